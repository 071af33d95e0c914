"""Run time against error, comparison with others, scaling: the tables of the benchmark.

They hold run times, so they differ from run to run; results never depend on them.
"""

import math

from knitsim.benchmark import elastica as benchmark_elastica
from knitsim.benchmark import scaling as benchmark_scaling
from knitsim.benchmark.fabric import friction_tasks, frictionless_tasks
from knitsim.benchmark.front import (
    NOISE,
    TARGETS,
    beaten_by,
    cheapest,
    front,
    measure,
    together,
)
from knitsim.benchmark.yarn import kinematic_tasks, yarn_tasks
from knitsim.stages.tables import PAPER_TIMES
from knitsim.store.timing import machine, write_csv

ERROR_COLUMNS = (
    "solver", "test", "quantity", "setting", "default", "seconds", "repeats", "error",
    "reference_error", "on_front", "beaten_by", "cheapest_for", "note", "machine",
)  # fmt: skip
BOUGHT_COLUMNS = ("solver", "test", "quantity", "asked", "setting", "error", "seconds", "note")
COMPARED_COLUMNS = (
    "scene", "solver", "target", "seconds", "error", "settings", "times_slower", "machine",
)  # fmt: skip
SCALING_COLUMNS = (
    "task", "size", "unit", "cores", "seconds", "memory_MB", "time_exponent", "memory_exponent",
    "note", "machine",
)  # fmt: skip
PHASE_COLUMNS = ("task", "phase", "seconds", "share", "note", "machine")

ALL_FABRIC = "relaxing, course, wale, both bendings"
NOT_REACHED = "not reached"
# How often a setting runs, and seconds after which it does not run again.
QUICK_REPEATS, QUICK_BUDGET = 3, 0.02
FULL_REPEATS, FULL_BUDGET = 15, 0.5


def percent(target):
    """A target in words: 0.01 is ``1 %``."""
    return f"{100.0 * target:g} %"


def measure_all(full):
    """Outcomes of all tasks: (frictionless ones of the equilibrium solver, the others)."""
    runs = (FULL_REPEATS, FULL_BUDGET) if full else (QUICK_REPEATS, QUICK_BUDGET)
    fabric = [measure(task, *runs) for task in frictionless_tasks(full)]
    others = [*friction_tasks(full), *yarn_tasks(full), *kinematic_tasks(full)]
    return fabric, [measure(task, *runs) for task in others]


def _curves(outcome):
    """(quantity, seconds, errors, bound of the reference's error) of each quantity."""
    seconds = [one.seconds for one in outcome.measured]
    for q, quantity in enumerate(outcome.task.quantities):
        errors = [one.errors[q] for one in outcome.measured]
        yield quantity, seconds, errors, outcome.reference_errors[q]


def _number(value, digits=4):
    return f"{value:.{digits}g}" if math.isfinite(value) else ""


def error_rows(outcomes):
    """Rows by ERROR_COLUMNS: every setting of every task and quantity."""
    rows = []
    for outcome in outcomes:
        task = outcome.task
        for quantity, seconds, errors, bound in _curves(outcome):
            on = front(seconds, errors)
            buys = {}
            for target in TARGETS:
                best = cheapest(seconds, errors, target)
                if best is not None:
                    buys.setdefault(best, []).append(percent(target))
            for i, one in enumerate(outcome.measured):
                better = None
                if one.setting.default:
                    better = beaten_by(seconds, errors, i)
                rows.append((
                    task.solver, task.test, quantity, one.setting.name,
                    "yes" if one.setting.default else "", _number(one.seconds), one.repeats,
                    _number(errors[i], 3), _number(bound, 3), "yes" if on[i] else "",
                    "" if better is None else outcome.measured[better].setting.name,
                    "; ".join(buys.get(i, [])), one.reason, machine(),
                ))  # fmt: skip
    return rows


def standing(outcome, seconds, errors, which):
    """In words, whether the setting ``which`` is on the front, and by how much it is off."""
    better = beaten_by(seconds, errors, which, noise=0.0)
    if better is None:
        return "on the front"
    saved = 1.0 - seconds[better] / seconds[which]
    where = "off the front" if saved > NOISE else "on the front within the noise of run times"
    name = outcome.measured[better].setting.name
    return f"{where}: {name} is as exact in {percent(round(saved, 2))} less time"


def bought_rows(fabric, others):
    """Rows by BOUGHT_COLUMNS: what the default buys, and the cheapest setting for each target.

    At the end, what one setting for all frictionless fabric tests costs together.
    """
    rows = []
    for outcome in (*fabric, *others):
        task = outcome.task
        for quantity, seconds, errors, bound in _curves(outcome):
            about = (task.solver, task.test, quantity)

            def row(asked, i, note="", about=about, outcome=outcome, errors=errors):
                if i is None:
                    return (*about, asked, NOT_REACHED, "", "", note)
                one = outcome.measured[i]
                return (
                    *about, asked, one.setting.name, _number(errors[i], 3), _number(one.seconds),
                    note,
                )  # fmt: skip

            for i, one in enumerate(outcome.measured):
                if one.setting.default:
                    rows.append(row("default", i, standing(outcome, seconds, errors, i)))
            for target in TARGETS:
                note = ""
                if target < bound:
                    note = f"below what the reference is known to, {bound:.1g}"
                rows.append(row(percent(target), cheapest(seconds, errors, target), note))
    own = [one for outcome in fabric for one in outcome.measured if one.setting.default]
    rows.append((
        "equilibrium", ALL_FABRIC, "all", "default", own[0].setting.name,
        _number(max(error for one in own for error in one.errors), 3),
        _number(sum(one.seconds for one in own)), "the largest error, frictionless",
    ))  # fmt: skip
    for target in TARGETS:
        best = together(fabric, target)
        name, seconds = (NOT_REACHED, "") if best is None else (best[0], _number(best[1]))
        rows.append((
            "equilibrium", ALL_FABRIC, "all", percent(target), name, "", seconds,
            "one setting for all, frictionless",
        ))  # fmt: skip
    return rows


def run_errors(full, errors_path, bought_path):
    """Measure run time against error and write both tables."""
    fabric, others = measure_all(full)
    write_csv(errors_path, ERROR_COLUMNS, error_rows([*fabric, *others]))
    write_csv(bought_path, BOUGHT_COLUMNS, bought_rows(fabric, others))


def comparison_rows():
    """Rows by COMPARED_COLUMNS: this solver and PyElastica to each target, then the paper's times.

    Without PyElastica one row says so.
    """
    rows = []
    version = benchmark_elastica.version()
    if version is None:
        rows.append((
            "all", "PyElastica", "", "", "",
            "not compared: not installed; pip install 'knitsim[compare]'", "", machine(),
        ))  # fmt: skip
    else:
        best = {}
        for one in benchmark_elastica.compare():
            own = best.setdefault((one.scene, one.target), one.seconds)
            solver = f"PyElastica {version}" if one.solver != "knitsim" else one.solver
            rows.append((
                one.scene, solver, f"{one.target:g}", _number(one.seconds), _number(one.error, 3),
                one.settings, _number(one.seconds / own, 3), machine(),
            ))  # fmt: skip
    for (stage, direction), seconds in PAPER_TIMES.items():
        rows.append((
            f"{stage.replace('_', ' ')}, {direction}", "the paper, its own computer", "",
            f"{seconds:g}", "", "as reported, kinematic model; for reference only", "", "",
        ))  # fmt: skip
    return rows


def scaling_rows(full=True):
    """Rows by SCALING_COLUMNS of all tasks that one process runs."""
    rows = []
    for growth in benchmark_scaling.growths(full):
        points, time, memory = benchmark_scaling.grow(growth)
        for point in points:
            rows.append((
                growth.name, point.size, growth.unit, 1, _number(point.seconds),
                _number(point.memory / 1e6, 3), _number(time, 3), _number(memory, 3), point.reason,
                machine(),
            ))  # fmt: skip
    return rows


def phase_rows(more=()):
    """Rows by PHASE_COLUMNS; more: (phase, seconds, note) of what was measured elsewhere."""
    spent, total, iterations = benchmark_scaling.phases()
    task = "course tension, 30 states, frictionless"
    rows = [
        (task, phase, _number(seconds), _number(seconds / total, 3), "", machine())
        for phase, seconds in spent.items()
    ]
    rows.append((task, "all", _number(total), "1", f"{iterations} iterations", machine()))
    for phase, seconds, note in more:
        rows.append((task, phase, _number(seconds), _number(seconds / total, 3), note, machine()))
    return rows

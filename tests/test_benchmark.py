"""Run time against error: the fronts and tables, the tasks, growth with size, and others' answers."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from knitsim.benchmark import elastica as benchmark_elastica
from knitsim.benchmark import fabric as benchmark_fabric
from knitsim.benchmark import scaling as benchmark_scaling
from knitsim.benchmark import yarn
from knitsim.benchmark.exact import lifted_end
from knitsim.benchmark.fabric import COTTON, DEFAULT, Knobs
from knitsim.benchmark.front import (
    Measured,
    Outcome,
    Setting,
    Task,
    beaten_by,
    cheapest,
    cpu_time,
    exponent,
    front,
    measure,
    together,
)
from knitsim.equilibrium import bend as bending
from knitsim.equilibrium import model
from knitsim.equilibrium import pull as tension
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError
from knitsim.figures import style
from knitsim.figures.benchmark import read, run_time_against_error
from knitsim.stages import benchmark as stage
from knitsim.stages import benchmark_runs
from knitsim.store.timing import write_csv


def test_the_front_is_what_no_other_beats():
    random = np.random.default_rng(7)
    seconds, errors = random.integers(1, 12, 60).astype(float), random.integers(1, 12, 60) / 100.0
    seconds[5], errors[9] = np.nan, np.nan
    on = front(seconds, errors)
    for i in range(60):
        beats = [
            k for k in range(60)
            if seconds[k] <= seconds[i] and errors[k] <= errors[i]
            and (seconds[k] < seconds[i] or errors[k] < errors[i])
        ]  # fmt: skip
        known = math.isfinite(seconds[i]) and math.isfinite(errors[i])
        assert on[i] == (known and not beats)


def test_cheapest_and_beaten_by():
    seconds, errors = [1.0, 2.0, 4.0, math.nan], [0.1, 0.01, 0.02, 0.0]
    assert cheapest(seconds, errors, 0.1) == 0
    assert cheapest(seconds, errors, 0.02) == 1
    assert cheapest(seconds, errors, 1e-3) is None
    assert beaten_by(seconds, errors, 2) == 1
    assert beaten_by(seconds, errors, 1) is None
    # A setting that is faster by noise alone beats nothing.
    assert beaten_by([1.0, 0.9], [0.1, 0.1], 0) is None


def test_exponent_of_a_power_law():
    size = np.array([1.0, 3.0, 10.0, 40.0])
    cost = 2.0 * size**1.5
    cost[1] = np.nan
    assert exponent(size, cost) == pytest.approx(1.5, abs=1e-12)
    assert math.isnan(exponent(size[:1], cost[:1]))


def test_cpu_time_stops_at_its_budget():
    calls = []
    result, seconds, runs = cpu_time(lambda: calls.append(1) or len(calls), 5)
    assert (result, runs, len(calls)) == (5, 5, 5) and seconds >= 0.0
    assert cpu_time(lambda: sum(range(1000)), 50, budget=0.0)[2] == 1


def refuse():
    raise ComputationError("no equilibrium")


def a_task():
    """Answers 1 + error; the reference is 1."""
    settings = (
        Setting("coarse", lambda: 1.2), Setting("own", lambda: 1.02, True),
        Setting("fine", lambda: 1.0005), Setting("none", refuse),
    )  # fmt: skip
    return Task(
        "solver", "test", ("answer",), settings, lambda: 1.0, lambda: 1.0001,
        lambda answer, reference: (abs(answer / reference - 1.0),),
    )  # fmt: skip


def test_measuring_a_task_and_its_tables():
    outcome = measure(a_task())
    assert [m.errors[0] for m in outcome.measured[:3]] == pytest.approx([0.2, 0.02, 5e-4])
    assert outcome.reference_errors == pytest.approx((1e-4,))
    failed = outcome.measured[3]
    assert math.isnan(failed.seconds) and failed.reason == "no equilibrium"

    seconds = (1.0, 2.0, 3.0, math.nan)
    fixed = replace(
        outcome,
        measured=tuple(
            replace(m, seconds=s) for m, s in zip(outcome.measured, seconds, strict=True)
        ),
    )
    rows = [dict(zip(stage.ERROR_COLUMNS, row, strict=True)) for row in stage.error_rows([fixed])]
    assert [row["on_front"] for row in rows] == ["yes", "yes", "yes", ""]
    assert [row["cheapest_for"] for row in rows] == ["", "10 %", "1 %; 0.1 %", ""]
    bought = stage.bought_rows([fixed], [])
    assert [row[3:5] for row in bought] == [
        ("default", "own"), ("10 %", "own"), ("1 %", "fine"), ("0.1 %", "fine"),
        ("0.01 %", stage.NOT_REACHED), ("default", "own"), ("10 %", "own"), ("1 %", "fine"),
        ("0.1 %", "fine"), ("0.01 %", stage.NOT_REACHED),
    ]  # fmt: skip
    assert bought[5][5:7] == ("0.02", "2") and bought[0][7] == "on the front"


@pytest.mark.parametrize(
    ("fine", "words"),
    [
        (2.5, "on the front"),
        (1.8, "on the front within the noise of run times: fine is as exact in 10 % less time"),
        (1.0, "off the front: fine is as exact in 50 % less time"),
    ],
)
def test_the_default_says_where_it_stands(fine, words):
    outcome = measure(a_task())
    seconds, errors = [1.0, 2.0, fine, math.nan], [0.2, 0.02, 5e-4, math.nan]
    assert stage.standing(outcome, seconds, errors, 1) == words


def test_together_takes_one_setting_for_all():
    def outcome(*rows):
        measured = tuple(Measured(Setting(n, None), s, 1, e) for n, s, e in rows)
        return Outcome(None, measured, ())

    first = outcome(("a", 1.0, (0.1,)), ("b", 2.0, (0.01,)), ("c", 1.5, (0.01,)))
    second = outcome(("b", 1.0, (0.01, 0.001)), ("c", 0.1, (0.01, 0.2)))
    assert together([first, second], 0.05) == ("b", 3.0)
    assert together([first, second], 1e-4) is None


def test_settings_that_are_constants_are_set_back():
    before = model.TOLERANCE, tension.INCREMENT, bending.INCREMENT
    with benchmark_fabric._set(Knobs(tolerance=1.0, step=2.0, arc=3.0)):
        assert (1.0, 2.0, 3.0) == (model.TOLERANCE, tension.INCREMENT, bending.INCREMENT)
    assert before == (model.TOLERANCE, tension.INCREMENT, bending.INCREMENT)


@pytest.mark.parametrize("full", [False, True])
def test_each_setting_is_tried_once_and_the_default_is_what_a_user_gets(full):
    assert Resolution() == DEFAULT.resolution
    tasks = [*benchmark_fabric.frictionless_tasks(full), *benchmark_fabric.friction_tasks(full)]
    for task in (*tasks, *yarn.yarn_tasks(full), *yarn.kinematic_tasks(full)):
        names = [setting.name for setting in task.settings]
        assert len(set(names)) == len(names)
        assert [setting.default for setting in task.settings].count(True) == 1


@pytest.mark.parametrize("knobs", [Knobs(24, 160), Knobs(40, 160), DEFAULT])
def test_a_setting_is_solved_with_the_points_that_it_names(knobs):
    """More contact points are taken where those asked for do not do: such a setting has no place here."""
    runs = benchmark_fabric._Runs()
    solved = [runs.relaxing(knobs)]
    for direction in ("course", "wale"):
        solved += [runs.pulled(knobs, direction), runs.bent(knobs, direction)]
    for one in solved:
        cell = one.model.cell
        assert knobs.name == f"{cell.points} points, {cell.contacts} contacts"
    assert not any(curve.stop_reason for curve in solved[1:])


def test_errors_of_a_curve_against_itself_and_against_another():
    relaxed = relax(COTTON)
    strains = 0.1 * np.arange(1, 4)
    curve = tensile(relaxed, "course", strains)
    assert benchmark_fabric.force_errors(curve, curve) == (0.0,)
    wrong = curve.replaced(force_per_loop=curve.force_per_loop * [1.0, 1.03, 1.01])
    assert benchmark_fabric.force_errors(wrong, curve)[0] == pytest.approx(0.03)
    stopped = curve.replaced(stop_reason="crossings lost")
    assert math.isnan(benchmark_fabric.force_errors(stopped, curve)[0])


def test_gauss_points_of_the_loop_are_those_asked_for(cotton_loop):
    coarse = yarn.with_gauss_points(cotton_loop, 3)
    pieces = cotton_loop.spline.knots.size - 1
    assert coarse.nodes.size == 3 * pieces and coarse.weights.sum() == pytest.approx(1.0)
    own = yarn.with_gauss_points(cotton_loop, cotton_loop.nodes.size // pieces)
    assert np.allclose(own.nodes, cotton_loop.nodes, rtol=0, atol=1e-15)
    assert np.allclose(own.weights, cotton_loop.weights, rtol=1e-12)


def test_yarn_error_falls_with_the_square_of_the_spacing():
    exact = yarn.pull_yarn(yarn.polyester(yarn.SPACING / 16.0), 20)
    coarse, fine = (
        yarn.yarn_errors(yarn.pull_yarn(yarn.polyester(s), 20), exact)[0] for s in (2e-4, 1e-4)
    )
    assert coarse / fine == pytest.approx(4.0, rel=0.05)


def test_growth_leaves_out_what_takes_too_long():
    def run(size):
        return sum(range(20_000 * size))

    growth = benchmark_scaling.Growth("sum", "terms", (1, 2, 10**9), run)
    points, _, _ = benchmark_scaling.grow(growth, 1, most=5.0)
    assert all(math.isfinite(p.seconds) for p in points[:2])
    assert math.isnan(points[2].seconds) and "left out" in points[2].reason


def test_a_disturbed_cell_finds_back_to_rest():
    relaxed = relax(benchmark_fabric.COTTON, Resolution(24, 192, "full"))
    model, start = benchmark_scaling.disturbed(relaxed)
    assert start[model.lattice] == pytest.approx(1.001 * relaxed.wale_spacing, rel=1e-12)
    again = benchmark_scaling.relax_again((model, start))
    assert again.iterations > 0
    assert again.wale_spacing == pytest.approx(relaxed.wale_spacing, rel=1e-4)
    assert again.energy.sum() == pytest.approx(relaxed.energy.sum(), rel=1e-8)


def test_phases_of_a_test_make_up_its_time():
    spent, total, iterations = benchmark_scaling.phases(repeats=1, states=1)
    assert set(spent) == {"contact search", "assembly", "solve", "other"}
    assert sum(spent.values()) >= total * (1.0 - 1e-9) > 0.0
    assert iterations >= 30  # one a state, at least


def test_the_smallest_size_of_every_task_is_solved():
    for growth in benchmark_scaling.growths(True):
        growth.run(growth.prepare(growth.sizes[0]))


def test_a_curve_is_written_to_time_it():
    assert benchmark_runs.files(repeats=1) > 0.0


def test_memory_of_an_array():
    _, bytes_ = benchmark_scaling.peak_memory(lambda: np.ones(8_000_000).sum())
    if math.isnan(bytes_):
        pytest.skip("this system does not tell a process its memory")
    assert 60e6 < bytes_ < 90e6


def test_lifted_rod_by_shooting():
    """The same state by integrating EI theta'' = -force cos(angle - theta) along the rod."""
    along, below, radius = 0.5, 0.1, 0.2
    x, y = lifted_end(along, below, radius)
    # By the exact code's free end: the straight part points from the contact to it.  Find where it
    # touches the cylinder, and shoot from there back to the clamp.
    from_axis = np.array([x - along, y + below])
    reach = math.sqrt(from_axis @ from_axis - radius**2)
    angle = math.atan2(from_axis[1], from_axis[0]) - math.asin(radius / np.hypot(*from_axis))
    touch = np.array([x, y]) - reach * np.array([math.cos(angle), math.sin(angle)])
    assert np.hypot(*(touch - [along, -below])) == pytest.approx(radius, rel=1e-9)
    length = 1.0 - reach

    def back(force):
        def slope(s, state):
            theta, bend = state[2:]
            return [
                -math.cos(theta), -math.sin(theta), -bend, force * math.cos(angle - theta),
            ]  # fmt: skip

        return solve_ivp(
            slope, (0.0, length), [*touch, angle, 0.0], rtol=1e-11, atol=1e-13
        ).y[:, -1]  # fmt: skip

    low, high = 0.1, 100.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if back(middle)[2] > 0.0 else (low, middle)
    end = back(0.5 * (low + high))
    assert np.abs(end[:3]).max() < 1e-8


def test_lifted_rod_of_small_lift():
    # Small slopes: the free end rises by (1 + 3 (1 - a)/(2 a)) times the lift.
    lift = 1e-5
    _, y = lifted_end(0.4, 0.1 - lift, 0.1)
    assert y / lift == pytest.approx(1.0 + 1.5 * 0.6 / 0.4, rel=1e-3)


@pytest.mark.slow
def test_own_solver_comes_to_the_exact_answers():
    assert benchmark_elastica.own_cantilever(40, 2) < 1e-4
    assert benchmark_elastica.own_lifted(80, 1) < 1e-3


def test_time_to_an_error_counts_from_where_it_stays():
    errors = iter([0.5, 0.009, 0.2, 0.008, 0.004, 0.0009, 0.0005])
    driven = benchmark_elastica.Driven(lambda: None, lambda: next(errors), 1.0)
    (to_percent, last), (to_thousandth, _) = benchmark_elastica.settle(driven, 7.0, looks=7)
    assert last == 0.0005 and 0.0 <= to_percent <= to_thousandth
    never = benchmark_elastica.Driven(lambda: None, lambda: math.nan, 1.0)
    assert math.isnan(benchmark_elastica.settle(never, 7.0, looks=7)[0][0])


def test_an_error_that_is_small_by_chance_buys_nothing():
    errors = {10: 1e-4, 20: 5e-3, 40: 2e-3, 80: 5e-4}
    best = benchmark_elastica._own(
        "scene", lambda elements, steps: errors[elements], ((10, 1), (20, 1), (40, 1), (80, 1))
    )
    assert best[1].settings.startswith("80 elements") and best[1].error == 5e-4
    assert best[0].error in (5e-3, 2e-3, 5e-4)


def test_a_target_that_none_reaches_names_what_came_closest():
    tried = [(3.0, 0.2, "coarse"), (math.nan, 0.02, "fine"), (1.0, 0.1, "fast")]
    assert benchmark_elastica._best("scene", "other", 0.1, tried).settings == "fast"
    missed = benchmark_elastica._best("scene", "other", 0.01, tried)
    assert math.isnan(missed.seconds) and missed.error == 0.02
    assert missed.settings == "not reached; closest: fine"


def test_without_pyelastica_the_table_says_so(monkeypatch):
    monkeypatch.setattr(benchmark_elastica, "version", lambda: None)
    rows = stage.comparison_rows()
    assert "not installed" in rows[0][5]
    assert {row[1] for row in rows[1:]} == {"the paper, its own computer"}


def test_the_figure_draws_fronts_and_defaults(tmp_path):
    outcome = measure(a_task())
    rows = []
    for solver, test in (
        ("equilibrium", "relaxing"), ("equilibrium", "course tension"),
        ("equilibrium", "wale tension with friction"), ("equilibrium", "course bending"),
        ("yarn", "tensile test"), ("kinematic", "course tension"),
    ):  # fmt: skip
        named = replace(outcome, task=replace(outcome.task, solver=solver, test=test))
        rows += stage.error_rows([named])
    write_csv(tmp_path / "errors.csv", stage.ERROR_COLUMNS, rows)
    table = read(tmp_path / "errors.csv")
    with style.context():
        fig = run_time_against_error(table)
    for ax in fig.axes:
        line = next(one for one in ax.lines if one.get_gid() == "answer")
        own = [r for r in table[:4] if r["on_front"] == "yes"]
        assert sorted(line.get_ydata()) == pytest.approx(sorted(float(r["error"]) for r in own))
        stars = [one for one in ax.lines if one.get_marker() == "*"]
        assert [float(s.get_ydata()[0]) for s in stars] == pytest.approx([0.02])


def test_run_of_the_quick_tables_writes_what_the_columns_name(tmp_path, monkeypatch):
    outcome = measure(a_task())
    monkeypatch.setattr(stage, "measure_all", lambda full: ([outcome], []))
    stage.run_errors(False, tmp_path / "e.csv", tmp_path / "b.csv")
    with (tmp_path / "b.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert rows[0]["asked"] == "default" and rows[-1]["test"] == stage.ALL_FABRIC

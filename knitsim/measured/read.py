"""A measured test from the files in which machines and Excel write it.

>>> from pathlib import Path
>>> from tempfile import TemporaryDirectory
>>> lines = ["Gauge length;100,0;mm", "Breite;50;mm", "", "Zeit;Weg;Standardkraft", "s;mm;N"]
>>> lines += ["0;0,0;0,00", "1;5,0;0,10", "2;10,0;0,35", "3;15,0;0,90", "4;20,0;2,00"]
>>> with TemporaryDirectory() as folder:
...     path = Path(folder) / "wale.csv"
...     _ = path.write_text("\\n".join(lines))
...     read_measured(path, direction="wale")
<MeasuredTest wale: tension along the wale, 5 points to 20 %, 0.04 N/mm>

What is recognised, left out and done to the numbers stands in the result; where a file leaves something
open, one line says which key to state.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from knitsim.errors import InputError
from knitsim.measured import corrected
from knitsim.measured import course as course_
from knitsim.measured.answers import Answers
from knitsim.measured.columns import columns_of
from knitsim.measured.names import CONDITIONS, heading
from knitsim.measured.test import KINDS, LOADING, RECOVERY, MeasuredTest, mean_of
from knitsim.store.sheet import read_sheets
from knitsim.units import from_si

# Keys of a study that answer what a file leaves open, as keywords of read_measured.
ANSWERS = (
    "columns",
    "unit",
    "skip",
    "decimal_sign",
    "sheet",
    "cycle",
    "zero",
    "slack",
    *CONDITIONS,
)
ZEROS, SLACKS = ("keep", "start", "tail"), ("find", "keep", "start")
LEAST_POINTS = {"tension": 4, "bending": 4, "yarn_tension": 8, "yarn_compression": 4}


def read_measured(
    paths, kind=None, direction="", *, name=None, columns=None, unit=None, skip=None, decimal_sign=None,
    sheet=None, cycle=None, zero=None, slack=None, rigidity=None, **conditions,
):  # fmt: skip
    """The :class:`~knitsim.measured.test.MeasuredTest` in a file, or of the specimens of several.

    paths: of a text file as a machine or Excel writes it, in any encoding, delimiter and decimal sign, or
    of an .xlsx workbook; of several files, each of one specimen, a list.  kind: tension or bending of a
    fabric, yarn_tension, yarn_compression; without it, what the columns show.  direction: course or
    wale, pulled or becoming curved, which a fit needs.  name: in messages and results, the file's own without it.

    What answers a question: columns {"extension_mm": heading or number of the column}; unit {quantity or
    heading: unit}; skip: number of first lines to pass over, or a list of lines; decimal_sign: "comma" or
    "point"; sheet: of a workbook; cycle: of a test of several (the first without it), or which one the
    file holds; zero: of the force, "keep" as it stands, "start" or "tail" for what is read before the
    test or after the break; slack: "find", "keep" the strain as it stands, or count it from the "start",
    the first point.  conditions: gauge_length, width (m), pretension (N/m, of a yarn N),
    machine_compliance (m/N), linear_density (kg/m), or with the unit at the end of the name,
    ``gauge_length_mm``; they come before those of the file.  rigidity (N m): of the yarns side by side in
    the fabric, with which a bending test is compared.

    Strain counts from no force, or from the pretension.  Slack, holds and what follows a break are left
    out, the extension of the machine is subtracted.  Raises InputError with file, line, value and what is
    right for a file that makes no sense or can be read in several ways.
    """
    paths = [paths] if isinstance(paths, (str, Path)) else list(paths)
    if kind is not None and kind not in KINDS:
        raise InputError("kind", kind, f"must be {' or '.join(KINDS)}")
    if not paths:
        raise InputError("measured files", "[]", "must be one or more")
    for key, value, known in (("zero", zero, ZEROS), ("slack", slack, SLACKS)):
        if value is not None and value not in known:
            raise InputError(f"{paths[0]}: {key}", value, f"must be {' or '.join(known)}")
    stated = _conditions(str(paths[0]), conditions)
    found = []
    for path in paths:
        answers = Answers(str(path), columns, unit, skip, decimal_sign, stated)
        for one in _specimens_of(path, kind, answers, sheet, direction):
            found.append(
                _test(one, direction, cycle, zero, slack or "find", rigidity, stated, answers)
            )
    source = ", ".join(dict.fromkeys(Path(path).name for path in paths))
    name = name or Path(paths[0]).stem
    if len(found) == 1:
        return replace(
            found[0], name=name, source=source, cycles=_named(found[0].cycles, name, source)
        )
    return mean_of(
        [replace(one, name=f"{name} {k}", source=source) for k, one in enumerate(found, 1)],
        name,
        source,
    )


def read_entry(entry, paths, kind, **more):
    """The MeasuredTest of a section of a study, {key: SI value}, that names its file and answers questions.

    more: keywords of :func:`read_measured` beside those of the entry.
    """
    stated = {key: entry[key] for key in ANSWERS if entry.get(key) is not None}
    return read_measured(paths, kind, entry.get("direction", ""), **(stated | more))


def measured_test(fabric, name):
    """The MeasuredTest ``name`` of a fabric of a study, a knitsim.study.study.FabricInput."""
    entry = fabric["measured"][name]
    # Yarns side by side: one along each course, two legs along each wale.
    yarns = {"course": 1.0 / fabric["course_spacing"], "wale": 2.0 / fabric["wale_spacing"]}
    rigidity = fabric.yarn["bending_rigidity"] * yarns[entry["direction"]]
    return read_entry(
        entry, fabric.measured_paths(name), entry["test"], name=name, rigidity=rigidity
    )


def _named(cycles, name, source):
    return tuple(replace(one, name=f"{name}, cycle {one.cycle}", source=source) for one in cycles)


def _conditions(where, given):
    """{name: SI value} of keywords that are names of conditions, with or without a unit at their end."""
    found = {}
    for key, value in given.items():
        if value is None:
            continue
        one = heading(key)
        if key in CONDITIONS:
            found[key] = value
        elif one.condition and one.unit is not None and one.unit.factor == one.unit.factor:
            found[one.condition] = value * one.unit.factor
        else:
            raise InputError(
                f"{where}: {key}", value, f"is not known; known are {', '.join(ANSWERS)}"
            )
    return found


def _specimens_of(path, kind, answers, sheet, direction):
    """The Columns of each specimen in a file: of one sheet, or of several that hold the same columns."""
    where = str(path)
    sheets = read_sheets(path, where)
    if sheet is not None:
        sheets = [one for one in sheets if one.name == str(sheet)]
        if not sheets:
            raise InputError(f"{where}: sheet", repr(sheet), "is no sheet of the file")
    if len(sheets) == 1:
        return _parts(columns_of(sheets[0], where, kind, answers, bool(direction)))
    found, failed = {}, None
    for one in sheets:
        try:
            found[one.name] = columns_of(
                one, f"{where}: {one.name}", kind, answers, bool(direction)
            )
        except InputError as error:
            failed = failed or error
    if not found:
        raise failed
    if len(found) > 1:
        heads = {
            tuple(columns[0].written[q][0] for q in columns[0].written)
            for columns in found.values()
        }
        if len(heads) > 1:
            raise InputError(
                where, f"sheets {', '.join(found)}", "hold different curves: state sheet"
            )
    return [part for columns in found.values() for part in _parts(columns)]


def _parts(columns):
    """Columns split where another specimen begins."""
    found = []
    for one in columns:
        edges = [0, *(row for row, what in one.breaks if what == "specimen"), len(one.lines)]
        for number, (first, end) in enumerate(zip(edges, edges[1:], strict=False), start=1):
            part = one.part(first, end) if len(edges) > 2 else one
            if len(edges) > 2:
                part.recognised = [*one.recognised, f"specimen {number} of {len(edges) - 1}"]
            found.append(part)
    return found


def _test(columns, direction, cycle, zero, slack, rigidity, stated, answers):
    """The MeasuredTest of the Columns of one specimen."""
    n, least = len(columns.lines), LEAST_POINTS[columns.kind]
    if n < least:
        last = int(columns.lines[-1]) if n else 1
        raise InputError(
            f"{columns.where}:{last}",
            None,
            f"the curve has {n} points, at least {least} are needed",
        )
    if columns.kind.startswith("yarn_"):
        direction = ""
    common = {
        "kind": columns.kind, "direction": direction, "comments": columns.comments,
        "conditions": {k: v for k, v in columns.conditions.items() if k not in ("pretension", "decimal_sign")},
    }  # fmt: skip
    if columns.kind == "yarn_compression":
        for quantity in ("thickness", "force"):
            bad = columns.values[quantity] < -course_.NOISE * np.abs(columns.values[quantity]).max()
            if bad.any():
                raise columns.refused(quantity, int(np.argmax(bad)), "must not be negative")
        left_out = _left_out(columns, [])
        return MeasuredTest(
            values=columns.values, recognised=tuple(columns.recognised), left_out=left_out, **common
        )
    if columns.kind == "bending":
        return _bending(columns, cycle, zero, rigidity, answers, common)
    corrected.refuse_strain(columns, columns.units.get("strain"), answers.states("strain"))
    corrected.refuse_force(columns, answers.states("force"))
    return _tension(columns, cycle, zero, slack, common)


def _left_out(columns, more):
    """(first line, last line, why) of the rows of numbers in ``more`` [(points, why)] and of others."""
    found = list(columns.left_out)
    for points, why in more:
        points = np.sort(points)
        for run in np.split(points, np.flatnonzero(np.diff(points) > 1) + 1):
            if len(run):
                found.append((int(columns.lines[run[0]]), int(columns.lines[run[-1]]), why))
    return tuple(sorted(found))


def _cycle_number(columns, cycles, cycle, what):
    """Number of the cycle of the file that is meant, from 0, and of the test, from 1."""
    wanted = cycle or 1
    if len(cycles) == 1 and columns.kind == "bending":
        return 0, wanted
    if wanted > len(cycles):
        raise InputError(
            f"{columns.where}: cycle",
            wanted,
            f"must be at most {len(cycles)}, the {what} of the file",
        )
    return wanted - 1, wanted


def _tension(columns, cycle, zero, slack, common):
    x, y = (
        columns.values["strain"],
        next(columns.values[q] for q in ("force_per_width", "force") if q in columns.values),
    )
    fabric = columns.kind == "tension"
    course = course_.course_of(columns, x, y)
    first = course.cycles[0]
    y, corrections, pretension = corrected.without_zero(columns, course, x, y, zero, fabric)
    if fabric:
        for one in course.cycles:
            course_.refuse_disorder(columns, one, x, y)
    columns.values["force_per_width" if fabric else "force"] = y
    x, more = corrected.without_machine(columns, x, y, first)
    corrections += more
    if more and fabric:
        for one in course.cycles:
            course_.refuse_disorder(columns, one, x, y)
    tests, slack_rows = [], []
    for number, one in enumerate(course.cycles, start=1):
        test, out = _one_cycle(
            columns, one, number, x, y, pretension, slack, corrections, common, course
        )
        tests.append(test)
        slack_rows.append(out)
    own, of_test = _cycle_number(columns, tests, cycle, "cycles")
    left_out = [*course.left_out, *slack_rows[own]]
    left_out += [
        (np.concatenate([one.loading, one.recovery]), f"cycle {k}")
        for k, one in enumerate(course.cycles, start=1) if k - 1 != own
    ]  # fmt: skip
    return replace(
        tests[own], cycle=of_test, cycles=tuple(tests) if len(tests) > 1 else (),
        left_out=_left_out(columns, left_out),
    )  # fmt: skip


def _one_cycle(columns, one, number, x, y, pretension, slack, corrections, common, course):
    fabric = columns.kind == "tension"
    rows = np.concatenate([one.loading, one.recovery])
    phase = np.repeat([LOADING, RECOVERY], [len(one.loading), len(one.recovery)])
    if not fabric:
        # The law of a yarn is that of its loading; noise of the strain may not go back.
        rows, phase = one.loading, phase[: len(one.loading)]
        order = np.argsort(x[rows], kind="stable")
        rows = rows[order]
    beside = [q for q in columns.values if q not in ("strain", "force", "force_per_width")]
    values = {"strain": x, ("force_per_width" if fabric else "force"): y}
    values |= {q: columns.values[q] for q in beside}
    test = MeasuredTest(
        values={q: v[rows] for q, v in values.items()}, phase=phase, cycle=number,
        broke_below=float(x[course.tail[0]]) if one.broke and course.tail.size else np.inf,
        pretension=pretension or 0.0, corrections=tuple(corrections), recognised=tuple(columns.recognised),
        **common,
    )  # fmt: skip
    if not fabric:
        return replace(test, pretension=0.0), [
            (one.recovery, "recovery")
        ] if one.recovery.size else []
    if pretension:
        found, keep, why = corrected.from_pretension(columns, test)
    else:
        found, keep, why = corrected.without_slack(test, one, x, y, slack)
    return found, [] if keep.all() else [(rows[~keep], why)]


def _bending(columns, cycle, zero, rigidity, answers, common):
    curvature, moment = columns.values["curvature"], columns.values["moment_per_width"]
    corrected.refuse_bending(columns, curvature, moment, rigidity, answers.states("moment"))
    cycles = course_.bending_cycles(columns, curvature, moment)
    flat = course_.moment_when_flat(curvature[cycles[0]], moment[cycles[0]])
    largest = float(np.abs(moment).max())
    corrections, recognised = [], list(columns.recognised)
    if zero in ("start", "tail"):
        if not np.isfinite(flat):
            raise InputError(
                f"{columns.where}: zero", zero, "the test does not pass the flat fabric"
            )
        moment = moment - flat
        corrections.append(f"moment at no curvature taken off: {from_si(flat, 'mN'):.4g} mN")
    elif zero is None and abs(flat) > course_.NOISE * largest:
        recognised.append(
            f"moment of the flat fabric {from_si(flat, 'mN'):.4g} mN, mean of both ways: curl, or an offset of "
            "the torque cell, which the file cannot tell apart; it is kept, and only the change of moment "
            "from flat is compared (zero: start takes it off)"
        )
    tests = [
        MeasuredTest(
            values={"curvature": curvature[rows], "moment_per_width": moment[rows]}, cycle=number,
            recognised=tuple(recognised), corrections=tuple(corrections), **common,
        )
        for number, rows in enumerate(cycles, start=1)
    ]  # fmt: skip
    own, of_test = _cycle_number(columns, tests, cycle, "cycles")
    others = [(rows, f"cycle {k}") for k, rows in enumerate(cycles, start=1) if k - 1 != own]
    used = np.zeros(len(curvature), dtype=bool)
    used[np.concatenate(cycles)] = True
    others.append((np.flatnonzero(~used), "a hold, at which the curvature stands still"))
    return replace(
        tests[own],
        cycle=of_test,
        cycles=tuple(tests) if len(tests) > 1 else (),
        left_out=_left_out(columns, others),
    )

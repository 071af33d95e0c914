"""A measured test from the files in which machines and Excel write it.

>>> from pathlib import Path
>>> from tempfile import TemporaryDirectory
>>> lines = ["Gauge length;100,0;mm", "Breite;50;mm", "", "Zeit;Weg;Standardkraft", "s;mm;N"]
>>> lines += ["0;0,0;0,00", "1;5,0;0,10", "2;10,0;0,35", "3;15,0;0,90", "4;20,0;2,00"]
>>> with TemporaryDirectory() as folder:
...     path = Path(folder) / "wale.csv"
...     _ = path.write_text("\\n".join(lines))
...     curve = read_measured(path, direction="wale")
>>> curve
<MeasuredTest wale: tension along the wale, 5 points to 20 %, 0.04 N/mm>
>>> curve.plot().get_ylabel()
'Force per width (gf/cm)'

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
from knitsim.measured.test import KINDS, MeasuredTest, mean_of
from knitsim.store.sheet import read_sheets

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
    wale, pulled or becoming curved, which a fit needs.  name: in messages and results, that of the file
    without it.

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
    if not paths:
        raise InputError("measured files", "[]", "must be one or more")
    for key, value, known in (
        ("kind", kind, KINDS),
        ("zero", zero, ZEROS),
        ("slack", slack, SLACKS),
    ):
        if value is not None and value not in known:
            raise InputError(f"{paths[0]}: {key}", value, f"must be {' or '.join(known)}")
    stated = _conditions(str(paths[0]), conditions)
    how = {"direction": direction, "cycle": cycle or 1, "zero": zero, "slack": slack or "find",
           "rigidity": rigidity}  # fmt: skip
    found, name = [], name or Path(paths[0]).stem
    for path in paths:
        answers = Answers(str(path), columns, unit, skip, decimal_sign, stated)
        for one in _specimens_of(path, kind, answers, sheet, bool(direction)):
            test = _test(one, answers, **how)
            found.append(replace(test, name=name, source=Path(path).name))
    if len(found) == 1:
        cycles = (replace(one, name=name, source=found[0].source) for one in found[0].cycles)
        return replace(found[0], cycles=tuple(cycles))
    source = ", ".join(dict.fromkeys(one.source for one in found))
    return mean_of(
        [replace(one, name=f"{name} {k}") for k, one in enumerate(found, 1)], name, source
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


def _conditions(where, given):
    """{name: SI value} of keywords that are names of conditions, with or without a unit at their end."""
    found = {}
    for key, value in given.items():
        if value is None:
            continue
        one = heading(key)
        if key in CONDITIONS:
            found[key] = value
        elif one.condition and one.unit is not None:
            found[one.condition] = one.unit.to_si(value)
        else:
            raise InputError(
                f"{where}: {key}", value, f"is not known; known are {', '.join(ANSWERS)}"
            )
    return found


def _specimens_of(path, kind, answers, sheet, fabric):
    """The Columns of each specimen in a file: of one sheet, or of several that hold the same columns."""
    where = str(path)
    sheets = read_sheets(path, where)
    if sheet is not None:
        sheets = [one for one in sheets if one.name == str(sheet)]
        if not sheets:
            raise InputError(f"{where}: sheet", repr(sheet), "is no sheet of the file")
    if len(sheets) == 1:
        return columns_of(sheets[0], where, kind, answers, fabric)
    found, failed = {}, []
    for one in sheets:
        try:
            found[one.name] = columns_of(one, f"{where}: {one.name}", kind, answers, fabric)
        except InputError as error:
            failed.append(error)
    if not found:
        raise failed[0]
    if len({tuple(name for name, _ in own[0].written.values()) for own in found.values()}) > 1:
        raise InputError(where, f"sheets {', '.join(found)}", "hold different curves: state sheet")
    return [one for own in found.values() for one in own]


def _test(columns, answers, direction, cycle, zero, slack, rigidity):
    """The MeasuredTest of the Columns of one specimen."""
    n, least = len(columns.lines), LEAST_POINTS[columns.kind]
    if n < least:
        at = f"{columns.where}:{columns.lines[-1] if n else columns.header_line}"
        raise InputError(at, None, f"the curve has {n} points, at least {least} are needed")
    common = {
        "kind": columns.kind, "direction": "" if columns.kind.startswith("yarn_") else direction,
        "comments": columns.comments, "recognised": tuple(columns.recognised),
        "conditions": {k: v for k, v in columns.conditions.items() if k != "pretension"},
    }  # fmt: skip
    if columns.kind == "yarn_compression":
        for quantity in KINDS[columns.kind]:
            values = columns.values[quantity]
            bad = values < -course_.NOISE * np.abs(values).max()
            if bad.any():
                raise columns.refused(quantity, int(np.argmax(bad)), "must not be negative")
        return MeasuredTest(values=columns.values, left_out=_left_out(columns, []), **common)
    if columns.kind == "bending":
        return _bending(columns, answers, cycle, zero, rigidity, common)
    corrected.refuse_strain(columns, columns.units.get("strain"), answers.states("strain"))
    corrected.refuse_force(columns, answers.states("force"))
    return _tension(columns, cycle, zero, slack, common)


def _chosen(columns, tests, cycle, left_out):
    """The test of the cycle that is asked for, with the rows of ``left_out`` and all cycles of several.

    left_out: [(points, why)] of every cycle and, last, of the whole test.
    """
    if len(tests) == 1 and columns.kind == "bending":
        number = 0  # the file holds one cycle, which is that one of the test
    elif cycle > len(tests):
        raise InputError(
            f"{columns.where}: cycle",
            cycle,
            f"must be at most {len(tests)}, the cycles of the file",
        )
    else:
        number = cycle - 1
    several = tuple(tests) if len(tests) > 1 else ()
    rows = _left_out(columns, [*left_out[number], *left_out[-1]])
    return replace(tests[number], cycle=cycle, cycles=several, left_out=rows)


def _left_out(columns, more):
    """(first line, last line, why) of the rows of numbers in ``more`` [(points, why)] and of others."""
    found = list(columns.left_out)
    for points, why in more:
        points = np.sort(points)
        for run in np.split(points, np.flatnonzero(np.diff(points) > 1) + 1):
            if len(run):
                found.append((int(columns.lines[run[0]]), int(columns.lines[run[-1]]), why))
    return tuple(sorted(found))


def _others(cycles, own):
    """[(points, why)] of the cycles (points each) that are not ``own``, but for points that it shares."""
    return [
        (np.setdiff1d(points, cycles[own]), f"cycle {k}")
        for k, points in enumerate(cycles, start=1) if k - 1 != own
    ]  # fmt: skip


def _tension(columns, cycle, zero, slack, common):
    """The test of a tension, corrected; strain of a yarn counts as it stands, for its law finds slack."""
    fabric = columns.kind == "tension"
    quantity = KINDS[columns.kind][1]
    x, y = columns.values["strain"], columns.values[quantity]
    course = course_.course_of(columns, x, y)
    begun = []
    if slack == "start":
        x, begun = corrected.from_first(columns, x, course.cycles[0].loading[0])
    y, done, pretension = corrected.without_zero(columns, course, x, y, zero)
    done = begun + done
    course_.refuse_disorder(columns, course, x, y)
    x, more = corrected.without_machine(columns, x, y, course.cycles[0])
    if more:
        course_.refuse_disorder(columns, course, x, y)
        done += more
    tests, left_out = [], []
    for number, one in enumerate(course.cycles):
        # Of a yarn loading counts, and what noise of its strain moves back stands where it belongs.
        rows = one.loading[np.argsort(x[one.loading], kind="stable")] if not fabric else one.points
        out = _others([c.points for c in course.cycles], number)
        out += [(one.recovery, "recovery")] if not fabric else []
        test = MeasuredTest(
            values={**{q: v[rows] for q, v in columns.values.items()}, "strain": x[rows], quantity: y[rows]},
            phase=np.isin(rows, one.recovery).astype(int), cycle=number + 1, corrections=tuple(done),
            broke_below=float(x[course.tail[0]]) if one.broke and course.tail.size else np.inf,
            pretension=pretension if fabric else 0.0, **common,
        )  # fmt: skip
        if fabric:
            test, keep, why = (
                corrected.from_pretension(columns, test) if pretension
                else corrected.without_slack(test, float(x[one.loading[0]]), slack)
            )  # fmt: skip
            out.append((rows[~keep], why))
        tests.append(test)
        left_out.append(out)
    return _chosen(columns, tests, cycle, [*left_out, course.left_out])


def _bending(columns, answers, cycle, zero, rigidity, common):
    curvature, moment = columns.values["curvature"], columns.values["moment_per_width"]
    corrected.refuse_bending(columns, curvature, moment, rigidity, answers.states("moment"))
    cycles = course_.bending_cycles(columns, curvature, moment)
    moment, done, said = corrected.without_offset(columns, curvature, moment, cycles[0], zero)
    common["recognised"] += tuple(said)
    tests = [
        MeasuredTest(
            values={"curvature": curvature[rows], "moment_per_width": moment[rows]}, cycle=number,
            corrections=tuple(done), **common,
        )
        for number, rows in enumerate(cycles, start=1)
    ]  # fmt: skip
    held = np.setdiff1d(np.arange(len(curvature)), np.concatenate(cycles))
    left_out = [_others(cycles, number) for number in range(len(cycles))]
    return _chosen(columns, tests, cycle, [*left_out, [(held, course_.HOLD)]])

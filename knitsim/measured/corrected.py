"""What is done to the numbers of a measured test, and what cannot be true of them.

The zero of the load cell, the machine, a pretension and slack are taken out, or asked about where the
file leaves them open; numbers that no yarn or fabric can have are refused with the slip that is likely.
"""

import numpy as np

from knitsim.errors import InputError
from knitsim.measured.course import (
    NOISE,
    ZERO,
    moment_when_flat,
    reading_at_start,
    reading_of_tail,
    slack_of,
)
from knitsim.measured.names import CONDITIONS
from knitsim.units import from_si

LARGEST_STRAIN = 5.0
LIKELY_STRAIN = 2.0  # of fabric and yarn; above it per cent are likely called a fraction
FABRIC_PERCENT, YARN_PERCENT = 0.02, 0.003  # below which a whole curve in per cent is a fraction
SMALLEST_STRAIN = 1e-3  # of a fabric
FORCES = (0.5, 3e4)  # N/m, of a fabric at its largest
TENACITIES = (5e2, 5e6)  # N m/kg, of a yarn at its largest: 0.05 cN/tex and 5 N/tex
STIFFEST = 3e8  # N m/kg, initial modulus of a yarn: 300 N/tex, beyond carbon
CURVATURES = (1.0, 1e4)  # 1/m, at its largest
RIGIDITIES = (0.01, 50.0)  # slope of moment by curvature over that of the yarns side by side
STIFFEST_FABRIC = 1e-2  # N m, the same slope where the yarn is not known


def without_zero(columns, course, x, y, zero):
    """(force without the zero of the load cell, what was done, pretension); InputError where it is open."""
    loading, tail, fabric = course.cycles[0].loading, course.tail, columns.kind == "tension"
    unit = "N_per_mm" if fabric else "N"
    shown, largest = unit.replace("_per_", "/"), float(y[loading].max())

    def say(value):
        return f"{from_si(value, unit):.4g} {shown}"

    start, seen, doubt = reading_at_start(x, y, loading)
    after, steady = reading_of_tail(y, tail, largest)
    pretension = columns.conditions.get("pretension", 0.0)
    certain = steady and after <= start + doubt and after < 0.1 * largest
    if zero == "tail" and not steady:
        raise InputError(
            f"{columns.where}: zero", "tail", "there is no steady force after a break in the file"
        )
    if zero == "tail" or (zero is None and certain):
        done = []
        if abs(after) > ZERO * largest:
            done = [f"zero of the load cell taken off: {say(after)}, read after the break"]
        else:
            after = 0.0
        if start - after > doubt and fabric and not pretension:
            pretension = start - after
        return y - after, done, pretension
    if zero == "start":
        how = "before the test" if seen else "off the first points"
        return y - start, [f"zero of the load cell taken off: {say(start)}, read {how}"], pretension
    if (
        zero == "keep"
        or abs(start) <= doubt
        or abs(start - pretension) <= max(doubt, 0.2 * pretension)
    ):
        return y, [], pretension
    at = f"{columns.where}:{columns.lines[loading[0]]}: force at no strain"
    part = f"{say(start)}, {100 * start / largest:.2g} % of the largest"
    off = "state zero: start if the load cell was not zeroed"
    pulled = "zero: keep if it is a pretension, which the fit takes out"
    if fabric:
        pulled = f"pretension_N_per_mm: {from_si(max(start, 0.0), unit):.4g} if it is a pretension"
    if not seen:
        raise InputError(
            at, f"{part}, read off the first points",
            f"must be none: {off}, zero: keep if the force is right, slack: start if the strain begins "
            f"elsewhere{', or ' + pulled if start > 0 and fabric else ''}",
        )  # fmt: skip
    if start < 0:
        raise InputError(
            at, part, f"must not be negative: {off}, or zero: keep if the force is right"
        )
    raise InputError(at, part, f"must be none: {off}, or {pulled}")


def without_machine(columns, x, y, first):
    """(strain without the extension of the machine, what was done)."""
    given, fabric = columns.conditions, columns.kind == "tension"
    if "machine_compliance" not in given:
        return x, []
    for name in ("gauge_length", "width")[: 1 + fabric]:
        if name not in given:
            key = CONDITIONS[name][1]
            raise InputError(
                f"{columns.where}: {name}", None,
                f"is missing: a machine compliance needs '# {key}: ...' or the key {key}",
            )  # fmt: skip
    force = y * given["width"] if fabric else y
    shift = given["machine_compliance"] * force / given["gauge_length"]
    top = int(first.loading[-1])
    part = float(shift[top] / x[top])
    if part >= 1.0:
        raise InputError(
            f"{columns.where}: machine_compliance",
            f"{from_si(given['machine_compliance'], 'mm_per_N'):.6g} mm/N",
            "explains all of the measured extension: nothing is left for the specimen",
        )  # fmt: skip
    for end in ("strain_low", "strain_high"):
        if end in columns.values:
            columns.values[end] = columns.values[end] - shift
    return x - shift, [
        f"extension of the machine subtracted, {100 * part:.2g} % of the largest extension"
    ]


def from_pretension(columns, test):
    """(test with its strain counted from where loading passes the pretension, or from the file's own
    zero if it starts above it; points kept; why not the others)."""
    pretension, force, loading = (
        test.pretension,
        test["force_per_width"],
        np.flatnonzero(test.loading),
    )
    if pretension >= force[loading].max():
        raise InputError(
            f"{columns.where}: pretension", f"{from_si(pretension, 'N_per_mm'):.6g} N/mm",
            f"must be below the largest force, {from_si(force.max(), 'N_per_mm'):.6g} N/mm",
        )  # fmt: skip
    above = int(np.argmax(force > pretension * (1.0 + 1e-9)))
    zero, across, keep = 0.0, 0.0, np.ones(len(force), dtype=bool)
    if above > 0:
        part = (pretension - force[above - 1]) / (force[above] - force[above - 1])
        zero, across = (
            0.0 if one is None else float(one[above - 1] + part * (one[above] - one[above - 1]))
            for one in (test["strain"], test.values.get("lateral_strain"))
        )
        numbers = np.arange(len(force))
        keep = (numbers >= above) & (test.loading | (force >= pretension))
    done = (
        f"strain counted from a pretension of {from_si(pretension, 'N_per_mm'):.4g} N/mm, "
        f"{100 * zero:.3g} % of strain in the file"
    )
    found = test.counted_from(zero, across).kept(keep, corrections=(*test.corrections, done))
    return found, keep, "below the pretension"


def from_first(columns, x, point):
    """(strain counted from the point where the extension was not zeroed, what was done)."""
    shift = float(x[point])
    for end in ("strain_low", "strain_high"):
        if end in columns.values:
            columns.values[end] = columns.values[end] - shift
    return x - shift, [f"strain counted from the first row, {100 * shift:.3g} % in the file"]


def without_slack(test, first, slack):
    """(test with its strain counted from where the specimen is taut, points kept, why not the others).

    first: strain of the first point of loading; slack: whether it is looked for, "find" or not.
    """
    zero, why = 0.0, ""
    if slack == "find":
        zero, why = slack_of(test.x, test.y, test.loading), "slack taken off, strain counted from"
        if test.cycle > 1 and not zero:
            # What the cycles before have left of strain.
            zero, why = first, f"cycle {test.cycle}: strain counted from where it begins,"
    if not zero:
        return test, np.ones(len(test), dtype=bool), ""
    keep = ~test.loading | (test["strain"] >= zero)
    done = f"{why} {100 * zero:.3g} % in the file"
    found = test.counted_from(zero).kept(keep, corrections=(*test.corrections, done))
    return found, keep, "slack"


def without_offset(columns, curvature, moment, points, zero):
    """(moment without that of the flat fabric if ``zero`` asks for it, what was done, what is to be said);
    points: of the first cycle."""
    flat = moment_when_flat(curvature[points], moment[points])
    if zero in ("start", "tail"):
        if not np.isfinite(flat):
            raise InputError(
                f"{columns.where}: zero", zero, "the test does not pass the flat fabric"
            )
        return (
            moment - flat,
            [f"moment of the flat fabric taken off: {from_si(flat, 'mN'):.4g} mN"],
            [],
        )
    if zero == "keep" or not abs(flat) > NOISE * np.abs(moment).max():
        return moment, [], []
    said = (
        f"moment of the flat fabric {from_si(flat, 'mN'):.4g} mN, mean of both ways: curl, or an offset of "
        "the torque cell, which the file cannot tell apart; it is kept, and only the change of moment from "
        "flat is compared (zero: start takes it off)"
    )
    return moment, [], [said]


def _ask(columns, quantity, value, right, point=None):
    name, numbers = columns.written[quantity]
    point = int(np.argmax(np.abs(numbers))) if point is None else point
    return InputError(f"{columns.where}:{columns.lines[point]}: {name}", value, right)


def refuse_strain(columns, unit, stated):
    """InputError for strains that no test reaches.

    unit: of the column, as its heading states it, None if it states none; stated: whether the caller
    states it, who then is right about per cent and fraction.
    """
    strain, fabric = columns.values["strain"], columns.kind == "tension"
    most = float(strain.max())
    shown, what = f"{most:.6g} at most", "fabric" if fabric else "yarn"
    either = "state unit: {strain: percent}, or {strain: 1} if it is a fraction"
    likely = LARGEST_STRAIN if unit is not None and fabric else LIKELY_STRAIN
    if most > LARGEST_STRAIN or (most > likely and not stated):
        slip = "is the unit, or the gauge length, right?"
        if unit is None:
            answer = either if most <= LARGEST_STRAIN else "state unit: {strain: percent}"
            slip = f"is it in per cent? then {answer}"
        raise _ask(
            columns,
            "strain",
            shown,
            f"no {what} is strained by more than {100 * likely:g} %: {slip}",
        )
    least = FABRIC_PERCENT if fabric else YARN_PERCENT
    if (
        unit is not None
        and unit.text.strip("()[] ") in ("%", "percent")
        and most < least
        and not stated
    ):
        raise _ask(
            columns, "strain", f"{100 * most:.6g} % at most",
            f"no test of a {what} is that small: is it a fraction? then {either}",
        )  # fmt: skip
    if fabric and most < SMALLEST_STRAIN:
        raise _ask(
            columns, "strain", shown,
            f"must reach {SMALLEST_STRAIN:g}: no fabric test is that small; is it the wrong unit of "
            "extension, or a fraction called per cent?",
        )  # fmt: skip
    for quantity, low, high in (("strain", -0.5, np.inf), ("lateral_strain", -1.0, LARGEST_STRAIN)):
        values = columns.values.get(quantity, np.zeros(1))
        for bad, right in (
            (values <= low, f"must be above {low:g}"),
            (values > high, f"must be at most {high:g}"),
        ):
            if bad.any():
                raise columns.refused(quantity, int(np.argmax(bad)), right)
    for end, way in (("strain_low", 1.0), ("strain_high", -1.0)):
        bad = way * (columns.values.get(end, strain) - strain) > 0
        if bad.any():
            side = "above" if way > 0 else "below"
            raise columns.refused(end, int(np.argmax(bad)), f"must not be {side} the strain")


def refuse_force(columns, stated):
    """InputError for forces that no yarn or fabric bears; stated: whether the caller states the unit."""
    fabric = columns.kind == "tension"
    quantity = "force_per_width" if fabric else "force"
    force, density = columns.values[quantity], columns.conditions.get("linear_density")
    largest = float(force.max())
    if not largest > 0:
        raise _ask(
            columns,
            quantity,
            f"{largest:g} {'N/m' if fabric else 'N'} at most",
            "must rise above 0: if the machine counts a pull as negative, state unit: {force: -N}",
        )
    if stated:
        return
    if fabric and not FORCES[0] <= largest <= FORCES[1]:
        raise _ask(
            columns, quantity, f"{largest:.4g} N/m at most",
            f"must be from {FORCES[0]:g} to {FORCES[1]:g} N/m for a knitted fabric: is the unit in the "
            "header right? state unit: {force: ...} if it is not, or if it is",
        )  # fmt: skip
    if fabric or density is None:
        return
    right = "is the unit of the force right? state unit: {force: ...} if it is not, or if it is"
    if not TENACITIES[0] <= largest / density <= TENACITIES[1]:
        raise _ask(
            columns, quantity, f"{largest:.4g} N, {1e-4 * largest / density:.4g} cN/tex at most",
            f"must be from {1e-4 * TENACITIES[0]:g} to {1e-4 * TENACITIES[1]:g} cN/tex: {right}",
        )  # fmt: skip
    strain = columns.values["strain"]
    order = np.argsort(strain, kind="stable")
    at = np.linspace(strain.min(), strain.max(), 21)
    modulus = float(
        np.diff(np.interp(at, strain[order], force[order])).max() / (at[1] - at[0]) / density
    )
    if modulus > STIFFEST:
        raise _ask(
            columns, quantity, f"initial modulus {1e-6 * modulus:.4g} N/tex",
            f"must be at most {1e-6 * STIFFEST:g} N/tex, no fibre is stiffer: is the strain a fraction "
            f"called per cent? {right}",
        )  # fmt: skip


def refuse_bending(columns, curvature, moment, rigidity, stated):
    """InputError for a bending test that no fabric gives; rigidity (N m): of its yarns side by side."""
    largest = float(np.abs(curvature).max())
    for wrong, right in (
        (largest > CURVATURES[1], "at most 100 per cm"),
        (largest < CURVATURES[0], "0.01 per cm or more at its largest"),
    ):
        if wrong:
            raise _ask(
                columns, "curvature", f"{largest / 100.0:.4g} per cm at most",
                f"must be {right}: is the unit in the header right?",
            )  # fmt: skip
    if curvature.min() > NOISE * largest or curvature.max() < -NOISE * largest:
        raise _ask(
            columns, "curvature", f"{curvature.min() / 100.0:.4g} per cm at least",
            "must pass the flat fabric, curvature 0: moments count from there",
        )  # fmt: skip
    slope = float(np.polynomial.polynomial.polyfit(curvature / largest, moment, 1)[1] / largest)
    if not slope > 0:
        raise _ask(
            columns, "moment_per_width", f"mean slope {slope:.4g} N m",
            "must rise with the curvature (both positive with the technical face convex)",
        )  # fmt: skip
    low, high = (part * rigidity for part in RIGIDITIES) if rigidity else (0.0, STIFFEST_FABRIC)
    if not low <= slope <= high and not stated:
        beside = (
            f", {slope / rigidity:.3g} times that of its yarns side by side" if rigidity else ""
        )
        raise _ask(
            columns, "moment_per_width", f"mean slope {slope:.4g} N m{beside}",
            f"must be from {low:.2g} to {high:.2g} N m: is the unit in the header right? state unit: "
            "{moment_per_width: ...} if it is not, or if it is",
        )  # fmt: skip

"""What one per cent of each input does to a fabric's tests: two-sided differences."""

from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.pull import tensile
from knitsim.errors import ComputationError, InputError
from knitsim.inference.continuation import (
    States,
    check_input,
    common_resolution,
    value_of,
    varied,
)
from knitsim.inference.trials import strains_for
from knitsim.kes.bending_test import bending
from knitsim.units import to_si

STEP = 0.01  # change of an input, relative; absolute for one that is zero
LIKELY_STRAINS = (0.01, 0.5)  # solved evenly, further apart beyond
BENDING_STATES = 4  # to each side; B and 2HB are read at 0.5, 1 and 1.5 per cm
MAX_CURVATURE = to_si(2.0, "per_cm")
_FAILURES = (ComputationError, InputError)


@dataclass(frozen=True)
class Row:
    """Effect of one input on one result.

    value: of the result as it is (SI); per_cent: its change in per cent for 1 % of the input (for
    0.01 of an input that is zero, one-sided); noise: how much per_cent differs when the input is
    changed twice as far, which holds the solver's noise and the curvature of the effect; note: why
    there is no number, "" otherwise.
    """

    input: str
    result: str
    value: float
    per_cent: float
    noise: float
    note: str


def standard_results(course_force, wale_force, *, curvature=MAX_CURVATURE, hysteresis=True):
    """A function of a fabric at rest to {result: value}: strain at these forces per width (N/m)
    course- and wale-wise on first loading, B and 2HB (N m, N per width) both ways, spacings at rest.

    curvature (1/m): largest one of the bending test, None for no bending; hysteresis: with 2HB, left
    out where the fabric has no friction.
    """

    def results(relaxed):
        found = {
            "wale_spacing": relaxed.wale_spacing,
            "course_spacing": relaxed.course_spacing,
        }
        for direction, force in (("course", course_force), ("wale", wale_force)):
            curve = tensile(relaxed, direction, strains_for(*LIKELY_STRAINS, 25), to_force=force)
            if curve.stop_reason:
                raise ComputationError(f"{direction} tension: {curve.stop_reason}")
            found[f"{direction}_strain"] = float(curve.strain[-1])
        if curvature is None:
            return found
        up = curvature * np.arange(1, BENDING_STATES + 1) / BENDING_STATES
        down = np.concatenate([up[::-1][1:], [0.0], -up])
        way = np.concatenate([[0.0], up, down, -up[::-1][1:], [0.0]])
        for direction in ("course", "wale"):
            curve = bend(relaxed, direction, way)
            if curve.stop_reason:
                raise ComputationError(f"{direction} bending: {curve.stop_reason}")
            kes = bending(curve.curvature, curve.moment_per_width)
            found[f"{direction}_B"] = kes["B"].value
            if hysteresis and relaxed.model.fabric.friction > 0.0:
                found[f"{direction}_2HB"] = kes["2HB"].value
        return found

    return results


def sensitivity_table(fabric, inputs, results, *, step=STEP, resolution=None):
    """Rows (:class:`Row`) for each of the inputs (names) and each result.

    results: function of a fabric at rest to {name: value}, e.g. :func:`standard_results`.  An input
    that cannot be changed both ways (no negative friction) is changed one way.  Raises
    ComputationError where the fabric as it is has no result.
    """
    for name in inputs:
        check_input(name, fabric)
    resolution = common_resolution([fabric], resolution)
    base = States(resolution)
    rest = base.rest(fabric)
    own = results(rest.relaxed)
    rows = []
    for name in inputs:
        value = value_of(fabric, name)
        unit = value if value else 1.0
        at, failure = {}, ""
        for times in (1, -1, 2, -2):
            base.last = rest
            try:
                moved = varied(fabric, {name: value + times * step * unit})
                at[times] = results(base.rest(moved).relaxed)
            except _FAILURES as error:
                failure = str(error)
        for result, here in own.items():
            slopes = [_slope(at, result, here, k, step) for k in (1, 2)]
            note = "" if np.isfinite(slopes[0]) else failure or "the result is zero"
            rows.append(Row(name, result, here, slopes[0], abs(slopes[1] - slopes[0]), note))
    return tuple(rows)


def _slope(at, result, here, k, step):
    """Per cent of a result per per cent of the input, from changes by k steps; one-sided if need be."""
    if not here:
        return np.nan
    high, low = at.get(k, {}).get(result), at.get(-k, {}).get(result)
    if high is not None and low is not None:
        return (high - low) / (2.0 * k * step * here)
    if high is not None:
        return (high - here) / (k * step * here)
    if low is not None:
        return (here - low) / (k * step * here)
    return np.nan

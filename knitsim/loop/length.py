"""The parameter chi of Choi and Lo's curve for a stated loop length, and the lengths that exist."""

import math

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from knitsim.errors import ComputationError, InputError
from knitsim.loop import choi_lo
from knitsim.loop.centreline import periodic_spline
from knitsim.units import from_si

DENSE = 200  # pieces of the spline that follows a curve itself: its length is right to 1e-8
# Range of chi searched for a loop length; below and above it no loop of interest lies.
_CHI = np.geomspace(0.05, 8.0, 41)


def chi_for_length(
    wale_spacing, course_spacing, diameter, loop_length, centre_line="spline", where="loop"
):
    """chi (1) for which the modelled centre line has the loop length (m), above the shortest one.

    Raises InputError if no chi does, with the shortest (or longest) length at these spacings and,
    where there is one, the factor on both spacings at which this length would do.
    """

    def length(chi):
        return _length(wale_spacing, course_spacing, diameter, chi, centre_line)

    chi_min, shortest = shortest_loop(wale_spacing, course_spacing, diameter, centre_line)
    if loop_length < shortest:
        factor = _spacing_factor(wale_spacing, course_spacing, diameter, loop_length, centre_line)
        also = ""
        if factor is not None:
            also = f"; this length needs both spacings {100 * (1 - factor):.2g} % closer"
        raise InputError(
            f"{where}.loop_length_mm", f"{from_si(loop_length, 'mm'):.6g}",
            f"must be at least {_round_up(from_si(shortest, 'mm'))} mm, the shortest loop at wale "
            f"spacing {from_si(wale_spacing, 'mm'):.5g} mm, course spacing "
            f"{from_si(course_spacing, 'mm'):.5g} mm, yarn diameter "
            f"{from_si(diameter, 'mm'):.4g} mm{also}",
        )  # fmt: skip
    low = chi_min
    for high in _CHI[_CHI > chi_min]:
        reached = length(high)
        if not math.isfinite(reached):
            high = _last_finite(length, low, high)
            reached = length(high)
        if reached >= loop_length:
            return brentq(lambda chi: length(chi) - loop_length, low, high, xtol=1e-15, rtol=4e-15)
        low = high
    raise InputError(
        f"{where}.loop_length_mm", f"{from_si(loop_length, 'mm'):.6g}",
        f"must be at most {from_si(length(low), 'mm'):.5g} mm, the longest loop at wale spacing "
        f"{from_si(wale_spacing, 'mm'):.5g} mm, course spacing "
        f"{from_si(course_spacing, 'mm'):.5g} mm, yarn diameter {from_si(diameter, 'mm'):.4g} mm",
    )  # fmt: skip


def shortest_loop(wale_spacing, course_spacing, diameter, centre_line="spline"):
    """chi (1) and length (m) of the shortest modelled centre line at these spacings (m)."""

    def length(chi):
        return _length(wale_spacing, course_spacing, diameter, chi, centre_line)

    lengths = np.array([length(chi) for chi in _CHI])
    best = int(np.argmin(lengths))
    if not math.isfinite(lengths[best]):
        raise ComputationError("shortest loop: the equations of Choi and Lo have no solution")
    low, high = _CHI[max(best - 1, 0)], _CHI[min(best + 1, len(_CHI) - 1)]
    if not math.isfinite(length(high)):
        high = _last_finite(length, _CHI[best], high)
    found = minimize_scalar(length, bounds=(low, high), method="bounded", options={"xatol": 1e-9})
    if found.fun < lengths[best]:
        return float(found.x), float(found.fun)
    return float(_CHI[best]), float(lengths[best])


def _length(wale_spacing, course_spacing, diameter, chi, centre_line):
    """Length of the modelled centre line, m, or inf where there is none."""
    source = choi_lo.solve(wale_spacing, course_spacing, diameter, chi)
    if source is None:
        return math.inf
    try:
        return centre_line_of(source, centre_line).length
    except ComputationError:
        return math.inf


def centre_line_of(source, centre_line):
    """The modelled centre line of a solved curve of Choi and Lo."""
    if centre_line == "spline":
        return periodic_spline(source.anchors())
    points = source.points(np.linspace(0.0, 2.0, DENSE + 1))
    return periodic_spline(closed(points, source.wale_spacing))


def closed(points, wale_spacing):
    """``points`` (k + 1, 3) with the last exactly one wale spacing from the first."""
    points[-1] = points[0] + (wale_spacing, 0.0, 0.0)
    return points


def _last_finite(length, low, high):
    """The largest chi between low (a loop) and high (none) that gives a loop, to 1e-6."""
    while high - low > 1e-6 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if math.isfinite(length(middle)) else (low, middle)
    return low


def _spacing_factor(wale_spacing, course_spacing, diameter, loop_length, centre_line):
    """Factor on both spacings at which ``loop_length`` is the shortest, None below 0.5."""

    def excess(factor):
        size = factor * wale_spacing, factor * course_spacing, diameter
        return shortest_loop(*size, centre_line)[1] - loop_length

    if excess(0.5) > 0:
        return None
    # Rounded down to the percent shown, so that what the message promises holds.
    return brentq(excess, 0.5, 1.0, xtol=1e-4) - 5e-3


def _round_up(length):
    """A length in mm with three decimals, never below the length itself."""
    return f"{math.ceil(length * 1000) / 1000:.3f}"

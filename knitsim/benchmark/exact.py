"""A clamped rod lifted by a hard cylinder, to round-off: the contact scene of the comparison."""

from functools import cache

import numpy as np
from scipy.optimize import fsolve

from knitsim.errors import ComputationError

_NODE, _WEIGHT = np.polynomial.legendre.leggauss(60)


def _lifted_part(force, angle):
    """Tip (x, y) of a rod of length 1, EI = 1, clamped along x, under ``force`` across its own tip.

    angle: of the tip's tangent (rad).  Returns x, y and the force that this tip angle needs less
    ``force``, from the first integral: theta'^2/2 = force sin(angle - theta), zero at the tip.
    """
    # theta = angle - t^2 angle takes the square root out of the integrals.
    t = 0.5 * (_NODE + 1.0)
    theta = angle * (1.0 - t**2)
    arc = 0.5 * _WEIGHT * 2.0 * t * angle / np.sqrt(2.0 * force * np.sin(angle - theta))
    return arc @ np.cos(theta), arc @ np.sin(theta), arc.sum() - 1.0


@cache
def lifted_end(along, below, radius):
    """Free end (x, y) of a rod of length 1 clamped at the origin along x, lifted by a cylinder.

    The cylinder's axis stands at (``along``, -``below``) across the plane; the centre line stays
    ``radius`` from it, without friction.  Between clamp and contact the rod is an elastica under a
    force across its own end; beyond, it is straight.

    Raises ComputationError if no such state is found.
    """

    def miss(unknowns):
        part, angle, force = unknowns
        x, y, length = _lifted_part(force, angle)
        # The axis lies ``radius`` from the contact, on the side that the rod is lifted from.
        return (
            part * x + radius * np.sin(angle) - along,
            part * y - radius * np.cos(angle) + below,
            length,
        )

    lift = radius - below
    start = (along, 1.5 * lift / along, 3.0 * lift / along)
    found, _, status, message = fsolve(miss, start, xtol=1e-13, full_output=True)
    if status != 1 or max(map(abs, miss(found))) > 1e-10:
        raise ComputationError(f"rod lifted by a cylinder: {message}")
    part, angle, force = found
    x, y, _ = _lifted_part(force, angle)
    rest = 1.0 - part
    return part * x + rest * np.cos(angle), part * y + rest * np.sin(angle)

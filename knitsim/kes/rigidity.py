"""Bending rigidity and curl of a fabric at rest in the equilibrium model, in short."""

import numpy as np

from knitsim.equilibrium.bend import bend
from knitsim.kes.bending_test import SLOPE_RANGE


def affine_rigidity(points, rigidity, wale_spacing, course_spacing):
    """Rigidity per width (N m) along course and wale if every piece of yarn bends with the fabric.

    points (n, 3) (m): one loop, the last point the first of the next.  A straight piece at the angle
    phi to the bent direction that follows the fabric on its cylinder is a helix: its curvature is
    curvature cos^2 phi, its energy per length B (curvature cos^2 phi)^2/2.  Over the loop's area that
    is B/(w c) times the integral of cos^4 phi along the loop.  Its two simplest cases: straight yarns
    along the course, one each course spacing, B/c; straight legs along the wale, two each wale
    spacing, 2 B/w.  Yarns that give way by turning and sliding make the fabric softer than that.
    """
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    shares = [length @ (steps[:, axis] / length) ** 4 for axis in range(2)]
    return rigidity / (wale_spacing * course_spacing) * np.array(shares)


def rigidity_and_curl(relaxed, direction, spacings="free"):
    """(B in N m, moment that holds the fabric flat in N) without friction.

    B: mean slope of the moment per width from 0.5 to 1.5 per cm, mean of both sides, as KES reads it.
    Not a number where the path ends early.
    """
    low, high = SLOPE_RANGE
    curve = bend(relaxed, direction, [low, high, 0.0, -low, -high], spacings=spacings)
    if curve.stop_reason:
        return np.nan, float(curve.flat_moment)
    moment = curve.moment_per_width
    slopes = np.array([moment[1] - moment[0], moment[3] - moment[4]]) / (high - low)
    return float(slopes.mean()), float(curve.flat_moment)

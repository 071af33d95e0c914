"""How far off the moments of a bending test are.

The whole test is solved again from the same relaxed shape with twice the control points and twice the
contact points, and with friction once more with half the steps.  The differences of the moments are
added and doubled: they fall at least in proportion to the steps and with the square of the spacing of
the points, so that the finer solution lacks no more than the difference.  The error from the contact
points wavers with the curvature; at each state the largest of its neighbourhood stands.
"""

import numpy as np

from knitsim.equilibrium.accuracy import SAFETY, fine_relaxed, scale_of
from knitsim.errors import ComputationError

AROUND = 2  # states on either side whose error may stand for a state


def errors_of(relaxed, curve, increment, again):
    """Estimated errors (steps,), (steps,) of a BendingCurve: of the moment, of its change.

    relaxed: where it starts from; increment (1/m): its largest step; again(relaxed, increment): the
    same test from another relaxed state or with another step.  Relative as in BendingCurve.  NaN where
    a finer solution failed.
    """
    missing = np.full(curve.steps, np.nan)
    try:
        others = [again(fine_relaxed(relaxed), increment)]
    except ComputationError:
        return missing, missing.copy()
    fabric = relaxed.model.fabric
    if fabric.friction > 0.0 or fabric.bending_hysteresis > 0.0:
        steps = np.abs(np.diff(curve.curvature, prepend=0.0)).max()
        others.append(again(relaxed, 0.5 * min(increment, steps) if steps > 0.0 else increment))
    moment = curve.moment_per_width
    of_moment, of_change = np.zeros(curve.steps), np.zeros(curve.steps)
    for other in others:
        if other.steps < curve.steps:
            return missing, missing.copy()
        off = other.moment_per_width - moment
        of_moment += _neighbourhood(np.abs(off))
        of_change += _neighbourhood(np.abs(off - (other.flat_moment - curve.flat_moment)))
    largest = np.abs(moment - curve.flat_moment).max()
    relative = of_change / largest if largest > 0.0 else np.zeros(curve.steps)
    return SAFETY * of_moment / scale_of(moment), SAFETY * relative


def _neighbourhood(values):
    """Largest of the values within AROUND places."""
    padded = np.pad(values, AROUND, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1).max(axis=1)

"""How far off the forces and moments of a test are: one rule for all tests.

The whole test is solved again from the same relaxed shape with twice the control points and twice the
contact points, and with friction once more with twice the increment.  The differences are added and
doubled: they fall at least with the square of the spacing of the points and in proportion to the
increments, so that the finer solution lacks no more than the difference.  The error from the contact
points wavers along the test; at each state the largest of its neighbourhood stands.
"""

import numpy as np

from knitsim.equilibrium.model import build_model, refine, with_set
from knitsim.equilibrium.relax import settle
from knitsim.equilibrium.result import BendingCurve
from knitsim.errors import ComputationError

SAFETY = 2.0
FLOOR = 0.01  # of the largest: below it an error is measured against this
AROUND = 2  # states on either side whose error may stand for a state


def fine_relaxed(relaxed):
    """The relaxed state at twice the resolution, started from the same shape."""
    model = relaxed.model
    fabric = model.fabric
    fine = build_model(fabric, model.resolution.refined(fabric), model.cell.symmetries)
    if model.held is not None:
        # The rest curvature belongs to the held loop, which must be found again.
        held = settle(fine, refine(model, model.held, fine), fine.free())
        fine = with_set(fine, held.y)
    state = settle(fine, refine(model, relaxed.y, fine), fine.free(0, 3))
    if not relaxed.history:
        return state
    from knitsim.equilibrium.programme import handled

    return handled(state, relaxed.history)


def estimated(relaxed, curve, increment, again):
    """The curve with its estimated errors.

    relaxed: where it starts from; increment: its largest step; again(relaxed, increment): the same test
    from another relaxed state or in other steps.  NaN where a solution failed.
    """
    try:
        others = [again(fine_relaxed(relaxed), increment)]
        if relaxed.model.rub:
            steps = np.abs(np.diff(curve.place, prepend=0.0)).max()
            others.append(again(relaxed, 2.0 * min(increment, steps) if steps > 0.0 else increment))
    except ComputationError:
        others = []
    unknown = np.full(curve.steps, np.nan)
    off = (
        sum((_off(curve, other) for other in others), np.zeros(curve.steps)) if others else unknown
    )
    curve = curve.replaced(numerical_error=SAFETY * off / scale_of(curve.value))
    if not isinstance(curve, BendingCurve):
        return curve
    largest = np.abs(curve.value - curve.flat_moment).max()
    changes = [_off(curve, other, other.flat_moment - curve.flat_moment) for other in others]
    change = sum(changes, np.zeros(curve.steps)) if others else unknown
    return curve.replaced(change_error=SAFETY * change / largest if largest > 0.0 else 0.0 * change)


def _off(curve, other, shift=0.0):
    """Difference of the values of two solutions of a test, (steps,); the largest around each state.

    States are matched one by one or, where the way back ends elsewhere, by place within phase and
    cycle.  shift: by which the other's values are higher throughout.
    """
    if other.steps == curve.steps and np.allclose(other.place, curve.place, rtol=1e-9, atol=1e-9):
        return _neighbourhood(np.abs(other.value - shift - curve.value))
    off = np.full(curve.steps, np.nan)
    for cycle in np.unique(curve.cycle):
        for phase in np.unique(curve.phase):
            mine = np.flatnonzero((curve.cycle == cycle) & (curve.phase == phase))
            theirs = np.flatnonzero((other.cycle == cycle) & (other.phase == phase))
            if not len(mine) or not len(theirs):
                continue
            theirs = theirs[np.argsort(other.place[theirs])]
            at = np.interp(curve.place[mine], other.place[theirs], other.value[theirs])
            # Where it has not been, nothing is known, but for the end of the way back.
            far = curve.place[mine] > other.place[theirs].max() + 1e-9
            off[mine] = np.where(far, np.nan, np.abs(at - shift - curve.value[mine]))
    return _neighbourhood(off)


def scale_of(values):
    """What errors of a curve's values are measured against: the size, 1 % of the largest at least."""
    return np.maximum(np.abs(values), FLOOR * np.abs(values).max())


def _neighbourhood(values):
    """Largest of the values within AROUND places; NaN where the value itself is."""
    padded = np.pad(values, AROUND, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1)
    return np.where(np.isnan(values), np.nan, np.fmax.reduce(around, axis=1))

"""How far off the forces are because the yarn is cut into finitely many pieces.

A few states of a curve are solved again with twice the control points and twice the contact points,
starting from the very same shape (a spline is subdivided exactly).  The difference of the forces,
times a safety factor, is the estimate; it also covers what the fine solution itself still lacks.
Between these states the largest of the neighbouring estimates stands.

With friction the force depends on the way there.  The whole test is then solved again with twice the
increment; the difference is added.  Since Coulomb's law is stepped implicitly, the error falls at
least in proportion to the increment, so that the difference is not less than the error of the finer.
"""

import numpy as np

from knitsim.equilibrium.model import build_model, refine
from knitsim.equilibrium.relax import relax, settle
from knitsim.equilibrium.solve import gradient_at
from knitsim.errors import ComputationError

SAFETY = 2.0
FLOOR = 0.01  # of the largest force: below it an error is measured against this


def fine_relaxed(relaxed):
    """The relaxed state at twice the resolution, started from the same shape."""
    model = relaxed.model
    fabric = model.fabric
    fine = build_model(fabric, model.resolution.refined(fabric))
    if fabric.set_fraction > 0.0:
        # The rest curvature belongs to the held loop, which must be found again.
        return relax(fabric, fine.resolution)
    return settle(fine, refine(model, relaxed.y, fine), fine.free(0, 3))


def spacing_error(relaxed):
    """Estimated relative error of the relaxed spacings; NaN where the finer solution failed."""
    try:
        fine = fine_relaxed(relaxed)
    except ComputationError:
        return np.nan
    # At second order the finer solution is four times closer; 2 leaves room for a lower order.
    return SAFETY * max(
        abs(fine.wale_spacing / relaxed.wale_spacing - 1.0),
        abs(fine.course_spacing / relaxed.course_spacing - 1.0),
    )


def spatial_error(relaxed, curve, samples=10):
    """Estimated error of curve.force_per_loop from the cutting into pieces, (steps,).

    Relative to max(|force|, 1 % of the largest).  samples: states that are solved again.  Friction
    is left out on both sides.  NaN where the fine solution failed, and next to that.
    """
    try:
        fine = fine_relaxed(relaxed)
    except ComputationError:
        return np.full(curve.steps, np.nan)
    model, at, new = relaxed.model, relaxed.model.lattice, fine.model.lattice
    size = scale_of(curve.force_per_loop)
    chosen = np.unique(np.linspace(0, curve.steps - 1, min(samples, curve.steps)).astype(int))
    ratio = np.divide(fine.y[new:], relaxed.y[at:], out=np.ones(4), where=relaxed.y[at:] != 0.0)
    errors = np.full(len(chosen), np.nan)
    for i, step in enumerate(chosen):
        coarse = curve.y[step]
        y = refine(model, coarse, fine.model)
        y[new:] *= ratio
        try:
            force = force_at(fine.model, y, curve)
            own = curve.force_per_loop[step]
            if model.fabric.friction > 0.0:
                own = force_at(model, coarse, curve)
        except ComputationError:
            continue
        errors[i] = SAFETY * abs(force - own) / size[step]
    return _between(np.arange(curve.steps), chosen, errors)


def increment_error(curve, coarse):
    """Estimated error of curve.force_per_loop from its increments, (steps,), relative as above.

    coarse: the same test with twice the increment.  States are matched one by one or, where the way
    back ends elsewhere, by strain within phase and cycle.
    """
    size = scale_of(curve.force_per_loop)
    if coarse.steps == curve.steps and np.allclose(
        coarse.strain, curve.strain, rtol=0.0, atol=1e-9
    ):
        return SAFETY * np.abs(coarse.force_per_loop - curve.force_per_loop) / size
    errors = np.full(curve.steps, np.nan)
    for cycle in np.unique(curve.cycle):
        for phase in np.unique(curve.phase):
            mine = np.flatnonzero((curve.cycle == cycle) & (curve.phase == phase))
            theirs = np.flatnonzero((coarse.cycle == cycle) & (coarse.phase == phase))
            if not len(mine) or not len(theirs):
                continue
            theirs = theirs[np.argsort(coarse.strain[theirs])]
            other = np.interp(
                curve.strain[mine], coarse.strain[theirs], coarse.force_per_loop[theirs]
            )
            errors[mine] = SAFETY * np.abs(other - curve.force_per_loop[mine]) / size[mine]
    return errors


def scale_of(force):
    """What errors of a curve's forces are measured against: |force|, 1 % of the largest at least."""
    return np.maximum(np.abs(force), FLOOR * np.abs(force).max())


def force_at(model, y, curve):
    """Frictionless force per loop (N) on the driven entry of a curve's test, from the shape y on."""
    scene = model.with_load(curve.load)
    state = settle(model, y, model.free(*curve.free), scene=scene)
    i = model.lattice + curve.driven
    return (gradient_at(model, scene, state.y)[0][i] + scene.load[i]) / model.loops


def _between(steps, known, values):
    """At each step the largest of the values known at the two places on either side of it.

    The error from the contact points wavers from state to state, hence two.  Next to a place where it
    could not be found it is not known either.
    """
    right = np.clip(np.searchsorted(known, steps), 0, len(known) - 1)
    left = np.where(known[right] == steps, right, np.maximum(right - 1, 0))
    around = np.clip(right[:, None] + np.arange(-2, 2), 0, len(known) - 1)
    unknown = np.isnan(values[left]) | np.isnan(values[right])
    return np.where(unknown, np.nan, np.fmax.reduce(values[around], axis=1))

"""Pure bending of the fabric: moment per width against curvature, with friction.

The bent direction ("course" or "wale") becomes the circumference of a cylinder; curvature is positive
when the technical face is convex.  Curvature and spacings belong to the mean plane of the centre line.

The moment is the derivative of a loop's energy (and friction potential) by the angle alpha = kappa w
that the loop spans, over the transverse spacing at rest: as KES has it, the moment of the specimen over
its width, and the derivative of the energy per area at rest by the curvature.  It is the moment about
the mean plane in a cut through the fabric.  With spacings free the force in the cut is zero as well:
the spacing w along the bent direction makes the energy least at a given angle, not at a given
curvature, where a force -kappa M would be left, held up by a pressure as on a mandrel.  The moment then
is the same about any plane.  With spacings held there is a force, balanced by a pressure; the moment is
that about the mean plane, and the mean over all cuts.

>>> from knitsim.equilibrium.fabric import Fabric
>>> from knitsim.equilibrium.relax import relax
>>> from knitsim.yarn.law import paper_k3
>>> cotton = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))
>>> curve = bend(relax(cotton), "course", [0.0, 100.0, -100.0])
>>> [round(1e3 * float(m), 2) for m in curve.moment_per_width]  # mN
[-4.35, -4.23, -4.48]
"""

import functools
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from knitsim.equilibrium.accuracy_bent import errors_of
from knitsim.equilibrium.kernels.follow import REACHED, new_states
from knitsim.equilibrium.kernels.follow_bent import (
    RAN_AWAY,
    STATE,
    Bending,
    flat_moment,
    follow_bending,
)
from knitsim.equilibrium.kernels.records import Bend
from knitsim.equilibrium.model import Model, centrelines
from knitsim.equilibrium.relax import REASONS
from knitsim.equilibrium.result import LOADING, RECOVERY, States
from knitsim.errors import InputError
from knitsim.loop.repeat import rolled

DIRECTIONS = {"course": 0, "wale": 1}
INCREMENT = 100.0  # 1/m, largest change of curvature in one solve without friction
FRICTION_INCREMENT = 25.0
TIGHTEST = 0.5  # curvature times half the thickness, yarn included
EXACT = 1e-12  # of the tightest curvature: how far a state may be from the asked one
SLIP_ROUNDING = 0.01  # of the diameter squared times the change of curvature, see Bending
TURN_ROUNDING = 0.01  # of the change of curvature
LAG_PASSES = 12  # at most
MOST_UNKNOWNS = 6000  # of a cell: its whole Hessian and factor, kept here, take 0.9 GB
_GAUSS = np.polynomial.legendre.leggauss(2)
_REASONS = {**REASONS, RAN_AWAY: "the free spacings run away (beyond half or twice those at rest)"}


@dataclass(frozen=True, eq=False)
class BendingCurve(States):
    """States of a bending test in the order visited; arrays (steps,) unless said.

    Spacings are those in the mean plane, centre lines those of the loop before it is rolled up.
    Names, units and signs follow the result store.  curvature (1/m); phase: 0 loading (the curvature
    grows in size), 1 recovery; cycle: from 1, a new one where the curvature sets out to the side of
    the first again; moment_per_width (N); flat_moment (N, one number): moment per width of the flat
    fabric at rest; energy (steps, 3): stretch, bend, contact per loop (J); work, dissipated:
    cumulative (J per loop); min_distance (diameters, NaN where nothing is near); residual (N);
    iterations; y (steps, unknowns): the states, in the coordinates of the fabric before it is rolled
    up.  width (m): transverse spacing at rest.  numerical_error (1): estimated error of the moment over
    max(|moment|, 1 % of the largest); change_error (1): of its change from flat_moment, over the
    largest change; NaN where not asked for.  A curve that ends early has fewer rows and a stop_reason
    that is not empty.
    """

    model: Model
    direction: str
    spacings: str
    width: float
    flat_moment: float
    curvature: np.ndarray
    phase: np.ndarray
    cycle: np.ndarray
    moment_per_width: np.ndarray
    energy: np.ndarray
    work: np.ndarray
    dissipated: np.ndarray
    min_distance: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    y: np.ndarray
    stop_reason: str
    numerical_error: np.ndarray
    change_error: np.ndarray

    def centrelines_bent(self, step, wales=0, courses=0):
        """Points in space (loops, points, 3) of the cell this many wales and courses on, in one state.

        The axis of the cylinder lies at thickness -1/curvature over the origin.
        """
        bent = DIRECTIONS[self.direction]
        points = centrelines(self.model, self.y[step])
        points[..., 0] += wales * self.wale_spacing[step]
        points[..., 1] += courses * self.course_spacing[step]
        along = points[..., bent].copy()
        points[..., bent] = 0.0
        return rolled(points, self.curvature[step], along, bent)

    @property
    def yarn_strain(self):
        """Mean strain of the yarn over the cell."""
        return self._yarn[0]

    @property
    def yarn_tension(self):
        """Mean tension of the yarn over the cell (N)."""
        return self._yarn[1]

    @functools.cached_property
    def _yarn(self):
        fabric, axis, cell = self.model.fabric, DIRECTIONS[self.direction], self.model.cell
        length = cell.wales * fabric.loop_length
        means = np.empty((self.steps, 2))
        for k, (loops, curvature) in enumerate(zip(self.centrelines, self.curvature, strict=True)):
            local = np.concatenate([
                bent_strain(np.concatenate([*course[:, :-1], course[-1, -1:]]), curvature, axis, length)
                for course in np.split(loops, cell.courses)
            ])  # fmt: skip
            means[k] = local.mean(), fabric.law.tension_at(local).mean()
        return means.T


def bent_strain(flat, curvature, axis, length):
    """Strain of a yarn over its period in a bent fabric, at two places a piece, (2 (points - 1),).

    flat: (points, 3) (m), in the coordinates of the fabric before it is rolled up, at equal lengths of
    the yarn at rest, which has ``length`` (m) in the period; the last point is the first of the next.
    On a cylinder what lies at thickness z is longer along the bent direction (axis) by 1 + curvature z.
    """
    at = np.linspace(0.0, 1.0, len(flat))
    step = flat[-1] - flat[0]
    closed = flat - at[:, None] * step
    closed[-1] = closed[0]
    line = CubicSpline(at, closed, bc_type="periodic")
    places = (at[:-1, None] + np.diff(at)[:, None] * 0.5 * (1.0 + _GAUSS[0])).ravel()
    speed = line(places, 1) + step
    speed[:, axis] *= 1.0 + curvature * line(places)[:, 2]
    return np.linalg.norm(speed, axis=1) / length - 1.0


def bend(relaxed, direction, curvatures, *, spacings="free", increment=None, estimate_error=False):
    """Bend the relaxed fabric through ``curvatures`` (1/m), in that order; a :class:`BendingCurve`.

    direction: "course" or "wale", the one that becomes curved.  spacings: "free" or "held" (at the
    relaxed ones; then the moment is that about the mean plane, next to a pressure).  Friction between
    yarns and within them is that of the fabric, from no friction force at rest on.  increment: largest
    change of curvature in one solved step (1/m), 25 with friction, 100 without.  estimate_error: fill
    numerical_error and change_error, by solving the test again with twice the resolution, and with
    friction also with half the steps.

    A path that cannot be followed to its end gives the states reached and a stop_reason.  Raises
    InputError for names that make no sense, for curvatures tighter than the fabric is thick, and for
    cells of too many loops.
    """
    if direction not in DIRECTIONS:
        raise InputError("direction", direction, "must be course or wale")
    if spacings not in ("free", "held"):
        raise InputError("spacings", spacings, "must be free or held")
    model, fabric = relaxed.model, relaxed.model.fabric
    if len(relaxed.y) > MOST_UNKNOWNS:
        raise InputError("cell", model.loops, "loops: must be fewer, one loop bends as all do")
    curvatures = np.atleast_1d(np.asarray(curvatures, dtype=float))
    if curvatures.ndim != 1 or not curvatures.size:
        raise InputError("curvature", curvatures.tolist(), "must be a list of numbers (1/m)")
    tightest = TIGHTEST / (np.abs(relaxed.centrelines[..., 2]).max() + 0.5 * fabric.diameter)
    if not (np.abs(curvatures) <= tightest).all():
        raise InputError(
            "curvature",
            float(np.abs(curvatures).max()),
            f"must be finite and {tightest:.4g} 1/m ({1e-2 * tightest:.4g} per cm) or less: the "
            "fabric is too thick for it",
        )
    rubs = fabric.friction > 0.0 or fabric.bending_hysteresis > 0.0
    if increment is None:
        increment = FRICTION_INCREMENT if rubs else INCREMENT
    if not 0.0 < increment < np.inf:
        raise InputError("increment", increment, "must be finite and above 0 1/m")
    bent = DIRECTIONS[direction]
    bending = Bending(
        model.free(0, 3) if spacings == "free" else model.free(),
        model.lattice + 3 * bent,
        float(increment),
        EXACT * tightest,
        fabric.friction,
        fabric.bending_hysteresis,
        SLIP_ROUNDING * fabric.diameter**2,
        TURN_ROUNDING,
        LAG_PASSES,
        model.expected,
    )
    scene = model.scene._replace(bend=Bend(0.0, bent, True))
    states, kept = (
        new_states(STATE, len(curvatures)),
        np.full((len(curvatures), len(relaxed.y)), np.nan),
    )
    reached, status = follow_bending(
        scene, model.trace, relaxed.y.copy(), curvatures, bending, model.control, states, kept
    )
    reason = ""
    if status != REACHED:
        reason = f"{_REASONS[status]}; stopped before curvature {curvatures[reached]:.6g} 1/m"
    states, kept = states[:reached], kept[:reached]
    phase, cycle = phases_of(curvatures[:reached])
    width = (relaxed.course_spacing, relaxed.wale_spacing)[bent]
    per_width = width * model.loops
    closest = states.closest / fabric.diameter
    unknown = np.full(reached, np.nan)
    curve = BendingCurve(
        model,
        direction,
        spacings,
        width,
        flat_moment(scene, relaxed.y) / per_width,
        curvatures[:reached].copy(),
        phase,
        cycle,
        states.moment / per_width,
        states.terms / model.loops,
        states.work / model.loops,
        states.lost / model.loops,
        np.where(np.isfinite(closest), closest, np.nan),
        states.residual.copy(),
        states.iterations.copy(),
        kept,
        reason,
        unknown,
        unknown.copy(),
    )
    if not estimate_error or not reached:
        return curve

    def again(start, largest):
        return bend(start, direction, curve.curvature, spacings=spacings, increment=largest)

    moment, change = errors_of(relaxed, curve, increment, again)
    return curve.replaced(numerical_error=moment, change_error=change)


def phases_of(curvatures):
    """Phase and cycle, (n,) each, of curvatures in the order visited from the flat fabric."""
    before = np.concatenate([[0.0], curvatures[:-1]])
    outward = (np.abs(curvatures) > np.abs(before)) | (curvatures * before < 0.0)
    # At rest or unchanged counts as the state before, at first as loading.
    still = curvatures == before
    phase, now = np.empty(len(curvatures), dtype=np.int64), LOADING
    for i in range(len(curvatures)):
        if not still[i]:
            now = LOADING if outward[i] else RECOVERY
        phase[i] = now
    first = np.sign(curvatures[np.flatnonzero(curvatures)[:1]]).sum()
    leaves = (curvatures * first > 0.0) & (before * first <= 0.0)
    return phase, np.maximum(np.cumsum(leaves), 1)

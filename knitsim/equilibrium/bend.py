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

import numpy as np

from knitsim.equilibrium.accuracy import solved
from knitsim.equilibrium.kernels.records import ANGLE, Bend
from knitsim.equilibrium.relax import without
from knitsim.equilibrium.result import DIRECTIONS, LOADING, RECOVERY, BendingCurve
from knitsim.equilibrium.walk import Walk, ways_of
from knitsim.errors import InputError

INCREMENT = 100.0  # 1/m, largest change of curvature in one solve without friction
FRICTION_INCREMENT = 25.0
TIGHTEST = 0.5  # curvature times half the thickness, yarn included
EXACT = 1e-12  # of the tightest curvature: how far a state may be from the asked one
WIDEST = 2.0  # times the spacings at the start (or their inverse): beyond, they run away
MOST_UNKNOWNS = 6000  # of a cell: its whole Hessian and factor, kept here, take 0.9 GB


def bend(
    relaxed,
    direction,
    curvatures,
    *,
    spacings="free",
    increment=None,
    accuracy=None,
    estimate_error=False,
):
    """Bend the relaxed fabric through ``curvatures`` (1/m), in that order; a :class:`.result.BendingCurve`.

    direction: "course" or "wale", the one that becomes curved.  spacings: "free" or "held" (at the
    relaxed ones; then the moment is that about the mean plane, next to a pressure).  Friction between
    yarns and within them is that of the fabric, with what it remembers at rest.  increment: largest
    change of curvature in one solved step (1/m), 25 with friction, 100 without.  accuracy: largest
    estimated error that is asked for, of the moment and of its change; resolution and increment are then
    chosen to meet it.  estimate_error: fill numerical_error and change_error without asking for an
    accuracy (:mod:`.accuracy`).

    A path that cannot be followed to its end gives the states reached and a stop_reason.  Raises
    InputError for names that make no sense, for curvatures tighter than the fabric is thick, and for
    cells too large.
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
    tightest = TIGHTEST / (np.abs(relaxed.centrelines[:, :, 2]).max() + 0.5 * fabric.diameter)
    if not (np.abs(curvatures) <= tightest).all():
        raise InputError(
            "curvature",
            float(np.abs(curvatures).max()),
            f"must be finite and {tightest:.4g} 1/m ({1e-2 * tightest:.4g} per cm) or less: the "
            "fabric is too thick for it",
        )
    if increment is None:
        increment = FRICTION_INCREMENT if model.rub else INCREMENT
    if not 0.0 < increment < np.inf:
        raise InputError("increment", increment, "must be finite and above 0 1/m")

    def run(start, increment):
        return _bend(start, direction, curvatures, spacings, increment, EXACT * tightest)

    return solved(without(relaxed, "bent"), run, increment, accuracy, estimate_error)


def _bend(relaxed, direction, curvatures, spacings, increment, exact):
    model, bent = relaxed.model, DIRECTIONS[direction]
    at = model.lattice
    walk = Walk(
        model.dense, model.scene._replace(bend=Bend(bent)), relaxed.y,
        free=(0, 3) if spacings == "free" else (), driven=[at + ANGLE], over=[at + 3 * bent],
        largest=increment, exact=exact, widest=WIDEST,
        told=lambda target: f"curvature {target[0]:.6g} 1/m", memory=turned(relaxed.memory, bent),
    )  # fmt: skip
    width = (relaxed.course_spacing, relaxed.wale_spacing)[bent]
    flat = walk.force[at + ANGLE] / model.loops / width
    walk.forward(curvatures[:, None])
    states, force = walk.states()
    steps = len(states["y"])
    states["phase"], states["cycle"] = phases_of(curvatures[:steps])
    states["segment"] = ways_of(curvatures[:steps])
    return BendingCurve(
        **states,
        start=relaxed,
        direction=direction,
        spacings=spacings,
        width=width,
        flat_moment=float(flat),
        curvature=curvatures[:steps].copy(),
        moment_per_width=force[:, at + ANGLE] / model.loops / width,
        change_error=np.full(steps, np.nan),
    )


def turned(memory, bent):
    """What friction remembers, its vectors in the frame of a fabric that is bent along ``bent``.

    There the first component lies along the bent direction, the second along the cylinder's axis.
    """
    if memory is None or memory == () or bent == 0:
        return memory
    pairs = memory.pairs.copy()
    for name in ("held", "facing"):
        pairs[name][:, :2] = pairs[name][:, 1::-1]
    return memory._replace(pairs=pairs)


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

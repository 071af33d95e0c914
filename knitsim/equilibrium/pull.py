"""Tests of a fabric in its plane from its relaxed state: tension along course or wale, biaxial, shear.

>>> from knitsim.equilibrium.fabric import Fabric
>>> from knitsim.equilibrium.relax import relax
>>> from knitsim.yarn.law import paper_k3
>>> cotton = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))
>>> curve = tensile(relax(cotton), "course", [0.1, 0.2, 0.4])
>>> [round(1e3 * float(f), 1) for f in curve.force_per_loop]  # mN
[4.3, 8.7, 18.8]
"""

import math

import numpy as np

from knitsim.equilibrium.accuracy import solved
from knitsim.equilibrium.kernels.records import COURSE_SPACING, SHEAR, WALE_SPACING
from knitsim.equilibrium.relax import released, settle, without
from knitsim.equilibrium.result import LOADING, RECOVERY, Curve
from knitsim.equilibrium.walk import Walk, ways_of
from knitsim.errors import ComputationError, InputError

PULLED = {"course": (WALE_SPACING, COURSE_SPACING), "wale": (COURSE_SPACING, WALE_SPACING)}
LARGEST_STRAIN = 5.0
INCREMENT = 0.1  # largest increment of strain without friction
FRICTION_INCREMENT = 0.01  # of strain: cycles of 12 then lie within 1.3 % of their limit (measured)
SHORTER = (-0.01, -0.02, -0.05, -0.1, -0.2)  # strains to which a fabric is pushed to lose its force


def tensile(
    relaxed,
    direction,
    strains,
    *,
    lateral="free",
    recovery=False,
    cycles=1,
    to_force=None,
    increment=FRICTION_INCREMENT,
    accuracy=None,
    estimate_error=False,
    refine=True,
):
    """Pull the fabric along ``direction`` ("course" or "wale"); a :class:`.result.Curve`.

    strains: rising, from the relaxed state, where states are asked for.  lateral: "free", "held" (at
    the relaxed spacing), or a force per width across the pull (N/m, over the relaxed spacing along
    it).  recovery: go back through the same strains until the force is zero; that state, with the
    residual strain, is the last of the cycle.  cycles: how often to load and recover.  to_force: end
    loading at this force per width (N/m) where it comes before the last strain; that state is then
    the last.  increment: largest strain of one solved step with friction.  accuracy: largest estimated
    error of the force that is asked for, over max(|force|, 1 % of the largest), on the ways back that
    of the curve (:func:`knitsim.store.tensile.counted_error`); resolution and increment are then chosen
    to meet it.  estimate_error: fill numerical_error without asking for an accuracy (:mod:`.accuracy`).
    refine: whether it is solved again with more contact points where it ends for want of them.

    A path that cannot be followed to its end gives the states reached and a stop_reason.  Raises
    InputError for strains, forces or names that make no sense, ComputationError where the lateral
    load has no equilibrium.
    """
    if direction not in PULLED:
        raise InputError("direction", direction, "must be course or wale")
    strains = _rising("strains", strains)
    if cycles < 1 or (cycles > 1 and not recovery):
        raise InputError("cycles", cycles, "must be 1 or more, and recovery asked for above 1")
    if to_force is not None and not to_force > 0:
        raise InputError("to_force", to_force, "must be above 0 N/m")

    def run(start, increment):
        return _tensile(start, direction, strains, lateral, recovery, cycles, to_force, increment)

    return solved(relaxed, run, increment, accuracy, estimate_error, refine)


def _tensile(relaxed, direction, strains, lateral, recovery, cycles, to_force, increment):
    pulled, across = PULLED[direction]
    start, load, free = laterally(relaxed, pulled, across, lateral)
    length = (relaxed.wale_spacing, 0.0, 0.0, relaxed.course_spacing)
    base, width = length[pulled], length[across]
    walk = walk_from(relaxed, start, free, [pulled], load, increment, base, strains_in(base))
    at = relaxed.model.lattice + pulled
    top = None if to_force is None else to_force * width * relaxed.model.loops
    for cycle in range(1, cycles + 1):
        asked = strains[strains > walk.y[at] / base - 1.0 + 1e-12]
        if not walk.forward(base * (1.0 + asked)[:, None], LOADING, cycle, top):
            break
        if not recovery:
            continue
        peak = walk.y[at] / base - 1.0
        # Held across, friction may leave it under tension at its first length.
        back = np.concatenate([strains[strains < peak - 1e-12][::-1], [0.0], SHORTER])
        if not walk.back(base * (1.0 + back)[:, None], cycle):
            break
    return curve_of(relaxed, walk, direction, pulled, base, width, free, load)


def biaxial(relaxed, strains, *, increment=FRICTION_INCREMENT):
    """Prescribe both spacings; strains: (steps, 2), along course and wale, from the relaxed state.

    A :class:`.result.Curve`; force_per_loop is that along the course, ``forces`` has both.
    """
    strains = np.asarray(strains, dtype=float)
    if strains.ndim != 2 or strains.shape[1] != 2 or not np.isfinite(strains).all():
        raise InputError("strains", strains.shape, "must be finite, of shape (steps, 2)")
    if (strains <= -0.9).any() or (strains > LARGEST_STRAIN).any():
        raise InputError("strains", strains.min(), f"must be between -0.9 and {LARGEST_STRAIN:g}")
    relaxed = released(relaxed, rubs=True)
    base = np.array([relaxed.wale_spacing, relaxed.course_spacing])
    driven, load = [WALE_SPACING, COURSE_SPACING], np.zeros(4)
    walk = walk_from(relaxed, relaxed.y, (), driven, load, increment, base.min(), strains_in(base))
    walk.forward(base * (1.0 + strains))
    return curve_of(relaxed, walk, "biaxial", WALE_SPACING, base[0], base[1], (), load)


def shear(
    relaxed,
    angles,
    *,
    lateral="free",
    tension=0.0,
    increment=FRICTION_INCREMENT,
    accuracy=None,
    estimate_error=False,
):
    """Shear the fabric in its plane, courses sliding over each other; a :class:`.result.Curve`.

    angles: (rad) in the order visited, e.g. 0 to 8 degrees, to -8, to 0; the course a wale above
    moves by course_spacing tan(angle) of the relaxed state along the course.  lateral: wale spacing
    "free" or "held".  tension: force per width along the wale (N/m), kept throughout; the course
    spacing is free.  force_per_width is the shear force over the relaxed wale spacing.  Shear has no
    mirror symmetry; the state is carried over into a cell without.  accuracy, estimate_error: as in
    tensile.
    """
    angles = np.asarray(angles, dtype=float)
    if angles.ndim != 1 or not angles.size or not (np.abs(angles) < 1.0).all():
        raise InputError("angles", angles.tolist(), "must be finite and within 1 rad")
    if lateral not in ("free", "held"):
        raise InputError("lateral", lateral, "must be free or held")

    def run(start, increment):
        return _shear(start, angles, lateral, tension, increment)

    return solved(without(relaxed, "sheared"), run, increment, accuracy, estimate_error)


def _shear(relaxed, angles, lateral, tension, increment):
    base = relaxed.course_spacing
    load = np.zeros(4)
    load[COURSE_SPACING] = tension * relaxed.wale_spacing
    free = (COURSE_SPACING, WALE_SPACING) if lateral == "free" else (COURSE_SPACING,)
    start = _under_load(relaxed, relaxed.y, free, load) if tension else relaxed.y

    def told(target):
        return f"an angle of {math.degrees(math.atan(target[0] / base)):.4g} degrees"

    walk = walk_from(relaxed, start, free, [SHEAR], load, increment, base, told)
    walk.forward(base * np.tan(angles)[:, None])
    curve = curve_of(relaxed, walk, "shear", SHEAR, base, relaxed.wale_spacing, free, load)
    rising = np.diff(np.abs(angles[: curve.steps]), prepend=0.0) >= 0.0
    return curve.replaced(
        strain=np.arctan(curve.strain + 1.0), phase=np.where(rising, LOADING, RECOVERY),
        segment=ways_of(angles[: curve.steps]),
    )  # fmt: skip


def walk_from(relaxed, start, free, driven, load, increment, spacing, told):
    """A :class:`.walk.Walk` in the plane; increment: of strain, with friction."""
    model = relaxed.model
    step = increment if model.rub else INCREMENT
    return Walk(
        model, model.with_load(load), start, free=free, driven=[model.lattice + d for d in driven],
        largest=step * spacing, told=told, memory=relaxed.memory,
    )  # fmt: skip


def curve_of(relaxed, walk, test, pulled, base, width, free, load):
    """The rows of a walk as a :class:`.result.Curve`."""
    if not walk.rows:
        raise ComputationError(f"{test} test: no state was reached: {walk.reason}")
    states, force = walk.states()
    model, y = relaxed.model, states["y"]
    at = model.lattice
    forces = force[:, at : at + 4] / model.loops
    if any(one.sign[0] != one.sign[1] for one in model.cell.symmetries):
        # The images of a loop and its mirror cancel; alone, either knows a shear force.
        forces[:, 1:3] = 0.0
    return Curve(
        **states,
        start=relaxed,
        test=test,
        strain=y[:, at + pulled] / base - 1.0,
        wale_strain=y[:, at + COURSE_SPACING] / relaxed.course_spacing - 1.0,
        force_per_loop=forces[:, pulled],
        force_per_width=forces[:, pulled] / width,
        forces=forces,
        status=np.zeros(len(y), dtype=np.int64),
        driven=pulled,
        free=tuple(free),
        load=np.asarray(load),
    )


def strains_in(base):
    """A function that tells spacings (m) as strains from those at rest, ``base``."""

    def told(target):
        strains = 100.0 * (np.asarray(target) / base - 1.0)
        return "a strain of " + " and ".join(f"{strain:.4g} %" for strain in strains)

    return told


def _rising(name, values):
    values = np.atleast_1d(np.asarray(values, dtype=float))
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise InputError(name, values.tolist(), "must be one or more finite numbers")
    if values[0] < 0 or values[-1] > LARGEST_STRAIN or (np.diff(values) <= 0).any():
        raise InputError(
            name, values.tolist(), f"must rise, from 0 on, to {LARGEST_STRAIN:g} at most"
        )
    return values


def laterally(relaxed, pulled, across, lateral):
    """Start, dead load (4,) and free lattice entries for a lateral condition."""
    load = np.zeros(4)
    if isinstance(lateral, str):
        if lateral not in ("free", "held"):
            raise InputError("lateral", lateral, "must be free, held or a force per width (N/m)")
        return relaxed.y, load, (across,) if lateral == "free" else ()
    if not math.isfinite(lateral):
        raise InputError("lateral", lateral, "must be finite (N/m)")
    width = relaxed.wale_spacing if pulled == WALE_SPACING else relaxed.course_spacing
    load[across] = lateral * width
    return _under_load(relaxed, relaxed.y, (across,), load), load, (across,)


def _under_load(relaxed, y, free, load, parts=4):
    """Equilibrium under a dead load on the lattice, brought up in parts."""
    model = relaxed.model
    for part in range(1, parts + 1):
        scene = model.with_load(np.asarray(load) * part / parts)
        y = settle(model, y, model.free(*free), scene=scene).y
    return y

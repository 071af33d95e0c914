"""Tests of a fabric from its relaxed state: tension along course or wale, biaxial, shear.

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

from knitsim.equilibrium.accuracy import fine_relaxed, increment_error, spatial_error
from knitsim.equilibrium.kernels.follow import REACHED, March, new_trail
from knitsim.equilibrium.relax import REASONS, settle
from knitsim.equilibrium.result import LOADING, RECOVERY, Curve
from knitsim.equilibrium.solve import follow, gradient_at
from knitsim.errors import ComputationError, InputError

# Entries of the lattice L.
WALE_SPACING, COURSE_SPACING, SHEAR = 0, 3, 2
_PULLED = {"course": (WALE_SPACING, COURSE_SPACING), "wale": (COURSE_SPACING, WALE_SPACING)}
LARGEST_STRAIN = 5.0
INCREMENT = 0.1  # largest increment of strain without friction
FRICTION_INCREMENT = 0.02
SLIP_ROUNDING = 0.02  # of the step's own length, see March
LAG_PASSES = 4
ROUGH = 0.3  # coefficient of friction above which as many more passes are taken: each leaves more
SHORTER = (-0.01, -0.02, -0.05, -0.1, -0.2)  # strains to which a fabric is pushed to lose its force
FORCE_TOLERANCE = 1e-6  # relative, where a force is asked for


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
    estimate_error=False,
):
    """Pull the fabric along ``direction`` ("course" or "wale"); a :class:`Curve`.

    strains: rising, from the relaxed state, where states are asked for.  lateral: "free", "held" (at
    the relaxed spacing), or a force per width across the pull (N/m, over the relaxed spacing along
    it).  recovery: go back through the same strains until the force is zero; that state, with the
    residual strain, is the last of the cycle.  cycles: how often to load and recover.  to_force: end
    loading at this force per width (N/m) where it comes before the last strain; that state is then
    the last.  increment: largest strain of one solved step with friction.  estimate_error: fill
    numerical_error, by solving some states (with friction the test) again, finer or coarser.

    A path that cannot be followed to its end gives the states reached and a stop_reason.  Raises
    InputError for strains, forces or names that make no sense, ComputationError where the lateral
    load has no equilibrium.
    """
    if direction not in _PULLED:
        raise InputError("direction", direction, "must be course or wale")
    strains = _rising("strains", strains)
    if cycles < 1 or (cycles > 1 and not recovery):
        raise InputError("cycles", cycles, "must be 1 or more, and recovery asked for above 1")
    if to_force is not None and not to_force > 0:
        raise InputError("to_force", to_force, "must be above 0 N/m")
    pulled, across = _PULLED[direction]
    start, load, free = _laterally(relaxed, pulled, across, lateral)
    length = (relaxed.wale_spacing, 0.0, 0.0, relaxed.course_spacing)
    base = length[pulled]
    walk = _Walk(relaxed, start, free, [pulled], load, increment, base, _strains_in(base))
    width = length[across]
    top = None if to_force is None else to_force * width * relaxed.model.loops
    for cycle in range(1, cycles + 1):
        low = walk.strain_of(pulled, base)
        asked = strains[strains > low + 1e-12]
        if not walk.forward(base * (1.0 + asked)[:, None], LOADING, cycle, top):
            break
        if not recovery:
            continue
        peak = walk.strain_of(pulled, base)
        # Held across, friction may leave it under tension at its first length.
        back = np.concatenate([strains[strains < peak - 1e-12][::-1], [0.0], SHORTER])
        if not walk.back(base * (1.0 + back)[:, None], cycle):
            break
    curve = walk.curve(direction, pulled, base, width)
    if not estimate_error:
        return curve

    def again(start, increment):
        return tensile(
            start, direction, strains, lateral=lateral, recovery=recovery, cycles=cycles,
            to_force=to_force, increment=increment,
        )  # fmt: skip

    return _with_error(relaxed, curve, again, increment)


def _with_error(relaxed, curve, again, increment):
    """The Curve with its estimated error; again(start, increment) runs the same test."""
    if relaxed.model.fabric.friction == 0.0:
        return curve.replaced(numerical_error=spatial_error(relaxed, curve))
    # With friction the force depends on the way: the whole test again, finer and in coarser steps.
    try:
        fine, coarse = again(fine_relaxed(relaxed), increment), again(relaxed, 2.0 * increment)
        error = increment_error(curve, fine) + increment_error(curve, coarse)
    except ComputationError:
        error = np.full(curve.steps, np.nan)
    return curve.replaced(numerical_error=error)


def biaxial(relaxed, strains, *, increment=FRICTION_INCREMENT):
    """Prescribe both spacings; strains: (steps, 2), along course and wale, from the relaxed state.

    A :class:`Curve`; force_per_loop is that along the course, ``forces`` has both.
    """
    strains = np.asarray(strains, dtype=float)
    if strains.ndim != 2 or strains.shape[1] != 2 or not np.isfinite(strains).all():
        raise InputError("strains", strains.shape, "must be finite, of shape (steps, 2)")
    if (strains <= -0.9).any() or (strains > LARGEST_STRAIN).any():
        raise InputError("strains", strains.min(), f"must be between -0.9 and {LARGEST_STRAIN:g}")
    base = np.array([relaxed.wale_spacing, relaxed.course_spacing])
    walk = _Walk(
        relaxed,
        relaxed.y,
        (),
        [WALE_SPACING, COURSE_SPACING],
        np.zeros(4),
        increment,
        base.min(),
        _strains_in(base),
    )
    walk.forward(base * (1.0 + strains), LOADING, 1, None)
    return walk.curve("biaxial", WALE_SPACING, base[0], base[1])


def shear(
    relaxed,
    angles,
    *,
    lateral="free",
    tension=0.0,
    increment=FRICTION_INCREMENT,
    estimate_error=False,
):
    """Shear the fabric in its plane, courses sliding over each other; a :class:`Curve`.

    angles: (rad) in the order visited, e.g. 0 to 8 degrees, to -8, to 0; the course a wale above
    moves by course_spacing tan(angle) of the relaxed state along the course.  lateral: wale spacing
    "free" or "held".  tension: force per width along the wale (N/m), kept throughout; the course
    spacing is free.  force_per_width is the shear force over the relaxed wale spacing.  ``relaxed``
    must be of the full cell, since shear has no mirror symmetry.  estimate_error: as in tensile.
    """
    angles = np.asarray(angles, dtype=float)
    if angles.ndim != 1 or not angles.size or not (np.abs(angles) < 1.0).all():
        raise InputError("angles", angles.tolist(), "must be finite and within 1 rad")
    if relaxed.model.cell.kind != "full":
        raise InputError("cell", relaxed.model.cell.kind, "must be full for shear")
    if lateral not in ("free", "held"):
        raise InputError("lateral", lateral, "must be free or held")
    base = relaxed.course_spacing
    load = np.zeros(4)
    load[COURSE_SPACING] = tension * relaxed.wale_spacing
    free = (COURSE_SPACING, WALE_SPACING) if lateral == "free" else (COURSE_SPACING,)
    start = relaxed.y
    if tension:
        start = _under_load(relaxed, start, free, load)

    def told(target):
        return f"an angle of {math.degrees(math.atan(target[0] / base)):.4g} degrees"

    walk = _Walk(relaxed, start, free, [SHEAR], load, increment, base, told)
    walk.forward(base * np.tan(angles)[:, None], LOADING, 1, None)
    curve = walk.curve("shear", SHEAR, base, relaxed.wale_spacing)
    rising = np.diff(np.abs(angles[: curve.steps]), prepend=0.0) >= 0.0
    curve = curve.replaced(
        strain=np.arctan(curve.strain + 1.0), phase=np.where(rising, LOADING, RECOVERY)
    )
    if not estimate_error:
        return curve

    def again(start, increment):
        return shear(start, angles, lateral=lateral, tension=tension, increment=increment)

    return _with_error(relaxed, curve, again, increment)


def _strains_in(base):
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


def _laterally(relaxed, pulled, across, lateral):
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


class _Walk:
    """A test under way: the current state and the rows so far.

    told: a function that tells the values of the driven entries to the user.
    """

    def __init__(self, relaxed, start, free, driven, load, increment, spacing, told):
        self.relaxed, self.model, self.told = relaxed, relaxed.model, told
        model = relaxed.model
        self.scene = model.with_load(load)
        self.y = start.copy()
        self.work = self.lost = 0.0
        self.entry = [model.lattice + d for d in driven]
        fabric = model.fabric
        step = increment if fabric.friction > 0.0 else INCREMENT
        self.march = March(
            model.free(*free),
            np.array(self.entry),
            step * spacing,
            fabric.friction,
            SLIP_ROUNDING,
            math.ceil(LAG_PASSES * max(1.0, fabric.friction / ROUGH)),
            model.expected,
        )
        self.free, self.load = tuple(free), np.asarray(load)
        self.force = gradient_at(model, self.scene, self.y)[0] + self.scene.load
        self.past = np.zeros(self.y.size + 1)
        self.rows = []
        self.reason = ""

    def strain_of(self, entry, base):
        return self.y[self.model.lattice + entry] / base - 1.0

    def _go(self, targets):
        """Follow targets from the current state without keeping anything: trail, end."""
        trail = new_trail(len(targets), self.past)
        y, force = self.y.copy(), self.force.copy()
        reached, status = follow(
            self.model,
            self.scene,
            y,
            force,
            np.ascontiguousarray(targets),
            self.march,
            trail,
        )
        return trail, reached, status

    def _keep(self, trail, count, phase, cycle):
        """Append the first ``count`` rows of a trail and move to the last of them."""
        states = trail.states
        for i in range(count):
            self.rows.append(
                (
                    phase,
                    cycle,
                    trail.y[i],
                    trail.force[i],
                    states.terms[i],
                    states.closest[i],
                    states.residual[i],
                    self.work + states.work[i],
                    self.lost + states.lost[i],
                    states.iterations[i],
                )
            )
        if count:
            self.y, self.force = trail.y[count - 1].copy(), trail.force[count - 1].copy()
            self.past = trail.past
            self.work += states.work[count - 1]
            self.lost += states.lost[count - 1]

    def _stop(self, status, target):
        self.reason = f"{REASONS[status]}; stopped before {self.told(target)}"

    def forward(self, targets, phase, cycle, top):
        """Go through targets, or up to the force ``top`` (N per cell) on the driven entry."""
        if top is None:
            trail, reached, status = self._go(targets)
            self._keep(trail, reached, phase, cycle)
            if status != REACHED:
                self._stop(status, targets[reached])
            return status == REACHED
        for target in targets:
            trail, _, status = self._go(target[None])
            if status != REACHED:
                self._stop(status, target)
                return False
            if trail.force[0, self.entry[0]] >= top:
                return self._to_force(top, target, trail, phase, cycle)
            self._keep(trail, 1, phase, cycle)
        self.reason = "the last strain was reached before the force that was asked for"
        return True

    def back(self, targets, cycle):
        """Go back through targets until the force is zero, where it says why not if it never is."""
        for target in targets:
            trail, _, status = self._go(target[None])
            if status != REACHED:
                self._stop(status, target)
                return False
            force = trail.force[0, self.entry[0]]
            zero = FORCE_TOLERANCE * max(abs(row[3][self.entry[0]]) for row in self.rows)
            if force < -zero:
                return self._to_force(0.0, target, trail, RECOVERY, cycle)
            self._keep(trail, 1, RECOVERY, cycle)
            if force <= zero:
                return True
        self.reason = "shortened to the end of the way back, the fabric is still under tension"
        return False

    def _to_force(self, wanted, target, trail, phase, cycle):
        """The state at a force between the current one and that of ``trail`` (regula falsi)."""
        i = self.entry[0]
        a, fa = self.y[i], self.force[i] - wanted
        b, fb = target[0], trail.force[0, i] - wanted
        scale = max(abs(self.force[i]), abs(trail.force[0, i]), abs(wanted))
        for _ in range(40):
            if abs(fb) <= FORCE_TOLERANCE * scale:
                break
            if fa * fb > 0.0:
                # Already there at the start of the step.
                return True
            middle = b - fb * (b - a) / (fb - fa)
            trail, _, status = self._go(np.array([[middle]]))
            if status != REACHED:
                self._stop(status, [middle])
                return False
            f = trail.force[0, i] - wanted
            if abs(f) <= FORCE_TOLERANCE * scale:
                break
            # Illinois: halve the weight of an end that stays.
            if f * fb < 0.0:
                a, fa = b, fb
            else:
                fa *= 0.5
            b, fb = middle, f
        self._keep(trail, 1, phase, cycle)
        return True

    def curve(self, test, pulled, base, width):
        """The rows as a :class:`Curve`."""
        model, at = self.model, self.model.lattice
        if not self.rows:
            raise ComputationError(f"{test} test: no state was reached: {self.reason}")
        phase, cycle, y, force, terms, closest, residual, work, lost, used = (
            np.array(column) for column in zip(*self.rows, strict=True)
        )
        forces = force[:, at : at + 4] / model.loops
        if model.cell.kind == "quarter":
            # The images of a loop and its mirror cancel; the quarter alone knows no shear force.
            forces[:, 1:3] = 0.0
        steps = len(y)
        closest = np.where(np.isfinite(closest), closest / model.fabric.diameter, np.nan)
        return Curve(
            model,
            test,
            y[:, at + pulled] / base - 1.0,
            y[:, at + COURSE_SPACING] / self.relaxed.course_spacing - 1.0,
            phase,
            cycle,
            forces[:, pulled],
            forces[:, pulled] / width,
            forces,
            terms / model.loops,
            work / model.loops,
            lost / model.loops,
            closest,
            residual,
            used,
            np.zeros(steps, dtype=np.int64),
            y,
            pulled,
            self.free,
            self.load,
            self.reason,
            np.full(steps, np.nan),
        )

"""The fabric at rest: the loops find their own shape and spacings.

From loops that are interlooped as the pattern says, wide and flat, with a yarn as thin as they have room
for, the yarn grows to its own diameter, then the spacings are let go; where there is no room at the start
they are free as it grows.  The stated spacings matter to a yarn with set alone: a part of its curvature
in the loop held at these.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from knitsim.equilibrium.cell import KEPT
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.fold import folded, overlooked
from knitsim.equilibrium.kernels.accept import CROSSINGS_LOST, NOT_SETTLED, RAN_AWAY, TOO_CLOSE
from knitsim.equilibrium.kernels.follow import widest
from knitsim.equilibrium.kernels.newton import CONVERGED, NO_DESCENT, NOT_FINITE, TOO_MANY
from knitsim.equilibrium.kernels.records import SHEAR
from knitsim.equilibrium.model import (
    Model,
    build_model,
    carried,
    centreline,
    centrelines,
    with_diameter,
    with_set,
)
from knitsim.equilibrium.solve import gradient_at, is_plain, is_stable, minimise
from knitsim.equilibrium.start import start_from
from knitsim.errors import ComputationError, InputError
from knitsim.loop.lattice import crossings_intact

REASONS = {
    TOO_MANY: "Newton's method did not reach the tolerance",
    NO_DESCENT: "no step lowered the energy although the residual is above the tolerance",
    NOT_FINITE: "energy or residual is not finite: yarns overlap too deeply",
    CROSSINGS_LOST: "yarns passed through each other (crossings lost)",
    TOO_CLOSE: "yarns are squeezed closer together than their contact points can tell",
    RAN_AWAY: "the free spacings run away (beyond half or twice those at rest)",
    NOT_SETTLED: "the normal forces of friction do not settle",
}

# Spacings of a start: loop length over wale and course spacing, near those of a relaxed plain knit.
KW, KC = 3.75, 5.4
# Starts tried in turn: sideways overlap of the legs and thickness, in diameters.
_STARTS = (
    (1.0, 1.19), (0.6, 1.19), (1.4, 1.19), (0.3, 1.0), (2.0, 1.19), (0.1, 1.0), (3.0, 1.4),
)  # fmt: skip
_THIN = 16.0  # a start has room for a yarn of this part of the loop length
_ROOM = 0.6  # smallest distance at a start, in the diameter then used
_GROWTH, _LEAST_GROWTH = 1.25, 1.002  # of the diameter in one step; below which it has no more room
_CLEAR = 0.9  # of the gap between two cores, a core grows by this part in one step
_LEAST_APART = 0.25  # diameters: closer, yarns at rest have run into each other
RELAX_ITERATIONS, RELAX_TRUST = 1000, 6
GROWTH_ITERATIONS = 200  # on the way to the own diameter: after more a smaller step is shorter
DENSER, REFINEMENTS = 1.25, 12  # contact points: more than just enough, tries
MOST_CONTACTS = 4096  # a loop


class TooCoarse(ComputationError):
    """Contact points too far apart for how closely yarns are pressed.

    contacts: that would do, a loop; y: the unknowns found, of a symmetric model without set, or None.
    """

    def __init__(self, contacts, y=None):
        self.contacts, self.y = contacts, y
        super().__init__(
            f"relaxing the fabric: {REASONS[TOO_CLOSE]} ({contacts} contact points per loop would do)"
        )


@dataclass(frozen=True, eq=False)
class Relaxed:
    """A fabric in equilibrium at rest; start of every test.

    y: unknowns; wale_spacing, course_spacing (m); energy (4,): stretch, bend, contact, friction per loop
    (J); residual (N); min_distance (diameters, NaN where nothing is near); iterations;
    crossings_intact.  stable: whether the energy without friction has a minimum here, by all unknowns of
    the cell, shear among them; None where a symmetric cell finds one, as a larger may not (:mod:`stability`).
    memory: what friction remembers of the way here, None where nothing has moved; history: that way.
    passed: unstable states with more symmetry that were left for this one (:mod:`.fold`).
    """

    model: Model
    y: np.ndarray
    energy: np.ndarray
    residual: float
    min_distance: float
    iterations: int
    crossings_intact: bool
    stable: bool | None
    memory: tuple | None = None
    history: tuple = ()
    passed: tuple = ()
    others: dict = field(default_factory=dict, repr=False)  # the same state at other resolutions

    @property
    def jammed(self):
        """Whether squeezing and stretching hold more energy than bending: the loop is too short."""
        stretch, bend, contact = self.energy[:3]
        return bool(stretch + contact > bend)

    def __repr__(self):
        w, c = 1e3 * self.wale_spacing, 1e3 * self.course_spacing
        return f"<{self.model.fabric.pattern} at rest: {w:.4g} x {c:.4g} mm>"

    @property
    def wale_spacing(self):
        return float(self.y[self.model.lattice])

    @property
    def course_spacing(self):
        return float(self.y[self.model.lattice + 3])

    @property
    def centreline(self):
        """Points of the first loop, (points, 3), m; the last is the first of the next."""
        return centreline(self.model, self.y)

    @property
    def centrelines(self):
        """Points of every loop of the cell, (loops, points, 3), m."""
        return centrelines(self.model, self.y)


def is_intact(model, y):
    """Whether the crossings are those of the pattern, read again where other code can.

    One plain loop is read by :mod:`knitsim.loop.lattice`.  A fabric that folds shows other crossings than
    its pattern has; no step lets its yarns pass through each other where all that touch are seen.
    """
    if not model.fabric.pattern.uniform:
        return not overlooked(model, y)
    if model.loops > 1:
        return is_plain(model, y)
    lattice = y[model.lattice : model.lattice + 4].reshape(2, 2)
    # Purl is plain knit seen from the back.
    side = 1.0 if model.fabric.pattern.stitch(0, 0) == "k" else -1.0
    points = centreline(model, y) * [1.0, 1.0, side]
    return crossings_intact(points, np.pad(lattice, ((0, 0), (0, 1))))


def relax(fabric, resolution=None):
    """The fabric at rest (:class:`Relaxed`), both spacings free.

    It is sought with the symmetry of the pattern.  A cell without symmetry is filled with what is found,
    and this state is reported, also where the loops would exchange yarn or turn sideways if nothing but
    friction kept them from it (Relaxed.stable).

    Contact points are taken as many as the state found needs.  Raises InputError for a resolution that is
    too coarse or a yarn for which the loop has no room, and ComputationError where no start leads to an
    interlooped equilibrium.
    """
    resolution = Resolution() if resolution is None else resolution

    def run(contacts, y):
        return _relax(fabric, replace(resolution, contacts=contacts), y)

    return refining(run, resolution.contacts)


def refining(run, contacts):
    """run(contacts, y) with more contact points per loop as long as it is :class:`TooCoarse`.

    y: the unknowns found before, or None.
    """
    y = None
    for _ in range(REFINEMENTS):
        try:
            return run(contacts, y)
        except TooCoarse as error:
            if error.contacts > MOST_CONTACTS:
                raise
            contacts, y = error.contacts, error.y
    return run(contacts, y)


def _relax(fabric, resolution, y):
    model = build_model(fabric, resolution)
    one, left = symmetric_of(model), ()
    y, used = _at_rest(one, y)
    if not fabric.pattern.uniform:
        one, y, used, left = folded(one, y, used)
        model = one if model.cell.symmetric else model
    if fabric.set_fraction > 0.0:
        held = held_state(one, y)
        if one is not model:
            model = build_model(fabric, model.resolution, model.cell.symmetries, model.sparse, True)
            model = with_set(model, carried(model, one, held))
            one = with_set(one, held)
        else:
            one = model = with_set(one, held)
        try:
            alone = settle(one, held, one.free(0, 3), used)
        except ComputationError:
            alone = settle(one, y, one.free(0, 3), used)
    else:
        alone = settle(one, y, one.free(0, 3), used)
    if one is not model:
        alone = settle(model, carried(model, one, alone.y), model.free(0, 3), alone.iterations)
    return replace(released(alone), passed=left)


def released(relaxed, rubs=False):
    """The relaxed state in a cell that holds no yarn from sliding along itself, if its set does.

    rubs: if friction does, as in every test with it.  Where neither does, nothing depends on how far yarns
    have slid, and the cell must say it.
    """
    model = relaxed.model
    if not model.cell.holds or not (model.held is not None or (rubs and model.rub)):
        return relaxed
    other = build_model(model.fabric, model.resolution, model.cell.symmetries, model.sparse, True)
    y = carried(other, model, relaxed.y)
    if model.held is None:
        return replace(relaxed, model=other, y=y, others={})
    other = with_set(other, carried(other, model, model.held))
    return settle(other, y, other.free(0, 3), relaxed.iterations)


def symmetric_of(model):
    """The model of the same fabric and points with all symmetries; itself where it has them."""
    if len(model.cell.symmetries) == len(model.fabric.pattern.symmetries()):
        return model
    return build_model(model.fabric, Resolution(model.cell.points, model.cell.contacts))


def without(relaxed, kept):
    """The relaxed state in a cell with only these symmetries of the pattern (:data:`.cell.KEPT`)."""
    model, fabric = relaxed.model, relaxed.model.fabric
    # Of those that the state has: a rib that has folded has fewer than its pattern.
    left = tuple(one for one in model.cell.symmetries if KEPT[kept](one))
    if left == model.cell.symmetries:
        return relaxed
    points = Resolution(model.cell.points, model.cell.contacts)
    other = build_model(fabric, points, left, slides=model.held is not None)
    if model.held is not None:
        other = with_set(other, carried(other, model, model.held))
    state = settle(other, carried(other, model, relaxed.y), other.free(0, 3), relaxed.iterations)
    state = released(state)
    if not relaxed.history:
        return state
    from knitsim.equilibrium.programme import handled

    return handled(state, relaxed.history)


def settle(model, y, free, used=0, scene=None):
    """Equilibrium (:class:`Relaxed`) near y with the given free unknowns.

    Raises ComputationError where it is not reached or not interlooped.
    """
    scene = model.scene if scene is None else scene
    y = y.copy()
    control = model.control._replace(limit=RELAX_ITERATIONS)
    status, iterations, residual, work = minimise(model, scene, y, free, control)
    if status in (TOO_MANY, NO_DESCENT):
        # A yarn that hardly stretches or bends: whole steps on trust get on where a search crawls.
        trusting = control._replace(trust=RELAX_TRUST)
        status, more, residual, work = minimise(model, scene, y, free, trusting)
        iterations += more
    if status == CONVERGED and not is_intact(model, y):
        status = CROSSINGS_LOST
    if status == CONVERGED and _run_into(model, np.sqrt(work.closest[0])):
        status = TOO_CLOSE
    if status == CONVERGED:
        check_fine(model, np.sqrt(work.closest[0]))
    if status != CONVERGED:
        raise ComputationError(
            f"relaxing the fabric: {REASONS[status]} (residual {residual:.3g} N)"
        )
    distance = np.sqrt(work.closest[0]) / model.fabric.diameter
    return Relaxed(
        model,
        y,
        np.append(work.terms, 0.0) / model.loops,
        residual,
        float(distance) if np.isfinite(distance) else np.nan,
        used + iterations,
        True,
        _stable(model, scene, y, np.union1d(free, model.free(SHEAR))),
    )


def _stable(model, scene, y, free):
    """Relaxed.stable: what a symmetric cell finds unstable is so, the reverse need not hold."""
    stable = is_stable(model, scene, y, free)
    return None if stable and model.cell.symmetric else stable


def _run_into(model, nearest):
    """Whether a smallest distance (m) says that the yarn has run into itself.

    An unloaded yarn is squeezed to half its diameter at most; where the search for a start has pushed
    two places of it into each other, discrete contact points may hold them there.
    """
    return not model.scene.law.core and nearest < _LEAST_APART * model.fabric.diameter


def check_fine(model, nearest, y=None):
    """Raises TooCoarse where contact points stand too far apart for a smallest distance (m) of yarns at y."""
    if not np.isfinite(nearest):
        return
    needed = np.sqrt(max(widest(nearest**2, model.scene.law.core), 0.0))
    spacing = model.scene.touch.points[0].length
    if spacing > needed:
        contacts = model.cell.contacts * min(DENSER * spacing / max(needed, 1e-3 * spacing), 4.0)
        raise TooCoarse(4 * int(np.ceil(contacts / 4.0)), y)


def _at_rest(model, near=None):
    """Unknowns of an interlooped equilibrium with spacings near those at rest, and the iterations used.

    near: unknowns to begin with, of fewer contact points.
    """
    length = model.fabric.loop_length
    if near is not None:
        try:
            found = settle(model, near, model.free(0, 3))
            return found.y, found.iterations
        except TooCoarse as error:
            raise TooCoarse(error.contacts, near) from None
        except ComputationError:
            pass
    reasons, thickest = [], 0.0
    for free in ((), (0, 3)):
        for y in _starting_shapes(model, length / KW, length / KC, reasons):
            done, used, reached = _grow(model, y, free)
            if done == CONVERGED:
                return y, used
            thickest = max(thickest, reached)
            reasons.append(REASONS[done])
    if thickest > 0.0:
        raise InputError(
            "diameter", model.fabric.diameter,
            f"the loop has no room for the yarn: a yarn of {1e3 * thickest:.4g} mm was laid into this "
            "loop length; give a thinner yarn, a softer contact law or a longer loop",
        )  # fmt: skip
    raise ComputationError(f"no equilibrium at rest; the starts gave: {reasons}")


def held_state(model, rest=None):
    """Unknowns of a symmetric model without set held at the stated spacings, of which a set is a part.

    rest: its unknowns at rest, from which it is pulled there where no start of its own is found.
    """
    fabric, reasons = model.fabric, []
    for y in _starting_shapes(model, fabric.wale_spacing, fabric.course_spacing, reasons):
        done, *_ = _grow(model, y, ())
        if done == CONVERGED:
            return y
        reasons.append(REASONS[done])
    rest = _at_rest(model)[0] if rest is None else rest
    return _pulled_to(model, rest, (fabric.wale_spacing, fabric.course_spacing))


def _pulled_to(model, rest, spacings):
    """Unknowns held at these spacings (m), reached along a path from rest."""
    from knitsim.equilibrium.walk import Walk

    at = model.lattice
    walk = Walk(
        model, model.scene, rest, free=(), driven=[at, at + 3], rub=(), memory=(),
        largest=0.05 * min(spacings), told=lambda target: "them",
    )  # fmt: skip
    if walk.forward(np.array([spacings])):
        return walk.y
    if walk.ended == TOO_CLOSE:
        raise TooCoarse(4 * int(np.ceil(DENSER * model.cell.contacts / 4.0)))
    reached = " x ".join(f"{1e3 * walk.reached[i]:.4g}" for i in (at, at + 3))
    raise InputError(
        "set", model.fabric.set_fraction,
        f"the loop has no room at the stated spacings, at which the yarn took its set: on the way "
        f"there from rest it came to {reached} mm; state spacings that it has room for, or set 0",
    )  # fmt: skip


def check_start(fabric, resolution=None):
    """Raises InputError if no starting shape of the loop is interlooped; nothing is solved."""
    model, reasons, length = build_model(fabric, resolution), [], fabric.loop_length
    if not any(True for _ in _starting_shapes(model, length / KW, length / KC, reasons)):
        raise InputError("loop length", length, f"no loop can be laid ({reasons[0]})")


def _starting_shapes(model, wale_spacing, course_spacing, reasons):
    """Unknowns of the interlooped starts in turn; why one is left out is added to reasons."""
    fabric = model.fabric
    thin = min(fabric.diameter, fabric.loop_length / _THIN)
    for overlap, thick in _STARTS:
        try:
            y = start_from(model, overlap * thin, thick * thin, wale_spacing, course_spacing)
        except ComputationError as error:
            reasons.append(str(error))
            continue
        if is_plain(model, y):
            yield y
        else:
            reasons.append("start not interlooped")


def _grow(model, y, free):
    """Equilibrium in place, the diameter growing to its own; free: lattice entries that give way.

    Returns status, iterations and the largest diameter (m) with an equilibrium.
    """
    own = model.fabric.diameter
    # Part of the diameter that must stay clear: a core, which scales with the diameter.
    core = model.fabric.contact.core(own) / own
    nearest = _nearest(model, y)
    diameter = min(own, nearest / max(_ROOM, core / _CLEAR))
    total, reached, growth, good, status = 0, 0.0, _GROWTH, y.copy(), CONVERGED
    while True:
        grown = model if diameter == own else with_diameter(model, diameter)
        # The first state has no other to begin from.
        limit = RELAX_ITERATIONS if diameter == own or not reached else GROWTH_ITERATIONS
        control = model.control._replace(limit=limit)
        status, used, *_ = minimise(model, grown.scene, y, model.free(*free), control)
        total += used
        if status == CONVERGED and model.fabric.pattern.uniform and not is_plain(model, y):
            status = CROSSINGS_LOST
        if status == CONVERGED:
            reached, nearest, good = diameter, _nearest(model, y), y.copy()
            if diameter == own:
                if _run_into(model, nearest):
                    return TOO_CLOSE, total, reached
                check_fine(model, nearest, y)
                return (CONVERGED if is_intact(model, y) else CROSSINGS_LOST), total, reached
        else:
            y[:] = good
            if reached == 0.0:
                return status, total, reached
            # Half way to what failed, at most.
            growth = np.sqrt(min(growth, diameter / reached))
        diameter = growth * reached
        if core:
            # The new core stays clear of what is there.
            diameter = min(diameter, reached + _CLEAR * (nearest / core - reached))
        if diameter < min(own, _LEAST_GROWTH * reached):
            return NOT_FINITE if status == CONVERGED else status, total, reached
        diameter = min(diameter, own)


def _nearest(model, y):
    """Smallest distance between contact points that count as touching (m)."""
    return gradient_at(model, model.scene, y)[1]

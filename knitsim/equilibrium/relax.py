"""The fabric at rest: the loop finds its own shape and spacings.

From a sinusoidal loop of the stated length the loop is first brought to equilibrium at the stated
spacings, then the spacings are let go.  Where the start has yarns closer than they like, the
diameter grows from what the start has room for.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium import spline
from knitsim.equilibrium import start as shape
from knitsim.equilibrium.cell import loop_of, pack
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.kernels.follow import CROSSINGS_LOST, TOO_CLOSE
from knitsim.equilibrium.kernels.newton import (
    CONVERGED,
    NO_DESCENT,
    NOT_FINITE,
    TOO_MANY,
)
from knitsim.equilibrium.model import (
    Model,
    build_model,
    centreline,
    centrelines,
    with_diameter,
    with_set,
)
from knitsim.equilibrium.solve import gradient_at, is_plain, is_stable, minimise
from knitsim.errors import ComputationError, InputError
from knitsim.loop.lattice import crossings_intact
from knitsim.loop.peirce import peirce_length

REASONS = {
    TOO_MANY: "Newton's method did not reach the tolerance",
    NO_DESCENT: "no step lowered the energy although the residual is above the tolerance",
    NOT_FINITE: "energy or residual is not finite: yarns overlap too deeply",
    CROSSINGS_LOST: "yarns passed through each other (crossings lost)",
    TOO_CLOSE: "yarns are squeezed closer together than their contact points stand",
}

# Starts tried in turn: sideways overlap of the legs and thickness, in diameters.
_STARTS = (
    (1.0, 1.19), (0.6, 1.19), (1.4, 1.19), (0.3, 1.0), (2.0, 1.19), (0.1, 1.0), (3.0, 1.4),
)  # fmt: skip
_ROOM = 0.6  # smallest distance at a start, in the diameter then used
_GROWTH, _GROWTH_STEPS = 1.25, 60  # of the diameter in one step; steps at most
_CLEAR = 0.97  # a core takes at most this part of the smallest distance
_LEAST_APART = 0.25  # diameters: closer, yarns at rest have run into each other
RELAX_ITERATIONS, RELAX_TRUST = 1000, 6


@dataclass(frozen=True, eq=False)
class Relaxed:
    """A fabric in equilibrium at rest; start of every test.

    y: unknowns; wale_spacing, course_spacing (m); energy (3,): stretch, bend, contact per loop (J);
    residual (N); min_distance (diameters, NaN where nothing is near); iterations; crossings_intact.
    stable: whether the energy without friction has a minimum here, by all unknowns of the cell; None
    for the quarter, which cannot know (see :mod:`stability`).
    """

    model: Model
    y: np.ndarray
    energy: np.ndarray
    residual: float
    min_distance: float
    iterations: int
    crossings_intact: bool
    stable: bool | None

    @property
    def wale_spacing(self):
        return float(self.y[self.model.lattice])

    @property
    def course_spacing(self):
        return float(self.y[self.model.lattice + 3])

    @property
    def centrelines(self):
        """Points of every loop of the cell, (loops, points, 3), m; see model.centrelines."""
        return centrelines(self.model, self.y)

    @property
    def centreline(self):
        """Points of the first loop, (points, 3), m; of one alone the last is the first, a wale on."""
        return self.centrelines[0]


def is_intact(model, y):
    """Crossings as in plain knit, checked on one whole loop by :mod:`knitsim.loop.lattice`."""
    lattice = y[model.lattice :].reshape(2, 2)
    c = model.cell
    if c.wales * c.courses > 1:
        return is_plain(model, y)
    return crossings_intact(centreline(model, y), np.pad(lattice, ((0, 0), (0, 1))))


def relax(fabric, resolution=None):
    """The fabric at rest (:class:`Relaxed`), both spacings free.

    A cell of several loops is filled with the symmetric loop at rest, and this state is reported,
    also where the loops would exchange yarn if nothing but friction kept them from it
    (Relaxed.stable).

    Raises InputError for a resolution that is too coarse or a fabric without a start, and
    ComputationError where no start leads to an interlooped equilibrium.
    """
    model = build_model(fabric, resolution)
    if model.loops > 1:
        one = build_model(fabric, Resolution(model.cell.points, model.cell.contacts))
        held, used = _held_start(one)
        if fabric.set_fraction > 0.0:
            one, model = with_set(one, held), with_set(model, spread(model, one, held))
        alone = settle(one, held, one.free(0, 3), used)
        y, used = spread(model, one, alone.y), alone.iterations
    else:
        y, used = _held_start(model)
        if fabric.set_fraction > 0.0:
            model = with_set(model, y)
    return settle(model, y, model.free(0, 3), used)


def spread(model, one, y):
    """Unknowns of a full cell's ``model`` with every loop like the state y of the one-loop model."""
    return pack(model.cell, loop_of(one.cell, y), y[one.lattice :])


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
    if status != CONVERGED:
        raise ComputationError(
            f"relaxing the fabric: {REASONS[status]} (residual {residual:.3g} N)"
        )
    distance = np.sqrt(work.closest[0]) / model.fabric.diameter
    return Relaxed(
        model,
        y,
        work.terms / model.loops,
        residual,
        float(distance) if np.isfinite(distance) else np.nan,
        used + iterations,
        True,
        is_stable(model, scene, y, free) if model.cell.kind == "full" else None,
    )


def _run_into(model, nearest):
    """Whether a smallest distance (m) says that the yarn has run into itself.

    An unloaded yarn is squeezed to half its diameter at most; where the search for a start has pushed
    two places of it into each other, discrete contact points may hold them there.
    """
    least = model.scene.touch.points[0].length
    if not model.fabric.contact.core(model.fabric.diameter):
        least = max(least, _LEAST_APART * model.fabric.diameter)
    return nearest < least


def held_state(fabric, resolution=None):
    """Unknowns of the loop at equilibrium at the stated spacings, of which a set is a part."""
    return _held_start(build_model(fabric, resolution))[0]


def _held_start(model):
    """An interlooped equilibrium at the stated spacings, and the iterations that it took."""
    reasons = []
    control = model.control._replace(limit=RELAX_ITERATIONS)
    for y in _starting_shapes(model, reasons):
        if not is_plain(model, y):
            reasons.append("start not interlooped")
            continue
        done, used = _grow(model, y, control)
        if done == CONVERGED and _run_into(model, _nearest(model, y)):
            done = TOO_CLOSE
        if done == CONVERGED and is_intact(model, y):
            return y, used
        reasons.append(REASONS.get(done, REASONS[CROSSINGS_LOST]))
    if not any(r in REASONS.values() for r in reasons):
        raise _no_start(model.fabric, reasons)
    raise ComputationError(f"no equilibrium at the stated spacings; the starts gave: {reasons}")


def check_start(fabric, resolution=None):
    """Raises InputError if no starting shape of the loop is interlooped; nothing is solved."""
    model, reasons = build_model(fabric, resolution), []
    if not any(is_intact(model, y) for y in _starting_shapes(model, reasons)):
        raise _no_start(fabric, [*reasons, "start not interlooped"])


def _starting_shapes(model, reasons):
    """Unknowns of the loops that are tried in turn; why one does not exist is added to reasons."""
    fabric = model.fabric
    thin = min(fabric.diameter, fabric.loop_length / 16.0)
    for overlap, thick in _STARTS:
        try:
            yield start_from(model, overlap * thin, thick * thin)
        except ComputationError as error:
            reasons.append(str(error))


def _no_start(fabric, reasons):
    usual = peirce_length(fabric.wale_spacing, fabric.course_spacing, fabric.diameter)
    return InputError(
        "loop length",
        fabric.loop_length,
        f"too short or too long to interloop at these spacings ({reasons[0]}); Peirce's loop there "
        f"has {1e3 * usual:.4g} mm",
    )


def start_from(model, overlap, thick):
    """Unknowns of a sinusoidal loop at the stated spacings (see :mod:`shape`)."""
    fabric, n = model.fabric, model.cell.points
    points = shape.sinusoidal_loop(fabric.wale_spacing, fabric.loop_length, overlap, thick, n)
    control = spline.interpolate_periodic(points, [fabric.wale_spacing, 0.0, 0.0])
    control[:, 2] -= control[:, 2].mean()
    return pack(model.cell, control, [fabric.wale_spacing, 0.0, 0.0, fabric.course_spacing])


def _grow(model, y, control):
    """Equilibrium at held spacings in place, the diameter growing to its own; status, iterations."""
    own = model.fabric.diameter
    # Part of the diameter that must stay clear: a core, which scales with the diameter.
    core = model.fabric.contact.core(own) / own
    nearest = _nearest(model, y)
    diameter = min(own, nearest / max(_ROOM, core / _CLEAR))
    total = 0
    for _ in range(_GROWTH_STEPS):
        grown = model if diameter == own else with_diameter(model, diameter)
        status, used, *_ = minimise(model, grown.scene, y, model.free(), control)
        total += used
        if status != CONVERGED or diameter == own:
            return status, total
        if not is_plain(model, y):
            return CROSSINGS_LOST, total
        diameter = min(own, _GROWTH * diameter)
        if core:
            diameter = min(diameter, _nearest(model, y) * _CLEAR / core)
    return TOO_MANY, total


def _nearest(model, y):
    """Smallest distance between contact points that count as touching (m)."""
    return gradient_at(model, model.scene, y)[1]

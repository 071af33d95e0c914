"""The fabric at rest: the loop finds its own shape and spacings.

From a sinusoidal loop of the stated length the loop is first brought to equilibrium at the stated
spacings, then the spacings are let go.  Where the start has yarns closer than they like, the
diameter grows from what the start has room for.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium import shape, spline
from knitsim.equilibrium.cell import pack
from knitsim.equilibrium.fabric import CoreContact
from knitsim.equilibrium.friction_kernels import no_slip
from knitsim.equilibrium.model import (
    Model,
    build_model,
    centreline,
    with_diameter,
    with_set,
)
from knitsim.equilibrium.newton_kernels import (
    CONVERGED,
    NO_DESCENT,
    NOT_FINITE,
    TOO_MANY,
    energy_of,
    minimise,
    new_work,
    pairs_at,
)
from knitsim.equilibrium.path_kernels import CROSSINGS_LOST, intact
from knitsim.errors import ComputationError, InputError
from knitsim.loop.lattice import crossings_intact

REASONS = {
    TOO_MANY: "Newton's method did not reach the tolerance",
    NO_DESCENT: "no step lowered the energy although the residual is above the tolerance",
    NOT_FINITE: "energy or residual is not finite: yarns overlap too deeply",
    CROSSINGS_LOST: "yarns passed through each other (crossings lost)",
}

# Starts tried in turn: sideways overlap of the legs and thickness, in diameters.
_STARTS = (
    (1.0, 1.19), (0.6, 1.19), (1.4, 1.19), (0.3, 1.0), (2.0, 1.19), (0.1, 1.0), (3.0, 1.4),
)  # fmt: skip
_ROOM = 0.6  # smallest distance at a start, in the diameter then used
_GROWTH, _GROWTH_STEPS = 1.25, 60  # of the diameter in one step; steps at most
_CLEAR = 0.97  # a core takes at most this part of the smallest distance
RELAX_ITERATIONS, RELAX_TRUST = 200, 6


@dataclass(frozen=True, eq=False)
class Relaxed:
    """A fabric in equilibrium at rest; start of every test.

    y: unknowns; wale_spacing, course_spacing (m); energy (3,): stretch, bend, contact per loop (J);
    residual (N); min_distance (diameters, NaN where nothing is near); iterations; crossings_intact.
    """

    model: Model
    y: np.ndarray
    energy: np.ndarray
    residual: float
    min_distance: float
    iterations: int
    crossings_intact: bool

    @property
    def wale_spacing(self):
        return float(self.y[self.model.lattice])

    @property
    def course_spacing(self):
        return float(self.y[self.model.lattice + 3])

    @property
    def centreline(self):
        """Points of one loop, (points, 3), m; the last is the first, one wale further."""
        return centreline(self.model, self.y)


def is_intact(model, y):
    """Crossings as in plain knit, checked on one whole loop by :mod:`knitsim.loop.lattice`."""
    lattice = y[model.lattice :].reshape(2, 2)
    c = model.cell
    if c.wales * c.courses > 1:
        return bool(intact(model.scene, model.trace, y, model.expected, new_work(model.scene)))
    return crossings_intact(centreline(model, y), np.pad(lattice, ((0, 0), (0, 1))))


def relax(fabric, resolution=None):
    """The fabric at rest (:class:`Relaxed`), both spacings free.

    Raises InputError for a resolution that is too coarse or a fabric without a start, and
    ComputationError where no start leads to an interlooped equilibrium.
    """
    model = build_model(fabric, resolution)
    y, used = _held_start(model)
    if fabric.set_fraction > 0.0:
        model = with_set(model, y)
    return settle(model, y, model.free(0, 3), used)


def settle(model, y, free, used=0, scene=None):
    """Equilibrium (:class:`Relaxed`) near y with the given free unknowns.

    Raises ComputationError where it is not reached or not interlooped.
    """
    scene = model.scene if scene is None else scene
    y, work = y.copy(), new_work(scene)
    control = model.control._replace(limit=RELAX_ITERATIONS)
    status, iterations, residual = minimise(scene, y, free, no_slip(), control, work)
    if status in (TOO_MANY, NO_DESCENT):
        # A yarn that hardly stretches or bends: whole steps on trust get on where a search crawls.
        trusting = control._replace(trust=RELAX_TRUST)
        status, more, residual = minimise(scene, y, free, no_slip(), trusting, work)
        iterations += more
    if status == CONVERGED and not is_intact(model, y):
        status = CROSSINGS_LOST
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
    )


def _held_start(model):
    """An interlooped equilibrium at the stated spacings, and the iterations that it took."""
    fabric, reasons = model.fabric, []
    work = new_work(model.scene)
    control = model.control._replace(limit=RELAX_ITERATIONS)
    thin = min(fabric.diameter, fabric.loop_length / 16.0)
    for overlap, thick in _STARTS:
        try:
            y = start_from(model, overlap * thin, thick * thin)
        except ComputationError as error:
            reasons.append(str(error))
            continue
        if not intact(model.scene, model.trace, y, model.expected, work):
            reasons.append("start not interlooped")
            continue
        done, used = _grow(model, y, control, work)
        if done == CONVERGED and is_intact(model, y):
            return y, used
        reasons.append(REASONS.get(done, REASONS[CROSSINGS_LOST]))
    if not any(r in REASONS.values() for r in reasons):
        raise InputError(
            "loop length",
            fabric.loop_length,
            f"no interlooped start at these spacings: {reasons[-1]}",
        )
    raise ComputationError(f"no equilibrium at the stated spacings; the starts gave: {reasons}")


def start_from(model, overlap, thick):
    """Unknowns of a sinusoidal loop at the stated spacings (see :mod:`shape`)."""
    fabric, n = model.fabric, model.cell.points
    points = shape.sinusoidal_loop(fabric.wale_spacing, fabric.loop_length, overlap, thick, n)
    control = spline.interpolate_periodic(points, [fabric.wale_spacing, 0.0, 0.0])
    control[:, 2] -= control[:, 2].mean()
    return pack(model.cell, control, [fabric.wale_spacing, 0.0, 0.0, fabric.course_spacing])


def _grow(model, y, control, work):
    """Equilibrium at held spacings in place, the diameter growing to its own; status, iterations."""
    own, contact = model.fabric.diameter, model.fabric.contact
    # Part of the diameter that must stay clear: a core, which scales with the diameter.
    core = contact.core / own if isinstance(contact, CoreContact) else 0.0
    nearest = _nearest(model, y)
    diameter = min(own, nearest / max(_ROOM, core / _CLEAR))
    total = 0
    for _ in range(_GROWTH_STEPS):
        grown = model if diameter == own else with_diameter(model, diameter)
        status, used, _ = minimise(grown.scene, y, model.free(), no_slip(), control, work)
        total += used
        if status != CONVERGED or diameter == own:
            return status, total
        if not intact(model.scene, model.trace, y, model.expected, work):
            return CROSSINGS_LOST, total
        diameter = min(own, _GROWTH * diameter)
        if core:
            diameter = min(diameter, _nearest(model, y) * _CLEAR / core)
    return TOO_MANY, total


def _nearest(model, y):
    """Smallest distance between contact points that count as touching (m)."""
    work = new_work(model.scene)
    scene = model.scene
    pairs = pairs_at(scene, y, 0.0, work)
    if not pairs[1].size:
        return np.inf
    energy_of(scene, y, pairs, no_slip(), 0, work)
    return float(np.sqrt(work.closest[0]))

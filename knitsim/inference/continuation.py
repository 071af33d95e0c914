"""A fabric whose inputs vary: its equilibrium followed from one set of values to the next.

A fit asks for the same test of many fabrics that differ little.  The fabric at rest is found from the
last one by Newton's method, in smaller steps where that fails, so that all trials stay on one branch.
How a state without friction answers to an input p follows from the state itself: at equilibrium g(y,
p) = 0, hence H dy/dp = -dg/dp with the Hessian H (implicit function theorem); the solver's own Hessian
is its preconditioner.  dg/dp at a fixed shape y is a difference of two gradients and needs no state to
be solved.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse.linalg import LinearOperator, gmres

from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.pairs import pairs_at
from knitsim.equilibrium.model import build_model, with_set
from knitsim.equilibrium.pull import biaxial
from knitsim.equilibrium.relax import Relaxed, relax, settle
from knitsim.errors import ComputationError, InputError
from knitsim.study.measured_keys import PARAMETERS

_BESIDE = ("wale_spacing", "course_spacing", "bending_hysteresis", "tangential_ratio")
_PARTS = (1, 2, 4, 8, 16)  # into which a change of inputs is split
PRESSED = 2.0  # contact points of a fabric that is fitted, over those at rest
MOVED = 1e-5  # diameters that an unknown is moved for d2E/dy2
EXACT, ROUNDS = 1e-4, 5  # of what is solved with it: residual, steps
DIFFERENCE = 1e-5  # relative change of an input for dg/dp at a fixed shape
LEAST_DIFFERENCE = 1e-6  # of inputs that can be zero
_FROM_ZERO = ("set", "friction", "bending_hysteresis")
_FAILURES = (ComputationError, InputError)


def inputs():
    """Where each input of a fabric stands: {name: (part, field)}, those that can be calibrated first."""
    calibrated = {n: tuple(f".{one.field}".split(".")[-2:]) for n, one in PARAMETERS.items()}
    return calibrated | {name: ("", name) for name in _BESIDE}


def check_input(name, fabric):
    """Raises InputError for a name that is not an input of this fabric."""
    if name not in inputs():
        raise InputError("parameter", name, f"must be one of {', '.join(inputs())}")
    laws = [fabric.contact.section] if fabric.contact.section else []
    why = PARAMETERS[name].meaningless(laws) if name in PARAMETERS else ""
    if why:
        raise InputError("parameter", name, why)


def value_of(fabric, name):
    """The input ``name`` of a fabric (SI)."""
    part, field = inputs()[name]
    return float(getattr(fabric.contact if part else fabric, field))


def varied(fabric, values):
    """The fabric with other inputs; values: {name: SI}.  Raises InputError as Fabric does."""
    places = inputs()
    own = {places[n][1]: float(v) for n, v in values.items() if not places[n][0]}
    contact = {places[n][1]: float(v) for n, v in values.items() if places[n][0]}
    if contact:
        own["contact"] = replace(fabric.contact, **contact)
    return replace(fabric, **own)


def _between(a, b, part):
    """The fabric a part of the way from a to b."""

    def mix(one, other):
        if other is None:  # a spacing that is not stated
            return None
        return (1.0 - part) * one + part * other

    own = {f: mix(getattr(a, f), getattr(b, f)) for place, f in inputs().values() if not place}
    contact = {f: mix(getattr(a.contact, f), getattr(b.contact, f)) for f in b.contact.quantities()}
    return replace(b, contact=replace(b.contact, **contact), **own)


@dataclass(frozen=True, eq=False)
class Rest:
    """A fabric at rest; held: unknowns of the loop held at the stated spacings (None without set)."""

    fabric: Fabric
    relaxed: Relaxed
    held: np.ndarray | None


class States:
    """Fabrics at rest, each found from the one before.

    resolution: of all of them, contact points included, so that results change smoothly with the
    inputs.  Equal requests in equal order give equal bytes.
    """

    def __init__(self, resolution):
        self.resolution = resolution
        self.last = None

    def rest(self, fabric):
        """The :class:`Rest` of a fabric.  Raises ComputationError where none is found."""
        found = self._first(fabric) if self.last is None else self._from(self.last, fabric)
        self.last = found
        return found

    def _first(self, fabric):
        try:
            rest = self._cold(replace(fabric, set_fraction=0.0))
        except _FAILURES as error:
            raise ComputationError(f"no equilibrium to start from: {error}") from error
        # The set comes last: its loop is held at spacings that may be tight.
        return self._from(rest, fabric) if fabric.set_fraction > 0.0 else rest

    def _cold(self, fabric):
        return Rest(fabric, relax(fabric, self.resolution), None)

    def _from(self, start, fabric):
        for parts in _PARTS:
            here = start
            try:
                for part in range(1, parts + 1):
                    # The last one exactly as asked.
                    aim = fabric if part == parts else _between(start.fabric, fabric, part / parts)
                    here = self._next(here, aim)
                return here
            except _FAILURES as error:
                failure = error
        raise failure

    def _next(self, start, fabric):
        before = start.relaxed.model
        model = build_model(fabric, before.resolution, before.cell.symmetries)
        held = None
        if fabric.set_fraction > 0.0:
            held = _held(model, start)
            model = with_set(model, held)
        return Rest(fabric, settle(model, start.relaxed.y, model.free(0, 3)), held)


def _held(model, start):
    """The loop of a model without set held at the stated spacings: from that of ``start``, or pulled
    there from rest."""
    fabric, at = model.fabric, model.lattice
    stated = np.array([fabric.wale_spacing, fabric.course_spacing])
    if start.held is not None:
        y = start.held.copy()
        y[[at, at + 3]] = stated
        try:
            return settle(model, y, model.free()).y
        except ComputationError:
            # Pressed too hard at the held spacings: at rest there is more room.
            pass
    smooth = build_model(replace(fabric, friction=0.0), model.resolution)
    rest = settle(smooth, start.relaxed.y, smooth.free(0, 3))
    strains = stated / [rest.wale_spacing, rest.course_spacing] - 1.0
    curve = biaxial(rest, strains[None])
    if curve.stop_reason:
        raise ComputationError(f"held at the stated spacings: {curve.stop_reason}")
    return curve.y[-1]


def common_resolution(fabrics, resolution=None):
    """The resolution with the contact points that the most demanding of the fabrics needs.

    More than at rest, for all loads of a test alike: a curve whose contact points change with an input
    would not change smoothly with it.
    """
    resolution = Resolution() if resolution is None else resolution
    if resolution.contacts is not None:
        return resolution
    most = PRESSED * max(resolution.contacts_for(f) for f in fabrics)
    return replace(resolution, contacts=4 * int(np.ceil(most / 4.0)))


def _spread(part, free, size):
    """The entries ``free`` of a vector of zeros (size,)."""
    whole = np.zeros(size)
    whole[free] = part
    return whole


class Sensitivity:
    """How equilibria of one fabric without friction answer to inputs, by the exact Hessian.

    rest: :class:`Rest`; names: inputs.  spacings (inputs, 2): d(wale, course spacing)/dp at rest.
    """

    def __init__(self, rest, names, resolution):
        self.rest, self.model = rest, rest.relaxed.model
        self.work = new_work(self.model.scene)
        self.pairs_of = {}
        self.models = [self._both_sides(name, resolution) for name in names]
        model, y = self.model, rest.relaxed.y
        free = model.free(0, 3)
        answer = self._solved(model.scene, y, free, self._by_inputs(y))
        self.spacings = answer[free[-2:]].T

    def _both_sides(self, name, resolution):
        """(Models on both sides of input ``name`` with the set that follows it, their distance).

        One-sided where the other side cannot exist (no negative friction, no thicker yarn).
        """
        fabric, held = self.rest.fabric, self.rest.held
        value = value_of(fabric, name)
        h = max(DIFFERENCE * abs(value), LEAST_DIFFERENCE if name in _FROM_ZERO else 0.0)
        ends, models = [], []
        for at in (value - h, value + h, value):
            if len(ends) == 2:
                break
            try:
                built = varied(fabric, {name: at})
                models.append(build_model(built, resolution, self.model.cell.symmetries))
            except InputError:
                continue
            ends.append(at)
        if held is not None:
            slope = self._of_held(models, ends)
            models = [
                with_set(model, held + (at - value) * slope)
                for model, at in zip(models, ends, strict=True)
            ]
        return models, ends[1] - ends[0]

    def _of_held(self, models, ends):
        """d(held loop)/dp: without set, at the stated spacings."""
        held = self.rest.held
        plain = build_model(self.rest.fabric, self.model.resolution)
        lattice = []
        for model in models:
            f = model.fabric
            lattice.append([f.wale_spacing, 0.0, 0.0, f.course_spacing])
        distance = ends[1] - ends[0]
        slope = np.zeros(held.size)
        at, free = plain.lattice, plain.free()
        slope[at : at + 4] = np.subtract(lattice[1], lattice[0]) / distance
        g = [self._gradient(model.scene, held) for model in models]
        right = (g[1] - g[0]) / distance
        if slope.any():
            right += self._curvature(plain.scene, held)(slope)
        return slope + self._solved(plain.scene, held, free, right[:, None])[:, 0]

    def _gradient(self, scene, y, pairs=None):
        pairs = pairs_at(scene, y, 0.0, self.work) if pairs is None else pairs
        energy_of(scene, y, pairs, (), np.int64(1), self.work)
        return self.work.gradient.copy()

    def _curvature(self, scene, y):
        """A function of a move (n,) that gives d2E/dy2 times it, by central differences of the gradient.

        The solver's own Hessian leaves out second derivatives of the cells of contact points, which a Newton
        step does not need: near a core they are a tenth.
        """
        step = MOVED * self.rest.fabric.diameter
        pairs = pairs_at(scene, y, y.size * step, self.work)

        def times(move):
            part = step / np.abs(move).max()
            ends = (self._gradient(scene, y + sign * part * move, pairs) for sign in (1.0, -1.0))
            return np.subtract(*ends) / (2.0 * part)

        return times

    def _solved(self, scene, y, free, right):
        """Moves (n, columns) of the free unknowns that change the gradient by -right (n, columns)."""
        times, pairs = self._curvature(scene, y), pairs_at(scene, y, 0.0, self.work)
        energy_of(scene, y, pairs, (), np.int64(2), self.work)
        factor = lu_factor(self.work.hessian[np.ix_(free, free)])
        shape = (len(free),) * 2
        near = LinearOperator(shape, matvec=partial(lu_solve, factor), dtype=float)

        def inner(part):
            return times(_spread(part.ravel(), free, y.size))[free]

        operator = LinearOperator(shape, matvec=inner, dtype=float)
        moves = np.zeros((y.size, right.shape[1]))
        for k, column in enumerate(right.T):
            answer, failed = gmres(operator, -column[free], M=near, rtol=EXACT, maxiter=ROUNDS)
            if failed:
                raise ComputationError("the answer of an equilibrium to an input is not found")
            moves[free, k] = answer
        return moves

    def _by_inputs(self, y):
        """dg/dp (n, inputs) at y."""
        rows = [
            (self._gradient(b.scene, y) - self._gradient(a.scene, y)) / distance
            for (a, b), distance in self.models
        ]
        return np.array(rows).T

    def of_force(self, y, pulled, free):
        """At an equilibrium y: dF/dL and dF/dp (inputs,) at a fixed L of the spacing pulled.

        F: force per loop (N) on the entry ``pulled`` of the lattice; free: lattice entries that are.
        """
        model = self.model
        unknown, driven = model.free(*free), model.lattice + pulled
        along = self._curvature(model.scene, y)(np.eye(y.size)[driven])
        right = np.column_stack([along, self._by_inputs(y)])
        moves = self._solved(model.scene, y, unknown, right)
        changes = right[driven] + along[unknown] @ moves[unknown]
        return changes[0] / model.loops, changes[1:] / model.loops

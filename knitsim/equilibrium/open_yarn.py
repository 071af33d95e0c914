"""Yarns with two ends on the fabric's own kernels: the scenes of the verification.

Yarns that are clamped, hinged or free at their ends, under end forces, couples and weight, moved
supports, against each other and against rigid cylinders, with friction.

>>> import numpy as np
>>> yarn = OpenYarn(0.1, 1e-6, TensionLaw([0, 0.1], [0, 1e4]), 40, start=Support("clamped"),
...                 tip_force=(0.0, -1e-4, 0.0))  # P L^2/B = 1
>>> state = solve_open([yarn])
>>> [round(float(x) / 0.1, 4) for x in state.end(0)[:2]]  # exact: 1 - 0.05643, -0.30172
[0.9436, -0.3017]
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium import spline
from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.kernels.accept import NOT_SETTLED
from knitsim.equilibrium.kernels.contact import barrier_at, flat_mean, flat_push, steps_at
from knitsim.equilibrium.kernels.energy import new_work
from knitsim.equilibrium.kernels.fixtures import law_of
from knitsim.equilibrium.kernels.follow import (
    LOOSE,
    PASSES,
    SETTLED,
    begin_friction,
    end_friction,
    is_rubbed,
    known,
    lag_friction,
    stands,
)
from knitsim.equilibrium.kernels.friction import MEMORY, Memory, Rub
from knitsim.equilibrium.kernels.newton import CONVERGED, Control, minimise
from knitsim.equilibrium.kernels.pairs import (
    expand,
    pairs_at,
    place_frames,
    place_points,
    skin_over,
    touching,
)
from knitsim.equilibrium.kernels.records import LATTICE, Scene
from knitsim.equilibrium.open_scene import assemble, loads_of, out_of_plane, turned
from knitsim.equilibrium.relax import REASONS
from knitsim.errors import ComputationError, InputError
from knitsim.jit import blank
from knitsim.yarn.law import TensionLaw

TOLERANCE = 1e-9  # residual, of B/L^2 + the loads
ROUND_OFF = 4e-16  # of the stiffness of an element and their number: forces are not known better
LOCKED, LOCKING_ORDER = 2e-4, 6  # of the bending energy: stretch that is none; how fast it goes
ITERATIONS = 400
TRUST = 6
CLEAR = 0.3  # of a contact distance: largest step


@dataclass(frozen=True)
class Support:
    """How a yarn is held at an end.

    kind: "clamped" (place and direction) or "hinged" (place).  direction (3,): of the tangent, as it
    is at the start of the scene where None.  moved_to (3,): where the place is carried in the course
    of the scene, or None.
    """

    kind: str
    direction: tuple | None = None
    moved_to: tuple | None = None

    def __post_init__(self):
        if self.kind not in ("clamped", "hinged"):
            raise InputError("support", self.kind, "must be clamped or hinged")


def straight(length):
    """A straight yarn along the course from the origin."""
    return lambda t: np.stack([length * t, 0 * t, 0 * t], axis=-1)


@dataclass(frozen=True, eq=False)
class OpenYarn:
    """One yarn of a scene; SI units.

    length (m), bending_rigidity (N m2), law, elements (spans).  shape: function of the place t in
    [0, 1] (m,) that gives the starting points (m, 3), straight along the course where None.  start,
    end: supports, None for a free end.  start_force, tip_force (3,): dead loads at the ends (N).
    couple: couple at the end (N m) about couple_axis.  weight (3,): dead load per length (N/m).
    rest_curvature: about the thickness axis (1/m), as a function of t, of a yarn that does not turn about
    itself.  contacts: contact
    points per element.
    """

    length: float
    bending_rigidity: float
    law: TensionLaw
    elements: int = 80
    shape: Callable | None = None
    start: Support | None = None
    end: Support | None = None
    start_force: tuple = (0.0, 0.0, 0.0)
    tip_force: tuple = (0.0, 0.0, 0.0)
    couple: float = 0.0
    couple_axis: tuple = (0.0, 0.0, 1.0)
    weight: tuple = (0.0, 0.0, 0.0)
    rest_curvature: Callable | None = None
    contacts: int = 2

    def __post_init__(self):
        for name in ("length", "bending_rigidity"):
            if not getattr(self, name) > 0.0:
                raise InputError(name, getattr(self, name), "must be above 0")
        if self.elements < 4:
            raise InputError("elements", self.elements, "must be 4 or more")

    def control(self):
        """Control points (elements + 3, 3) of the starting shape."""
        n = self.elements
        curve = self.shape or straight(self.length)
        points = np.asarray(curve(np.arange(n + 1) / n), dtype=float)
        matrix, right = np.zeros((n + 3, n + 3)), np.zeros((n + 3, 3))
        for i in range(n + 1):
            matrix[i, i : i + 3] = np.array([1.0, 4.0, 1.0]) / 6.0
            right[i] = points[i]
        # End tangents by one-sided differences of third order.
        slope = np.array([-11.0, 18.0, -9.0, 2.0]) / 6.0
        matrix[n + 1, [0, 2]] = -0.5, 0.5
        right[n + 1] = slope @ points[:4]
        matrix[n + 2, [n, n + 2]] = -0.5, 0.5
        right[n + 2] = -slope @ points[: n - 4 : -1]
        return np.linalg.solve(matrix, right)


@dataclass(frozen=True)
class Cylinder:
    """A rigid cylinder: a point of its axis, the axis, and how it pushes.

    distance: of the yarn's centre line from the axis at which contact begins (m); stiffness: K of
    the barrier law per length of yarn (N).
    """

    point: tuple
    axis: tuple
    distance: float
    stiffness: float

    @property
    def law(self):
        """The barrier law of the yarn against it, per length of yarn."""
        return BarrierContact(self.stiffness)


@dataclass(frozen=True, eq=False)
class OpenState:
    """Equilibrium of a scene of open yarns.

    energy (4,): stretch, bend, contact, and what friction holds (J); lost: to friction so far (J);
    residual (N); iterations so far.
    """

    yarns: tuple
    scene: Scene
    chain: np.ndarray
    supports: dict
    y: np.ndarray
    x: np.ndarray
    gradient: np.ndarray
    energy: np.ndarray
    lost: float
    residual: float
    iterations: int

    def points(self, yarn, per_element=4):
        """Points along a yarn, (elements per_element + 1, 3), m."""
        n = self.yarns[yarn].elements
        return spline.evaluate(self._own(yarn), np.arange(n * per_element + 1) / per_element)

    def end(self, yarn):
        """Where a yarn ends (3,), m."""
        return spline.evaluate(self._own(yarn), [self.yarns[yarn].elements])[0]

    def end_angle(self, yarn):
        """Angle of the tangent at the end in the plane course-wale (rad), followed along the yarn."""
        v = np.diff(self.points(yarn, 8), axis=0)
        a, b = self._own(yarn)[-3], self._own(yarn)[-1]
        v = np.concatenate([v, (b - a)[None]])
        return float(np.unwrap(np.arctan2(v[:, 1], v[:, 0]))[-1])

    def reaction(self, yarn, end):
        """Force (3,) of the support at "start" or "end" on the yarn (N)."""
        first = self.supports[yarn, end]
        return self.gradient[first : first + 3]

    def strain(self, yarn):
        """Yarn strain at the Gauss points, in order along the yarn."""
        v, _, rod = self._derivatives(yarn)
        return np.linalg.norm(v, axis=1) / rod.span - 1.0

    def curvature(self, yarn):
        """Curvature (1/m) at the Gauss points, in order along the yarn."""
        v, a, rod = self._derivatives(yarn)
        return np.linalg.norm(np.cross(v, a), axis=1) / ((v**2).sum(1) * rod.span)

    def tension(self, yarn):
        """Axial tension (N) at the Gauss points, in order along the yarn."""
        return self.yarns[yarn].law.tension_at(self.strain(yarn))

    def contact_force(self, yarn, other):
        """Force (3,) of the contact with another yarn on this one (N)."""
        touch, length = self.scene.touch, self.scene.touch.points.length
        points = np.zeros((touch.points.size, 9))
        place_frames(touch, self.x, points)
        total = np.zeros(3)
        mine, theirs = (np.flatnonzero(touch.points.yarn == k) for k in (yarn, other))
        apart = np.linalg.norm(points[mine, None, :3] - points[None, theirs, :3], axis=2)
        for i, k in np.argwhere(apart < touching(self.scene)):
            i, k = int(mine[i]), int(theirs[k])
            steps = steps_at(touch, points, (i, k, 0))
            d = tuple((points[i] - points[k])[:3])
            mean = flat_mean(d, steps, self.scene.law)
            total -= flat_push(d, steps, mean, length[i] * length[k])
        return total

    def cylinder_force(self, cylinder=0):
        """Normal force per contact point of a cylinder on the yarns, (points, 3), N."""
        touch, rigid = self.scene.touch, self.scene.fixtures.cylinders
        points = np.zeros((touch.points.size, 3))
        place_points(touch, self.x, points)
        d = points - rigid.point[cylinder]
        d -= np.outer(d @ rigid.axis[cylinder], rigid.axis[cylinder])
        law = law_of(rigid[cylinder])
        slope = [barrier_at(float(s), law)[1] for s in (d**2).sum(1)]
        return -2.0 * np.array(slope)[:, None] * d * touch.points.length[:, None]

    def _own(self, yarn):
        first = self.chain[yarn]
        return self.x[first : first + self.yarns[yarn].elements + 3]

    def _derivatives(self, yarn):
        rod, first = self.scene.rod, self.chain[yarn]
        own = (rod.first >= first) & (rod.first < first + self.yarns[yarn].elements)
        rod = rod[own]
        at = self.x[rod.first[:, None] + np.arange(4)]
        v = np.einsum("ma,mak->mk", rod.d1, at)
        a = np.einsum("ma,mak->mk", rod.d2, at)
        return v, a, rod


def solve_open(yarns, **scene):
    """The last state (:class:`OpenState`) of :func:`follow_open`."""
    *_, last = follow_open(yarns, **scene)
    return last


def _carry(yarns, scene, chain, supports, y, change):
    """Move the inner points of yarns along with their supports, which have been moved by ``change``.

    Otherwise the whole way of a support would be taken from the elements beside it; where it is longer
    than they are they turn over, and Newton's method finds a rod that is folded up there.
    """
    for k, yarn in enumerate(yarns):
        ways = [
            change[supports[k, end]:][:3] for end in ("start", "end") if (k, end) in supports
        ]  # fmt: skip
        if not ways:
            continue
        points = yarn.elements + 3
        along = np.linspace(ways[0], ways[-1], points).ravel()
        rows = scene.map.rows[3 * chain[k] : 3 * (chain[k] + points)]
        own = rows.stop - rows.start == 1  # of points that no support holds
        y[scene.map.entries.column[rows.start[own]]] += along[own]


def follow_open(
    yarns,
    *,
    cylinders=(),
    contact=None,
    diameter=1e-3,
    friction=0.0,
    sticking=1.0,
    steps=10,
    planar=None,
    coarse=False,
):
    """Bring the loads up and the supports to their places; yields an :class:`OpenState` for each step.

    contact: BarrierContact or CoreContact between yarns of this diameter (m), None for none;
    friction: coefficient at all contacts; sticking: their stiffness along the yarns before they slide,
    over that across them where they first touch.  steps: a number of even steps from 0 to 1, or a
    programme of factors, (n,) for all or (n, 3) for the weights, for forces and couples at the ends and
    for the way of the supports.  coarse: whether to take an answer of elements that are too long, too.
    All yarns share one tension law (that of the first).  planar: nothing moves along the thickness;
    where None, so if nothing in the scene points out of the plane.  (A yarn without torsional
    stiffness is not stable out of its plane under every load.)

    Raises InputError for a scene that makes no sense, ComputationError where a step fails.
    """
    yarns = tuple(yarns)
    if not yarns or any(y.law is not yarns[0].law for y in yarns):
        raise InputError("yarns", len(yarns), "must be one or more, all with the same law")
    programme = (
        np.arange(1, steps + 1) / steps if isinstance(steps, int) else np.array(steps, float)
    )
    if programme.shape not in ((len(programme),), (len(programme), 3)) or not len(programme):
        raise InputError(
            "steps", programme.shape, "must be a number, factors (n,) or factors (n, 3)"
        )
    scene, chain, supports, y = assemble(yarns, cylinders, contact, diameter)
    own = min(supports.values(), default=len(y) - LATTICE)
    loads = loads_of(yarns, scene, chain)
    out = out_of_plane(scene, own)
    couples = scene.fixtures.couples
    if planar is None:
        planar = not (y[out].any() or loads[:, out].any() or couples.normal[:, :2].any())
    free = np.setdiff1d(np.arange(own), out) if planar else np.arange(own)
    longest = max(yarn.length for yarn in yarns)
    rigidity = max(yarn.bending_rigidity for yarn in yarns)
    tolerance = TOLERANCE * (rigidity / longest**2 + np.abs(loads).sum())
    most = max(yarn.elements for yarn in yarns)
    element = rigidity * (most / longest) ** 2
    tolerance += ROUND_OFF * most * (scene.stretch.stiffness + element)
    # Whole steps through a cylinder or another yarn would end on its other side.
    cap = min(
        [0.5 * longest]
        + [CLEAR * c.distance for c in cylinders]
        + ([] if contact is None else [CLEAR * diameter])
    )
    control = Control(tolerance, cap, 0.1 * diameter, ITERATIONS, TRUST, False)
    rub, memory = (), ()
    if friction > 0.0:
        shell = 0.0 if contact is None else sticking * contact.shell(diameter)
        scene.fixtures.cylinders.shell *= sticking
        rub = Rub(float(friction), max(shell, 1e-300), ())
        size = (len(cylinders), scene.touch.points.size)
        memory = Memory(blank(0, MEMORY), blank(size, MEMORY), ())
    work = new_work(scene)
    begin, target = y.copy(), y.copy()
    for (k, end), first in supports.items():
        place = getattr(yarns[k], end).moved_to
        if place is not None:
            target[first : first + 3] = place
    lost, total = 0.0, 0
    for step, factors in enumerate(programme):
        heavy, pulled, moved = np.broadcast_to(factors, 3)
        expand(scene.map, y, work.x)
        scene = scene._replace(
            load=heavy * loads[0] + pulled * loads[1],
            fixtures=scene.fixtures._replace(couples=turned(couples, pulled, work.x)),
        )
        start, skin, settled = y.copy(), control.skin, not is_rubbed(rub)
        y[own:] = (begin + moved * (target - begin))[own:]
        if contact is None and not cylinders:  # nothing that a yarn could be moved through
            _carry(yarns, scene, chain, supports, y, y - start)
        while True:
            around = pairs = pairs_at(scene, start, skin, work)
            slip = begin_friction(scene, start, around, rub, memory, work)
            for _ in range(PASSES + 1):
                aim = control
                if not settled:
                    aim = control._replace(tolerance=LOOSE * control.tolerance)
                status, used, residual, pairs = minimise(
                    scene, y, free, pairs, slip, aim, False, work
                )
                total += used
                if status != CONVERGED or (
                    settled and (used == 0 or stands(scene, y, slip, rub, work))
                ):
                    break
                settled = lag_friction(scene, y, slip, rub, work) <= SETTLED or settled
            else:
                status = NOT_SETTLED
            if status != CONVERGED or known(scene, y, slip, around, pairs, work):
                break
            wider = skin_over(scene, start, y, control.skin)
            if wider <= skin:
                status = NOT_SETTLED
                break
            skin = wider
        if status != CONVERGED:
            raise ComputationError(
                f"open yarns: step {step + 1} of {len(programme)}: {REASONS[status]} "
                f"(residual {residual:.3g} N, tolerance {tolerance:.3g} N)"
            )
        memory, loss, held = end_friction(scene, y, slip, memory, work)
        lost += loss
        expand(scene.map, y, work.x)
        if not coarse:
            _check_locking(yarns, scene, work)
        yield OpenState(
            yarns, scene, chain, supports, y.copy(), work.x.copy(), work.gradient.copy(),
            np.append(work.terms, held), lost, residual, total,
        )  # fmt: skip


def _check_locking(yarns, scene, work):
    """Raises ComputationError where elements are too long for a yarn as stiff as this.

    A nearly inextensible curve of few elements cannot bend without stretching: its strain then goes to and
    fro within each element.  What this holds, beyond the energy of a strain that changes evenly along the
    element, is no energy of the yarn.
    """
    rod = scene.rod
    v = np.einsum("ma,mak->mk", rod.d1, work.x[rod.first[:, None] + np.arange(4)])
    strain = (np.linalg.norm(v, axis=1) / rod.span - 1.0).reshape(-1, 3)
    # At three Gauss points, what is neither a mean nor a slope is this times (2, -2.5, 2)/9.
    wave = strain @ [1.0, -2.0, 1.0]
    lengths = rod.weight.reshape(-1, 3).sum(1)
    spurious = 0.5 * scene.stretch.stiffness * 5.0 / 81.0 * (lengths * wave**2).sum()
    locked = spurious / work.terms[:2].sum() if spurious > 0.0 else 0.0
    if locked > LOCKED:
        most = max(yarn.elements for yarn in yarns)
        needed = int(np.ceil(most * (locked / LOCKED) ** (1.0 / LOCKING_ORDER) * 1.1))
        raise ComputationError(
            f"open yarns: {most} elements are too few for a yarn as stiff as this, which cannot bend "
            f"without stretching ({locked:.1e} of the energy): take {needed} or more"
        )

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
from knitsim.equilibrium.cell import owners, to_map
from knitsim.equilibrium.kernels.contact import law_at, place_points
from knitsim.equilibrium.kernels.friction import begin_slip, lag_at, loss_of, no_slip
from knitsim.equilibrium.kernels.newton import (
    CONVERGED,
    Control,
    expand,
    minimise,
    new_work,
    pairs_at,
)
from knitsim.equilibrium.kernels.records import (
    COUPLE,
    CYLINDER,
    IMAGE,
    LATTICE,
    ROD,
    TOUCH_POINT,
    Bend,
    Scene,
    Touch,
    records,
)
from knitsim.equilibrium.model import NEIGHBOURS, rounded_law
from knitsim.equilibrium.relax import REASONS
from knitsim.errors import ComputationError, InputError
from knitsim.yarn.law import TensionLaw

TOLERANCE = 1e-9  # residual, of B/L^2 + the loads
ROUND_OFF = 1e-14  # of the stretch stiffness: strains are not known better
ITERATIONS = 400
SLIP_ROUNDING = 1e-5  # of the longest yarn
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
    rest_curvature: magnitude of the rest curvature (1/m) as a function of t.  contacts: contact
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


@dataclass(frozen=True, eq=False)
class OpenState:
    """Equilibrium of a scene of open yarns.

    energy (3,): stretch, bend, contact (J); work of the moved supports and lost (J) where steps were
    taken; residual (N), iterations.
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
        touch = self.scene.touch
        points = np.zeros((touch.points.size, 3))
        place_points(touch, self.x, points)
        total = np.zeros(3)
        mine, theirs = (np.flatnonzero(touch.points.yarn == k) for k in (yarn, other))
        for i in mine:
            for k in theirs:
                d = points[i] - points[k]
                _, slope, _ = law_at(float(d @ d), self.scene.law)
                total -= 2.0 * slope * d * touch.points.length[i] * touch.points.length[k]
        return total

    def cylinder_force(self, cylinder=0):
        """Normal force per contact point of a cylinder on the yarns, (points, 3), N."""
        touch, rigid = self.scene.touch, self.scene.cylinders
        points = np.zeros((touch.points.size, 3))
        place_points(touch, self.x, points)
        d = points - rigid.point[cylinder]
        d -= np.outer(d @ rigid.axis[cylinder], rigid.axis[cylinder])
        slope = [law_at(float(s), rigid.law[cylinder])[1] for s in (d**2).sum(1)]
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


def solve_open(
    yarns,
    *,
    cylinders=(),
    contact=None,
    diameter=1e-3,
    friction=0.0,
    steps=10,
    passes=3,
    slip_rounding=None,
    rounding=1e-4,
    planar=None,
):
    """Bring the loads up and the supports to their places in ``steps``; an :class:`OpenState`.

    contact: BarrierContact or CoreContact between yarns of this diameter (m), None for none;
    friction: coefficient at all contacts; slip_rounding (m): slip at which friction is fully
    mobilised, None for 1e-5 of the longest yarn; rounding: of
    |kappa| near zero where there is a rest curvature, times 1/length.
    All yarns share one tension law (that of the first).  planar: nothing moves along the thickness;
    where None, so if nothing in the scene points out of the plane.  (A yarn without torsional
    stiffness is not stable out of its plane under every load.)

    Raises InputError for a scene that makes no sense, ComputationError where a step fails.
    """
    yarns = tuple(yarns)
    if not yarns or any(y.law is not yarns[0].law for y in yarns):
        raise InputError("yarns", len(yarns), "must be one or more, all with the same law")
    scene, chain, supports, y = _assemble(yarns, cylinders, contact, diameter, rounding)
    own = min(supports.values(), default=len(y) - LATTICE)
    loads = _loads(yarns, scene, chain)
    out = _out_of_plane(scene, own)
    if planar is None:
        planar = not (y[out].any() or loads[out].any() or scene.couples.normal[:, :2].any())
    free = np.setdiff1d(np.arange(own), out) if planar else np.arange(own)
    longest = max(yarn.length for yarn in yarns)
    slip_rounding = SLIP_ROUNDING * longest if slip_rounding is None else slip_rounding
    rigidity = max(yarn.bending_rigidity for yarn in yarns)
    tolerance = TOLERANCE * (rigidity / longest**2 + np.abs(loads).sum())
    tolerance += ROUND_OFF * scene.stretch.stiffness
    # Whole steps through a cylinder or another yarn would end on its other side.
    cap = min(
        [0.5 * longest]
        + [CLEAR * c.distance for c in cylinders]
        + ([] if contact is None else [CLEAR * diameter])
    )
    control = Control(tolerance, cap, 0.1 * diameter, ITERATIONS, TRUST)
    work = new_work(scene)
    begin, target = y.copy(), y.copy()
    for (k, end), first in supports.items():
        place = getattr(yarns[k], end).moved_to
        if place is not None:
            target[first : first + 3] = place
    couples = scene.couples
    lost, total = 0.0, 0
    for step in range(1, steps + 1):
        part = step / steps
        expand(scene.map, y, work.x)
        scene = scene._replace(
            load=part * loads,
            couples=_turned(couples, part, work.x),
        )
        start = y.copy()
        y[own:] = (begin + part * (target - begin))[own:]
        slip, pairs = no_slip(), None
        for once in range(passes if friction > 0.0 else 1):
            if friction > 0.0:
                at = y if once else start
                lattice = expand(scene.map, at, work.x)
                place_points(scene.touch, work.x, work.points)
                if once:
                    lag_at(scene, work.points, lattice, pairs[1], friction, slip)
                else:
                    pairs = pairs_at(scene, start, control.skin, work)
                    slip = begin_slip(scene, work.points, lattice, pairs, friction, slip_rounding)
            status, used, residual = minimise(scene, y, free, slip, control, work)
            total += used
            if status != CONVERGED:
                raise ComputationError(
                    f"open yarns: step {step} of {steps}: {REASONS[status]} "
                    f"(residual {residual:.3g} N, tolerance {tolerance:.3g} N)"
                )
        if friction > 0.0:
            lattice = expand(scene.map, y, work.x)
            place_points(scene.touch, work.x, work.points)
            lost += loss_of(scene, work.points, lattice, slip)
    return OpenState(
        yarns,
        scene,
        chain,
        supports,
        y,
        work.x.copy(),
        work.gradient.copy(),
        work.terms.copy(),
        lost,
        residual,
        total,
    )


def _out_of_plane(scene, own):
    """Unknowns below ``own`` that only move points along the thickness."""
    map_ = scene.map
    row = owners(map_)
    column = map_.entries.column
    moves = (map_.entries.value != 0.0) & (row < len(map_.rows) - LATTICE)
    along = np.zeros(own, dtype=bool)
    along[[c for c in column[moves & (row % 3 == 2)] if c < own]] = True
    along[[c for c in column[moves & (row % 3 != 2)] if c < own]] = False
    return np.flatnonzero(along)


def _turned(couples, part, x):
    """``part`` of the couples, their angles counted from the tangents at the control points x."""
    v = np.einsum("ma,mak->mk", couples.d1, x[couples.first[:, None] + np.arange(4)])
    v -= (v * couples.normal).sum(1)[:, None] * couples.normal
    turned = couples.copy()
    turned.moment = part * couples.moment
    turned.reference = v / np.linalg.norm(v, axis=1)[:, None]
    return turned


def _assemble(yarns, cylinders, contact, diameter, rounding):
    """Scene, first control point of each yarn, columns of the supports, starting unknowns."""
    rows, start, supports, counter = [], [], {}, 0
    controls = [yarn.control() for yarn in yarns]
    chain = np.cumsum([0] + [len(c) for c in controls])[:-1]
    for k, (yarn, control) in enumerate(zip(yarns, controls, strict=True)):
        own = [None] * len(control)
        ends = {"start": (0, 1, 2, 1.0), "end": (-1, -2, -3, -1.0)}
        held = {}
        for end, (outer, middle, inner, sense) in ends.items():
            support = getattr(yarn, end)
            if support is None:
                continue
            # Place: (Q_outer + 4 Q_middle + Q_inner)/6 = P.  Direction: Q_inner - Q_outer = s t.
            t = None
            if support.kind == "clamped":
                t = support.direction
                t = sense * (control[inner] - control[outer]) if t is None else np.array(t, float)
                t = t / np.linalg.norm(t)
            held[end] = (outer, middle, inner, sense, t)
        skip = set()
        for outer, middle, _, _, t in held.values():
            skip.add(middle % len(control))
            if t is not None:
                skip.add(outer % len(control))
        for i, point in enumerate(control):
            if i not in skip:
                own[i] = [{counter + axis: 1.0} for axis in range(3)]
                start += list(point)
                counter += 3
        for end, (outer, middle, inner, sense, t) in held.items():
            if t is not None:
                along = counter
                counter += 1
                start.append(sense * (control[inner] - control[outer]) @ t)
                own[outer] = [{**own[inner][axis], along: -sense * t[axis]} for axis in range(3)]
            supports[k, end] = (own, outer, middle, inner, controls[k])
        rows.append(own)
    columns = {}
    for key, (own, outer, middle, inner, control) in supports.items():
        columns[key] = counter
        start += list((control[outer] + 4.0 * control[middle] + control[inner]) / 6.0)
        own[middle] = [
            _sum((1.5, {counter + axis: 1.0}), (-0.25, own[outer][axis]), (-0.25, own[inner][axis]))
            for axis in range(3)
        ]
        counter += 3
    map_ = to_map([row for own in rows for row in own], counter)
    y = np.array([*start, 0.0, 0.0, 0.0, 0.0])
    law = np.zeros(4) if contact is None else contact.array(diameter)
    scene = Scene(
        map_,
        _rod(yarns, chain, rounding),
        rounded_law(yarns[0].law),
        _touch(yarns, chain, diameter, contact is not None or bool(cylinders)),
        _cylinders(cylinders),
        _couples(yarns, chain),
        Bend(0.0, 0, False),
        law,
        np.zeros(len(y)),
        np.ones(len(y)),
    )
    return scene, chain, columns, y


def _sum(*terms):
    total = {}
    for factor, row in terms:
        for column, value in row.items():
            total[column] = total.get(column, 0.0) + factor * value
    return total


def _rod(yarns, chain, rounding):
    parts = []
    for yarn, first in zip(yarns, chain, strict=True):
        n = yarn.elements
        span = yarn.length / n
        place = np.tile(spline.GAUSS_POINTS, n)
        at = np.repeat(np.arange(n), 3)
        rest = np.zeros(3 * n)
        if yarn.rest_curvature is not None:
            rest = np.asarray(yarn.rest_curvature((at + place) / n), dtype=float)
        parts.append(
            records(
                ROD,
                3 * n,
                first=at + first,
                d0=spline.basis(place),
                d1=spline.basis_first(place),
                d2=spline.basis_second(place),
                span=span,
                weight=np.tile(spline.GAUSS_WEIGHTS, n) * span,
                rest=rest,
                stiffness=yarn.bending_rigidity,
                rounding=rounding / min(yarn.length for yarn in yarns),
            )
        )
    return np.concatenate(parts).view(np.recarray)


def _touch(yarns, chain, diameter, wanted):
    parts = []
    for k, (yarn, begin) in enumerate(zip(yarns, chain, strict=True)):
        m = yarn.contacts if wanted else 0
        place = np.tile((np.arange(m) + 0.5) / max(m, 1), yarn.elements)
        at = np.repeat(np.arange(yarn.elements), m)
        step = yarn.length / yarn.elements
        parts.append(
            records(
                TOUCH_POINT,
                len(at),
                first=at + begin,
                yarn=k,
                basis=spline.basis(place),
                length=step / max(m, 1),
                arc=(at + place) * step,
            )
        )
    images = records(IMAGE, 1, sign=1.0, arc_sign=1.0, same=True)
    points = np.concatenate(parts).view(np.recarray)
    return Touch(points, images, 1.0, NEIGHBOURS * diameter)


def _cylinders(cylinders):
    axis = np.array([c.axis for c in cylinders], dtype=float).reshape(-1, 3)
    return records(
        CYLINDER,
        len(cylinders),
        point=np.array([c.point for c in cylinders], dtype=float).reshape(-1, 3),
        axis=axis / np.linalg.norm(axis, axis=1)[:, None],
        law=np.array([[0.0, c.distance, 0.0, c.stiffness] for c in cylinders]).reshape(-1, 4),
    )


def _couples(yarns, chain):
    turned = [k for k, yarn in enumerate(yarns) if yarn.couple]
    axis = np.array([yarns[k].couple_axis for k in turned], dtype=float).reshape(-1, 3)
    return records(
        COUPLE,
        len(turned),
        first=[chain[k] + yarns[k].elements - 1 for k in turned],
        d1=spline.basis_first([1.0]),
        moment=[yarns[k].couple for k in turned],
        normal=axis / np.linalg.norm(axis, axis=1)[:, None],
    )


def _loads(yarns, scene, chain):
    """Dead loads by the unknowns."""
    rows = len(scene.map.rows)
    force = np.zeros(rows)
    for yarn, first in zip(yarns, chain, strict=True):
        n = yarn.elements
        for place, load in ((0, yarn.start_force), (n, yarn.tip_force)):
            for a, part in enumerate((1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)):
                at = 3 * (first + place + a)
                force[at : at + 3] += part * np.asarray(load, dtype=float)
        step = yarn.length / n
        for g, weight in zip(spline.GAUSS_POINTS, spline.GAUSS_WEIGHTS, strict=True):
            for a, part in enumerate(spline.basis([g])[0]):
                for i in range(n):
                    at = 3 * (first + i + a)
                    force[at : at + 3] += weight * step * part * np.asarray(yarn.weight, float)
    loads = np.zeros(len(scene.load))
    entries = scene.map.entries
    np.add.at(loads, entries.column, entries.value * force[owners(scene.map)])
    return loads

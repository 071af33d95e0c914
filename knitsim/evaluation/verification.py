"""Cases with an exact answer, run by the solver of the fabric: value, exact value, observed order.

Every case is a scene of open yarns (:mod:`knitsim.equilibrium.open_yarn`), solved with more and more
elements and compared with :mod:`knitsim.evaluation.exact_rods`, ``exact_crimp`` and
``exact_contacts``, which share nothing with the solver.  All quantities are dimensionless.

What keeps an error from falling further is part of the scene, not of its resolution: the exact rods
do not stretch (these do, by load 1e-7), contact is hard (here it has a stiffness), and the kinks of a
tension law are sharp (the solver rounds them over 4e-4 strain).  ``Case.floor`` holds an estimate of
it, beyond which no order is observed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq
from scipy.special import j0

from knitsim.equilibrium import spline
from knitsim.equilibrium.fabric import BarrierContact
from knitsim.equilibrium.open_yarn import Cylinder, OpenYarn, Support, solve_open
from knitsim.evaluation import exact_contacts, exact_crimp, exact_rods
from knitsim.yarn.law import TensionLaw

ELEMENTS = (10, 20, 40, 80)
CONTACT_ELEMENTS = ELEMENTS[1:]  # ten do not follow a cylinder
LIMIT, CONTACT_LIMIT = 1e-4, 5e-3  # largest error asked for with the most elements

RODS, SHAPES, CONTACTS = "loaded cantilevers", "struts, crimp and stretch", "contact and friction"

# The rods: EA L^2/B = 1e7, so that they stretch by 1e-7 under the load B/L^2.
LENGTH, RIGIDITY = 0.1, 1e-6
STRETCH = 1e-7
_STIFF = TensionLaw([0.0, 0.1], [0.0, 0.1 * RIGIDITY / (LENGTH**2 * STRETCH)])
_LOAD, _COUPLE = RIGIDITY / LENGTH**2, RIGIDITY / LENGTH
_CLAMPED, _HINGED = Support("clamped", direction=(1.0, 0.0, 0.0)), Support("hinged")

# The yarns on cylinders.
_PULL, _RADIUS = 0.1, 10e-3
_CORD = TensionLaw([0.0, 0.1], [0.0, 100.0])
_CRIMP_STEPS = 20  # in fewer the curvature changes sign on the way


@dataclass(frozen=True)
class Comparison:
    """A quantity computed and exact, dimensionless."""

    quantity: str
    value: float
    exact: float

    @property
    def error(self):
        """|value - exact| over |exact|; over 1, the rod's length, where the exact value is 0."""
        scale = abs(self.exact)
        return abs(self.value - self.exact) / (scale if scale > 1e-9 else 1.0)


@dataclass(frozen=True)
class Case:
    """A scene with an exact answer.

    run: function of the number of elements that returns the OpenState and the Comparisons; group:
    one of RODS, SHAPES, CONTACTS; floor: relative error that more elements do not take away, about;
    limit: largest error asked for; note: what the floor is from.
    """

    name: str
    group: str
    run: Callable
    floor: float
    note: str = "the exact rod does not stretch"
    limit: float = LIMIT
    elements: tuple = field(default=ELEMENTS)


@dataclass(frozen=True)
class Checked:
    """Comparisons of one quantity over the numbers of elements, all (elements,): value, exact, error,
    residual (N), iterations of the solver.

    order: observed order of convergence, see :func:`observed_order`.
    """

    case: Case
    quantity: str
    value: np.ndarray
    exact: np.ndarray
    error: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    order: float


def observed_order(elements, error, floor):
    """Slope of the error between the two finest resolutions at which it exceeds ``floor``.

    elements, error (n,): log(error ratio)/log(elements ratio).  NaN where fewer than two errors
    exceed it.
    """
    above = np.flatnonzero(np.asarray(error) > floor)
    if above.size < 2:
        return math.nan
    last, next_to_last = above[-1], above[-2]
    return math.log(error[next_to_last] / error[last]) / math.log(
        elements[last] / elements[next_to_last]
    )


def check(case):
    """Run a Case with all its numbers of elements; a list of :class:`Checked`.

    Raises ComputationError if the solver does not reach a state.
    """
    solved = [case.run(n) for n in case.elements]
    residual = np.array([state.residual for state, _ in solved])
    iterations = np.array([state.iterations for state, _ in solved])
    found = []
    for rows in zip(*(comparisons for _, comparisons in solved), strict=True):
        error = np.array([row.error for row in rows])
        found.append(
            Checked(
                case,
                rows[0].quantity,
                np.array([row.value for row in rows]),
                np.array([row.exact for row in rows]),
                error,
                residual,
                iterations,
                observed_order(case.elements, error, case.floor),
            )
        )
    return found


# ---- starting shapes ----


def _curve(angle, length):
    """Shape for OpenYarn of the given length whose tangent has the angle ``angle(t)`` (rad)."""
    node, weight = np.polynomial.legendre.leggauss(40)

    def shape(t):
        t = np.asarray(t, dtype=float)
        at = angle(0.5 * t[:, None] * (node + 1.0))
        along, across = 0.5 * t * (np.cos(at) @ weight), 0.5 * t * (np.sin(at) @ weight)
        return length * np.stack([along, across, 0.0 * t], axis=-1)

    return shape


def _over_cylinder(turn, tail, radius, top):
    """(length, shape, direction of the end) of two straight tails and an arc between them.

    radius: of the arc (m), its highest point at ``top`` (m) above the origin; it starts to the left.
    """
    length = 2.0 * tail + radius * turn

    def shape(t):
        s = length * (np.asarray(t, dtype=float) - 0.5)
        angle = np.clip(s / radius, -0.5 * turn, 0.5 * turn)
        rest = s - radius * angle
        x = radius * np.sin(angle) + rest * np.cos(angle)
        y = radius * (np.cos(angle) - 1.0) - rest * np.sin(angle) + top
        return np.stack([x, y, 0.0 * s], axis=-1)

    return length, shape, np.array([math.cos(0.5 * turn), -math.sin(0.5 * turn), 0.0])


# ---- rods ----


def _rod(elements, **changes):
    return OpenYarn(LENGTH, RIGIDITY, _STIFF, elements, **changes)


def tip_load_case(load):
    """Cantilever with the dead load P L^2/EI = ``load`` across it at its tip."""
    exact = exact_rods.tip_load(load)

    def run(elements):
        force = (0.0, -load * _LOAD, 0.0)
        state = solve_open([_rod(elements, start=_CLAMPED, tip_force=force)])
        x, y, _ = state.end(0) / LENGTH
        return state, [
            Comparison("deflection/L", -y, exact.deflection),
            Comparison("shortening/L", 1.0 - x, exact.shortening),
        ]

    # The tip moves by the rod's own stretch, against which the shortening is the smallest.
    floor = 3.0 * load * STRETCH
    return Case(f"cantilever, tip load {load:g} EI/L2", RODS, run, floor)


def own_weight_case(load):
    """Cantilever under its own weight, weight per length times L^3/EI = ``load``."""
    exact = exact_rods.own_weight(load)

    def run(elements):
        weight = (0.0, -load * _LOAD / LENGTH, 0.0)
        state = solve_open([_rod(elements, start=_CLAMPED, weight=weight)])
        x, y, _ = state.end(0)
        return state, [Comparison("height/width", -y / x, exact.ratio)]

    return Case(f"cantilever, own weight {load:g} EI/L2", RODS, run, 3.0 * load * STRETCH)


def roll_up_case(turn, text):
    """Cantilever rolled up by an end couple to kappa L = ``turn``, which ``text`` spells."""
    exact = exact_rods.roll_up(turn)

    def run(elements):
        state = solve_open([_rod(elements, start=_CLAMPED, couple=turn * _COUPLE)])
        tip = state.end(0) / LENGTH
        return state, [
            Comparison("tip along/L", tip[0], exact[0]),
            Comparison("tip across/L", tip[1], exact[1]),
        ]

    # No force, so nothing stretches: only round-off is left.
    return Case(f"rolled up to kappa L = {text}", RODS, run, 1e-8, "round-off")


def strut_case(distance, ends):
    """Strut with ``hinged`` or ``clamped`` ends, pulled together to ``distance`` of its length.

    It starts with its ends in place, bent to theta = a cos(pi s) or a sin(2 pi s), chord J_0(a).
    """
    exact = exact_rods.strut(distance, ends)
    a = brentq(lambda angle: j0(angle) - distance, 1e-6, 2.4)
    support = _HINGED if ends == "hinged" else _CLAMPED

    def angle(t):
        return a * (np.cos(np.pi * t) if ends == "hinged" else np.sin(2.0 * np.pi * t))

    def run(elements):
        strut = _rod(elements, shape=_curve(angle, LENGTH), start=support, end=support)
        state = solve_open([strut], steps=1)
        middle = state.points(0, 2)[elements, 1] / LENGTH
        return state, [
            Comparison("force L2/EI", -state.reaction(0, "end")[0] / _LOAD, exact.load),
            Comparison("deflection/L", middle, exact.mid_deflection),
        ]

    floor = 3.0 * exact.load * STRETCH
    return Case(f"{ends} strut, ends at {distance:g} L", SHAPES, run, floor)


def crimp_case(name, rest_angle, rest_curvature, pull):
    """A quarter wave of a crimped yarn under the tension p = T L^2/EI = ``pull``.

    rest_angle, rest_curvature: of the quarter over its arc length (rad; rad per L).  The yarn's
    bending energy knows the rest curvature's magnitude only, so these rest shapes are such that the
    exact curvature keeps its sign.
    """
    exact = exact_crimp.pull_crimped(rest_angle, pull)
    at_rest = exact_crimp.pull_crimped(rest_angle, 0.0).chord

    def run(elements):
        yarn = _rod(
            elements,
            shape=_curve(rest_angle, LENGTH),
            start=_CLAMPED,
            tip_force=(pull * _LOAD, 0.0, 0.0),
            rest_curvature=lambda t: rest_curvature(t) / LENGTH,
        )
        state = solve_open([yarn], steps=_CRIMP_STEPS, rounding=1e-6)
        chord = state.end(0)[0] / LENGTH
        return state, [Comparison("extension", chord / at_rest - 1.0, exact.extension)]

    floor = 3.0 * pull * STRETCH / exact.extension
    return Case(f"crimped yarn ({name}), pull {pull:g} EI/L2", SHAPES, run, floor)


# ---- stretch ----

_KNEE = TensionLaw([0.0, 0.02, 0.08], [0.0, 1.0, 1.6])  # 50 N, then 10 N


def pulled_case(strain):
    """A straight yarn of a bilinear law pulled to ``strain``: its force and its energy."""
    force = float(np.interp(strain, _KNEE.strain, _KNEE.tension))
    fine = np.union1d(np.linspace(0.0, strain, 3), np.minimum(_KNEE.strain, strain))
    energy = float(np.trapezoid(np.interp(fine, _KNEE.strain, _KNEE.tension), fine))

    def run(elements):
        end = Support("hinged", moved_to=(LENGTH * (1.0 + strain), 0.0, 0.0))
        yarn = OpenYarn(LENGTH, RIGIDITY, _KNEE, elements, start=_HINGED, end=end)
        state = solve_open([yarn])
        return state, [
            Comparison("force (N)", state.reaction(0, "end")[0], force),
            Comparison("energy/L (N)", state.energy[0] / LENGTH, energy),
        ]

    note = "the kink of the law is rounded"
    return Case(f"straight yarn pulled to {100 * strain:g} %", SHAPES, run, LIMIT, note)


def hanging_case():
    """A yarn of a bilinear law that hangs under its own weight: the strain at rest is kinked."""
    tip, own = 0.4, 1.0  # N; the tension is 1 N, that of the knee, at 0.6 of the length
    # Extension/L: the strain over the tension, which grows evenly along the yarn.
    knots = np.array([tip, 1.0, tip + own])
    exact = float(np.trapezoid(np.interp(knots, _KNEE.tension, _KNEE.strain), knots)) / own

    def run(elements):
        yarn = OpenYarn(
            LENGTH, 1e-9, _KNEE, elements, start=_HINGED,
            tip_force=(tip, 0.0, 0.0), weight=(own / LENGTH, 0.0, 0.0),
        )  # fmt: skip
        state = solve_open([yarn], steps=1)
        return state, [Comparison("extension/L", state.end(0)[0] / LENGTH - 1.0, exact)]

    note = "the kink of the law is rounded"
    return Case("yarn hanging under its own weight", SHAPES, run, LIMIT, note)


# ---- contact and friction ----


def _angle_between(pull, reaction):
    """Turn (rad) of a yarn between the direction of the pull at its start and that at its end."""
    cross = pull[0] * reaction[1] - pull[1] * reaction[0]
    return (math.pi - math.atan2(cross, pull[0] * reaction[0] + pull[1] * reaction[1])) % (
        2.0 * math.pi
    )


def capstan_case(friction, turn):
    """A nearly limp yarn round half a cylinder, pulled over it until it slips everywhere.

    The contact is spread along the yarn, not at nodes, so the continuous answers apply; that with
    the stiffness of the yarn is 3e-4 away from exp(mu phi).
    """
    rigidity, slip = 1e-8, 1e-3
    length, shape, along = _over_cylinder(turn, 5e-3, _RADIUS, _RADIUS)
    pull = _PULL * along * [-1.0, 1.0, 1.0]
    end = tuple(shape(np.ones(1))[0] + slip * along)

    def run(elements):
        yarn = OpenYarn(
            length, rigidity, _CORD, elements, shape=shape, start_force=tuple(pull),
            end=Support("hinged", moved_to=end),
        )  # fmt: skip
        cylinder = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), _RADIUS, 100.0)
        # The normal force lags by a pass; each adds a term of the series of exp(mu phi).
        state = solve_open([yarn], cylinders=[cylinder], friction=friction, steps=2, passes=8)
        reaction = state.reaction(0, "end")
        ratio = float(np.linalg.norm(reaction)) / _PULL
        found = _angle_between(pull, reaction)
        stiff = exact_contacts.capstan_stiff(friction, _PULL, rigidity, _RADIUS, found)
        return state, [
            Comparison("T2/T1, stiff yarn", ratio, stiff / _PULL),
            Comparison("T2/T1, exp(mu phi)", ratio, exact_contacts.capstan(friction, turn)),
        ]

    name = f"capstan, friction {friction:g}, turn {turn / math.pi:g} pi"
    return Case(
        name, CONTACTS, run, 2e-4, "compliance of the contact", CONTACT_LIMIT, CONTACT_ELEMENTS
    )


def wrapped_case(turn, rigidity, contact):
    """A stiff yarn round a cylinder without friction; contact: ``line`` or ``point``.

    The yarn turns by about ``turn``; the exact answer is for the angle between its two pulls.
    """
    length_scale = math.sqrt(rigidity / _PULL)
    arc = _RADIUS if contact == "line" else 2.0 * _RADIUS
    # Tails of six decay lengths: their ends matter by 1e-5.
    length, shape, along = _over_cylinder(turn, 6.0 * length_scale, arc, _RADIUS)
    pull = _PULL * along * [-1.0, 1.0, 1.0]
    stiffness = 1e3 if contact == "line" else 1e4
    points = 2 if contact == "line" else 4

    def run(elements):
        yarn = OpenYarn(
            length, rigidity, _CORD, elements, shape=shape, start_force=tuple(pull),
            end=_HINGED, contacts=points,
        )  # fmt: skip
        cylinder = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), _RADIUS, stiffness)
        state = solve_open([yarn], cylinders=[cylinder], steps=1)
        reaction = state.reaction(0, "end")
        exact = exact_contacts.wrapped_yarn(
            _PULL, rigidity, _RADIUS, _angle_between(pull, reaction)
        )
        if exact.kind != contact:
            raise AssertionError(f"{contact} contact meant, exact answer is a {exact.kind}")
        compare = _line_contact if contact == "line" else _point_contact
        return state, compare(state, exact, pull, reaction)

    return Case(
        f"stiff yarn round a cylinder, {contact} contact",
        CONTACTS,
        run,
        2e-4 if contact == "line" else 5e-4,
        "compliance of the contact",
        CONTACT_LIMIT,
        CONTACT_ELEMENTS,
    )


def _line_contact(state, exact, pull, reaction):
    yarn = state.yarns[0]
    force = np.linalg.norm(state.cylinder_force(), axis=1)
    step = yarn.length / force.size
    at = (np.arange(force.size) + 0.5) * step
    gauss = np.add.outer(np.arange(yarn.elements), spline.GAUSS_POINTS).ravel()
    gauss *= yarn.length / yarn.elements
    # The middle of the contact, clear of the forces at its ends.
    middle, reach = at @ force / force.sum(), 0.3 * exact.contact_angle * _RADIUS
    inner, inner_gauss = abs(at - middle) < reach, abs(gauss - middle) < reach
    # Curvature per length as stretched.
    curvature = (state.curvature(0) / (1.0 + state.strain(0)))[inner_gauss].mean()
    pressure = force[inner].mean() / step
    tension = state.tension(0)[inner_gauss].mean()
    whole = exact.inner_tension * exact.contact_angle + 2.0 * exact.point_force
    return [
        Comparison("pressure radius/T", pressure * _RADIUS / _PULL, exact.pressure * _RADIUS / _PULL),
        Comparison("tension in contact/T", tension / _PULL, exact.inner_tension / _PULL),
        Comparison("curvature radius", curvature * _RADIUS, exact.curvature * _RADIUS),
        Comparison("sum of contact forces/T", force.sum() / _PULL, whole / _PULL),
    ]


def _point_contact(state, exact, pull, reaction):
    """Total force, and how far the point is from the lines of the two pulls.

    T times that distance is the moment at the point, EI theta'.  The curvature there is not
    compared itself: it has a kink that neither the elements nor the contact's compliance show.
    """
    total = state.cylinder_force().sum(axis=0)
    points = state.points(0, 8)
    crown = points[np.argmax(points @ total)]
    distance = 0.0
    # Their mean: where on the flat crown the point is taken does not matter to it.
    for end, force in ((points[0], pull), (points[-1], reaction)):
        distance += 0.5 * np.linalg.norm(np.cross(crown - end, force)) / np.linalg.norm(force)
    moment = exact.curvature * state.yarns[0].bending_rigidity
    return [
        Comparison("contact force/T", float(np.linalg.norm(total)) / _PULL, exact.total / _PULL),
        Comparison(
            "lever of T/radius", float(distance) / _RADIUS, moment / (_PULL * _RADIUS)
        ),
    ]


def crossing_case():
    """Two hinged yarns under tension that cross at a right angle, pressed together by their ends.

    The exact force is that of two springs in series for the approach less what the contact itself
    gives way, at the tension found; it holds for slopes far below 1 (here 0.005).
    """
    diameter, approach, stretched, stiffness = 1e-3, 1e-4, 1e-3, 20.0
    law = TensionLaw([0.0, 0.1], [0.0, 0.1 * stiffness])
    halves, rigidities = (10e-3, 8e-3), (2e-8, 1e-8)
    along = np.eye(3)[:2]

    def run(elements):
        yarns = []
        for k, (half, rigidity) in enumerate(zip(halves, rigidities, strict=True)):

            def shape(t, half=half, k=k):
                return half * (2.0 * t[:, None] - 1.0) * along[k] + [0.0, 0.0, k * diameter]

            start, end = (
                Support("hinged", moved_to=tuple(
                    side * half * (1.0 + stretched) * along[k]
                    + [0.0, 0.0, k * (diameter - approach)]
                ))
                for side in (-1.0, 1.0)
            )  # fmt: skip
            yarns.append(
                OpenYarn(
                    2.0 * half, rigidity, law, elements, shape=shape, start=start, end=end, contacts=2
                )
            )  # fmt: skip
        state = solve_open(yarns, contact=BarrierContact(1e3), diameter=diameter, steps=2)
        lower, upper = (state.points(k, 2)[elements, 2] for k in (0, 1))
        springs = [
            exact_contacts.span_stiffness(
                rigidity, 2.0 * half * (1.0 + stretched), state.tension(k).mean()
            )
            for k, (half, rigidity) in enumerate(zip(halves, rigidities, strict=True))
        ]
        pressed = approach - (diameter - (upper - lower))
        exact = pressed / sum(1.0 / spring for spring in springs)
        unit = rigidities[0] / halves[0] ** 2
        held = sum(state.reaction(0, end)[2] for end in ("start", "end"))
        return state, [
            Comparison("contact force L2/EI", -state.contact_force(0, 1)[2] / unit, exact / unit),
            Comparison("force of the supports L2/EI", held / unit, exact / unit),
        ]

    return Case(
        "two yarns crossing", CONTACTS, run, 1e-4, "the exact answer is for small slopes",
        CONTACT_LIMIT, CONTACT_ELEMENTS,
    )  # fmt: skip


def cases():
    """All cases, in the order of the tables."""
    return (
        *(tip_load_case(load) for load in (1.0, 4.0, 10.0)),
        *(own_weight_case(load) for load in (10.0, 100.0)),
        roll_up_case(1.0, "1"),
        roll_up_case(math.pi, "pi"),
        roll_up_case(2.0 * math.pi, "2 pi"),
        *(strut_case(distance, "hinged") for distance in (0.8, 0.5)),
        *(strut_case(distance, "clamped") for distance in (0.8, 0.5)),
        crimp_case(
            "sine", exact_crimp.crimp_sine(0.8),
            lambda t: 0.4 * np.pi * np.cos(0.5 * np.pi * t), 5.0,
        ),
        crimp_case("arcs", exact_crimp.crimp_arcs(0.8), lambda t: 0.8 + 0.0 * t, 10.0),
        *(pulled_case(strain) for strain in (0.01, 0.05)),
        hanging_case(),
        capstan_case(0.3, math.pi),
        wrapped_case(math.pi, 4e-7, "line"),
        wrapped_case(0.3, 4e-7, "point"),
        crossing_case(),
    )  # fmt: skip

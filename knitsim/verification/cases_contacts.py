"""Verification scenes with contact: capstan, yarn round a cylinder, yarns that cross.

Each function returns a :class:`knitsim.verification.case.Case`.
"""

import math

import numpy as np

from knitsim.equilibrium import spline
from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.open_yarn import Cylinder, OpenYarn, Support, solve_open
from knitsim.errors import ComputationError
from knitsim.verification import exact_contacts
from knitsim.verification.case import (
    CONTACT_ELEMENTS,
    CONTACT_LIMIT,
    CONTACTS,
    Case,
    Comparison,
)
from knitsim.yarn.law import TensionLaw

_PULL, _RADIUS = 0.1, 10e-3
_CORD = TensionLaw([0.0, 0.1], [0.0, 100.0])
_HINGED = Support("hinged")
_SOFT_NOTE = "the contact gives way"


def over_cylinder(turn, tail, radius, top):
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
    length, shape, along = over_cylinder(turn, 5e-3, _RADIUS, _RADIUS)
    pull = _PULL * along * [-1.0, 1.0, 1.0]
    end = tuple(shape(np.ones(1))[0] + slip * along)

    def run(elements):
        yarn = OpenYarn(
            length, rigidity, _CORD, elements, shape=shape, start_force=tuple(pull),
            end=Support("hinged", moved_to=end),
        )  # fmt: skip
        cylinder = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), _RADIUS, 100.0)
        # The normal force lags by a pass; each adds a term of the series of exp(mu phi).
        state = solve_open([yarn], cylinders=[cylinder], friction=friction, steps=2, coarse=True)
        reaction = state.reaction(0, "end")
        ratio = float(np.linalg.norm(reaction)) / _PULL
        found = _angle_between(pull, reaction)
        stiff = exact_contacts.capstan_stiff(friction, _PULL, rigidity, _RADIUS, found)
        return state, [
            Comparison("T2/T1, stiff yarn", ratio, stiff / _PULL, 5e-5),
            Comparison("T2/T1, exp(mu phi)", ratio, exact_contacts.capstan(friction, turn), 1e-3),
        ]

    name = f"capstan, friction {friction:g}, turn {turn / math.pi:g} pi"
    note = f"{_SOFT_NOTE}; exp(mu phi) is for a limp yarn"
    return Case(name, CONTACTS, run, note, CONTACT_LIMIT, CONTACT_ELEMENTS)


def wrapped_case(turn, rigidity, contact):
    """A stiff yarn round a cylinder without friction; contact: ``line`` or ``point``.

    The yarn turns by about ``turn``; the exact answer is for the angle between its two pulls.
    """
    length_scale = math.sqrt(rigidity / _PULL)
    arc = _RADIUS if contact == "line" else 2.0 * _RADIUS
    # Tails of six decay lengths: their ends matter by 1e-5.
    length, shape, along = over_cylinder(turn, 6.0 * length_scale, arc, _RADIUS)
    pull = _PULL * along * [-1.0, 1.0, 1.0]
    stiffness = 1e3 if contact == "line" else 1e4
    points = 2 if contact == "line" else 4

    def run(elements):
        yarn = OpenYarn(
            length, rigidity, _CORD, elements, shape=shape, start_force=tuple(pull),
            end=_HINGED, contacts=points,
        )  # fmt: skip
        cylinder = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), _RADIUS, stiffness)
        state = solve_open([yarn], cylinders=[cylinder], steps=1, coarse=True)
        reaction = state.reaction(0, "end")
        exact = exact_contacts.wrapped_yarn(
            _PULL, rigidity, _RADIUS, _angle_between(pull, reaction)
        )
        if exact.kind != contact:
            raise ComputationError(
                f"yarn round a cylinder: meant to touch along a {contact}, the exact answer is a"
                f" {exact.kind}"
            )
        compare = _line_contact if contact == "line" else _point_contact
        return state, compare(state, exact, pull, reaction)

    name = f"stiff yarn round a cylinder, {contact} contact"
    return Case(name, CONTACTS, run, _SOFT_NOTE, CONTACT_LIMIT, CONTACT_ELEMENTS)


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
    whole = exact.inner_tension * exact.contact_angle + 2.0 * exact.point_force
    pairs = {
        "pressure radius/T": (force[inner].mean() / step * _RADIUS / _PULL,
                              exact.pressure * _RADIUS / _PULL),
        "tension in contact/T": (state.tension(0)[inner_gauss].mean() / _PULL,
                                 exact.inner_tension / _PULL),
        "curvature radius": (curvature * _RADIUS, exact.curvature * _RADIUS),
        "sum of contact forces/T": (force.sum() / _PULL, whole / _PULL),
    }  # fmt: skip
    return [Comparison(quantity, *pair, 4e-5) for quantity, pair in pairs.items()]


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
        Comparison(
            "contact force/T", float(np.linalg.norm(total)) / _PULL, exact.total / _PULL, 5e-4
        ),
        Comparison(
            "lever of T/radius", float(distance) / _RADIUS, moment / (_PULL * _RADIUS), 5e-4
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
        state = solve_open(
            yarns, contact=BarrierContact(1e3), diameter=diameter, steps=2, coarse=True
        )
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
            Comparison(quantity, force / unit, exact / unit, 1e-4)
            for quantity, force in (
                ("contact force L2/EI", -state.contact_force(0, 1)[2]),
                ("force of the supports L2/EI", held),
            )
        ]

    note = "the exact answer is for small slopes"
    return Case("two yarns crossing", CONTACTS, run, note, CONTACT_LIMIT, CONTACT_ELEMENTS)

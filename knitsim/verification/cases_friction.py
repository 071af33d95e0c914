"""Verification scenes of friction under loads that turn back: a yarn on an incline, the capstan.

Each function returns a :class:`knitsim.verification.case.Case`.
"""

import math

import numpy as np
from scipy.optimize import brentq

from knitsim.equilibrium import spline
from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.open_yarn import Cylinder, OpenYarn, Support, follow_open
from knitsim.verification import exact_friction
from knitsim.verification.case import CONTACT_ELEMENTS, CONTACT_LIMIT, CONTACTS, Case, Comparison
from knitsim.verification.cases_contacts import over_cylinder
from knitsim.yarn.law import TensionLaw

_RADIUS = 10e-3


def incline_case(friction, slope):
    """A heavy yarn on an incline, pulled upwards at its end, let go, pulled again.

    It lies along a cylinder, as deep in its surface as its weight presses it, and starts on the springs
    of friction, unstretched.  The way of its end shows the part that slid and does not come back, and
    that a closed loop of the pull ends where it began.
    """
    length, stiffness, weight, pull, barrier = 0.1, 1e4, 10.0, 0.3, 1e3
    along = np.array([math.cos(slope), math.sin(slope), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    pressed = weight * math.cos(slope)
    depth = brentq(lambda x: 2.0 * barrier / _RADIUS * (x**-3 - x) - pressed, 0.9, 1.0)
    spring = BarrierContact(barrier).shell(_RADIUS)
    law = TensionLaw([0.0, 0.1], [0.0, 0.1 * stiffness])
    # Weight, pull, and nothing that is held.
    programme = [(1, 0, 0), (1, 1, 0), (1, 0, 0), (1, 1, 0), (1, 0.4, 0), (1, 1, 0)]
    rest = (spring, stiffness, length)
    up = exact_friction.pulled_end(pull, friction * pressed + weight * math.sin(slope), *rest)
    half = exact_friction.unpulled_end(0.6 * pull, friction * pressed, *rest)
    whole = exact_friction.unpulled_end(pull, friction * pressed, *rest)
    lost = exact_friction.pull_cycle_loss(pull, friction * pressed, *rest)

    def shape(t):
        return np.outer(length * np.asarray(t), along) + depth * _RADIUS * across

    def run(elements):
        yarn = OpenYarn(
            length, 1e-6, law, elements, shape=shape, tip_force=tuple(pull * along),
            weight=(0.0, -weight, 0.0),
        )  # fmt: skip
        cylinder = Cylinder((0.0, 0.0, 0.0), tuple(along), _RADIUS, barrier)
        states = list(
            follow_open(
                [yarn], cylinders=[cylinder], friction=friction, steps=programme, coarse=True
            )
        )
        way = np.array([(state.end(0) - states[0].end(0)) @ along for state in states])
        pairs = {
            "way out EA/(P L)": (way[1], up),
            "way left EA/(P L)": (way[2], up - whole),
            "way out again EA/(P L)": (way[3], up),
            "way at 40 % EA/(P L)": (way[4], up - half),
        }
        unit = pull * length / stiffness
        found = [Comparison(name, a / unit, b / unit, 5e-6) for name, (a, b) in pairs.items()]
        cycle = (states[3].lost - states[1].lost) / (pull * unit)
        return states[-1], [
            *found, Comparison("lost in a cycle EA/(P2 L)", cycle, lost / (pull * unit), 5e-6)
        ]  # fmt: skip

    name = f"yarn on an incline, friction {friction:g}, slope {slope:g}"
    note = "where it starts to slide falls between contact points"
    return Case(name, CONTACTS, run, note, CONTACT_LIMIT, CONTACT_ELEMENTS)


def unloaded_capstan_case(friction, turn):
    """A limp yarn pulled over a cylinder, let back part of the way, all the way, and pulled again.

    On the way back it slides from its end on, up to where the tension meets that of the way out.  The
    cylinder gives way under the yarn, in proportion to the tension, and so adds to what stretches.
    """
    rigidity, low, stiffness, tail, barrier = 1e-9, 0.1, 1e3, 5e-3, 100.0
    law = TensionLaw([0.0, 0.1], [0.0, 0.1 * stiffness])
    length, shape, along = over_cylinder(turn, tail, _RADIUS, _RADIUS)
    grown = math.exp(friction * turn)
    # Of the barrier near first touch: 8 K/d2.
    compliance = _RADIUS * (1.0 / stiffness + 1.0 / (8.0 * barrier))
    asked = 0.5 * low * grown
    back = exact_friction.unloading_way(friction, low, asked, turn, compliance, tail / stiffness)
    out = 2e-5
    programme = [(1, 1, part) for part in (0.5, 1.0, 1.0 - back / out, 0.0, 1.0)]

    def run(elements):
        yarn = OpenYarn(
            length, rigidity, law, elements, shape=shape,
            start_force=tuple(low * along * [-1.0, 1.0, 1.0]),
            end=Support("hinged", moved_to=tuple(shape(np.ones(1))[0] + out * along)),
        )  # fmt: skip
        cylinder = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), _RADIUS, barrier)
        states = list(
            follow_open(
                [yarn],
                cylinders=[cylinder],
                friction=friction,
                sticking=100.0,
                steps=programme,
                coarse=True,
            )
        )
        end = [float(np.linalg.norm(state.reaction(0, "end"))) for state in states]
        gauss = np.add.outer(np.arange(elements), spline.GAUSS_POINTS).ravel()
        angle = (gauss * length / elements - tail) / _RADIUS
        tension, found = states[2].tension(0), []
        for name, low_angle, high_angle in (("still out", 0.15, 0.45), ("back", 0.8, 0.95)):
            there = (angle > low_angle * turn) & (angle < high_angle * turn)
            exact = [
                exact_friction.unloaded_tension(friction, low, asked, turn, a) for a in angle[there]
            ]
            found.append(
                (f"mean tension where it is {name}/T1", tension[there].mean(), np.mean(exact))
            )
        compared = [
            ("T2/T1 pulled", end[1], low * grown),
            ("T2/T1 part of the way back", end[2], asked),
            *found,
            ("T2/T1 back", end[3], low / grown),
            ("T2/T1 pulled again", end[4], low * grown),
        ]
        return states[-1], [Comparison(name, a / low, b / low, 5e-4) for name, a, b in compared]

    name = f"capstan let back, friction {friction:g}, turn {turn / math.pi:g} pi"
    note = "friction gives way before it slides; the yarn is not quite limp"
    return Case(name, CONTACTS, run, note, CONTACT_LIMIT, CONTACT_ELEMENTS)

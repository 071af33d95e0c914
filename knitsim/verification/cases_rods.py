"""Verification scenes without contact: cantilevers, struts, crimped yarns, stretch.

Each function returns a :class:`knitsim.verification.case.Case`.
"""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.special import j0

from knitsim.equilibrium.open_yarn import OpenYarn, Support, solve_open
from knitsim.verification import exact_crimp, exact_rods
from knitsim.verification.case import RODS, SHAPES, Case, Comparison
from knitsim.yarn.law import TensionLaw

LENGTH, RIGIDITY = 0.1, 1e-6
# Strain of the rods under the load EI/L^2: stiffer ones lock with few elements, softer ones stretch.
STRETCH = 1e-7
_LOAD, _COUPLE = RIGIDITY / LENGTH**2, RIGIDITY / LENGTH
_CLAMPED, _HINGED = Support("clamped", direction=(1.0, 0.0, 0.0)), Support("hinged")
_CRIMP_STEPS = 20  # in fewer the curvature changes sign on the way
_CRIMP_STRETCH = 1e-8  # its extension is small


def _law(stretch):
    return TensionLaw([0.0, 0.1], [0.0, 0.1 * _LOAD / stretch])


_STIFF, _STIFFER = _law(STRETCH), _law(_CRIMP_STRETCH)


def _curve(angle, length):
    """Shape for OpenYarn of the given length whose tangent has the angle ``angle(t)`` (rad)."""
    node, weight = np.polynomial.legendre.leggauss(40)

    def shape(t):
        t = np.asarray(t, dtype=float)
        at = angle(0.5 * t[:, None] * (node + 1.0))
        along, across = 0.5 * t * (np.cos(at) @ weight), 0.5 * t * (np.sin(at) @ weight)
        return length * np.stack([along, across, 0.0 * t], axis=-1)

    return shape


def _rod(elements, law=_STIFF, **changes):
    return OpenYarn(LENGTH, RIGIDITY, law, elements, **changes)


def _stretched(load, stretch=STRETCH):
    """What a rod under a load (EI/L2) moves by its own stretch, at most about (over L)."""
    return 3.0 * load * stretch


def tip_load_case(load):
    """Cantilever with the dead load P L^2/EI = ``load`` across it at its tip."""
    exact, floor = exact_rods.tip_load(load), _stretched(load)

    def run(elements):
        force = (0.0, -load * _LOAD, 0.0)
        state = solve_open([_rod(elements, start=_CLAMPED, tip_force=force)], coarse=True)
        x, y, _ = state.end(0) / LENGTH
        return state, [
            Comparison("deflection/L", -y, exact.deflection, floor / exact.deflection),
            Comparison("shortening/L", 1.0 - x, exact.shortening, floor / exact.shortening),
        ]

    return Case(f"cantilever, tip load {load:g} EI/L2", RODS, run)


def own_weight_case(load):
    """Cantilever under its own weight, weight per length times L^3/EI = ``load``."""
    exact = exact_rods.own_weight(load)

    def run(elements):
        weight = (0.0, -load * _LOAD / LENGTH, 0.0)
        state = solve_open([_rod(elements, start=_CLAMPED, weight=weight)], coarse=True)
        x, y, _ = state.end(0)
        return state, [Comparison("height/width", -y / x, exact.ratio, _stretched(load))]

    return Case(f"cantilever, own weight {load:g} EI/L2", RODS, run)


def roll_up_case(turn, text):
    """Cantilever rolled up by an end couple to kappa L = ``turn``, which ``text`` spells."""
    exact = exact_rods.roll_up(turn)
    floor = 1e-8  # no force, so nothing stretches

    def run(elements):
        state = solve_open([_rod(elements, start=_CLAMPED, couple=turn * _COUPLE)], coarse=True)
        x, y, _ = state.end(0) / LENGTH
        if text == "2 pi":
            return state, [Comparison("tip to clamp/L", math.hypot(x, y), 0.0, floor)]
        return state, [
            Comparison("tip along/L", x, exact[0], floor),
            Comparison("tip across/L", y, exact[1], floor),
        ]

    return Case(f"rolled up to kappa L = {text}", RODS, run, "round-off")


def strut_case(distance, ends):
    """Strut with ``hinged`` or ``clamped`` ends, pulled together to ``distance`` of its length.

    It starts with its ends in place, bent to theta = a cos(pi s) or a sin(2 pi s), chord J_0(a).
    """
    exact = exact_rods.strut(distance, ends)
    floor = _stretched(exact.load)
    a = brentq(lambda angle: j0(angle) - distance, 1e-6, 2.4)
    support = _HINGED if ends == "hinged" else _CLAMPED

    def angle(t):
        return a * (np.cos(np.pi * t) if ends == "hinged" else np.sin(2.0 * np.pi * t))

    def run(elements):
        strut = _rod(elements, shape=_curve(angle, LENGTH), start=support, end=support)
        state = solve_open([strut], steps=1, coarse=True)
        middle = state.points(0, 2)[elements, 1] / LENGTH
        return state, [
            Comparison("force L2/EI", -state.reaction(0, "end")[0] / _LOAD, exact.load, floor),
            Comparison("deflection/L", middle, exact.mid_deflection, floor / exact.mid_deflection),
        ]

    return Case(f"{ends} strut, ends at {distance:g} L", SHAPES, run)


def crimp_case(name, rest_angle, rest_curvature, pull):
    """A quarter wave of a crimped yarn under the tension p = T L^2/EI = ``pull``.

    rest_angle, rest_curvature: of the quarter over its arc length (rad; rad per L).
    """
    exact = exact_crimp.pull_crimped(rest_angle, pull)
    at_rest = exact_crimp.pull_crimped(rest_angle, 0.0).chord
    floor = _stretched(pull, _CRIMP_STRETCH) / exact.extension

    def run(elements):
        yarn = _rod(
            elements,
            _STIFFER,
            shape=_curve(rest_angle, LENGTH),
            start=_CLAMPED,
            tip_force=(pull * _LOAD, 0.0, 0.0),
            rest_curvature=lambda t: rest_curvature(t) / LENGTH,
        )
        state = solve_open([yarn], steps=_CRIMP_STEPS, coarse=True)
        chord = state.end(0)[0] / LENGTH
        return state, [Comparison("extension", chord / at_rest - 1.0, exact.extension, floor)]

    return Case(f"crimped yarn ({name}), pull {pull:g} EI/L2", SHAPES, run)


_KNEE = TensionLaw([0.0, 0.02, 0.08], [0.0, 1.0, 1.6])  # 50 N, then 10 N
_KNEE_FLOOR, _KNEE_NOTE = 5e-5, "the kink of the law is rounded"


def pulled_case(strain):
    """A straight yarn of a bilinear law pulled to ``strain``: its force and its energy."""
    force = float(np.interp(strain, _KNEE.strain, _KNEE.tension))
    fine = np.union1d(np.linspace(0.0, strain, 3), np.minimum(_KNEE.strain, strain))
    energy = float(np.trapezoid(np.interp(fine, _KNEE.strain, _KNEE.tension), fine))

    def run(elements):
        end = Support("hinged", moved_to=(LENGTH * (1.0 + strain), 0.0, 0.0))
        yarn = OpenYarn(LENGTH, RIGIDITY, _KNEE, elements, start=_HINGED, end=end)
        state = solve_open([yarn], coarse=True)
        return state, [
            Comparison("force/force of the knee", state.reaction(0, "end")[0], force, _KNEE_FLOOR),
            Comparison(
                "energy/(L force of the knee)", state.energy[0] / LENGTH, energy, _KNEE_FLOOR
            ),
        ]

    return Case(f"straight yarn pulled to {100 * strain:g} %", SHAPES, run, _KNEE_NOTE)


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
        state = solve_open([yarn], steps=1, coarse=True)
        extension = state.end(0)[0] / LENGTH - 1.0
        return state, [Comparison("extension/L", extension, exact, _KNEE_FLOOR)]

    return Case("yarn hanging under its own weight", SHAPES, run, _KNEE_NOTE)

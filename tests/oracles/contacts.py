"""Exact answers for yarns in contact: a chain that slips, the tail of a wrapped yarn, pressed yarns."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from knitsim.verification.exact_rods import tip_load


def capstan_chain(friction, turns):
    """T2/T1 of a limp chain that slips on every contact node; turns (n,): its angle at each (rad).

    At a node (T2 - T1) cos(t/2) = mu N and (T1 + T2) sin(t/2) = N, the normal force halving the angle
    between its two links.  So T2/T1 = (1 + mu tan(t/2))/(1 - mu tan(t/2)) and log(T2/T1) = 2 sum
    atanh(mu tan(t/2)); for n equal turns to leading order mu phi + mu (1 + mu^2) phi^3/(12 n^2).
    """
    return math.exp(2.0 * math.fsum(np.arctanh(friction * np.tan(0.5 * np.asarray(turns)))))


def tail_angle(tension, rigidity, start_angle, arc):
    """Angle (rad) between a long tail and its asymptote at ``arc`` (m, any shape) from the contact.

    tan(theta/4) = tan(theta_0/4) exp(-s sqrt(T/EI)); start_angle: theta_0.
    """
    decay = np.exp(-np.asarray(arc, dtype=float) * math.sqrt(tension / rigidity))
    return 4.0 * np.arctan(math.tan(0.25 * start_angle) * decay)


@dataclass(frozen=True)
class PressedYarns:
    """Contact force (N), the deflections of the two (m) and their curvatures at the contact (m-1)."""

    force: float
    deflections: tuple
    curvatures: tuple

    def touch_at_a_point(self, distance, crossing_angle=0.5 * math.pi):
        """Whether the yarns touch at one point only: (1 - d kappa_a)(1 - d kappa_b) > cos^2(angle)."""
        room = [1.0 - distance * each for each in self.curvatures]
        return min(room) > 0.0 and room[0] * room[1] > math.cos(crossing_angle) ** 2


def pressed_yarns(approach, rigidities, lengths):
    """Two straight yarns that cross at their middles, their ends pressed past each other (approach, m).

    The ends of either yarn are held at one height each, free to slide along the yarn's plane and to
    turn.  By symmetry the middle is a clamp and each half a cantilever of length L/2 under the dead
    load N/2 across it: N solves delta_a(N) + delta_b(N) = approach.
    """
    half = [0.5 * part for part in lengths]
    scale = [0.5 * a * a / b for a, b in zip(half, rigidities, strict=True)]

    def bent(force):
        return [tip_load(force * each) for each in scale]

    def gap(force):
        return sum(a * rod.deflection for a, rod in zip(half, bent(force), strict=True)) - approach

    # A cantilever stiffens as it bends: the linear answer, N/approach = 1/sum(L^3/(48 EI)), is low.
    low = approach / sum(a * each / 3.0 for a, each in zip(half, scale, strict=True))
    high = 2.0 * low
    while gap(high) <= 0.0:
        high *= 2.0
    force = brentq(gap, 0.999 * low, high, xtol=1e-300, rtol=1e-15)
    rods = bent(force)
    return PressedYarns(
        force, tuple(a * rod.deflection for a, rod in zip(half, rods, strict=True)),
        tuple(rod.root_moment / a for a, rod in zip(half, rods, strict=True)),
    )  # fmt: skip

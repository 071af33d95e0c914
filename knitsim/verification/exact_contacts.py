"""Exact answers for yarns in contact: capstan, yarn round a cylinder, a span that is pushed.

SI units.  Yarns are inextensible here, the contact is hard: the radius of contact is the distance
between the yarn's centre line and the cylinder's axis, or half the distance of two centre lines
each.  Friction acts at the centre line (its couple about it is left out).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from knitsim.errors import InputError, number

_ROOT = {"xtol": 1e-300, "rtol": 4.0 * np.finfo(float).eps, "maxiter": 500}

# ---- the capstan ----


def capstan(friction, turn):
    """T2/T1 = exp(mu phi) of a limp yarn that slips over the angle ``turn`` (rad); Euler."""
    friction = number("friction", friction, 0.0, low_allowed=True)
    return math.exp(friction * number("turn", turn, 0.0, low_allowed=True))


# ---- a stiff yarn round a cylinder ----


@dataclass(frozen=True)
class WrappedYarn:
    """A yarn round a cylinder, without friction.

    kind: ``line`` or ``point``; lift_off_turn: phi* (rad; inf where the contact is always a point);
    contact_angle: of the line contact (rad, 0 for a point); total: resultant of all contact forces,
    2 T sin(phi/2) (N); point_force (N): the whole force, or that at each end of the line contact;
    pressure: force per length of yarn between them (N m-1); inner_tension: of the yarn in line
    contact (N; T cos(phi/2) for a point); curvature: of the centre line in contact (m-1);
    tail_turn: what each tail turns from the contact to its asymptote (rad).
    """

    kind: str
    lift_off_turn: float
    contact_angle: float
    total: float
    point_force: float
    pressure: float
    inner_tension: float
    curvature: float
    tail_turn: float


def lift_off_turn(tension, rigidity, radius):
    """phi* = 4 asin(sqrt(EI/T)/(2 rho)): up to this total turn (rad) the contact is one point.

    tension: T (N), rigidity: EI (N m2), radius: rho (m), of the centre line in contact.
    A long tail under T obeys EI theta'' = T sin(theta), so |theta'| = 2 sqrt(T/EI) sin(theta/2).
    In a point contact theta = phi/2 on both sides; the yarn lies outside the cylinder while
    theta' <= 1/rho.  Returns inf where no turn is enough (EI/T >= 4 rho^2).
    """
    tension, rigidity, radius = _wrap(tension, rigidity, radius)
    sine = math.sqrt(rigidity / tension) / (2.0 * radius)
    return 4.0 * math.asin(sine) if sine < 1.0 else math.inf


def wrapped_yarn(tension, rigidity, radius, turn):
    """Contact of a stiff yarn round a cylinder, pulled by T at both ends, without friction.

    tension, rigidity, radius: see :func:`lift_off_turn`; turn: phi (rad) between the directions of
    the two pulls.  Tails long against sqrt(EI/T): a tail of length t with a free end is
    off by a few exp(-2 t sqrt(T/EI)), relative, in all but the total, which it does not change.

    Up to phi* one point carries N = 2 T sin(phi/2).  Beyond it the yarn lies on the cylinder over
    phi - phi*: the moment there is EI/rho throughout, so there is no shear force and the tension is
    constant, T' = T cos(phi*/2) = T - EI/(2 rho^2), pressed on with T'/rho per length.  At each end
    the curvature is continuous (the moment is), the shear force of the tail is not: the point force
    T sin(phi*/2).
    Returns a :class:`WrappedYarn`.  Raises InputError for a turn of 0, of more than pi in a point
    contact (the tails cross), or a line contact that the yarn would leave (T <= EI/(2 rho^2)).
    """
    tension, rigidity, radius = _wrap(tension, rigidity, radius)
    turn = number("turn", turn, 0.0)
    limit = lift_off_turn(tension, rigidity, radius)
    total = 2.0 * tension * math.sin(0.5 * turn)
    if turn <= limit:
        if turn > math.pi:
            raise InputError(
                "turn", turn, f"must be at most pi in a point contact (phi* = {limit:g})"
            )
        curvature = 2.0 * math.sqrt(tension / rigidity) * math.sin(0.25 * turn)
        inner = tension * math.cos(0.5 * turn)
        return WrappedYarn("point", limit, 0.0, total, total, 0.0, inner, curvature, 0.5 * turn)
    inner = tension - 0.5 * rigidity / radius**2
    if inner <= 0.0:
        raise InputError(
            "tension", tension, f"must be above EI/(2 rho^2) = {0.5 * rigidity / radius**2:g} N"
        )
    end = tension * math.sin(0.5 * limit)
    return WrappedYarn(
        "line", limit, turn - limit, total, end, inner / radius, inner, 1.0 / radius, 0.5 * limit
    )


def capstan_stiff(friction, tension, rigidity, radius, turn):
    """Greater tension T2 (N) at which a stiff yarn slips over a cylinder, long tails.

    tension: the smaller one, T1 (N); other arguments as in :func:`wrapped_yarn`.  In line contact
    the moment is constant, the tension T' grows as exp(mu phi); each end has the point force
    T_i sin(beta_i) with its own friction, beta_i = phi*(T_i)/2 the turn of that tail:
        T2 (cos beta_2 - mu sin beta_2)
            = T1 (cos beta_1 + mu sin beta_1) exp(mu (phi - beta_1 - beta_2)).
    EI -> 0 gives exp(mu phi).  Raises InputError unless the contact at T1 is a line.
    """
    friction = number("friction", friction, 0.0, low_allowed=True)
    tension, rigidity, radius = _wrap(tension, rigidity, radius)
    turn = number("turn", turn, 0.0)
    if turn <= lift_off_turn(tension, rigidity, radius):
        raise InputError("turn", turn, "must exceed the turn of lift-off: the contact is a point")
    if tension <= 0.5 * rigidity / radius**2:
        raise InputError("tension", tension, "must be above EI/(2 rho^2)")
    first = 0.5 * lift_off_turn(tension, rigidity, radius)
    low_side = tension * (math.cos(first) + friction * math.sin(first))

    def excess(t2):
        # (cos beta - mu sin beta) T2 with T2 cos(beta_2) = T2 - EI/(2 rho^2).
        beta = 0.5 * lift_off_turn(t2, rigidity, radius)
        high_side = t2 * (math.cos(beta) - friction * math.sin(beta))
        return high_side - low_side * math.exp(friction * (turn - first - beta))

    if friction == 0.0:
        return tension
    high = tension * math.exp(friction * turn)
    while excess(high) <= 0.0:
        high *= 2.0
    return brentq(excess, tension, high, **_ROOT)


def _wrap(tension, rigidity, radius):
    return (
        number("tension", tension, 0.0),
        number("rigidity", rigidity, 0.0, low_allowed=True),
        number("radius", radius, 0.0),
    )


# ---- two yarns that cross ----


def span_stiffness(rigidity, span, tension=0.0, ends="hinged"):
    """Force over deflection (N m-1) at the middle of a yarn's span, for small deflections.

    rigidity: EI (N m2), span: L (m), tension: T (N, at least 0), ends: ``hinged`` or ``clamped``.
    Beam under tension, EI w'''' = T w'': k = 4 T/(L (1 - tanh(u)/u)), u = (L/2) sqrt(T/EI) hinged,
    half of that clamped; without tension 48 EI/L^3 and 192 EI/L^3.  Two spans that cross are
    springs in series: N = approach/(1/k_a + 1/k_b), for slopes far below 1.
    """
    rigidity = number("rigidity", rigidity, 0.0)
    span = number("span", span, 0.0)
    tension = number("tension", tension, 0.0, low_allowed=True)
    if ends not in ("hinged", "clamped"):
        raise InputError("ends", repr(ends), "must be hinged or clamped")
    half = 0.5 if ends == "hinged" else 0.25
    u = half * span * math.sqrt(tension / rigidity)
    if u < 0.05:
        # 3 (1 - tanh(u)/u)/u^2 as a series; the next term is below 1e-14.
        q = u * u
        slack = 1.0 - q * (2 / 5 - q * (17 / 105 - q * (62 / 945 - q * 1382 / 51975)))
    else:
        slack = 3.0 * (1.0 - math.tanh(u) / u) / (u * u)
    return 12.0 * rigidity / (half**2 * span**3 * slack)

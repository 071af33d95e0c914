"""Ideal KES curves, and explicit step limits of chains of mass points, from their formulas."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class IdealTension:
    """linearity LT (1), work WT (J m-2), resilience RT (1), extension EMT (1), recovered (J m-2)."""

    linearity: float
    work: float
    resilience: float
    extension: float
    recovered: float


def kes_power_curve(scale, n, m, force, residual=0.0):
    """KES tension parameters of F = a e^n (a: scale, N m-1) up to ``force``, then back by a power m.

    Recovery runs from (e_m, F_m) to F = 0 at the residual strain e_r as F_m ((e - e_r)/(e_m - e_r))^m.
    With e_m = (F_m/a)^(1/n), WT = F_m e_m/(n + 1) up and F_m (e_m - e_r)/(m + 1) back; LT = 2/(n + 1),
    RT = (n + 1)/(m + 1) for e_r = 0 (S. Kawabata, The Standardization and Analysis of Hand Evaluation,
    2nd ed., 1980).
    """
    extension = (force / scale) ** (1.0 / n)
    work = force * extension / (n + 1.0)
    recovered = force * (extension - residual) / (m + 1.0)
    return IdealTension(2.0 / (n + 1.0), work, recovered / work, extension, recovered)


@dataclass(frozen=True)
class IdealBending:
    """rigidity B (N m), hysteresis 2HB (N, the width of the loop), lost (J m-2, per cycle)."""

    rigidity: float
    hysteresis: float
    lost: float


def kes_linear_bending(rigidity, half, top):
    """KES bending parameters of M = B kappa + HB (curvature rising) and B kappa - HB (falling).

    Turning points at plus and minus ``top`` (m-1), where the moment jumps by 2HB; the cycle loses the
    loop's area, 4 HB top.
    """
    return IdealBending(rigidity, 2.0 * half, 4.0 * half * top)


def stretch_step_limit(stiffness, linear_density, spacing, nodes=None):
    """Largest stable step (s) of central differences, 2/omega_max, for stretching waves in a chain.

    Mass points mu h joined by springs EA/h: omega = (2/h) sqrt(EA/mu) |sin(q h/2)|.  For an endless
    chain the sine reaches 1; with ``nodes`` free points between two held ones it is sin(pi n/(2 (n+1))).
    """
    return spacing * math.sqrt(linear_density / stiffness) / _largest_sine(nodes)


def bending_step_limit(rigidity, linear_density, spacing, nodes=None):
    """The same for bending waves, EI/(2 h^3) sum (w_(i-1) - 2 w_i + w_(i+1))^2, hinged ends:
    omega = (4/h^2) sqrt(EI/mu) sin^2(q h/2)."""
    limit = 0.5 * spacing**2 * math.sqrt(linear_density / rigidity)
    return limit / _largest_sine(nodes) ** 2


def _largest_sine(nodes):
    return 1.0 if nodes is None else math.sin(0.5 * math.pi * nodes / (nodes + 1.0))

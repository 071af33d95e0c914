"""Exact answers for verification, from their formulas: ideal KES curves and explicit step limits.

Rods (cantilever, strut, roll-up) are in :mod:`knitsim.verification.exact_rods`, the crimped yarn in
:mod:`knitsim.verification.exact_crimp`, contacts (capstan, yarn round a cylinder, crossing yarns) in
:mod:`knitsim.verification.exact_contacts`.  None of them uses any other solver of knitsim.
"""

import math
from dataclasses import dataclass

from knitsim.errors import InputError, number

# ---- ideal KES curves ----


@dataclass(frozen=True)
class IdealTension:
    """KES tension parameters of a pair of power curves.

    linearity LT (1), work WT (J m-2), resilience RT (1; KES prints it in per cent), extension
    EMT (1; likewise), recovered work (J m-2).
    """

    linearity: float
    work: float
    resilience: float
    extension: float
    recovered: float


def kes_power_curve(scale, loading_power, recovery_power, force, residual_strain=0.0):
    """KES tension parameters of F = a e^n up to ``force``, then back by a power m.

    scale: a (N m-1), loading_power: n, force: the greatest force per width F_m (N m-1).  Recovery
    runs from (e_m, F_m) to F = 0 at the residual strain e_r as F_m ((e - e_r)/(e_m - e_r))^m.
    With e_m = (F_m/a)^(1/n) the integrals are WT = F_m e_m/(n + 1) up and F_m (e_m - e_r)/(m + 1)
    back.  Then LT = WT/(F_m e_m/2) = 2/(n + 1) and RT, their ratio, is (n + 1)/(m + 1) for e_r = 0
    (definitions: S. Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd ed., 1980).
    Returns an :class:`IdealTension`; raises InputError for values outside the definitions.
    """
    scale = number("scale", scale, 0.0)
    n = number("loading_power", loading_power, 0.0)
    m = number("recovery_power", recovery_power, 0.0)
    force = number("force", force, 0.0)
    extension = (force / scale) ** (1.0 / n)
    residual = number("residual_strain", residual_strain, 0.0, extension, low_allowed=True)
    work = force * extension / (n + 1.0)
    recovered = force * (extension - residual) / (m + 1.0)
    return IdealTension(2.0 / (n + 1.0), work, recovered / work, extension, recovered)


@dataclass(frozen=True)
class IdealBending:
    """KES bending parameters of a straight curve with constant hysteresis.

    rigidity B (N m), hysteresis 2HB (N, the width of the loop), lost (J m-2, per cycle).
    """

    rigidity: float
    hysteresis: float
    lost: float


def kes_linear_bending(rigidity, half_hysteresis, max_curvature):
    """KES bending parameters of M = B kappa + HB (curvature rising) and B kappa - HB (falling).

    rigidity: B per width (N m), half_hysteresis: HB (N), max_curvature: the cycle's turning points
    are at plus and minus this (m-1); there the moment jumps by 2HB.  Every chord of a branch has
    the slope B, and the two branches are 2HB apart at every curvature, so the result depends on no
    choice of range; the cycle loses the loop's area, 4 HB kappa_max.
    Returns an :class:`IdealBending`.
    """
    rigidity = number("rigidity", rigidity, 0.0)
    half = number("half_hysteresis", half_hysteresis, 0.0, low_allowed=True)
    max_curvature = number("max_curvature", max_curvature, 0.0)
    return IdealBending(rigidity, 2.0 * half, 4.0 * half * max_curvature)


# ---- explicit step limits of chains of mass points ----


def stretch_step_limit(stiffness, linear_density, spacing, nodes=None):
    """Largest stable step (s) of central differences, 2/omega_max, for stretching waves in a chain.

    Mass points mu h joined by springs EA/h: omega = (2/h) sqrt(EA/mu) |sin(q h/2)|.  For an endless
    (or even periodic) chain the sine reaches 1 and the limit is h sqrt(mu/EA).

    stiffness: EA (N), linear_density: mu (kg m-1), spacing: h (m).  nodes: the number of free
    points between two held ones; then the largest sine is sin(pi n/(2 (n + 1))), exactly.
    """
    stiffness, mu, h = _chain(stiffness, linear_density, spacing)
    return h * math.sqrt(mu / stiffness) / _largest_sine(nodes)


def bending_step_limit(rigidity, linear_density, spacing, nodes=None):
    """As :func:`stretch_step_limit` for bending waves; rigidity: EI (N m2).

    Energy EI/(2 h^3) sum (w_(i-1) - 2 w_i + w_(i+1))^2: omega = (4/h^2) sqrt(EI/mu) sin^2(q h/2),
    so the limit is (h^2/2) sqrt(mu/EI).  nodes: the number of free points between two hinged ones.
    """
    rigidity, mu, h = _chain(rigidity, linear_density, spacing)
    return 0.5 * h * h * math.sqrt(mu / rigidity) / _largest_sine(nodes) ** 2


def _chain(stiffness, linear_density, spacing):
    return (
        number("stiffness", stiffness, 0.0),
        number("linear_density", linear_density, 0.0),
        number("spacing", spacing, 0.0),
    )


def _largest_sine(nodes):
    if nodes is None:
        return 1.0
    if nodes != int(nodes) or nodes < 1:
        raise InputError("nodes", nodes, "must be a whole number, at least 1")
    return math.sin(0.5 * math.pi * nodes / (nodes + 1.0))

"""The naturally crimped yarn pulled straight: rest shapes, extension against force, dimensionless.

Lengths are in arc lengths of a quarter wave (crest to inflection), forces in EI/length^2, energies
in EI/length.  Planar and inextensible; accuracy as in :mod:`knitsim.verification.exact_rods`.
"""

import math
from dataclasses import dataclass

import numpy as np

from knitsim.errors import InputError, number
from knitsim.verification.exact_rods import MOST_LOAD, clamped_rod


@dataclass(frozen=True)
class CrimpedYarn:
    """A quarter wave of a crimped yarn under tension: chord (over the quarter's arc length),
    extension (of the chord, over the chord at rest), steepest angle (rad), energy stored in the
    quarter (EI/length), estimated relative error."""

    chord: float
    extension: float
    end_angle: float
    energy: float
    error: float


def crimp_sine(largest_angle):
    """Rest shape whose angle is a sine of the arc length: theta_0 = A sin(pi s/2).

    From the crest (s = 0) to the inflection (s = 1) of a wave, as a function for
    :func:`pull_crimped`.  Its chord is J_0(A), so A (rad) must be below 2.4.
    """
    angle = number("largest_angle", largest_angle, 0.0, 2.4)
    return lambda s: angle * np.sin(0.5 * math.pi * s)


def crimp_arcs(largest_angle):
    """Rest shape of circular arcs that join in inflections: theta_0 = A s (zigzag of the angle).

    Its chord is sin(A)/A, so A (rad) must be below pi.
    """
    angle = number("largest_angle", largest_angle, 0.0, math.pi)
    return lambda s: angle * s


def pull_crimped(rest_angle, pull):
    """A naturally crimped yarn pulled straight: theta'' - theta_0'' = p sin(theta).

    The yarn's rest shape is a symmetric wave: theta_0 is odd about each crest and even about each
    inflection.  So is theta, and the yarn under the tension T along its axis is made of quarters
    from crest (theta = 0) to inflection (no moment, theta' = theta_0').  A piece cut at inflections
    with hinged ends, or at crests with guided ends, is the same exactly.

    rest_angle: theta_0 over the quarter, function of s in [0, 1] (:func:`crimp_sine`,
    :func:`crimp_arcs`, :func:`crimp_sinusoid`); pull: p = T (quarter's arc length)^2/EI, 0 to 1e5.
    Returns a :class:`CrimpedYarn`; its tension is the derivative of the energy by the chord.
    """
    pull = number("pull", pull, 0.0, MOST_LOAD, low_allowed=True)
    at_crest = float(np.asarray(rest_angle(np.zeros(1)))[0])
    if not abs(at_crest) <= 1e-12:
        raise InputError("rest_angle(0)", at_crest, "must be 0: the quarter starts at a crest")
    rod = clamped_rod(force=(pull, 0.0), rest_angle=rest_angle)
    chord, gain = float(rod.tip[0]), float(rod.displacement[0])
    return CrimpedYarn(chord, gain / (chord - gain), rod.tip_angle, rod.energy, rod.error)

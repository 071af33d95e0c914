"""Lateral compression of a yarn: contact laws of the equilibrium model from a measured curve.

The contact energy of two yarns is v(D) per length of the one and length of the other, D being the
distance of their centre lines.  For two straight yarns that cross at right angles it sums up to
E(D) = 2 pi int_D v(r) r dr, so that the force that presses them together is

    F(D) = 2 pi D v(D),

and a measured force-thickness curve of two crossed yarns is the law itself.  Their thickness is D and
one diameter, as the two outer halves are not pressed by a yarn.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from knitsim.errors import InputError

LEAST_POINTS = 4


def barrier_energy(distance, diameter):
    """(1 - x^2)^2/x^2, x = distance/diameter: the barrier law's energy over its stiffness K (1)."""
    x2 = (np.asarray(distance, dtype=float) / diameter) ** 2
    return np.where(x2 < 1.0, (1.0 - x2) ** 2 / x2, 0.0)


def crossed_force(distance, diameter, stiffness):
    """Force (N) that presses two yarns crossed at right angles to a distance of centre lines (m).

    Barrier law with stiffness K (N/m): F = 2 pi K D (1 - x^2)^2/x^2, zero from one diameter on.
    """
    distance = np.asarray(distance, dtype=float)
    return 2.0 * math.pi * stiffness * distance * barrier_energy(distance, diameter)


@dataclass(frozen=True)
class CompressionFit:
    """stiffness K (N/m) with its 95 % interval (low, high); rms: misfit over the largest force."""

    stiffness: float
    low: float
    high: float
    rms: float
    points: int


def fit_barrier(distance, force, diameter, where="compression"):
    """Least-squares stiffness K of the barrier law; a :class:`CompressionFit`.

    distance: of the centre lines of two crossed yarns (m), force (N), both (n,); diameter (m).  The
    law is linear in K, so the answer is unique.

    Raises InputError if no point lies below one diameter, at or below zero distance, or too few do.
    """
    distance, force = np.asarray(distance, dtype=float), np.asarray(force, dtype=float)
    if (distance <= 0).any():
        raise InputError(
            where, f"distance {distance.min():.4g} m",
            f"the thickness must stay above the yarn's diameter, {diameter:.4g} m",
        )  # fmt: skip
    shape = crossed_force(distance, diameter, 1.0)
    pressed = int((shape > 0).sum())
    if pressed < LEAST_POINTS:
        raise InputError(
            where, f"{pressed} points in contact",
            f"at least {LEAST_POINTS} must be thinner than two diameters, {2 * diameter:.4g} m",
        )  # fmt: skip
    stiffness = float(shape @ force / (shape @ shape))
    if not stiffness > 0:
        raise InputError(where, f"stiffness {stiffness:.4g} N/m", "the force must rise as it thins")
    misfit = force - stiffness * shape
    freedom = force.size - 1
    error = math.sqrt(misfit @ misfit / freedom / (shape @ shape)) * stdtrit(freedom, 0.975)
    rms = math.sqrt(misfit @ misfit / force.size) / force.max()
    return CompressionFit(stiffness, stiffness - error, stiffness + error, rms, force.size)


def fit_barrier_test(test, diameter):
    """:func:`fit_barrier` on a measured yarn compression, a knitsim.measured.test.MeasuredTest.

    The thickness is that of two crossed yarns: the distance of their centre lines and one diameter.
    """
    return fit_barrier(test["thickness"] - diameter, test["force"], diameter, where=test.source)

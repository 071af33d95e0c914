"""A crimp that is a sine in space, and the pull at which a crimped yarn has a given extension."""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipeinc

from knitsim.verification.exact_crimp import pull_crimped


def crimp_sinusoid(slope):
    """Rest shape y = h cos(2 pi x/wavelength); slope: b = 2 pi h/wavelength.

    The quarter's arc length up to phase phi is E(phi | -b^2), inverted for phi by bisection; then
    theta_0 = atan(b sin(phi)).
    """
    quarter = float(ellipeinc(0.5 * math.pi, -slope * slope))

    def rest_angle(s):
        target = np.asarray(s, dtype=float) * quarter
        low, high = np.zeros(target.shape), np.full(target.shape, 0.5 * math.pi)
        for _ in range(60):
            middle = 0.5 * (low + high)
            beyond = ellipeinc(middle, -slope * slope) > target
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        return np.arctan(slope * np.sin(0.5 * (low + high)))

    return rest_angle


def crimped_pull(rest_angle, extension):
    """The pull of :func:`pull_crimped` at which the extension is ``extension``, above 0."""
    high = 1.0
    while pull_crimped(rest_angle, high).extension < extension:
        high *= 4.0
    return brentq(
        lambda p: pull_crimped(rest_angle, p).extension - extension, 0.0, high,
        xtol=1e-300, rtol=1e-13,
    )  # fmt: skip

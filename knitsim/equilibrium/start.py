"""A loop to start from: right topology for any sizes, no equation that may lack a solution.

On the half loop, t in [0, 1] from sinker arc to head:
x = w t/2 + A sin 2 pi t, y = -(H/2) cos pi t, z = (Z/2)(1 - cos 2 pi t).
A makes neighbouring legs overlap sideways by a given width, H gives the loop its length.
"""

import math

import numpy as np
from scipy.optimize import brentq

from knitsim.errors import ComputationError


def _points(t, width, side, height, thick):
    return np.stack(
        [
            0.5 * width * t + side * np.sin(2 * np.pi * t),
            -0.5 * height * np.cos(np.pi * t),
            0.5 * thick * (1 - np.cos(2 * np.pi * t)),
        ],
        axis=-1,
    )


def _length(width, side, height, thick):
    """Length of the whole loop (two halves)."""
    t = (np.arange(200) + 0.5) / 200
    v = np.stack(
        [
            0.5 * width + 2 * np.pi * side * np.cos(2 * np.pi * t),
            0.5 * np.pi * height * np.sin(np.pi * t),
            np.pi * thick * np.sin(2 * np.pi * t),
        ]
    )
    return 2.0 * np.sqrt((v**2).sum(0)).mean()


def _overlap(side, width):
    """How far the leg runs back over its neighbour's: x(t1) - x(1 - t1) at the turning point t1."""
    ratio = width / (4 * np.pi * side)
    if ratio >= 1.0:
        return 0.0
    t = math.acos(-ratio) / (2 * np.pi)
    return 0.5 * width * (2 * t - 1) + 2 * side * math.sin(2 * np.pi * t)


def sinusoidal_loop(width, length, overlap, thick, points):
    """Positions (points, 3) of one loop at equal arc length, from the sinker arc on.

    width: wale spacing; length: loop length; overlap: how far legs run back sideways; thick:
    thickness between centre lines (all m).  Raises ComputationError where the loop length does not
    suffice.
    """
    side = brentq(
        lambda a: _overlap(a, width) - overlap,
        width / (4 * np.pi),
        width + overlap,
        xtol=1e-9 * width,
    )
    flat = _length(width, side, 0.0, thick)
    if flat >= length:
        raise ComputationError(
            f"no loop of length {length:g} m has wale spacing {width:g} m and legs that overlap by "
            f"{overlap:g} m: these alone take {flat:g} m"
        )
    height = brentq(
        lambda h: _length(width, side, h, thick) - length, 0.0, length, xtol=1e-9 * length
    )
    t = np.linspace(0.0, 1.0, 2001)
    fine = _points(t, width, side, height, thick)
    arc = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(fine, axis=0) ** 2).sum(1)))])
    half = points // 2
    at = np.interp(np.arange(half + 1) * arc[-1] / half, arc, t)
    first = _points(at, width, side, height, thick)
    second = first[-2:0:-1] * [-1, 1, 1] + [width, 0, 0]
    return np.concatenate([first, second])

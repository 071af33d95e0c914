"""Contact laws averaged over the cells that pairs of contact points stand for, as the method states them.

Two contact points stand for a stretch of either yarn, h long.  Over the cell of both, the squared distance
is taken to be q + a x + b y with x, y in [-1/2, 1/2]; a law with a core takes the distance itself to be so.
The sum a x + b y = t has a density that is a trapezoid, so that the mean of the law is an integral by t
alone, here by Gauss's rule piece by piece.  Nothing of this is shared with the solver.
"""

import numpy as np

from knitsim.verification.judge.given import Barrier

SPREAD = 1.1  # spacings of contact points beyond the diameter up to which cells may touch
THIN = 1e-3  # of d (d - core): least change of the square over a cell; smaller ones are rounded off to it
NARROW, DEEP = 0.05, 0.98  # of d^2: half width of cells that are averaged by derivatives; approach
PLACES = 16  # of the rule, in each piece
_AT, _WEIGHT = (0.5 * x for x in np.polynomial.legendre.leggauss(PLACES))
_STEP = 1e-30  # of complex derivatives


def cell_mean(given, square, along, other):
    """Mean energy (J/m2) over cells whose squared distance is ``square`` (m2) in the middle.

    along, other: its changes over the cell (m2); all of one shape (n,), and complex where derivatives are
    sought by complex steps.
    """
    law, d = given.contact, given.diameter
    least = THIN * d * (d - law.core)
    a, b = np.sqrt(along**2 + least**2), np.sqrt(other**2 + least**2)
    if isinstance(law, Barrier):
        return _of_barrier(law, d, square, a, b)
    middle = np.sqrt(square)
    a, b = 0.5 * a / middle, 0.5 * b / middle
    # No corner of a cell comes nearer the core than half way.
    part = (a + b) / (middle - law.core)
    shrunk = (1.0 + part**8) ** -0.125
    return _by_density(lambda x: law.at(x, d)[0], middle, a * shrunk, b * shrunk, d)


def _of_barrier(law, d, square, a, b):
    """By the squared distance; narrow cells that touch everywhere by v, v'' and v'''' in the middle."""
    half = 0.5 * (a + b).real
    deep = square.real - half <= (1.0 - DEEP) * d * d
    whole = (square.real + half <= d * d) & (deep | (half <= NARROW * d * d))
    found = np.empty_like(square)
    edge = [x[~whole] for x in (square, a, b)]
    found[~whole] = _by_density(lambda x: law.at(np.sqrt(x), d)[0], *edge, d * d)
    u, a, b = 1.0 - square[whole] / d**2, a[whole] / d**2, b[whole] / d**2
    i = 1.0 / (1.0 - u)
    second = (a**2 + b**2) / 24.0
    fourth = (a**4 + b**4) / 1920.0 + a**2 * b**2 / 576.0
    found[whole] = law.stiffness * (u**2 * i + 2.0 * i**3 * second + 24.0 * i**5 * fourth)
    return found


def _by_density(value, middle, a, b, touch):
    """Mean of value(middle + t) below touch, t having the density of a x + b y."""
    half, less = 0.5 * (a + b), 0.5 * np.where((a - b).real < 0.0, b - a, a - b)
    near = (middle - half).real < touch  # elsewhere nothing touches
    total = np.zeros_like(middle)
    middle, a, b, half, less = (x[near] for x in (middle, a, b, half, less))
    top = np.where(a.real < b.real, b, a)
    cut = touch - middle
    ends = [np.where((end - cut).real > 0.0, cut, end) for end in (-half, -less, less, half)]
    density = (lambda t: (half + t) / (a * b), lambda t: 1.0 / top, lambda t: (half - t) / (a * b))
    for low, high, of in zip(ends[:-1], ends[1:], density, strict=True):
        t = 0.5 * (low + high) + _AT[:, None] * (high - low)
        total[near] += (high - low) * (_WEIGHT[:, None] * value(middle + t) * of(t)).sum(0)
    return total


def cell_slopes(given, square, along, other):
    """Derivatives (3, n) of :func:`cell_mean` by square, along and other."""
    parts = np.array([square, along, other], dtype=complex)
    found = []
    for n in range(3):
        moved = parts.copy()
        moved[n] += 1j * _STEP
        found.append(cell_mean(given, *moved).imag / _STEP)
    return np.array(found)


def cell_press(given, square, along, other, distance):
    """Force between two points per length of either yarn (N/m2): by the square, times twice the distance."""
    moved = cell_mean(given, square + 1j * _STEP, along + 0j, other + 0j)
    return -2.0 * distance * moved.imag / _STEP


def cells(at, of_i, of_k, more_i, more_k, curvature):
    """(q, a, b) of cells: the squared distance in the middle, raised by its mean second-order part, and
    its changes over the stretches of both yarns.

    at (4, n): along the bent axis and the other one from k to i, thickness of i, of k; of_i, of_k (3, n): by
    how much the stretch of i, of k changes the first two and its own thickness; more_i, more_k: second
    differences likewise.
    """
    x, y, zi, zk = at
    mi, mk = 1.0 + curvature * zi, 1.0 + curvature * zk
    if curvature == 0.0:
        chord, first, second = x * x, 2.0 * x, 2.0 + 0.0 * x
    else:
        angle = curvature * x
        chord = (2.0 * np.sin(0.5 * angle) / curvature) ** 2
        first, second = 2.0 * np.sin(angle) / curvature, 2.0 * np.cos(angle)

    def by(step, sign, m):
        """Derivative of the square along a step of i (sign 1) or of k (-1)."""
        own = 2.0 * sign * (zi - zk) + curvature * m * chord
        return mi * mk * first * step[0] + 2.0 * y * step[1] + own * step[2]

    def twice(step, m):
        bend = mi * mk * second * step[0] ** 2 + 2.0 * curvature * m * first * step[0] * step[2]
        return bend + 2.0 * step[1] ** 2 + 2.0 * step[2] ** 2

    lift = twice(of_i, mk) + twice(of_k, mi) + by(more_i, 1.0, mk) + by(more_k, -1.0, mi)
    square = y * y + (zi - zk) ** 2 + mi * mk * chord
    return square + lift / 24.0, by(of_i, 1.0, mk), by(of_k, -1.0, mi)

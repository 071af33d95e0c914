"""Slow twin of contact energies averaged over cells: a pair of contact points counts by the mean of the law
over the stretch of either yarn that the points stand for, within which the squared distance is taken as

    q + a x + b y,   x, y in [-1/2, 1/2],   q raised by 1/24 of its second derivatives along both yarns,

a, b and these by the number of the point.
"""

import numpy as np

FINE = 120  # places along either side of a cell


def barrier(square, stiffness, diameter):
    """K (1 - x^2)^2/x^2, x = distance/diameter below 1, by squared distances."""
    s = square / diameter**2
    return np.where(s < 1.0, stiffness * (1.0 - s) ** 2 / s, 0.0)


def cell_means(square, along, other, value):
    """Means of ``value`` of the squared distance over cells, all (n,)."""
    x = (np.arange(FINE) + 0.5) / FINE - 0.5
    means = np.zeros(len(square))
    for i in range(len(square)):
        means[i] = value(square[i] + along[i] * x[:, None] + other[i] * x).mean()
    return means


def expanded(d, e, f, c):
    """q, a, b of cells: d between the points, e and f their steps along either yarn, c the second
    differences of the one less those of the other; all (n, 3)."""

    def dot(u, v):
        return (u * v).sum(-1)

    q = dot(d, d) + (dot(e, e) + dot(f, f) + dot(d, c)) / 12.0
    return q, 2.0 * dot(d, e), -2.0 * dot(d, f)

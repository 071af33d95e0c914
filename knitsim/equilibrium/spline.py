"""Uniform cubic B-splines: basis values, sample tables and fitting.

A centre line is r(u) = sum_i Q_i b(u - i) with control points Q_i and the centred cubic B-spline b.
On the span [i, i + 1] the four control points i - 1 .. i + 2 act; a chain of n spans therefore has
n + 3 control points, numbered from 0, and span i uses the points i .. i + 3 of the chain.
"""

import numpy as np

# Three Gauss points on [0, 1]: exact for polynomials of degree five.
GAUSS_POINTS = 0.5 + np.array([-0.5, 0.0, 0.5]) * np.sqrt(0.6)
GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


def basis(t):
    """Values of the four basis functions at t in [0, 1] of a span; t: (m,); result (m, 4)."""
    t = np.asarray(t, dtype=float)
    s = 1.0 - t
    return np.stack([s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3], axis=-1) / 6.0


def basis_first(t):
    """First derivatives by the parameter, as in :func:`basis`."""
    t = np.asarray(t, dtype=float)
    s = 1.0 - t
    return np.stack([-(s**2), 3 * t**2 - 4 * t, 4 * s - 3 * s**2, t**2], axis=-1) / 2.0


def basis_second(t):
    """Second derivatives by the parameter, as in :func:`basis`."""
    t = np.asarray(t, dtype=float)
    return np.stack([1.0 - t, 3 * t - 2, 1 - 3 * t, t], axis=-1)


def contact_basis(t, spacing):
    """Columns of a contact point (TOUCH_POINT) at t (m,) of a span, with points every ``spacing`` spans."""
    return {
        "basis": basis(t),
        "along": spacing * basis_first(t),
        "turn": spacing**2 * basis_second(t),
    }


def split(u, spans):
    """Span index and place in it of parameters u in [0, spans]; the end belongs to the last span."""
    u = np.asarray(u, dtype=float)
    span = np.clip(np.floor(u).astype(np.int64), 0, spans - 1)
    return span, u - span


def evaluate(control, u):
    """Points of a chain at the parameters u (m,); control: (spans + 3, k); result (m, k)."""
    span, t = split(u, len(control) - 3)
    return np.einsum("ma,mak->mk", basis(t), control[span[:, None] + np.arange(4)])


def interpolate_periodic(points, step):
    """Control points Q_0 .. Q_(n-1) of the periodic spline with r(i) = points[i].

    points: (n, k), one period; the curve advances by ``step`` (k,) in a period, so that
    Q_(i+n) = Q_i + step.  Solved in Fourier space: (Q_(i-1) + 4 Q_i + Q_(i+1))/6 = points[i].
    """
    points = np.asarray(points, dtype=float)
    n = len(points)
    # The part that is linear in i is reproduced exactly, which leaves a circulant system.
    drift = np.arange(n)[:, None] / n * np.asarray(step, dtype=float)
    symbol = (4.0 + 2.0 * np.cos(2.0 * np.pi * np.arange(n) / n)) / 6.0
    periodic = np.fft.ifft(np.fft.fft(points - drift, axis=0) / symbol[:, None], axis=0).real
    return periodic + drift

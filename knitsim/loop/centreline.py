"""The yarn's centre line as one periodic cubic spline, and its arc length."""

import functools
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from knitsim.errors import ComputationError, InputError

# Stretches for which the quadrature is asked to hold: the kinematic model deforms the loop so.
_STRETCHES = np.array([[1.0, 1.0, 1.0], [2.0, 0.5, 1.0], [0.5, 2.0, 1.0]])


@dataclass(frozen=True, eq=False)
class PeriodicSpline:
    """Cubic spline r(u), u = 0..1 over one period, r(u + 1) = r(u) + period, C2 everywhere.

    knots: (k + 1,) from 0 to 1.  coefficients: (k, 4, 3) in m, of the powers 0..3 of u - knots[i].
    period: (3,) in m.  nodes, weights: (q,) Gauss points in u, the same number between any two
    knots, so that the integral of f(u) du is sum(weights f(nodes)).
    """

    knots: np.ndarray
    coefficients: np.ndarray
    period: np.ndarray
    nodes: np.ndarray = field(init=False, repr=False)
    weights: np.ndarray = field(init=False, repr=False)
    length: float = field(init=False)
    _length_at_knots: np.ndarray = field(init=False, repr=False)

    def __post_init__(self):
        order = self._enough_gauss_points()
        nodes, weights = self._gauss(order)
        pieces = (weights * _norm(self.derivative(nodes))).reshape(-1, order).sum(axis=1)
        values = {
            "nodes": nodes, "weights": weights, "length": float(pieces.sum()),
            "_length_at_knots": np.concatenate([[0.0], np.cumsum(pieces)]),
        }  # fmt: skip
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def points(self, u):
        """Points (..., 3) in m at any u (...)."""
        return self.derivative(u, 0)

    def derivative(self, u, order=1):
        """d^order r / du^order, order 0 to 3, shape (..., 3), m."""
        u = np.asarray(u, dtype=float)
        turn = np.floor(u)
        within = u - turn
        piece = np.searchsorted(self.knots, within, side="right") - 1
        piece = np.clip(piece, 0, len(self.knots) - 2)
        x = (within - self.knots[piece])[..., None]
        c = self.coefficients[piece]
        if order == 0:
            value = ((c[..., 3, :] * x + c[..., 2, :]) * x + c[..., 1, :]) * x + c[..., 0, :]
            return value + turn[..., None] * self.period
        if order == 1:
            return (3 * c[..., 3, :] * x + 2 * c[..., 2, :]) * x + c[..., 1, :]
        if order == 2:
            return 6 * c[..., 3, :] * x + 2 * c[..., 2, :]
        return 6 * c[..., 3, :] + 0 * x

    def tangents(self, u):
        """Unit tangents (..., 3) at u (...)."""
        derivative = self.derivative(u)
        return derivative / _norm(derivative)[..., None]

    def curvature(self, u):
        """Curvature (...) in 1/m at u (...)."""
        first, second = self.derivative(u), self.derivative(u, 2)
        return _norm(np.cross(first, second)) / _norm(first) ** 3

    def arc_length(self, u):
        """Arc length (...) in m from u = 0 to u (...), 0 <= u <= 1."""
        u = np.asarray(u, dtype=float)
        piece = np.clip(np.searchsorted(self.knots, u, side="right") - 1, 0, len(self.knots) - 2)
        return self._length_at_knots[piece] + self._partial(piece, u)

    def at_arc_length(self, arc):
        """u (...) at arc length (...) in m, 0 <= arc <= length; to rounding error."""
        arc = np.asarray(arc, dtype=float)
        if np.any(arc < 0) or np.any(arc > self.length * (1 + 1e-12)):
            raise ValueError("arc length outside one period")
        piece = np.searchsorted(self._length_at_knots, arc, side="right") - 1
        piece = np.clip(piece, 0, len(self.knots) - 2)
        start, end = self._length_at_knots[piece], self._length_at_knots[piece + 1]
        low, high = self.knots[piece], self.knots[piece + 1]
        u = low + (high - low) * (arc - start) / (end - start)
        for _ in range(50):
            miss = start + self._partial(piece, u) - arc
            # Newton's step, kept between the knots; the speed never vanishes.
            u = np.clip(u - miss / _norm(self.derivative(u)), low, high)
            if np.all(np.abs(miss) <= 4e-15 * self.length):
                return u
        raise ComputationError("arc length of the centre line: Newton did not converge")

    def stretched(self, factors):
        """This spline with course, wale and thickness coordinates times ``factors`` (3,) > 0."""
        factors = np.asarray(factors, dtype=float)
        return PeriodicSpline(self.knots, self.coefficients * factors, self.period * factors)

    def sections(self, count):
        """u (count,) and arc length (count + 1,), m, of sections at equal arc length from u = 0.

        The last arc length, the loop's, is where the first section's image in the next loop lies.
        """
        arc = self.length * np.arange(count + 1) / count
        return self.at_arc_length(arc[:-1]), arc

    def _gauss(self, order):
        x, w = _gauss_legendre(order)
        half = 0.5 * np.diff(self.knots)[:, None]
        middle = 0.5 * (self.knots[1:] + self.knots[:-1])[:, None]
        return (middle + half * x).ravel(), (half * w).ravel()

    def _enough_gauss_points(self):
        """Gauss points between knots for a length exact to 1e-10, stretched as in _STRETCHES."""
        before = np.full(len(_STRETCHES), np.inf)
        for order in (3, 4, 6, 8, 12, 16, 24, 32, 48, 64):
            nodes, weights = self._gauss(order)
            stretched = self.derivative(nodes) * _STRETCHES[:, None, :]
            lengths = _norm(stretched) @ weights
            settled = np.abs(lengths - before) <= 1e-10 * lengths
            if settled.all():
                return order
            before = lengths
        if settled[0]:
            return order
        raise ComputationError(
            "centre line: its arc length does not converge; it stands still or has a cusp"
        )

    def _partial(self, piece, u):
        """Arc length (...) from the knot that starts ``piece`` to u."""
        order = len(self.nodes) // (len(self.knots) - 1)
        x, w = _gauss_legendre(order)
        half = 0.5 * (u - self.knots[piece])[..., None]
        nodes = self.knots[piece][..., None] + half * (1 + x)
        # Straight from the coefficients: at a knot the piece must not change to the next.
        c = self.coefficients[piece][..., None, :, :]
        t = (nodes - self.knots[piece][..., None])[..., None]
        speed = _norm((3 * c[..., 3, :] * t + 2 * c[..., 2, :]) * t + c[..., 1, :])
        return (half * w * speed).sum(axis=-1)


def periodic_spline(anchors):
    """The periodic cubic spline through anchors (k + 1, 3), m, with chord-length parameter.

    The last anchor is the first moved by one period.  Raises InputError if there are fewer than
    three spans, a coordinate is not finite or two successive anchors coincide.
    """
    anchors = np.array(anchors, dtype=float)
    if anchors.ndim != 2 or anchors.shape[1] != 3 or len(anchors) < 4:
        raise InputError(
            "centre line",
            f"anchors of shape {anchors.shape}",
            "must be four or more points in space, the last closing the period",
        )
    if not np.isfinite(anchors).all():
        raise InputError("centre line", "nan or inf", "every anchor must be finite")
    chords = _norm(np.diff(anchors, axis=0))
    if chords.min() <= 1e-12 * chords.sum():
        where = int(np.argmin(chords))
        raise InputError(
            "centre line", f"anchors {where} and {where + 1}", "must not be the same point"
        )
    knots = np.concatenate([[0.0], np.cumsum(chords)])
    knots /= knots[-1]
    knots[-1] = 1.0
    period = anchors[-1] - anchors[0]
    # What is left after the steady advance by the period closes on itself.
    closed = anchors - knots[:, None] * period
    closed[-1] = closed[0]
    spline = CubicSpline(knots, closed, bc_type="periodic")
    coefficients = np.ascontiguousarray(spline.c[::-1].transpose(1, 0, 2))
    coefficients[:, 0] += knots[:-1, None] * period
    coefficients[:, 1] += period
    return PeriodicSpline(knots, coefficients, period)


@functools.cache
def _gauss_legendre(order):
    return np.polynomial.legendre.leggauss(order)


def _norm(vectors):
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))

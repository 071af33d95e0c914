"""A curve read between its points, by one of the rules of :mod:`knitsim.kes.single_pass`."""

import itertools
import math

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq

RULES = ("auto", "linear", "pchip", "spline", "power")
_FEWEST = 7  # points for a choice of rule
_AS_GOOD = 2.0  # factor within which the more robust rule is taken
_ROUNDING = 1e-13  # of the largest value
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)

NEEDS = {
    "linear": "",
    "pchip": "must be linear for points of equal abscissa",
    "spline": "needs 4 points, none of equal abscissa",
    "power": "needs 4 points, the first at 0, all others above 0, and a curve that rises from it",
}


def every_other(size, first):
    kept = np.zeros(size, dtype=bool)
    kept[first::2] = True
    kept[[0, -1]] = True
    return np.flatnonzero(kept)


def choose_rule(x, y):
    if (np.diff(x) == 0).any():
        return "linear"
    if x.size < _FEWEST:
        return "pchip"
    errors = {}
    for rule in RULES[1:]:
        # Half of the points may fit a rule that all of them do not.
        if interpolant(rule, x, y) is None:
            continue
        squares = []
        for first in (0, 1):
            kept = every_other(x.size, first)
            read = interpolant(rule, x[kept], y[kept])
            if read is None:
                break
            left = np.setdiff1d(np.arange(x.size), kept)
            squares.append((read.read(x[left]) - y[left]) ** 2)
        else:
            errors[rule] = math.sqrt(np.concatenate(squares).mean())
    # Differences in the rounding decide nothing.
    enough = _AS_GOOD * min(errors.values()) + _ROUNDING * np.abs(y).max()
    return next(rule for rule in RULES if rule in errors and errors[rule] <= enough)


def interpolant(rule, x, y):
    """The curve through the points by one rule, or None where it does not apply."""
    if rule == "linear":
        return Interpolant(x, y, _Linear(x, y))
    if (np.diff(x) == 0).any():
        return None
    if rule == "pchip":
        return Interpolant(x, y, PchipInterpolator(x, y))
    if x.size < 4:
        return None
    if rule == "spline":
        return Interpolant(x, y, CubicSpline(x, y))
    if abs(y[0]) > _ROUNDING * y.max() or not (y[1:] > 0).all():
        return None
    power = _Power(x, y)
    return Interpolant(x, y, power, power.exponent) if power.exponent > 0 else None


class _Linear:
    def __init__(self, x, y):
        self.x, self.y = x, y

    def __call__(self, at):
        left = np.clip(np.searchsorted(self.x, at, side="right") - 1, 0, self.x.size - 2)
        width = self.x[left + 1] - self.x[left]
        # Only at the very end may the interval be a vertical step.
        part = np.where(width > 0, (at - self.x[left]) / np.where(width > 0, width, 1.0), 1.0)
        return self.y[left] + part * (self.y[left + 1] - self.y[left])


class _Power:
    """exp of the spline of ln y over ln(x - x[0]); before the second point the power law that has
    its value and slope there and is 0 at the first."""

    def __init__(self, x, y):
        logs = np.log(x[1:] - x[0])
        self.zero, self.step, self.top = x[0], x[1] - x[0], y[1]
        self.spline = CubicSpline(logs, np.log(y[1:]))
        self.exponent = float(self.spline(logs[0], 1))

    def __call__(self, at):
        part = np.maximum(at - self.zero, 0.0) / self.step
        beyond = np.maximum(part, 1.0)
        later = np.exp(self.spline(np.log(beyond * self.step)))
        return np.where(part < 1.0, self.top * np.minimum(part, 1.0) ** self.exponent, later)


class Interpolant:
    """A curve through points (x ascending); power: exponent before the second point, or None."""

    def __init__(self, x, y, read, power=None):
        self.x, self.y, self.read, self.power = x, y, read, power

    def __call__(self, at):
        return float(self.read(at))

    def integral(self, low, high, about):
        """Integral of y, or of (x - about) y: exact for polynomials up to degree 23 per interval."""
        total, first = 0.0, 0
        if self.power is not None and low < self.x[1]:
            top = min(high, self.x[1])
            total = self._from_zero(top, about) - self._from_zero(low, about)
            low, first = top, 1
        inside = self.x[first:]
        inside = inside[(inside > low) & (inside < high)]
        ends = np.concatenate([[low], inside, [high]])
        half, middle = 0.5 * np.diff(ends), 0.5 * (ends[1:] + ends[:-1])
        at = middle[:, None] + half[:, None] * _NODES
        values = self.read(at) if about is None else self.read(at) * (at - about)
        return float(total + half @ (values @ _WEIGHTS))

    def _from_zero(self, top, about):
        """The integral from the first point over top y1 t^n, t = (x - x0)/(x1 - x0)."""
        step, n = self.x[1] - self.x[0], self.power
        part = (top - self.x[0]) / step
        area = step * self.y[1] * part ** (n + 1.0)
        if about is None:
            return area / (n + 1.0)
        return area * (step * part / (n + 2.0) + (self.x[0] - about) / (n + 1.0))

    def reach(self, level, near):
        above = np.flatnonzero(self.y >= level)
        if above.size:
            i = above[0]
            return float(self.x[0]) if i == 0 else self._root(i - 1, level)
        highest = int(np.argmax(self.y))
        return float(self.x[highest]) if self.y[highest] >= level - near else None

    def last_zero(self):
        below = np.flatnonzero(self.y <= 0.0)
        if not below.size:
            return None
        i = below[-1]
        if self.y[i] == 0.0 or i == self.x.size - 1:
            return float(self.x[i])
        return self._root(i, 0.0)

    def rising_zeros(self):
        found, other = [], np.flatnonzero(self.y != 0.0)
        # Points that are not 0, and ends at 0 as if the curve came from below or went on above.
        sign = {int(i): np.sign(self.y[i]) for i in other}
        if other.size and other[0] > 0:
            sign[-1] = -1.0
        if other.size and other[-1] < self.x.size - 1:
            sign[self.x.size] = 1.0
        order = sorted(sign)
        for i, j in itertools.pairwise(order):
            if sign[i] < 0 < sign[j]:
                zeros = self.x[i + 1 : j]
                found.append(
                    float(zeros[np.argmin(np.abs(zeros))]) if zeros.size else self._root(i, 0.0)
                )
        return found

    def _root(self, i, level):
        """x between points i and i + 1 where y = level; the points lie on both sides of it."""
        low, high = float(self.x[i]), float(self.x[i + 1])
        if low == high:
            return low

        def excess(x):
            # At the points the given values, so that rounding cannot take the change of sign.
            y = self.y[i] if x == low else self.y[i + 1] if x == high else self(x)
            return y - level

        eps = np.finfo(float).eps
        return float(brentq(excess, low, high, xtol=eps * max(abs(low), abs(high)), rtol=4 * eps))

"""One pass of a test: a curve along which strain, curvature or angle goes one way only.

A pass is read between its points, never beyond them.  How it is read (its rule):

- ``linear``: straight lines; a vertical step (equal abscissae) is kept.
- ``pchip``: piecewise cubic, monotone between monotone points (Fritsch and Butland).
- ``spline``: cubic, twice differentiable, not-a-knot; exact for cubics.
- ``power``: that spline through the logarithms, for curves that leave zero as a power: exact for
  a x^n with any n > 0, whose derivatives are singular at 0.
- ``auto``: every second point is left out and predicted from the rest; the rule of the smallest
  rms error is taken, a rule higher in this list wherever it comes within a factor of 2.  Smooth
  curves so get a spline, noise and kinks straight lines.  Below 7 points: ``pchip``.

Errors are those of reading between the points, not of the points: the larger of the changes when the
even or the odd points are left out, for a smooth curve as a rule several times the true error.  NaN:
too few points for an estimate.
"""

import math

import numpy as np
from scipy.integrate import quad

from knitsim.errors import ComputationError, InputError, number
from knitsim.kes.read import (
    NEEDS,
    RULES,
    Interpolant,
    choose_rule,
    every_other,
    interpolant,
)
from knitsim.measured.course import TURN, turns

ROUNDING = 1e-9  # relative; an end this close counts as reached
_BRACKETS = 2001  # points at which a function is searched for a crossing


class Pass:
    """One pass through points, in the order of the test; shape (n,), n >= 2, SI.

    x: strain, curvature or angle; it may stay equal but not turn.  y: force or moment per width.
    names: of the two, source: of the file or test, for messages.  Points that repeat the one before
    are dropped.  Attributes: ``low``, ``high``, ``rising``, ``start``, ``rule`` (the one taken),
    ``x`` and ``y`` (ascending).  Raises InputError for values that are not finite, an x that turns
    or does not change, and for a rule that cannot be had.
    """

    def __init__(self, x, y, *, names=("x", "y"), source="", rule="auto"):
        x, y = checked(x, y, names, source)
        if rule not in RULES:
            raise InputError("rule", rule, f"must be one of {', '.join(RULES)}")
        self.rising = bool(x[-1] > x[0])
        self.start = float(x[0])
        refuse_turns(x, np.arange(x.size), self.rising, names, source)
        if x[-1] == x[0]:
            raise InputError(place(source, names[0]), f"{x[0]:.9g}", "must change within a pass")
        if not self.rising:
            x, y = x[::-1], y[::-1]
        new = np.concatenate([[True], (np.diff(x) != 0) | (np.diff(y) != 0)])
        self.x, self.y = x[new], y[new]
        self.low, self.high = float(self.x[0]), float(self.x[-1])
        self.rule = choose_rule(self.x, self.y) if rule == "auto" else rule
        self._full = interpolant(self.rule, self.x, self.y)
        if self._full is None:
            raise InputError(place(source, "rule"), rule, NEEDS[rule])
        halves = [every_other(self.x.size, first) for first in (0, 1)]
        self._halves = [
            interpolant(self.rule, self.x[kept], self.y[kept])
            for kept in halves
            if kept.size < self.x.size
        ]

    def __str__(self):
        return f"{len(self.x)} points, rule {self.rule}"

    def covers(self, low, high):
        """Whether the pass reaches over [low, high], but for rounding."""
        near = ROUNDING * max(abs(self.low), abs(self.high))
        return self.low - near <= low and high <= self.high + near

    def value(self, at):
        """(y, error) at x = ``at``; in a vertical step the mean of its ends."""
        at = min(max(at, self.low), self.high)
        there = self.y[self.x == at]
        found = 0.5 * (there[0] + there[-1]) if there.size else self._full(at)
        return float(found), self._change(found, lambda half: half(at))

    def integral(self, low, high):
        """(integral of y over x from low to high, error)."""
        return self._integral(low, high, None)

    def first_moment(self, low, high):
        """(integral of (x - (low + high)/2) y over x from low to high, error)."""
        return self._integral(low, high, 0.5 * (low + high))

    def _integral(self, low, high, about):
        low, high = (min(max(end, self.low), self.high) for end in (low, high))
        found = self._full.integral(low, high, about)
        return found, self._change(found, lambda half: half.integral(low, high, about))

    def reach(self, level, near=0.0):
        """(x, error) where y, for x rising, first reaches ``level`` to within ``near``; else None."""
        found = self._full.reach(level, near)
        if found is None:
            return None
        return found, self._change(found, lambda half: half.reach(level, near))

    def last_zero(self):
        """(x, error) of the last point, for x rising, where y is not above 0; None if all are."""
        found = self._full.last_zero()
        if found is None:
            return None
        return found, self._change(found, lambda half: half.last_zero())

    def rising_zeros(self):
        """All x where y passes from below to above 0 as x rises, with their errors: a list.

        Where y is 0 at several points on end, that nearest to x = 0.
        """
        found = self._full.rising_zeros()
        # Without some of the points there may be another number of zeros: nothing to compare with.
        halves = [half and half.rising_zeros() for half in self._halves]
        halves = [zeros if zeros and len(zeros) == len(found) else None for zeros in halves]
        return [(x, self._most([z and z[k] for z in halves], x)) for k, x in enumerate(found)]

    def _change(self, found, reading):
        return self._most([half and reading(half) for half in self._halves], found)

    @staticmethod
    def _most(others, found):
        if not others or any(other is None for other in others):
            return math.nan
        return max(abs(float(other) - float(found)) for other in others)


class FunctionPass(Pass):
    """A pass given as a function y(x) of one number, from ``start`` to ``end`` (SI).

    Integrals are adaptive (QUADPACK), with its error estimate; crossings are looked for at 2001
    equal steps.  Raises InputError where the function is not finite at one of them.
    """

    def __init__(self, function, start, end, *, names=("x", "y"), source=""):
        self.start, end = number("start", start), number("end", end)
        if self.start == end:
            raise InputError("end", end, "must differ from the start")
        self.rising, self.rule = end > self.start, "function"
        self.low, self.high = min(self.start, end), max(self.start, end)
        self.x = np.linspace(self.low, self.high, _BRACKETS)
        self.y = np.array([float(function(float(x))) for x in self.x])
        checked(self.x, self.y, names, source)
        self._function = function
        self._full, self._halves = Interpolant(self.x, self.y, self._read), []

    def __str__(self):
        return "a function"

    def _read(self, x):
        values = [float(self._function(float(one))) for one in np.ravel(x)]
        return np.reshape(values, np.shape(x))

    def value(self, at):
        """(y, 0.0) at x = ``at``."""
        return float(self._function(min(max(at, self.low), self.high))), 0.0

    def _integral(self, low, high, about):
        low, high = (min(max(end, self.low), self.high) for end in (low, high))

        def integrand(x):
            return float(self._function(x)) * (1.0 if about is None else x - about)

        found, error, *rest = quad(
            integrand, low, high, epsabs=0.0, epsrel=1e-12, limit=500, full_output=1
        )
        size = (high - low) * np.abs(self.y).max() * (1.0 if about is None else high - low)
        if len(rest) > 1 and error > 1e-6 * size:
            raise ComputationError(
                f"integral from {low:.6g} to {high:.6g}: {rest[1].split('.')[0]}"
            )
        return found, error

    @staticmethod
    def _most(others, found):
        return 4.0 * np.finfo(float).eps * abs(float(found))  # that of the root finding


def place(source, name):
    """Where a message points: the source, if it has a name, and the quantity."""
    return f"{source}: {name}" if source else name


def checked(x, y, names, source):
    """x and y as float arrays (n,); raises InputError unless they are that, of finite numbers."""
    arrays = []
    for name, values in zip(names, (x, y), strict=True):
        try:
            values = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            raise InputError(place(source, name), repr(values)[:60], "must be numbers") from None
        if values.ndim != 1 or values.size < 2:
            raise InputError(
                place(source, name), values.shape, "must be a row of 2 or more numbers"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputError(place(source, f"{name}[{bad[0]}]"), values[bad[0]], "must be finite")
        arrays.append(values)
    if arrays[0].size != arrays[1].size:
        right = f"must have as many points as {names[0]}, {arrays[0].size}"
        raise InputError(place(source, names[1]), f"{arrays[1].size} points", right)
    return arrays


def refuse_turns(x, index, rising, names, source):
    """InputError for the first point at which x goes back; index: of the points in the test."""
    back = np.flatnonzero(np.diff(x) < 0 if rising else np.diff(x) > 0)
    if back.size:
        i = back[0]
        way = "fall below" if rising else "rise above"
        raise InputError(
            place(source, f"{names[0]}[{index[i + 1]}]"),
            f"{x[i + 1]:.9g}",
            f"must not {way} the value before it, {x[i]:.9g}, in a"
            f" {'rising' if rising else 'falling'} pass (a test turns where it goes back by"
            f" {TURN:.0%} of its range or more)",
        )


def runs_of(x, index, names, source):
    """Index arrays of the passes that the points ``index`` of a test make, in its order, checked.

    x: (n,), as :func:`checked` gives it.  Runs of one point, as where a test starts anew, are left
    out.  Raises InputError where x turns within a pass or never changes.
    """
    first, runs = 0, []
    for end in turns(x[index]):
        run = index[first : end + 1]
        first = end + 1
        if run.size > 1:
            refuse_turns(x[run], run, bool(x[run[-1]] > x[run[0]]), names, source)
            if x[run[-1]] != x[run[0]]:
                runs.append(run)
    if not runs:
        raise InputError(place(source, names[0]), f"{x[index[0]]:.9g}", "must change in a test")
    return runs


def in_cycle(cycle, wanted, size, source):
    """Indices of the points of one cycle; all of them if cycle is None."""
    if cycle is None:
        return np.arange(size)
    cycle = np.asarray(cycle)
    if cycle.shape != (size,):
        raise InputError(place(source, "cycle"), cycle.shape, f"must have shape ({size},)")
    index = np.flatnonzero(cycle == wanted)
    if not index.size:
        known = ", ".join(str(one) for one in np.unique(cycle))
        raise InputError(place(source, "number"), wanted, f"must be a cycle of the test: {known}")
    return index


def passes(x, y, *, names=("x", "y"), source="", rule="auto", cycle=None, number=1):
    """The passes of a whole test, split where x turns: a list of :class:`Pass` in its order.

    x, y: (n,), SI.  A pass ends at its extreme; the next begins with the point after it.  cycle:
    (n,) with the number of the cycle of each point; then only the cycle ``number`` is split.
    Raises InputError, as :class:`Pass` does.
    """
    x, y = checked(x, y, names, source)
    index = in_cycle(cycle, number, x.size, source)
    return [
        Pass(x[run], y[run], names=names, source=source, rule=rule)
        for run in runs_of(x, index, names, source)
    ]

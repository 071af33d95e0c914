"""A measured bending test as a fit sees it, and the same points from the model.

With friction the moment depends on the way to a curvature.  The model therefore goes through the
curvatures in the order of the measurement, and of both the mean over the ways (rising and falling
curvature) is compared at the same curvatures, found by the same function.
"""

from dataclasses import dataclass, field

import numpy as np

from knitsim.equilibrium.bend import bend
from knitsim.errors import ComputationError, InputError
from knitsim.measured.course import turns
from knitsim.measured.test import MeasuredTest

COMPARED = 16  # curvatures at which model and measurement are compared, the flat fabric left out
PASS_POINTS = 17  # at most, of one pass of the test, which the model goes through


@dataclass(frozen=True, eq=False)
class BendingPoints:
    """What a fit compares of a measured bending test, a knitsim.measured.test.MeasuredTest.

    curvature, moment_per_width (n,): of the test, from any zero, which curl makes uncertain, thinned to
    at most 17 points a pass.  at (points,): curvatures compared, without 0; change (points,): moment per
    width there, mean of both ways, counted from that at curvature 0.  The model goes round before as
    often as the fabric did.  Raises InputError for a curvature or moment that does not change.
    """

    test: MeasuredTest
    curvature: np.ndarray = field(init=False)
    moment_per_width: np.ndarray = field(init=False)
    at: np.ndarray = field(init=False)
    change: np.ndarray = field(init=False)

    def __post_init__(self):
        curvature, moment, name = self.test.x, self.test.y, self.test.name
        if curvature.min() == curvature.max():
            raise InputError(f"{name}: curvature", float(curvature[0]), "must change")
        if not moment.any():
            raise InputError(f"{name}: moment per width", 0.0, "must not be zero throughout")
        own = passed_points(curvature)
        curvature, moment = curvature[own], moment[own]
        ends = [
            (min(curvature[run].min() for run in way), max(curvature[run].max() for run in way))
            for way in ways_of(curvature)
        ]
        at = np.linspace(max(low for low, _ in ends), min(high for _, high in ends), COMPARED + 1)
        at = at[np.abs(at) > 1e-9 * np.abs(at).max()]
        for field_, value in (("curvature", curvature), ("moment_per_width", moment), ("at", at)):
            object.__setattr__(self, field_, value)
        object.__setattr__(self, "change", self.compared(moment))

    def compared(self, moment):
        """Change of moment (N, (points,)) of moments (n,) along ``curvature``, measured or not."""
        mean = self.mean(moment, np.append(self.at, 0.0))
        return mean[:-1] - mean[-1]

    def mean(self, values, at):
        """Mean over both ways of values (n,) along ``curvature``, at curvatures ``at``."""
        read = read_by_way(self.curvature, values, at)
        there = np.isfinite(read)
        total = np.where(there, read, 0.0).sum(axis=0)
        return np.divide(
            total, there.sum(axis=0), out=np.full(len(at), np.nan), where=there.any(axis=0)
        )

    def follow(self, relaxed, **options):
        """(BendingCurve, its states that belong to ``curvature``) of a fabric at rest.

        options: of knitsim.equilibrium.bend.bend.  Raises ComputationError where it ends early.
        """
        n, direction = len(self.curvature), self.test.direction
        curve = bend(relaxed, direction, np.tile(self.curvature, self.test.cycle), **options)
        if curve.stop_reason:
            raise ComputationError(f"{direction} bending: {curve.stop_reason}")
        return curve, slice(-n, None)


def bending_points(points, relaxed):
    """Change of moment (N) of the model at the compared curvatures of a BendingPoints, (points,)."""
    curve, own = points.follow(relaxed)
    return points.compared(curve.moment_per_width[own])


def passed_points(curvature):
    """Numbers of the points that make each pass of a test go one way only, PASS_POINTS at most.

    The points at which the test turns are kept.
    """
    found, first = [0], 0
    for end in turns(curvature):
        run = np.arange(first, end + 1)
        along = np.sign(curvature[end] - curvature[first]) * curvature[run]
        # What noise moves back is left out.
        run = run[1:][along[1:] > np.maximum.accumulate(along)[:-1]]
        if len(run) >= PASS_POINTS:
            wanted = np.linspace(curvature[first], curvature[run[-1]], PASS_POINTS)[1:, None]
            run = run[np.unique(np.abs(curvature[run] - wanted).argmin(axis=1))]
        found.extend(run)
        first = end
    return np.array(found)


def ways_of(curvature):
    """The passes (numbers of points, by rising curvature) of each way that a test goes."""
    rising, falling, first = [], [], 0
    for end in turns(curvature):
        # A point at which the test turns belongs to both ways.
        run = np.arange(first, end + 1)
        if curvature[end] > curvature[first]:
            rising.append(run)
        elif curvature[end] < curvature[first]:
            falling.append(run[::-1])
        first = end
    return [way for way in (rising, falling) if way]


def read_by_way(curvature, values, at):
    """Values (n,) along a test, read at curvatures ``at`` on each way that it goes: (ways, at).

    Of several passes of one way the mean; NaN where none comes by.
    """
    least, most = curvature.min(), curvature.max()
    at, found = np.clip(at, least, most), []
    near = 1e-9 * (most - least)
    for way in ways_of(curvature):
        total, count = np.zeros(len(at)), np.zeros(len(at))
        for run in way:
            x = curvature[run]
            there = (x[0] - near <= at) & (at <= x[-1] + near)
            total[there] += np.interp(at[there], x, values[run])
            count += there
        found.append(np.divide(total, count, out=np.full(len(at), np.nan), where=count > 0))
    return np.array(found)

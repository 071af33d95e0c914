"""Inputs of a fabric found from its measured curves: robust nonlinear least squares.

At most three inputs are free between bounds.  The residual is the strain at the measured force, or
the force at the measured strain; of all points the squares are summed, points far out counting less.
A fabric that has no equilibrium, or does not reach the measured points, turns a trial down and is
noted; the fit goes on.
"""

import itertools
import math
import time
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.errors import ComputationError, InputError
from knitsim.inference.bending_points import BendingPoints
from knitsim.inference.continuation import check_input, value_of, varied
from knitsim.inference.statistics import (
    Spread,
    robust_scale,
    soft,
    soft_loss,
    spread,
    warnings_of,
)
from knitsim.inference.trials import STATES, Trials
from knitsim.measured.test import MeasuredTest
from knitsim.study.measured_keys import MOST_FREE

KINDS = ("strain", "force")
MISFITS = ("relative", "absolute", "band")
PENALTY = 1e3  # residual of a trial that failed: far beyond any that succeeds
MOST_TRIALS = 60
TOLERANCES = {"ftol": 1e-6, "xtol": 1e-6, "gtol": 1e-7}
PROFILE_AT = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)  # standard errors
PROFILE_STEPS, PROFILE_GAIN = 3, 0.01  # steps at most, and while the misfit falls by as much
ROUNDS, STILL = 4, 0.9  # of a robust fit at most, and while the scale of its residuals falls so far
ON_BOUND, SAME = 1e-4, 1e-3  # of the range; of the sum of squares


@dataclass(frozen=True)
class Parameter:
    """A free input: its name in :data:`knitsim.inference.continuation.INPUTS`, its bounds (SI)
    and where the search starts (the fabric's own value without it)."""

    name: str
    low: float
    high: float
    start: float | None = None


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be fitted.

    fabric: with all other inputs; parameters: one to three :class:`Parameter`; curves: measured
    tests (MeasuredTest) of tension, of which those points count that say something, and of bending;
    kind: "strain" at given force or "force" at given strain (bending: always the moment); misfit:
    "relative" to the measured value (no less than 5 % of the largest), "absolute" (over the largest of
    the curve) or "band" (over half the measured band, no less than a tenth of its middle width);
    resolution, states: of the solver, states up to the largest measured strain.
    """

    fabric: Fabric
    parameters: tuple
    curves: tuple
    kind: str = "strain"
    misfit: str = "relative"
    resolution: Resolution | None = None
    states: int = STATES

    def __post_init__(self):
        parameters, curves = tuple(self.parameters), tuple(self.curves)
        if not curves or not all(isinstance(c, MeasuredTest) for c in curves):
            raise InputError("curves", len(curves), "must be one or more measured tests")
        for c in curves:
            if not c.direction:
                raise InputError(f"{c.name}: direction", None, "is missing; must be course or wale")
        curves = tuple(c.to_fit() if c.kind == "tension" else c for c in curves)
        object.__setattr__(self, "parameters", parameters)
        object.__setattr__(self, "curves", curves)
        names = [p.name for p in parameters]
        if not 1 <= len(names) <= MOST_FREE or len(set(names)) < len(names):
            raise InputError("free parameters", names, f"must be 1 to {MOST_FREE}, each once")
        for p in parameters:
            check_input(p.name, self.fabric)
            if not (math.isfinite(p.low) and math.isfinite(p.high) and p.low < p.high):
                raise InputError(f"{p.name}: bounds", [p.low, p.high], "must be finite and rising")
            start = self._start(p)
            if not p.low <= start <= p.high:
                raise InputError(
                    f"{p.name}: start",
                    start,
                    f"must lie within its bounds, {p.low:g} to {p.high:g}",
                )
        if len({c.name for c in curves}) < len(curves):
            raise InputError("curves", [c.name for c in curves], "must have different names")
        if self.kind not in KINDS:
            raise InputError("residual", self.kind, f"must be {' or '.join(KINDS)}")
        if self.misfit not in MISFITS:
            raise InputError("misfit", self.misfit, f"must be one of {', '.join(MISFITS)}")
        banded = self.kind == "strain" and all(
            c.kind == "tension" and c.band is not None for c in curves
        )
        if self.misfit == "band" and not banded:
            raise InputError(
                "misfit", "band", "needs strain at given force, and bands of all curves"
            )
        size = sum(
            int((c.weight > 0).sum()) if c.kind == "tension" else len(BendingPoints(c).at)
            for c in curves
        )
        if size <= len(names):
            raise InputError(
                "measured points", size, f"must be more than the {len(names)} free parameters"
            )

    def _start(self, parameter):
        if parameter.start is None:
            return value_of(self.fabric, parameter.name)
        return float(parameter.start)

    @property
    def names(self):
        return tuple(p.name for p in self.parameters)

    @property
    def bounds(self):
        """(parameters, 2), SI."""
        return np.array([[p.low, p.high] for p in self.parameters], dtype=float)

    @property
    def start(self):
        """(parameters,), SI."""
        return np.array([self._start(p) for p in self.parameters])


@dataclass(frozen=True, eq=False)
class Profile:
    """Misfit along one parameter, the others fitted again; values (n,) SI rising, misfit (n,) rms
    (NaN where no fabric was found)."""

    name: str
    values: np.ndarray
    misfit: np.ndarray


@dataclass(frozen=True, eq=False)
class Calibration:
    """A fit: what was found and how far to trust it.

    fabric: with the fitted inputs; names, values, low, high (parameters,): fitted inputs and their
    95 % intervals, each by itself, cut at the bounds; spread: covariance and correlation; misfit:
    rms of the residuals, weighted; curves: :class:`Fitted`; profiles: :class:`Profile`; warnings,
    notes: sentences (what the data cannot tell; trials that failed); evaluations: tests solved;
    cpu_seconds: time of this fit; converged: whether the search ended by itself.
    """

    problem: Problem
    fabric: Fabric
    names: tuple
    values: np.ndarray
    low: np.ndarray
    high: np.ndarray
    spread: Spread
    misfit: float
    curves: tuple
    profiles: tuple
    warnings: tuple
    notes: tuple
    evaluations: int
    cpu_seconds: float
    converged: bool
    resolution: Resolution


def fit(problem, *, profile=True):
    """Fit a :class:`Problem`; a :class:`Calibration`.

    profile: also follow the misfit along each parameter, to three standard errors on both sides.
    Raises ComputationError where neither the start nor any other point tried within the bounds has
    an equilibrium that reaches the measured points.
    """
    begun = time.process_time()
    trial = Trials(problem)
    low, high = problem.bounds.T
    unit = high - low

    def residual(u):
        found = trial.residual(low + u * unit)
        return np.full(trial.points, PENALTY) if found is None else found

    def jacobian(u):
        return trial.jacobian(low + u * unit) * unit

    start = _workable_start(problem, trial)
    u = (start - low) / unit
    found = least_squares(
        residual, u, jacobian, bounds=(0.0, 1.0), max_nfev=MOST_TRIALS, **TOLERANCES
    )
    root, size = np.concatenate(trial.root), np.inf
    there = root > 0
    for _ in range(ROUNDS):
        seen = robust_scale(found.fun[there] / root[there], len(u))
        if not seen < STILL * size:
            break
        # Points far from the rest are there, to which the fit before has given way: once more, with less
        # weight on them, however much of the curve they stand for.
        size = seen
        found = least_squares(
            residual, np.clip(found.x, 0.0, 1.0), jacobian, bounds=(0.0, 1.0),
            loss=soft_loss(size * np.where(there, root, 1.0)), max_nfev=MOST_TRIALS, **TOLERANCES,
        )  # fmt: skip
    scale = size * np.where(there, root, 1.0)
    values, r = _on_bounds(problem, trial, low + found.x * unit)
    slopes = trial.jacobian(values, central=True)
    spread_ = spread(values, r, slopes, scale, trial.groups, np.concatenate(trial.weight))
    interval = np.clip(spread_.interval, low[:, None], high[:, None])
    names, bounds = problem.names, problem.bounds
    warnings = list(warnings_of(names, values, bounds, spread_))
    if found.status == 0:
        warnings.append(f"the search was stopped after {MOST_TRIALS} trials")
    curves = trial.fitted(values)
    profiles = tuple(
        _profile(trial, i, values, spread_.standard_error[i], slopes, scale)
        for i in range(len(names) if profile else 0)
    )
    return Calibration(
        problem,
        varied(problem.fabric, dict(zip(names, values, strict=True))),
        names,
        values,
        interval[:, 0],
        interval[:, 1],
        spread_,
        trial.misfit(r),
        curves,
        profiles,
        tuple(warnings),
        tuple(trial.notes),
        trial.evaluations,
        time.process_time() - begun,
        found.status > 0,
        trial.resolution,
    )


def _workable_start(problem, trial):
    """The start, or the nearest of some points within the bounds where the model has an answer."""
    low, high = problem.bounds.T
    if trial.residual(problem.start) is not None:
        return problem.start
    grid = [
        low + np.array(u) * (high - low)
        for u in itertools.product((0.2, 0.5, 0.8), repeat=len(low))
    ]
    grid.sort(key=lambda v: float((((v - problem.start) / (high - low)) ** 2).sum()))
    for values in grid:
        if trial.residual(values) is not None:
            return values
    raise ComputationError(f"calibration: no start within the bounds: {trial.notes[0]}")


def _on_bounds(problem, trial, values):
    """Values and residuals, with values that all but sit on a bound put onto it: the search itself
    stays inside, and no friction is another fabric than next to none."""
    r = trial.residual(values)
    low, high = problem.bounds.T
    near = ON_BOUND * (high - low)
    snapped = np.where(values - low <= near, low, np.where(high - values <= near, high, values))
    if (snapped == values).all():
        return values, r
    other = trial.residual(snapped)
    if other is None or other @ other > (1.0 + SAME) * (r @ r):
        trial.residual(values)
        return values, r
    return snapped, other


def _profile(trial, i, values, error, slopes, scale):
    """The :class:`Profile` of parameter i: the others follow by Gauss-Newton with the slopes of the
    fit, which near it are nearly right; the best of a few steps counts."""
    low, high = trial.problem.bounds.T
    unit = high - low
    if not np.isfinite(error) or error > unit[i]:
        error = unit[i] / 6.0
    asked = np.unique(np.clip(values[i] + np.array(PROFILE_AT) * error, low[i], high[i]))
    others = [k for k in range(len(values)) if k != i]
    own = trial.misfit(trial.residual(values))
    rows = [(values[i], own)]
    for side in (asked[asked < values[i]][::-1], asked[asked > values[i]]):
        here = values.copy()
        for value in side:
            best, found = np.inf, None
            for tried in _starts_along(slopes, here, i, value, others):
                if trial.residual(np.clip(tried, low, high)) is not None:
                    break
            for _ in range(PROFILE_STEPS):
                tried = np.clip(tried, low, high)
                r = trial.residual(tried)
                if r is None or trial.misfit(r) >= best:
                    break
                gained = 1.0 - trial.misfit(r) / best
                best, found = trial.misfit(r), tried.copy()
                if not others or gained < PROFILE_GAIN:
                    break
                w = np.sqrt(soft(r, scale))[:, None]
                tried = tried.copy()
                tried[others] -= np.linalg.lstsq(w * slopes[:, others], w[:, 0] * r, rcond=None)[0]
            rows.append((value, best if np.isfinite(best) else np.nan))
            here = here if found is None else found
    rows.sort()
    at, misfit = np.array(rows).T
    return Profile(trial.names[i], at, misfit)


def _starts_along(slopes, here, i, value, others):
    """Values with parameter i moved to ``value``: the others where the linear model has its minimum,
    half way there, and unmoved."""
    back = np.zeros(len(others))
    if others:
        back = np.linalg.lstsq(slopes[:, others], slopes[:, i], rcond=None)[0] * (value - here[i])
    for part in (1.0, 0.5, 0.0) if others else (0.0,):
        tried = here.copy()
        tried[i] = value
        tried[others] -= part * back
        yield tried

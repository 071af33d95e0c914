"""Run time against error: settings of a solver, each timed and compared with a converged reference.

A :class:`Task` is one test by one solver; its settings are tried in turn.  Times are process CPU
time, medians of repeated runs, kernels compiled.  A setting is on the front if no other is both
faster and more exact.
"""

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from knitsim.errors import ComputationError, InputError

TARGETS = (0.1, 0.01, 1e-3, 1e-4)  # errors that a user may ask for
NOISE = 0.2  # of a run time: by less a setting is not called faster


@dataclass(frozen=True)
class Setting:
    """One way to solve a task.

    name: the settings in words, the same words for the same setting in every task; run: function
    without arguments that returns the answer; default: whether this is what a user gets who asks
    for nothing; prepare: called once before, not timed.
    """

    name: str
    run: Callable
    default: bool = False
    prepare: Callable | None = None


@dataclass(frozen=True)
class Task:
    """One test by one solver, its answer compared with that of ``reference()``.

    quantities: what of the answer is compared; errors: function of an answer and the reference that
    returns one relative error for each.  check: function that returns the answer of a reference
    about half as fine; how far it is from the reference bounds the reference's own error.
    """

    solver: str
    test: str
    quantities: tuple
    settings: tuple
    reference: Callable
    check: Callable
    errors: Callable


@dataclass(frozen=True)
class Measured:
    """A setting tried: seconds (median CPU time of ``repeats`` runs, NaN where it failed), errors
    (one a quantity, NaN where the test was not solved to its end) and why not (``reason``)."""

    setting: Setting
    seconds: float
    repeats: int
    errors: tuple
    reason: str = ""


@dataclass(frozen=True)
class Outcome:
    """A task done: its settings as measured, and the bound of the reference's error by quantity."""

    task: Task
    measured: tuple
    reference_errors: tuple


def cpu_time(call, repeats=3, budget=math.inf):
    """(result, median seconds of process CPU time, number of runs) of ``call()``.

    budget: seconds after which no further run is begun.
    """
    seconds = []
    while (len(seconds) < repeats and sum(seconds) < budget) or not seconds:
        begin = time.process_time()
        result = call()
        seconds.append(time.process_time() - begin)
    return result, statistics.median(seconds), len(seconds)


def measure(task, repeats=3, budget=math.inf):
    """The :class:`Outcome` of a Task; every setting runs ``repeats`` times or for ``budget`` s.

    A setting that is refused or fails is kept with its reason; a reference that fails raises.
    """
    reference = task.reference()
    measured = []
    for setting in task.settings:
        try:
            if setting.prepare is not None:
                setting.prepare()
            answer, seconds, runs = cpu_time(setting.run, repeats, budget)
        except (InputError, ComputationError) as error:
            missing = (math.nan,) * len(task.quantities)
            measured.append(Measured(setting, math.nan, 0, missing, str(error)))
            continue
        errors = tuple(float(e) for e in task.errors(answer, reference))
        reason = "" if np.isfinite(errors).all() else "the test was not solved to its end"
        measured.append(Measured(setting, seconds, runs, errors, reason))
    bounds = tuple(float(e) for e in task.errors(task.check(), reference))
    return Outcome(task, tuple(measured), bounds)


def front(seconds, errors):
    """Mask (n,) of the settings that no other beats in one and equals or beats in the other.

    seconds, errors (n,); a NaN in either is never on the front and beats nothing.
    """
    seconds, errors = np.asarray(seconds, dtype=float), np.asarray(errors, dtype=float)
    on = np.isfinite(seconds) & np.isfinite(errors)
    for i in np.flatnonzero(on):
        no_worse = (seconds <= seconds[i]) & (errors <= errors[i])
        better = (seconds < seconds[i]) | (errors < errors[i])
        on[i] = not (no_worse & better).any()
    return on


def beaten_by(seconds, errors, which, noise=NOISE):
    """The fastest setting that is as exact as ``which`` and faster by more than ``noise``, or None."""
    seconds, errors = np.asarray(seconds, dtype=float), np.asarray(errors, dtype=float)
    better = (errors <= errors[which]) & (seconds < (1.0 - noise) * seconds[which])
    if not better.any():
        return None
    return int(np.flatnonzero(better)[np.argmin(seconds[better])])


def cheapest(seconds, errors, target):
    """The fastest setting with an error of ``target`` at most, or None where none reaches it."""
    seconds, errors = np.asarray(seconds, dtype=float), np.asarray(errors, dtype=float)
    reached = np.isfinite(seconds) & (errors <= target)
    if not reached.any():
        return None
    return int(np.flatnonzero(reached)[np.argmin(seconds[reached])])


def together(outcomes, target):
    """The one setting that solves all ``outcomes`` to ``target`` in the least time: (name, seconds).

    All quantities count.  None where no setting does.
    """
    sums = {}
    for outcome in outcomes:
        for one in outcome.measured:
            if all(error <= target for error in one.errors):
                sums.setdefault(one.setting.name, []).append(one.seconds)
    known = {name: sum(s) for name, s in sums.items() if len(s) == len(outcomes)}
    return min(known.items(), key=lambda pair: pair[1]) if known else None


def exponent(size, cost):
    """Slope of log(cost) against log(size), fitted by least squares; NaN for fewer than two sizes.

    size, cost (n,), both above 0; sizes without a cost (NaN) are left out.
    """
    size, cost = np.asarray(size, dtype=float), np.asarray(cost, dtype=float)
    known = np.isfinite(cost) & (cost > 0.0)
    if known.sum() < 2:
        return math.nan
    return float(np.polyfit(np.log(size[known]), np.log(cost[known]), 1)[0])

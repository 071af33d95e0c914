"""Something computed with a skip and without it: the time that it saves, the difference that it makes."""

import time
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Measured:
    """CPU times (s) with the skip and without it, and the largest relative difference of the results.

    compared: what was compared, in words; tolerance: largest difference that the skip may make.
    """

    what: str
    compared: str
    with_skip: float
    without_skip: float
    difference: float
    tolerance: float

    @property
    def saved(self):
        """CPU time saved (s)."""
        return self.without_skip - self.with_skip

    @property
    def within(self):
        """Whether the difference is within the tolerance; a number that is none is not."""
        return bool(self.difference <= self.tolerance)


def measure(what, compared, skipping, full, tolerance, repeats=3):
    """:class:`Measured` of two calls that give the same numbers (arrays of one shape).

    skipping: the call that skips, run ``repeats`` times (the least time stands); full: the call that
    does not, run once.  The difference is the largest one over the largest size of the full result.
    """
    with_skip = np.inf
    for _ in range(repeats):
        begin = time.process_time()
        short = np.asarray(skipping(), dtype=float)
        with_skip = min(with_skip, time.process_time() - begin)
    begin = time.process_time()
    whole = np.asarray(full(), dtype=float)
    without_skip = time.process_time() - begin
    if short.shape != whole.shape:
        # A test that ended early is not the same result.
        return Measured(what, compared, with_skip, without_skip, np.inf, tolerance)
    largest = np.abs(whole).max()
    difference = np.abs(short - whole).max() / (largest if largest > 0.0 else 1.0)
    return Measured(what, compared, with_skip, without_skip, float(difference), tolerance)

"""How good a predicted band was, once the test is measured.

>>> import numpy as np
>>> samples = np.random.default_rng(0).normal(size=(4000, 1))
>>> one = score(samples, np.array([0.0]), np.array([0.0]))
>>> round(one.crps, 2), one.inside_95, one.inside_50
(0.23, 1.0, 1.0)
"""

from dataclasses import dataclass

import numpy as np

LEVELS = {50: (0.25, 0.75), 95: (0.025, 0.975)}


@dataclass(frozen=True)
class Score:
    """inside_50, inside_95: share of the measured points in the bands; rms: of median over measured value
    less 1; crps: mean continuous ranked probability score in units of the quantity (T. Gneiting and A. E.
    Raftery, J. Am. Stat. Assoc. 102 (2007) 359), small for bands that are narrow and right; width_95:
    mean width of the 95 % band; points."""

    inside_50: float
    inside_95: float
    rms: float
    crps: float
    width_95: float
    points: int


def crps(samples, measured):
    """E|X - y| - E|X - X'|/2 of samples (n, points) against measured (points,); (points,)."""
    ordered = np.sort(samples, axis=0)
    n = len(ordered)
    rank = 2.0 * np.arange(1, n + 1) - n - 1.0
    spread = (rank[:, None] * ordered).sum(axis=0) / n**2
    return np.abs(samples - measured).mean(axis=0) - spread


def bands(samples):
    """{50: (low, high), 95: (low, high)} and the median of samples (n, points), (points,) each."""
    found = {level: np.quantile(samples, ends, axis=0) for level, ends in LEVELS.items()}
    return found, np.median(samples, axis=0)


def score(samples, measured, median=None):
    """The :class:`Score` of samples (n, points) of what would be measured; median: (points,) of the
    prediction, that of the samples without."""
    found, middle = bands(samples)
    middle = middle if median is None else median
    inside = {
        k: float(((low <= measured) & (measured <= high)).mean())
        for k, (low, high) in found.items()
    }
    divisor = np.where(measured == 0.0, 1.0, measured)
    return Score(
        inside[50], inside[95], float(np.sqrt((((middle - measured) / divisor) ** 2).mean())),
        float(crps(samples, measured).mean()), float(np.diff(found[95], axis=0).mean()), len(measured),
    )  # fmt: skip

"""Loop length and set fitted so that the fabric at rest has the density that is stated.

The model predicts a density; where that of the real fabric is known better than its loop length and
its set, these two follow from it.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from knitsim.equilibrium.relax import Relaxed, relax
from knitsim.errors import ComputationError, InputError

LOOP_LENGTH_RANGE = (0.85, 1.25)  # of the stated loop length
TOLERANCE = 1e-4  # of the spacings: the fit counts as reached
PENALTY = 1.0  # relative misfit of a trial that has no equilibrium


@dataclass(frozen=True, eq=False)
class DensityFit:
    """A fabric at rest with loop length and set fitted.

    relaxed: the state, whose fabric carries the fitted values; misfit (2,): relative difference of
    wale and course spacing from the stated ones; reached: both within 1e-4 (a set between 0 and 1 need
    not exist that does it).
    """

    relaxed: Relaxed
    misfit: np.ndarray
    reached: bool

    @property
    def loop_length(self):
        return self.relaxed.model.fabric.loop_length

    @property
    def set_fraction(self):
        return self.relaxed.model.fabric.set_fraction


def fit_density(fabric, resolution=None):
    """Fit loop length and set of a fabric to its stated spacings; a :class:`DensityFit`.

    Raises ComputationError where the start itself does not relax.
    """
    stated = np.array([fabric.wale_spacing, fabric.course_spacing])
    start = replace(fabric, set_fraction=0.5)
    relax(start, resolution)

    def misfit(unknown):
        try:
            tried = replace(
                fabric, loop_length=unknown[0] * fabric.loop_length, set_fraction=unknown[1]
            )
            state = relax(tried, resolution)
        except (ComputationError, InputError):
            return np.full(2, PENALTY)
        return np.array([state.wale_spacing, state.course_spacing]) / stated - 1.0

    low, high = LOOP_LENGTH_RANGE
    found = least_squares(
        misfit, [1.0, 0.5], bounds=([low, 0.0], [high, 1.0]), diff_step=1e-3, xtol=1e-8, ftol=1e-12
    )
    best = replace(
        fabric, loop_length=found.x[0] * fabric.loop_length, set_fraction=float(found.x[1])
    )
    state = relax(best, resolution)
    left = np.array([state.wale_spacing, state.course_spacing]) / stated - 1.0
    return DensityFit(state, left, bool(np.abs(left).max() <= TOLERANCE))

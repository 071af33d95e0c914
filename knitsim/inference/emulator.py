"""The model's rows as smooth functions of its uncertain inputs, and how far off these are.

Rows are told in the scale in which inference compares them: spacings and strain along the pull by their
logarithm, strain across as it is.  Each number is a smooth function of the features of the inputs
(:meth:`knitsim.inference.inputs.Input.feature`) through solved rows; its leave-one-out error is part of
every band.
"""

from copy import copy

import numpy as np

from knitsim.errors import ComputationError

LENGTHS = (2.0, 3.0, 4.5, 7.0, 10.0, 15.0)  # L, of features with variance 1
NUGGETS = np.geomspace(1e-7, 1e-1, 7)
CONSTANT, LINEAR, TINY = 10.0, 0.1, 1e-16
LEAST = 3.0  # solved rows over features: below it no leave-one-out error is trusted
LEAST_ROWS = 20.0  # that errors near a fit are taken from, in effect
RUBBING = ("friction", "tangential_ratio")


def logged(places):
    """Which places of a row are compared by their logarithm, (places,) bool."""
    return np.array([p.quantity != "lateral_strain" for p in places])


def told(places, rows):
    """Rows (..., places) in the scale of comparison."""
    log = logged(places)
    return np.where(log, np.log(np.where(log, rows, 1.0)), rows)


def untold(places, rows):
    """Rows (..., places) back in SI."""
    log = logged(places)
    return np.where(log, np.exp(np.where(log, rows, 0.0)), rows)


class Smooth:
    """Columns y (rows, n), NaN where there is no number, as smooth functions of features x (rows, m).

    A Gaussian process (C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning,
    2006, ch. 2) with the covariance s s' (CONSTANT + LINEAR x.x' + exp(-|x - x'|^2/(2 L^2))) and a nugget;
    scale (rows,): s, 1 without, of functions that vanish with it.  L and nugget are those with the
    least leave-one-out errors, which are exact for it (ibid., 5.4.2).

    left_out: (rows, n) those errors, NaN as y.  Raises ComputationError for too few rows.
    """

    def __init__(self, x, y, scale=None):
        if len(x) < LEAST * x.shape[1]:
            raise ComputationError(
                f"{len(x)} solved fabrics are too few to tell the effect of the inputs: "
                f"{int(np.ceil(LEAST * x.shape[1]))} or more"
            )
        self.x, self.scale = x, np.ones(len(x)) if scale is None else scale
        known = np.isfinite(y)
        self.middle = np.zeros(y.shape[1]) if scale is not None else np.nanmean(y, axis=0)
        y = y - self.middle
        patterns = np.unique(known, axis=1).T
        own = [(known == one[:, None]).all(axis=0) for one in patterns]
        best = np.inf
        for length in LENGTHS:
            whole = self._covariance(x, self.scale, length)
            for nugget in NUGGETS:
                weights, left = np.zeros_like(y), np.full_like(y, np.nan)
                for rows, columns in zip(patterns, own, strict=True):
                    both = np.ix_(rows, columns)
                    inner = whole[np.ix_(rows, rows)] + nugget * np.eye(rows.sum())
                    inverse = np.linalg.inv(inner)
                    weights[both] = inverse @ y[both]
                    left[both] = weights[both] / np.diag(inverse)[:, None]
                size = np.log(np.nanmean(left**2, axis=0) + TINY).sum()
                if size < best:
                    best, self.length, self.nugget = size, length, nugget
                    self.weights, self.left_out = weights, left

    def _covariance(self, x, scale, length):
        dot = x @ self.x.T
        square = (x**2).sum(axis=1)[:, None] + (self.x**2).sum(axis=1) - 2.0 * dot
        near = np.exp(-0.5 * np.maximum(square, 0.0) / length**2)
        return (CONSTANT + LINEAR * dot + near) * scale[:, None] * self.scale

    def at(self, x, scale=None):
        scale = np.ones(len(x)) if scale is None else scale
        return self.middle + self._covariance(x, scale, self.length) @ self.weights

    @property
    def error(self):
        """Root mean square (n,) of the leave-one-out errors."""
        return np.sqrt(np.nanmean(self.left_out**2, axis=0))

    def covariance(self, weight=None):
        """Covariance (n, n) of the errors of one row; weight (rows,): how much each row counts."""
        known = np.isfinite(self.left_out)
        weight = np.ones(len(known)) if weight is None else weight
        left = np.where(known, self.left_out, 0.0)
        both = (known * weight[:, None]).T @ known
        mixed = (left * weight[:, None]).T @ left / np.maximum(both, 1e-12)
        deviation = np.maximum(np.sqrt(np.diag(mixed)), 1e-12)
        size, axes = np.linalg.eigh(mixed / np.outer(deviation, deviation))
        whole = (axes * np.maximum(size, 0.0)) @ axes.T
        # What had few rows in common gets back the deviation that it has by itself.
        scale = deviation / np.sqrt(np.maximum(np.diag(whole), TINY))
        return whole * np.outer(scale, scale)


class Emulator:
    """Rows for any inputs, from solved ones.

    inputs; places: of a row; z: (rows, inputs) standard normal numbers; rows: (rows, places) SI, of fabrics
    without friction if ``rubbed`` is there, NaN where a force was not reached.  rubbed: (numbers (k,) of
    rows, (k, places) the same fabrics with friction): what friction changes is small and smooth, and is
    told by few of them.  error: (places,) root mean square of the leave-one-out errors, in the scale of
    comparison; covariance (places, places).  Raises ComputationError for too few rows.
    """

    def __init__(self, inputs, places, z, rows, rubbed=None):
        self.inputs, self.places, self.solved = tuple(inputs), tuple(places), len(rows)
        self.rubbing = [
            k for k, i in enumerate(self.inputs) if rubbed is not None and i.name in RUBBING
        ]
        self.others = [k for k in range(len(self.inputs)) if k not in self.rubbing]
        y = told(self.places, np.asarray(rows))
        self.z, self.told = np.asarray(z), y
        self.plain, self.rub, self.number = Smooth(self._t(z)[:, self.others], y), None, None
        if rubbed is not None:
            self.number, with_friction = rubbed
            self.solved += len(self.number)
            change = told(self.places, np.asarray(with_friction)) - y[self.number]
            own = self.z[self.number]
            self.rub = Smooth(self._t(own), change, self._friction(own))
        self.covariance = self._covariance()
        self.error = np.sqrt(np.diag(self.covariance))

    def _covariance(self, weight=None):
        found = self.plain.covariance(weight)
        if self.rub is not None:
            found = found + self.rub.covariance(None if weight is None else weight[self.number])
        return found

    def near(self, log):
        """This emulator with the errors that it has where a fit is; log (rows,): logarithm of the likelihood
        of each solved row.  Tempered until LEAST_ROWS count in effect."""
        for power in 0.5 ** np.arange(30):
            weight = np.exp(power * (log - log.max()))
            if weight.sum() ** 2 / (weight**2).sum() >= min(LEAST_ROWS, len(log)):
                break
        found = copy(self)
        found.covariance = self._covariance(weight)
        found.error = np.sqrt(np.diag(found.covariance))
        return found

    def _t(self, z):
        z = np.atleast_2d(z)
        return np.stack([i.feature(z[:, k]) for k, i in enumerate(self.inputs)], axis=1)

    def _friction(self, z):
        names = [i.name for i in self.inputs]
        friction = self.inputs[names.index("friction")]
        return friction.at(z[:, names.index("friction")]) / max(float(friction.at(2.0)), 1e-9)

    def rows(self, z):
        """Rows (n, places) at z (n, inputs), in the scale of comparison."""
        z = np.atleast_2d(z)
        t = self._t(z)
        plain = self.plain.at(t[:, self.others])
        return plain if self.rub is None else plain + self.rub.at(t, self._friction(z))

    def slopes(self, z, step=1e-4):
        """Derivatives (places, inputs) at one z (inputs,)."""
        sides = z + step * np.concatenate([np.eye(len(z)), -np.eye(len(z))])
        up, down = np.split(self.rows(sides), 2)
        return (up - down).T / (2.0 * step)

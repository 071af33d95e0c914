"""The model's rows as a polynomial in its uncertain inputs, and how far off that is.

Rows are told in the scale in which inference compares them: spacings and strain along the pull by their
logarithm, strain across as it is.  Each number is a quadratic of the features of the inputs
(:meth:`knitsim.inference.inputs.Input.feature`), fitted by ridge regression to solved rows; the ridge is
that with the least leave-one-out error, which is exact for such fits (D. M. Allen, Technometrics 16
(1974) 125), and that error is part of every band.
"""

import numpy as np

from knitsim.errors import ComputationError

RIDGES = np.geomspace(1e-4, 1e2, 13)  # of the sum of squares of a feature
LEAST = 1.5  # solved rows over features: below it no leave-one-out error is trusted
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


class Polynomial:
    """Ridge regression of columns y (rows, n), NaN where there is no number, on features x (rows, m).

    weights (m, n); left_out: leave-one-out errors (rows, n), NaN as y; error: (n,) their root mean square.
    """

    def __init__(self, x, y, through_zero=False):
        self.mean = np.zeros(y.shape[1])
        self.weights = np.zeros((x.shape[1], y.shape[1]))
        self.left_out = np.full_like(y, np.nan)
        known = np.isfinite(y)
        for pattern in np.unique(known, axis=1).T:
            columns = (known == pattern[:, None]).all(axis=0)
            self._fit(x[pattern], y[np.ix_(pattern, columns)], pattern, columns, through_zero)
        self.error = np.sqrt(np.nanmean(self.left_out**2, axis=0))

    def _fit(self, x, y, pattern, columns, through_zero):
        n = len(x)
        if n < LEAST * x.shape[1]:
            raise ComputationError(
                f"{n} solved fabrics are too few to tell the effect of the inputs: "
                f"{int(np.ceil(LEAST * x.shape[1]))} or more"
            )
        centre = np.zeros(x.shape[1]) if through_zero else x.mean(axis=0)
        middle = np.zeros(y.shape[1]) if through_zero else y.mean(axis=0)
        x, y = x - centre, y - middle
        u, size, right = np.linalg.svd(x, full_matrices=False)
        best = np.full(y.shape[1], np.inf)
        weights, left_out = np.zeros((x.shape[1], y.shape[1])), np.zeros_like(y)
        for ridge in RIDGES:
            shrink = size / (size**2 + ridge)
            tried = (right.T * shrink) @ (u.T @ y)
            own = (u**2 * (size * shrink)).sum(axis=1) + (0.0 if through_zero else 1.0 / n)
            left = (y - x @ tried) / (1.0 - np.minimum(own, 0.99))[:, None]
            error = (left**2).mean(axis=0)
            better = error < best
            best = np.where(better, error, best)
            weights[:, better], left_out[:, better] = tried[:, better], left[:, better]
        self.weights[:, columns], self.mean[columns] = weights, middle - centre @ weights
        self.left_out[np.ix_(pattern, columns)] = left_out

    def at(self, x):
        return self.mean + x @ self.weights

    @property
    def covariance(self):
        """Covariance (n, n) of the errors of one row."""
        known = np.isfinite(self.left_out)
        left = np.where(known, self.left_out, 0.0)
        both = known.T.astype(float) @ known
        deviation = np.maximum(self.error, 1e-12)
        mixed = left.T @ left / np.maximum(both, 1.0) / np.outer(deviation, deviation)
        size, axes = np.linalg.eigh(mixed)
        whole = (axes * np.maximum(size, 0.0)) @ axes.T
        # What had few rows in common gets back the deviation that it has by itself.
        scale = deviation / np.sqrt(np.diag(whole))
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
        self.plain, self.rub = Polynomial(self._features(z), y), None
        self.covariance = self.plain.covariance
        if rubbed is not None:
            number, with_friction = rubbed
            self.solved += len(number)
            change = told(self.places, np.asarray(with_friction)) - y[number]
            self.rub = Polynomial(self._rub_features(z[number]), change, through_zero=True)
            self.covariance = self.covariance + self.rub.covariance
        self.error = np.sqrt(np.diag(self.covariance))

    def _t(self, z):
        z = np.atleast_2d(z)
        return np.stack([i.feature(z[:, k]) for k, i in enumerate(self.inputs)], axis=1)

    def _features(self, z):
        t = self._t(z)[:, self.others]
        i, j = np.triu_indices(t.shape[1])
        # Squares less their mean, so that the mean of a row is the mean of its number.
        return np.concatenate([t, t[:, i] * t[:, j] - (i == j)], axis=1)

    def _rub_features(self, z):
        """Features that vanish without friction: its powers, with the stiffness before sliding."""
        z = np.atleast_2d(z)
        names = [i.name for i in self.inputs]
        friction = self.inputs[names.index("friction")]
        m = (friction.at(z[:, names.index("friction")]) / max(float(friction.at(2.0)), 1e-9))[
            :, None
        ]
        t = self._t(z)
        r = (
            t[:, [names.index("tangential_ratio")]]
            if "tangential_ratio" in names
            else np.zeros_like(m)
        )
        return np.concatenate([m, m * r, m * r**2, m**2, m**2 * r, m * t[:, self.others]], axis=1)

    def rows(self, z):
        """Rows (n, places) at z (n, inputs), in the scale of comparison."""
        plain = self.plain.at(self._features(z))
        return plain if self.rub is None else plain + self.rub.at(self._rub_features(z))

    def slopes(self, z, step=1e-4):
        """Derivatives (places, inputs) at one z (inputs,)."""
        sides = z + step * np.concatenate([np.eye(len(z)), -np.eye(len(z))])
        up, down = np.split(self.rows(sides), 2)
        return (up - down).T / (2.0 * step)

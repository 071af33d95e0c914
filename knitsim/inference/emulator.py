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
LEAST = 2.0  # solved rows over features: below it no leave-one-out error is trusted


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


class Emulator:
    """Rows for any inputs, from solved ones.

    inputs; places: of a row; z: (rows, inputs) standard normal numbers; rows: (rows, places) SI.  error:
    (places,) root mean square of the leave-one-out errors, in the scale of comparison.  Raises
    ComputationError for too few rows.
    """

    def __init__(self, inputs, places, z, rows):
        self.inputs, self.places = tuple(inputs), tuple(places)
        x, y = self._features(z), told(self.places, np.asarray(rows))
        if len(x) < LEAST * x.shape[1]:
            raise ComputationError(
                f"{len(x)} solved fabrics are too few to tell the effect of {len(self.inputs)} inputs: "
                f"{int(LEAST * x.shape[1])} or more"
            )
        self.mean = y.mean(axis=0)
        u, size, right = np.linalg.svd(x, full_matrices=False)
        best = np.full(len(self.places), np.inf)
        self.weights = np.zeros((x.shape[1], len(self.places)))
        self.left_out = np.zeros_like(y)
        for ridge in RIDGES:
            shrink = size / (size**2 + ridge)
            weights = (right.T * shrink) @ (u.T @ (y - self.mean))
            own = (u**2 * (size * shrink)).sum(axis=1) + 1.0 / len(x)
            left = (y - self.mean - x @ weights) / (1.0 - np.minimum(own, 0.99))[:, None]
            error = np.sqrt((left**2).mean(axis=0))
            better = error < best
            best = np.where(better, error, best)
            self.weights[:, better], self.left_out[:, better] = weights[:, better], left[:, better]
        self.error = best
        n = len(x)
        self.covariance = self.left_out.T @ self.left_out / n

    def _features(self, z):
        z = np.atleast_2d(z)
        t = np.stack([i.feature(z[:, k]) for k, i in enumerate(self.inputs)], axis=1)
        i, j = np.triu_indices(t.shape[1])
        # Legendre's for places in a range, Hermite's for normal numbers: all of mean 0.
        return np.concatenate([t, t[:, i] * t[:, j] - (i == j)], axis=1)

    def rows(self, z):
        """Rows (n, places) at z (n, inputs), in the scale of comparison."""
        return self.mean + self._features(z) @ self.weights

    def slopes(self, z, step=1e-4):
        """Derivatives (places, inputs) at one z (inputs,)."""
        sides = z + step * np.concatenate([np.eye(len(z)), -np.eye(len(z))])
        up, down = np.split(self.rows(sides), 2)
        return (up - down).T / (2.0 * step)

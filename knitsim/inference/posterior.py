"""What measured tests teach about the uncertain inputs of a fabric, and what that predicts.

The inputs are a standard normal vector z (:mod:`.inputs`), the model a row y(z) of numbers.  A measured
test is H y + e + d: H interpolates the row to the measured forces, e is the error of the measurement and d
what the model leaves out (M. C. Kennedy and A. O'Hagan, J. R. Stat. Soc. B 63 (2001) 425).  e and d are
normal and correlate along the curve (:func:`together`), half of the variance of e between neighbours only
by chance: errors that are taken as too smooth let small wiggles of a curve decide about the inputs.  The
size s of d, relative to the strain, is itself unknown, and estimated from the misfit together with them:

    -2 ln p(z, s) = |z|^2 + r' C^-1 r + ln|C| + prior of s,   r = measured - H y(z),  C = E + s^2 D.

The most probable z is found by Gauss-Newton; about it the distribution is taken as normal with the
covariance (J' C^-1 J + 1)^-1, J = dy/dz (Laplace).  Draws of that are weighted by what p truly is, the
weights smoothed (A. Vehtari et al., J. Mach. Learn. Res. 25 (2024) 72); where k is above 0.7 the
approximation is not to be trusted and says so.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar
from scipy.stats import genpareto

from knitsim.errors import InputError
from knitsim.inference.emulator import logged
from knitsim.inference.inputs import Input

DISCREPANCY = Input("discrepancy", "tolerance", 0.05, 1.0, "assumed; four points' weight")
ACROSS = (
    1.0  # discrepancy of the strain across, in that of the strain along: error of Poisson's ratio
)
MEASURED = 0.03  # relative error of a strain whose file has no band
LEAST_ERROR = 0.003  # of strain: clamps, markers and the zero of a test
REST = 0.035  # relative error of a spacing at rest: one specimen differs by 7 % between handlings
TOGETHER = 1.0  # ln of forces over which errors go together
ALONE = 0.5  # part of the variance of a measured point that goes with no other
RANGE_OF = {
    2: 1.128,
    3: 1.693,
    4: 2.059,
    5: 2.326,
}  # range of n normal numbers in standard deviations
RUNS = 5  # taken for a band whose number of runs is unknown
ROUNDS, STILL = 40, 1e-6
TRUSTED = 0.7  # k of the weights
ADAPTED, TAIL = 3, 8.0  # rounds of samples; degrees of freedom of what proposes them


@dataclass(frozen=True, eq=False)
class Block:
    """Measured numbers of one test and quantity: at (n,) N/m; values (n,) in the scale of comparison;
    H (n, places); error (n, n) covariance; shape (n,): of the discrepancy, times s its deviation."""

    test: str
    quantity: str
    at: np.ndarray
    values: np.ndarray
    H: np.ndarray
    error: np.ndarray
    shape: np.ndarray
    name: str = ""


def reading(places, test, quantity, at):
    """H (n, places): the numbers of a row at forces ``at`` (N/m), cubic in ln f; H = 0 beyond the row's
    forces is refused with InputError."""
    own = [k for k, p in enumerate(places) if (p.test, p.quantity) == (test, quantity)]
    if not own:
        raise InputError(f"{test} {quantity}", None, "is not among the predicted quantities")
    forces = np.array([places[k].at for k in own])
    found = np.zeros((len(at), len(places)))
    if test == "rest":
        found[:, own] = 1.0
        return found
    if min(at) < forces[0] * (1 - 1e-9) or max(at) > forces[-1] * (1 + 1e-9):
        raise InputError(
            f"{test} forces", [float(min(at)), float(max(at))],
            f"must lie between {forces[0]:.4g} and {forces[-1]:.4g} N/m",
        )  # fmt: skip
    spline = make_interp_spline(np.log(forces), np.eye(len(own)), k=min(3, len(own) - 1))
    found[:, own] = spline(np.log(np.asarray(at)))
    return found


def together(at):
    """Correlation (n, n) of errors at forces ``at`` (N/m): Matern's of order 3/2, since nothing says that
    they are smoother than with one derivative."""
    x = np.log(np.asarray(at))
    apart = math.sqrt(3.0) * np.abs(x[:, None] - x) / TOGETHER
    return (1.0 + apart) * np.exp(-apart)


def block(places, test, quantity, at, values, error, *, strain=None, correlated=True, name=""):
    """A :class:`Block`; at (n,) N/m; values, error (n,): strains and their standard deviations; strain:
    (n,) along the pull, of which the discrepancy of the strain across is a part."""
    at, values = np.asarray(at, dtype=float), np.asarray(values, dtype=float)
    error = np.broadcast_to(np.asarray(error, dtype=float), values.shape)
    shape = np.ones(len(at))
    if quantity == "lateral_strain":
        shape = ACROSS * np.asarray(strain)
    else:
        if not (values > 0).all():
            raise InputError(f"{name or test} {quantity}", values.min(), "must be above 0")
        error, values = error / values, np.log(values)
    alone = ALONE if correlated else 1.0
    mix = (1.0 - alone) * together(at) + alone * np.eye(len(at))
    covariance = np.outer(error, error) * mix
    return Block(
        test, quantity, at, values, reading(places, test, quantity, at), covariance, shape, name
    )


def error_of(test, quantity="strain"):
    """Standard deviations (n,) of a measured tension test's loading points, from the file's own band."""
    own = test.loading
    strain = test["strain"][own]
    if test.band is None:
        error = np.maximum(MEASURED * np.abs(strain), LEAST_ERROR)
    else:
        low, high = (end[own] for end in test.band)
        runs = len(test.specimens) or RUNS
        error = np.maximum((high - low) / RANGE_OF.get(runs, RANGE_OF[RUNS]), LEAST_ERROR)
    if quantity == "strain":
        return error
    # Of the strain across no band is kept: relative as that along, and the zero of the test.
    return np.maximum(np.abs(test["lateral_strain"][own]) * error / np.abs(strain), LEAST_ERROR)


def blocks_of(places, test, quantities=("strain",)):
    """The :class:`Block` of each quantity of a measured tension test (MeasuredTest), at those of its
    loading points that lie within the row's forces."""
    top = {p.test: p.at for p in places}
    bottom = {p.test: p.at for p in reversed(places)}
    force, found = test["force_per_width"], []
    for quantity in quantities:
        if quantity not in test:
            continue
        keep = test.loading & (force >= bottom[test.direction]) & (force <= top[test.direction])
        keep &= np.isfinite(test[quantity]) & (test["strain"] > 0)
        inside = keep[test.loading]
        found.append(block(
            places, test.direction, quantity, force[keep], test[quantity][keep],
            error_of(test, quantity)[inside], strain=test["strain"][keep], name=test.name,
        ))  # fmt: skip
    return found


def rest_blocks(places, wale_spacing, course_spacing, error=REST):
    """Blocks of the spacings at rest (m)."""
    pairs = (("wale_spacing", wale_spacing), ("course_spacing", course_spacing))
    return [
        block(places, "rest", name, [1.0], [v], error * v, name="rest") for name, v in pairs if v
    ]


def fitted(emulator, blocks):
    """The :class:`Posterior` of blocks, with the errors of an Emulator there where the fit is."""
    first = Posterior(emulator, blocks)
    if not first.blocks:
        return first
    s = np.full(len(emulator.z), first.s)
    return Posterior(emulator.near(first.log_likelihood(emulator.z, s)), blocks)


class Posterior:
    """What blocks of measured numbers leave of the inputs of a model.

    model: with ``inputs``, ``places``, ``rows(z)``, ``slopes(z)`` and ``covariance`` of its own errors, as
    :class:`knitsim.inference.emulator.Emulator`; blocks: (:class:`Block`, ...), none for the prior.

    z, s: most probable inputs and discrepancy; covariance: of z; draws(n, seed): samples.
    """

    def __init__(self, model, blocks=()):
        self.model, self.blocks = model, tuple(blocks)
        n = len(model.inputs)
        self.H = (
            np.concatenate([b.H for b in self.blocks])
            if blocks
            else np.zeros((0, len(model.places)))
        )
        self.values = np.concatenate([b.values for b in self.blocks]) if blocks else np.zeros(0)
        self.error = self._joined([b.error for b in self.blocks])
        self.error = self.error + self.H @ model.covariance @ self.H.T
        self.shape = self._joined(
            [np.outer(b.shape, b.shape) * together(b.at) for b in self.blocks]
        )
        self.z, self.s, self.converged = np.zeros(n), 0.0, True
        self.spread_s = math.log1p(DISCREPANCY.second) / 2.0
        if self.blocks:
            self._search()
        _, slopes, _ = self._at(self.z, self.s)
        self.precision = np.eye(n) + slopes.T @ slopes
        self.covariance = np.linalg.inv(self.precision)

    @staticmethod
    def _joined(parts):
        size = sum(len(p) for p in parts)
        whole, at = np.zeros((size, size)), 0
        for part in parts:
            whole[at : at + len(part), at : at + len(part)] = part
            at += len(part)
        return whole

    def _factor(self, s):
        size = float(DISCREPANCY.at(s))
        return np.linalg.cholesky(self.error + size**2 * self.shape)

    def _at(self, z, s):
        """Whitened residual and slopes, and ln|C|."""
        factor = self._factor(s)
        r = np.linalg.solve(factor, self.values - self.H @ self.model.rows(z)[0])
        slopes = np.linalg.solve(factor, self.H @ self.model.slopes(z))
        return r, slopes, 2.0 * np.log(np.diag(factor)).sum()

    def minus_log(self, z, s):
        """-ln p up to a constant, (n,), for z (n, inputs) and s (n,)."""
        z, s = np.atleast_2d(z), np.atleast_1d(s)
        return 0.5 * (z**2).sum(axis=1) + 0.5 * s**2 - self.log_likelihood(z, s)

    def log_likelihood(self, z, s):
        """ln p of the blocks up to a constant, (n,), for z (n, inputs) and s (n,)."""
        if not self.blocks:
            return np.zeros(len(z))
        off = self.values - self.model.rows(z) @ self.H.T
        size = DISCREPANCY.at(s)[:, None, None]
        covariance = self.error + size**2 * self.shape
        factor = np.linalg.cholesky(covariance)
        r = np.linalg.solve(factor, off[:, :, None])[:, :, 0]
        log = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        return -0.5 * (r**2).sum(axis=1) - log

    def _search(self):
        """Gauss-Newton in z with halved steps, the best s in between."""
        here = float(self.minus_log(self.z, self.s)[0])
        for _ in range(ROUNDS):
            r, slopes, _ = self._at(self.z, self.s)
            step = np.linalg.solve(np.eye(len(self.z)) + slopes.T @ slopes, slopes.T @ r - self.z)
            before = here
            for part in 0.5 ** np.arange(12):
                value = float(self.minus_log(self.z + part * step, self.s)[0])
                if value < here:
                    self.z, here = self.z + part * step, value
                    break
            best = minimize_scalar(
                lambda s: float(self.minus_log(self.z, s)[0]), bounds=(-6.0, 6.0), method="bounded"
            )
            if best.fun < here:
                self.s, here = float(best.x), float(best.fun)
            if before - here < STILL:
                return
        self.converged = False

    def draws(self, count, seed=0, weighted=True):
        """(z (count, inputs), s (count,), k): samples, and the k of their weights (0 without).

        weighted: resampled by the true density over that which proposes, a t-distribution, which is moved to
        the mean and covariance of a first such sample (adaptive importance sampling).
        """
        rng = np.random.default_rng(seed)
        middle = np.append(self.z, self.s)
        covariance = np.diag(np.append(np.zeros(len(self.z)), self._width_s() ** 2))
        covariance[:-1, :-1] = self.covariance
        if not (weighted and self.blocks):
            sample = rng.multivariate_normal(middle, covariance, count, method="cholesky")
            return sample[:, :-1], sample[:, -1], 0.0
        for _ in range(ADAPTED):
            sample, log = self._proposed(rng, 8 * count, middle, covariance)
            weight, k = smoothed(log - log.max())
            middle = weight @ sample
            covariance = (sample - middle).T @ (weight[:, None] * (sample - middle))
            # What few samples tell must not close a direction.
            covariance += 1e-6 * np.eye(len(middle))
        chosen = rng.choice(len(sample), count, p=weight)
        return sample[chosen, :-1], sample[chosen, -1], k

    def _proposed(self, rng, many, middle, covariance):
        """Samples (many, inputs + 1) of a t-distribution, heavier in its tails than the normal one so that no
        weight is without bound, and ln of the density over it."""
        n = len(middle)
        tail = np.sqrt(TAIL / rng.chisquare(TAIL, many))[:, None]
        step = rng.standard_normal((many, n)) * tail
        sample = middle + step @ np.linalg.cholesky(covariance).T
        power = -0.5 * (n + TAIL) * np.log1p((step**2).sum(axis=1) / TAIL)
        return sample, -self.minus_log(sample[:, :-1], sample[:, -1]) - power

    def _width_s(self):
        """Standard deviation of s about its most probable value."""
        if not self.blocks:
            return 1.0
        h = 0.1
        low, mid, high = self.minus_log(
            np.tile(self.z, (3, 1)), self.s + h * np.array([-1.0, 0.0, 1.0])
        )
        return 1.0 / math.sqrt(max((low + high - 2.0 * mid) / h**2, 0.1))

    def log_density(self, both):
        """ln p (n,) at (n, inputs + 1), z and s together, as a sampler takes it."""
        return -self.minus_log(both[:, :-1], both[:, -1])


def smoothed(log):
    """(Weights that sum to 1, k) of their logarithms: the largest replaced by a Pareto tail's."""
    weight = np.exp(log)
    many = int(min(0.2 * len(weight), 3.0 * math.sqrt(len(weight))))
    order = np.argsort(weight)
    cut = weight[order[-many - 1]]
    k, _, scale = genpareto.fit(weight[order[-many:]] - cut, floc=0.0)
    quantiles = genpareto.ppf((np.arange(1, many + 1) - 0.5) / many, k, 0.0, scale)
    weight[order[-many:]] = np.minimum(cut + quantiles, 1.0)
    return weight / weight.sum(), float(k)


def predicted(posterior, test, quantity, at, *, count=2000, seed=0, measured=None, weighted=True):
    """Samples (count, n) of a test's quantity (SI) at forces ``at`` (N/m): inputs, the model's own error
    and what it leaves out; with measured (n,), standard deviations, of what would be measured.

    The discrepancy of a test that was itself fitted is taken as that of a new one.
    """
    model = posterior.model
    z, s, _ = posterior.draws(count, seed, weighted)
    rng = np.random.default_rng(seed + 1)
    at = np.asarray(at, dtype=float)
    H = reading(model.places, test, quantity, at)
    rows = model.rows(z)
    values = rows @ H.T
    values = values + _normal(rng, H @ model.covariance @ H.T, count)
    along = values
    shape = np.ones(values.shape)
    log = bool(logged(model.places)[H.any(axis=0)].all())
    if not log:
        strain = reading(model.places, test, "strain", at)
        shape = ACROSS * np.exp(rows @ strain.T)
    mix = together(at)
    values = along + DISCREPANCY.at(s)[:, None] * shape * _normal(rng, mix, count)
    if measured is not None:
        middle = np.exp(np.median(values, axis=0)) if log else 1.0
        values = values + _normal(rng, mix, count) * measured / middle
    return np.exp(values) if log else values


def _normal(rng, covariance, count):
    size, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(size, 0.0))
    return rng.standard_normal((count, len(covariance))) @ root.T

"""What a least-squares fit knows about its parameters."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from knitsim.errors import InputError

CONFIDENCE = 0.95
INSEPARABLE = 0.95  # |correlation| from which two parameters count as not told apart
UNKNOWN = 0.8  # part of its bounds that an interval may take before the input counts as not found
ON_BOUND = 1e-3  # of the range between the bounds
# Neighbouring residuals this correlated, in units of 1/sqrt(points), are said to be a pattern.
PATTERN = 2.0


@dataclass(frozen=True, eq=False)
class Spread:
    """Linear uncertainty of fitted parameters.

    covariance, correlation, information (parameters, parameters), the last the inverse of the first
    and finite where that is not; standard_error (parameters,); interval
    (parameters, 2): at 95 %, each parameter taken by itself; factor: Student's t of the interval;
    freedom: degrees of freedom; pattern: correlation of neighbouring residuals.
    """

    covariance: np.ndarray
    information: np.ndarray
    correlation: np.ndarray
    standard_error: np.ndarray
    interval: np.ndarray
    factor: float
    freedom: int
    pattern: float


def soft(residual, scale):
    """Weight of each residual in the robust loss 2 s^2 (sqrt(1 + r^2/s^2) - 1), s = scale, of all or (n,)
    of each."""
    return 1.0 / np.sqrt(1.0 + (residual / scale) ** 2)


def soft_loss(scale):
    """That loss as scipy.optimize.least_squares takes it, with the scale (n,) of each residual."""

    def loss(square):
        over = 1.0 + square / scale**2
        return np.stack([
            2.0 * scale**2 * (np.sqrt(over) - 1.0), over**-0.5, -0.5 * over**-1.5 / scale**2
        ])  # fmt: skip

    return loss


def robust_scale(residual, parameters, factor=4.0):
    """Residual from which a point counts less: ``factor`` standard deviations of the bulk.

    From the median of the sizes, which outliers do not move; infinite (nothing counts less) where
    no residual is beyond it.
    """
    n = len(residual)
    sigma = 1.4826 * float(np.median(np.abs(residual))) * np.sqrt(n / max(n - parameters, 1))
    if not sigma > 0 or np.abs(residual).max() <= factor * sigma:
        return np.inf
    return factor * sigma


def spread(values, residual, jacobian, scale, groups, weight=None):
    """The :class:`Spread` about ``values`` (parameters,).

    residual (n,), jacobian (n, parameters) by the parameters, both times the root of the weight;
    scale: of the robust loss, of all or (n,), inf for plain squares; groups (n,): number of the curve;
    weight (n,): of each point, all alike without.

    Covariance s^2 (J^T J)^-1 (J^T W J) (J^T J)^-1, W the weights over their mean: points are equally
    certain, whatever they weigh (P. J. Huber, Proc. Fifth Berkeley Symp. 1 (1967) 221).  s^2 is that of an
    M-estimate (P. J. Huber, Robust Statistics, 1981, ch. 7), sum(psi^2)/(n - p)/mean(psi')^2.  Where
    neighbouring residuals of a curve go together (correlation c), the points count as n (1 - c)/(1 + c)
    independent ones: a model that bends differently from the measurement leaves such a pattern, and its
    parameters are less certain than the scatter says.  Singular directions count as unknown (infinite).
    """
    n, p = jacobian.shape
    w = soft(residual, scale)
    psi = w * residual
    slope = np.mean(w**3)
    freedom = n - p
    if freedom < 1:
        raise InputError("measured points", n, f"must be more than the {p} free parameters")
    pattern = neighbour_correlation(residual, groups)
    # Of a few points a correlation is poorly known: what is seen counts, if it widens.
    together = min(max(pattern, 0.0), 0.95)
    inflation = (1.0 + together) / (1.0 - together)
    s2 = inflation * float(psi @ psi) / freedom / slope**2
    weight = np.ones(n) if weight is None else weight / weight.mean()
    size = np.linalg.norm(jacobian, axis=0)
    seen = size > 0
    covariance = np.full((p, p), 0.0)
    np.fill_diagonal(covariance, np.inf)
    if seen.any():
        j = jacobian[:, seen] / size[seen]
        _, singular, right = np.linalg.svd(j, full_matrices=False)
        if singular[-1] > 1e-10 * singular[0]:
            inner = (right.T / singular**2) @ right
            inner = inner @ (j.T @ (weight[:, None] * j)) @ inner
            covariance[np.ix_(seen, seen)] = s2 * inner / np.outer(size[seen], size[seen])
    error = np.sqrt(np.diag(covariance))
    finite = np.isfinite(error) & (error > 0)
    correlation = np.eye(p)
    both = np.ix_(finite, finite)
    correlation[both] = covariance[both] / np.outer(error[finite], error[finite])
    factor = float(stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE))
    interval = np.stack([values - factor * error, values + factor * error], axis=1)
    information = jacobian.T @ jacobian
    if np.ptp(weight) > 0.0:
        scaled = jacobian / np.where(seen, size, 1.0)
        known, meat = scaled.T @ scaled, scaled.T @ (weight[:, None] * scaled)
        information = known @ np.linalg.pinv(meat, 1e-12, True) @ known * np.outer(size, size)
    information = information / s2 if s2 > 0 else np.full((p, p), np.inf)
    return Spread(covariance, information, correlation, error, interval, factor, freedom, pattern)


def neighbour_correlation(residual, groups):
    """Correlation of neighbouring residuals within the groups, about zero; 0 for fewer than 3 pairs."""
    same = groups[1:] == groups[:-1]
    one, next_ = residual[:-1][same], residual[1:][same]
    size = np.linalg.norm(one) * np.linalg.norm(next_)
    return float(one @ next_ / size) if len(one) >= 3 and size > 0 else 0.0


def warnings_of(names, values, bounds, spread_):
    """What a user must be told about fitted parameters, one sentence each."""
    found = []
    for i, name in enumerate(names):
        low, high = bounds[i]
        for end, what in ((low, "lower"), (high, "upper")):
            if abs(values[i] - end) <= ON_BOUND * (high - low):
                found.append(
                    f"{name} sits on its {what} bound: the data want it beyond, so that its interval "
                    "and those of the others hold only as far as the bound is right (bounds: of the "
                    "calibration moves it)"
                )
        ends = np.clip(spread_.interval[i], low, high)
        if ends[1] - ends[0] >= UNKNOWN * (high - low):
            found.append(
                f"the data do not determine {name}: its interval is nearly as wide as its bounds"
            )
    for i in range(len(names)):
        for j in range(i):
            c = spread_.correlation[i, j]
            if abs(c) >= INSEPARABLE:
                how = "raised together" if c > 0 else "traded against each other"
                found.append(
                    f"the data cannot tell {names[j]} and {names[i]} apart (correlation {c:+.3f}): "
                    f"{how} they fit nearly as well"
                )
    if not np.isfinite(spread_.standard_error).all():
        found.append("some combination of the parameters has no effect on the fitted points")
    if spread_.pattern > PATTERN / np.sqrt(spread_.freedom + len(names)):
        found.append(
            "the misfit is a pattern, not scatter (neighbouring residuals correlate by "
            f"{spread_.pattern:+.2f}): the model's curve has another shape than the measured one; "
            "the intervals are widened for it, but do not cover what the model leaves out"
        )
    return tuple(found)

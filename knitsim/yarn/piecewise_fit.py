"""Least squares of a force-strain record by two straight lines with slack and a toe before them.

With the recorded strain e, over the onset e0, the toe half-width w and the kink v (all in recorded
strain), and the slopes a and b::

    F(e) = a ramp(min(e, v)) + b max(e - v, 0)
    ramp(e) = 0 below e0 - w,  (e - e0 + w)^2 / (4 w) within w of e0,  e - e0 above e0 + w

The yarn between the clamps is longer than the gauge length by the slack, so its own strain is
(e - e0)/(1 + e0); a test begun under pretension has e0 below 0.  The constants of the yarn are
those of its own strain.
"""

from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

# Free parameters of each onset, simplest first.  ratio is the smaller slope over the larger; span
# is v - e0; toe is w/span, at most 0.9, since the line between toe and kink gives its slope.
ONSETS = {
    "none": ("larger", "ratio", "span"),
    "slack": ("larger", "ratio", "span", "onset"),
    "slack and toe": ("larger", "ratio", "span", "onset", "toe"),
}
PARAMETERS = ONSETS["slack and toe"]
# Their values where they are not free: a ratio of 1 and a span of twice the record are one line.
_FIXED = np.array([1.0, 1.0, 2.0, 0.0, 0.0])
_LOWER = np.array([0.0, 0.0, 1e-6, -1.0, 1e-6])
_UPPER = np.array([np.inf, 1.0, 2.0, 1.0, 0.9])
# Two residuals below this part of the largest force are equal, whatever their ratio.
_EXACT = 1e-10
# Nearer than this to a bound a parameter counts as being at it.
_AT_BOUND = 1e-5
# Smallest singular value, of a Jacobian of unit columns, that determines the parameters.
_DETERMINED = 1e-8


@dataclass(frozen=True, eq=False)
class Fit:
    """A least-squares solution; all in the units of the record (strain, N).

    natural: a, b, v, e0, w.  covariance: of ``constants``, (5, 5).  at_bound: those of PARAMETERS
    that were found at a bound or that the record does not determine: without an interval.
    fitted: F at the points (N), (n,).  criterion: Bayesian information criterion of this fit;
    criterion_straight: of the best single line with the same onset.
    """

    onset: str
    natural: np.ndarray
    covariance: np.ndarray
    at_bound: tuple[str, ...]
    fitted: np.ndarray
    criterion: float
    criterion_straight: float
    degrees_of_freedom: int

    @property
    def constants(self):
        """k_first, k_second (N), kink, slack, toe half-width, in the strain of the yarn."""
        a, b, v, e0, w = self.natural
        stretch = 1 + e0
        return np.array([a * stretch, b * stretch, (v - e0) / stretch, e0, w / stretch])


def ramp(strain, onset, half_width):
    """Strain taken up beyond the onset, with a quadratic toe; arrays broadcast."""
    u = strain - onset
    # Without a toe the width only has to be no zero divisor.
    width = np.where(half_width > 0, half_width, 1.0)
    toe = (u + width) ** 2 / (4 * width)
    return np.where(u >= half_width, u, np.where(u <= -half_width, 0.0, toe))


def model(strain, natural):
    """Force F(e) of the module's text at the recorded strain, (n,)."""
    a, b, v, e0, w = natural
    return a * ramp(np.minimum(strain, v), e0, w) + b * np.maximum(strain - v, 0)


def _natural_jacobian(strain, natural):
    """dF/d(a, b, v, e0, w), (n, 5)."""
    a, b, v, e0, w = natural
    above = strain > v
    u = np.minimum(strain, v) - e0
    in_toe = np.abs(u) < w
    width = w if w > 0 else 1.0
    slope = np.where(in_toe, (u + w) / (2 * width), (u > 0).astype(float))
    return np.column_stack(
        [
            ramp(np.minimum(strain, v), e0, w),
            np.maximum(strain - v, 0),
            np.where(above, a - b, 0.0),
            -a * slope,
            a * np.where(in_toe, (width**2 - u**2) / (4 * width**2), 0.0),
        ]
    )


def _to_natural(p, falling):
    """a, b, v, e0, w from larger, ratio, span, onset, toe; and the Jacobian of this, (5, 5)."""
    larger, ratio, span, onset, toe = p
    jacobian = np.zeros((5, 5))
    big, small = (0, 1) if falling else (1, 0)
    natural = np.zeros(5)
    natural[big], natural[small] = larger, ratio * larger
    natural[2:] = onset + span, onset, toe * span
    jacobian[big, 0] = 1.0
    jacobian[small, :2] = ratio, larger
    jacobian[2, 2:4] = 1.0
    jacobian[3, 3] = 1.0
    jacobian[4, 2], jacobian[4, 4] = toe, span
    return natural, jacobian


def _project(e, f, falling, kinks, onset, toe):
    """Best of ``kinks`` at one onset and toe by variable projection: (squares, parameters).

    The slopes follow from the 2 x 2 normal equations, their ratio kept within its bounds.
    """
    v = kinks[kinks > onset + 0.01]
    if v.size == 0:
        return np.inf, None
    g = ramp(np.minimum(e, v[:, None]), onset, toe * (v[:, None] - onset))
    h = np.maximum(e - v[:, None], 0)
    gg, hh, gh = (g * g).sum(1), (h * h).sum(1), (g * h).sum(1)
    fg, fh = g @ f, h @ f
    # Both slopes times the determinant, which is positive.
    a, b = fg * hh - fh * gh, fh * gg - fg * gh
    large, small = (a, b) if falling else (b, a)
    ratio = np.clip(np.where(large > 0, small / np.where(large > 0, large, 1), 1), 0, 1)
    one, two = (1, ratio) if falling else (ratio, 1)
    fs = one * fg + two * fh
    ss = one**2 * gg + 2 * one * two * gh + two**2 * hh
    slope = np.maximum(fs / np.maximum(ss, 1e-300), 1e-6)
    squares = f @ f - 2 * slope * fs + slope**2 * ss
    i = int(np.argmin(squares))
    return squares[i], np.array([slope[i], ratio[i], v[i] - onset, onset, toe])


def _scan(strain, force, falling, onset):
    """Starting values (larger, ratio, span, onset, toe), one for each of a few toes."""
    every = max(1, strain.size // 250)
    e, f = strain[::every], force[::every]
    kinks = np.unique(np.quantile(e, np.linspace(0.02, 0.98, 49)))
    onsets = np.linspace(-0.3, 0.7, 21) if onset != "none" else np.zeros(1)
    toes = (0.15, 0.45, 0.9) if onset == "slack and toe" else (0.0,)
    for toe in toes:
        found = [_project(e, f, falling, kinks, e0, toe) for e0 in onsets]
        yield min(found, key=lambda one: one[0])[1]


def _descend(strain, force, falling, onset, start):
    """Least squares from one start: (parameters, squares).

    The sum of squares has a crease wherever a kink passes a point of the record, at which a method
    of gradients stops.  So a shrinking grid searches around its solution, and it starts again.
    """
    free = np.arange(len(ONSETS[onset]))
    p, squares = _solve(strain, force, falling, free, start)
    if squares <= strain.size * _EXACT**2:
        return p, squares
    first, lowest, best = squares, squares, p
    radius = 3 * (strain[-1] - strain[0]) / strain.size
    while radius > 1e-6:
        around = np.linspace(-radius, radius, 9)
        kinks = best[3] + best[2] + around
        onsets = best[3] + around if onset != "none" else np.zeros(1)
        near = [_project(strain, force, falling, kinks, e0, best[4]) for e0 in onsets]
        lower, candidate = min(near, key=lambda one: one[0])
        if lower < lowest:
            lowest, best = lower, candidate
        radius /= 3
    if lowest < first * (1 - 1e-9):
        again, lower = _solve(strain, force, falling, free, best)
        return (again, lower) if lower < lowest else (best, lowest)
    return p, squares


def _solve(strain, force, falling, free, start):
    """Bounded least squares from one start; ``free``: indices into PARAMETERS."""

    def full(x):
        p = _FIXED.copy()
        p[free] = x
        return p

    def residuals(x):
        return model(strain, _to_natural(full(x), falling)[0]) - force

    def jacobian(x):
        natural, chain = _to_natural(full(x), falling)
        return (_natural_jacobian(strain, natural) @ chain)[:, free]

    lower, upper = _LOWER[free], _UPPER[free]
    x0 = np.clip(start[free], lower + 1e-9, upper - 1e-9)
    found = optimize.least_squares(
        residuals, x0, jacobian, (lower, upper), xtol=1e-9, ftol=1e-9, gtol=1e-15, max_nfev=60
    )
    return full(found.x), 2 * found.cost


def _criterion(squares, points, parameters):
    """Bayesian information criterion; a misfit below rounding is as good as none."""
    variance = max(squares / points, _EXACT**2)
    return points * np.log(variance) + parameters * np.log(points)


def _enough_points(strain, natural):
    """Whether each of the two lines carries three points, and one of the first is off its toe."""
    _, _, v, e0, w = natural
    first = strain[(strain > e0 - w) & (strain <= v)]
    return first.size >= 3 and first[-1] >= e0 + w and (strain > v).sum() >= 3


def _straight(strain, force, onset, falling):
    """Smallest sum of squares of a single line with the same onset, and its parameter count."""
    free = np.array([0, *range(3, len(ONSETS[onset]))])
    upper = force > 0.3
    slope, intercept = np.polyfit(strain[upper], force[upper], 1) if upper.sum() > 1 else (1.0, 0.0)
    slope = max(slope, 1e-3)
    start = np.array([slope, 1.0, 2.0, np.clip(-intercept / slope, -0.9, 0.9), 0.0])
    squares = []
    for toe in (0.02, 0.15):
        start[4] = toe
        squares.append(_solve(strain, force, falling, free, start)[1])
    return min(squares), free.size


def fit(strain, force, falling, onset):
    """Least squares with one onset (a key of ONSETS); None without three points on both lines.

    strain, force: (n,), rising strain and a positive largest force.  falling: the second line is
    the flatter one (a >= b), or else the steeper one.
    """
    width, height = strain[-1], force.max()
    e, f = strain / width, force / height
    free = np.arange(len(ONSETS[onset]))
    solutions = []
    for start in _scan(e, f, falling, onset):
        p, squares = _descend(e, f, falling, onset, start)
        if _enough_points(e, _to_natural(p, falling)[0]):
            solutions.append((squares, tuple(p)))
    if not solutions:
        return None
    squares, p = min(solutions)
    p = np.array(p)
    natural, chain = _to_natural(p, falling)
    jacobian = _natural_jacobian(e, natural) @ chain
    scale = np.linalg.norm(jacobian, axis=0)
    # A parameter at a bound, or one that no point of the record feels, has no interval.
    near = (np.minimum(p - _LOWER, _UPPER - p) < _AT_BOUND) | (scale == 0)
    inner, near = free[~near[free]], free[near[free]]
    freedom = e.size - inner.size
    # Root of the inverse of J^T J from the singular values.
    _, values, right = np.linalg.svd(jacobian[:, inner] / scale[inner], full_matrices=False)
    if values[-1] < _DETERMINED:
        near = free
    root = right.T / np.maximum(values, _DETERMINED) / scale[inner, None]
    scaling = np.array([height / width, height / width, width, width, width])
    natural = natural * scaling
    spread = _constants_jacobian(natural) @ (scaling[:, None] * chain[:, inner]) @ root
    straight, parameters = _straight(e, f, onset, falling)
    return Fit(
        onset,
        natural,
        spread @ spread.T * (squares / freedom),
        tuple(PARAMETERS[i] for i in near),
        model(strain, natural),
        _criterion(squares, e.size, free.size),
        _criterion(straight, e.size, parameters),
        freedom,
    )


def _constants_jacobian(natural):
    """d(k_first, k_second, kink, slack, toe)/d(a, b, v, e0, w), (5, 5): see Fit.constants."""
    a, b, v, e0, w = natural
    stretch = 1 + e0
    jacobian = np.diag([stretch, stretch, 1 / stretch, 1.0, 1 / stretch])
    jacobian[:, 3] += [a, b, -1 / stretch - (v - e0) / stretch**2, 0.0, -w / stretch**2]
    return jacobian


def fits(strain, force, falling, onsets=tuple(ONSETS)):
    """The fits of all ``onsets`` that have one, best criterion first, the simplest among equals."""
    found = [fit(strain, force, falling, onset) for onset in onsets]
    return sorted((one for one in found if one is not None), key=lambda one: one.criterion)


def half_width(found, gradient, level=0.95):
    """Half the confidence interval of a function of a Fit's constants, from its gradient (5,)."""
    quantile = special.stdtrit(found.degrees_of_freedom, 0.5 + level / 2)
    return float(quantile * np.sqrt(max(gradient @ found.covariance @ gradient, 0.0)))

"""Exact and converged answers for planar, inextensible elastic rods, in dimensionless form.

Lengths are in rod lengths L, forces in EI/L^2, couples in EI/L, energies in EI/L, angles in rad.
theta(s) is the angle of the tangent, EI theta' the bending moment.  Accuracy: about 1e-12 relative,
also for loads so small that the displacements are tiny.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipkm1, elliprd, elliprf

from knitsim.errors import ComputationError, InputError, number

_ROOT = {"xtol": 1e-300, "rtol": 4.0 * np.finfo(float).eps, "maxiter": 500}
# Two resolutions must agree to this; the finer, which is returned, is then better by far.
_AGREE_QUADRATURE = 1e-12
_AGREE_COLLOCATION = 1e-11  # round-off alone reaches 1e-12 at loads of 1e5

_LEAST_BUCKLING = 0.25 * math.pi**2  # thrust that buckles a cantilever, EI/L^2
MOST_LOAD = math.nextafter(1e5, math.inf)  # of any load on a rod (EI/L^2): up to 1e5

# ---- the dead tip load: elliptic integrals ----


@dataclass(frozen=True)
class TipLoad:
    """A cantilever under a dead tip load across it: tip deflection and shortening (of the tip's
    distance from the clamp's plane, both over L), tip angle (rad), root moment (EI/L)."""

    deflection: float
    shortening: float
    tip_angle: float
    root_moment: float


@lru_cache(maxsize=32)
def _gauss(count):
    """Gauss-Legendre nodes and weights on [0, 1]."""
    node, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (node + 1.0), 0.5 * weight


def _tip_integrals(w_end, panels_per_unit=1.0):
    """sqrt(P), sqrt(P) deflection and sqrt(P) shortening at the parameter ``w_end``.

    With sin(theta) = sigma (1 - v^2), sigma = sin(tip angle) = tanh^2 W and v = sinh w/sinh W, the
    first integral theta'^2 = 2 P (sin(tip angle) - sin theta) of theta'' = -P cos(theta) becomes
    sqrt(P) ds = sqrt(2) dw / sqrt(1 + sigma (1 - v^2)): smooth for every load, nothing cancels.
    These are the elliptic integrals of Bisshopp and Drucker with modulus^2 = (1 + sigma)/2.
    """
    node, weight = _gauss(24)
    panels = max(1, math.ceil(w_end * panels_per_unit))
    w = (np.arange(panels)[:, None] + node) * (w_end / panels)
    # sinh w/sinh W and cosh w/cosh W without overflow.
    decay = np.exp(w - w_end)
    v = decay * np.expm1(-2.0 * w) / math.expm1(-2.0 * w_end)
    cosh_ratio = decay * (1.0 + np.exp(-2.0 * w)) / (1.0 + math.exp(-2.0 * w_end))
    sine = math.tanh(w_end) ** 2 * (1.0 - v) * (1.0 + v)
    cosine = cosh_ratio * np.sqrt(1.0 + sine)
    ds = math.sqrt(2.0) / np.sqrt(1.0 + sine) * weight * (w_end / panels)
    return float(ds.sum()), float((ds * sine).sum()), float((ds * sine**2 / (1.0 + cosine)).sum())


def tip_load(load):
    """A cantilever, clamped along x, with the dead load P L^2/EI = ``load`` across it at its tip.

    The branch that grows from the straight rod.  K. E. Bisshopp and D. C. Drucker, Q. Appl. Math. 3
    (1945) 272: sqrt(P) = K(k) - F(k, phi_1), deflection/L = 1 - 2 (E(k) - E(k, phi_1))/sqrt(P),
    k^2 = (1 + sin(tip angle))/2, k sin(phi_1) = 1/sqrt(2).  Returns a :class:`TipLoad`; raises
    InputError unless 0 <= load <= 1e8.
    """
    load = number("load", load, 0.0, math.nextafter(1e8, math.inf), low_allowed=True)
    if load == 0.0:
        return TipLoad(0.0, 0.0, 0.0, 0.0)
    root = math.sqrt(load)
    # sqrt(P) lies between W and sqrt(2) W; the margin covers round-off.
    low, high = root / math.sqrt(2.0) * (1.0 - 1e-12), root * (1.0 + 1e-12)
    w_end = brentq(lambda w: _tip_integrals(w)[0] - root, low, high, **_ROOT)
    found, finer = np.array(_tip_integrals(w_end)), np.array(_tip_integrals(w_end, 2.0))
    if not np.all(np.abs(found - finer) <= _AGREE_QUADRATURE * np.abs(finer)):
        raise ComputationError(f"tip load {load:g}: quadrature at two resolutions disagrees")
    tanh, sech = math.tanh(w_end), 2.0 * math.exp(-w_end) / (1.0 + math.exp(-2.0 * w_end))
    return TipLoad(
        deflection=float(finer[1]) / root,
        shortening=float(finer[2]) / root,
        tip_angle=math.atan2(tanh**2, math.sqrt(1.0 + tanh**2) * sech),
        root_moment=root * math.sqrt(2.0) * tanh,
    )


# ---- a clamped rod under any dead load: collocation ----


@dataclass(frozen=True)
class ClampedRod:
    """A rod clamped at the origin: its shape and reactions, dimensionless.

    arc (n,), angle (n,), points (n, 2): the centre line at Gauss nodes of the arc length; tip (2,);
    displacement (2,): of the tip from the rest shape, free of cancellation; tip_angle; root_moment;
    energy: stored in bending; error: largest change of these at the last doubling of the nodes,
    over the largest displacement.
    """

    arc: np.ndarray
    angle: np.ndarray
    points: np.ndarray
    tip: np.ndarray
    displacement: np.ndarray
    tip_angle: float
    root_moment: float
    energy: float
    error: float


@lru_cache(maxsize=8)
def _line(count):
    """Gauss nodes and weights on [0, 1], the matrix that integrates from 0, and the matrix that
    turns u = theta'' into theta for theta(0) = 0, theta'(1) = 0."""
    node, weight = np.polynomial.legendre.leggauss(count)
    # Discrete Legendre coefficients of nodal values, exact up to degree count - 1 ...
    values = np.polynomial.legendre.legvander(node, count)
    coefficients = (np.arange(count)[:, None] + 0.5) * values[:, :count].T * weight
    # ... and the integral of each polynomial from -1: (P_(k+1) - P_(k-1))/(2k + 1), P_0: x + 1.
    k = np.arange(1, count)
    antiderivative = np.empty((count, count))
    antiderivative[:, 0] = node + 1.0
    antiderivative[:, 1:] = (values[:, 2:] - values[:, :-2]) / (2 * k + 1)
    integrate = 0.5 * antiderivative @ coefficients
    s, w = 0.5 * (node + 1.0), 0.5 * weight
    to_angle = -integrate @ (w - integrate)
    for array in (s, w, integrate, to_angle):
        array.setflags(write=False)
    return s, w, integrate, to_angle


def _newton(count, rest, force, weight, couple, second):
    """theta'' at the nodes in equilibrium, from the guess ``second``; None if not converged."""
    s, _, _, to_angle = _line(count)
    fx = force[0] + weight[0] * (1.0 - s)
    fy = force[1] + weight[1] * (1.0 - s)
    last = math.inf
    for _ in range(25):
        angle = rest + couple * s + to_angle @ second
        sine, cosine = np.sin(angle), np.cos(angle)
        residual = second - fx * sine + fy * cosine
        jacobian = np.eye(count) - (fx * cosine + fy * sine)[:, None] * to_angle
        try:
            step = np.linalg.solve(jacobian, residual)
        except np.linalg.LinAlgError:
            return None
        second = second - step
        change = np.abs(step).max()
        # Quadratic convergence: a step of 1e-9 leaves nothing but round-off.
        if change <= 1e-9 * np.abs(second).max():
            return second
        # A step this far from the end of the branch may land on another one.
        if not change <= 0.25 * last:
            return None
        last = change
    return None


def _stable(count, angle, force, weight):
    """Whether the energy's second variation is positive: int phi'^2 + (F . t) phi^2 ds."""
    s, _, _, to_angle = _line(count)
    axial = (force[0] + weight[0] * (1.0 - s)) * np.cos(angle)
    axial = axial + (force[1] + weight[1] * (1.0 - s)) * np.sin(angle)
    if np.all(axial > -_LEAST_BUCKLING):
        return True
    # to_angle is minus a positive operator, so these eigenvalues are real but for round-off.
    return bool(np.linalg.eigvals(np.eye(count) - axial[:, None] * to_angle).real.min() > 0.0)


def _follow(count, rest, force, weight, couple):
    """theta'' on the stable branch that grows from the unloaded rod, and whether it is unstable
    just beyond.  Loads are raised in steps that turn no section by more than half a radian.
    theta'' is None if no step is small enough."""
    s, _, _, to_angle = _line(count)
    size = max(np.abs(force).max(), np.abs(weight).max(), abs(couple))
    done, second, before = 0.0, np.zeros(count), np.zeros(count)
    step = min(1.0, 1.0 / size) if size else 1.0
    least = 1e-7 * step
    while done < 1.0:
        target = min(1.0, done + step)
        loads = [target * part for part in (force, weight, couple)]
        found = _newton(count, rest, *loads, second * (target / done if done else 1.0))
        unstable = False
        if found is not None:
            turned = couple * target * s + to_angle @ found
            unstable = not _stable(count, rest + turned, loads[0], loads[1])
            if not unstable and np.abs(turned - before).max() <= 0.5:
                done, second, before = target, found, turned
                step *= 2.0
                continue
        step *= 0.5
        if step < least:
            return None, unstable
    return second, False


def _refine(count, before, rest, force, weight, couple):
    """theta'' with more nodes, from that of the resolution before (interpolated); None if there is
    none or it does not lead to a stable state nearby."""
    if before is None:
        return None
    coarse, rod = before
    node = 2.0 * rod.arc - 1.0
    fit = np.linalg.solve(np.polynomial.legendre.legvander(node, node.size - 1), coarse)
    s, _, _, to_angle = _line(count)
    guess = np.polynomial.legendre.legval(2.0 * s - 1.0, fit)
    second = _newton(count, rest, force, weight, couple, guess)
    if second is None or np.abs(to_angle @ (second - guess)).max() > 0.1:
        return None
    turned = couple * s + to_angle @ second
    return second if _stable(count, rest + turned, force, weight) else None


def _describe(count, rest_angle, rest, couple, second):
    s, w, integrate, to_angle = _line(count)
    turned = couple * s + to_angle @ second
    angle, mean = rest + turned, rest + 0.5 * turned
    half_sine = 2.0 * np.sin(0.5 * turned)
    bent = couple - (w - integrate) @ second  # theta' - theta_0'
    return ClampedRod(
        arc=s,
        angle=angle,
        points=np.column_stack([integrate @ np.cos(angle), integrate @ np.sin(angle)]),
        tip=np.array([w @ np.cos(angle), w @ np.sin(angle)]),
        displacement=np.array([-w @ (half_sine * np.sin(mean)), w @ (half_sine * np.cos(mean))]),
        tip_angle=float(rest_angle(np.ones(1))[0] + couple - w @ (s * second)),
        root_moment=float(couple - w @ second),
        energy=float(0.5 * w @ bent**2),
        error=math.inf,
    )


def _straight(s):
    return np.zeros_like(s)


def clamped_rod(force=(0.0, 0.0), weight=(0.0, 0.0), couple=0.0, rest_angle=None):
    """A rod clamped in its rest direction under dead loads at its tip and along it, and a couple.

    The clamp is at s = 0, the origin.  force (2,): at the tip (EI/L^2); weight (2,): the load per
    length, times L (EI/L^2); couple: at the tip (EI/L).  rest_angle: the tangent's angle theta_0 at
    rest, a smooth function of s in [0, 1] (array to array); a straight rod along x by default.

    Solves theta'' - theta_0'' = F_x sin(theta) - F_y cos(theta), F = force + weight (1 - s), with
    theta(0) = theta_0(0) and theta'(1) - theta_0'(1) = couple, by Legendre collocation of theta''
    (well conditioned, spectral), nodes doubled until the result stands to 1e-11.  The branch is the
    one that grows from the rest shape as all loads grow together, stable all the way: a load that
    buckles the rod needs a small one across it.  Returns a :class:`ClampedRod`.

    Raises InputError for loads beyond 1e5, ComputationError if 512 nodes are not enough or if the
    branch ends (snaps, or bifurcates) below the loads.
    """
    force = np.array([number("force", part, -MOST_LOAD, MOST_LOAD) for part in force])
    weight = np.array([number("weight", part, -MOST_LOAD, MOST_LOAD) for part in weight])
    couple = number("couple", couple, -MOST_LOAD, MOST_LOAD)
    rest_angle = _straight if rest_angle is None else rest_angle
    what = f"clamped rod under force {force}, weight {weight}, couple {couple:g}"
    before = None
    for count in (32, 64, 128, 256, 512):
        s = _line(count)[0]
        rest = np.asarray(rest_angle(s), dtype=float)
        if rest.shape != s.shape or not np.all(np.isfinite(rest)):
            raise InputError("rest_angle", None, "must return one finite angle for each s")
        second, unstable = _refine(count, before, rest, force, weight, couple), False
        if second is None:
            second, unstable = _follow(count, rest, force, weight, couple)
        if unstable and count >= 64:
            raise ComputationError(f"{what}: the branch from rest loses its stability on the way")
        if second is None:
            before = None
            continue
        rod = _describe(count, rest_angle, rest, couple, second)
        if before is not None:
            error = _change(before[1], rod)
            if error <= _AGREE_COLLOCATION:
                return replace(rod, error=error)
        before = second, rod
    raise ComputationError(f"{what}: not resolved with 512 nodes")


def _change(coarse, fine):
    scale = np.abs(fine.displacement).max()
    moved = np.abs(fine.displacement - coarse.displacement).max() / (scale or 1.0)
    # A curved rest shape must be resolved even where no load moves it.
    moved = max(moved, np.abs(fine.tip - coarse.tip).max())
    stored = abs(fine.energy - coarse.energy) / (fine.energy or 1.0)
    moment = abs(fine.root_moment - coarse.root_moment) / (abs(fine.root_moment) or 1.0)
    # A moment or an angle that is zero by symmetry is judged by the energy's scale.
    moment = min(moment, abs(fine.root_moment - coarse.root_moment) / (fine.energy**0.5 or 1.0))
    return float(max(moved, stored, moment, abs(fine.tip_angle - coarse.tip_angle)))


@dataclass(frozen=True)
class OwnWeight:
    """A horizontal cantilever under its own weight: drop H and reach W of its tip (over L), their
    ratio H/W, tip angle below the horizontal (rad) and estimated relative error."""

    height: float
    width: float
    ratio: float
    tip_angle: float
    error: float


def own_weight(load):
    """A cantilever, clamped horizontally, bent by its own weight: the master curve.

    load: Gamma = (weight per length) L^3/EI.  theta'' = -Gamma (1 - s) cos(theta), theta measured
    downwards, theta(0) = 0 = theta'(1); H = the tip's depth below the clamp, W = its horizontal
    distance from it.  H/W against Gamma is the master curve of the cantilever test of V. Romero et
    al., ACM Trans. Graph. 40(4) (2021) 61.  For a yarn the weight per length is mu g, EI = B.
    Returns an :class:`OwnWeight`; raises InputError unless 0 <= load <= 1e5.
    """
    load = number("load", load, 0.0, MOST_LOAD, low_allowed=True)
    rod = clamped_rod(weight=(0.0, -load))
    height, width = -float(rod.displacement[1]), float(rod.tip[0])
    # rod.error is relative to the displacement, most of which is H; W may be far smaller.
    error = rod.error * max(1.0, float(np.abs(rod.displacement).max()) / width)
    return OwnWeight(height, width, height / width, -rod.tip_angle, error)


# ---- closed forms ----


def roll_up(turn):
    """Tip (x, y) over L of a straight cantilever bent by an end couple to kappa L = ``turn`` (rad).

    M = EI kappa; the rod is an arc, x = sin(turn)/turn, y = (1 - cos(turn))/turn; a full circle at
    turn = 2 pi.  Any shape; returns (..., 2).
    """
    turn = np.asarray(turn, dtype=float)
    if not np.all(np.isfinite(turn)):
        raise InputError("turn", turn.tolist(), "must be finite")
    half = 0.5 * turn
    half_sinc = np.sinc(half / math.pi)
    return np.stack([half_sinc * np.cos(half), half_sinc * np.sin(half)], axis=-1)


@dataclass(frozen=True)
class Strut:
    """A strut pulled together: load (EI/L^2), mid deflection (over L), the largest angle between
    its tangent and the line of its ends (rad)."""

    load: float
    mid_deflection: float
    largest_angle: float


def strut(distance, ends="hinged"):
    """A straight strut whose ends are pulled together to ``distance`` (over L), first mode.

    Hinged: P = 4 K^2, distance = 2 E/K - 1, deflection k/K, k = sin(largest angle/2) (Love, A
    Treatise on the Mathematical Theory of Elasticity, 4th ed., art. 262-263).  ``clamped``: both
    ends held parallel to the line of the ends; it consists of a hinged strut of half the length and
    two halves of another, so P = 16 K^2 and the same deflection over L.  Below distance 0 the ends
    have passed each other.
    Raises InputError unless -0.99 < distance < 1 and ends is ``hinged`` or ``clamped``.
    """
    distance = number("distance", distance, -0.99, 1.0)
    if ends not in ("hinged", "clamped"):
        raise InputError("ends", repr(ends), "must be hinged or clamped")
    closed = 1.0 - distance

    def excess(w):
        # k = tanh w; (K - E)/K = (m/3) R_D(0, 1 - m, 1)/K, which does not cancel at small m.
        m, complement = math.tanh(w) ** 2, 1.0 / math.cosh(w) ** 2
        return (
            2.0 / 3.0 * m * elliprd(0.0, complement, 1.0) / elliprf(0.0, complement, 1.0) - closed
        )

    # m/2 <= (K - E)/K <= m and K >= w + log 2 bracket the root.
    low = math.atanh(math.sqrt(0.5 * closed)) * (1.0 - 1e-9)
    w = brentq(excess, low, max(2.0 * low, math.pi / (2.0 - closed)), **_ROOT)
    k, complete = math.tanh(w), float(ellipkm1(1.0 / math.cosh(w) ** 2))
    load = (4.0 if ends == "hinged" else 16.0) * complete**2
    return Strut(load, k / complete, 2.0 * math.atan(math.sinh(w)))

"""Contact between yarns: pair search, contact laws, energy with exact derivatives (compiled).

Contact is an energy v(D) per length squared of unordered pairs of points, D the distance of the
centre lines, integrated by points of equal arc length.  A pair (i, k, g) is own point i against the
image of own point k under operation g.  Each unordered pair is visited once: i < k with every g;
i = k with one of g and its inverse, at half weight where g is its own inverse.
"""

import math

import numpy as np

from knitsim.jit import njit

CHUNK = 8  # points per bounding box of the pair search


@njit
def law_at(square, law):
    """Energy v (N/m) and its first two derivatives by the squared distance; inside a core: inf.

    law as in :class:`knitsim.equilibrium.scene.Scene`.  Barrier: v = K (1 - x^2)^2/x^2, x = D/d.
    Core: v = k delta^2/(p (p-1)) [z^(1-p) - 1 - (p-1)(1-z)], z = (D - core)/delta, delta = d - core.
    """
    d2 = law[2] * law[2]
    if square >= d2:
        return 0.0, 0.0, 0.0
    if law[0] == 0.0:
        s = square / d2
        i = 1.0 / s
        return law[1] * (i - 2.0 + s), law[1] * (1.0 - i * i) / d2, 2.0 * law[1] * i**3 / (d2 * d2)
    distance = math.sqrt(square)
    if distance <= law[3]:
        return math.inf, 0.0, 0.0
    delta, p = law[2] - law[3], law[5]
    z = (distance - law[3]) / delta
    power = z ** (-p)
    v = law[4] * delta**2 / (p * (p - 1)) * (z * power - 1.0 - (p - 1) * (1.0 - z))
    by_d = law[4] * delta / p * (1.0 - power)
    by_dd = law[4] * power / z
    # d/d(D^2) = (1/2D) d/dD
    first = 0.5 * by_d / distance
    return v, first, 0.25 * (by_dd - by_d / distance) / square


@njit
def place_points(touch, x, points):
    """Fill points (m, 3) with the positions of the contact points."""
    for i in range(touch.points.size):
        f, basis = touch.points[i].first, touch.points[i].basis
        for axis in range(3):
            points[i, axis] = (
                basis[0] * x[f, axis]
                + basis[1] * x[f + 1, axis]
                + basis[2] * x[f + 2, axis]
                + basis[3] * x[f + 3, axis]
            )


@njit
def boxes_of(points, size, low, high):
    """Fill low, high (chunks, 3) with the bounds of runs of ``size`` points."""
    for c in range(low.shape[0]):
        for axis in range(3):
            lo = hi = points[c * size, axis]
            for i in range(c * size + 1, min(points.shape[0], (c + 1) * size)):
                lo = min(lo, points[i, axis])
                hi = max(hi, points[i, axis])
            low[c, axis] = lo
            high[c, axis] = hi


@njit
def image_is_far(sign, shift, low, high, own_low, own_high, reach):
    """Whether the image of the box (low, high) is further than ``reach`` from the own box."""
    for axis in range(3):
        a = sign[axis] * low[axis] + shift[axis]
        b = sign[axis] * high[axis] + shift[axis]
        if min(a, b) - own_high[axis] > reach or own_low[axis] - max(a, b) > reach:
            return True
    return False


@njit
def find_pairs(touch, points, lattice, reach):
    """All pairs closer than ``reach`` (m): pairs (n, 3) of i, k, g and their weights (n,).

    Bounding boxes of runs of CHUNK points are compared first.
    """
    m = points.shape[0]
    chunks = (m + CHUNK - 1) // CHUNK
    low, high = np.empty((chunks, 3)), np.empty((chunks, 3))
    boxes_of(points, np.int64(CHUNK), low, high)
    whole_low, whole_high = np.empty((1, 3)), np.empty((1, 3))
    boxes_of(points, m, whole_low, whole_high)
    # Local names: a tuple of arrays is slow to pass around in the inner loops.
    arc, yarn, length = touch.points.arc, touch.points.yarn, touch.points.length
    copies, exclude, square = touch.copies, touch.exclude, reach * reach
    pairs = np.empty((256, 3), dtype=np.int64)
    weight = np.empty(256)
    count = 0
    for g in range(touch.images.size):
        image = touch.images[g]
        s0, s1, same, other = image.sign[0], image.sign[1], image.same, image.inverse
        sign = (s0, s1, image.sign[2])
        t0 = image.steps[0] * lattice[0] + image.steps[1] * lattice[2]
        t1 = image.steps[0] * lattice[1] + image.steps[1] * lattice[3]
        shift = (t0, t1, 0.0)
        arc_sign, arc_shift = image.arc_sign, image.arc_shift
        if image_is_far(
            sign, shift, whole_low[0], whole_high[0], whole_low[0], whole_high[0], reach
        ):
            continue
        for ci in range(chunks):
            for ck in range(ci, chunks):
                if image_is_far(sign, shift, low[ck], high[ck], low[ci], high[ci], reach):
                    continue
                for i in range(ci * CHUNK, min(m, (ci + 1) * CHUNK)):
                    for k in range(max(i, ck * CHUNK), min(m, (ck + 1) * CHUNK)):
                        d0 = points[i, 0] - s0 * points[k, 0] - t0
                        d1 = points[i, 1] - s1 * points[k, 1] - t1
                        d2 = points[i, 2] - sign[2] * points[k, 2]
                        if d0 * d0 + d1 * d1 + d2 * d2 >= square:
                            continue
                        if same and yarn[i] == yarn[k]:
                            if abs(arc[i] - (arc_sign * arc[k] + arc_shift)) < exclude:
                                continue
                        factor = copies
                        if i == k:
                            if other == g:
                                factor *= 0.5
                            elif g > other >= 0:
                                continue
                        if count == weight.size:
                            pairs, weight = _resized(pairs, weight, 2 * count)
                        pairs[count, 0], pairs[count, 1], pairs[count, 2] = i, k, g
                        weight[count] = factor * length[i] * length[k]
                        count += 1
    return _resized(pairs, weight, count)


@njit
def _resized(pairs, weight, size):
    """Copies with room for ``size`` pairs, as many of the old ones in them as there is room for."""
    more = np.empty((size, 3), dtype=np.int64)
    longer = np.empty(size)
    for i in range(min(size, weight.size)):
        longer[i] = weight[i]
        for axis in range(3):
            more[i, axis] = pairs[i, axis]
    return more, longer


@njit
def add_pair(touch, pair, h, half):
    """Add the Hessian of one pair's energy by its d, a symmetric 3 x 3 tuple ``h``, to ``half``.

    d = x_i - sign x_k - m1 a1 - m2 a2, so that dd/dx_k = -sign, dd/da1 = -m1, dd/da2 = -m2.
    """
    i, k, g = pair
    fi, fk = touch.points[i].first, touch.points[k].first
    n = half.shape[0] - 4
    sign, steps = touch.images[g].sign, touch.images[g].steps
    m1, m2 = steps[0], steps[1]
    s = (sign[0], sign[1], sign[2])
    for r in range(3):
        for q in range(3):
            value = h[r][q]
            mixed, other = value * s[q], s[r] * value
            for a in range(4):
                ba, ca = touch.points[i].basis[a], touch.points[k].basis[a]
                ri, rk = 3 * (fi + a) + r, 3 * (fk + a) + r
                own, image, cross = 0.5 * value * ba, 0.5 * other * s[q] * ca, mixed * ba
                for b in range(4):
                    half[ri, 3 * (fi + b) + q] += own * touch.points[i].basis[b]
                    half[rk, 3 * (fk + b) + q] += image * touch.points[k].basis[b]
                    half[ri, 3 * (fk + b) + q] -= cross * touch.points[k].basis[b]
                if q < 2:
                    half[ri, n + q] -= m1 * value * ba
                    half[ri, n + 2 + q] -= m2 * value * ba
                    half[rk, n + q] += m1 * other * ca
                    half[rk, n + 2 + q] += m2 * other * ca
            if r < 2 and q < 2:
                half[n + r, n + q] += 0.5 * m1 * m1 * value
                half[n + 2 + r, n + 2 + q] += 0.5 * m2 * m2 * value
                half[n + r, n + 2 + q] += m1 * m2 * value


@njit
def isotropic_plus(first, second, d):
    """The matrix first I + second d d^T as a tuple of rows."""
    x, y, z = second * d[0], second * d[1], second * d[2]
    return (
        (first + x * d[0], x * d[1], x * d[2]),
        (x * d[1], first + y * d[1], y * d[2]),
        (x * d[2], y * d[2], first + z * d[2]),
    )


@njit
def separation(touch, points, lattice, pair):
    """d, from the image of point k to point i (m)."""
    i, k, g = pair
    sign, steps = touch.images[g].sign, touch.images[g].steps
    m1, m2 = steps[0], steps[1]
    return (
        points[i, 0] - sign[0] * points[k, 0] - m1 * lattice[0] - m2 * lattice[2],
        points[i, 1] - sign[1] * points[k, 1] - m1 * lattice[1] - m2 * lattice[3],
        points[i, 2] - sign[2] * points[k, 2],
    )


@njit
def scatter_pair(touch, pair, force, gradient):
    """Add an energy gradient by d to the gradient by control points and lattice."""
    i, k, g = pair
    sign, steps = touch.images[g].sign, touch.images[g].steps
    s = (sign[0], sign[1], sign[2])
    fi, fk = 3 * touch.points[i].first, 3 * touch.points[k].first
    n = gradient.size - 4
    for axis in range(3):
        f, image = force[axis], s[axis] * force[axis]
        for a in range(4):
            gradient[fi + 3 * a + axis] += touch.points[i].basis[a] * f
            gradient[fk + 3 * a + axis] -= touch.points[k].basis[a] * image
        if axis < 2:
            gradient[n + axis] -= steps[0] * f
            gradient[n + 2 + axis] -= steps[1] * f


@njit
def add_contact(scene, points, lattice, pairs, order, gradient, half):
    """Contact energy (J) and the smallest squared distance of the listed pairs (m2).

    pairs: (pairs, weights).  order 1 adds to gradient, order 2 also to ``half`` (Hessian = A + A^T).
    """
    touch, law = scene.touch, scene.law
    listed, weight = pairs
    energy, closest = 0.0, math.inf
    for j in range(weight.size):
        pair = (listed[j, 0], listed[j, 1], listed[j, 2])
        d = separation(touch, points, lattice, pair)
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        closest = min(closest, square)
        v, v1, v2 = law_at(square, law)
        if v == 0.0:
            continue
        energy += weight[j] * v
        if order == 0:
            continue
        f = 2.0 * weight[j] * v1
        scatter_pair(touch, pair, (f * d[0], f * d[1], f * d[2]), gradient)
        if order == 2:
            add_pair(touch, pair, isotropic_plus(f, 4.0 * weight[j] * v2, d), half)
    return energy, closest

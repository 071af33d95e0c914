"""Contact between yarns: the laws, and their energy with exact derivatives (compiled).

Contact is an energy v(D) per length squared of unordered pairs of points, D the distance of the
centre lines, integrated by points of equal arc length.
"""

import math

import numpy as np

from knitsim.equilibrium.contact import CORE
from knitsim.equilibrium.kernels.mean import THIN, mean_at
from knitsim.equilibrium.kernels.pairs import touching
from knitsim.equilibrium.kernels.records import LATTICE
from knitsim.jit import choose, leaf, njit


@leaf
def barrier_at(square, law):
    """Energy v (J/m2) and its first two derivatives by the squared distance: K (1 - x^2)^2/x^2."""
    d2 = law.diameter * law.diameter
    if square >= d2:
        return 0.0, 0.0, 0.0
    # By the gap, not by differences of large numbers: a hard contact is pressed by next to nothing.
    s, stiffness = square / d2, law.stiffness
    i, gap = 1.0 / s, 1.0 - s
    first, second = -stiffness * gap * (1.0 + s) * i * i / d2, 2.0 * stiffness * i**3 / (d2 * d2)
    return stiffness * gap * gap * i, first, second


@leaf
def soft_at(square, law):
    """As :func:`barrier_at`, of a core law or a tabulated one; inside a core: inf."""
    if square >= law.diameter * law.diameter:
        return 0.0, 0.0, 0.0
    distance = math.sqrt(square)
    if distance <= law.core:
        return math.inf, 0.0, 0.0
    delta = law.diameter - law.core
    z = (distance - law.core) / delta
    if law.soft[0] == CORE:
        k, p = law.stiffness, law.soft[1]
        t = (law.diameter - distance) / delta
        more = math.expm1(-p * math.log1p(-t))  # z^-p - 1
        v = k * delta**2 / (p * (p - 1)) * (more - p * t - t * more)
        by_d = -k * delta / p * more
        by_dd = k * (1.0 + more) / z
    else:
        v, by_d, by_dd = table_at(z, law.soft)
        by_d, by_dd = by_d / delta, by_dd / (delta * delta)
    # d/d(D^2) = (1/2D) d/dD
    return v, 0.5 * by_d / distance, 0.25 * (by_dd - by_d / distance) / square


law_at = choose("law.soft", soft_at, barrier_at)


@leaf
def table_at(z, table):
    """Energy and its first two derivatives by the gap z of a tabulated law; below the table: inf."""
    j = int(-math.log(z) / table[1])
    if 2 + 8 * j >= table.size:
        return math.inf, 0.0, 0.0
    low, high = math.exp(-(j + 1) * table[1]), math.exp(-j * table[1])
    h = high - low
    u, v, first, second = (z - low) / h, 0.0, 0.0, 0.0
    for k in range(5, -1, -1):
        second = second * u + 2.0 * first
        first = first * u + v
        v = v * u + table[2 + 8 * j + k]
    return v, first / h, second / (h * h)


@leaf
def isotropic_plus(first, second, d):
    """The matrix first I + second d d^T as a tuple of rows."""
    x, y, z = second * d[0], second * d[1], second * d[2]
    return (
        (first + x * d[0], x * d[1], x * d[2]),
        (x * d[1], first + y * d[1], y * d[2]),
        (x * d[2], y * d[2], first + z * d[2]),
    )


@leaf
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
def add_pushes(touch, near, push, order, gradient, half):
    """Add energies of pairs, given by their d, to the gradient and Hessian by points and lattice.

    near (n, 3): i, k, g; push (n, 9): of each pair the gradient by d and the Hessian xx, xy, xz, yy,
    yz, zz.  d = x_i - sign x_k - m1 a1 - m2 a2, so that dd/dx_k = -sign, dd/da1 = -m1, dd/da2 = -m2.
    order as in ``add_flat_contact``.  Sums by contact point come first, the basis of the spline last.
    """
    m = touch.points.size
    add_forces(touch, near, push, np.zeros((m, 3)), gradient)
    if order == 2:
        own, mixed = np.zeros((m, 6)), np.zeros((m, 3, 4))
        add_stiffness(touch, near, push, own, mixed, (np.zeros(6), np.zeros((4, 6))), half)


@leaf
def add_forces(touch, near, push, force, gradient):
    """The gradient's part of :func:`add_pushes`; force (m, 3): zeros."""
    points, images = touch.points, touch.images
    n = gradient.size - LATTICE
    for j in range(near.shape[0]):
        i, k, g = near[j, 0], near[j, 1], near[j, 2]
        for axis in range(3):
            f = push[j, axis]
            force[i, axis] += f
            force[k, axis] -= images[g].sign[axis] * f
            if axis < 2:
                gradient[n + axis] -= images[g].steps[0] * f
                gradient[n + 2 + axis] -= images[g].steps[1] * f
    for i in range(points.size):
        row = 3 * points[i].first
        for a in range(4):
            for axis in range(3):
                gradient[row + 3 * a + axis] += points[i].basis[a] * force[i, axis]


@leaf
def add_stiffness(touch, near, push, own, mixed, run, half):
    """The Hessian's part of :func:`add_pushes`: a matrix A with Hessian = A + A^T.

    All zeros at first: by contact point, own (m, 6), Hessian by its place, packed as in push; mixed (m, 3,
    4), by its place and L; run: over a run of pairs with the same i, g and span of k the sum (6,), and the
    sum with each basis value of k (4, 6).
    """
    points, images = touch.points, touch.images
    total, cross = run
    for j in range(near.shape[0]):
        i, k, g = near[j, 0], near[j, 1], near[j, 2]
        sign, steps = images[g].sign, images[g].steps
        for e in range(6):
            h = push[j, 3 + e]
            total[e] += h
            for b in range(4):
                cross[b, e] += points[k].basis[b] * h
        s0, s1, s2 = sign[0], sign[1], sign[2]
        xx, xy, xz = push[j, 3], push[j, 4], push[j, 5]
        yy, yz, zz = push[j, 6], push[j, 7], push[j, 8]
        own[k, 0] += xx
        own[k, 1] += s0 * s1 * xy
        own[k, 2] += s0 * s2 * xz
        own[k, 3] += yy
        own[k, 4] += s1 * s2 * yz
        own[k, 5] += zz
        for c in range(2):
            m = steps[c]
            if m != 0.0:
                mixed[k, 0, 2 * c] += m * s0 * xx
                mixed[k, 0, 2 * c + 1] += m * s0 * xy
                mixed[k, 1, 2 * c] += m * s1 * xy
                mixed[k, 1, 2 * c + 1] += m * s1 * yy
                mixed[k, 2, 2 * c] += m * s2 * xz
                mixed[k, 2, 2 * c + 1] += m * s2 * yz
        after = j + 1
        if after < near.shape[0] and near[after, 0] == i and near[after, 2] == g:
            if points[near[after, 1]].first == points[k].first:
                continue
        add_run(points, i, k, images[g], total, cross, half)
        for e in range(6):
            own[i, e] += total[e]
        for c in range(2):
            m = steps[c]
            if m != 0.0:
                mixed[i, 0, 2 * c] -= m * total[0]
                mixed[i, 0, 2 * c + 1] -= m * total[1]
                mixed[i, 1, 2 * c] -= m * total[1]
                mixed[i, 1, 2 * c + 1] -= m * total[3]
                mixed[i, 2, 2 * c] -= m * total[2]
                mixed[i, 2, 2 * c + 1] -= m * total[4]
        total[:] = 0.0
        cross[:] = 0.0
    for i in range(points.size):
        if own[i, 0] != 0.0 or own[i, 3] != 0.0 or own[i, 5] != 0.0:
            add_own(points, i, own, mixed, half)


@leaf
def add_run(points, i, k, image, total, cross, half):
    """Add the Hessian between point i and the points of the span of k, and that by the lattice."""
    n = half.shape[0] - LATTICE
    row, column = 3 * points[i].first, 3 * points[k].first
    sign, steps = image.sign, image.steps
    for b in range(4):
        h = (
            (cross[b, 0] * sign[0], cross[b, 1] * sign[1], cross[b, 2] * sign[2]),
            (cross[b, 1] * sign[0], cross[b, 3] * sign[1], cross[b, 4] * sign[2]),
            (cross[b, 2] * sign[0], cross[b, 4] * sign[1], cross[b, 5] * sign[2]),
        )
        for a in range(4):
            f = points[i].basis[a]
            for r in range(3):
                for q in range(3):
                    half[row + 3 * a + r, column + 3 * b + q] -= f * h[r][q]
    for c in range(2):
        for e in range(2):
            m = 0.5 * steps[c] * steps[e]
            if m != 0.0:
                half[n + 2 * c, n + 2 * e] += m * total[0]
                half[n + 2 * c, n + 2 * e + 1] += m * total[1]
                half[n + 2 * c + 1, n + 2 * e] += m * total[1]
                half[n + 2 * c + 1, n + 2 * e + 1] += m * total[3]


@leaf
def add_own(points, i, own, mixed, half):
    """Add the Hessian by the place of point i (packed as in ``add_pushes``), and by it and L."""
    n, row = half.shape[0] - LATTICE, 3 * points[i].first
    basis = points[i].basis
    h = (
        (own[i, 0], own[i, 1], own[i, 2]),
        (own[i, 1], own[i, 3], own[i, 4]),
        (own[i, 2], own[i, 4], own[i, 5]),
    )
    for a in range(4):
        for b in range(a + 1):
            f = basis[a] * basis[b] * (0.5 if a == b else 1.0)
            for r in range(3):
                for q in range(3):
                    half[row + 3 * a + r, row + 3 * b + q] += f * h[r][q]
        for r in range(3):
            for e in range(4):
                half[row + 3 * a + r, n + e] += basis[a] * mixed[i, r, e]


@leaf
def steps_at(touch, points, pair):
    """Steps along both yarns from a pair to the next contact points (m), and by how much these change.

    (e, f, c): the step of i, that of the image of k, second differences of i less those of k.
    """
    i, k, g = pair
    sign = touch.images[g].sign
    s0, s1, s2 = sign[0], sign[1], sign[2]
    return (
        (points[i, 3], points[i, 4], points[i, 5]),
        (s0 * points[k, 3], s1 * points[k, 4], s2 * points[k, 5]),
        (
            points[i, 6] - s0 * points[k, 6],
            points[i, 7] - s1 * points[k, 7],
            points[i, 8] - s2 * points[k, 8],
        ),
    )


@leaf
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@leaf
def cell_mean(square, along, other, law):
    """Mean of the law over a cell whose squared distance changes by along and other across it.

    Returns it and its derivatives by q, along, other, qq, q along, q other, along along, along other,
    other other.
    """
    least = THIN * law.diameter * (law.diameter - law.core)
    a, b = math.sqrt(along * along + least * least), math.sqrt(other * other + least * least)
    v, vq, va, vb, vqq, vqa, vqb, vaa, vab, vbb = mean_at(square, a, b, law)
    ra, rb = along / a, other / b
    # What the rounding at least adds to the second derivatives.
    va, vb, more, most = va * ra, vb * rb, va * least * least / a**3, vb * least * least / b**3
    return (
        v, vq, va, vb, vqq, vqa * ra, vqb * rb, vaa * ra * ra + more, vab * ra * rb, vbb * rb * rb + most,
    )  # fmt: skip


@leaf
def flat_mean(d, steps, law):
    """:func:`cell_mean` of a pair of a flat fabric: d its distance vector, steps of :func:`steps_at`."""
    e, f, c = steps
    lift = dot(e, e) + dot(f, f) + dot(d, c)
    return cell_mean(dot(d, d) + lift / 12.0, 2.0 * dot(d, e), -2.0 * dot(d, f), law)


@leaf
def flat_push(d, steps, mean, weight):
    """Derivative of a pair's energy by d."""
    e, f, c = steps
    q, a, b = 2.0 * weight * mean[1], 2.0 * weight * mean[2], -2.0 * weight * mean[3]
    n = q / 24.0
    return (
        q * d[0] + n * c[0] + a * e[0] + b * f[0],
        q * d[1] + n * c[1] + a * e[1] + b * f[1],
        q * d[2] + n * c[2] + a * e[2] + b * f[2],
    )


@leaf
def flat_matrix(d, steps, mean, weight):
    """Hessian by d of a pair's energy (xx, xy, xz, yy, yz, zz), its steps held."""
    e, f, _ = steps
    _, vq, _, _, vqq, vqa, vqb, vaa, vab, vbb = mean
    w = 4.0 * weight
    first = 2.0 * weight * vq
    qq, qa, qb, aa, ab, bb = w * vqq, w * vqa, -w * vqb, w * vaa, -w * vab, w * vbb
    x, y, z = d
    e0, e1, e2 = e
    f0, f1, f2 = f
    x1, y1, z1 = qq * x + qa * e0 + qb * f0, qq * y + qa * e1 + qb * f1, qq * z + qa * e2 + qb * f2
    x2, y2, z2 = qa * x + aa * e0 + ab * f0, qa * y + aa * e1 + ab * f1, qa * z + aa * e2 + ab * f2
    x3, y3, z3 = qb * x + ab * e0 + bb * f0, qb * y + ab * e1 + bb * f1, qb * z + ab * e2 + bb * f2
    return (
        first + x * x1 + e0 * x2 + f0 * x3,
        x * y1 + e0 * y2 + f0 * y3,
        x * z1 + e0 * z2 + f0 * z3,
        first + y * y1 + e1 * y2 + f1 * y3,
        y * z1 + e1 * z2 + f1 * z3,
        first + z * z1 + e2 * z2 + f2 * z3,
    )


@njit
def add_flat_contact(scene, lattice, listed, order, work):
    """Contact energy (J) of the listed pairs at the contact points in work; fills work.closest.

    Each pair counts by the mean of the law over its cell (:mod:`.mean`).  order 1 adds to work.expanded,
    order 2 also to work.half; of the Hessian that by the distance vectors alone, which lacks a few per
    cent of the changes of the cells and leaves Newton's method next to quadratic.
    """
    size = listed.weight.size if order > 0 else 0
    near, push = np.empty((size, 3), dtype=np.int64), np.empty((size, 9))
    frame = np.zeros((work.points.shape[0] if size > 0 else 0, 6))
    energy, count = flat_pairs(scene, lattice, listed, order, near, push, frame, work)
    if count > 0:
        add_pushes(scene.touch, near[:count], push[:count], order, work.expanded, work.half)
        add_frames(scene.touch, frame, work.expanded)
    return energy


@leaf
def flat_pairs(scene, lattice, listed, order, near, push, frame, work):
    """Energy (J) of the pairs and how many touch; fills of these near and push, and frame."""
    touch, law, points = scene.touch, scene.law, work.points
    pairs, weight = listed.pairs, listed.weight
    energy, closest, count = 0.0, math.inf, 0
    outside = touching(scene) ** 2
    for j in range(weight.size):
        pair = (pairs[j, 0], pairs[j, 1], pairs[j, 2])
        d = separation(touch, points, lattice, pair)
        square = dot(d, d)
        closest = min(closest, square)
        if square >= outside:
            continue
        steps = steps_at(touch, points, pair)
        mean = flat_mean(d, steps, law)
        if mean[0] == 0.0:
            continue
        w = weight[j]
        energy += w * mean[0]
        if order == 0:
            continue
        i, k, g = pair
        sign = touch.images[g].sign
        e, f, _ = steps
        by_d = flat_push(d, steps, mean, w)
        # By the rise of the square along either yarn, and by what lifts it.
        a, b, n = 2.0 * w * mean[2], -2.0 * w * mean[3], w * mean[1] / 12.0
        for axis in range(3):
            near[count, axis], push[count, axis] = pair[axis], by_d[axis]
            frame[i, axis] += a * d[axis] + 2.0 * n * e[axis]
            frame[k, axis] += sign[axis] * (b * d[axis] + 2.0 * n * f[axis])
            frame[i, 3 + axis] += n * d[axis]
            frame[k, 3 + axis] -= sign[axis] * n * d[axis]
        if order == 2:
            h = flat_matrix(d, steps, mean, w)
            for r in range(6):
                push[count, 3 + r] = h[r]
        count += 1
    work.closest[0] = closest
    return energy, count


@leaf
def add_frames(touch, frame, gradient):
    """Add to the gradient what contact points do by their derivatives; frame (m, 6): energies by these."""
    for i in range(touch.points.size):
        point = touch.points[i]
        row = 3 * point.first
        for a in range(4):
            for axis in range(3):
                gradient[row + 3 * a + axis] += (
                    point.along[a] * frame[i, axis] + point.turn[a] * frame[i, 3 + axis]
                )

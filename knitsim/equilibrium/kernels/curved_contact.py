"""Contact between yarns of a fabric bent to a cylinder, see :mod:`.curved` (compiled)."""

import math

import numpy as np

from knitsim.equilibrium.kernels.contact import add_frames, add_own, cell_mean
from knitsim.equilibrium.kernels.curved import chord_square
from knitsim.equilibrium.kernels.pairs import curvature_at, touching
from knitsim.equilibrium.kernels.records import LATTICE
from knitsim.jit import leaf, njit


@leaf
def gaps_at(scene, points, lattice, pair):
    """dx, dy, z_i, z_k of a pair in the fabric's coordinates (m)."""
    i, k, g = pair
    bent = scene.bend.direction
    other = 1 - bent
    image = scene.touch.images[g]
    m1, m2 = image.steps[0], image.steps[1]
    dx = points[i, bent] - image.sign[bent] * points[k, bent]
    dy = points[i, other] - image.sign[other] * points[k, other]
    return (
        dx - m1 * lattice[bent] - m2 * lattice[2 + bent],
        dy - m1 * lattice[other] - m2 * lattice[2 + other],
        points[i, 2],
        points[k, 2],
    )


@njit
def add_gaps(scene, near, push, order, work):
    """Add energies of pairs by (dx, dy, z_i, z_k, kappa) to the gradient and Hessian.

    near (n, 3): i, k, g; push (n, 20): of each pair the gradient by the five and the upper triangle of the
    Hessian, row by row.  As in :func:`.contact.add_pushes`, sums by contact point come first.
    """
    m = scene.touch.points.size
    by_point = np.zeros((m, 3)), np.zeros((m, 6)), np.zeros((m, 3, 4)), np.zeros((m, 3))
    _add_gaps(scene, near, push, order, by_point, np.zeros((4, 9)), work)


@leaf
def _add_gaps(scene, near, push, order, by_point, cross, work):
    force, own, mixed, turned = by_point
    touch, points, bent = scene.touch, scene.touch.points, scene.bend.direction
    gradient, half, by_kappa = work.expanded, work.half, work.bent.by_kappa
    n = gradient.size - LATTICE
    for j in range(near.shape[0]):
        i, k, g = near[j, 0], near[j, 1], near[j, 2]
        image = touch.images[g]
        # In the axes of the points: along the course first.
        a, b = bent, 1 - bent
        sign, steps = image.sign, image.steps
        s0, s1 = sign[0], sign[1]
        force[i, 0] += push[j, a]
        force[i, 1] += push[j, b]
        force[i, 2] += push[j, 2]
        force[k, 0] -= s0 * push[j, a]
        force[k, 1] -= s1 * push[j, b]
        force[k, 2] += push[j, 3]
        for c in range(2):
            gradient[n + 2 * c] -= steps[c] * push[j, a]
            gradient[n + 2 * c + 1] -= steps[c] * push[j, b]
        by_kappa[0] += push[j, 4]
        if order == 1:
            continue
        # Row 0 of the triangle begins at 5, row 1 at 10.
        x, y, xy = 5 + 5 * a, 5 + 5 * b, push[j, 6]
        xx, xi, xk, xt = push[j, x], push[j, x + 2 - a], push[j, x + 3 - a], push[j, x + 4 - a]
        yy, yi, yk, yt = push[j, y], push[j, y + 2 - b], push[j, y + 3 - b], push[j, y + 4 - b]
        ii, ik, it, kk, kt = push[j, 14], push[j, 15], push[j, 16], push[j, 17], push[j, 18]
        by_kappa[1] += push[j, 19]
        own[i, 0] += xx
        own[i, 1] += xy
        own[i, 2] += xi
        own[i, 3] += yy
        own[i, 4] += yi
        own[i, 5] += ii
        own[k, 0] += xx
        own[k, 1] += s0 * s1 * xy
        own[k, 2] -= s0 * xk
        own[k, 3] += yy
        own[k, 4] -= s1 * yk
        own[k, 5] += kk
        turned[i, 0] += xt
        turned[i, 1] += yt
        turned[i, 2] += it
        turned[k, 0] -= s0 * xt
        turned[k, 1] -= s1 * yt
        turned[k, 2] += kt
        for c in range(2):
            t = steps[c]
            if t != 0.0:
                mixed[i, 0, 2 * c] -= t * xx
                mixed[i, 0, 2 * c + 1] -= t * xy
                mixed[i, 1, 2 * c] -= t * xy
                mixed[i, 1, 2 * c + 1] -= t * yy
                mixed[i, 2, 2 * c] -= t * xi
                mixed[i, 2, 2 * c + 1] -= t * yi
                mixed[k, 0, 2 * c] += t * s0 * xx
                mixed[k, 0, 2 * c + 1] += t * s0 * xy
                mixed[k, 1, 2 * c] += t * s1 * xy
                mixed[k, 1, 2 * c + 1] += t * s1 * yy
                mixed[k, 2, 2 * c] -= t * xk
                mixed[k, 2, 2 * c + 1] -= t * yk
                work.bent.mixed[n + 2 * c] -= t * xt
                work.bent.mixed[n + 2 * c + 1] -= t * yt
                for e in range(2):
                    both = 0.5 * t * steps[e]
                    half[n + 2 * c, n + 2 * e] += both * xx
                    half[n + 2 * c, n + 2 * e + 1] += both * xy
                    half[n + 2 * c + 1, n + 2 * e] += both * xy
                    half[n + 2 * c + 1, n + 2 * e + 1] += both * yy
        for f in range(4):
            h = points[k].basis[f]
            cross[f, 0] -= h * s0 * xx
            cross[f, 1] -= h * s1 * xy
            cross[f, 2] += h * xk
            cross[f, 3] -= h * s0 * xy
            cross[f, 4] -= h * s1 * yy
            cross[f, 5] += h * yk
            cross[f, 6] -= h * s0 * xi
            cross[f, 7] -= h * s1 * yi
            cross[f, 8] += h * ik
        after = j + 1
        if after < near.shape[0] and near[after, 0] == i and near[after, 2] == g:
            if points[near[after, 1]].first == points[k].first:
                continue
        # The end of a run of pairs with the same i, g and span of k.
        row, column = 3 * points[i].first, 3 * points[k].first
        for f in range(4):
            for e in range(4):
                h = points[i].basis[e]
                for r in range(3):
                    for q in range(3):
                        half[row + 3 * e + r, column + 3 * f + q] += h * cross[f, 3 * r + q]
        cross[:] = 0.0
    for i in range(points.size):
        row, basis = 3 * points[i].first, points[i].basis
        for e in range(4):
            for axis in range(3):
                gradient[row + 3 * e + axis] += basis[e] * force[i, axis]
                if order == 2:
                    work.bent.mixed[row + 3 * e + axis] += basis[e] * turned[i, axis]
        if order == 2:
            add_own(points, i, own, mixed, half)


@leaf
def bent_square(gaps, kappa, chord):
    """Squared distance (m2) of a pair."""
    _, dy, zi, zk = gaps
    return dy * dy + (zi - zk) ** 2 + (1.0 + kappa * zi) * (1.0 + kappa * zk) * chord[0]


@leaf
def bent_slopes(gaps, kappa, chord):
    """Derivatives of the squared distance by dx, dy, z_i, z_k, kappa."""
    _, dy, zi, zk = gaps
    mi, mk, dz = 1.0 + kappa * zi, 1.0 + kappa * zk, zi - zk
    q, q1, _, qk, _, _ = chord
    both, cross = mi * mk, zi * mk + zk * mi
    return (
        both * q1, 2.0 * dy, 2.0 * dz + kappa * mk * q, -2.0 * dz + kappa * mi * q, cross * q + both * qk,
    )  # fmt: skip


@leaf
def bent_curved(gaps, kappa, chord, curved):
    """Fill curved (5, 5) with the second derivatives of the squared distance by the five."""
    _, _, zi, zk = gaps
    mi, mk = 1.0 + kappa * zi, 1.0 + kappa * zk
    q, q1, q2, qk, q1k, qkk = chord
    both, cross = mi * mk, zi * mk + zk * mi
    curved[0, 0] = both * q2
    curved[0, 2] = kappa * mk * q1
    curved[0, 3] = kappa * mi * q1
    curved[0, 4] = cross * q1 + both * q1k
    curved[1, 1] = curved[2, 2] = curved[3, 3] = 2.0
    curved[2, 3] = kappa * kappa * q - 2.0
    curved[2, 4] = (mk + kappa * zk) * q + kappa * mk * qk
    curved[3, 4] = (mi + kappa * zi) * q + kappa * mi * qk
    curved[4, 4] = 2.0 * zi * zk * q + 2.0 * cross * qk + both * qkk
    for a in range(5):
        for b in range(a):
            curved[a, b] = curved[b, a]


@leaf
def bent_steps(scene, points, pair):
    """What dx, dy, z_i or z_k change to the next points along i and along k; second differences of all.

    Three tuples: (dx, dy, z_i) along i, (dx, dy, z_k) along k, the sum of the second differences of the four.
    """
    i, k, g = pair
    bent = scene.bend.direction
    other, sign = 1 - bent, scene.touch.images[g].sign
    return (
        (points[i, 3 + bent], points[i, 3 + other], points[i, 5]),
        (-sign[bent] * points[k, 3 + bent], -sign[other] * points[k, 3 + other], points[k, 5]),
        (
            points[i, 6 + bent] - sign[bent] * points[k, 6 + bent],
            points[i, 6 + other] - sign[other] * points[k, 6 + other],
            points[i, 8],
            points[k, 8],
        ),
    )


@leaf
def bent_lift(gaps, kappa, chord, steps):
    """Part of the lift of a cell that the squares of the steps make."""
    _, _, zi, zk = gaps
    mi, mk = 1.0 + kappa * zi, 1.0 + kappa * zk
    _, q1, q2, _, _, _ = chord
    (u, v, z), (s, t, y), _ = steps
    lift = mi * mk * q2 * u * u + 2.0 * kappa * u * z * mk * q1 + 2.0 * (v * v + z * z)
    return lift + mi * mk * q2 * s * s + 2.0 * kappa * s * y * mi * q1 + 2.0 * (t * t + y * y)


@leaf
def add_lift(gaps, kappa, chord, steps, slope, factor):
    """Add the derivatives of :func:`bent_lift` by the five, times factor, to slope (5,)."""
    dx, _, zi, zk = gaps
    mi, mk = 1.0 + kappa * zi, 1.0 + kappa * zk
    _, q1, q2, _, q1k, _ = chord
    both, cross = mi * mk, zi * mk + zk * mi
    q3, q2k = -kappa * kappa * q1, -2.0 * dx * math.sin(kappa * dx)
    for r in range(2):
        u, z = (steps[0][0], steps[0][2]) if r == 0 else (steps[1][0], steps[1][2])
        m = mk if r == 0 else mi
        twice = 2.0 * kappa * u * z
        slope[0] += factor * (both * q3 * u * u + twice * m * q2)
        slope[2] += factor * kappa * mk * q2 * u * u
        slope[3] += factor * kappa * mi * q2 * u * u
        slope[3 - r] += factor * twice * kappa * q1
        slope[4] += factor * (cross * q2 + both * q2k) * u * u
        slope[4] += (
            factor * 2.0 * u * z * (m * q1 + kappa * ((zk if r == 0 else zi) * q1 + m * q1k))
        )


@leaf
def bent_mean(gaps, kappa, chord, steps, by, law):
    """The :func:`.contact.cell_mean` of a pair; by (5,): derivatives of its square."""
    (u, v, z), (s, t, y), c = steps
    lift = by[0] * c[0] + by[1] * c[1] + by[2] * c[2] + by[3] * c[3]
    lift += bent_lift(gaps, kappa, chord, steps)
    return cell_mean(
        bent_square(gaps, kappa, chord) + lift / 24.0, by[0] * u + by[1] * v + by[2] * z,
        by[0] * s + by[1] * t + by[3] * y, law,
    )  # fmt: skip


@njit
def add_bent_contact(scene, lattice, listed, order, work):
    """As :func:`knitsim.equilibrium.kernels.contact.add_flat_contact`, with the derivatives by kappa."""
    size = listed.weight.size if order > 0 else 0
    near, push = np.empty((size, 3), dtype=np.int64), np.empty((size, 20))
    frame = np.zeros((work.points.shape[0], 6))
    buffers = np.zeros(5), np.zeros((5, 5)), np.zeros((3, 5))
    energy, count = bent_pairs(scene, lattice, listed, order, (near, push, frame), buffers, work)
    if count > 0:
        add_gaps(scene, near[:count], push[:count], order, work)
        add_frames(scene.touch, frame, work.expanded)
    return energy


@leaf
def bent_pairs(scene, lattice, listed, order, found, buffers, work):
    """Energy (J) of the pairs and how many touch; fills of these near and push, and frame."""
    kappa, points = curvature_at(scene, lattice), work.points
    pairs, weight, touch = listed.pairs, listed.weight, scene.touch
    energy, closest, bent, count = 0.0, math.inf, scene.bend.direction, 0
    near, push, frame = found
    slope, curved, rows = buffers
    outside = touching(scene) ** 2
    for j in range(weight.size):
        pair = (pairs[j, 0], pairs[j, 1], pairs[j, 2])
        gaps = gaps_at(scene, points, lattice, pair)
        chord = chord_square(gaps[0], kappa)
        square = bent_square(gaps, kappa, chord)
        closest = min(closest, square)
        if square >= outside:
            continue
        by, steps = bent_slopes(gaps, kappa, chord), bent_steps(scene, points, pair)
        mean = bent_mean(gaps, kappa, chord, steps, by, scene.law)
        if mean[0] == 0.0:
            continue
        w = weight[j]
        energy += w * mean[0]
        if order == 0:
            continue
        bent_curved(gaps, kappa, chord, curved)
        (u, v, z), (s, t, y), second = steps
        # Of the square, its change along either yarn: derivatives by the five.
        q, n = w * mean[1], w * mean[1] / 24.0
        for a in range(5):
            rows[0, a] = by[a]
            rows[1, a] = curved[a, 0] * u + curved[a, 1] * v + curved[a, 2] * z
            rows[2, a] = curved[a, 0] * s + curved[a, 1] * t + curved[a, 3] * y
            slope[a] = q * by[a] + w * (mean[2] * rows[1, a] + mean[3] * rows[2, a])
            for b in range(4):
                slope[a] += n * curved[a, b] * second[b]
        add_lift(gaps, kappa, chord, steps, slope, n)
        i, k, g = pair
        sign = touch.images[g].sign
        for axis in range(3):
            near[count, axis] = pair[axis]
            # The thickness of either point counts by itself.
            at = 2 if axis == 2 else (axis if bent == 0 else 1 - axis)
            of_k, turned = (3, 1.0) if axis == 2 else (at, -sign[axis])
            frame[i, axis] += w * mean[2] * by[at] + 2.0 * n * rows[1, at]
            frame[k, axis] += turned * (w * mean[3] * by[of_k] + 2.0 * n * rows[2, of_k])
            frame[i, 3 + axis] += n * by[at]
            frame[k, 3 + axis] += turned * n * by[of_k]
        for a in range(5):
            push[count, a] = slope[a]
        if order == 2:
            qq, qa, qb = w * mean[4], w * mean[5], w * mean[6]
            aa, ab, bb = w * mean[7], w * mean[8], w * mean[9]
            at = 5
            for a in range(5):
                x, y, z = rows[0, a], rows[1, a], rows[2, a]
                x, y, z = (
                    qq * x + qa * y + qb * z,
                    qa * x + aa * y + ab * z,
                    qb * x + ab * y + bb * z,
                )
                for b in range(a, 5):
                    push[count, at] = (
                        q * curved[a, b] + x * rows[0, b] + y * rows[1, b] + z * rows[2, b]
                    )
                    at += 1
        count += 1
    work.closest[0] = closest
    return energy, count

"""The energies of a fabric bent to a cylinder (compiled).

The fabric's own coordinates stay flat: x along the bent direction, y along the cylinder's axis, z
the thickness; the fabric point (x, y, z) lies at the angle kappa x and the radius 1/kappa + z.  A
translation in x is then a rotation about the axis, so that lattice, images, symmetry and the map of
the unknowns are those of the flat fabric.  In the frame of the cylinder, with m = 1 + kappa z,

    velocity     = (m x', y', z')
    acceleration = (m x'' + 2 kappa x' z', y'', z'' - kappa m x'^2)
    distance^2   = dy^2 + dz^2 + m_1 m_2 q,   q = (2 sin(kappa dx/2)/kappa)^2,

all regular at kappa = 0.  kappa > 0 makes the technical face (z > 0) convex.  The plane z = 0, to
which kappa and the spacings belong, is the mean of the centre line (held by the map).
"""

import math

import numpy as np

from knitsim.equilibrium.contact_kernels import law_at
from knitsim.equilibrium.yarn_kernels import add_form, yarn_point
from knitsim.jit import njit


@njit
def chord_square(delta, kappa):
    """q, its first two derivatives by dx, and its derivative by kappa."""
    angle = kappa * delta
    if abs(angle) < 1e-2:
        a, s = angle * angle, delta * delta
        return (
            s * (1.0 - a / 12.0 + a * a / 360.0),
            2.0 * delta * (1.0 - a / 6.0 + a * a / 120.0),
            2.0 * (1.0 - a / 2.0 + a * a / 24.0),
            kappa * s * s * (-1.0 / 6.0 + a / 90.0),
        )
    q = (2.0 * math.sin(0.5 * angle) / kappa) ** 2
    first = 2.0 * math.sin(angle) / kappa
    return q, first, 2.0 * math.cos(angle), (delta * first - 2.0 * q) / kappa


@njit
def add_curved_yarn(scene, x, order, gradient, half, terms):
    """As :func:`knitsim.equilibrium.yarn_kernels.add_yarn`; returns the derivative by kappa (J m)."""
    rod, kappa, bent = scene.rod, scene.bend.curvature, scene.bend.direction
    other = 1 - bent
    by_kappa = 0.0
    # Local variables: x', y', z', x'', y'', z'', z, each an axis and a row of basis derivatives.
    axes = np.array([bent, other, 2, bent, other, 2, 2])
    local = np.zeros(7)
    weights = np.empty((7, 4))
    form, tangent = np.empty(6), np.empty((6, 6))
    jacobian, chained, matrix = np.zeros((6, 7)), np.zeros((6, 7)), np.zeros((7, 7))
    for point in rod:
        f = point.first
        for k in range(4):
            for i in range(3):
                weights[i, k], weights[3 + i, k] = point.d1[k], point.d2[k]
            weights[6, k] = point.d0[k]
        for i in range(7):
            local[i] = 0.0
            for k in range(4):
                local[i] += weights[i, k] * x[f + k, axes[i]]
        u, z1, a, z = local[0], local[2], local[3], local[6]
        m = 1.0 + kappa * z
        v = (m * u, local[1], z1)
        w = (m * a + 2.0 * kappa * u * z1, local[4], local[5] - kappa * m * u * u)
        yarn_point(point, scene.stretch, v, w, order, form, tangent, terms)
        if order == 0:
            continue
        by_kappa += form[0] * z * u + form[3] * (z * a + 2.0 * u * z1)
        by_kappa -= form[5] * (1.0 + 2.0 * kappa * z) * u * u
        jacobian[0, 0], jacobian[0, 6], jacobian[1, 1], jacobian[2, 2] = m, kappa * u, 1.0, 1.0
        jacobian[3, 3], jacobian[3, 0], jacobian[3, 2] = m, 2.0 * kappa * z1, 2.0 * kappa * u
        jacobian[3, 6], jacobian[4, 4], jacobian[5, 5] = kappa * a, 1.0, 1.0
        jacobian[5, 0], jacobian[5, 6] = -2.0 * kappa * m * u, -kappa * kappa * u * u
        for i in range(7):
            g = 0.0
            for r in range(6):
                g += jacobian[r, i] * form[r]
            for k in range(4):
                gradient[3 * (f + k) + axes[i]] += g * weights[i, k]
        if order == 1:
            continue
        chained[:] = 0.0
        for r in range(6):
            for s in range(6):
                for i in range(7):
                    chained[r, i] += tangent[r, s] * jacobian[s, i]
        matrix[:] = 0.0
        for r in range(6):
            for i in range(7):
                if jacobian[r, i] != 0.0:
                    for j in range(7):
                        matrix[i, j] += jacobian[r, i] * chained[r, j]
        # Curvature of the map itself: m x', m x'' + 2 kappa x' z', -kappa m x'^2.
        matrix[0, 6] += form[0] * kappa - form[5] * 2.0 * kappa * kappa * u
        matrix[6, 0] += form[0] * kappa - form[5] * 2.0 * kappa * kappa * u
        matrix[3, 6] += form[3] * kappa
        matrix[6, 3] += form[3] * kappa
        matrix[0, 2] += form[3] * 2.0 * kappa
        matrix[2, 0] += form[3] * 2.0 * kappa
        matrix[0, 0] -= form[5] * 2.0 * kappa * m
        add_form(f, axes, weights, matrix, half)
    return by_kappa


@njit
def add_curved_contact(scene, points, lattice, pairs, order, gradient, half):
    """As :func:`knitsim.equilibrium.contact_kernels.add_contact`; also the derivative by kappa."""
    touch, law, kappa, bent = scene.touch, scene.law, scene.bend.curvature, scene.bend.direction
    listed, weight = pairs
    other = 1 - bent
    n = gradient.size - 4
    energy, closest, by_kappa = 0.0, math.inf, 0.0
    # Local variables dx, dy, z_i, z_k as linear forms: rows of the gradient and their coefficients.
    row, factor = np.zeros((4, 10), dtype=np.int64), np.zeros((4, 10))
    size = np.array([10, 10, 4, 4])
    slope, bend = np.zeros(4), np.zeros((4, 4))
    for j in range(weight.size):
        i, k, g = listed[j, 0], listed[j, 1], listed[j, 2]
        sign, steps = touch.images[g].sign, touch.images[g].steps
        m1, m2 = steps[0], steps[1]
        dx = points[i, bent] - sign[bent] * points[k, bent]
        dx -= m1 * lattice[bent] + m2 * lattice[2 + bent]
        dy = points[i, other] - sign[other] * points[k, other]
        dy -= m1 * lattice[other] + m2 * lattice[2 + other]
        zi, zk = points[i, 2], points[k, 2]
        mi, mk, dz = 1.0 + kappa * zi, 1.0 + kappa * zk, zi - zk
        q, q1, q2, qk = chord_square(dx, kappa)
        square = dy * dy + dz * dz + mi * mk * q
        closest = min(closest, square)
        v, v1, v2 = law_at(square, law)
        if v == 0.0:
            continue
        energy += weight[j] * v
        if order == 0:
            continue
        first, second = weight[j] * v1, weight[j] * v2
        slope[0], slope[1] = mi * mk * q1, 2.0 * dy
        slope[2], slope[3] = 2.0 * dz + kappa * mk * q, -2.0 * dz + kappa * mi * q
        by_kappa += first * ((zi * mk + zk * mi) * q + mi * mk * qk)
        for a in range(4):
            ri, rk = 3 * (touch.points[i].first + a), 3 * (touch.points[k].first + a)
            bi, bk = touch.points[i].basis[a], touch.points[k].basis[a]
            row[0, a], factor[0, a] = ri + bent, bi
            row[0, 4 + a], factor[0, 4 + a] = rk + bent, -sign[bent] * bk
            row[1, a], factor[1, a] = ri + other, bi
            row[1, 4 + a], factor[1, 4 + a] = rk + other, -sign[other] * bk
            row[2, a], factor[2, a] = ri + 2, bi
            row[3, a], factor[3, a] = rk + 2, bk
        row[0, 8], row[0, 9], factor[0, 8], factor[0, 9] = n + bent, n + 2 + bent, -m1, -m2
        row[1, 8], row[1, 9], factor[1, 8], factor[1, 9] = n + other, n + 2 + other, -m1, -m2
        for a in range(4):
            for r in range(size[a]):
                gradient[row[a, r]] += first * slope[a] * factor[a, r]
        if order == 1:
            continue
        bend[:] = 0.0
        bend[0, 0], bend[1, 1], bend[2, 2], bend[3, 3] = mi * mk * q2, 2.0, 2.0, 2.0
        bend[2, 3] = -2.0 + kappa * kappa * q
        bend[0, 2], bend[0, 3] = kappa * mk * q1, kappa * mi * q1
        for a in range(4):
            for b in range(a, 4):
                h = first * bend[a, b] + second * slope[a] * slope[b]
                h *= 0.5 if a == b else 1.0
                for r in range(size[a]):
                    for s in range(size[b]):
                        half[row[a, r], row[b, s]] += h * factor[a, r] * factor[b, s]
    return energy, closest, by_kappa

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

What is prescribed is the angle of one loop, kappa times the spacing w along the bent direction, so
that kappa = angle/w follows the unknown w.  The energy at a given angle then has its minimum by w
where the force through a cut is zero, whatever the plane z = 0.
"""

import math

import numpy as np

from knitsim.equilibrium.kernels.contact import add_frames, cell_mean
from knitsim.equilibrium.kernels.pairs import curvature_at, touching
from knitsim.equilibrium.kernels.records import ANGLE, LATTICE
from knitsim.equilibrium.kernels.yarn import add_form, is_turned, locked_point, yarn_point
from knitsim.jit import njit


@njit
def chord_square(delta, kappa):
    """q, its first two derivatives by dx; by kappa the first of q and of dq/ddx, the second of q."""
    angle = kappa * delta
    if abs(angle) < 1e-2:
        a, s = angle * angle, delta * delta
        return (
            s * (1.0 - a / 12.0 + a * a / 360.0),
            2.0 * delta * (1.0 - a / 6.0 + a * a / 120.0),
            2.0 * (1.0 - a / 2.0 + a * a / 24.0),
            kappa * s * s * (-1.0 / 6.0 + a / 90.0 - a * a / 3360.0),
            kappa * s * delta * (-2.0 / 3.0 + a / 15.0 - a * a / 420.0),
            s * s * (-1.0 / 6.0 + a / 30.0 - a * a / 672.0),
        )
    q = (2.0 * math.sin(0.5 * angle) / kappa) ** 2
    first, second = 2.0 * math.sin(angle) / kappa, 2.0 * math.cos(angle)
    by_kappa, mixed = (delta * first - 2.0 * q) / kappa, (delta * second - first) / kappa
    return q, first, second, by_kappa, mixed, (delta * mixed - 3.0 * by_kappa) / kappa


# The local variables of a Gauss point: x', y', z', x'', y'', z'', z, each an axis and a row of the
# derivatives of the basis.
@njit
def local_variables(point, bent, axes, weights):
    """Fill axes (7,) and weights (7, 4) of a Gauss point."""
    for i in range(7):
        axes[i] = i % 3
    axes[6] = 2
    if bent == 1:
        for i in range(2):
            axes[i], axes[3 + i] = 1 - i, 1 - i
    for k in range(4):
        for i in range(3):
            weights[i, k], weights[3 + i, k] = point.d1[k], point.d2[k]
        weights[6, k] = point.d0[k]


@njit
def local_values(first, x, axes, weights, local):
    """Fill local (7,) from the control points x."""
    for i in range(7):
        local[i] = 0.0
        for k in range(4):
            local[i] += weights[i, k] * x[first + k, axes[i]]


@njit
def motion(local, kappa):
    """Velocity and acceleration by the parameter in the frame of the cylinder."""
    u, z1, m = local[0], local[2], 1.0 + kappa * local[6]
    v = (m * u, local[1], z1)
    return v, (m * local[3] + 2.0 * kappa * u * z1, local[4], local[5] - kappa * m * u * u)


@njit
def add_local(first, local, kappa, order, table, work):
    """Add an energy of velocity and acceleration by way of the local variables.

    table: form (6,), tangent (6, 6) as in ``yarn_point``, axes, weights.
    """
    form, tangent, axes, weights = table
    u, z1, a, z = local[0], local[2], local[3], local[6]
    m = 1.0 + kappa * z
    # Derivative of (velocity, acceleration) by kappa: entries 0, 3 and 5.
    p0, p3, p5 = z * u, z * a + 2.0 * u * z1, -(1.0 + 2.0 * kappa * z) * u * u
    work.bent.by_kappa[0] += form[0] * p0 + form[3] * p3 + form[5] * p5
    jacobian = np.zeros((6, 7))
    jacobian[0, 0], jacobian[0, 6], jacobian[1, 1], jacobian[2, 2] = m, kappa * u, 1.0, 1.0
    jacobian[3, 3], jacobian[3, 0], jacobian[3, 2] = m, 2.0 * kappa * z1, 2.0 * kappa * u
    jacobian[3, 6], jacobian[4, 4], jacobian[5, 5] = kappa * a, 1.0, 1.0
    jacobian[5, 0], jacobian[5, 6] = -2.0 * kappa * m * u, -kappa * kappa * u * u
    for i in range(7):
        g = 0.0
        for r in range(6):
            g += jacobian[r, i] * form[r]
        for k in range(4):
            work.expanded[3 * (first + k) + axes[i]] += g * weights[i, k]
    if order == 1:
        return
    chained, matrix, turned = np.zeros((6, 7)), np.zeros((7, 7)), np.empty(6)
    for r in range(6):
        turned[r] = tangent[r, 0] * p0 + tangent[r, 3] * p3 + tangent[r, 5] * p5
        for s in range(6):
            for i in range(7):
                chained[r, i] += tangent[r, s] * jacobian[s, i]
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
    add_form(first, axes, weights, matrix, work.half)
    work.bent.by_kappa[1] += (
        turned[0] * p0 + turned[3] * p3 + turned[5] * p5 - form[5] * 2.0 * z * u * u
    )
    for i in range(7):
        g = 0.0
        for r in range(6):
            g += jacobian[r, i] * turned[r]
        # Change of the local derivatives with kappa.
        if i == 0:
            g += form[0] * z + form[3] * 2.0 * z1 - form[5] * 2.0 * (1.0 + 2.0 * kappa * z) * u
        elif i == 2:
            g += form[3] * 2.0 * u
        elif i == 3:
            g += form[3] * z
        elif i == 6:
            g += form[0] * u + form[3] * a - form[5] * 2.0 * kappa * u * u
        for k in range(4):
            work.bent.mixed[3 * (first + k) + axes[i]] += g * weights[i, k]


@njit
def locked_bent(scene, point, v, w, order, form, tangent, terms):
    # In the frame of the cylinder: bent direction, axis, thickness.  Two axes exchanged, a curvature
    # vector, which is axial, changes its sign.
    a, b = scene.bend.direction, 1 - scene.bend.direction
    sign = 1.0 if a == 0 else -1.0
    facing, turning = point.facing, point.turning
    locked_point(
        point, (facing[a], facing[b], facing[2]),
        (sign * turning[a], sign * turning[b], sign * turning[2]), v, w, order, form, tangent, terms,
    )  # fmt: skip


@njit
def add_bent_yarn(scene, lattice, order, work):
    """As :func:`knitsim.equilibrium.kernels.yarn.add_flat_yarn`, with the derivatives by kappa."""
    kappa = curvature_at(scene, lattice)
    axes, weights, local = np.empty(7, dtype=np.int64), np.empty((7, 4)), np.empty(7)
    form, tangent = np.empty(6), np.empty((6, 6))
    for point in scene.rod:
        local_variables(point, scene.bend.direction, axes, weights)
        local_values(point.first, work.x, axes, weights, local)
        v, w = motion(local, kappa)
        yarn_point(point, scene.stretch, v, w, order, form, tangent, work.terms)
        if is_turned(point):
            locked_bent(scene, point, v, w, order, form, tangent, work.terms)
        if order > 0:
            add_local(point.first, local, kappa, order, (form, tangent, axes, weights), work)


@njit
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
def add_gaps(scene, pair, order, slope, bend, table, work):
    """Add an energy of (dx, dy, z_i, z_k, kappa) with gradient slope (5,) and Hessian bend (5, 5).

    Of bend only the upper triangle counts.  table: buffers (4, 10) for rows and factors.
    """
    i, k, g = pair
    touch, bent = scene.touch, scene.bend.direction
    other, n = 1 - bent, work.expanded.size - LATTICE
    row, factor = table
    image = touch.images[g]
    m1, m2 = image.steps[0], image.steps[1]
    # The four as linear forms of control points and lattice.
    for a in range(4):
        ri, rk = 3 * (touch.points[i].first + a), 3 * (touch.points[k].first + a)
        bi, bk = touch.points[i].basis[a], touch.points[k].basis[a]
        row[0, a], factor[0, a] = ri + bent, bi
        row[0, 4 + a], factor[0, 4 + a] = rk + bent, -image.sign[bent] * bk
        row[1, a], factor[1, a] = ri + other, bi
        row[1, 4 + a], factor[1, 4 + a] = rk + other, -image.sign[other] * bk
        row[2, a], factor[2, a] = ri + 2, bi
        row[3, a], factor[3, a] = rk + 2, bk
    row[0, 8], row[0, 9], factor[0, 8], factor[0, 9] = n + bent, n + 2 + bent, -m1, -m2
    row[1, 8], row[1, 9], factor[1, 8], factor[1, 9] = n + other, n + 2 + other, -m1, -m2
    work.bent.by_kappa[0] += slope[4]
    for a in range(4):
        for r in range(10 if a < 2 else 4):
            work.expanded[row[a, r]] += slope[a] * factor[a, r]
    if order == 1:
        return
    work.bent.by_kappa[1] += bend[4, 4]
    for a in range(4):
        for r in range(10 if a < 2 else 4):
            work.bent.mixed[row[a, r]] += bend[a, 4] * factor[a, r]
        for b in range(a, 4):
            h = bend[a, b] * (0.5 if a == b else 1.0)
            if h == 0.0:
                continue
            for r in range(10 if a < 2 else 4):
                left = h * factor[a, r]
                for s in range(10 if b < 2 else 4):
                    work.half[row[a, r], row[b, s]] += left * factor[b, s]


@njit
def bent_square(gaps, kappa, by, curved):
    """Squared distance (m2) of a pair; fills its derivatives by dx, dy, z_i, z_k, kappa.

    by (5,), curved (5, 5): first and second ones.
    """
    dx, dy, zi, zk = gaps
    mi, mk, dz = 1.0 + kappa * zi, 1.0 + kappa * zk, zi - zk
    q, q1, q2, qk, q1k, qkk = chord_square(dx, kappa)
    both, cross = mi * mk, zi * mk + zk * mi
    by[0], by[1] = both * q1, 2.0 * dy
    by[2], by[3] = 2.0 * dz + kappa * mk * q, -2.0 * dz + kappa * mi * q
    by[4] = cross * q + both * qk
    curved[:] = 0.0
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
    return dy * dy + dz * dz + both * q


@njit
def bent_steps(scene, points, pair, step):
    """Fill step (3, 5) with what dx, dy, z_i, z_k change to the next points along i and along k.

    The last row holds the sum of their second differences.
    """
    i, k, g = pair
    bent = scene.bend.direction
    other, sign = 1 - bent, scene.touch.images[g].sign
    step[:] = 0.0
    step[0, 0], step[0, 1], step[0, 2] = points[i, 3 + bent], points[i, 3 + other], points[i, 5]
    step[1, 0], step[1, 1] = -sign[bent] * points[k, 3 + bent], -sign[other] * points[k, 3 + other]
    step[1, 3] = points[k, 5]
    step[2, 0] = points[i, 6 + bent] - sign[bent] * points[k, 6 + bent]
    step[2, 1] = points[i, 6 + other] - sign[other] * points[k, 6 + other]
    step[2, 2], step[2, 3] = points[i, 8], points[k, 8]


@njit
def bent_lift(gaps, kappa, step, slope, factor):
    """Part of the lift of a cell that the squares of the steps make; adds its slope times factor.

    slope (5,) by dx, dy, z_i, z_k, kappa.
    """
    dx, _, zi, zk = gaps
    mi, mk = 1.0 + kappa * zi, 1.0 + kappa * zk
    _, q1, q2, _, q1k, _ = chord_square(dx, kappa)
    both, cross = mi * mk, zi * mk + zk * mi
    q3, q2k = -kappa * kappa * q1, -2.0 * dx * math.sin(kappa * dx)
    lift = 0.0
    for r in range(2):
        u, v = step[r, 0], step[r, 1]
        z, m = (step[r, 2], mk) if r == 0 else (step[r, 3], mi)
        twice = 2.0 * kappa * u * z
        lift += both * q2 * u * u + twice * m * q1 + 2.0 * (v * v + z * z)
        slope[0] += factor * (both * q3 * u * u + twice * m * q2)
        slope[2] += factor * kappa * mk * q2 * u * u
        slope[3] += factor * kappa * mi * q2 * u * u
        slope[3 - r] += factor * twice * kappa * q1
        slope[4] += factor * (cross * q2 + both * q2k) * u * u
        slope[4] += (
            factor * 2.0 * u * z * (m * q1 + kappa * ((zk if r == 0 else zi) * q1 + m * q1k))
        )
    return lift


@njit
def add_bent_contact(scene, lattice, listed, order, work):
    """As :func:`knitsim.equilibrium.kernels.contact.add_flat_contact`, with the derivatives by kappa."""
    kappa, points = curvature_at(scene, lattice), work.points
    pairs, weight, touch = listed.pairs, listed.weight, scene.touch
    energy, closest, bent = 0.0, math.inf, scene.bend.direction
    table = (np.zeros((4, 10), dtype=np.int64), np.zeros((4, 10)))
    slope, bend, by, curved = np.zeros(5), np.zeros((5, 5)), np.zeros(5), np.zeros((5, 5))
    step, unused, rows = np.zeros((3, 5)), np.zeros(5), np.zeros((3, 5))
    frame = np.zeros((points.shape[0], 6))
    outside = touching(scene) ** 2
    for j in range(weight.size):
        pair = (pairs[j, 0], pairs[j, 1], pairs[j, 2])
        gaps = gaps_at(scene, points, lattice, pair)
        square = bent_square(gaps, kappa, by, curved)
        closest = min(closest, square)
        if square >= outside:
            continue
        bent_steps(scene, points, pair, step)
        mean = bent_mean(scene, gaps, kappa, step, square, by, unused)
        if mean[0] == 0.0:
            continue
        w = weight[j]
        energy += w * mean[0]
        if order == 0:
            continue
        # Of the square, its change along either yarn: derivatives by the five.
        for a in range(5):
            rows[0, a], rows[1, a], rows[2, a] = by[a], 0.0, 0.0
            for b in range(4):
                rows[1, a] += curved[a, b] * step[0, b]
                rows[2, a] += curved[a, b] * step[1, b]
        q, n = w * mean[1], w * mean[1] / 24.0
        for a in range(5):
            slope[a] = q * by[a] + w * (mean[2] * rows[1, a] + mean[3] * rows[2, a])
            for b in range(4):
                slope[a] += n * curved[a, b] * step[2, b]
        bent_lift(gaps, kappa, step, slope, n)
        i, k, g = pair
        sign = touch.images[g].sign
        for axis in range(3):
            # The thickness of either point counts by itself.
            at = 2 if axis == 2 else (axis if bent == 0 else 1 - axis)
            of_k, turned = (3, 1.0) if axis == 2 else (at, -sign[axis])
            more, most = 0.0, 0.0
            for b in range(4):
                more += curved[at, b] * step[0, b]
                most += curved[of_k, b] * step[1, b]
            frame[i, axis] += w * mean[2] * by[at] + 2.0 * n * more
            frame[k, axis] += turned * (w * mean[3] * by[of_k] + 2.0 * n * most)
            frame[i, 3 + axis] += n * by[at]
            frame[k, 3 + axis] += turned * n * by[of_k]
        if order == 2:
            qq, qa, qb = w * mean[4], w * mean[5], w * mean[6]
            aa, ab, bb = w * mean[7], w * mean[8], w * mean[9]
            for a in range(5):
                x, y, z = rows[0, a], rows[1, a], rows[2, a]
                x, y, z = (
                    qq * x + qa * y + qb * z,
                    qa * x + aa * y + ab * z,
                    qb * x + ab * y + bb * z,
                )
                for b in range(a, 5):
                    bend[a, b] = q * curved[a, b] + x * rows[0, b] + y * rows[1, b] + z * rows[2, b]
        add_gaps(scene, pair, order, slope, bend, table, work)
    if order > 0:
        add_frames(touch, frame, work.expanded)
    work.closest[0] = closest
    return energy


@njit
def bent_mean(scene, gaps, kappa, step, square, by, unused):
    """The :func:`.contact.cell_mean` of a pair; by (5,): derivatives of its square, step of bent_steps."""
    along = other = lift = 0.0
    for a in range(4):
        along += by[a] * step[0, a]
        other += by[a] * step[1, a]
        lift += by[a] * step[2, a]
    lift += bent_lift(gaps, kappa, step, unused, 0.0)
    return cell_mean(square + lift / 24.0, along, other, scene.law)


@njit
def no_kappa(scene, lattice, order, work):
    """Nothing to begin or end: the scene is flat."""


@njit
def begin_kappa(scene, lattice, order, work):
    """Clear the derivatives by kappa."""
    work.bent.by_kappa[:] = 0.0
    if order == 2:
        work.bent.mixed[:] = 0.0


@njit
def end_kappa(scene, lattice, order, work):
    """Add what angle and spacing do by way of kappa = angle/w to work.expanded and work.half."""
    if order == 0:
        return
    by, mixed = work.bent.by_kappa, work.bent.mixed
    first = work.expanded.size - LATTICE
    at, turned = first + 3 * scene.bend.direction, first + ANGLE
    w = lattice[3 * scene.bend.direction]
    by_w, by_angle = -curvature_at(scene, lattice) / w, 1.0 / w
    work.expanded[at] += by[0] * by_w
    work.expanded[turned] += by[0] * by_angle
    if order == 2:
        for r in range(mixed.size):
            work.half[at, r] += by_w * mixed[r]
            work.half[turned, r] += by_angle * mixed[r]
        work.half[at, at] += 0.5 * by[1] * by_w * by_w - by[0] * by_w / w
        work.half[turned, turned] += 0.5 * by[1] * by_angle * by_angle
        work.half[turned, at] += by[1] * by_angle * by_w - by[0] * by_angle / w

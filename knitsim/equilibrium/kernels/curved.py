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

from knitsim.equilibrium.kernels.pairs import curvature_at
from knitsim.equilibrium.kernels.records import ANGLE, LATTICE
from knitsim.equilibrium.kernels.yarn import add_form, is_turned, locked_point, yarn_point
from knitsim.jit import leaf, njit


@leaf
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
    sine, cosine = math.sin(0.5 * angle), math.cos(0.5 * angle)
    q = (2.0 * sine / kappa) ** 2
    first, second = 4.0 * sine * cosine / kappa, 2.0 - 4.0 * sine * sine
    by_kappa, mixed = (delta * first - 2.0 * q) / kappa, (delta * second - first) / kappa
    return q, first, second, by_kappa, mixed, (delta * mixed - 3.0 * by_kappa) / kappa


# The local variables of a Gauss point: x', y', z', x'', y'', z'', z, each an axis and a row of the
# derivatives of the basis.
@leaf
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


@leaf
def local_values(first, x, axes, weights, local):
    """Fill local (7,) from the control points x."""
    for i in range(7):
        local[i] = 0.0
        for k in range(4):
            local[i] += weights[i, k] * x[first + k, axes[i]]


@leaf
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


@leaf
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


@leaf
def no_kappa(scene, lattice, order, work):
    """Nothing to begin or end: the scene is flat."""


@leaf
def begin_kappa(scene, lattice, order, work):
    """Clear the derivatives by kappa."""
    work.bent.by_kappa[:] = 0.0
    if order == 2:
        work.bent.mixed[:] = 0.0


@leaf
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

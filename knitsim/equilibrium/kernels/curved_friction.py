"""Friction between the yarns of a bent fabric (compiled).

As in :mod:`knitsim.equilibrium.kernels.friction`.  The vector between two centre lines is taken in the
frame that turns with the fabric, half way between the two points,

    d = ((m_1 + m_2) s, dy, dz c),   s = sin(kappa dx/2)/kappa,   c = cos(kappa dx/2),

so that a rotation of the whole about the axis is no slip.
"""

import math

import numpy as np

from knitsim.equilibrium.kernels.curved_contact import add_gaps, gaps_at
from knitsim.equilibrium.kernels.friction import across, slip_matrix, spring_at
from knitsim.equilibrium.kernels.pairs import curvature_at
from knitsim.jit import leaf, njit


@leaf
def arm_at(delta, kappa):
    """s (m) and its first two derivatives by kappa (m2, m3)."""
    angle, cube = 0.5 * kappa * delta, delta * delta * delta
    if abs(angle) < 1e-2:
        a = angle * angle
        return (
            0.5 * delta * (1.0 - a / 6.0 + a * a / 120.0),
            kappa * cube * (-1.0 / 24.0 + a / 240.0),
            cube * (-1.0 / 24.0 + a / 80.0),
        )
    s, c = math.sin(angle) / kappa, math.cos(angle)
    first = (0.5 * delta * c - s) / kappa
    return s, first, -(0.25 * delta * delta * s * kappa + 2.0 * first) / kappa


@leaf
def vector_at(gaps, kappa):
    """The vector d between the centre lines of a pair (m)."""
    dx, dy, zi, zk = gaps
    s, _, _ = arm_at(dx, kappa)
    return ((2.0 + kappa * (zi + zk)) * s, dy, (zi - zk) * math.cos(0.5 * kappa * dx))


@njit
def add_bent_friction(scene, lattice, slip, order, work):
    """Potential of the friction between yarns (J); order as in ``add_flat_contact``."""
    size = slip.pairs.size if order > 0 else 0
    near, push = np.empty((size, 3), dtype=np.int64), np.empty((size, 20))
    buffers = np.zeros((5, 5)), np.zeros((5, 3)), np.zeros(3)
    energy, count = _bent_pairs(scene, lattice, slip, order, near, push, buffers, work)
    if count > 0:
        add_gaps(scene, near[:count], push[:count], order, work)
    return energy


@leaf
def _bent_pairs(scene, lattice, slip, order, near, push, buffers, work):
    """Energy (J) of the pairs and how many rub; fills of these near and push, as of ``add_gaps``."""
    kappa, points, energy, count = curvature_at(scene, lattice), work.points, 0.0, 0
    bend, by, turned = buffers
    for j in range(slip.pairs.size):
        rub = slip.pairs[j]
        if rub.limit == 0.0:
            continue
        pair = (rub.pair[0], rub.pair[1], rub.pair[2])
        gaps = gaps_at(scene, points, lattice, pair)
        u, size = across(vector_at(gaps, kappa), rub.anchor, rub.normal)
        v, f, tail = spring_at(size, rub.stiffness, rub.limit)
        energy += v
        if order == 0:
            continue
        dx, _, zi, zk = gaps
        s, sk, skk = arm_at(dx, kappa)
        c, half = math.cos(0.5 * kappa * dx), 0.5 * kappa
        both, z, dz = 2.0 + kappa * (zi + zk), zi + zk, zi - zk
        # Derivatives of d by dx, dy, z_i, z_k, kappa; c' = -kappa^2 s/2, dc/dkappa = -kappa dx s/2.
        by[0, 0], by[0, 2] = 0.5 * both * c, -dz * half * kappa * s
        by[1, 1] = 1.0
        by[2, 0], by[2, 2] = kappa * s, c
        by[3, 0], by[3, 2] = kappa * s, -c
        by[4, 0], by[4, 2] = z * s + both * sk, -dz * half * dx * s
        for a in range(5):
            push[count, a] = f * (by[a, 0] * u[0] + by[a, 1] * u[1] + by[a, 2] * u[2])
        if order == 2:
            h = slip_matrix(f, tail / (size * size) if tail != 0.0 else 0.0, rub.normal, u)
            for a in range(5):
                for r in range(3):
                    turned[r] = h[r][0] * by[a, 0] + h[r][1] * by[a, 1] + h[r][2] * by[a, 2]
                for b in range(a + 1):
                    bend[b, a] = turned[0] * by[b, 0] + turned[1] * by[b, 1] + turned[2] * by[b, 2]
            fx, fz = f * u[0], f * u[2]
            # d(kappa s)/dkappa = dx c/2.
            bend[0, 0] -= 0.5 * half * kappa * (fx * both * s + fz * dz * c)
            bend[0, 2] += half * (fx * c - fz * kappa * s)
            bend[0, 3] += half * (fx * c + fz * kappa * s)
            bend[0, 4] += 0.5 * fx * (z * c - both * half * dx * s)
            bend[0, 4] -= 0.5 * fz * dz * kappa * (s + 0.5 * dx * c)
            bend[2, 4] += 0.5 * dx * (fx * c - fz * kappa * s)
            bend[3, 4] += 0.5 * dx * (fx * c + fz * kappa * s)
            bend[4, 4] += fx * (2.0 * z * sk + both * skk) - 0.25 * fz * dz * dx * dx * c
            at = 5
            for a in range(5):
                for b in range(a, 5):
                    push[count, at] = bend[a, b]
                    at += 1
        for axis in range(3):
            near[count, axis] = pair[axis]
        count += 1
    return energy, count

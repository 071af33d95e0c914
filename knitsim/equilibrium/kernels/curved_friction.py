"""Friction in a bent fabric: between yarns at their contacts, and within the yarn (compiled).

Between yarns it is Coulomb's law as in :mod:`knitsim.equilibrium.kernels.friction`.  The vector between
two centre lines is taken in the frame that turns with the fabric, half way between the two points,

    d = ((m_1 + m_2) s, dy, dz c),   s = sin(kappa dx/2)/kappa,   c = cos(kappa dx/2),

so that a rotation of the whole about the axis is no slip.

Within the yarn a couple M0 opposes every change of the curvature: over a step the potential is
M0 f0(|e.b - e.b0|) per reference length, where b is the turning of the yarn's tangent per reference
length, a vector, b0 that at the start of the step, and e = b0/|b0|.  So the curvature counts along the
direction it has, with a sign, and a yarn that is bent straight and to the other side goes through zero;
the direction itself may change freely, as the spin of the yarn is not followed.
"""

import math

import numpy as np

from knitsim.equilibrium.kernels.contact import law_at
from knitsim.equilibrium.kernels.curved import (
    add_gaps,
    add_local,
    gaps_at,
    local_values,
    local_variables,
    motion,
)
from knitsim.equilibrium.kernels.friction import LAG, RUB, Slip, across, rise_at, slip_matrix
from knitsim.jit import njit

STRAIGHT = 1e-6  # 1/m: below it the curvature has no direction, and the axis of the cylinder stands


@njit
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


@njit
def vector_at(gaps, kappa):
    """The vector d between the centre lines of a pair (m)."""
    dx, dy, zi, zk = gaps
    s, _, _ = arm_at(dx, kappa)
    return ((2.0 + kappa * (zi + zk)) * s, dy, (zi - zk) * math.cos(0.5 * kappa * dx))


@njit
def add_curved_friction(scene, kappa, points, lattice, slip, order, out):
    """Potential of the friction between yarns (J); order as in ``add_contact``."""
    energy = 0.0
    table = (np.zeros((4, 10), dtype=np.int64), np.zeros((4, 10)))
    slope, bend = np.zeros(5), np.zeros((5, 5))
    by, turned = np.zeros((5, 3)), np.zeros(3)
    for j in range(slip.pairs.size):
        rub = slip.pairs[j]
        if rub.limit == 0.0:
            continue
        pair = (rub.pair[0], rub.pair[1], rub.pair[2])
        gaps = gaps_at(scene, points, lattice, pair)
        u, size = across(vector_at(gaps, kappa), rub.start, rub.normal)
        f0, over, f2 = rise_at(size, slip.rounding)
        energy += rub.limit * f0
        if order == 0:
            continue
        f = rub.limit * over
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
            slope[a] = f * (by[a, 0] * u[0] + by[a, 1] * u[1] + by[a, 2] * u[2])
        if order == 2:
            tail = rub.limit * (f2 - over) / (size * size) if size > 0.0 else 0.0
            h = slip_matrix(f, tail, rub.normal, u)
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
        add_gaps(scene, pair, order, slope, bend, table, out)
    return energy


@njit
def cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@njit
def turning(v, w, span):
    """Turning of the tangent per reference length, a vector (1/m): v x w/(v^2 span)."""
    scale = 1.0 / (span * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
    b = cross(v, w)
    return (scale * b[0], scale * b[1], scale * b[2])


@njit
def add_lag(scene, kappa, x, slip, order, out):
    """Potential of the yarn's lagging couple (J); order as in ``add_contact``."""
    energy = 0.0
    if slip.lags.size == 0:
        return energy
    axes, weights, local = np.empty(7, dtype=np.int64), np.empty((7, 4)), np.empty(7)
    form, tangent, by = np.empty(6), np.zeros((6, 6)), np.empty(6)
    for p in range(slip.lags.size):
        point, lag = scene.rod[p], slip.lags[p]
        local_variables(point, scene.bend.direction, axes, weights)
        local_values(point.first, x, axes, weights, local)
        v, w = motion(local, kappa)
        e = (lag.axis[0], lag.axis[1], lag.axis[2])
        b = turning(v, w, point.span)
        turn = e[0] * b[0] + e[1] * b[1] + e[2] * b[2]
        change = turn - lag.start
        f0, over, f2 = rise_at(abs(change), slip.turn)
        energy += lag.couple * f0
        if order == 0:
            continue
        # turn = e.(v x w)/(a span), a = v.v.
        ia = 1.0 / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        scale, we, ev = ia / point.span, cross(w, e), cross(e, v)
        f = lag.couple * over * change
        for i in range(3):
            by[i] = scale * we[i] - 2.0 * turn * ia * v[i]
            by[3 + i] = scale * ev[i]
        for i in range(6):
            form[i] = f * by[i]
        if order == 2:
            for i in range(6):
                for j in range(6):
                    tangent[i, j] = lag.couple * f2 * by[i] * by[j]
            for i in range(3):
                tangent[i, i] -= f * 2.0 * turn * ia
                for j in range(3):
                    mixed = -2.0 * scale * ia * v[i] * ev[j]
                    # d2 (e.v x w)/dv_i dw_j
                    if j == (i + 1) % 3:
                        mixed += scale * e[(i + 2) % 3]
                    elif i == (j + 1) % 3:
                        mixed -= scale * e[(j + 2) % 3]
                    tangent[i, 3 + j] += f * mixed
                    tangent[3 + j, i] += f * mixed
                    h = 8.0 * turn * ia * v[i] * v[j] - 2.0 * scale * (we[i] * v[j] + v[i] * we[j])
                    tangent[i, j] += f * ia * h
        add_local(point.first, local, kappa, order, (form, tangent, axes, weights), out)
    return energy


@njit
def curved_lag_at(scene, kappa, points, lattice, weight, friction, slip):
    """As ``lag_at`` in a bent fabric: fill normal and limit of the slip from the contact forces.

    Returns the change of the limits, weighed by the slips, over the limits so weighed.
    """
    changed = whole = 0.0
    for j in range(weight.size):
        rub = slip.pairs[j]
        d = vector_at(
            gaps_at(scene, points, lattice, (rub.pair[0], rub.pair[1], rub.pair[2])), kappa
        )
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        distance = math.sqrt(square)
        _, v1, _ = law_at(square, scene.law)
        for axis in range(3):
            rub.normal[axis] = d[axis] / distance
        limit = -2.0 * distance * v1 * weight[j] * friction
        _, size = across(d, rub.start, rub.normal)
        changed += abs(limit - slip.pairs["limit"][j]) * size
        whole += limit * size
        slip.pairs["limit"][j] = limit
    return changed / whole if whole > 0.0 else 0.0


@njit
def turnings_at(scene, kappa, x, turnings):
    """Fill turnings (m, 3) with the yarn's curvature vector at each Gauss point (1/m)."""
    axes, weights, local = np.empty(7, dtype=np.int64), np.empty((7, 4)), np.empty(7)
    for p in range(turnings.shape[0]):
        point = scene.rod[p]
        local_variables(point, scene.bend.direction, axes, weights)
        local_values(point.first, x, axes, weights, local)
        v, w = motion(local, kappa)
        b = turning(v, w, point.span)
        for axis in range(3):
            turnings[p, axis] = b[axis]


@njit
def begin_curved_slip(scene, kappa, x, points, lattice, pairs, rub):
    """Friction of a step that starts at the given control and contact points.

    rub: coefficient of friction between yarns, the rounding of its slip (m), the couple within the
    yarn (N m), the rounding of its curvature (1/m).
    """
    friction, rounding, couple, turn = rub
    listed, weight = pairs
    size = weight.size if friction > 0.0 else 0
    lags = scene.rod.size if couple > 0.0 else 0
    slip = Slip(
        np.empty(size, dtype=RUB),
        np.empty((0, 0), dtype=RUB),
        rounding,
        np.empty(lags, dtype=LAG),
        turn,
    )
    for j in range(size):
        pair = (listed[j, 0], listed[j, 1], listed[j, 2])
        d = vector_at(gaps_at(scene, points, lattice, pair), kappa)
        for axis in range(3):
            slip.pairs["pair"][j, axis] = listed[j, axis]
            slip.pairs["start"][j, axis] = d[axis]
    curved_lag_at(scene, kappa, points, lattice, weight[:size], friction, slip)
    for j in range(size):
        slip.pairs["before"][j] = slip.pairs["limit"][j]
    turnings = np.empty((lags, 3))
    turnings_at(scene, kappa, x, turnings)
    for p in range(lags):
        b = (turnings[p, 0], turnings[p, 1], turnings[p, 2])
        size = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
        for axis in range(3):
            straight = 1.0 if axis == 1 else 0.0
            slip.lags["axis"][p, axis] = b[axis] / size if size > STRAIGHT else straight
        slip.lags["start"][p] = size if size > STRAIGHT else b[1]
        slip.lags["couple"][p] = couple * scene.rod[p].weight
    return slip


@njit
def curved_loss(scene, kappa, x, points, lattice, slip):
    """As ``loss_of`` in a bent fabric: energy lost in the step (J), within the yarn too."""
    lost = 0.0
    for j in range(slip.pairs.size):
        rub = slip.pairs[j]
        d = vector_at(
            gaps_at(scene, points, lattice, (rub.pair[0], rub.pair[1], rub.pair[2])), kappa
        )
        _, size = across(d, rub.start, rub.normal)
        _, over, _ = rise_at(size, slip.rounding)
        lost += 0.5 * (rub.limit + rub.before) * over * size * size
    turnings = np.empty((slip.lags.size, 3))
    turnings_at(scene, kappa, x, turnings)
    for p in range(slip.lags.size):
        lag = slip.lags[p]
        change = -lag.start
        for axis in range(3):
            change += lag.axis[axis] * turnings[p, axis]
        size = abs(change)
        _, over, _ = rise_at(size, slip.turn)
        lost += lag.couple * over * size * size
    return lost

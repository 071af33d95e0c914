"""Friction within the yarn: a couple that opposes every change of its curvature (compiled).

A Jenkins element in each Gauss point, as at the contacts: while the fibres stick the yarn is stiffer by
k, until the couple reaches M0 and they slide.  b is the turning of the yarn's tangent per reference
length, a vector.  Over a step the curvature counts along the direction that it has at the start, e =
b0/|b0|, with a sign, so that a yarn that is bent straight and to the other side goes through zero; the
direction itself may change freely, as the spin of the yarn is not followed.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.curved import add_local, local_values, local_variables, motion
from knitsim.equilibrium.kernels.friction import spring_at
from knitsim.equilibrium.kernels.pairs import curvature_at
from knitsim.equilibrium.kernels.yarn import derivatives_at, scatter
from knitsim.jit import blank, choose, leaf, njit

STRAIGHT = 1e-6  # 1/m: below it the curvature has no direction, and that along the wale stands

# A Gauss point of the yarn over a load step.  axis: e; anchor: curvature along e at which the couple is
# zero (1/m); limit: M0, stiffness: k, each times the reference length that the point stands for.
LAG = np.dtype(
    [("axis", "f8", 3), ("anchor", "f8"), ("limit", "f8"), ("stiffness", "f8")], align=True
)
# What it remembers: e, and the elastic part of the curvature along it (1/m).
LAG_MEMORY = np.dtype([("axis", "f8", 3), ("held", "f8")], align=True)


class Couple(NamedTuple):
    """Friction within the yarn: limit M0 (N m), stiffness k (N m2)."""

    limit: float
    stiffness: float


@leaf
def cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@leaf
def turning(v, w, span):
    """Turning of the tangent per reference length, a vector (1/m): v x w/(v^2 span)."""
    scale = 1.0 / (span * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
    b = cross(v, w)
    return (scale * b[0], scale * b[1], scale * b[2])


@njit
def lag_point(point, lag, v, w, order, form, tangent):
    """Potential (J) of a Gauss point; fills form (6,) and, with order 2, tangent (6, 6)."""
    e = (lag.axis[0], lag.axis[1], lag.axis[2])
    b = turning(v, w, point.span)
    turned = e[0] * b[0] + e[1] * b[1] + e[2] * b[2]
    change = turned - lag.anchor
    energy, over, bend = spring_at(abs(change), lag.stiffness, lag.limit)
    if order == 0:
        return energy
    # turned = e.(v x w)/(a span), a = v.v.
    ia = 1.0 / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    scale, we, ev = ia / point.span, cross(w, e), cross(e, v)
    f, by = over * change, np.empty(6)
    for i in range(3):
        by[i] = scale * we[i] - 2.0 * turned * ia * v[i]
        by[3 + i] = scale * ev[i]
    for i in range(6):
        form[i] = f * by[i]
    if order < 2:
        return energy
    for i in range(6):
        for j in range(6):
            tangent[i, j] = (over + bend) * by[i] * by[j]
    for i in range(3):
        tangent[i, i] -= f * 2.0 * turned * ia
        for j in range(3):
            mixed = -2.0 * scale * ia * v[i] * ev[j]
            # d2 (e.v x w)/dv_i dw_j
            if j == (i + 1) % 3:
                mixed += scale * e[(i + 2) % 3]
            elif i == (j + 1) % 3:
                mixed -= scale * e[(j + 2) % 3]
            tangent[i, 3 + j] += f * mixed
            tangent[3 + j, i] += f * mixed
            h = 8.0 * turned * ia * v[i] * v[j] - 2.0 * scale * (we[i] * v[j] + v[i] * we[j])
            tangent[i, j] += f * ia * h
    return energy


@njit
def _add_flat(scene, lattice, lags, order, work):
    energy, form, tangent = 0.0, np.empty(6), np.empty((6, 6))
    for p in range(lags.size):
        v, w = derivatives_at(scene.rod[p], work.x)
        energy += lag_point(scene.rod[p], lags[p], v, w, order, form, tangent)
        if order > 0:
            scatter(scene.rod[p], form, tangent, order, work.expanded, work.half)
    return energy


@njit
def _add_bent(scene, lattice, lags, order, work):
    energy, form, tangent = 0.0, np.empty(6), np.empty((6, 6))
    axes, weights, local = np.empty(7, dtype=np.int64), np.empty((7, 4)), np.empty(7)
    kappa = curvature_at(scene, lattice)
    for p in range(lags.size):
        point = scene.rod[p]
        local_variables(point, scene.bend.direction, axes, weights)
        local_values(point.first, work.x, axes, weights, local)
        v, w = motion(local, kappa)
        energy += lag_point(point, lags[p], v, w, order, form, tangent)
        if order > 0:
            add_local(point.first, local, kappa, order, (form, tangent, axes, weights), work)
    return energy


# Potential of the yarn's lagging couple (J); order as in ``add_flat_contact``.
add_lags = choose("scene.bend", _add_bent, _add_flat)


@leaf
def _flat_turning(scene, lattice, p, work):
    v, w = derivatives_at(scene.rod[p], work.x)
    return turning(v, w, scene.rod[p].span)


@njit
def _bent_turning(scene, lattice, p, work):
    point = scene.rod[p]
    axes, weights, local = np.empty(7, dtype=np.int64), np.empty((7, 4)), np.empty(7)
    local_variables(point, scene.bend.direction, axes, weights)
    local_values(point.first, work.x, axes, weights, local)
    v, w = motion(local, curvature_at(scene, lattice))
    return turning(v, w, point.span)


turning_at = choose("scene.bend", _bent_turning, _flat_turning)


@njit
def begin_lags(scene, lattice, couple, memory, work):
    """A LAG for each Gauss point, at the start of a step; memory: as of ``end_lags``, or none."""
    lags = blank(scene.rod.size, LAG)
    for p in range(lags.size):
        b, lag = turning_at(scene, lattice, p, work), lags[p]
        size = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
        along = 0.0
        for axis in range(3):
            straight = 1.0 if axis == 1 else 0.0
            lag.axis[axis] = b[axis] / size if size > STRAIGHT else straight
            if memory.size:
                along += lag.axis[axis] * memory[p].axis[axis]
        lag.anchor = size if size > STRAIGHT else b[1]
        if memory.size:
            # Bent through zero, the direction has turned round.
            lag.anchor -= memory[p].held if along >= 0.0 else -memory[p].held
        lag.limit = couple.limit * scene.rod[p].weight
        lag.stiffness = couple.stiffness * scene.rod[p].weight
    return lags


@njit
def end_lags(scene, lattice, lags, work):
    """What the yarn remembers after a step (LAG_MEMORY), energy lost and held (J)."""
    memory = blank(lags.size, LAG_MEMORY)
    lost = held = 0.0
    for p in range(lags.size):
        lag, b = lags[p], turning_at(scene, lattice, p, work)
        change = -lag.anchor
        for axis in range(3):
            change += lag.axis[axis] * b[axis]
            memory[p].axis[axis] = lag.axis[axis]
        most = lag.limit / lag.stiffness
        kept = min(max(change, -most), most)
        memory[p].held = kept
        lost += lag.limit * abs(change - kept)
        held += 0.5 * lag.stiffness * kept * kept
    return memory, lost, held

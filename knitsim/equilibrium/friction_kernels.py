"""Coulomb friction at the contacts as an incremental potential (compiled).

Over one load step from y0 to y a pair slips by u, the part of d(y) - d(y0) across its normal, d being
the vector between the centre lines.  The potential is sum w mu N f0(|u|), with the normal force N
and the normal lagged (taken at the last pass), and f0' = f1 rising from 0 to 1 over the slip
``rounding``: f1 = 2 s/r - (s/r)^2 for s < r, 1 beyond.  Its minimum is the implicit step of Coulomb's
law in the limit of small rounding.  Friction between centre lines: the spin of the yarn about its
own axis is not followed.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.contact_kernels import (
    add_pair,
    law_at,
    scatter_pair,
    separation,
)
from knitsim.equilibrium.cylinder_kernels import add_point, from_axis, scatter_point
from knitsim.jit import njit


class Slip(NamedTuple):
    """Friction pairs of one load step.

    pairs (n, 3); start (n, 3): d at the start (m); normal (n, 3): lagged unit normal; limit (n,):
    weight mu N of the lag (N); before (n,): the same at the start of the step; rounding (m).
    wrap_...: the same for every contact point on every rigid cylinder, (cylinders, points, ...).
    """

    pairs: np.ndarray
    start: np.ndarray
    normal: np.ndarray
    limit: np.ndarray
    before: np.ndarray
    rounding: float
    wrap_start: np.ndarray
    wrap_normal: np.ndarray
    wrap_limit: np.ndarray
    wrap_before: np.ndarray


@njit
def no_slip():
    """Friction of a scene that has none."""
    return Slip(
        np.empty((0, 3), dtype=np.int64),
        np.empty((0, 3)),
        np.empty((0, 3)),
        np.empty(0),
        np.empty(0),
        1.0,
        np.empty((0, 0, 3)),
        np.empty((0, 0, 3)),
        np.empty((0, 0)),
        np.empty((0, 0)),
    )


@njit
def lag_at(scene, points, lattice, weight, friction, slip):
    """Fill slip.normal and slip.limit from the contact forces at the given points."""
    for j in range(weight.size):
        pair = (slip.pairs[j, 0], slip.pairs[j, 1], slip.pairs[j, 2])
        d = separation(scene.touch, points, lattice, pair)
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        distance = math.sqrt(square)
        _, v1, _ = law_at(square, scene.law)
        for axis in range(3):
            slip.normal[j, axis] = d[axis] / distance
        slip.limit[j] = -2.0 * distance * v1 * weight[j] * friction
    for c in range(slip.wrap_limit.shape[0]):
        for i in range(points.shape[0]):
            d = from_axis(scene.cylinders, c, points, i)
            square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            distance = math.sqrt(square)
            _, v1, _ = law_at(square, scene.cylinders.law[c])
            for axis in range(3):
                slip.wrap_normal[c, i, axis] = d[axis] / distance
            slip.wrap_limit[c, i] = -2.0 * distance * v1 * scene.touch.length[i] * friction


@njit
def begin_slip(scene, points, lattice, pairs, friction, rounding):
    """Friction pairs for a load step that starts at the given points."""
    n, c, m = pairs[1].size, scene.cylinders.law.shape[0], points.shape[0]
    slip = Slip(
        pairs[0],
        np.empty((n, 3)),
        np.empty((n, 3)),
        np.empty(n),
        np.empty(n),
        rounding,
        np.empty((c, m, 3)),
        np.empty((c, m, 3)),
        np.empty((c, m)),
        np.empty((c, m)),
    )
    for i in range(c):
        slip.wrap_start[i] = points
    for j in range(n):
        d = separation(
            scene.touch, points, lattice, (pairs[0][j, 0], pairs[0][j, 1], pairs[0][j, 2])
        )
        for axis in range(3):
            slip.start[j, axis] = d[axis]
    lag_at(scene, points, lattice, pairs[1], friction, slip)
    slip.before[:] = slip.limit
    slip.wrap_before[:] = slip.wrap_limit
    return slip


@njit
def across(d, start, n):
    """The part of d - start across the unit normal n, and its size (m)."""
    a, b, c = d[0] - start[0], d[1] - start[1], d[2] - start[2]
    along = a * n[0] + b * n[1] + c * n[2]
    u = (a - along * n[0], b - along * n[1], c - along * n[2])
    return u, math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])


@njit
def rise_at(size, rounding):
    """f0 (m), f1/size (1/m) and f1' (1/m) at a slip of this size."""
    if size >= rounding:
        return size - rounding / 3.0, 1.0 / size, 0.0
    x = size / rounding
    return size * x * (1.0 - x / 3.0), (2.0 - x) / rounding, (2.0 - 2.0 * x) / rounding


@njit
def slip_matrix(f, bend, n, u):
    """f (I - n n^T) + bend u u^T as a tuple of rows."""
    return (
        (
            f * (1.0 - n[0] * n[0]) + bend * u[0] * u[0],
            -f * n[0] * n[1] + bend * u[0] * u[1],
            -f * n[0] * n[2] + bend * u[0] * u[2],
        ),
        (
            -f * n[1] * n[0] + bend * u[1] * u[0],
            f * (1.0 - n[1] * n[1]) + bend * u[1] * u[1],
            -f * n[1] * n[2] + bend * u[1] * u[2],
        ),
        (
            -f * n[2] * n[0] + bend * u[2] * u[0],
            -f * n[2] * n[1] + bend * u[2] * u[1],
            f * (1.0 - n[2] * n[2]) + bend * u[2] * u[2],
        ),
    )


@njit
def add_friction(scene, points, lattice, slip, order, gradient, half):
    """Potential of the friction forces (J); order as in ``add_contact``."""
    touch = scene.touch
    energy = 0.0
    for j in range(slip.limit.size):
        limit = slip.limit[j]
        if limit == 0.0:
            continue
        pair = (slip.pairs[j, 0], slip.pairs[j, 1], slip.pairs[j, 2])
        u, size = across(separation(touch, points, lattice, pair), slip.start[j], slip.normal[j])
        f0, over, f2 = rise_at(size, slip.rounding)
        energy += limit * f0
        if order == 0:
            continue
        f = limit * over
        scatter_pair(touch, pair, (f * u[0], f * u[1], f * u[2]), gradient)
        if order == 2:
            bend = limit * (f2 - over) / (size * size) if size > 0.0 else 0.0
            add_pair(touch, pair, slip_matrix(f, bend, slip.normal[j], u), half)
    for c in range(slip.wrap_limit.shape[0]):
        for i in range(points.shape[0]):
            limit = slip.wrap_limit[c, i]
            if limit == 0.0:
                continue
            u, size = across(points[i], slip.wrap_start[c, i], slip.wrap_normal[c, i])
            f0, over, f2 = rise_at(size, slip.rounding)
            energy += limit * f0
            if order == 0:
                continue
            f = limit * over
            scatter_point(touch, i, (f * u[0], f * u[1], f * u[2]), gradient)
            if order == 2:
                bend = limit * (f2 - over) / (size * size) if size > 0.0 else 0.0
                add_point(touch, i, slip_matrix(f, bend, slip.wrap_normal[c, i], u), half)
    return energy


@njit
def loss_of(scene, points, lattice, slip):
    """Energy lost in the step (J): friction force times slip, the force the mean over the step."""
    lost = 0.0
    for j in range(slip.limit.size):
        pair = (slip.pairs[j, 0], slip.pairs[j, 1], slip.pairs[j, 2])
        d = separation(scene.touch, points, lattice, pair)
        _, size = across(d, slip.start[j], slip.normal[j])
        _, over, _ = rise_at(size, slip.rounding)
        lost += 0.5 * (slip.limit[j] + slip.before[j]) * over * size * size
    for c in range(slip.wrap_limit.shape[0]):
        for i in range(points.shape[0]):
            _, size = across(points[i], slip.wrap_start[c, i], slip.wrap_normal[c, i])
            _, over, _ = rise_at(size, slip.rounding)
            lost += 0.5 * (slip.wrap_limit[c, i] + slip.wrap_before[c, i]) * over * size * size
    return lost

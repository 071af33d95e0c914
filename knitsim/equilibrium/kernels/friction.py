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

from knitsim.equilibrium.kernels.contact import add_pushes, law_at, separation
from knitsim.equilibrium.kernels.fixtures import add_point, from_axis, scatter_point
from knitsim.jit import njit

# One place that rubs over a load step.  i, k, g: the pair; start: d at the start (m); normal: lagged
# unit normal; limit: weight mu N of the lag (N); before: the same at the start of the step.
RUB = np.dtype(
    [
        ("pair", "i8", 3),
        ("start", "f8", 3),
        ("normal", "f8", 3),
        ("limit", "f8"),
        ("before", "f8"),
    ],
    align=True,
)


# A Gauss point of the yarn whose bending couple lags.  axis: unit vector of its curvature at the start
# of the step, start: the curvature then (1/m); couple: M0 times the reference length it stands for
# (N m2).
LAG = np.dtype([("axis", "f8", 3), ("start", "f8"), ("couple", "f8")], align=True)


class Slip(NamedTuple):
    """Friction of one load step.

    pairs (n,): a RUB for each listed pair; wraps (cylinders, points): one for every contact point on
    every rigid cylinder, its pair unused; rounding (m).  lags: a LAG for each Gauss point of the yarn,
    or none; turn: their rounding (1/m).
    """

    pairs: np.ndarray
    wraps: np.ndarray
    rounding: float
    lags: np.ndarray
    turn: float


@njit
def no_slip():
    """Friction of a scene that has none."""
    return Slip(
        np.empty(0, dtype=RUB), np.empty((0, 0), dtype=RUB), 1.0, np.empty(0, dtype=LAG), 1.0
    )


@njit
def lag_at(scene, points, lattice, weight, friction, slip):
    """Fill normal and limit of the slip from the contact forces at the given points."""
    pairs, normal, limit = slip.pairs["pair"], slip.pairs["normal"], slip.pairs["limit"]
    for j in range(weight.size):
        pair = (pairs[j, 0], pairs[j, 1], pairs[j, 2])
        d = separation(scene.touch, points, lattice, pair)
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        distance = math.sqrt(square)
        _, v1, _ = law_at(square, scene.law)
        for axis in range(3):
            normal[j, axis] = d[axis] / distance
        limit[j] = -2.0 * distance * v1 * weight[j] * friction
    wrap_normal, wrap_limit = slip.wraps["normal"], slip.wraps["limit"]
    for c in range(wrap_limit.shape[0]):
        for i in range(points.shape[0]):
            d = from_axis(scene.cylinders, c, points, i)
            square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            distance = math.sqrt(square)
            _, v1, _ = law_at(square, scene.cylinders[c].law)
            for axis in range(3):
                wrap_normal[c, i, axis] = d[axis] / distance
            wrap_limit[c, i] = -2.0 * distance * v1 * scene.touch.points[i].length * friction


@njit
def begin_slip(scene, points, lattice, pairs, friction, rounding):
    """Friction pairs for a load step that starts at the given points."""
    listed, weight = pairs
    slip = Slip(
        np.empty(weight.size, dtype=RUB),
        np.empty((scene.cylinders.size, points.shape[0]), dtype=RUB),
        rounding,
        np.empty(0, dtype=LAG),
        1.0,
    )
    for j in range(weight.size):
        pair = (listed[j, 0], listed[j, 1], listed[j, 2])
        d = separation(scene.touch, points, lattice, pair)
        for axis in range(3):
            slip.pairs["pair"][j, axis] = listed[j, axis]
            slip.pairs["start"][j, axis] = d[axis]
    for c in range(scene.cylinders.size):
        for i in range(points.shape[0]):
            for axis in range(3):
                slip.wraps["start"][c, i, axis] = points[i, axis]
    lag_at(scene, points, lattice, weight, friction, slip)
    for j in range(weight.size):
        slip.pairs["before"][j] = slip.pairs["limit"][j]
    for c in range(scene.cylinders.size):
        for i in range(points.shape[0]):
            slip.wraps["before"][c, i] = slip.wraps["limit"][c, i]
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
    pairs, limits = slip.pairs["pair"], slip.pairs["limit"]
    starts, normals = slip.pairs["start"], slip.pairs["normal"]
    room = slip.pairs.size if order > 0 else 0
    near, push = np.empty((room, 3), dtype=np.int64), np.empty((room, 9))
    energy, count = 0.0, 0
    for j in range(slip.pairs.size):
        limit = limits[j]
        if limit == 0.0:
            continue
        pair = (pairs[j, 0], pairs[j, 1], pairs[j, 2])
        u, size = across(separation(touch, points, lattice, pair), starts[j], normals[j])
        f0, over, f2 = rise_at(size, slip.rounding)
        energy += limit * f0
        if order == 0:
            continue
        f = limit * over
        bend = limit * (f2 - over) / (size * size) if size > 0.0 else 0.0
        h = slip_matrix(f, bend, normals[j], u)
        for axis in range(3):
            near[count, axis], push[count, axis] = pair[axis], f * u[axis]
        push[count, 3], push[count, 4], push[count, 5] = h[0][0], h[0][1], h[0][2]
        push[count, 6], push[count, 7], push[count, 8] = h[1][1], h[1][2], h[2][2]
        count += 1
    if count > 0:
        add_pushes(touch, near[:count], push[:count], order, gradient, half)
    limits, starts, normals = slip.wraps["limit"], slip.wraps["start"], slip.wraps["normal"]
    for c in range(slip.wraps.shape[0]):
        for i in range(points.shape[0]):
            limit = limits[c, i]
            if limit == 0.0:
                continue
            place = (points[i, 0], points[i, 1], points[i, 2])
            u, size = across(place, starts[c, i], normals[c, i])
            f0, over, f2 = rise_at(size, slip.rounding)
            energy += limit * f0
            if order == 0:
                continue
            f = limit * over
            scatter_point(touch, i, (f * u[0], f * u[1], f * u[2]), gradient)
            if order == 2:
                bend = limit * (f2 - over) / (size * size) if size > 0.0 else 0.0
                add_point(touch, i, slip_matrix(f, bend, normals[c, i], u), half)
    return energy


@njit
def loss_of(scene, points, lattice, slip):
    """Energy lost in the step (J): friction force times slip, the force the mean over the step."""
    pairs, starts, normals = slip.pairs["pair"], slip.pairs["start"], slip.pairs["normal"]
    lost = 0.0
    for j in range(slip.pairs.size):
        d = separation(scene.touch, points, lattice, (pairs[j, 0], pairs[j, 1], pairs[j, 2]))
        _, size = across(d, starts[j], normals[j])
        _, over, _ = rise_at(size, slip.rounding)
        mean = 0.5 * (slip.pairs[j]["limit"] + slip.pairs[j]["before"])
        lost += mean * over * size * size
    starts, normals = slip.wraps["start"], slip.wraps["normal"]
    for c in range(slip.wraps.shape[0]):
        for i in range(points.shape[0]):
            place = (points[i, 0], points[i, 1], points[i, 2])
            _, size = across(place, starts[c, i], normals[c, i])
            _, over, _ = rise_at(size, slip.rounding)
            mean = 0.5 * (slip.wraps[c, i]["limit"] + slip.wraps[c, i]["before"])
            lost += mean * over * size * size
    return lost

"""Friction of a scene over a load step: begun, lagged, added to the energy, ended (compiled).

Chooses by the types of the scene what there is: between yarns, flat or bent; on rigid cylinders; within
the yarn.
"""

import math

import numpy as np

from knitsim.equilibrium.kernels.contact import (
    barrier_at,
    dot,
    flat_mean,
    separation,
    steps_at,
)
from knitsim.equilibrium.kernels.curved import chord_square
from knitsim.equilibrium.kernels.curved_contact import (
    bent_mean,
    bent_slopes,
    bent_square,
    bent_steps,
    gaps_at,
)
from knitsim.equilibrium.kernels.curved_friction import add_bent_friction, vector_at
from knitsim.equilibrium.kernels.fixtures import add_point, from_axis, law_of, scatter_point
from knitsim.equilibrium.kernels.friction import (
    MEMORY,
    RUB,
    Memory,
    Slip,
    across,
    add_flat_friction,
    ask,
    begin,
    end,
    precedes,
    recall,
    share_of,
    slip_matrix,
    spring_at,
    turn,
)
from knitsim.equilibrium.kernels.lag import add_lags, begin_lags, end_lags
from knitsim.equilibrium.kernels.pairs import curvature_at, expand, place_frames, touching
from knitsim.jit import blank, choose, leaf, njit


@leaf
def _flat_vector(scene, lattice, pair, work):
    return separation(scene.touch, work.points, lattice, pair)


@leaf
def _bent_vector(scene, lattice, pair, work):
    return vector_at(gaps_at(scene, work.points, lattice, pair), curvature_at(scene, lattice))


vector_of = choose("scene.bend", _bent_vector, _flat_vector)
add_pairs = choose("scene.bend", add_bent_friction, add_flat_friction)


@leaf
def _no_lags(scene, lattice, lags, order, work):
    return 0.0


add_lagging = choose("lags", add_lags, _no_lags)


@leaf
def _flat_press(scene, lattice, pair, work):
    d = separation(scene.touch, work.points, lattice, pair)
    if dot(d, d) >= touching(scene) ** 2:
        return 0.0
    mean = flat_mean(d, steps_at(scene.touch, work.points, pair), scene.law)
    return -2.0 * math.sqrt(dot(d, d)) * mean[1]


@leaf
def _bent_press(scene, lattice, pair, work):
    kappa = curvature_at(scene, lattice)
    gaps = gaps_at(scene, work.points, lattice, pair)
    chord = chord_square(gaps[0], kappa)
    square = bent_square(gaps, kappa, chord)
    if square >= touching(scene) ** 2:
        return 0.0
    by, steps = bent_slopes(gaps, kappa, chord), bent_steps(scene, work.points, pair)
    return -2.0 * math.sqrt(square) * bent_mean(gaps, kappa, chord, steps, by, scene.law)[1]


# Force with which two contact points press, per length of both yarns (N/m2).
press_of = choose("scene.bend", _bent_press, _flat_press)


@leaf
def _no_wraps(scene, slip, rub, work, first):
    return 0.0, 0.0


@leaf
def _ask_wraps(scene, slip, rub, work, first):
    """Limits on the cylinders as found; first: at the start of the step."""
    along = moved = 0.0
    cylinders, points = scene.fixtures.cylinders, work.points
    for c in range(cylinders.size):
        for i in range(points.shape[0]):
            wrap, length = slip.wraps[c, i], scene.touch.points[i].length
            place = (points[i, 0], points[i, 1], points[i, 2])
            d = from_axis(cylinders, c, points, i)
            square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            _, slope, _ = barrier_at(square, law_of(cylinders[c]))
            limit = -2.0 * math.sqrt(square) * slope * length * rub.friction
            if first:
                begin(wrap, d, place, limit, cylinders[c].shell * length)
            else:
                a, b = ask(wrap, limit)
                along += a
                moved += b
    return along, moved


@leaf
def _turn_wraps(scene, slip, rub, work, first):
    """Normals and limits on the cylinders; what that changes of the friction forces, and these (N)."""
    changed = whole = 0.0
    cylinders, points = scene.fixtures.cylinders, work.points
    for c in range(cylinders.size):
        for i in range(points.shape[0]):
            place = (points[i, 0], points[i, 1], points[i, 2])
            d = from_axis(cylinders, c, points, i)
            change, force = turn(slip.wraps[c, i], d, place, slip.share[0])
            changed += change
            whole += force
    return changed, whole


@leaf
def _add_wraps(scene, slip, order, work):
    """Potential of friction on the cylinders (J)."""
    energy, points = 0.0, work.points
    for c in range(slip.wraps.shape[0]):
        for i in range(points.shape[0]):
            rub = slip.wraps[c, i]
            if rub.limit == 0.0:
                continue
            place = (points[i, 0], points[i, 1], points[i, 2])
            u, size = across(place, rub.anchor, rub.normal)
            v, f, bend = spring_at(size, rub.stiffness, rub.limit)
            energy += v
            if order == 0:
                continue
            scatter_point(scene.touch, i, (f * u[0], f * u[1], f * u[2]), work.expanded)
            if order == 2:
                bend = bend / (size * size) if bend != 0.0 else 0.0
                add_point(scene.touch, i, slip_matrix(f, bend, rub.normal, u), work.half)
    return energy


@leaf
def _end_wraps(scene, slip, memory, work):
    """Energy lost and held (J) on the cylinders; fills memory (cylinders, points)."""
    lost = held = 0.0
    for c in range(memory.shape[0]):
        for i in range(memory.shape[1]):
            place = (work.points[i, 0], work.points[i, 1], work.points[i, 2])
            d = from_axis(scene.fixtures.cylinders, c, work.points, i)
            gone, kept = end(slip.wraps[c, i], d, place, memory[c, i])
            lost += gone
            held += kept
    return lost, held


@leaf
def _no_end(scene, slip, memory, work):
    return 0.0, 0.0


@leaf
def _no_add(scene, slip, order, work):
    return 0.0


ask_wraps = choose("scene.fixtures", _ask_wraps, _no_wraps)
turn_wraps = choose("scene.fixtures", _turn_wraps, _no_wraps)
add_wraps = choose("scene.fixtures", _add_wraps, _no_add)
end_wraps = choose("scene.fixtures", _end_wraps, _no_end)


@leaf
def _without_couple(scene, lattice, couple, memory, work):
    return ()


@leaf
def _without_lags(scene, lattice, lags, work):
    return (), 0.0, 0.0


begin_lagging = choose("couple", begin_lags, _without_couple)
end_lagging = choose("lags", end_lags, _without_lags)


@njit
def begin_slip(scene, y, listed, rub, memory, work):
    """The :class:`Slip` of a load step that starts at y with what is remembered there."""
    lattice = expand(scene.map, y, work.x)
    place_frames(scene.touch, work.x, work.points)
    rubs = blank(listed.weight.size, RUB)
    for j in range(rubs.size):
        for axis in range(3):
            rubs[j].pair[axis] = listed.pairs[j, axis]
    recall(rubs, memory.pairs)
    for j in range(rubs.size):
        pair = (rubs[j].pair[0], rubs[j].pair[1], rubs[j].pair[2])
        d = vector_of(scene, lattice, pair, work)
        weight = listed.weight[j]
        limit = press_of(scene, lattice, pair, work) * weight * rub.friction
        begin(rubs[j], d, d, limit, rub.shell * weight)
    wraps = blank(memory.wraps.shape, RUB)
    for c in range(wraps.shape[0]):
        for i in range(wraps.shape[1]):
            for axis in range(3):
                wraps[c, i].held[axis] = memory.wraps[c, i].held[axis]
                wraps[c, i].facing[axis] = memory.wraps[c, i].facing[axis]
    lags = begin_lagging(scene, lattice, rub.couple, memory.lags, work)
    slip = Slip(rubs, wraps, lags, np.array([1.0, 0.0]))
    ask_wraps(scene, slip, rub, work, True)
    return slip


@njit
def lag_slip(scene, y, slip, rub, work):
    """Take normals and limits anew at y; returns how much of the friction force that changes (1)."""
    lattice = expand(scene.map, y, work.x)
    place_frames(scene.touch, work.x, work.points)
    along, moved = ask_wraps(scene, slip, rub, work, False)
    for j in range(slip.pairs.size):
        place = slip.pairs[j]
        pair = (place.pair[0], place.pair[1], place.pair[2])
        weight = place.stiffness / rub.shell
        a, b = ask(place, press_of(scene, lattice, pair, work) * weight * rub.friction)
        along, moved = along + a, moved + b
    share = share_of(slip.share, along, moved)
    changed = whole = 0.0
    for j in range(slip.pairs.size):
        place = slip.pairs[j]
        if place.asked == 0.0 and place.limit == 0.0:
            continue
        d = vector_of(scene, lattice, (place.pair[0], place.pair[1], place.pair[2]), work)
        change, force = turn(place, d, d, share)
        changed += change
        whole += force
    change, force = turn_wraps(scene, slip, rub, work, False)
    changed, whole = changed + change, whole + force
    return changed / whole if whole > 0.0 else 0.0


@njit
def all_rub(scene, y, slip, listed, work):
    """Whether every listed pair that presses at y is among those that rub."""
    if slip.pairs.size == 0:
        return listed.weight.size == 0
    lattice = expand(scene.map, y, work.x)
    place_frames(scene.touch, work.x, work.points)
    at = 0
    for j in range(listed.weight.size):
        i, k, g = listed.pairs[j, 0], listed.pairs[j, 1], listed.pairs[j, 2]
        if press_of(scene, lattice, (i, k, g), work) == 0.0:
            continue
        while at < slip.pairs.size and precedes(slip.pairs[at].pair, i, k, g):
            at += 1
        if at == slip.pairs.size:
            return False
        pair = slip.pairs[at].pair
        if pair[0] != i or pair[1] != k or pair[2] != g:
            return False
    return True


@leaf
def add_friction(scene, lattice, slip, order, work):
    """Potential (J) of all friction; order as in ``add_flat_contact``."""
    energy = add_pairs(scene, lattice, slip, order, work)
    energy += add_wraps(scene, slip, order, work)
    return energy + add_lagging(scene, lattice, slip.lags, order, work)


@njit
def end_slip(scene, y, slip, work):
    """The :class:`Memory` after a step that ends at y, energy lost in it, energy held in the springs (J)."""
    lattice = expand(scene.map, y, work.x)
    place_frames(scene.touch, work.x, work.points)
    kept = blank(slip.pairs.size, MEMORY)
    count, lost, held = 0, 0.0, 0.0
    for j in range(slip.pairs.size):
        place = slip.pairs[j]
        if place.limit == 0.0 and place.before == 0.0:
            continue
        d = vector_of(scene, lattice, (place.pair[0], place.pair[1], place.pair[2]), work)
        gone, stuck = end(place, d, d, kept[count])
        lost += gone
        held += stuck
        count += stuck > 0.0
    wraps = blank(slip.wraps.shape, MEMORY)
    gone, stuck = end_wraps(scene, slip, wraps, work)
    lags, rubbed, lagging = end_lagging(scene, lattice, slip.lags, work)
    return Memory(kept[:count].copy(), wraps, lags), lost + gone + rubbed, held + stuck + lagging

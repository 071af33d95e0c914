"""Which places of the yarns are near each other: the pair search, and what a list of pairs covers (compiled).

A pair (i, k, g) is own point i against the image of own point k under operation g.  Each unordered
pair is visited once: i < k with every g; i = k with one of g and its inverse, at half weight where g
is its own inverse.  A list is made around one shape of the fabric and serves for every shape in which
nothing can have come near that was not listed; :func:`covers` says whether it does, and is asked at
every point of which an energy is taken.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.records import ANGLE, LATTICE
from knitsim.jit import choose, leaf, njit

SPREAD = 1.1  # spacings of contact points: how far beyond the diameter their cells reach
CHUNK = 8  # points per bounding box of the pair search
BEYOND = 1.25  # ways: how far beyond a trial pairs are listed
APART = 0.75  # spacings of contact points: two yarns this far apart at their points do not cross between


class Listed(NamedTuple):
    """Pairs around a shape.

    pairs (n, 3): i, k, g; weight (n,): length times length (m2) that a pair stands for; center (y
    size): the shape; reach (1,): distance in the fabric's flat coordinates within which all pairs of
    that shape are listed (m).
    """

    pairs: np.ndarray
    weight: np.ndarray
    center: np.ndarray
    reach: np.ndarray


@leaf
def place_frames(touch, x, points):
    """Fill points (m, 9) with the contact points and their derivatives by the number of the point."""
    for i in range(touch.points.size):
        point = touch.points[i]
        f, basis, along, turn = point.first, point.basis, point.along, point.turn
        for axis in range(3):
            a, b, c, d = x[f, axis], x[f + 1, axis], x[f + 2, axis], x[f + 3, axis]
            points[i, axis] = basis[0] * a + basis[1] * b + basis[2] * c + basis[3] * d
            points[i, 3 + axis] = along[0] * a + along[1] * b + along[2] * c + along[3] * d
            points[i, 6 + axis] = turn[0] * a + turn[1] * b + turn[2] * c + turn[3] * d


@leaf
def place_points(touch, x, points):
    """Fill points (m, 3 or more) with the positions of the contact points."""
    for i in range(touch.points.size):
        f, basis = touch.points[i].first, touch.points[i].basis
        for axis in range(3):
            points[i, axis] = (
                basis[0] * x[f, axis]
                + basis[1] * x[f + 1, axis]
                + basis[2] * x[f + 2, axis]
                + basis[3] * x[f + 3, axis]
            )


@njit
def expand(map_, y, x):
    """Control points x (n, 3) of the unknowns y; returns the lattice L."""
    rows = map_.rows.size
    lattice = np.empty(LATTICE)
    for r in range(rows):
        value = map_.rows[r].offset
        for e in range(map_.rows[r].start, map_.rows[r].stop):
            value += map_.entries[e].value * y[map_.entries[e].column]
        if r < rows - LATTICE:
            x[r // 3, r % 3] = value
        else:
            lattice[r - rows + LATTICE] = value
    return lattice


@leaf
def curvature_at(scene, lattice):
    """kappa (1/m) of a bent fabric: the angle of one loop over its spacing along the bent direction."""
    return lattice[ANGLE] / lattice[3 * scene.bend.direction]


@leaf
def _flat_bound(scene, lattice, distance, x):
    return distance


@leaf
def _bent_bound(scene, lattice, distance, x):
    # 1 + kappa z is no less than 1 - |kappa| thick.  Of all places a distance apart, those at that
    # height, side by side along the bent direction, are furthest apart in flat coordinates.
    thick = 0.0
    for i in range(x.shape[0]):
        thick = max(thick, abs(x[i, 2]))
    kappa = abs(curvature_at(scene, lattice))
    chord = distance / max(1.0 - kappa * thick, 0.2)
    if kappa == 0.0:
        return chord
    return 2.0 / kappa * math.asin(min(0.5 * kappa * chord, 1.0))


# Distance in flat coordinates beyond which no two places are closer than ``distance`` (m).
flat_distance = choose("scene.bend", _bent_bound, _flat_bound)


@njit
def approach(scene, y, center):
    """How much closer (m) two contact points, or one and an image of the other, can have come at most.

    A contact point moves no further than its control points, an image by as many spacings more.
    """
    map_ = scene.map
    largest, rows = 0.0, map_.rows.size
    moved = np.zeros(3)
    spacings = 0.0
    for r in range(rows - 1):  # the angle, last, moves nothing in flat coordinates
        value = 0.0
        for e in range(map_.rows[r].start, map_.rows[r].stop):
            column = map_.entries[e].column
            value += map_.entries[e].value * (y[column] - center[column])
        if r >= rows - LATTICE:
            spacings += abs(value)
            continue
        moved[r % 3] = value
        if r % 3 == 2:
            largest = max(largest, moved[0] ** 2 + moved[1] ** 2 + moved[2] ** 2)
    return 2.0 * math.sqrt(largest) + scene.touch.far * spacings


@leaf
def touching(scene):
    """Distance (m) within which the cells of two contact points may touch (:mod:`.mean`).

    Half of (a + b) is 2 h D at most, h being their spacing along the stretched yarn.
    """
    points = scene.touch.points
    return scene.law.diameter + (SPREAD * points[0].length if points.size > 0 else 0.0)


@leaf
def _covers_flat(scene, listed, y, work):
    """Whether every pair that touches at y is in the list."""
    return approach(scene, y, listed.center) + touching(scene) <= listed.reach[0]


@njit
def _covers_bent(scene, listed, y, work):
    lattice = expand(scene.map, y, work.x)
    near = flat_distance(scene, lattice, touching(scene), work.x)
    return approach(scene, y, listed.center) + near <= listed.reach[0]


covers = choose("scene.bend", _covers_bent, _covers_flat)


@njit
def pairs_at(scene, y, skin, work):
    """The :class:`Listed` pairs that touch at y, and those that do if they come closer by ``skin`` (m)."""
    lattice = expand(scene.map, y, work.x)
    place_points(scene.touch, work.x, work.points)
    reach = flat_distance(scene, lattice, touching(scene) + skin, work.x)
    pairs, weight = find_pairs(scene.touch, work.points, lattice, reach)
    return Listed(pairs, weight, y.copy(), np.full(1, reach))


@njit
def skin_over(scene, y, trial, skin):
    """The skin (m) with which pairs at y are listed that cover the way to ``trial`` and a little more."""
    return skin + BEYOND * approach(scene, trial, y)


@leaf
def boxes_of(points, size, low, high):
    """Fill low, high (chunks, 3) with the bounds of runs of ``size`` points."""
    for c in range(low.shape[0]):
        for axis in range(3):
            lo = hi = points[c * size, axis]
            for i in range(c * size + 1, min(points.shape[0], (c + 1) * size)):
                lo = min(lo, points[i, axis])
                hi = max(hi, points[i, axis])
            low[c, axis] = lo
            high[c, axis] = hi


@leaf
def image_is_far(sign, shift, low, high, own_low, own_high, reach):
    """Whether the image of the box (low, high) is further than ``reach`` from the own box."""
    for axis in range(3):
        a = sign[axis] * low[axis] + shift[axis]
        b = sign[axis] * high[axis] + shift[axis]
        if min(a, b) - own_high[axis] > reach or own_low[axis] - max(a, b) > reach:
            return True
    return False


@njit
def find_pairs(touch, points, lattice, reach):
    """All pairs closer than ``reach`` (m): pairs (n, 3) of i, k, g and their weights (n,).

    Bounding boxes of runs of CHUNK points are compared first.
    """
    m = points.shape[0]
    chunks = (m + CHUNK - 1) // CHUNK
    low, high = np.empty((chunks, 3)), np.empty((chunks, 3))
    boxes_of(points, np.int64(CHUNK), low, high)
    whole_low, whole_high = np.empty((1, 3)), np.empty((1, 3))
    boxes_of(points, m, whole_low, whole_high)
    image_at = np.empty((3, m))
    near = np.empty((CHUNK * CHUNK, 2), dtype=np.int64)
    pairs = np.empty((1024, 3), dtype=np.int64)
    weight = np.empty(1024)
    count = 0
    for g in range(touch.images.size):
        image = touch.images[g]
        sign = (image.sign[0], image.sign[1], image.sign[2])
        t0 = image.steps[0] * lattice[0] + image.steps[1] * lattice[2]
        t1 = image.steps[0] * lattice[1] + image.steps[1] * lattice[3]
        shift = (t0, t1, 0.0)
        if image_is_far(
            sign, shift, whole_low[0], whole_high[0], whole_low[0], whole_high[0], reach
        ):
            continue
        for axis in range(3):
            for k in range(m):
                image_at[axis, k] = sign[axis] * points[k, axis] + shift[axis]
        for ci in range(chunks):
            for ck in range(ci, chunks):
                if image_is_far(sign, shift, low[ck], high[ck], low[ci], high[ci], reach):
                    continue
                found = near_points(points, image_at, ci, ck, reach, near)
                if count + found > weight.size:
                    pairs, weight = _resized(pairs, weight, 2 * weight.size)
                for j in range(found):
                    i, k = near[j, 0], near[j, 1]
                    factor = pair_factor(touch, i, k, g)
                    if factor > 0.0:
                        pairs[count, 0], pairs[count, 1], pairs[count, 2] = i, k, g
                        weight[count] = factor
                        count += 1
    return _resized(pairs, weight, count)


@leaf
def near_points(points, image_at, ci, ck, reach, near):
    """Fill near with the i of run ci and k >= i of run ck closer than reach; returns how many."""
    m, square, found = points.shape[0], reach * reach, 0
    for i in range(ci * CHUNK, min(m, (ci + 1) * CHUNK)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(max(i, ck * CHUNK), min(m, (ck + 1) * CHUNK)):
            d0, d1, d2 = x - image_at[0, k], y - image_at[1, k], z - image_at[2, k]
            # Written always and kept by counting: a branch here costs more than the distance.
            near[found, 0], near[found, 1] = i, k
            found += d0 * d0 + d1 * d1 + d2 * d2 < square
    return found


@leaf
def pair_factor(touch, i, k, g):
    """Weight (m2) of the pair (i, k, g), i <= k; 0 where it does not count."""
    image = touch.images[g]
    own, other = touch.points[i], touch.points[k]
    if own.yarn == image.turn * other.yarn + image.up:
        if abs(own.arc - (image.arc_sign * other.arc + image.arc_shift)) < touch.exclude:
            return 0.0
    factor = touch.copies * own.length * other.length
    if i == k:
        if image.inverse == g:
            factor *= 0.5
        elif g > image.inverse:
            return 0.0
    return factor


@njit
def _resized(pairs, weight, size):
    """Copies with room for ``size`` pairs, as many of the old ones in them as there is room for."""
    more = np.empty((size, 3), dtype=np.int64)
    longer = np.empty(size)
    for i in range(min(size, weight.size)):
        longer[i] = weight[i]
        for axis in range(3):
            more[i, axis] = pairs[i, axis]
    return more, longer


@njit
def _can_meet_flat(scene, before, after, near, work):
    # Pairs that are not listed are further apart than those that touch.
    closest = min(math.sqrt(work.closest[0]), touching(scene))
    return not closest - approach(scene, after, before) > near


@njit
def _can_meet_bent(scene, before, after, near, work):
    return True


# Whether two places may have been closer than ``near`` (m) on the way, by how far apart they are after it.
can_meet = choose("scene.bend", _can_meet_bent, _can_meet_flat)


@njit
def passes(scene, before, after, work):
    """Whether yarns may pass through each other as y goes straight from ``before`` to ``after``.

    Conservative: between two contact points of a yarn its centre line stays within half their spacing of
    one of them, so that of two yarns that do not come closer than that in any pair of contact points
    none passes.  work.closest must be that of ``after``: where no two places can have come from so far apart,
    nothing else is looked at.  Bounding boxes of runs of points, over both ends of the way, come next.
    """
    m = work.points.shape[0]
    if m == 0:
        return False
    near = scene.touch.points[0].length * APART
    if not can_meet(scene, before, after, near, work):
        return False
    start, end = np.empty((m, 3)), np.empty((m, 3))
    from_ = expand(scene.map, before, work.x)
    place_points(scene.touch, work.x, start)
    to = expand(scene.map, after, work.x)
    place_points(scene.touch, work.x, end)
    chunks = (m + CHUNK - 1) // CHUNK
    low, high = np.empty((chunks, 3)), np.empty((chunks, 3))
    later_low, later_high = np.empty((chunks, 3)), np.empty((chunks, 3))
    boxes_of(start, np.int64(CHUNK), low, high)
    boxes_of(end, np.int64(CHUNK), later_low, later_high)
    for g in range(scene.touch.images.size):
        image = scene.touch.images[g]
        s, m1, m2 = image.sign, image.steps[0], image.steps[1]
        t = (m1 * from_[0] + m2 * from_[2], m1 * from_[1] + m2 * from_[3], 0.0)
        u = (m1 * to[0] + m2 * to[2], m1 * to[1] + m2 * to[3], 0.0)
        for ci in range(chunks):
            for ck in range(ci, chunks):
                far = False
                for axis in range(3):
                    a = min(s[axis] * low[ck, axis], s[axis] * high[ck, axis]) + t[axis]
                    b = max(s[axis] * low[ck, axis], s[axis] * high[ck, axis]) + t[axis]
                    c = min(s[axis] * later_low[ck, axis], s[axis] * later_high[ck, axis]) + u[axis]
                    d = max(s[axis] * later_low[ck, axis], s[axis] * later_high[ck, axis]) + u[axis]
                    own_low = min(low[ci, axis], later_low[ci, axis])
                    own_high = max(high[ci, axis], later_high[ci, axis])
                    far |= min(a, c) - own_high > near or own_low - max(b, d) > near
                if far:
                    continue
                for i in range(ci * CHUNK, min(m, (ci + 1) * CHUNK)):
                    for k in range(max(i, ck * CHUNK), min(m, (ck + 1) * CHUNK)):
                        least = 0.0
                        along = moved = 0.0
                        for axis in range(3):
                            x = start[i, axis] - s[axis] * start[k, axis] - t[axis]
                            v = end[i, axis] - s[axis] * end[k, axis] - u[axis] - x
                            least += x * x
                            along += x * v
                            moved += v * v
                        if along < 0.0:
                            part = min(-along / moved, 1.0)
                            least += part * (2.0 * along + part * moved)
                        if least < near * near and pair_factor(scene.touch, i, k, g) > 0.0:
                            return True
    return False

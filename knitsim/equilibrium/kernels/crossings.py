"""Crossings of a cell's yarns with those of other courses, read along the yarn (compiled).

The check that runs after every accepted state: seen along the thickness axis (from the technical
face), every crossing of the own polyline with an image in another course is noted as
2 * (courses up) + (1 if the own yarn lies above), in the order met along the own yarn.  Strict: a
state that shows any crossing more than a plain knit does is refused, though it may hold nothing.
"""

import numpy as np

from knitsim.equilibrium.kernels.pairs import boxes_of, expand, image_is_far, place_points
from knitsim.jit import leaf, njit


@leaf
def segments_crossing(points, i, k, start, side, facing):
    """(p, above): where the segment from vertex i on crosses an image of that from vertex k on.

    start, side: the image's first vertex and its course to the second, seen along the thickness
    axis; facing: -1 where the image has face and back exchanged, else 1.  p: part of the way along
    segment i, -1 if they do not cross; above: whether i lies above.
    """
    cx, cy = start
    ex, ey = side
    ax, ay = points[i, 0], points[i, 1]
    bx, by = points[i + 1, 0] - ax, points[i + 1, 1] - ay
    area = bx * ey - by * ex
    if area == 0.0:
        return -1.0, False
    p = ((cx - ax) * ey - (cy - ay) * ex) / area
    q = ((cx - ax) * by - (cy - ay) * bx) / area
    if not (0.0 <= p < 1.0 and 0.0 <= q < 1.0):
        return -1.0, False
    z = points[i, 2] + p * (points[i + 1, 2] - points[i, 2])
    return p, z > facing * (points[k, 2] + q * (points[k + 1, 2] - points[k, 2]))


@njit
def crossings_of(trace, points, lattice, limit):
    """Crossing codes in order along each own yarn; at most ``limit``.

    trace: the cell's Touch whose points are the vertices of polylines; points: their positions.
    """
    m = points.shape[0]
    code = np.empty(limit, dtype=np.int64)
    place = np.empty(limit)
    count = 0
    low, high = np.empty((1, 3)), np.empty((1, 3))
    boxes_of(points, m, low, high)
    left, right, bottom, top = low[0, 0], high[0, 0], low[0, 1], high[0, 1]
    for g in range(trace.images.size):
        image = trace.images[g]
        m1, m2 = image.steps[0], image.steps[1]
        s0, s1 = image.sign[0], image.sign[1]
        t0 = m1 * lattice[0] + m2 * lattice[2]
        t1 = m1 * lattice[1] + m2 * lattice[3]
        sign, shift = (s0, s1, image.sign[2]), (t0, t1, 0.0)
        if image_is_far(sign, shift, low[0], high[0], low[0], high[0], 0.0):
            continue
        for k in range(m - 1):
            if trace.points[k + 1].first > trace.points[k].first + 1:  # another piece of yarn
                continue
            cx, cy = s0 * points[k, 0] + t0, s1 * points[k, 1] + t1
            ex, ey = s0 * points[k + 1, 0] + t0 - cx, s1 * points[k + 1, 1] + t1 - cy
            low_x, high_x = min(cx, cx + ex), max(cx, cx + ex)
            low_y, high_y = min(cy, cy + ey), max(cy, cy + ey)
            if low_x > right or high_x < left or low_y > top or high_y < bottom:
                continue
            for i in range(m - 1):
                if trace.points[i + 1].first > trace.points[i].first + 1:
                    continue
                up = image.turn * trace.points[k].yarn + image.up - trace.points[i].yarn
                if up == 0:
                    continue
                ax, ay = points[i, 0], points[i, 1]
                bx, by = points[i + 1, 0] - ax, points[i + 1, 1] - ay
                if min(ax, ax + bx) > high_x or max(ax, ax + bx) < low_x:
                    continue
                if min(ay, ay + by) > high_y or max(ay, ay + by) < low_y:
                    continue
                p, above = segments_crossing(points, i, k, (cx, cy), (ex, ey), image.sign[2])
                if p < 0.0:
                    continue
                if count == limit:
                    return code
                where = i + p
                # Insert in the order met along the own yarn.
                at = count
                while at > 0 and place[at - 1] > where:
                    place[at], code[at] = place[at - 1], code[at - 1]
                    at -= 1
                place[at], code[at] = where, 2 * up + (1 if above else 0)
                count += 1
    return code[:count]


@leaf
def same_crossings(found, expected):
    """Whether the codes are the expected ones."""
    if found.size != expected.size:
        return False
    for i in range(found.size):
        if found[i] != expected[i]:
            return False
    return True


@njit
def intact(scene, trace, y, expected, x):
    """Whether the crossings at y are the expected ones; x: buffer of the control points."""
    lattice = expand(scene.map, y, x)
    points = np.empty((trace.points.size, 3))
    place_points(trace, x, points)
    return same_crossings(crossings_of(trace, points, lattice, 4 * expected.size), expected)

"""Large cells: pair search and crossings in linear time, Hessian in blocks (compiled).

The dense kernels compare every stretch of yarn with every other and keep the Hessian as a full
matrix: right for one loop, quadratic and worse in the number of loops.  Here stretches are sorted
into a grid of the fabric's plane, and the Hessian is kept as 3 x 3 blocks of pairs of control points
that touch or are neighbours, with the lattice as four dense columns beside it.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.contact import flat_matrix, flat_mean, separation, steps_at
from knitsim.equilibrium.kernels.crossings import segments_crossing
from knitsim.equilibrium.kernels.friction import across, slip_matrix, spring_at
from knitsim.equilibrium.kernels.lag import lag_point
from knitsim.equilibrium.kernels.pairs import CHUNK, image_is_far
from knitsim.equilibrium.kernels.yarn import derivatives_at, held_point, is_turned, yarn_point
from knitsim.jit import choose, njit


class Graph(NamedTuple):
    """Which control points of the chains are the same, and where the blocks of their pairs are.

    node (chain points,): number of the control point in the cell; turn: how many a1 the chain point
    lies from it.  own (chain points, 4, 4): block of each pair out of the four control points of
    the span that starts there; touching (n, 4, 4): the same of the two spans of each coupling.
    """

    node: np.ndarray
    turn: np.ndarray
    own: np.ndarray
    touching: np.ndarray


class Parts(NamedTuple):
    """The Hessian by control points and lattice.

    blocks (n, 3, 3): second derivatives by a control point (rows) and one of no higher number;
    border (control points, 3, 4): by control point and lattice; corner (4, 4): by the lattice.
    """

    blocks: np.ndarray
    border: np.ndarray
    corner: np.ndarray


class Grid(NamedTuple):
    """Boxes sorted into squares of the plane: corner and size (m), squares along course and wale.

    start: first place in ``order`` of each square, and the end; order: numbers of the boxes.
    """

    left: float
    bottom: float
    size: float
    columns: int
    rows: int
    start: np.ndarray
    order: np.ndarray


@njit
def grid_of(low, high, reach):
    """The :class:`Grid` of boxes (n, 3), by their middles.

    A box that comes within ``reach`` of another lies in the same square as that or in one beside it.
    """
    n = low.shape[0]
    size = 0.0
    left = bottom = math.inf
    right = top = -math.inf
    for c in range(n):
        x, y = 0.5 * (low[c, 0] + high[c, 0]), 0.5 * (low[c, 1] + high[c, 1])
        size = max(size, high[c, 0] - low[c, 0], high[c, 1] - low[c, 1])
        left, right, bottom, top = min(left, x), max(right, x), min(bottom, y), max(top, y)
    size += reach
    # No more squares than twice the boxes, however far these are spread.
    size = max(size, math.sqrt((right - left) * (top - bottom) / (2.0 * n)))
    columns, rows = int((right - left) / size) + 1, int((top - bottom) / size) + 1
    start = np.zeros(columns * rows + 1, dtype=np.int64)
    square = np.empty(n, dtype=np.int64)
    for c in range(n):
        x, y = 0.5 * (low[c, 0] + high[c, 0]), 0.5 * (low[c, 1] + high[c, 1])
        square[c] = int((y - bottom) / size) * columns + int((x - left) / size)
        start[square[c] + 1] += 1
    for s in range(columns * rows):
        start[s + 1] += start[s]
    order = np.empty(n, dtype=np.int64)
    next_place = start.copy()
    for c in range(n):
        order[next_place[square[c]]] = c
        next_place[square[c]] += 1
    return Grid(left, bottom, size, columns, rows, start, order)


@njit
def square_range(grid, x, y):
    """First and last column and row of the squares around a place; empty where it is too far off."""
    column = math.floor((x - grid.left) / grid.size)
    row = math.floor((y - grid.bottom) / grid.size)
    return (
        max(0, int(column) - 1),
        min(grid.columns - 1, int(column) + 1),
        max(0, int(row) - 1),
        min(grid.rows - 1, int(row) + 1),
    )


@njit
def chunks_of(touch, points):
    """Runs of at most CHUNK points of one yarn: first points and the end, bounds low, high."""
    m = points.shape[0]
    yarn = touch.points.yarn
    first = np.empty(m + 1, dtype=np.int64)
    count = 0
    for i in range(m):
        if i == 0 or yarn[i] != yarn[i - 1] or i - first[count - 1] == CHUNK:
            first[count] = i
            count += 1
    first[count] = m
    low, high = np.empty((count, 3)), np.empty((count, 3))
    for c in range(count):
        for axis in range(3):
            lo = hi = points[first[c], axis]
            for i in range(first[c] + 1, first[c + 1]):
                lo, hi = min(lo, points[i, axis]), max(hi, points[i, axis])
            low[c, axis], high[c, axis] = lo, hi
    return first[: count + 1], low, high


@njit
def find_pairs_in_grid(touch, points, lattice, reach):
    """As :func:`knitsim.equilibrium.kernels.pairs.find_pairs`, in linear time and another order."""
    first, low, high = chunks_of(touch, points)
    grid = grid_of(low, high, reach)
    whole_low, whole_high = np.empty((1, 3)), np.empty((1, 3))
    for axis in range(3):
        whole_low[0, axis], whole_high[0, axis] = low[:, axis].min(), high[:, axis].max()
    arc, yarn, length = touch.points.arc, touch.points.yarn, touch.points.length
    copies, exclude, square = touch.copies, touch.exclude, reach * reach
    pairs = np.empty((1024, 3), dtype=np.int64)
    weight = np.empty(1024)
    count = 0
    for g in range(touch.images.size):
        image = touch.images[g]
        s0, s1, other = image.sign[0], image.sign[1], image.inverse
        turn, up = image.turn, image.up
        sign = (s0, s1, image.sign[2])
        t0 = image.steps[0] * lattice[0] + image.steps[1] * lattice[2]
        t1 = image.steps[0] * lattice[1] + image.steps[1] * lattice[3]
        shift = (t0, t1, 0.0)
        arc_sign, arc_shift = image.arc_sign, image.arc_shift
        if image_is_far(
            sign, shift, whole_low[0], whole_high[0], whole_low[0], whole_high[0], reach
        ):
            continue
        for ck in range(low.shape[0]):
            x = s0 * 0.5 * (low[ck, 0] + high[ck, 0]) + t0
            y = s1 * 0.5 * (low[ck, 1] + high[ck, 1]) + t1
            left, right, bottom, top = square_range(grid, x, y)
            for row in range(bottom, top + 1):
                for column in range(left, right + 1):
                    at = row * grid.columns + column
                    for place in range(grid.start[at], grid.start[at + 1]):
                        ci = grid.order[place]
                        if ci > ck or image_is_far(
                            sign, shift, low[ck], high[ck], low[ci], high[ci], reach
                        ):
                            continue
                        for i in range(first[ci], first[ci + 1]):
                            for k in range(max(i, first[ck]), first[ck + 1]):
                                d0 = points[i, 0] - s0 * points[k, 0] - t0
                                d1 = points[i, 1] - s1 * points[k, 1] - t1
                                d2 = points[i, 2] - sign[2] * points[k, 2]
                                if d0 * d0 + d1 * d1 + d2 * d2 >= square:
                                    continue
                                if yarn[i] == turn * yarn[k] + up:
                                    if abs(arc[i] - (arc_sign * arc[k] + arc_shift)) < exclude:
                                        continue
                                factor = copies
                                if i == k:
                                    if other == g:
                                        factor *= 0.5
                                    elif g > other:
                                        continue
                                if count == weight.size:
                                    pairs, weight = lengthened(pairs, weight)
                                pairs[count, 0], pairs[count, 1], pairs[count, 2] = i, k, g
                                weight[count] = factor * length[i] * length[k]
                                count += 1
    return pairs[:count].copy(), weight[:count].copy()


@njit
def lengthened(table, column):
    """Copies with room for twice as many rows."""
    n = column.size
    more, longer = np.empty((2 * n, table.shape[1]), dtype=table.dtype), np.empty(2 * n)
    more[:n] = table
    longer[:n] = column
    return more, longer


@njit
def crossings_in_grid(trace, points, lattice):
    """Places along the own yarns and codes of all crossings, unordered, in linear time.

    Codes as in :func:`knitsim.equilibrium.kernels.crossings.crossings_of`; a place is the number of
    the vertex before it plus the fraction of the way to the next.
    """
    m = points.shape[0]
    yarn = trace.points.yarn
    begin = np.empty(m, dtype=np.int64)
    n = 0
    for i in range(m - 1):
        if yarn[i] == yarn[i + 1]:
            begin[n] = i
            n += 1
    low, high = np.empty((n, 3)), np.empty((n, 3))
    for c in range(n):
        for axis in range(3):
            a, b = points[begin[c], axis], points[begin[c] + 1, axis]
            low[c, axis], high[c, axis] = min(a, b), max(a, b)
    grid = grid_of(low, high, 0.0)
    code = np.empty((256, 1), dtype=np.int64)
    where = np.empty(256)
    count = 0
    for g in range(trace.images.size):
        image = trace.images[g]
        m1, m2 = image.steps[0], image.steps[1]
        s0, s1 = image.sign[0], image.sign[1]
        t0 = m1 * lattice[0] + m2 * lattice[2]
        t1 = m1 * lattice[1] + m2 * lattice[3]
        for c in range(n):
            k = begin[c]
            cx, cy = s0 * points[k, 0] + t0, s1 * points[k, 1] + t1
            ex, ey = s0 * points[k + 1, 0] + t0 - cx, s1 * points[k + 1, 1] + t1 - cy
            left, right, bottom, top = square_range(grid, cx + 0.5 * ex, cy + 0.5 * ey)
            for row in range(bottom, top + 1):
                for column in range(left, right + 1):
                    at = row * grid.columns + column
                    for place in range(grid.start[at], grid.start[at + 1]):
                        i = begin[grid.order[place]]
                        up = image.turn * yarn[k] + image.up - yarn[i]
                        if up == 0:
                            continue
                        p, above = segments_crossing(
                            points, i, k, (cx, cy), (ex, ey), image.sign[2]
                        )
                        if p < 0.0:
                            continue
                        if count == where.size:
                            code, where = lengthened(code, where)
                        code[count, 0] = 2 * up + (1 if above else 0)
                        where[count] = i + p
                        count += 1
    return where[:count].copy(), code[:count, 0].copy()


@njit
def keys_of(scene, node, pairs):
    """One number for the two spans of each listed pair, (n,)."""
    total = node.max() + 1
    keys = np.empty(pairs.shape[0], dtype=np.int64)
    for j in range(pairs.shape[0]):
        fi, fk = scene.touch.points[pairs[j, 0]].first, scene.touch.points[pairs[j, 1]].first
        keys[j] = node[fi] * total + node[fk]
    return keys


@njit
def _no_lag(lags, p, point, v, w, tangent):
    """The yarn has no friction of its own."""


@njit
def _add_lag(lags, p, point, v, w, tangent):
    form, more = np.empty(6), np.empty((6, 6))
    lag_point(point, lags[p], v, w, np.int64(2), form, more)
    for i in range(6):
        for j in range(6):
            tangent[i, j] += more[i, j]


add_lag = choose("lags", _add_lag, _no_lag)


@njit
def add_yarn_blocks(scene, x, lags, graph, parts):
    """Add the Hessian of the yarn's own energy and friction; x (n, 3): control points of the chains.

    lags: LAG of :mod:`knitsim.equilibrium.kernels.lag`, or ().
    """
    form, tangent, terms = np.empty(6), np.empty((6, 6)), np.zeros(3)
    for p in range(scene.rod.size):
        point = scene.rod[p]
        f = point.first
        v, w = derivatives_at(point, x)
        yarn_point(point, scene.stretch, v, w, np.int64(2), form, tangent, terms)
        if is_turned(point):
            held_point(point, v, w, np.int64(2), form, tangent, terms)
        add_lag(lags, p, point, v, w, tangent)
        turn, turn2 = 0.0, 0.0
        for k in range(4):
            turn += point.d1[k] * graph.turn[f + k]
            turn2 += point.d2[k] * graph.turn[f + k]
        # Only spans that cross the edge of the cell change with a1.
        edge = graph.node[f + 3] - graph.node[f] != 3
        for k in range(4):
            dk, sk, r = point.d1[k], point.d2[k], graph.node[f + k]
            for m in range(4):
                c = graph.node[f + m]
                if c > r:
                    continue
                dm, sm, at = point.d1[m], point.d2[m], graph.own[f, k, m]
                for i in range(3):
                    for j in range(3):
                        parts.blocks[at, i, j] += dm * (
                            dk * tangent[i, j] + sk * tangent[3 + i, j]
                        ) + sm * (dk * tangent[i, 3 + j] + sk * tangent[3 + i, 3 + j])
            if edge:
                for i in range(3):
                    for j in range(2):
                        parts.border[r, i, j] += turn * (
                            dk * tangent[i, j] + sk * tangent[3 + i, j]
                        ) + turn2 * (dk * tangent[i, 3 + j] + sk * tangent[3 + i, 3 + j])
        if edge:
            for i in range(2):
                for j in range(2):
                    parts.corner[i, j] += turn * (
                        turn * tangent[i, j] + turn2 * tangent[3 + i, j]
                    ) + turn2 * (turn * tangent[i, 3 + j] + turn2 * tangent[3 + i, 3 + j])


@njit
def add_pair_blocks(scene, pair, coupling, h, graph, parts):
    """Add the Hessian of one pair's energy by its d, a symmetric 3 x 3 tuple ``h``.

    d = x_i - x_k - m1 a1 - m2 a2 with x_i = sum of basis times (control point + turn a1).
    """
    i, k, g = pair
    p, q, steps = scene.touch.points[i], scene.touch.points[k], scene.touch.images[g].steps
    fi, fk = p.first, q.first
    b, c = p.basis, q.basis
    node, turn = graph.node, graph.turn
    n1, n2 = -steps[0], -steps[1]
    for a in range(4):
        n1 += b[a] * turn[fi + a] - c[a] * turn[fk + a]
    edge = abs(n1) > 1e-12 or n2 != 0.0
    for a in range(4):
        ri, rk = node[fi + a], node[fk + a]
        for m in range(4):
            own = b[a] * b[m]
            at = graph.own[fi, a, m]
            if node[fi + m] <= ri:
                for r in range(3):
                    for s in range(3):
                        parts.blocks[at, r, s] += own * h[r][s]
            own = c[a] * c[m]
            at = graph.own[fk, a, m]
            if node[fk + m] <= rk:
                for r in range(3):
                    for s in range(3):
                        parts.blocks[at, r, s] += own * h[r][s]
            # Both triangles fall on the block of a control point with itself.
            mixed = -b[a] * c[m] * (2.0 if node[fk + m] == ri else 1.0)
            at = graph.touching[coupling, a, m]
            for r in range(3):
                for s in range(3):
                    parts.blocks[at, r, s] += mixed * h[r][s]
        if edge:
            for r in range(3):
                for s in range(2):
                    parts.border[ri, r, s] += b[a] * n1 * h[r][s]
                    parts.border[ri, r, 2 + s] += b[a] * n2 * h[r][s]
                    parts.border[rk, r, s] -= c[a] * n1 * h[r][s]
                    parts.border[rk, r, 2 + s] -= c[a] * n2 * h[r][s]
    if edge:
        for r in range(2):
            for s in range(2):
                parts.corner[r, s] += n1 * n1 * h[r][s]
                parts.corner[r, 2 + s] += n1 * n2 * h[r][s]
                parts.corner[2 + r, s] += n1 * n2 * h[r][s]
                parts.corner[2 + r, 2 + s] += n2 * n2 * h[r][s]


@njit
def add_contact_blocks(scene, points, lattice, pairs, graph, parts):
    """Add the Hessian of the contact energy; pairs: (pairs, weights, couplings)."""
    listed, weight, coupling = pairs
    for j in range(weight.size):
        pair = (listed[j, 0], listed[j, 1], listed[j, 2])
        d = separation(scene.touch, points, lattice, pair)
        steps = steps_at(scene.touch, points, pair)
        mean = flat_mean(d, steps, scene.law)
        if mean[0] != 0.0:
            xx, xy, xz, yy, yz, zz = flat_matrix(d, steps, mean, weight[j])
            h = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
            add_pair_blocks(scene, pair, coupling[j], h, graph, parts)


@njit
def add_slip_blocks(scene, points, lattice, slip, coupling, graph, parts):
    """Add the Hessian of the friction potential; coupling (n,): those of the rubbing pairs."""
    for j in range(slip.pairs.size):
        rub = slip.pairs[j]
        if rub.limit == 0.0:
            continue
        pair = (rub.pair[0], rub.pair[1], rub.pair[2])
        u, size = across(separation(scene.touch, points, lattice, pair), rub.anchor, rub.normal)
        _, f, bend = spring_at(size, rub.stiffness, rub.limit)
        h = slip_matrix(f, bend / (size * size) if bend != 0.0 else 0.0, rub.normal, u)
        add_pair_blocks(scene, pair, coupling[j], h, graph, parts)

"""The repeating cell of a plain knit: which control points are unknown, and where the images lie.

A loop starts in the middle of its sinker arc (parameter 0), its head is at n/2, the next loop starts
at n.  Courses are numbered upwards, a course lies c above the one before.

Symmetry of a plain loop: the mirror x -> -x about the sinker arc (u -> -u), and the half turn about
the thickness axis through the middle of a leg (u -> n/2 - u, x -> a1/2 - x, y -> -y).  Both together
leave a quarter, from the sinker arc to the middle of a leg.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium import spline
from knitsim.equilibrium.kernels.records import (
    IMAGE,
    LATTICE,
    MAP_ENTRY,
    MAP_ROW,
    ROD,
    TOUCH_POINT,
    Map,
    Touch,
    records,
)

REACH = 2  # images this many wales and courses away can touch


@dataclass(frozen=True, eq=False)
class Cell:
    """Layout of a cell: which number is which.

    kind: "quarter" or "full"; points, contacts: control and contact points per loop; wales, courses:
    loops in the cell (1 for the quarter).  rows: for every control point of every chain, three dicts
    column -> value, the lattice at columns count .. count + 3.  chain (yarns): first control point
    of each chain; spans: spans of a chain; origin: parameter u of control point 1 of a chain;
    copies: how often the cell's energy counts for all its loops.
    """

    kind: str
    points: int
    contacts: int
    wales: int
    courses: int
    count: int
    map: Map
    slot: np.ndarray
    chain: np.ndarray
    spans: int
    copies: float


def quarter(points, contacts):
    """A quarter of one symmetric loop; points and contacts: per loop, multiples of 4."""
    m = points // 4
    number = iter(range(3 * (m + 1)))
    # Sinker arc: x = 0.  Middle of the leg: x = a1/4, y = 0.  The mean thickness is zero.
    middle = m // 2
    slot = np.full((m + 1, 3), -1, dtype=np.int64)
    for k in range(m + 1):
        for axis in range(3):
            fixed = (axis == 0 and k in (0, m)) or (axis == 1 and k == m)
            if not (fixed or (axis == 2 and k == middle)):
                slot[k, axis] = next(number)
    count = slot.max() + 1
    a1 = count
    rows = [[{} if s < 0 else {s: 1.0} for s in row] for row in slot]
    rows[m][0] = {a1: 0.25}
    share = [1.0] + [2.0] * (m - 1) + [1.0]
    rows[middle][2] = _combine(
        (-share[k] / share[middle], rows[k][2]) for k in range(m + 1) if k != middle
    )
    before = [_combine([(-1.0, rows[1][0])]), rows[1][1], rows[1][2]]
    after = [
        _combine([(0.5, {a1: 1.0}), (-1.0, rows[m - 1][0])]),
        _combine([(-1.0, rows[m - 1][1])]),
        rows[m - 1][2],
    ]
    table = [before, *rows, after]
    return Cell(
        "quarter",
        points,
        contacts,
        1,
        1,
        count,
        to_map(table, count),
        slot,
        np.array([0]),
        m,
        4.0,
    )


def full(points, contacts, wales=1, courses=1):
    """``wales`` by ``courses`` whole loops without symmetry.

    Rigid translation and the sliding of each yarn along itself cost nothing and are taken out: the
    middle of the first sinker arc stays at x = 0, the left leg of the first loop at y = 0 in its
    middle, the mean thickness of that loop at zero; and in each yarn the middles of the two legs of
    the first loop lie at the same height.  (Sliding raises one and lowers the other.  A condition on x
    would not do: sinker arc and head run the same way, so that sliding moves both as a translation
    does.)  Points cut from a yarn feel a little of the sliding; the condition then takes a force, zero
    in the symmetric state.
    """
    n = points * wales
    slot = np.full((courses * n, 3), -1, dtype=np.int64)
    left, right = points // 4, 3 * points // 4
    pinned = {(0, 0), (left, 1), (left, 2)} | {(j * n + right, 1) for j in range(courses)}
    number = iter(range(3 * courses * n))
    for k in range(courses * n):
        for axis in range(3):
            if (k, axis) not in pinned:
                slot[k, axis] = next(number)
    count = slot.max() + 1
    a1 = (count, count + 1)
    rows = [[{} if s < 0 else {s: 1.0} for s in row] for row in slot]
    for j in range(courses):
        rows[j * n + right][1] = rows[j * n + left][1]
    rows[left][2] = _combine((-1.0, rows[k][2]) for k in range(points) if k != left)
    table = []
    for j in range(courses):
        own = rows[j * n : (j + 1) * n]
        for k in range(-1, n + 2):
            turns, place = divmod(k, n)
            step = float(turns * wales)
            table.append(
                [
                    _combine([(1.0, own[place][0]), (step, {a1[0]: 1.0})]),
                    _combine([(1.0, own[place][1]), (step, {a1[1]: 1.0})]),
                    own[place][2],
                ]
            )
    return Cell(
        "full",
        points,
        contacts,
        wales,
        courses,
        count,
        to_map(table, count),
        slot,
        np.arange(courses) * (n + 3),
        n,
        1.0,
    )


def _combine(terms):
    """Sum of (factor, row), rows as dicts column -> value."""
    total = {}
    for factor, row in terms:
        for column, value in row.items():
            total[column] = total.get(column, 0.0) + factor * value
    return {c: v for c, v in total.items() if v != 0.0}


def to_map(table, count):
    rows = [row for point in table for row in point]
    rows += [{count + i: 1.0} for i in range(LATTICE)]
    start = np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.int64)
    column = np.array([c for r in rows for c in r], dtype=np.int64)
    value = np.array([v for r in rows for v in r.values()], dtype=float)
    return Map(
        records(MAP_ROW, len(rows), start=start[:-1], stop=start[1:]),
        records(MAP_ENTRY, len(column), column=column, value=value),
    )


def _along(cell, per_span):
    """First control point, place in the span and parameter u of samples at ``per_span`` (places)."""
    spans = np.tile(np.arange(cell.spans), len(cell.chain))
    first = np.repeat(spans + np.repeat(cell.chain, cell.spans), len(per_span))
    place = np.tile(per_span, len(spans))
    return first, place, np.repeat(spans, len(per_span)) + place


def rod_of(cell, loop_length, bending_rigidity):
    """Gauss points of the cell's yarns (no rest curvature)."""
    first, place, _ = _along(cell, spline.GAUSS_POINTS)
    span = loop_length / cell.points
    weight = np.tile(spline.GAUSS_WEIGHTS, len(first) // 3) * span * cell.copies
    return records(
        ROD,
        len(first),
        first=first,
        d0=spline.basis(place),
        d1=spline.basis_first(place),
        d2=spline.basis_second(place),
        span=span,
        weight=weight,
        stiffness=bending_rigidity,
    )


def touch_of(cell, loop_length, exclude):
    """Contact points of the cell's yarns and the operations that make the images."""
    per_yarn = cell.spans * cell.contacts // cell.points
    u = (np.arange(per_yarn) + 0.5) * cell.points / cell.contacts
    span, place = spline.split(u, cell.spans)
    yarns = len(cell.chain)
    per_u = loop_length / cell.points
    sign, steps, arc_sign, arc_shift = [], [], [], []

    def add(s, m1, m2, along, shift):
        sign.append((s[0], s[1], 1.0))
        steps.append((m1, m2))
        arc_sign.append(along)
        arc_shift.append(shift * loop_length)

    wide = -(-REACH // cell.wales)
    high = -(-REACH // cell.courses)
    for j2 in range(-high, high + 1):
        for j1 in range(-wide, wide + 1):
            m1, m2 = float(j1 * cell.wales), float(j2 * cell.courses)
            add((1.0, 1.0), m1, m2, 1.0, m1)
            if cell.kind == "quarter":
                add((-1.0, 1.0), m1, m2, -1.0, m1)
                add((-1.0, -1.0), m1 + 0.5, m2, -1.0, m1 + 0.5)
                add((1.0, -1.0), m1 + 0.5, m2, 1.0, m1 + 0.5)
                if j1 == wide:
                    # The glide's inverse lies one step further to the left.
                    add((1.0, -1.0), -m1 - 0.5, m2, 1.0, -m1 - 0.5)
    sign, steps = np.array(sign), np.array(steps)
    # x -> S x + t has the inverse x -> S x - S t.
    back = -sign[:, :2] * steps
    match = (np.abs(steps[None] - back[:, None]).max(-1) < 1e-9) & (
        np.abs(sign[None] - sign[:, None]).max(-1) < 1e-9
    )
    inverse = np.where(match.any(1), match.argmax(1), -1)
    points = records(
        TOUCH_POINT,
        yarns * per_yarn,
        first=(span[None] + cell.chain[:, None]).ravel(),
        yarn=np.repeat(np.arange(yarns), per_yarn),
        basis=np.tile(spline.basis(place), (yarns, 1)),
        length=loop_length / cell.contacts,
        arc=np.tile(u * per_u, yarns),
    )
    images = records(
        IMAGE,
        len(sign),
        sign=sign,
        steps=steps,
        arc_sign=arc_sign,
        arc_shift=arc_shift,
        same=steps[:, 1] == 0.0,
        inverse=inverse,
    )
    return Touch(points, images, cell.copies, float(exclude))


def trace_of(cell, touch):
    """Vertices of the cell's yarns as polylines, half a span apart, with the operations of touch."""
    u = np.arange(2 * cell.spans + 1) / 2.0
    span, place = spline.split(u, cell.spans)
    yarns = len(cell.chain)
    points = records(
        TOUCH_POINT,
        yarns * len(u),
        first=(span[None] + cell.chain[:, None]).ravel(),
        yarn=np.repeat(np.arange(yarns), len(u)),
        basis=np.tile(spline.basis(place), (yarns, 1)),
    )
    return touch._replace(points=points)


# Along one loop from the sinker arc, 2 (courses up) + (1 if above): under, over the course below,
# over, under the one above at each side of the loop.
_LEG = [-2, -1, 3, 2]


def expected_crossings(cell):
    """The codes that a plain knit shows along the yarns of the cell."""
    if cell.kind == "quarter":
        return np.array(_LEG[:2], dtype=np.int64)
    return np.array((_LEG + _LEG[::-1]) * cell.wales * cell.courses, dtype=np.int64)


def pack(cell, loop, lattice):
    """Unknowns y of a cell filled with one loop's shape, or with those of all its loops.

    loop: control points (points, 3) of one loop in the cell's origin, or (wales courses points, 3) as
    from loop_of; lattice (4,): L.
    """
    lattice = np.asarray(lattice, dtype=float)
    y = np.zeros(cell.count + LATTICE)
    y[cell.count :] = lattice
    if cell.kind == "quarter":
        all_points = loop[: cell.spans + 1]
    elif len(loop) == len(cell.slot):
        all_points = loop
    else:
        step1 = np.array([lattice[0], lattice[1], 0.0])
        step2 = np.array([lattice[2], lattice[3], 0.0])
        all_points = np.concatenate(
            [loop + i * step1 + j * step2 for j in range(cell.courses) for i in range(cell.wales)]
        )
    used = cell.slot >= 0
    y[cell.slot[used]] = all_points[used]
    return y


def owners(map_):
    """For every entry of a map the number of its row."""
    return np.repeat(np.arange(len(map_.rows)), map_.rows.stop - map_.rows.start)


def control_points(cell, y):
    """Control points of all chains at y, (m, 3)."""
    rows, entries = cell.map
    x = np.bincount(owners(cell.map), entries.value * y[entries.column], minlength=len(rows))
    return (x + rows.offset)[:-LATTICE].reshape(-1, 3)


def loop_of(cell, y):
    """Control points (wales courses points, 3) of all loops of the cell at y."""
    x = control_points(cell, y)
    if cell.kind == "full":
        n = cell.spans
        return np.concatenate([x[s + 1 : s + 1 + n] for s in cell.chain])
    m, width = cell.spans, y[cell.count]
    leg = x[1 : m + 2]
    half = np.concatenate([leg, leg[-2::-1] * [-1, -1, 1] + [0.5 * width, 0, 0]])
    return np.concatenate([half, half[-2:0:-1] * [-1, 1, 1] + [width, 0, 0]])

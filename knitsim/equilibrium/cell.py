"""The repeating cell of a knit: which control points are unknown, and where the images lie.

A loop starts in the middle of its sinker arc, its head is half a loop further, the next loop starts
where it ends.  Courses are numbered upwards, a course lies a2 above the one before.  A place on the yarn
of a course is given by u, counted in loops; control point k of a course stands at u = k/points.

The symmetries of the pattern leave a part of the yarns, from which all the rest follows: for plain knit
a quarter of a loop, from the sinker arc to the middle of a leg.  The same code without symmetries gives
whole loops, and the other way round the latter prove the former.
"""

import functools
import math
from dataclasses import dataclass, replace

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
from knitsim.equilibrium.pattern import Pattern

# Images this many wales and courses away can touch: where stitches differ a fabric may fold, wales
# behind each other and, where courses differ, these over each other.
REACH, REACH_RIB, REACH_FOLDED = (2, 2), (4, 3), (4, 5)
# Which symmetries a test leaves: those that a bent fabric has, whose face and back differ, and those of
# a sheared one, whose cell is no rectangle.
KEPT = {
    "all": lambda one: True,
    "bent": lambda one: one.sign[2] > 0,
    "sheared": lambda one: one.sign[0] == one.sign[1],
    "none": lambda one: one.sign == (1, 1, 1) and one.along == one.up == 0,
}


@dataclass(frozen=True)
class Piece:
    """A run of spans of a yarn that is solved for: course, first control point, spans."""

    course: int
    first: int
    spans: int


@dataclass(frozen=True, eq=False)
class Cell:
    """Layout of a cell: which number is which.

    pattern; points, contacts: control and contact points per loop; wales, courses: loops in the cell;
    symmetries: operations of the pattern that are used.  pieces: of the yarns that are solved for, chain:
    first control point of each in the kernels' list.  count: unknowns q, the lattice follows; where
    (count, 3): course, control point and axis of each.  map: to the control points of the pieces;
    whole: to those of all loops, (courses, wales points) in order.
    """

    pattern: Pattern
    points: int
    contacts: int
    wales: int
    courses: int
    symmetries: tuple
    pieces: tuple
    chain: np.ndarray
    count: int
    where: np.ndarray
    map: Map
    whole: Map
    slides: bool = False

    @property
    def copies(self):
        """How often the energy of the pieces counts for that of the cell."""
        return float(len(self.symmetries))

    @property
    def symmetric(self):
        return len(self.symmetries) > 1

    @property
    def holds(self):
        """Whether the cell itself keeps its yarns from sliding."""
        return not self.slides and not any(one.sign[0] < 0 for one in self.symmetries)

    @property
    def spans(self):
        """Spans of the yarn of a course in the cell."""
        return self.wales * self.points


def cell_of(pattern, points, contacts, kept="all", wales=1, courses=1, slides=False):
    """The :class:`Cell` of ``wales`` by ``courses`` periods of a pattern.

    kept: a name of KEPT, or some of the symmetries of the pattern.  points and contacts: per loop,
    multiples of 4.  More than one period has no symmetry.  slides: as in :class:`Cell`.
    """
    kept = "none" if wales * courses > 1 else kept
    if isinstance(kept, str):
        kept = tuple(one for one in pattern.symmetries() if KEPT[kept](one))
    wales, courses = wales * pattern.wales, courses * pattern.courses
    return replace(_laid_out(pattern, points, wales, courses, kept, slides), contacts=contacts)


@functools.lru_cache(maxsize=64)
def _laid_out(pattern, points, wales, courses, symmetries, slides):
    """A cell whose contact points are still to be told."""
    layout = _Layout(pattern, points, wales, courses, symmetries, slides)
    pieces = layout.pieces()
    where, rows = layout.rows(pieces)
    count = len(where)
    column = {name: i for i, name in enumerate(where)}
    column |= {("L", i): count + i for i in range(LATTICE)}

    def map_of(places):
        coordinates = [row for place in places for row in layout.at(rows, *place)]
        return to_map([{column[n]: v for n, v in row.items()} for row in coordinates], count)

    chains = [
        [(piece.course, k) for k in range(piece.first - 1, piece.first + piece.spans + 2)]
        for piece in pieces
    ]
    chain = np.cumsum([0, *map(len, chains)])[:-1]
    whole = [(j, k) for j in range(courses) for k in range(wales * points)]
    return Cell(
        pattern, points, 0, wales, courses, symmetries, pieces, chain, count,
        np.array(where).reshape(-1, 3), map_of(place for own in chains for place in own),
        map_of(whole), slides,
    )  # fmt: skip


class _Layout:
    """Control points of a cell and how the symmetries carry them into each other.

    A coordinate is a dict: of unknowns (course, control point, axis) and of lattice entries ("L", i).
    """

    def __init__(self, pattern, points, wales, courses, symmetries, slides):
        self.pattern, self.points = pattern, points
        self.wales, self.courses = wales, courses
        self.symmetries, self.slides = symmetries, slides

    def image(self, one, course, k):
        """Course and control point that one is carried to, within the cell, and loops and courses beyond."""
        course = one.sign[1] * course + one.up
        k = one.sign[0] * k + round(one.along * self.points)
        up, course = divmod(course, self.courses)
        along, k = divmod(k, self.wales * self.points)
        return course, k, along * self.wales, up * self.courses

    def pieces(self):
        """Runs of legs, or half legs where one is symmetric in itself, out of which all others follow."""
        seen, found = set(), []
        for course in range(self.courses):
            for leg in range(2 * self.wales):
                if (course, leg) in seen:
                    continue
                turned = False
                for one in self.symmetries:
                    # By its middle, a quarter of a loop from either end.
                    middle = (2 * leg + 1) * self.points // 4
                    there, k, *_ = self.image(one, course, middle)
                    seen.add((there, 2 * k // self.points))
                    turned |= (there, k) == (course, middle) and one.sign[0] < 0
                spans = self.points // (4 if turned else 2)
                first = leg * self.points // 2
                last = found[-1] if found else Piece(-1, 0, 0)
                if last.course == course and last.first + last.spans == first:
                    found[-1] = Piece(course, last.first, last.spans + spans)
                else:
                    found.append(Piece(course, first, spans))
        return tuple(found)

    def rows(self, pieces):
        """Unknowns, and the coordinates of all control points: {(course, k): [x, y, z]}."""
        rows = {}
        for piece in pieces:
            for k in range(piece.first, piece.first + piece.spans + 1):
                k %= self.wales * self.points
                if (piece.course, k) not in rows:
                    self._spread(rows, piece.course, k)
        for (course, k, axis), terms in self._gauge(rows, pieces).items():
            _substitute(rows, (course, k, axis), terms)
        used = dict.fromkeys(
            key for row in rows.values() for x in row for key in x if key[0] != "L"
        )
        return list(used), rows

    def _spread(self, rows, course, k):
        """Add the coordinates of a control point and of all its images."""
        own = [{(course, k, axis): 1.0} for axis in range(3)]
        images = []
        for one in self.symmetries:
            there, at, along, up = self.image(one, course, k)
            # The image in the cell: x -> sign x + (along of the operation less whole periods) a1 + ...
            shift = _combine([(one.along - along, _A1), (one.up - up, _A2)], 2)
            if (there, at) == (course, k):
                for axis in range(3):
                    if one.sign[axis] < 0:
                        own[axis] = {c: 0.5 * v for c, v in shift[axis].items()}
            images.append((one, there, at, shift))
        for one, there, at, shift in images:
            rows[there, at] = [
                _sum([(float(one.sign[axis]), own[axis]), (1.0, shift[axis])]) for axis in range(3)
            ]

    def _gauge(self, rows, pieces):
        """What takes out rigid motions and the sliding of yarns that no symmetry takes out: {unknown: terms}.

        The middle of the first sinker arc stays at x = 0, the left leg of the first loop at y = 0 in its
        middle, the mean thickness at zero; and in each yarn the middles of the two legs of its first loop
        lie at the same height.  (Sliding raises one and lowers the other.  A condition on x would not do:
        sinker arc and head run the same way, so that sliding moves both as a translation does.)  Points
        cut from a yarn feel a little of the sliding; the condition then takes a force, zero where the
        loop is symmetric.  Friction or set say themselves how far a yarn slides; then nothing holds it.
        """
        signs = np.array([one.sign for one in self.symmetries])
        left, right, first = self.points // 4, 3 * self.points // 4, pieces[0].course
        held = {}
        if (signs[:, 0] > 0).all():
            held[first, pieces[0].first, 0] = {}
        if (signs[:, 1] > 0).all():
            held[first, left, 1] = {}
        if not self.slides and not any(one.sign[0] < 0 for one in self.symmetries):
            for course in dict.fromkeys(piece.course for piece in pieces):
                own = rows[course, right][1]
                if (course, right, 1) in own:
                    held[course, right, 1] = {(course, left, 1): 1.0}
            if (first, left, 1) in held:
                held[first, right, 1] = {}
        if (signs[:, 2] > 0).all():
            mean = _sum((1.0, row[2]) for row in rows.values())
            pinned = min(mean, key=lambda name: (name[0], abs(name[1] - left)))
            share = mean.pop(pinned)
            held[pinned] = {name: -value / share for name, value in mean.items()}
        return held

    def at(self, rows, course, k):
        """Coordinates of control point k of a course, also beyond the cell."""
        turns, k = divmod(k, self.wales * self.points)
        step = _combine([(turns * self.wales, _A1)], 2)
        return [_sum([(1.0, rows[course, k][axis]), (1.0, step[axis])]) for axis in range(3)]


_A1, _A2 = (0, 1), (2, 3)  # entries of L: along course and wale


def _combine(steps, axes):
    """Coordinates (3) of a sum of factors times lattice vectors."""
    found = [{} for _ in range(3)]
    for factor, vector in steps:
        for axis in range(axes):
            if factor:
                found[axis]["L", vector[axis]] = float(factor)
    return found


def _sum(terms):
    """Sum of (factor, dict)."""
    total = {}
    for factor, row in terms:
        for key, value in row.items():
            total[key] = total.get(key, 0.0) + factor * value
    return {key: value for key, value in total.items() if value != 0.0}


def _substitute(rows, key, terms):
    """Replace an unknown by a combination of others in all rows."""
    for row in rows.values():
        for axis in range(3):
            if key in row[axis]:
                factor = row[axis].pop(key)
                row[axis] = _sum([(1.0, row[axis]), (factor, terms)])


def to_map(rows, count):
    """The Map of rows, dicts column -> value, and of the lattice, which stands from ``count`` on."""
    rows = [*rows, *({count + i: 1.0} for i in range(LATTICE))]
    start = np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.int64)
    column = np.array([c for r in rows for c in r], dtype=np.int64)
    value = np.array([v for r in rows for v in r.values()], dtype=float)
    return Map(
        records(MAP_ROW, len(rows), start=start[:-1], stop=start[1:]),
        records(MAP_ENTRY, len(column), column=column, value=value),
    )


def owners(map_):
    """For every entry of a map the number of its row."""
    return np.repeat(np.arange(len(map_.rows)), map_.rows.stop - map_.rows.start)


def placed(map_, y):
    """Control points of a map at y, (m, 3)."""
    rows, entries = map_
    x = np.bincount(owners(map_), entries.value * y[entries.column], minlength=len(rows))
    return (x + rows.offset)[:-LATTICE].reshape(-1, 3)


def loops_of(cell, y):
    """Control points of all loops of the cell at y, (courses, wales points, 3)."""
    return placed(cell.whole, y).reshape(cell.courses, -1, 3)


def pack(cell, loops, lattice):
    """Unknowns y of a cell.

    loops: control points of all its loops, (courses, wales points, 3), with the symmetry of the cell;
    lattice (4 or 5,): L, the angle zero where it is left out.
    """
    y = np.zeros(cell.count + LATTICE)
    y[: cell.count] = loops[tuple(cell.where.T)]
    y[cell.count : cell.count + len(lattice)] = lattice
    return y


def rod_of(cell, lengths, bending_rigidity):
    """Gauss points of the cell's yarns (no rest curvature); lengths (courses,): of a loop in each (m)."""
    first = np.concatenate(
        [np.arange(p.spans) + s for p, s in zip(cell.pieces, cell.chain, strict=True)]
    )
    span = np.concatenate([np.full(p.spans, lengths[p.course]) for p in cell.pieces]) / cell.points
    first, span = np.repeat(first, 3), np.repeat(span, 3)
    place = np.tile(spline.GAUSS_POINTS, len(first) // 3)
    weights = np.tile(spline.GAUSS_WEIGHTS, len(first) // 3)
    return records(
        ROD, len(first), first=first, d0=spline.basis(place), d1=spline.basis_first(place),
        d2=spline.basis_second(place), span=span, weight=weights * span * cell.copies,
        stiffness=bending_rigidity,
    )  # fmt: skip


def touch_of(cell, lengths, exclude):
    """Contact points of the cell's yarns and the operations that make the images; lengths as in rod_of.

    Arcs are counted in loops of the mean length, in which courses differ little.
    """
    first, place, course, arc, length = [], [], [], [], []
    loop_length = float(np.mean(lengths))
    for one, start in zip(cell.pieces, cell.chain, strict=True):
        count = one.spans * cell.contacts // cell.points
        u = (np.arange(count) + 0.5) * cell.points / cell.contacts
        span, at = spline.split(u, one.spans)
        first.append(start + span)
        place.append(at)
        course.append(np.full(count, one.course))
        arc.append((one.first + u) * loop_length / cell.points)
        length.append(np.full(count, lengths[one.course] / cell.contacts))
    points = records(
        TOUCH_POINT,
        sum(map(len, first)),
        first=np.concatenate(first),
        yarn=np.concatenate(course),
        **spline.contact_basis(np.concatenate(place), cell.points / cell.contacts),
        length=np.concatenate(length),
        arc=np.concatenate(arc),
    )
    images = images_of(cell.pattern, cell.wales, cell.courses, cell.symmetries).copy()
    images.arc_shift *= loop_length
    return Touch(points, images, cell.copies, float(exclude), float(np.abs(images.steps).max()))


def reach_of(pattern):
    """Wales and courses to the furthest images of a pattern that are looked at."""
    return REACH if pattern.uniform else REACH_RIB if pattern.courses == 1 else REACH_FOLDED


@functools.lru_cache(maxsize=64)
def images_of(pattern, wales, courses, symmetries):
    """Every operation that carries the yarn to a place that it can touch (IMAGE), arcs in loops."""
    reach = reach_of(pattern)
    found = []
    for one in symmetries:
        # A mirror carries a place to where its own and the image's coordinate add up to the step.
        mirrored = [not pattern.uniform and one.sign[axis] < 0 for axis in (0, 1)]
        wide = _periods(one.along, wales, reach[0], 2 * wales * mirrored[0])
        high = _periods(one.up, courses, reach[1], 2 * courses * mirrored[1])
        found += [(one, one.along + a, one.up + b) for b in high for a in wide]
    sign = np.array([one.sign for one, *_ in found], dtype=float)
    steps = np.array([[along, up] for _, along, up in found], dtype=float)
    # x -> S x + t has the inverse x -> S x - S t.
    back = -sign[:, :2] * steps
    match = (np.abs(steps[None] - back[:, None]).max(-1) < 1e-9) & (
        np.abs(sign[None] - sign[:, None]).max(-1) < 1e-9
    )
    return records(
        IMAGE, len(found), sign=sign, steps=steps, arc_sign=sign[:, 0], arc_shift=steps[:, 0],
        turn=sign[:, 1], up=steps[:, 1], inverse=match.argmax(1),
    )  # fmt: skip


def _periods(offset, period, reach, further):
    """Whole periods for which offset + periods lies within the reach (half a loop more for halves), or up to
    so much further.
    """
    reach = max(reach, period) + offset % 1
    least = math.ceil((-reach - offset) / period)
    return [period * n for n in range(least, math.floor((reach + further - offset) / period) + 1)]


def trace_of(cell, touch):
    """Vertices of the cell's yarns as polylines, half a span apart, with the operations of touch."""
    first, place, course = [], [], []
    for one, start in zip(cell.pieces, cell.chain, strict=True):
        span, at = spline.split(np.arange(2 * one.spans + 1) / 2.0, one.spans)
        first.append(start + span)
        place.append(at)
        course.append(np.full(len(at), one.course))
    points = records(
        TOUCH_POINT, sum(map(len, first)), first=np.concatenate(first),
        yarn=np.concatenate(course), basis=spline.basis(np.concatenate(place)),
    )  # fmt: skip
    return touch._replace(points=points)


def expected_crossings(cell):
    """The codes that the pattern shows along the pieces of the cell, in order."""
    codes, half = [], cell.points // 2
    for one in cell.pieces:
        for leg in range(one.first // half, (one.first + one.spans - 1) // half + 1):
            own = cell.pattern.crossings(leg, one.course)
            codes += own if one.spans >= half else own[: len(own) // 2]
    return np.array(codes, dtype=np.int64)


def symmetries_of(cell, y, tolerance):
    """Those symmetries of the pattern that a state of a full cell has, to a tolerance (m).

    A shift of the whole along the axes that an operation reverses does not count.
    """
    loops, lattice, n = loops_of(cell, y), y[cell.count :], cell.spans
    a1, a2 = np.array([*lattice[:2], 0.0]), np.array([*lattice[2:4], 0.0])
    found = []
    for one in cell.pattern.symmetries():
        turns, k = np.divmod(one.sign[0] * np.arange(n) + round(one.along * cell.points), n)
        ups, j = np.divmod(one.sign[1] * np.arange(cell.courses) + one.up, cell.courses)
        image = np.array(one.sign) * loops + one.along * a1 + one.up * a2
        there = loops[j][:, k] + turns[None, :, None] * cell.wales * a1
        off = there + ups[:, None, None] * cell.courses * a2 - image
        shift = np.where(np.array(one.sign) < 0, off.mean((0, 1)), 0.0)
        if np.abs(off - shift).max() <= tolerance:
            found.append(one)
    return tuple(found)

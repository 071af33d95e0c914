"""Is a folded fabric interlooped as its pattern says?  Its yarns are drawn taut in an open cell, and read.

Seen along the thickness, a folded fabric shows other crossings than its pattern has.  What a motion in
which no two yarns meet leads to is knitted in the same way: a change of both spacings is one, and so is
each step in which nothing moves as far as to what lies nearest.  The yarns shorten like rubber, kept apart
by a force below a diameter, until the crossings seen are those of the pattern, or nothing moves any more.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from knitsim.verification.judge.given import design
from knitsim.verification.judge.measure import NEIGHBOURS, images_around, size_of
from knitsim.verification.judge.shape import as_patterned

VIEW = 2  # pieces per span
WIDE, HIGH = 2.4, 4.0  # loop length over wale and course spacing of the open cell
APART = 0.8, 0.4  # diameters up to which yarns push, tried in turn
PUSH = 0.5  # of a crossing over the yarn's pull
PACE = 5.0  # of a step: pieces over which a yarn evens out in it
SAFE = 0.45  # of the way to what lies nearest
STEPS, LOOK, STILL = 4000, 20, 1e-3  # at most; between two readings; diameters moved in a step
PARTS = 50  # of a straight way at most


@dataclass(frozen=True, eq=False)
class Lines:
    """Yarns of a cell as polylines: corners (yarns, n, 3), m; cell (2, 2): its steps (m)."""

    corners: np.ndarray
    cell: np.ndarray

    def pieces(self):
        """Vectors along the pieces (yarns, n, 3), the last of each yarn goes to the next cell."""
        ends = self.corners[:, :1] + np.append(self.cell[0], 0.0)
        return np.diff(np.concatenate([self.corners, ends], axis=1), axis=1)


def lines_of(given, control, lattice):
    """:class:`Lines` of a state; control (yarns, spans, 3), lattice (4,)."""
    spans = control.shape[1]
    matrix, turns = design(spans, np.arange(VIEW * spans) / VIEW)
    cell = np.reshape(lattice, (2, 2)) * [[given.wales], [given.courses]]
    corners = matrix @ control
    corners[..., :2] += turns[:, None] * cell[0]
    return Lines(corners, cell)


class _Near:
    """Pairs of pieces of Lines whose middles are closer than ``reach``, each once.

    i, k, image (pairs, 2) by which k is moved; gap (pairs, 3): from k to i where they are closest, its length
    room.  beyond: what lies between all other pairs at least.
    """

    def __init__(self, given, lines, reach):
        pieces = lines.pieces()
        middle, size = (lines.corners + 0.5 * pieces).reshape(-1, 3), size_of(pieces).ravel()
        count, loop = pieces.shape[1], given.wales * given.loop_length
        images = images_around(middle, lines.cell, reach)
        shift = np.pad(images @ lines.cell, ((0, 0), (0, 1)))
        moved = (middle[None] + shift[:, None]).reshape(-1, 3)
        near = (moved > middle.min(0) - reach) & (moved < middle.max(0) + reach)
        kept = np.flatnonzero(near.all(1))
        found = cKDTree(middle).sparse_distance_matrix(
            cKDTree(moved[kept]), reach, output_type="ndarray"
        )
        i, far = found["i"].astype(np.int64), kept[found["j"].astype(np.int64)]
        k, image = far % len(middle), images[far // len(middle)]
        arcs = (i % count - k % count) * loop / count - image[:, 0] * loop
        same = (image[:, 1] == 0) & (i // count == k // count)
        keep = ((image != 0).any(1) | (i < k)) & (
            ~same | (np.abs(arcs) >= NEIGHBOURS * given.diameter)
        )
        order = np.lexsort((k, i, far // len(middle)))
        order = order[keep[order]]
        self.i, self.k, self.image = i[order], k[order], image[order]
        ends = pieces.reshape(-1, 3)
        self.gap = _closest(middle[self.i] - moved[far[order]], ends[self.i], ends[self.k])
        self.room = size_of(self.gap)
        self.beyond = reach - size.max()


def _closest(gap, a, b):
    """The shortest ways (n, 3) from straight pieces b to a (n, 3), whose middles are a gap (n, 3) apart.

    Between the insides of both, or from an end of one to the other.
    """
    aa, bb, ab = (a * a).sum(1), (b * b).sum(1), (a * b).sum(1)
    ag, bg = (a * gap).sum(1), (b * gap).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        both = np.stack([ab * bg - bb * ag, aa * bg - ab * ag]) / (aa * bb - ab * ab)
    places = [np.where((np.abs(both) <= 0.5).all(0), both, 0.5)]
    for end in (-0.5, 0.5):
        at = np.full(len(a), end)
        places.append((at, np.clip((end * ab + bg) / bb, -0.5, 0.5)))
        places.append((np.clip((end * ab - ag) / aa, -0.5, 0.5), at))
    ways = np.array([gap + s[:, None] * a - t[:, None] * b for s, t in places])
    return ways[size_of(ways).argmin(0), np.arange(len(a))]


def straight(given, before, after):
    """Whether no yarns meet on the straight way from one Lines to another."""
    moved, turned = after.corners - before.corners, after.cell - before.cell
    pieces = after.pieces() - before.pieces()
    middle, grown = (moved + 0.5 * pieces).reshape(-1, 3), 0.5 * size_of(pieces).ravel()
    done = 0.0
    for _ in range(PARTS):
        here = Lines(before.corners + done * moved, before.cell + done * turned)
        reach = given.diameter + size_of(here.pieces()).max()
        near = _Near(given, here, reach)
        images = images_around(here.corners.reshape(-1, 3), here.cell, 2.0 * reach)
        fastest = np.abs(images @ turned).sum(1).max() + 2.0 * (size_of(middle) + grown).max()
        shift = np.pad(near.image @ turned, ((0, 0), (0, 1)))
        speed = size_of(middle[near.i] - middle[near.k] - shift) + grown[near.i] + grown[near.k]
        if near.room.min(initial=near.beyond) <= 0.0:
            return False
        with np.errstate(divide="ignore"):
            done += 2.0 * SAFE * min((near.room / speed).min(initial=np.inf), near.beyond / fastest)
        if done >= 1.0:
            return True
    return False


def taut(given, lines):
    """Whether the yarns, drawn taut in an open cell, cross as the pattern says."""
    return any(_drawn(given, lines, apart * given.diameter) for apart in APART)


def _drawn(given, lines, apart):
    """The same for yarns that push up to a distance (m)."""
    open_cell = np.diag([given.loop_length / WIDE, given.loop_length / HIGH])
    open_cell *= [[given.wales], [given.courses]]
    corners = lines.corners.copy()
    corners[..., :2] = corners[..., :2] @ np.linalg.solve(lines.cell, open_cell)
    lines = Lines(corners, open_cell)
    count = corners.shape[1]
    pull = 2.0 * np.eye(count) - np.roll(np.eye(count), 1, 0) - np.roll(np.eye(count), -1, 0)
    soften = np.linalg.inv(pull + np.eye(count) / PACE)
    for step in range(STEPS):
        if step % LOOK == 0 and as_patterned(given, _closed(lines), open_cell):
            return True
        pieces = lines.pieces()
        near = _Near(given, lines, apart + size_of(pieces).max())
        room = min(near.room.min(initial=np.inf), near.beyond)
        if room <= 0.0:
            return False
        push = PUSH * apart * np.maximum(apart / near.room - 1.0, 0.0)
        push = (push / near.room)[:, None] * near.gap
        ends, forces = np.concatenate([near.i, near.k]), np.concatenate([push, -push])
        on = [np.bincount(ends, column, pieces[..., 0].size) for column in forces.T]
        on = np.stack(on, axis=1).reshape(pieces.shape)
        force = pieces - np.roll(pieces, 1, axis=1) + 0.5 * (on + np.roll(on, 1, axis=1))
        way = soften @ force
        longest = size_of(way).max()
        if longest < STILL * given.diameter:
            break
        way *= min(1.0, SAFE * room / longest)
        lines = Lines(lines.corners + way, open_cell)
    return as_patterned(given, _closed(lines), open_cell)


def _closed(lines):
    """Corners (yarns, n + 1, 3), the last the first of the next cell."""
    ends = lines.corners[:, :1] + np.append(lines.cell[0], 0.0)
    return np.concatenate([lines.corners, ends], axis=1)


def not_interlooped(given, controls, lattices):
    """Number of the first state that is not knitted as the pattern says, None where all are.

    A state is where its crossings are seen to be the pattern's; where knit and purl stand side by side, so
    that a fabric folds, also where a straight way leads to it from one that is, or where its yarns drawn
    taut show them.
    """
    before, folds = None, len(set("".join(given.pattern))) > 1
    for number, (control, lattice) in enumerate(zip(controls, lattices, strict=True)):
        lines = lines_of(given, control, lattice)
        if not as_patterned(given, _closed(lines), lines.cell) and not (
            folds and ((before and straight(given, before, lines)) or taut(given, lines))
        ):
            return number
        before = lines
    return None

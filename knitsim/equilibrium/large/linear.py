"""The Hessian of a large cell as a sparse matrix, and linear problems with it.

The Hessian is assembled in blocks of control points (:mod:`sparse_kernels`) and factorised by SuperLU
(:func:`scipy.sparse.linalg.splu`) without pivoting, so that the signs of the pivots tell whether it is
positive definite.  The lattice couples to all of the cell's edge; it is kept out of the sparse matrix
as a border and eliminated last.

Flat fabrics only, without cylinders and couples: the cells of the fabric solver.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from knitsim.equilibrium.kernels.energy import new_work
from knitsim.equilibrium.kernels.pairs import (
    CHUNK,
    Listed,
    expand,
    place_frames,
    place_points,
    touching,
)
from knitsim.equilibrium.kernels.records import LATTICE, Work
from knitsim.equilibrium.large import assembly as kernels

SHIFT, SHIFT_STEP, SHIFTS = 1e-6, 4.0, 40  # of the largest diagonal entry; growth; tries
KRYLOV, REFACTOR = 60, 20  # back substitutions at most; above this the factor is renewed
GROWN = 1e6  # residual over the first, by the factor: such a factor is too far from the Hessian
FORCING = 1e-6  # how much smaller the residual of the linear problem must become
KEPT = 0.5  # couplings that stay in a pattern though they do not touch, over the pairs that do
COUNTED = ("factor", "pattern", "pairs", "krylov")


@dataclass(eq=False)
class Pattern:
    """Where the entries of the Hessian are, for given touching spans.

    keys: the couplings (rising); blocks: how many there are; entries, places: numbers of their entries, and
    where among the values of the sparse matrix each is added; start, index: its compressed columns.
    """

    keys: np.ndarray
    graph: kernels.Graph
    blocks: int
    entries: np.ndarray
    places: np.ndarray
    start: np.ndarray
    index: np.ndarray


@dataclass(eq=False)
class SparseWork:
    """Buffers of one scene of a full cell, the order of its unknowns, its pattern and last factor.

    work: buffers of energy and gradient, without the dense matrices.  node, turn: see
    :class:`sparse_kernels.Graph`.  unknown (control points, 3): number in y of each component, -1
    where it is held.  thick: numbers in y of all thickness components.  order: number in y of each row
    of the sparse matrix; number: row for each component.
    stale: whether the factor is too far from the Hessian to serve.  linear: the last Linear.
    counts: of what was done.
    """

    cell: object
    work: Work
    node: np.ndarray
    turn: np.ndarray
    unknown: np.ndarray
    thick: np.ndarray
    order: np.ndarray = None
    number: np.ndarray = None
    pattern: Pattern = None
    factor: object = None
    stale: bool = False
    linear: object = None
    counts: dict = field(default_factory=lambda: dict.fromkeys(COUNTED, 0))


def new_sparse_work(cell, scene):
    """The :class:`SparseWork` of a full cell's scene."""
    rows, entries = cell.map
    chain_points = (len(rows) - LATTICE) // 3
    n = cell.spans
    place = np.arange(-1, n + 2)
    node = (np.arange(len(cell.chain))[:, None] * n + place % n).ravel()
    turn = np.tile((place // n) * float(cell.wales), len(cell.chain))
    # A component that is one unknown, whichever.  The one that keeps the mean thickness at zero
    # counts as held: the mean is restored after each step.
    own = np.flatnonzero(turn == 0.0)
    unknown = np.full((len(own), 3), -1, dtype=np.int64)
    for axis in range(3):
        row = rows[3 * own + axis]
        single = np.flatnonzero(row.stop - row.start == 1)
        unknown[single, axis] = entries.column[row.start[single]]
    thick = unknown[:, 2]
    # The buffers of the energy and its gradient, with dense matrices of next to no size.
    small = scene._replace(map=scene.map._replace(rows=rows[-LATTICE:]), load=scene.load[-LATTICE:])
    work = new_work(small)._replace(
        x=np.zeros((chain_points, 3)),
        expanded=np.zeros(len(rows)),
        gradient=np.zeros(cell.count + LATTICE),
    )
    return SparseWork(cell, work, node, turn, unknown, thick[thick >= 0])


def place(scene, y, work):
    """Control and contact points at y into the buffers; the lattice (4,)."""
    lattice = expand(scene.map, y, work.work.x)
    place_frames(scene.touch, work.work.x, work.work.points)
    return lattice


def sparse_pairs(scene, y, skin, work):
    """The :class:`Listed` pairs at y as of ``pairs_at``."""
    lattice, reach = place(scene, y, work), touching(scene) + skin
    work.counts["pairs"] += 1
    pairs, weight = kernels.find_pairs_in_grid(scene.touch, work.work.points, lattice, reach)
    # In the order of the dense search, in which friction remembers.
    i, k, g = pairs.T
    order = np.lexsort((k, i, k // CHUNK, i // CHUNK, g))
    return Listed(pairs[order], weight[order], y.copy(), np.full(1, reach))


def sparse_intact(scene, trace, y, expected, work):
    """Whether the crossings at y are the expected ones, as ``intact``."""
    lattice = expand(scene.map, y, work.work.x)
    points = np.empty((trace.points.size, 3))
    place_points(trace, work.work.x, points)
    where, code = kernels.crossings_in_grid(trace, points, lattice)
    return np.array_equal(code[np.argsort(where, kind="stable")], expected)


def _blocks_of(work, keys):
    """Graph with the blocks for couplings ``keys``, and the control points of each block."""
    total, n = len(work.unknown), work.cell.spans
    # The span that starts at a control point has the next three of its yarn.
    yarn, along = np.divmod(np.arange(total), n)
    span = yarn[:, None] * n + (along[:, None] + np.arange(4)) % n

    def numbered(a, b):
        a, b = span[a][:, :, None], span[b][:, None, :]
        return np.maximum(a, b) * total + np.minimum(a, b)

    every = np.arange(total)
    own, touching = numbered(every, every), numbered(keys // total, keys % total)
    blocks = np.unique(np.concatenate([own.ravel(), touching.ravel()]))
    own = np.searchsorted(blocks, own)
    graph = kernels.Graph(work.node, work.turn, own[work.node], np.searchsorted(blocks, touching))
    return graph, *np.divmod(blocks, total)


def _set_order(work, rows, columns):
    """Choose the order of the unknowns in the sparse matrix, by control points."""
    rank = _fill_reducing(rows, columns, len(work.unknown))
    keep = work.unknown >= 0
    first = np.full(work.cell.count, 3 * len(rank))
    np.minimum.at(first, work.unknown[keep], (3 * rank[:, None] + np.arange(3))[keep])
    work.order = np.argsort(first, kind="stable")
    number = np.empty(work.cell.count, dtype=np.int64)
    number[work.order] = np.arange(work.cell.count)
    work.number = np.where(keep, number[work.unknown], -1)


def _fill_reducing(rows, columns, total):
    """Rank of each control point in a minimum-degree order of their graph.

    SuperLU orders a small diagonally dominant matrix of the same graph; the order of the threefold
    larger Hessian follows at a fraction of the cost, and with less fill.
    """
    off = rows != columns
    links = sparse.coo_matrix(
        (np.full(off.sum(), -1.0), (rows[off], columns[off])), shape=(total, total)
    )
    links = links + links.T
    graph = (sparse.diags(1.0 - np.asarray(links.sum(1)).ravel()) + links).tocsc()
    return _lu(graph, "MMD_AT_PLUS_A").perm_c


def _lu(matrix, order):
    return splu(matrix, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _pattern_of(work, keys):
    """The :class:`Pattern` for couplings ``keys`` (rising) and neighbours along the yarns."""
    graph, rows, columns = _blocks_of(work, keys)
    if work.order is None:
        # Kept: which places touch changes little in a fabric that stays interlooped.
        _set_order(work, rows, columns)
    p = np.broadcast_to(work.number[rows][:, :, None], (len(rows), 3, 3)).ravel()
    q = np.broadcast_to(work.number[columns][:, None, :], (len(rows), 3, 3)).ravel()
    inside = (p >= 0) & (q >= 0)
    p, q, entries = p[inside], q[inside], np.flatnonzero(inside)
    size = work.cell.count
    # Boolean entries: those that fall on each other are one.
    half = sparse.coo_matrix((np.ones(len(p), dtype=bool), (p, q)), shape=(size, size)).tocsc()
    whole = (half + half.T).tocsc()
    whole.sort_indices()
    # A block off the diagonal stands on both sides of it.
    both = np.repeat(rows != columns, 9)[inside]
    stored = np.repeat(np.arange(size), np.diff(whole.indptr)) * size + whole.indices
    places = np.searchsorted(stored, np.concatenate([q * size + p, (p * size + q)[both]]))
    entries = np.concatenate([entries, entries[both]])
    return Pattern(keys, graph, len(rows), entries, places, whole.indptr, whole.indices)


def _couplings(work, keys):
    """Numbers of the couplings of each list of keys in the pattern, which is renewed where needed."""
    known = work.pattern.keys if work.pattern is not None else np.empty(0, dtype=np.int64)
    numbers = [np.searchsorted(known, k) for k in keys]
    if work.pattern is None or not all(
        not len(k) or (n.max() < len(known) and np.array_equal(known[n], k))
        for k, n in zip(keys, numbers, strict=True)
    ):
        # Those that were touching may touch again: a pattern costs more than some zeros.
        kept = known if len(known) < KEPT * sum(map(len, keys)) else known[:0]
        known = np.unique(np.concatenate([*keys, kept]))
        work.pattern = _pattern_of(work, known)
        work.counts["pattern"] += 1
        numbers = [np.searchsorted(known, k) for k in keys]
    return numbers


class Linear:
    """The Hessian at y by all q and the free entries of the lattice, in the order of ``work``.

    matrix: sparse, by q; border (count, 4), corner (4, 4): by the lattice.  free: numbers of the
    free lattice entries.
    """

    def __init__(self, scene, y, pairs, slip, free, work):
        both = [pairs.pairs] + ([np.ascontiguousarray(slip.pairs["pair"])] if slip else [])
        coupling, *rubbing = _couplings(
            work, [kernels.keys_of(scene, work.node, listed) for listed in both]
        )
        pattern, inner = work.pattern, work.work
        parts = kernels.Parts(
            np.zeros((pattern.blocks, 3, 3)),
            np.zeros((len(work.unknown), 3, LATTICE)),
            np.zeros((LATTICE, LATTICE)),
        )
        lattice = place(scene, y, work)
        graph = pattern.graph
        kernels.add_yarn_blocks(scene, inner.x, slip.lags if slip else (), graph, parts)
        listed = (pairs.pairs, pairs.weight, coupling)
        kernels.add_contact_blocks(scene, inner.points, lattice, listed, graph, parts)
        if slip:
            kernels.add_slip_blocks(scene, inner.points, lattice, slip, *rubbing, graph, parts)
        added = parts.blocks.ravel()[pattern.entries]
        value = np.bincount(pattern.places, added, len(pattern.index))
        size = work.cell.count
        self.matrix = sparse.csc_matrix((value, pattern.index, pattern.start), shape=(size, size))
        self.border, self.corner = np.zeros((size, LATTICE)), parts.corner
        keep = work.number >= 0
        np.add.at(self.border, work.number[keep], parts.border[keep])
        self.free = np.asarray(free, dtype=np.int64)
        self.work = work

    def times(self, v):
        """Product with a vector of q (in order) and the free lattice entries."""
        n = self.matrix.shape[0]
        border = self.border[:, self.free]
        at = border.T @ v[:n] + self.corner[np.ix_(self.free, self.free)] @ v[n:]
        return np.concatenate([self.matrix @ v[:n] + border @ v[n:], at])

    def factorise(self):
        """Renew the factor of ``work`` with the smallest shift of a rising sequence that makes the
        Hessian positive definite; False where none does.
        """
        work = self.work
        size = SHIFT * abs(self.matrix.diagonal()).max()
        # Where the last one needed a shift, this one needs hardly less.
        shift = work.factor.shift / SHIFT_STEP**2 if work.factor is not None else 0.0
        shift = shift if shift >= size else 0.0
        for _ in range(SHIFTS):
            work.counts["factor"] += 1
            factor = factor_of(self, shift)
            if factor is not None:
                work.factor, work.stale = factor, False
                return True
            shift = size if shift == 0.0 else SHIFT_STEP * shift
        return False

    def ready(self):
        """See that ``work`` has a factor near enough; False where none exists."""
        factor = self.work.factor
        if self.work.stale or factor is None or not np.array_equal(factor.free, self.free):
            return self.factorise()
        return True

    def solve(self, rhs):
        """Solution for a right side; where the Hessian is not definite, a direction of descent.

        Conjugate gradients with the factor of a point nearby as preconditioner: a handful of back
        substitutions, where factorising anew costs some seventy in a cell of 20 by 20 loops.
        """
        work = self.work
        r, x = rhs, np.zeros_like(rhs)
        z = p = start = work.factor.solve(r)
        rho = first = r @ z
        for used in range(1, KRYLOV + 1):
            work.counts["krylov"] += 1
            work.stale = used > REFACTOR
            ap = self.times(p)
            curve = p @ ap
            if not curve > 0.0:
                # Convex no longer: what was found so far, or the preconditioned gradient.
                work.stale = True
                return p if used == 1 else x
            length = rho / curve
            x = x + length * p
            r = r - length * ap
            z = work.factor.solve(r)
            new = r @ z
            if new <= FORCING**2 * first:
                return x
            if not new <= GROWN * first:
                work.stale = True
                return start
            p = z + (new / rho) * p
            rho = new
        work.stale = True
        return x

    def answer(self, rhs, nearly=False):
        """Change of y (all entries) that balances the right side by y, the mean thickness kept.

        nearly: by the factor alone, which may be that of a point nearby.
        """
        work, count = self.work, self.work.cell.count
        q = rhs[:count].copy()
        # By y, the control point that keeps the mean moves along with each other one; the matrix
        # holds it instead.  Forces along the thickness add up to zero.
        q[work.thick] -= q[work.thick].sum() / len(work.unknown)
        solve = work.factor.solve if nearly else self.solve
        solved = solve(np.concatenate([q[work.order], rhs[count + self.free]]))
        change = np.zeros(count + LATTICE)
        change[work.order] = solved[:count]
        change[work.thick] -= change[work.thick].sum() / len(work.unknown)
        change[count + self.free] = solved[count:]
        return change

    def by_lattice(self, lattice):
        """Change of the gradient by y for a change of the lattice (4,)."""
        work, count = self.work, self.work.cell.count
        change = np.empty(count + LATTICE)
        change[work.order] = self.border @ lattice
        # The reverse of what ``answer`` does to its right side.
        held = -change[work.thick].sum()
        change[work.thick] -= held
        change[count:] = self.corner @ lattice
        return change


@dataclass(eq=False)
class Factor:
    """Factor of Hessian + shift I by q and the free lattice entries, these eliminated last."""

    lu: object
    border: np.ndarray
    solved: np.ndarray
    schur: np.ndarray
    free: np.ndarray
    shift: float

    def solve(self, rhs):
        n = len(self.border)
        z = self.lu.solve(rhs[:n])
        if not len(self.free):
            return z
        at = np.linalg.solve(self.schur, rhs[n:] - self.border.T @ z)
        return np.concatenate([z - self.solved @ at, at])


def factor_of(linear, shift=0.0):
    """The :class:`Factor` of a :class:`Linear` with a shift; None where not positive definite."""
    matrix, free = linear.matrix, linear.free
    if shift:
        matrix = matrix + shift * sparse.identity(matrix.shape[0], format="csc")
    try:
        lu = _lu(matrix, "NATURAL")
    except RuntimeError:  # a pivot is exactly zero
        return None
    # Pivots off the diagonal: the signs would not mean what they should.
    if not (np.array_equal(lu.perm_r, lu.perm_c) and (lu.U.diagonal() > 0.0).all()):
        return None
    border = linear.border[:, free]
    solved = lu.solve(border) if len(free) else border
    schur = linear.corner[np.ix_(free, free)] + shift * np.eye(len(free)) - border.T @ solved
    if len(free) and not np.linalg.eigvalsh(0.5 * (schur + schur.T))[0] > 0.0:
        return None
    return Factor(lu, border, solved, schur, free, shift)

"""States at rest with less symmetry than their pattern has: a rib folds.

Where the state that has all symmetries is unstable, the eigenvector of the lowest eigenvalue of the full
cell's Hessian says which way it gives.  A step along it keeps some of the symmetries; with these the
fabric finds its next state, and so on until it is stable.

>>> from knitsim.equilibrium.fabric import Fabric
>>> from knitsim.equilibrium.relax import relax
>>> from knitsim.yarn.law import paper_k3
>>> rib = Fabric(None, None, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(True), pattern="rib_1x1")
>>> rest = relax(rib)
>>> len(rib.pattern.symmetries()), len(rest.model.cell.symmetries), len(rest.passed)
(4, 2, 1)
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, eigsh
from scipy.spatial import cKDTree

from knitsim.equilibrium.cell import loops_of, owners, reach_of, symmetries_of
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.newton import factorise, solve_factored
from knitsim.equilibrium.kernels.pairs import pairs_at
from knitsim.equilibrium.kernels.records import LATTICE
from knitsim.equilibrium.model import build_model, carried, centrelines
from knitsim.errors import ComputationError

MOST_LOOPS = 16  # in a cell that is searched
FOLDS = 4  # losses of symmetry followed, one after the other
STEP = 0.3  # diameters, largest of a step along an eigenvector
SYMMETRIC = 0.02  # of the step: to what an operation must hold
KEPT = 0.02  # diameters: to what it must hold at rest
LESS = 1e-6  # of the energy: how much less counts
SHIFTED = 4.0  # factor of a shift that is too small
UNSTABLE = 1e-9  # of the largest eigenvalue: a negative one that is more than round-off
SHIFT = 64 * UNSTABLE  # of the largest diagonal entry: below most lowest eigenvalues


def lowest_mode(model, y):
    """Lowest eigenvalue of the frictionless Hessian of a full cell over its largest diagonal entry (1),
    and its eigenvector by all unknowns (longest move of a control point or spacing 1).

    What a move costs counts against how far control points move, so that it does not matter which of
    them are held against rigid motions.
    """
    free, work = model.free(0, 3), new_work(model.scene)
    pairs = pairs_at(model.scene, y, 0.0, work)
    energy_of(model.scene, y, pairs, model.at_ease, np.int64(2), work)
    hessian = work.hessian[np.ix_(free, free)].copy()
    whole = model.cell.whole
    rows, value = owners(whole), whole.entries.value.copy()
    value[rows >= len(whole.rows) - LATTICE] *= np.sqrt(model.cell.points)
    place = csr_array((value, (rows, whole.entries.column)), shape=(len(whole.rows), y.size))
    value, vector = _lowest(hessian, (place.T @ place).toarray()[np.ix_(free, free)])
    mode = np.zeros(y.size)
    mode[free] = vector
    moved = np.append((place @ mode)[:-LATTICE], mode[-LATTICE:-1])
    # The sign is a convention of the library that found it.
    mode /= moved[np.argmax(np.abs(moved))]
    return value / hessian.diagonal().max(), mode


def _lowest(hessian, mass):
    """Lowest eigenvalue and its vector, by Lanczos' method from a shift below it, where there is a factor."""
    shift, n = SHIFT * hessian.diagonal().max(), np.arange(len(hessian))
    # Not by LAPACK, whose threads wait for each other: a rib's rest took 2.2 s of CPU so on a busy machine.
    factor = np.zeros_like(hessian)
    while not factorise(hessian + shift * mass, n, 0.0, factor):
        shift *= SHIFTED

    def solved(right):
        found = right.ravel().copy()
        solve_factored(factor, found)
        return found

    solve = LinearOperator(hessian.shape, matvec=solved, dtype=float)
    start = np.random.default_rng(0).standard_normal(len(hessian))
    value, vector = eigsh(hessian, k=1, M=mass, sigma=-shift, OPinv=solve, v0=start)
    return value[0], vector[:, 0]


def overlooked(model, y):
    """Whether yarns touch that lie further apart than the cell's images reach: courses that have slid far
    over each other, which could have passed through each other unseen.
    """
    cell, d = model.cell, model.fabric.diameter
    size = np.array([cell.wales, cell.courses])
    across, up = np.ptp(loops_of(cell, y)[..., :2], axis=(0, 1)) + d
    a1, a2 = y[model.lattice : model.lattice + 4].reshape(2, 2) * size[:, None]
    highest = int(up / a2[1])
    widest = int((across + highest * abs(a2[0])) / a1[0])
    seen = np.maximum(reach_of(cell.pattern), size) // size
    far = [
        (p, q) for q in range(highest + 1) for p in range(-widest, widest + 1)
        if abs(p) > seen[0] or q > seen[1]
    ]  # fmt: skip
    points = centrelines(model, y).reshape(-1, 3) if far else np.zeros((0, 3))
    tree = cKDTree(points)
    moves = (np.append(p * a1 + q * a2, 0.0) for p, q in far)
    return any(np.isfinite(tree.query(points + m, distance_upper_bound=d)[0]).any() for m in moves)


def folded(one, y, used):
    """Model, unknowns, iterations of a stable state at rest, and the unstable ones that were left.

    one, y: the state with all symmetries; the states left: [(wale spacing, course spacing (m), energy
    per loop (J))].
    """
    from knitsim.equilibrium.relax import settle

    fabric, resolution = one.fabric, Resolution(one.cell.points, one.cell.contacts)
    state, left = settle(one, y, one.free(0, 3)), []
    full = build_model(fabric, resolution, "none", sparse=False)
    for _ in range(FOLDS if full.loops <= MOST_LOOPS else 0):
        flat = carried(full, one, state.y)
        value, mode = lowest_mode(full, flat)
        if value >= -UNSTABLE:
            break
        step = STEP * fabric.diameter
        disturbed = flat + step * mode
        kept = symmetries_of(full.cell, disturbed, SYMMETRIC * step)
        less = build_model(fabric, resolution, kept)
        try:
            found = settle(less, carried(less, full, disturbed), less.free(0, 3), state.iterations)
        except ComputationError:
            break
        less_energy = found.energy.sum() < (1.0 - LESS) * state.energy.sum()
        if not less_energy or _ran_away(found, state):
            break
        left.append((state.wale_spacing, state.course_spacing, float(state.energy.sum())))
        one, state = less, found
    if left:
        one, state = _with_symmetry(one, state)
    return one, state.y, used + state.iterations, tuple(left)


def _ran_away(found, state):
    """Whether a fabric has not folded but come apart: its spacings are beyond half or twice those it had.

    Courses that slide so far over each other meet others than those whose images are looked at.
    """
    wale = found.wale_spacing / state.wale_spacing
    course = found.course_spacing / state.course_spacing
    return not (0.5 < wale < 2.0 and 0.5 < course < 2.0)


def _with_symmetry(one, state):
    """The state in a cell with all symmetries that it has: a step along a mode may have lost more."""
    from knitsim.equilibrium.relax import settle

    fabric, resolution = one.fabric, Resolution(one.cell.points, one.cell.contacts)
    full = build_model(fabric, resolution, "none")
    kept = symmetries_of(full.cell, carried(full, one, state.y), KEPT * fabric.diameter)
    if len(kept) <= len(one.cell.symmetries):
        return one, state
    more = build_model(fabric, resolution, kept)
    try:
        found = settle(more, carried(more, one, state.y), more.free(0, 3), state.iterations)
    except ComputationError:
        return one, state
    same = abs(found.energy.sum() / state.energy.sum() - 1.0) <= LESS
    return (more, found) if same else (one, state)

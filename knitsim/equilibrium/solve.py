"""One face of the solver for all fabrics: dense and compiled, or sparse where the cell is large."""

import numpy as np

from knitsim.equilibrium.kernels import follow as paths
from knitsim.equilibrium.kernels import newton
from knitsim.equilibrium.kernels.crossings import intact
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.pairs import Listed, pairs_at
from knitsim.equilibrium.kernels.records import LATTICE
from knitsim.equilibrium.large.linear import (
    Linear,
    factor_of,
    new_sparse_work,
    sparse_intact,
    sparse_pairs,
)
from knitsim.equilibrium.large.newton import lattice_entries, sparse_follow, sparse_minimise


def minimise(model, scene, y, free, control):
    """Move y (in place) to a minimum of the frictionless energy by its free unknowns.

    Returns status, iterations, residual (N), and the buffers with gradient, terms and closest at y.
    """
    if model.sparse:
        work = new_sparse_work(model.cell, scene)
        pairs = sparse_pairs(scene, y, control.skin, work)
        return *sparse_minimise(scene, y, free, pairs, (), control, False, work)[:3], work.work
    work = new_work(scene)
    listed, slip = _none_listed(y), model.at_ease
    return *newton.minimise(scene, y, free, listed, slip, control, False, work)[:3], work


def _none_listed(y):
    """A list of pairs that covers no shape."""
    return Listed(np.empty((0, 3), dtype=np.int64), np.empty(0), y.copy(), np.full(1, -np.inf))


def _energy_at(model, scene, y, free=None):
    """Buffers with the frictionless energy at y of a dense model; its Hessian too where ``free`` is given.

    By a search that takes no step: another way into the kernels would take a second more to compile.
    """
    work, control = new_work(scene), model.control._replace(limit=0, skin=0.0)
    some = model.free()[:0] if free is None else free
    newton.minimise(
        scene, y.copy(), some, _none_listed(y), model.at_ease, control, free is None, work
    )
    return work


def gradient_at(model, scene, y):
    """Derivatives of the frictionless energy by y (N), dead loads in them; closest distance (m)."""
    if model.sparse:
        holder = new_sparse_work(model.cell, scene)
        work, pairs = holder.work, sparse_pairs(scene, y, 0.0, holder)
        energy_of(scene, y, pairs, model.at_ease, np.int64(1), work)
    else:
        work = _energy_at(model, scene, y)
    return work.gradient, float(np.sqrt(work.closest[0]))


def force_at(model, scene, y, rub, memory):
    """Derivatives by y (N) of energy and friction, which prescribed unknowns and dead loads hold."""
    if rub == () or not (memory.pairs.size or len(memory.lags)):
        return gradient_at(model, scene, y)[0] + scene.load
    if model.sparse:
        holder = new_sparse_work(model.cell, scene)
        work, pairs = holder.work, sparse_pairs(scene, y, model.control.skin, holder)
    else:
        work = new_work(scene)
        pairs = pairs_at(scene, y, model.control.skin, work)
    slip = paths.begin_friction(scene, y, pairs, rub, memory, work)
    energy_of(scene, y, pairs, slip, np.int64(1), work)
    return work.gradient + scene.load


def follow(model, scene, standing, targets, march, rub, trail):
    """As :func:`knitsim.equilibrium.kernels.follow.follow`."""
    if model.sparse:
        return sparse_follow(model, scene, standing, targets, march, rub, trail)
    return paths.follow(scene, standing, targets, march, rub, trail)


def is_plain(model, y):
    """Whether the crossings of all yarns of the cell are those of the pattern."""
    if model.sparse:
        work = new_sparse_work(model.cell, model.scene)
        return sparse_intact(model.scene, model.trace, y, model.expected, work)
    x = np.zeros(((len(model.scene.map.rows) - LATTICE) // 3, 3))
    return bool(intact(model.scene, model.trace, y, model.expected, x))


def linear_at(model, scene, y, free):
    """The sparse frictionless Hessian of a full cell at y (:class:`.large.linear.Linear`)."""
    work = new_sparse_work(model.cell, scene)
    pairs = sparse_pairs(scene, y, 0.0, work)
    return Linear(scene, y, pairs, (), lattice_entries(free, work), work)


def is_stable(model, scene, y, free):
    """Whether the frictionless energy of the cell is convex at y by all q and the free entries."""
    if model.sparse:
        return factor_of(linear_at(model, scene, y, free)) is not None
    work = _energy_at(model, scene, y, free)
    return bool(newton.factorise(work.hessian, free, 0.0, work.factor))

"""One face of the solver for all fabrics: dense and compiled, or sparse where the cell is large."""

import numpy as np

from knitsim.equilibrium.kernels import follow as path_kernels
from knitsim.equilibrium.kernels import newton as newton_kernels
from knitsim.equilibrium.kernels.friction import no_slip
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
        return *sparse_minimise(scene, y, free, no_slip(), control, work), work.work
    work = newton_kernels.new_work(scene)
    return *newton_kernels.minimise(scene, y, free, no_slip(), control, work), work


def gradient_at(model, scene, y):
    """Derivatives of the frictionless energy by y (N), dead loads in them; closest distance (m)."""
    if model.sparse:
        holder = new_sparse_work(model.cell, scene)
        work, pairs = holder.work, sparse_pairs(scene, y, 0.0, holder)
    else:
        work = newton_kernels.new_work(scene)
        pairs = newton_kernels.pairs_at(scene, y, 0.0, work)
    newton_kernels.energy_of(scene, y, pairs, no_slip(), np.int64(1), work)
    return work.gradient, float(np.sqrt(work.closest[0]))


def follow(model, scene, y, force, targets, march, trail):
    """As :func:`knitsim.equilibrium.kernels.follow.follow`."""
    if model.sparse:
        return sparse_follow(model, scene, y, force, targets, march, trail)
    return path_kernels.follow(scene, model.trace, y, force, targets, march, model.control, trail)


def is_plain(model, y):
    """Whether the crossings of all yarns of the cell are those of plain knit."""
    if model.sparse:
        work = new_sparse_work(model.cell, model.scene)
        return sparse_intact(model.scene, model.trace, y, model.expected, work)
    work = newton_kernels.new_work(model.scene)
    return bool(path_kernels.intact(model.scene, model.trace, y, model.expected, work))


def linear_at(model, scene, y, free):
    """The sparse frictionless Hessian of a full cell at y (:class:`.large.linear.Linear`)."""
    work = new_sparse_work(model.cell, scene)
    pairs = sparse_pairs(scene, y, 0.0, work)
    return Linear(scene, y, pairs, no_slip(), lattice_entries(free, work), work)


def is_stable(model, scene, y, free):
    """Whether the frictionless energy of a full cell is convex at y by all q and the free entries."""
    if model.sparse:
        return factor_of(linear_at(model, scene, y, free)) is not None
    work = newton_kernels.new_work(scene)
    pairs = newton_kernels.pairs_at(scene, y, 0.0, work)
    newton_kernels.energy_of(scene, y, pairs, no_slip(), np.int64(2), work)
    return bool(newton_kernels.factorise(work.hessian, free, 0.0, work.factor))

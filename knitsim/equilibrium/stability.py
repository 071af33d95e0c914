"""Whether the symmetric loop is a minimum of the energy among many.

The quarter of a loop, repeated, is always in equilibrium; whether loops side by side would rather
differ, only a larger cell can tell.  Without friction nothing but the yarn's stiffness keeps a loop
from giving yarn to its neighbours, and a pulled fabric can do with less energy if it does.  The
smallest eigenvalue of the larger cell's Hessian along the quarter's path shows where.
"""

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.model import build_model, carried, with_set
from knitsim.equilibrium.solve import linear_at
from knitsim.errors import ComputationError, InputError

EIGEN_TOLERANCE = 1e-6


def lowest_stiffness(curve, wales, courses):
    """Smallest eigenvalue (N/m) of a larger cell's Hessian at each state of a quarter's curve, (steps,).

    The Hessian is that of the frictionless energy of ``wales`` by ``courses`` whole loops, all in the
    curve's state, by all unknowns of the cell that equilibrium decides in that test; negative where
    the symmetric state is not stable without friction.  Raises InputError for a curve that is not of
    the quarter, ComputationError where no eigenvalue is found.
    """
    one = curve.model
    if not one.cell.symmetric:
        raise InputError("cell", "full", "must be symmetric: the symmetric state is asked for")
    size = Resolution(one.cell.points, one.cell.contacts, "full", wales, courses)
    model = build_model(one.fabric, size, slides=one.held is not None)
    if one.held is not None:
        model = with_set(model, carried(model, one, one.held))
    scene, free = model.with_load(curve.load), model.free(*curve.free)
    return np.array(
        [_lowest(linear_at(model, scene, carried(model, one, y), free)) for y in curve.y]
    )


def _lowest(linear):
    """Smallest eigenvalue: the one nearest to a shift below it, at which the Hessian has a factor."""
    if not linear.factorise():
        raise ComputationError("stability: the Hessian of the larger cell has no factor")
    factor = linear.work.factor
    n = len(factor.border) + len(factor.free)
    found = eigsh(
        LinearOperator((n, n), matvec=linear.times),
        k=1,
        sigma=-factor.shift,
        OPinv=LinearOperator((n, n), matvec=factor.solve),
        v0=np.random.default_rng(0).standard_normal(n),
        tol=EIGEN_TOLERANCE,
        return_eigenvectors=False,
    )
    return float(found[0])

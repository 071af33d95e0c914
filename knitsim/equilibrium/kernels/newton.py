"""Equilibrium of one scene: total energy of the unknowns, Newton's method, following a load (compiled).

Newton's method uses the exact Hessian, shifted by a multiple of the identity where it is not positive
definite, a cap on the largest displacement and an Armijo line search.  Where a further decrease of
the energy drowns in round-off, a smaller residual counts as progress.

A Hessian costs several gradients.  So its factor serves for up to two more steps where the residual
falls so fast that these are expected to end the search.

A nearly inextensible yarn that turns stretches at first in any straight step, and the next step
takes the stretch out again; a line search that forbids the rise crawls.  So a few whole steps may be
taken on trust (Control.trust): if they do not end below the energy they started from, the best
known point is restored and searched from as usual.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.contact import add_contact, find_pairs, place_points
from knitsim.equilibrium.kernels.curved import (
    Bent,
    add_angle,
    add_curved_contact,
    add_curved_yarn,
    curvature_at,
)
from knitsim.equilibrium.kernels.curved_friction import add_curved_friction, add_lag
from knitsim.equilibrium.kernels.fixtures import add_couples, add_cylinders
from knitsim.equilibrium.kernels.friction import add_friction
from knitsim.equilibrium.kernels.yarn import add_yarn
from knitsim.jit import njit

CONVERGED, TOO_MANY, NO_DESCENT, NOT_FINITE = 0, 1, 2, 3
ARMIJO = 1e-4
ROUND_OFF = 1e-13  # relative to the energy
HALVINGS = 30
REUSES = 2  # steps with a factor after the first, where they are expected to end the search
FADING = 2.0  # a factor's second step against its first: Newton's error e becomes c e^2, then 2 c e


class Control(NamedTuple):
    """Settings of Newton's method.

    tolerance: largest residual (N); cap: largest change of any unknown in one step (m); skin: how
    far beyond contact pairs are listed (m); limit: iterations allowed; trust: whole steps in a row
    that may be taken although the energy rises.
    """

    tolerance: float
    cap: float
    skin: float
    limit: int
    trust: int


class Work(NamedTuple):
    """Buffers of one scene: control points, contact points, gradients, Hessians, factor.

    terms: energy by term (stretch, bending, contact); closest (1,): smallest squared distance;
    by_kappa (2,), mixed: derivatives by the curvature of a bent fabric, of energy and friction
    potential (J m, J m2) and of their expanded gradient.
    """

    x: np.ndarray
    points: np.ndarray
    half: np.ndarray
    expanded: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray
    factor: np.ndarray
    terms: np.ndarray
    closest: np.ndarray
    by_kappa: np.ndarray
    mixed: np.ndarray


@njit
def new_work(scene):
    rows = scene.map.rows.size
    n = scene.load.size
    return Work(
        np.zeros(((rows - 4) // 3, 3)),
        np.zeros((scene.touch.points.size, 3)),
        np.zeros((rows, rows)),
        np.zeros(rows),
        np.zeros(n),
        np.zeros((n, n)),
        np.zeros((n, n)),
        np.zeros(3),
        np.zeros(1),
        np.zeros(2),
        np.zeros(rows),
    )


@njit
def expand(map_, y, x):
    """Control points x (n, 3) of the unknowns y; returns the lattice L."""
    rows = map_.rows.size
    lattice = np.empty(4)
    for r in range(rows):
        value = map_.rows[r].offset
        for e in range(map_.rows[r].start, map_.rows[r].stop):
            value += map_.entries[e].value * y[map_.entries[e].column]
        if r < rows - 4:
            x[r // 3, r % 3] = value
        else:
            lattice[r - rows + 4] = value
    return lattice


@njit
def reduce_gradient(map_, expanded, gradient):
    """gradient = C^T expanded."""
    gradient[:] = 0.0
    for r in range(expanded.size):
        g = expanded[r]
        for e in range(map_.rows[r].start, map_.rows[r].stop):
            gradient[map_.entries[e].column] += map_.entries[e].value * g


@njit
def reduce_hessian(map_, half, hessian):
    """hessian = C^T (A + A^T) C for the half matrix A."""
    hessian[:] = 0.0
    rows = half.shape[0]
    for r in range(rows):
        for c in range(rows):
            h = half[r, c]
            if h == 0.0:
                continue
            for e in range(map_.rows[r].start, map_.rows[r].stop):
                hr = h * map_.entries[e].value
                i = map_.entries[e].column
                for f in range(map_.rows[c].start, map_.rows[c].stop):
                    hessian[i, map_.entries[f].column] += hr * map_.entries[f].value
    n = hessian.shape[0]
    for i in range(n):
        hessian[i, i] *= 2.0
        for j in range(i):
            total = hessian[i, j] + hessian[j, i]
            hessian[i, j] = total
            hessian[j, i] = total


@njit
def energy_of(scene, y, pairs, slip, order, work):
    """Total energy (J) at y with the listed contact pairs (pairs, weights) and friction pairs.

    Fills work.terms (without friction) and work.closest, with order >= 1 work.gradient, with order 2
    work.hessian, all by y, with friction and the dead loads in them.
    """
    lattice = expand(scene.map, y, work.x)
    work.terms[:] = 0.0
    if order >= 1:
        work.expanded[:] = 0.0
    if order == 2:
        work.half[:] = 0.0
    bent, kappa, rubbing = Bent(work.expanded, work.half, work.mixed, work.by_kappa), 0.0, 0.0
    work.by_kappa[0] = 0.0
    if scene.bend.active:
        kappa = curvature_at(scene.bend, lattice)
        if order == 2:
            work.by_kappa[1] = 0.0
            work.mixed[:] = 0.0
        add_curved_yarn(scene, kappa, work.x, order, bent, work.terms)
        rubbing += add_lag(scene, kappa, work.x, slip, order, bent)
    else:
        add_yarn(scene, work.x, order, work.expanded, work.half, work.terms)
    energy = work.terms[0] + work.terms[1] + rubbing
    energy += add_couples(scene.couples, work.x, order, work.expanded, work.half)
    work.closest[0] = math.inf
    if pairs[1].size or slip.pairs.size or scene.cylinders.size:
        place_points(scene.touch, work.x, work.points)
        if scene.bend.active:
            contact, closest = add_curved_contact(
                scene, kappa, work.points, lattice, pairs, order, bent
            )
            contact_slip = add_curved_friction(
                scene, kappa, work.points, lattice, slip, order, bent
            )
        else:
            contact, closest = add_contact(
                scene, work.points, lattice, pairs, order, work.expanded, work.half
            )
            contact_slip = add_friction(
                scene, work.points, lattice, slip, order, work.expanded, work.half
            )
        work.closest[0] = closest
        contact += add_cylinders(scene, work.points, order, work.expanded, work.half)
        work.terms[2] = contact
        energy += contact + contact_slip
    if order >= 1 and scene.bend.active:
        add_angle(scene.bend, lattice, order, bent)
    for i in range(y.size):
        energy -= scene.load[i] * y[i]
    if order >= 1:
        reduce_gradient(scene.map, work.expanded, work.gradient)
        for i in range(y.size):
            work.gradient[i] -= scene.load[i]
    if order == 2:
        reduce_hessian(scene.map, work.half, work.hessian)
    return energy


@njit
def pairs_at(scene, y, skin, work):
    """Pairs closer than the diameter plus ``skin`` at y."""
    lattice = expand(scene.map, y, work.x)
    place_points(scene.touch, work.x, work.points)
    reach = scene.law[1] + skin
    if scene.bend.active:
        # Flat coordinates are longer than the true distance where 1 + kappa z is below 1.
        thick = 0.0
        for i in range(work.points.shape[0]):
            thick = max(thick, abs(work.points[i, 2]))
        reach /= max(1.0 - abs(curvature_at(scene.bend, lattice)) * thick, 0.2)
    return find_pairs(scene.touch, work.points, lattice, reach)


@njit
def residual_of(gradient, scale, free):
    largest = 0.0
    for i in free:
        r = abs(gradient[i]) * scale[i]
        if not r <= largest:  # a NaN stays
            largest = r
    return largest


@njit
def factorise(hessian, free, shift, factor):
    """Upper Cholesky factor of hessian[free, free] + shift I; False if not positive definite."""
    n = free.size
    for i in range(n):
        for j in range(i, n):
            factor[i, j] = hessian[free[i], free[j]]
        factor[i, i] += shift
    for k in range(n):
        pivot = factor[k, k]
        if not pivot > 0.0:
            return False
        pivot = math.sqrt(pivot)
        inverse = 1.0 / pivot
        factor[k, k] = pivot
        for j in range(k + 1, n):
            factor[k, j] *= inverse
        for i in range(k + 1, n):
            f = factor[k, i]
            if f != 0.0:
                for j in range(i, n):
                    factor[i, j] -= f * factor[k, j]
    return True


@njit
def solve_factored(factor, rhs):
    """Overwrite rhs (n,) with the solution of U^T U z = rhs."""
    n = rhs.size
    for i in range(n):
        rhs[i] /= factor[i, i]
        z = rhs[i]
        for j in range(i + 1, n):
            rhs[j] -= factor[i, j] * z
    for i in range(n - 1, -1, -1):
        z = rhs[i]
        for j in range(i + 1, n):
            z -= factor[i, j] * rhs[j]
        rhs[i] = z / factor[i, i]


@njit
def factorise_shifted(hessian, free, factor):
    """Factorise with the smallest shift of a rising sequence that makes it positive definite."""
    if factorise(hessian, free, 0.0, factor):
        return 0.0
    size = 0.0
    for i in free:
        size = max(size, abs(hessian[i, i]))
    shift = 1e-6 * size
    for _ in range(40):
        if factorise(hessian, free, shift, factor):
            return shift
        shift *= 4.0
    return math.inf


@njit
def largest_move(map_, change):
    """Largest change of a control point's component or of L, for a change of y."""
    largest = 0.0
    for r in range(map_.rows.size):
        value = 0.0
        for e in range(map_.rows[r].start, map_.rows[r].stop):
            value += map_.entries[e].value * change[map_.entries[e].column]
        largest = max(largest, abs(value))
    return largest


@njit
def approach(map_, change):
    """Half of what two contact points, or one and an image of the other, can come closer at most.

    A contact point moves no further than its control points, an image by as many spacings more.
    """
    largest, rows = 0.0, map_.rows.size
    moved = np.zeros(3)
    spacings = 0.0
    for r in range(rows):
        value = 0.0
        for e in range(map_.rows[r].start, map_.rows[r].stop):
            value += map_.entries[e].value * change[map_.entries[e].column]
        if r >= rows - 4:
            spacings += abs(value)
            continue
        moved[r % 3] = value
        if r % 3 == 2:
            largest = max(largest, moved[0] ** 2 + moved[1] ** 2 + moved[2] ** 2)
    return math.sqrt(largest) + spacings


# Loops instead of array expressions, which Numba takes long to compile.
@njit
def copy_to(source, target):
    for i in range(source.size):
        target[i] = source[i]


@njit
def move(y, length, step, point):
    """point = y + length step."""
    for i in range(y.size):
        point[i] = y[i] + length * step[i]


@njit
def minimise(scene, y, free, slip, control, work):
    """Move y (in place) along its free unknowns to a minimum of the energy.

    Returns status, iterations, residual (N).  Afterwards work.factor and work.hessian are those of
    one of the last points, work.gradient and work.terms the values at y.
    """
    # The order of the energy is given as np.int64: Numba would compile everything once more for each
    # literal number.  ``searching``: point = y + length step is on trial; otherwise it is a start.
    point, kept = y.copy(), y.copy()
    step = np.zeros(y.size)
    rhs = np.empty(free.size)
    energy = kept_energy = math.inf
    residual = slope = size = length = moved = reached = 0.0
    searching, relist = False, True
    iteration = halvings = on_trust = reuses = 0
    trust = control.trust
    pairs = (np.empty((0, 3), dtype=np.int64), np.empty(0))
    while True:
        if relist:
            pairs = pairs_at(scene, point, control.skin, work)
            relist = False
        # At a start the Hessian is needed anyway.
        order = np.int64(1 if searching else 2)
        new = energy_of(scene, point, pairs, slip, order, work)
        after = residual_of(work.gradient, scene.scale, free)
        finite = math.isfinite(new) and math.isfinite(after)
        restore = False
        if searching:
            accepted = finite and (
                new <= energy + ARMIJO * length * slope
                or (abs(new - energy) <= ROUND_OFF * abs(energy) and after < residual)
            )
            if finite and not accepted and on_trust < trust:
                on_trust += 1
                accepted = True
            if accepted:
                moved = reached
                restore = on_trust > 0 and on_trust >= trust and new >= kept_energy
            elif halvings < HALVINGS:
                halvings += 1
                length *= 0.5
                move(y, length, step, point)
                reached = moved + length * size
                continue
            elif on_trust == 0:
                return NO_DESCENT, iteration, residual
            else:
                restore = True
        elif not finite:
            return NOT_FINITE, iteration, after
        if restore and after > control.tolerance:
            # Trust has led nowhere: back, and no trust until the energy has fallen below.
            copy_to(kept, point)
            moved, on_trust, trust = 0.0, 0, 0
            searching, relist = False, True
            continue
        copy_to(point, y)
        # What the factor is expected to leave of the residual if it is used once more.
        rate = math.inf
        if searching and length == 1.0 and on_trust == 0:
            rate = after / residual * (FADING if reuses == 0 else 1.0)
        energy, residual = new, after
        if energy < kept_energy:
            copy_to(y, kept)
            kept_energy = energy
            on_trust = 0
            trust = control.trust if searching else trust
        enough = residual * rate ** (REUSES - reuses) <= control.tolerance
        reuses = reuses + 1 if enough and reuses < REUSES else 0
        if reuses == 0 and (order == 2 or residual > control.tolerance):
            if order < 2:
                energy_of(scene, y, pairs, slip, np.int64(2), work)
            if not math.isfinite(factorise_shifted(work.hessian, free, work.factor)):
                return NOT_FINITE, iteration, residual
        if residual <= control.tolerance:
            return CONVERGED, iteration, residual
        if iteration == control.limit:
            return TOO_MANY, iteration, residual
        iteration += 1
        for i in range(free.size):
            rhs[i] = -work.gradient[free[i]]
        solve_factored(work.factor, rhs)
        slope = 0.0
        for i in range(free.size):
            step[free[i]] = rhs[i]
            slope += rhs[i] * work.gradient[free[i]]
        size = largest_move(scene.map, step)
        length = 1.0 if size <= control.cap else control.cap / size
        size = approach(scene.map, step)
        move(y, length, step, point)
        searching, halvings = True, 0
        # Pairs are listed around the point where ``moved`` was last zero.
        reached = moved + length * size
        if reached > 0.5 * control.skin:
            relist, moved, reached = True, length * size, 0.0


@njit
def tangent(y, change, free, work):
    """Add to y the prescribed ``change`` and the answer of the free unknowns that keeps the forces.

    Uses work.hessian and work.factor.
    """
    rhs = np.zeros(free.size)
    for j in range(y.size):
        if change[j] != 0.0:
            for i in range(free.size):
                rhs[i] -= work.hessian[free[i], j] * change[j]
    solve_factored(work.factor, rhs)
    for j in range(y.size):
        y[j] += change[j]
    for i in range(free.size):
        y[free[i]] += rhs[i]

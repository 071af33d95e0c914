"""Newton's method and the following of a path in a large cell, with its sparse Hessian.

The same steps as :mod:`newton_kernels` and :mod:`path_kernels`, to the same tolerances and with the same
checks of every state, in Python, where each step is large enough: cap and Armijo search, tangent
predictor, step halving, work balance.  Instead of shifting a Hessian that is not positive definite,
Newton's linear problem is solved by conjugate gradients that end where they meet negative curvature.
"""

import math

import numpy as np

from knitsim.equilibrium.kernels.follow import (
    BALANCED,
    CROSSINGS_LOST,
    LEAST_MOVE,
    LOOSE,
    REACHED,
    SMALLEST,
    SMALLEST_BALANCED,
    TOO_CLOSE,
    WHOLE_BALANCED,
    bend_predictor,
    resolved,
    set_free,
    work_of_increment,
)
from knitsim.equilibrium.kernels.friction import begin_slip, lag_at, loss_of, no_slip
from knitsim.equilibrium.kernels.newton import (
    ARMIJO,
    CONVERGED,
    HALVINGS,
    NO_DESCENT,
    NOT_FINITE,
    ROUND_OFF,
    TOO_MANY,
    energy_of,
    largest_move,
    residual_of,
)
from knitsim.equilibrium.large.linear import (
    Linear,
    new_sparse_work,
    place,
    sparse_intact,
    sparse_pairs,
)


def lattice_entries(free, work):
    """Which entries of the lattice are among the free unknowns."""
    return free[free >= work.cell.count] - work.cell.count


def sparse_minimise(scene, y, free, slip, control, work):
    """As :func:`knitsim.equilibrium.kernels.newton.minimise`, without steps on trust.

    free: all q and entries of the lattice.  Afterwards work.work holds gradient and terms at y.
    """
    inner, lattice = work.work, lattice_entries(free, work)
    pairs = sparse_pairs(scene, y, control.skin, work)
    energy = energy_of(scene, y, pairs, slip, np.int64(1), inner)
    residual = residual_of(inner.gradient, scene.scale, free)
    if not (math.isfinite(energy) and math.isfinite(residual)):
        return NOT_FINITE, 0, residual
    moved, iteration = 0.0, 0
    while residual > control.tolerance:
        if iteration == control.limit:
            return TOO_MANY, iteration, residual
        iteration += 1
        linear = work.linear = Linear(scene, y, pairs, slip, lattice, work)
        if not linear.ready():
            return NOT_FINITE, iteration, residual
        step = linear.answer(-inner.gradient)
        slope = step @ inner.gradient
        size = largest_move(scene.map, step)
        length = 1.0 if size <= control.cap else control.cap / size
        # Pairs are listed around the point where ``moved`` was last zero.
        if moved + length * size > 0.5 * control.skin:
            pairs = sparse_pairs(scene, y, control.skin, work)
            moved = 0.0
        for _ in range(HALVINGS + 1):
            point = y + length * step
            new = energy_of(scene, point, pairs, slip, np.int64(1), inner)
            after = residual_of(inner.gradient, scene.scale, free)
            lower = new <= energy + ARMIJO * length * slope
            drowned = abs(new - energy) <= ROUND_OFF * abs(energy) and after < residual
            if math.isfinite(new) and math.isfinite(after) and (lower or drowned):
                break
            length *= 0.5
        else:
            energy_of(scene, y, pairs, slip, np.int64(1), inner)
            return NO_DESCENT, iteration, residual
        moved += length * size
        y[:] = point
        energy, residual = new, after
    return CONVERGED, iteration, residual


def _solve_step(scene, y, march, control, start, work):
    """As :func:`knitsim.equilibrium.kernels.follow.solve_step`."""
    inner, slip, total, lost = work.work, no_slip(), 0, 0.0
    rubs = march.friction > 0.0
    for once in range(march.passes if rubs else 1):
        if rubs and once == 0:
            pairs = sparse_pairs(scene, start, control.skin, work)
            slip = _slip_from(scene, start, pairs, y - start, march, work)
        elif rubs:
            lattice = place(scene, y, work)
            lag_at(scene, inner.points, lattice, pairs[1], march.friction, slip)
        # All passes but the last only serve to find the normal forces.
        last = not rubs or once == march.passes - 1
        aim = control._replace(tolerance=control.tolerance * (1.0 if last else LOOSE))
        status, iterations, residual = sparse_minimise(scene, y, march.free, slip, aim, work)
        total += iterations
        if status != CONVERGED:
            return status, total, residual, 0.0
    if rubs:
        lattice = place(scene, y, work)
        lost = loss_of(scene, inner.points, lattice, slip)
    return status, total, residual, lost


def _slip_from(scene, start, pairs, change, march, work):
    """Friction of a step from ``start`` in which the driven unknowns move by ``change``."""
    moved = max(LEAST_MOVE * march.largest, np.abs(change[march.driven]).max())
    lattice = place(scene, start, work)
    return begin_slip(
        scene, work.work.points, lattice, pairs, march.friction, march.rounding * moved
    )


def _predicted(scene, y, before, change, march, control, work):
    """Tangent prediction from y for the prescribed ``change`` of the lattice; None without one.

    With the Hessian of the last Newton step, friction in it, or where there is none that at y with
    all contacts sticking: many loops are next to unstable without friction.
    """
    linear = work.linear
    if linear is None:
        lattice = lattice_entries(march.free, work)
        pairs = sparse_pairs(scene, y, control.skin, work)
        slip = no_slip()
        if march.friction > 0.0:
            slip = _slip_from(scene, y, pairs, change, march, work)
        linear = work.linear = Linear(scene, y, pairs, slip, lattice, work)
    if not linear.ready():
        return None
    trial = y + change + linear.answer(-linear.by_lattice(change[work.cell.count :]))
    bend_predictor(trial, y, before, march)
    return trial


def sparse_follow(model, scene, y, force, targets, march, trail):
    """As :func:`knitsim.equilibrium.kernels.follow.follow`, for a model with a sparse Hessian."""
    work, control = new_sparse_work(model.cell, scene), model.control
    inner, driven = work.work, march.driven
    before, done, lost = y.copy(), 0.0, 0.0
    pairs = sparse_pairs(scene, y, control.skin, work)
    energy_of(scene, y, pairs, no_slip(), np.int64(1), inner)
    stored = inner.terms.sum()
    for state, target in enumerate(targets):
        left, iterations = 1.0, 0
        far = np.abs(target - y[driven]).max()
        part = min(1.0, march.largest / far) if far > 0.0 else 1.0
        part = 1.0 / math.ceil(1.0 / part - 1e-9)
        smallest, smallest_balanced = part * SMALLEST, part * SMALLEST_BALANCED
        while left > 1e-9:
            part = min(part, left)
            change = np.zeros_like(y)
            change[driven] = (target - y[driven]) * (part / left)
            trial = _predicted(scene, y, before, change, march, control, work)
            if trial is None:
                return state, NOT_FINITE
            status, used, residual, loss = _solve_step(scene, trial, march, control, y, work)
            iterations += used
            if status == CONVERGED and not sparse_intact(
                scene, model.trace, trial, march.expected, work
            ):
                status = CROSSINGS_LOST
            if status == CONVERGED and not resolved(scene, inner):
                status = TOO_CLOSE
            if status != CONVERGED:
                part *= 0.5
                before, work.linear = y.copy(), None
                if part < smallest:
                    return state, status
                continue
            after, past = inner.gradient + scene.load, trail.past.copy()
            energy = inner.terms.sum()
            step_work = energy - stored
            moved = np.zeros_like(y)
            moved[driven] = (trial - y)[driven]
            # What is free moves under dead loads only, whose work is exact.
            held = scene.load[march.free] @ (trial - y)[march.free]
            if march.friction == 0.0:
                loss = set_free(force @ moved, after @ moved, step_work - held, stored)
                if part > smallest_balanced and loss > 0.0:
                    part *= 0.5
                    work.linear = None
                    continue
                step_work += loss
            else:
                gain = step_work + loss
                step_work = held + work_of_increment(force, after, moved, past)
                # Where the force bends sharply, as where yarns start to slip, it is followed closely.
                most = BALANCED * abs(step_work) + WHOLE_BALANCED * abs(done + step_work)
                if part > smallest_balanced and abs(step_work - gain) > most:
                    part *= 0.5
                    work.linear = None
                    continue
            done, stored, lost = done + step_work, energy, lost + loss
            trail.past[:], force[:] = past, after
            before = y.copy()
            y[:] = trial
            left = left - part if left - part > 1e-9 else 0.0
        trail.y[state], trail.force[state] = y, force
        row = trail.states[state]
        row.terms[:] = inner.terms
        row.closest, row.residual = math.sqrt(inner.closest[0]), residual
        row.work, row.lost = done, lost
        row.iterations, row.status = iterations, REACHED
    return len(targets), REACHED

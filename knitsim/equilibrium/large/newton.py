"""Newton's method and the following of a path in a large cell, with its sparse Hessian.

The same steps as :mod:`.kernels.newton` and :mod:`.kernels.follow`, to the same tolerances and with the
same checks of every state, in Python, where each step is large enough: cap and Armijo search, factors that
serve on, tangent predictor, step halving, work balance.  Instead of shifting a Hessian that is not positive
definite, Newton's linear problem is solved by conjugate gradients that end where they meet negative
curvature.
"""

import math

import numpy as np

from knitsim.equilibrium.kernels.accept import (
    ACCEPT,
    CROSSINGS_LOST,
    FOUND,
    NOT_SETTLED,
    REACHED,
    STOP,
    TOO_CLOSE,
    account,
    decide,
    parts_of,
    seek,
    step_to,
)
from knitsim.equilibrium.kernels.energy import energy_of
from knitsim.equilibrium.kernels.follow import (
    LOOSE,
    PASSES,
    SETTLED,
    begin_friction,
    bend_predictor,
    end_friction,
    is_rubbed,
    known,
    lag_friction,
    resolved,
    stands,
)
from knitsim.equilibrium.kernels.newton import (
    CLOSER,
    CONVERGED,
    CURVED,
    FALLING,
    HALVINGS,
    MEMORY,
    NO_DESCENT,
    NOT_FINITE,
    TOO_MANY,
    gets_on,
    largest_move,
    residual_of,
)
from knitsim.equilibrium.kernels.pairs import covers, passes, skin_over
from knitsim.equilibrium.kernels.records import LATTICE
from knitsim.equilibrium.large.linear import (
    Linear,
    new_sparse_work,
    sparse_intact,
    sparse_pairs,
)


def lattice_entries(free, work):
    """Which entries of the lattice are among the free unknowns."""
    return free[free >= work.cell.count] - work.cell.count


def sparse_minimise(scene, y, free, pairs, slip, control, ready, work):
    """As :func:`knitsim.equilibrium.kernels.newton.minimise`, without steps on trust.

    free: all q and entries of the lattice.  Afterwards work.work holds gradient and terms at y.
    """
    inner, lattice = work.work, lattice_entries(free, work)

    def at(point, listed):
        if not covers(scene, listed, point, inner):
            listed = sparse_pairs(scene, point, control.skin, work)
        value = energy_of(scene, point, listed, slip, np.int64(1), inner)
        return value, residual_of(inner.gradient, scene.scale, free), listed

    energy, residual, pairs = at(y, pairs)
    if not (math.isfinite(energy) and math.isfinite(residual)):
        return NOT_FINITE, 0, residual, pairs
    iteration, serves, taught = 0, ready, []
    rate = 0.0
    while residual > control.tolerance or rate * residual > CLOSER * control.tolerance:
        if iteration == control.limit:
            found = CONVERGED if residual <= control.tolerance else TOO_MANY
            return found, iteration, residual, pairs
        iteration += 1
        if not serves:
            work.linear, taught = Linear(scene, y, pairs, slip, lattice, work), []
            if not work.linear.factorise():
                return NOT_FINITE, iteration, residual, pairs
        before = inner.gradient.copy()
        step = _solve_taught(work.linear, taught, -before)
        slope = step @ before
        size = largest_move(scene.map, step)
        length = 1.0 if size <= control.cap else control.cap / size
        for _ in range(HALVINGS + 1):
            point = y + length * step
            new, after, pairs = at(point, pairs)
            finite = math.isfinite(new) and math.isfinite(after)
            if finite and gets_on(energy, new, length * slope, residual, after):
                if not (control.certify and passes(scene, y, point, inner)):
                    break
            length *= 0.5
        else:
            _, residual, pairs = at(y, pairs)
            found = CONVERGED if residual <= control.tolerance else NO_DESCENT
            return found, iteration, residual, pairs
        serves = length == 1.0 and after <= FALLING * residual and len(taught) < MEMORY
        serves = serves and work.factor.shift == 0.0
        change, rate = inner.gradient - before, after / residual if taught else 0.0
        if serves and step @ change > CURVED * np.linalg.norm(step) * np.linalg.norm(change):
            taught.append((step, change, 1.0 / (step @ change)))
        y[:] = point
        energy, residual = new, after
    return CONVERGED, iteration, residual, pairs


def _solve_taught(linear, taught, rhs):
    """As :func:`knitsim.equilibrium.kernels.newton.solve_taught`; where nothing is taught, by the Hessian."""
    if not taught:
        return linear.answer(rhs)
    shares = []
    for step, change, inverse in reversed(taught):
        shares.append(inverse * (step @ rhs))
        rhs = rhs - shares[-1] * change
    found = linear.answer(rhs, nearly=True)
    for (step, change, inverse), share in zip(taught, reversed(shares), strict=True):
        found = found + (share - inverse * (change @ found)) * step
    return found


def _solve_step(scene, y, slip, rub, march, pairs, work):
    """As :func:`knitsim.equilibrium.kernels.follow.solve_step`."""
    inner, total = work.work, 0
    settled = not is_rubbed(rub)
    lag_friction(scene, y, slip, rub, inner)
    for _ in range(PASSES + 1):
        # The first passes only serve to find the normal forces.
        aim = march.control
        if not settled:
            aim = aim._replace(tolerance=aim.tolerance * LOOSE)
        status, iterations, residual, pairs = sparse_minimise(
            scene, y, march.free, pairs, slip, aim, True, work
        )
        total += iterations
        if status != CONVERGED or (
            settled and (iterations == 0 or stands(scene, y, slip, rub, inner))
        ):
            return status, total, residual, pairs
        settled = lag_friction(scene, y, slip, rub, inner) <= SETTLED or settled
    return NOT_SETTLED, total, residual, pairs


def _forces(scene, march, work):
    """As :func:`knitsim.equilibrium.kernels.follow.forces_at`."""
    force = work.work.gradient + scene.load
    linear = work.linear
    if linear is not None and linear.ready():
        left = np.zeros_like(force)
        left[march.free] = work.work.gradient[march.free]
        answer = linear.answer(left)
        for d in march.driven:
            unit = np.zeros(LATTICE)
            unit[d - work.cell.count] = 1.0
            force[d] -= linear.by_lattice(unit)[march.free] @ answer[march.free]
    return force


def sparse_follow(model, scene, standing, targets, march, rub, trail):
    """As :func:`knitsim.equilibrium.kernels.follow.follow`, for a model with a sparse Hessian."""
    work, control = new_sparse_work(model.cell, scene), march.control
    inner, lattice = work.work, lattice_entries(march.free, work)
    y, force, past, memory = standing
    before, done, lost, rubbed = y.copy(), 0.0, 0.0, 0.0
    pairs = sparse_pairs(scene, y, control.skin, work)
    slip = begin_friction(scene, y, pairs, rub, memory, inner)
    held = end_friction(scene, y, slip, memory, inner)[2]
    energy_of(scene, y, pairs, slip, np.int64(1), inner)
    stored = begun = inner.terms.sum() + held
    driven = march.driven[0]
    search, skin = np.zeros(4), control.skin
    search[0] = 1.0 if force[driven] < march.until else -1.0
    for state, target in enumerate(targets):
        left, iterations, increments = 1.0, 0, 0
        part, smallest, balanced = parts_of(y, target, march)
        search[1], search[2] = 0.0, part
        while left > 1e-9:
            part = part if left - part > 1e-9 else left
            pairs = sparse_pairs(scene, y, skin, work)
            slip = begin_friction(scene, y, pairs, rub, memory, inner)
            if work.linear is None:
                work.linear = Linear(scene, y, pairs, slip, lattice, work)
            if not work.linear.ready():
                return state, NOT_FINITE, memory
            change = np.zeros_like(y)
            step_to(change, y, target, part / left, march)
            by_lattice = work.linear.by_lattice(change[work.cell.count :])
            trial = y + change + work.linear.answer(-by_lattice)
            bend_predictor(trial, y, before, march)
            around = pairs
            status, used, residual, pairs = _solve_step(scene, trial, slip, rub, march, pairs, work)
            iterations += used
            if status == CONVERGED and not known(scene, trial, slip, around, pairs, inner):
                wider = skin_over(scene, y, trial, control.skin)
                if wider > skin:
                    skin, work.linear = wider, None
                    continue
                status = NOT_SETTLED
            skin = control.skin
            if status == CONVERGED and (
                passes(scene, y, trial, inner)
                if control.certify
                else not sparse_intact(scene, march.trace, trial, march.expected, work)
            ):
                status = CROSSINGS_LOST
            if status == CONVERGED and not resolved(scene, inner):
                status = TOO_CLOSE
            verdict, onward = decide(part, smallest, status), 0.5 * part
            if status == CONVERGED:
                after, passed = _forces(scene, march, work), past.copy()
                remembered, rub_loss, held = end_friction(scene, trial, slip, memory, inner)
                energy = inner.terms.sum() + held
                loss, step_work, unbalanced = account(
                    scene.load, march, (force, after, trial - y, passed), energy - stored, rub_loss,
                    (stored, rubbed, begun + done - stored - lost),
                )  # fmt: skip
                verdict = decide(part, balanced, NOT_SETTLED if unbalanced else CONVERGED)
                # Where the fabric snaps, it does so in each part that is long enough.
                onward = balanced if unbalanced and rubbed + rub_loss == 0.0 else onward
                verdict = ACCEPT if verdict == STOP else verdict
            if verdict == ACCEPT:
                verdict, onward = seek(
                    search, force[driven], after[driven], part, march, is_rubbed(rub)
                )
            if verdict == STOP:
                return state, NOT_SETTLED if status == CONVERGED else status, memory
            if verdict != ACCEPT:
                part = onward
                work.linear = None
                before = y.copy() if status != CONVERGED else before
                continue
            done, lost, stored, memory = done + step_work, lost + loss, energy, remembered
            rubbed += rub_loss
            past[:], force[:] = passed, after
            before = y.copy()
            y[:] = trial
            increments += 1
            left, part = left - part if onward > 0.0 else 0.0, onward
        trail.y[state], trail.force[state] = y, force
        row = trail.states[state]
        row.terms[:3], row.terms[3] = inner.terms, stored - inner.terms.sum()
        row.closest, row.residual = math.sqrt(inner.closest[0]), residual
        row.work, row.lost = done, lost
        row.iterations, row.increments, row.status = iterations, increments, REACHED
        if onward == 0.0:
            return state + 1, FOUND, memory
    return len(targets), REACHED, memory

"""Equilibrium of one scene by Newton's method (compiled).

Newton's method uses the exact Hessian, shifted by a multiple of the identity where it is not positive
definite, a cap on the largest displacement and an Armijo line search.  Where a further decrease of
the energy drowns in round-off, a smaller residual counts as progress: any smaller one where the energy is the
same to its last digits, one that is far smaller where terms that cancel have blurred a few more.

A Hessian costs several gradients.  So its factor serves on as long as whole steps bring the residual down,
corrected by what the steps since have told of the curvature (limited-memory BFGS, Nocedal 1980): of a
Hessian that leaves something out, too, this makes superlinear steps.

A nearly inextensible yarn that turns stretches at first in any straight step, and the next step
takes the stretch out again; a line search that forbids the rise crawls.  So a few whole steps may be
taken on trust (Control.trust): if they do not end below the energy they started from, the best
known point is restored and searched from as usual.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.energy import energy_of
from knitsim.equilibrium.kernels.pairs import covers, pairs_at, passes
from knitsim.jit import leaf, njit

CONVERGED, TOO_MANY, NO_DESCENT, NOT_FINITE = 0, 1, 2, 3
ARMIJO = 1e-4
ROUND_OFF = 1e-13  # relative to the energy
BLURRED, FALLEN = 1e-10, 0.1  # relative to the energy, to the residual
HALVINGS = 30
MEMORY = 12  # steps with one factor: how many are remembered
FALLING = 0.5  # of the residual: a step that leaves more asks for a new factor
CLOSER = 0.03  # of the tolerance: what another step with an older factor would leave, as the last one tells
CURVED = 1e-10  # cosine of step and change of gradient from which on a step is remembered


class Control(NamedTuple):
    """Settings of Newton's method.

    tolerance: largest residual (N); cap: largest change of any unknown in one step (m); skin: how
    far beyond contact pairs are listed (m); limit: iterations allowed; trust: whole steps in a row
    that may be taken although the energy rises; certify: whether a step is refused on which yarns may
    pass through each other.
    """

    tolerance: float
    cap: float
    skin: float
    limit: int
    trust: int
    certify: bool


@leaf
def residual_of(gradient, scale, free):
    largest = 0.0
    for i in free:
        r = abs(gradient[i]) * scale[i]
        if not r <= largest:  # a NaN stays
            largest = r
    return largest


@leaf
def gets_on(energy, new, aimed, residual, after):
    """Whether a step gets on: from energy and residual to ``new`` and ``after``; aimed: slope by length."""
    change = abs(new - energy)
    return (
        new <= energy + ARMIJO * aimed
        or (change <= ROUND_OFF * abs(energy) and after < residual)
        or (change <= BLURRED * abs(energy) and after < FALLEN * residual)
    )


@leaf
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


@leaf
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


@leaf
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


@leaf
def largest_move(map_, change):
    """Largest change of a control point's component or of a spacing (m), for a change of y."""
    largest = 0.0
    for r in range(map_.rows.size - 1):
        value = 0.0
        for e in range(map_.rows[r].start, map_.rows[r].stop):
            value += map_.entries[e].value * change[map_.entries[e].column]
        largest = max(largest, abs(value))
    return largest


@leaf
def remember(taught, count, step, change):
    """Keep a step (n,) and the change of the gradient over it as number ``count``, if it curves upwards.

    taught: steps (MEMORY, n), changes (MEMORY, n), 1 over the products of both (MEMORY,), room for as
    many numbers.  Returns how many are kept.
    """
    steps, changes, inverse, _ = taught
    product = long = large = 0.0
    for i in range(step.size):
        product += step[i] * change[i]
        long += step[i] * step[i]
        large += change[i] * change[i]
    if not product > CURVED * math.sqrt(long * large):
        return count
    for i in range(step.size):
        steps[count, i], changes[count, i] = step[i], change[i]
    inverse[count] = 1.0 / product
    return count + 1


@leaf
def solve_taught(factor, taught, count, rhs):
    """As :func:`solve_factored`, with the inverse corrected by the steps remembered (two-loop recursion)."""
    steps, changes, inverse, share = taught
    for k in range(count - 1, -1, -1):
        share[k] = 0.0
        for i in range(rhs.size):
            share[k] += steps[k, i] * rhs[i]
        share[k] *= inverse[k]
        for i in range(rhs.size):
            rhs[i] -= share[k] * changes[k, i]
    solve_factored(factor, rhs)
    for k in range(count):
        product = 0.0
        for i in range(rhs.size):
            product += changes[k, i] * rhs[i]
        product = share[k] - inverse[k] * product
        for i in range(rhs.size):
            rhs[i] += product * steps[k, i]


# Loops instead of array expressions, which Numba takes long to compile.
@leaf
def copy_to(source, target):
    for i in range(source.size):
        target[i] = source[i]


@leaf
def move(y, length, step, point):
    """point = y + length step."""
    for i in range(y.size):
        point[i] = y[i] + length * step[i]


@njit
def minimise(scene, y, free, listed, slip, control, ready, work):
    """Move y (in place) along its free unknowns to a minimum of the energy.

    listed: pairs to begin with, renewed where they do not cover a point; ready: whether work.factor is that
    of a point so near that it may serve.  Returns status, iterations, residual (N) and the pairs as they are
    at the end.  Afterwards work.factor and work.hessian are those of one of the last points, work.gradient
    and work.terms the values at y.
    """
    # The order of the energy is given as np.int64: Numba would compile everything once more for each
    # literal number.  ``searching``: point = y + length step is on trial; otherwise it is a start.
    point, kept = y.copy(), y.copy()
    step, before = np.zeros(y.size), np.zeros(free.size)
    rhs, change = np.empty(free.size), np.empty(free.size)
    steps, changes = np.empty((MEMORY, free.size)), np.empty((MEMORY, free.size))
    taught = steps, changes, np.empty(MEMORY), np.empty(MEMORY)
    energy = kept_energy = math.inf
    residual = slope = length = 0.0
    searching = False
    iteration = halvings = on_trust = count = 0
    shift, trust = 0.0, control.trust
    while True:
        if not covers(scene, listed, point, work):
            listed = pairs_at(scene, point, control.skin, work)
        # At a start the Hessian is needed anyway.
        order = np.int64(1 if searching or ready else 2)
        new = energy_of(scene, point, listed, slip, order, work)
        after = residual_of(work.gradient, scene.scale, free)
        finite = math.isfinite(new) and math.isfinite(after)
        restore = False
        if searching:
            accepted = finite and gets_on(energy, new, length * slope, residual, after)
            if finite and not accepted and on_trust < trust:
                on_trust += 1
                accepted = True
            if accepted and control.certify and passes(scene, y, point, work):
                accepted = False
            if accepted:
                restore = on_trust > 0 and on_trust >= trust and new >= kept_energy
            elif halvings < HALVINGS:
                halvings += 1
                length *= 0.5
                move(y, length, step, point)
                continue
            elif on_trust == 0:
                found = CONVERGED if residual <= control.tolerance else NO_DESCENT
                if found == CONVERGED:  # round-off: no step gets any closer
                    energy_of(scene, y, listed, slip, np.int64(1), work)
                return found, iteration, residual, listed
            else:
                restore = True
        elif not finite:
            return NOT_FINITE, iteration, after, listed
        if restore and after > control.tolerance:
            # Trust has led nowhere: back, and no trust until the energy has fallen below.
            copy_to(kept, point)
            on_trust, trust = 0, 0
            searching = False
            continue
        copy_to(point, y)
        serves = searching and length == 1.0 and on_trust == 0 and shift == 0.0
        serves = (serves and after <= FALLING * residual and count < MEMORY) or ready
        rate = after / residual if count > 0 else 0.0
        done = after <= control.tolerance and rate * after <= CLOSER * control.tolerance
        energy, residual = new, after
        if energy < kept_energy:
            copy_to(y, kept)
            kept_energy = energy
            on_trust = 0
            trust = control.trust if searching else trust
        if ready:
            ready = False
        elif serves:
            for i in range(free.size):
                rhs[i], change[i] = step[free[i]], work.gradient[free[i]] - before[i]
            count = remember(taught, count, rhs, change)
        elif order == 2 or not done:
            if order < 2:
                energy_of(scene, y, listed, slip, np.int64(2), work)
            shift, count = factorise_shifted(work.hessian, free, work.factor), 0
            if not math.isfinite(shift):
                return NOT_FINITE, iteration, residual, listed
        if done:
            return CONVERGED, iteration, residual, listed
        if iteration == control.limit:
            found = CONVERGED if residual <= control.tolerance else TOO_MANY
            return found, iteration, residual, listed
        iteration += 1
        for i in range(free.size):
            before[i] = work.gradient[free[i]]
            rhs[i] = -before[i]
        solve_taught(work.factor, taught, count, rhs)
        slope = 0.0
        for i in range(free.size):
            step[free[i]] = rhs[i]
            slope += rhs[i] * work.gradient[free[i]]
        size = largest_move(scene.map, step)
        length = 1.0 if size <= control.cap else control.cap / size
        move(y, length, step, point)
        searching, halvings = True, 0

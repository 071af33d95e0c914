"""Following a path of prescribed unknowns from one equilibrium to the next (compiled).

Tangent predictor, Newton, then the acceptance of the state: residual below the tolerance, crossings
intact, nothing but finite numbers.  Otherwise the step is halved; where it becomes too small the
path ends with the reason.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.contact import place_points
from knitsim.equilibrium.kernels.crossings import crossings_of, same_crossings
from knitsim.equilibrium.kernels.friction import begin_slip, lag_at, loss_of, no_slip
from knitsim.equilibrium.kernels.newton import (
    CONVERGED,
    Control,
    copy_to,
    energy_of,
    expand,
    factorise_shifted,
    minimise,
    new_work,
    pairs_at,
    tangent,
)
from knitsim.equilibrium.kernels.records import records
from knitsim.jit import njit

REACHED, NOT_REACHED = 0, 10
CROSSINGS_LOST = 11
TOO_CLOSE = 13
SMALLEST = 1.0 / 64.0  # of an asked step
BALANCED = 0.03  # of an increment's work: what may be neither stored nor lost
WHOLE_BALANCED = 3e-3  # of all work so far: the same
SMALLEST_BALANCED = 1.0 / 8.0  # of an asked step: increments are not made smaller for the balance
SNAP, LEAST_SNAP = 0.05, 1e-7  # of the larger work of both forces, of the energy: see set_free
LOOSE = 1e2  # tolerance of the passes that only find normal forces, over that of the last
LEAST_MOVE = 1e-3  # of the largest increment: a step that moves less is rounded as if it moved this


class March(NamedTuple):
    """How a path is followed.

    free: unknowns that equilibrium decides; driven: those that are prescribed; largest: largest
    change of a driven unknown in one increment (m); friction: coefficient; rounding: slip at which
    friction is fully mobilised, over the change of the driven unknowns in that step (1), as slips in a
    step must be mobilised or friction creeps; passes: how often the normal forces are lagged; expected: the
    crossing codes that every state must show.
    """

    free: np.ndarray
    driven: np.ndarray
    largest: float
    friction: float
    rounding: float
    passes: int
    expected: np.ndarray


def state_type(*more):
    """Record of a state of a path, with these numbers besides.

    terms: stretch, bending, contact (J); closest: smallest distance (m); residual (N); work, lost:
    cumulative from the start (J).
    """
    numbers = (*more, "closest", "residual", "work", "lost")
    return np.dtype(
        [
            ("terms", "f8", 3),
            *((name, "f8") for name in numbers),
            ("iterations", "i8"),
            ("status", "i8"),
        ],
        align=True,
    )


def new_states(kind, count):
    """Records (kind: a state_type) of states none of which is reached yet."""
    missing = {"iterations": 0, "status": NOT_REACHED}
    return records(kind, count, **{n: missing.get(n, np.nan) for n in kind.names})


STATE = state_type()


class Trail(NamedTuple):
    """What is kept of each asked state; one row each.

    y; force: derivatives of energy and friction potential by y (N), which the driven unknowns and the
    dead loads hold; states (STATE).  past: of the last increment, see :func:`work_of_increment`.
    """

    y: np.ndarray
    force: np.ndarray
    states: np.ndarray
    past: np.ndarray


def new_trail(states, past):
    """A trail of states none of which is reached yet; past: that of the trail before, or zeros."""
    unknowns = past.size - 1
    y, force = np.full((2, states, unknowns), np.nan)
    return Trail(y, force, new_states(STATE, states), past.copy())


@njit
def intact(scene, trace, y, expected, work):
    """Whether the crossings at y are the expected ones."""
    lattice = expand(scene.map, y, work.x)
    points = np.empty((trace.points.size, 3))
    place_points(trace, work.x, points)
    return same_crossings(crossings_of(trace, points, lattice, 4 * expected.size), expected)


@njit
def resolved(scene, work):
    """Whether yarns, in the state whose energy was taken last, are further apart than contact points.

    Contact points further apart than the yarns no longer see a crossing.
    """
    points = scene.touch.points
    return points.size == 0 or work.closest[0] >= points[0].length ** 2


@njit
def loosened(control):
    """For a pass that only serves to find the normal forces."""
    return Control(
        control.tolerance * LOOSE, control.cap, control.skin, control.limit, control.trust
    )


# Inlined into its one caller: on its own it would compile all the solver once more.
@njit(inline="always")
def solve_step(scene, y, march, control, start, work):
    """Equilibrium at the driven values of y, with friction against the state ``start``.

    Returns status, iterations, residual, energy lost.
    """
    slip, pairs = no_slip(), (np.empty((0, 3), dtype=np.int64), np.empty(0))
    rubs = march.friction > 0.0
    moved = LEAST_MOVE * march.largest
    for i in march.driven:
        moved = max(moved, abs(y[i] - start[i]))
    status, total, residual = CONVERGED, 0, 0.0
    for once in range(march.passes if rubs else 1):
        if rubs:
            if once == 0:
                pairs = pairs_at(scene, start, control.skin, work)
            lattice = expand(scene.map, start if once == 0 else y, work.x)
            place_points(scene.touch, work.x, work.points)
            if once == 0:
                slip = begin_slip(
                    scene, work.points, lattice, pairs, march.friction, march.rounding * moved
                )
            else:
                lag_at(scene, work.points, lattice, pairs[1], march.friction, slip)
        last = not rubs or once == march.passes - 1
        aim = control if last else loosened(control)
        status, iterations, residual = minimise(scene, y, march.free, slip, aim, work)
        total += iterations
        if status != CONVERGED:
            return status, total, residual, 0.0
    lost = 0.0
    if rubs:
        lattice = expand(scene.map, y, work.x)
        place_points(scene.touch, work.x, work.points)
        lost = loss_of(scene, work.points, lattice, slip)
    return status, total, residual, lost


@njit
def bend_predictor(trial, y, before, march):
    """Add the curvature of the path to the tangent prediction ``trial`` from y.

    With the state ``before`` the last step h ago and the tangent v, y(k) = y + k v + (k/h)^2
    (before - y + h v).  Left out where the driven unknowns turn back, or where it is not small.
    """
    last = along = 0.0
    for i in march.driven:
        last += (y[i] - before[i]) ** 2
        along += (y[i] - before[i]) * (trial[i] - y[i])
    if last == 0.0 or along <= 0.0:
        return
    ratio = along / last
    straight = bent = 0.0
    for i in march.free:
        v = trial[i] - y[i]
        straight += v * v
        bent += (ratio * ratio * (before[i] - y[i] + v / ratio)) ** 2
    if bent > 0.25 * straight:
        return
    for i in march.free:
        trial[i] += ratio * ratio * (before[i] - y[i] + (trial[i] - y[i]) / ratio)


@njit
def work_of_increment(force, after, moved, past):
    """Work of the prescribed forces over one increment (J); ``past`` moves on by it.

    force, after: forces on both sides (y size); moved: change of y, zero where it is not
    prescribed.  past (y size + 1): the last increment's change of y and its slope of the force along
    the way (N/m); zeros before the first.  In one direction the force is the parabola through its
    last three values, otherwise the chord.  The parabola's share is at most that of one that is level
    at one end, as friction that has just turned makes the force bend sharply.
    """
    n = moved.size
    size = last = along = low = high = 0.0
    for i in range(n):
        size += moved[i] * moved[i]
        last += past[i] * past[i]
        along += moved[i] * past[i]
        low += force[i] * moved[i]
        high += after[i] * moved[i]
    if size == 0.0:
        return 0.0
    size, last = math.sqrt(size), math.sqrt(last)
    work = 0.5 * (low + high)
    slope = (high - low) / (size * size)
    if along > 0.999999 * size * last and last > 0.0:
        share = size**3 / (6.0 * (last + size)) * (slope - past[n])
        most = abs(high - low) / 6.0
        work -= min(max(share, -most), most)
    for i in range(n):
        past[i] = moved[i]
    past[n] = slope
    return work


@njit
def set_free(low, high, gain, stored):
    """Energy (J) that is set free in an increment without friction, where the fabric snaps, else 0.

    low, high: work of the driving forces if they were throughout those before and those after;
    gain: energy stored less the work of dead loads; stored: energy so far.  On a smooth path the gain
    lies between the two; of forces that grow it is their geometric mean if they grow exponentially,
    and hardly less in short steps.  Where it is less by more than a margin, the fabric has jumped to
    another shape on the way.
    """
    least = min(low, high)
    if least > 0.0:
        least = math.sqrt(low * high)
    least -= SNAP * max(abs(low), abs(high)) + LEAST_SNAP * stored
    return 0.5 * (low + high) - gain if gain < least else 0.0


@njit
def follow(scene, trace, y, force, targets, march, control, trail):
    """Visit the rows of ``targets`` (states, driven) one after another; y ends at the last state.

    y must be an equilibrium, held by ``force`` (as in Trail); both end at the last state, as does
    trail.past.  Fills trail; a state that is not reached and all after it keep NaN.  Returns the number
    of states reached and the reason of the end (a status).
    """
    work = new_work(scene)
    n = y.size
    before = y.copy()
    trial = np.empty(n)
    change = np.zeros(n)
    after, moved, past = np.empty(n), np.zeros(n), np.empty(n + 1)
    stale = True
    done, lost = 0.0, 0.0
    listed = pairs_at(scene, y, control.skin, work)
    energy_of(scene, y, listed, no_slip(), np.int64(2), work)
    stored = work.terms[0] + work.terms[1] + work.terms[2]
    factorise_shifted(work.hessian, march.free, work.factor)
    for state in range(targets.shape[0]):
        left, iterations = 1.0, 0
        far = 0.0
        for j in range(march.driven.size):
            far = max(far, abs(targets[state, j] - y[march.driven[j]]))
        part = min(1.0, march.largest / far) if far > 0.0 else 1.0
        part = 1.0 / math.ceil(1.0 / part - 1e-9)
        smallest, smallest_balanced = part * SMALLEST, part * SMALLEST_BALANCED
        while left > 1e-9:
            part = min(part, left)
            for j in range(march.driven.size):
                i = march.driven[j]
                change[i] = (targets[state, j] - y[i]) * (part / left)
            if stale:
                listed = pairs_at(scene, y, control.skin, work)
                energy_of(scene, y, listed, no_slip(), np.int64(2), work)
                factorise_shifted(work.hessian, march.free, work.factor)
                stale = False
            copy_to(y, trial)
            tangent(trial, change, march.free, work)
            bend_predictor(trial, y, before, march)
            status, used, residual, loss = solve_step(scene, trial, march, control, y, work)
            iterations += used
            if status == CONVERGED and not intact(scene, trace, trial, march.expected, work):
                status = CROSSINGS_LOST
            if status == CONVERGED and not resolved(scene, work):
                status = TOO_CLOSE
            if status != CONVERGED:
                part *= 0.5
                copy_to(y, before)
                if part < smallest:
                    return state, status
                stale = True
                continue
            energy = work.terms[0] + work.terms[1] + work.terms[2]
            step_work = energy - stored
            copy_to(trail.past, past)
            for i in range(n):
                after[i] = work.gradient[i] + scene.load[i]
            # What is free moves under dead loads only, whose work is exact.
            held = low = high = 0.0
            for i in range(n):
                moved[i] = 0.0
            for i in march.free:
                held += scene.load[i] * (trial[i] - y[i])
            for i in march.driven:
                moved[i] = trial[i] - y[i]
                low += force[i] * moved[i]
                high += after[i] * moved[i]
            if march.friction == 0.0:
                loss = set_free(low, high, step_work - held, stored)
                if part > smallest_balanced and loss > 0.0:
                    part *= 0.5
                    stale = True
                    continue
                step_work += loss
            else:
                gain = step_work + loss
                step_work = held + work_of_increment(force, after, moved, past)
                # Where the force bends sharply, as where yarns start to slip, it is followed closely.
                most = BALANCED * abs(step_work) + WHOLE_BALANCED * abs(done + step_work)
                if part > smallest_balanced and abs(step_work - gain) > most:
                    part *= 0.5
                    stale = True
                    continue
            done += step_work
            stored = energy
            copy_to(past, trail.past)
            copy_to(after, force)
            lost += loss
            copy_to(y, before)
            copy_to(trial, y)
            left -= part
            left = left if left > 1e-9 else 0.0
        for i in range(n):
            trail.y[state, i], trail.force[state, i] = y[i], force[i]
        row = trail.states[state]
        for i in range(3):
            row.terms[i] = work.terms[i]
        row.closest, row.residual = math.sqrt(work.closest[0]), residual
        row.work, row.lost = done, lost
        row.iterations, row.status = iterations, REACHED
    return targets.shape[0], REACHED

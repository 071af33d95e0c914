"""Following a path of prescribed unknowns from one equilibrium to the next (compiled).

Tangent predictor, Newton, then the acceptance of the state: residual below the tolerance, normal forces
of friction settled, crossings intact, work balanced.  Otherwise the step is halved; where it becomes
too small the path ends with the reason.

What is prescribed is an unknown (a spacing), or an unknown over another: the angle of a loop over its
spacing, which is the curvature of a bent fabric.  Then the unknown itself is held in each step, so that
energy and friction potential have no derivative by any free unknown in equilibrium, the spacing along
the bent direction included; the angle that belongs to an asked curvature is found at the end.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.accept import (
    ACCEPT,
    CROSSINGS_LOST,
    FOUND,
    NOT_REACHED,
    NOT_SETTLED,
    RAN_AWAY,
    REACHED,
    STOP,
    TOO_CLOSE,
    account,
    aim_at,
    decide,
    miss_of,
    parts_of,
    seek,
    step_to,
)
from knitsim.equilibrium.kernels.crossings import intact
from knitsim.equilibrium.kernels.energy import begin_work, energy_of
from knitsim.equilibrium.kernels.friction import Slip
from knitsim.equilibrium.kernels.newton import (
    CONVERGED,
    Control,
    copy_to,
    factorise_shifted,
    minimise,
    solve_factored,
)
from knitsim.equilibrium.kernels.pairs import covers, pairs_at, passes, skin_over
from knitsim.equilibrium.kernels.records import LATTICE, Touch, records
from knitsim.equilibrium.kernels.slip import all_rub, begin_slip, end_slip, lag_slip
from knitsim.jit import choose, njit

LOOSE = 1e2  # tolerance of the passes that only find normal forces, over that of the last
SETTLED = 2e-3  # of the friction force: what another pass may change of it
ROOM = 0.25  # of D^2 - core^2: the square of the largest spacing of contact points, see widest
PASSES, CORRECTIONS = 20, 6  # at most: of the normal forces, of an unknown held over another


class March(NamedTuple):
    """How a path is followed.

    free: unknowns that equilibrium decides; driven: those that are prescribed; over: for each of these
    the unknown it is divided by in what is asked for, or -1; largest: largest change of what is asked
    for in one increment; exact: how far a state may be from what was asked for where there is a
    divisor; widest: factor by which spacings may change before they are said to run away; trace,
    expected: polylines of the yarns and the crossings that every state must show; control: of Newton;
    until: force (N) on the one driven unknown, none of them over another, at which the way ends, from
    either side, NaN for none; scale: the force (N) that its tolerance is a part of.
    """

    free: np.ndarray
    driven: np.ndarray
    over: np.ndarray
    largest: float
    exact: float
    widest: float
    trace: Touch
    expected: np.ndarray
    control: Control
    until: float = math.nan
    scale: float = 1.0


class Standing(NamedTuple):
    """Where a path stands.

    y: an equilibrium; force: derivatives of energy and friction potential by y (N), which the driven
    unknowns and the dead loads hold; past: of the last increment, see
    :func:`knitsim.equilibrium.kernels.accept.work_of_increment`; memory: what friction remembers
    (:class:`.friction.Memory`), or ().
    """

    y: np.ndarray
    force: np.ndarray
    past: np.ndarray
    memory: tuple


# State of a path.  terms: stretch, bend, contact, and what the springs of friction hold (J); closest:
# smallest distance (m); residual (N); work, lost: cumulative from the start (J); increments: accepted
# since the last asked state.
STATE = np.dtype(
    [
        ("terms", "f8", 4),
        *((name, "f8") for name in ("closest", "residual", "work", "lost")),
        *((name, "i8") for name in ("iterations", "increments", "status")),
    ],
    align=True,
)


class Trail(NamedTuple):
    """What is kept of each asked state, one row each: y, force (as in Standing), states (STATE)."""

    y: np.ndarray
    force: np.ndarray
    states: np.ndarray


def new_trail(states, unknowns):
    """A trail of states none of which is reached yet."""
    y, force = np.full((2, states, unknowns), np.nan)
    missing = {"iterations": 0, "increments": 0, "status": NOT_REACHED}
    rows = records(STATE, states, **{n: missing.get(n, np.nan) for n in STATE.names})
    return Trail(y, force, rows)


@njit
def resolved(scene, work):
    """Whether contact points are close enough for the state whose energy was taken last."""
    points = scene.touch.points
    if points.size == 0 or not math.isfinite(work.closest[0]):
        return True
    return points[0].length ** 2 <= widest(work.closest[0], scene.law.core)


@njit
def widest(square, core):
    """Square (m2) of the largest spacing h of contact points whose closest are sqrt(square) = D apart.

    Yarns that cross between the points, at most h/2 along either, come to D^2 - h^2/2 of each other.  A law
    with a core has the room D^2 - core^2: the mean over the cells of the points (:mod:`.mean`) is off by the
    fourth power of h over that.  With a quarter of the room slopes of contact energies were off by 1.5 %,
    with half of it by 11 %; a law without a core only needs to see the crossings.
    """
    return ROOM * (square - core * core) if core > 0.0 else square


@njit
def loosened(control):
    """For a pass that only serves to find the normal forces."""
    return Control(
        control.tolerance * LOOSE,
        control.cap,
        control.skin,
        control.limit,
        control.trust,
        control.certify,
    )


@njit
def _smooth(scene, y, listed, rub, memory, work):
    return ()


@njit
def _nothing_lags(scene, y, slip, rub, work):
    return 0.0


@njit
def _nothing_lost(scene, y, slip, memory, work):
    return memory, 0.0, 0.0


@njit
def _ended(scene, y, slip, memory, work):
    return end_slip(scene, y, slip, work)


@njit
def _is_rubbed(rub):
    return rub.friction > 0.0


# Whether there are normal forces to be lagged.
is_rubbed = choose("rub", _is_rubbed, False)
begin_friction = choose("rub", begin_slip, _smooth)
lag_friction = choose("rub", lag_slip, _nothing_lags)


@njit
def _stands(scene, y, slip, rub, work):
    tried = Slip(slip.pairs.copy(), slip.wraps.copy(), slip.lags, slip.share.copy())
    return lag_slip(scene, y, tried, rub, work) <= SETTLED


# Whether another pass would leave the friction forces as they are; nothing is lagged by asking.
stands = choose("rub", _stands, True)


@njit
def _known(scene, y, slip, around, listed, work):
    return covers(scene, around, y, work) or all_rub(scene, y, slip, listed, work)


# Whether the friction of a step, begun with the pairs ``around``, knows all that press at its end y.
known = choose("slip", _known, True)
end_friction = choose("slip", _ended, _nothing_lost)


@njit
def answer(y, change, free, work):
    """Add to y the ``change`` of prescribed unknowns and the answer of the free ones to it.

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
def correct(y, target, march, change, work):
    """Move the one driven unknown, held over another, to where the quotient is the target."""
    at, under = march.driven[0], march.over[0]
    change[:] = 0.0
    change[at] = 1.0
    trial = y.copy()
    answer(trial, change, march.free, work)
    slope = trial[under] - y[under]
    step = (target * y[under] - y[at]) / (1.0 - target * slope)
    for i in range(y.size):
        y[i] += step * (trial[i] - y[i])


# Inlined into its one caller: on its own it would compile all the solver once more.
@njit(inline="always")
def solve_step(scene, y, slip, rub, target, ends, march, listed, work):
    """Equilibrium at the driven values of y, with the friction of a step that has begun.

    target: what is asked for; ends: whether the step ends there.  Returns status, iterations, residual,
    pairs.
    """
    change, total, residual, status = np.zeros(y.size), 0, 0.0, CONVERGED
    # Where nothing was pressed so far, a prediction does not tell the normal forces.
    settled, passes, corrections = not is_rubbed(rub), 0, 0
    lag_friction(scene, y, slip, rub, work)
    while True:
        aim = march.control if settled else loosened(march.control)
        status, iterations, residual, listed = minimise(
            scene, y, march.free, listed, slip, aim, passes > 0, work
        )
        total += iterations
        if status != CONVERGED:
            break
        missed = settled and ends and miss_of(y, target, march) > march.exact
        if missed:
            corrections += 1
            correct(y, target[0], march, change, work)
        elif settled and (iterations == 0 or stands(scene, y, slip, rub, work)):
            break
        else:
            passes += 1
        if passes > PASSES or corrections > CORRECTIONS:
            status = NOT_SETTLED
            break
        # In a loose pass, friction far below its residual seems settled: a whole one must bear it out.
        settled = lag_friction(scene, y, slip, rub, work) <= SETTLED or settled
    return status, total, residual, listed


@njit
def forces_at(scene, march, work, force):
    """Fill force (y size) with the derivatives by y in equilibrium, loads left out.

    Those of the driven unknowns are taken where Newton's next step would end: what is left of the
    residual counts for them in first order, unlike for the energy.
    """
    rhs = np.empty(march.free.size)
    for i in range(march.free.size):
        rhs[i] = work.gradient[march.free[i]]
    solve_factored(work.factor, rhs)
    for i in range(force.size):
        force[i] = work.gradient[i] + scene.load[i]
    for d in march.driven:
        for i in range(march.free.size):
            force[d] -= work.hessian[d, march.free[i]] * rhs[i]


@njit
def follow(scene, standing, targets, march, rub, trail):
    """Visit the rows of ``targets`` (states, driven) one after another.

    Arrays of ``standing`` are moved along and end at the last state.  rub: :class:`.friction.Rub` or
    ().  Fills trail; a state that is not reached and all after it keep NaN.  Where the force
    ``march.until`` is come upon, the state there is the last, and the status FOUND.  Returns the number
    of states reached, the reason of the end (a status) and the memory of friction at the end.
    """
    work, control = begin_work(scene), march.control
    y, force, past, memory = standing
    n = y.size
    first = y.copy()
    before, trial, change, passed = y.copy(), np.empty(n), np.zeros(n), past.copy()
    after, moved = np.empty(n), np.zeros(n)
    stale, done, lost, rubbed = True, 0.0, 0.0, 0.0
    driven, reached, ended = march.driven[0], 0, REACHED
    search, skin = np.zeros(4), control.skin
    search[0] = 1.0 if force[driven] < march.until else -1.0
    listed = pairs_at(scene, y, skin, work)
    slip = begin_friction(scene, y, listed, rub, memory, work)
    _, _, held = end_friction(scene, y, slip, memory, work)
    energy_of(scene, y, listed, slip, np.int64(0), work)
    stored = begun = work.terms[0] + work.terms[1] + work.terms[2] + held
    for state in range(targets.shape[0]):
        left, iterations, increments = 1.0, 0, 0
        part, smallest, balanced = parts_of(y, targets[state], march)
        search[1], search[2] = 0.0, part
        while left > 1e-9:
            part = part if left - part > 1e-9 else left
            if skin > control.skin or not covers(scene, listed, y, work):
                listed = pairs_at(scene, y, skin, work)
            slip = begin_friction(scene, y, listed, rub, memory, work)
            if stale:
                energy_of(scene, y, listed, slip, np.int64(2), work)
                factorise_shifted(work.hessian, march.free, work.factor)
                stale = False
            copy_to(y, trial)
            step_to(change, y, targets[state], part / left, march)
            answer(trial, change, march.free, work)
            aim_at(trial, y, targets[state], part / left, march)
            bend_predictor(trial, y, before, march)
            around = listed
            status, used, residual, listed = solve_step(
                scene, trial, slip, rub, targets[state], part >= left, march, listed, work
            )
            iterations += used
            if status == CONVERGED and not known(scene, trial, slip, around, listed, work):
                # Yarns have slid on to others: the step again, with all pairs on the way.
                wider = skin_over(scene, y, trial, control.skin)
                if wider > skin:
                    skin, stale = wider, True
                    continue
                status = NOT_SETTLED
            skin = control.skin
            for i in (n - LATTICE, n - LATTICE + 3):
                if (
                    not first[i] <= trial[i] * march.widest
                    or not trial[i] <= first[i] * march.widest
                ):
                    status = RAN_AWAY if status == CONVERGED else status
            if status == CONVERGED and (
                passes(scene, y, trial, work)
                if control.certify
                else not intact(scene, march.trace, trial, march.expected, work.x)
            ):
                status = CROSSINGS_LOST
            if status == CONVERGED and not resolved(scene, work):
                status = TOO_CLOSE
            verdict, loss, step_work, remembered = decide(part, smallest, status), 0.0, 0.0, memory
            rub_loss, onward = 0.0, 0.5 * part
            if status == CONVERGED:
                remembered, rub_loss, held = end_friction(scene, trial, slip, memory, work)
                forces_at(scene, march, work, after)
                energy = work.terms[0] + work.terms[1] + work.terms[2] + held
                for i in range(n):
                    moved[i] = trial[i] - y[i]
                copy_to(past, passed)
                loss, step_work, unbalanced = account(
                    scene.load, march, (force, after, moved, passed), energy - stored, rub_loss,
                    (stored, rubbed, begun + done - stored - lost),
                )  # fmt: skip
                verdict = decide(part, balanced, CONVERGED if not unbalanced else NOT_SETTLED)
                # Where the fabric snaps, it does so in each part that is long enough.
                onward = balanced if unbalanced and rubbed + rub_loss == 0.0 else onward
                verdict = ACCEPT if verdict == STOP else verdict
            if verdict == ACCEPT:
                verdict, onward = seek(
                    search, force[driven], after[driven], part, march, is_rubbed(rub)
                )
            if verdict != ACCEPT:
                if verdict == STOP:
                    return state, NOT_SETTLED if status == CONVERGED else status, memory
                part = onward
                if status != CONVERGED:
                    copy_to(y, before)
                stale = True
                continue
            done, lost, stored, memory = done + step_work, lost + loss, energy, remembered
            rubbed += rub_loss
            copy_to(passed, past)
            copy_to(after, force)
            copy_to(y, before)
            copy_to(trial, y)
            increments += 1
            left, part = left - part if onward > 0.0 else 0.0, onward
        row = trail.states[state]
        for i in range(n):
            trail.y[state, i], trail.force[state, i] = y[i], force[i]
        for i in range(3):
            row.terms[i] = work.terms[i]
        row.terms[3] = stored - work.terms[0] - work.terms[1] - work.terms[2]
        row.closest, row.residual = math.sqrt(work.closest[0]), residual
        row.work, row.lost = done, lost
        row.iterations, row.increments, row.status = iterations, increments, REACHED
        reached += 1
        if onward == 0.0:
            ended = FOUND
            break
    return reached, ended, memory

"""Following a bending test from curvature to curvature (compiled).

What is prescribed is the angle of one loop; its energy and the friction potential have no derivative
by any unknown in equilibrium, the spacing along the bent direction included where it is free.  The
angle that belongs to an asked curvature of the mean plane is found along the way.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.contact import place_points
from knitsim.equilibrium.kernels.curved_friction import (
    begin_curved_slip,
    curved_lag_at,
    curved_loss,
)
from knitsim.equilibrium.kernels.follow import (
    CROSSINGS_LOST,
    REACHED,
    SMALLEST_BALANCED,
    TOO_CLOSE,
    intact,
    loosened,
    resolved,
    set_free,
    state_type,
    work_of_increment,
)
from knitsim.equilibrium.kernels.friction import no_slip
from knitsim.equilibrium.kernels.newton import (
    CONVERGED,
    TOO_MANY,
    copy_to,
    energy_of,
    expand,
    factorise_shifted,
    minimise,
    new_work,
    pairs_at,
    reduce_gradient,
    solve_factored,
)
from knitsim.equilibrium.kernels.records import Bend, Scene
from knitsim.jit import njit

RAN_AWAY = 12
SMALLEST = 1.0 / 64.0  # of an asked step
LEAST_MOVE = 1e-3  # of the largest increment: a smaller one is rounded as if it were this
SETTLED = 0.02  # of the friction work of a step: what the next pass may change of it
# What may be neither stored nor lost in an increment, of what is lost in it and in all so far.
BALANCED, WHOLE_BALANCED = 0.05, 3e-3
CORRECTIONS = 6  # of the angle, at most
WIDEST = 2.0  # times the spacings at the start (or their inverse): beyond, they run away


class Bending(NamedTuple):
    """How a bending test is followed.

    free: unknowns that equilibrium decides; at: the unknown spacing along the bent direction;
    largest: largest change of curvature in one increment (1/m); exact: how far a curvature may be
    from the asked one (1/m); friction: coefficient between yarns; couple: of friction within the
    yarn (N m); rounding: slip at which friction is fully mobilised, over the change of curvature in
    that increment (m2); turn: change of the yarn's curvature likewise (1); passes: how often the normal
    forces are found anew at most; expected: the crossing codes that every state must show.
    """

    free: np.ndarray
    at: int
    largest: float
    exact: float
    friction: float
    couple: float
    rounding: float
    turn: float
    passes: int
    expected: np.ndarray


# A state of a bending test.  angle (rad); moment: derivative of energy and friction potential by the
# angle (N m per cell).
STATE = state_type("angle", "moment")


@njit
def at_angle(scene, angle):
    """The scene bent by this angle per loop."""
    return Scene(
        scene.map,
        scene.rod,
        scene.stretch,
        scene.touch,
        scene.cylinders,
        scene.couples,
        Bend(angle, scene.bend.direction, True),
        scene.law,
        scene.load,
        scene.scale,
    )


@njit
def flat_moment(scene, y):
    """Derivative of the energy by the angle (N m per cell) in the state y, at the scene's angle."""
    work = new_work(scene)
    energy_of(scene, y, pairs_at(scene, y, 0.0, work), no_slip(), np.int64(1), work)
    return work.by_kappa[0] / y[y.size - 4 + 3 * scene.bend.direction]


@njit
def angle_tangent(scene, y, free, work, change):
    """Fill change (y size) with the answer of the free unknowns to a unit of angle.

    Uses work.mixed, work.by_kappa and work.factor.
    """
    rows, direction = work.mixed.size, scene.bend.direction
    w = y[y.size - 4 + 3 * direction]
    for r in range(rows):
        work.expanded[r] = work.mixed[r] / w
    kappa = scene.bend.angle / w
    work.expanded[rows - 4 + 3 * direction] -= (
        work.by_kappa[1] * kappa / w + work.by_kappa[0] / w
    ) / w
    reduce_gradient(scene.map, work.expanded, change)
    rhs = np.empty(free.size)
    for i in range(free.size):
        rhs[i] = -change[free[i]]
    solve_factored(work.factor, rhs)
    change[:] = 0.0
    for i in range(free.size):
        change[free[i]] = rhs[i]


@njit
def angle_step(kappa, angle, y, change, at):
    """Change of the angle that brings the curvature to kappa, if y follows as y + change dangle."""
    return (kappa * y[at] - angle) / (1.0 - kappa * change[at])


@njit
def bend_step(scene, y, start, kappa, bending, control, work):
    """Equilibrium at the curvature kappa from the trial y, scene bent by a trial angle.

    start: the state that friction counts from, (angle, y).  Returns status, iterations, residual,
    the angle, energy lost.
    """
    angle, before = scene.bend.angle, start[0] / start[1][bending.at]
    rubs = bending.friction > 0.0 or bending.couple > 0.0
    passes = bending.passes if bending.friction > 0.0 else 1
    slip, pairs = no_slip(), (np.empty((0, 3), dtype=np.int64), np.empty(0))
    change = np.zeros(y.size)
    if rubs:
        moved = max(abs(kappa - before), LEAST_MOVE * bending.largest)
        origin = at_angle(scene, start[0])
        pairs = pairs_at(origin, start[1], control.skin, work)
        lattice = expand(scene.map, start[1], work.x)
        place_points(scene.touch, work.x, work.points)
        slip = begin_curved_slip(
            scene,
            before,
            work.x,
            work.points,
            lattice,
            pairs,
            (bending.friction, bending.rounding * moved, bending.couple, bending.turn * moved),
        )
    total = 0
    # Passes until the normal forces, and what they rub away, are those of the state itself.
    settled = bending.friction == 0.0
    for once in range(passes + CORRECTIONS):
        here = at_angle(scene, angle)
        aim = control if settled else loosened(control)
        status, used, residual = minimise(here, y, bending.free, slip, aim, work)
        total += used
        if status != CONVERGED:
            return status, total, residual, angle, 0.0
        if settled and abs(angle / y[bending.at] - kappa) <= bending.exact:
            break
        if once == passes + CORRECTIONS - 1:
            return TOO_MANY, total, residual, angle, 0.0
        if not settled:
            lattice = expand(scene.map, y, work.x)
            place_points(scene.touch, work.x, work.points)
            now = angle / y[bending.at]
            off = curved_lag_at(here, now, work.points, lattice, pairs[1], bending.friction, slip)
            settled = off <= SETTLED or once >= passes - 2
        angle_tangent(here, y, bending.free, work, change)
        step = angle_step(kappa, angle, y, change, bending.at)
        angle += step
        for i in bending.free:
            y[i] += change[i] * step
    lost = 0.0
    if rubs:
        lattice = expand(scene.map, y, work.x)
        place_points(scene.touch, work.x, work.points)
        lost = curved_loss(scene, angle / y[bending.at], work.x, work.points, lattice, slip)
    return CONVERGED, total, residual, angle, lost


@njit
def follow_bending(scene, trace, y, curvatures, bending, control, states, kept):
    """Visit the curvatures (1/m) one after another from the flat state y, which ends at the last.

    Fills states (STATE) and kept (states, y size).  Returns the number of states reached and the
    reason of the end (a status).
    """
    work = new_work(scene)
    n = y.size
    here = at_angle(scene, 0.0)
    trial, change, first = np.empty(n), np.zeros(n), y.copy()
    before, moment, lost = 0.0, np.zeros(1), 0.0
    after, moved, past, done = np.zeros(1), np.zeros(1), np.zeros(2), 0.0
    passed = np.zeros(2)
    rubs = bending.friction > 0.0 or bending.couple > 0.0
    stale = True
    energy_of(here, y, pairs_at(here, y, 0.0, work), no_slip(), np.int64(1), work)
    moment[0] = work.by_kappa[0] / y[bending.at]
    stored = work.terms[0] + work.terms[1] + work.terms[2]
    last_step, last_y = 0.0, y.copy()
    for state in range(curvatures.size):
        kappa, left, iterations = here.bend.angle / y[bending.at], 1.0, 0
        far = abs(curvatures[state] - kappa)
        part = 1.0 / max(1.0, math.ceil(far / bending.largest - 1e-9))
        smallest, smallest_balanced = part * SMALLEST, part * SMALLEST_BALANCED
        while left > 1e-9:
            part = min(part, left)
            before = here.bend.angle / y[bending.at]
            wanted = before + (curvatures[state] - before) * (part / left)
            if part >= left:
                wanted = curvatures[state]
            if stale:
                listed = pairs_at(here, y, control.skin, work)
                energy_of(here, y, listed, no_slip(), np.int64(2), work)
                factorise_shifted(work.hessian, bending.free, work.factor)
                stale = False
            angle_tangent(here, y, bending.free, work, change)
            step = angle_step(wanted, here.bend.angle, y, change, bending.at)
            for i in range(n):
                trial[i] = y[i] + change[i] * step
            # The path's own curvature, from the last increment in the same direction.
            if last_step * step > 0.0:
                ratio = step / last_step
                for i in bending.free:
                    trial[i] += ratio * ratio * (last_y[i] - y[i] + change[i] * last_step)
            status, used, residual, angle, loss = bend_step(
                at_angle(scene, here.bend.angle + step),
                trial,
                (here.bend.angle, y),
                wanted,
                bending,
                control,
                work,
            )
            iterations += used
            for i in (n - 4, n - 1):
                if status == CONVERGED and not (first[i] / WIDEST < trial[i] < first[i] * WIDEST):
                    status = RAN_AWAY
            if status == CONVERGED and not intact(scene, trace, trial, bending.expected, work):
                status = CROSSINGS_LOST
            if status == CONVERGED and not resolved(scene, work):
                status = TOO_CLOSE
            if status != CONVERGED:
                part *= 0.5
                last_step = 0.0
                stale = True
                if part < smallest:
                    return state, status
                continue
            # The moment where Newton's next step would end: what is left of the residual counts for
            # it in first order, unlike for the energy.
            after[0] = work.by_kappa[0] / trial[bending.at]
            angle_tangent(at_angle(scene, angle), trial, bending.free, work, change)
            for i in bending.free:
                after[0] += work.gradient[i] * change[i]
            moved[0] = angle - here.bend.angle
            energy = work.terms[0] + work.terms[1] + work.terms[2]
            step_work = energy - stored
            if not rubs:
                low, high = moment[0] * moved[0], after[0] * moved[0]
                loss = set_free(low, high, step_work, stored)
                if part > smallest_balanced and loss > 0.0:
                    part *= 0.5
                    stale = True
                    continue
                step_work += loss
            else:
                gain = step_work + loss
                copy_to(past, passed)
                step_work = work_of_increment(moment, after, moved, passed)
                # Where the moment bends sharply, as where yarns start to slip, it is followed closely.
                most = BALANCED * loss + WHOLE_BALANCED * (lost + loss)
                if part > smallest_balanced and abs(step_work - gain) > most:
                    part *= 0.5
                    stale = True
                    continue
                copy_to(passed, past)
            done += step_work
            stored = energy
            moment[0] = after[0]
            lost += loss
            last_step = moved[0]
            copy_to(y, last_y)
            copy_to(trial, y)
            here = at_angle(scene, angle)
            left -= part
            left = left if left > 1e-9 else 0.0
        copy_to(y, kept[state])
        row = states[state]
        for i in range(3):
            row.terms[i] = work.terms[i]
        row.angle, row.moment = here.bend.angle, moment[0]
        row.closest, row.residual = math.sqrt(work.closest[0]), residual
        row.work, row.lost = done, lost
        row.iterations, row.status = iterations, REACHED
    return curvatures.size, REACHED

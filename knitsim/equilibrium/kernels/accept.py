"""Whether a step along a path is accepted, halved or the last: one decision for all that follow one.

Plain functions of numbers and arrays, compiled, called by the compiled loop for one loop of the fabric
and by that in Python for large cells.
"""

import math

from knitsim.equilibrium.kernels.newton import CONVERGED
from knitsim.jit import leaf, njit

REACHED, NOT_REACHED, FOUND = 0, 10, 15
CROSSINGS_LOST, RAN_AWAY, TOO_CLOSE, NOT_SETTLED = 11, 12, 13, 14
ACCEPT, HALVE, STOP = 0, 1, 2
SMALLEST = 1.0 / 256.0  # of an asked step: where yarns lock, friction settles in short ones alone
SMALLEST_BALANCED = 1.0 / 8.0  # of an asked step: increments are not made smaller for the balance
# What may be neither stored nor lost in an increment: of what is lost in it, of all that was lost, of
# its work.
BALANCED, WHOLE_BALANCED, WORK_BALANCED = 0.05, 3e-3, 0.01
# Of all that was lost, what increments together may miss; above it only a part of that is let through.
ASTRAY, CLOSER = 0.01, 0.2
# Of the largest force, where a force is asked for.  With friction a state is known no better than the
# friction force is settled.
FORCE_TOLERANCE, RUBBED_TOLERANCE = 1e-6, 1e-4
TRIES = 40  # at most, to find it
SNAP, LEAST_SNAP = 0.05, 1e-7  # of the larger work of both forces, of the energy: see set_free


@njit
def decide(part, smallest, status):
    """ACCEPT where the status is CONVERGED; else HALVE, or STOP where half of ``part`` is too small."""
    if status == CONVERGED:
        return ACCEPT
    return STOP if 0.5 * part < smallest else HALVE


@njit
def value_of(y, march, j):
    """What is asked for of the driven unknown number j."""
    return y[march.driven[j]] / (1.0 if march.over[j] < 0 else y[march.over[j]])


@njit
def miss_of(y, target, march):
    """How far what is held over another unknown is from the target; 0 where nothing is."""
    if march.over[0] < 0:
        return 0.0
    return abs(value_of(y, march, 0) - target[0])


@njit
def parts_of(y, target, march):
    """Equal parts of the way to the target: the first, the smallest, the smallest for the balance."""
    far = 0.0
    for j in range(march.driven.size):
        far = max(far, abs(target[j] - value_of(y, march, j)))
    part = 1.0 / max(1.0, math.ceil(far / march.largest - 1e-9))
    return part, part * SMALLEST, part * SMALLEST_BALANCED


@njit
def step_to(change, y, target, share, march):
    """Fill change (y size) of the driven unknowns for a share of what is left of the way."""
    change[:] = 0.0
    for j in range(march.driven.size):
        here, under = value_of(y, march, j), march.over[j]
        step = (target[j] - here) * share
        change[march.driven[j]] = step * (1.0 if under < 0 else y[under])


@njit
def aim_at(trial, y, target, share, march):
    """Make the prediction ``trial`` longer or shorter for what is held over another unknown."""
    at, under = march.driven[0], march.over[0]
    if under < 0 or trial[at] == y[at]:
        return
    here = value_of(y, march, 0)
    aim = here + (target[0] - here) * share
    ratio = (aim * y[under] - y[at]) / (trial[at] - y[at] - aim * (trial[under] - y[under]))
    for i in range(y.size):
        trial[i] = y[i] + ratio * (trial[i] - y[i])


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
def account(load, march, forces, gain, loss, so_far):
    """Energy lost, work done in an increment (J), and whether the books do not balance.

    forces: force, after, moved, past as in :func:`work_of_increment`, moved of all unknowns; gain: of
    stored energy; loss: to friction; so_far: energy stored, energy lost before, and what was neither.
    """
    force, after, moved, past = forces
    stored, lost, astray = so_far
    # What is free moves under dead loads only, whose work is exact.
    held = low = high = 0.0
    for i in march.free:
        held += load[i] * moved[i]
        moved[i] = 0.0
    for i in march.driven:
        low += force[i] * moved[i]
        high += after[i] * moved[i]
    if loss == 0.0 and lost == 0.0:
        loss = set_free(low, high, gain - held, stored)
        return loss, gain + loss, loss > 0.0
    work = held + work_of_increment(force, after, moved, past)
    most = BALANCED * loss + WHOLE_BALANCED * (lost + loss) + WORK_BALANCED * abs(work - held)
    off = work - gain - loss
    if abs(astray + off) > ASTRAY * (lost + loss):
        most *= CLOSER
    # Where the force bends sharply, as where yarns start to slip, it is followed closely.
    return loss, work, abs(off) > most


@leaf
def seek(search, before, after, part, march, rubbed):
    """What an increment means where a force is looked for, by secants: verdict, next part.

    search (4,): the side that the force is come upon from, 1 from below; weight of the force here, which
    halves where it stays, 0 as long as no increment went beyond; the part that is usual on the way; tries.
    before, after: the driven forces (N).  The next part is 0 where the force is found.  HALVE where the
    increment went beyond it, to be repeated with the next part; STOP after too many tries; else ACCEPT.  With
    friction the force at a strain depends on the increments that led there.  So one that falls short is
    gone: what remains to the force is then one short increment.
    """
    over = search[0] * (after - march.until)
    enough = FORCE_TOLERANCE * march.scale
    if rubbed and search[3] >= 2.0:
        enough = (RUBBED_TOLERANCE if search[3] >= 4.0 else 0.1 * RUBBED_TOLERANCE) * march.scale
    if abs(over) <= enough:
        return ACCEPT, 0.0
    if not (over > 0.0 or search[1] > 0.0):
        return ACCEPT, part
    search[3] += 1.0
    if search[3] > TRIES:
        return STOP, part
    if over > 0.0:
        short = search[0] * (march.until - before)
        search[1] = 0.5 * search[1] if search[1] > 0.0 else 1.0
        return HALVE, part * search[1] * short / (search[1] * short + over)
    search[1], gained = 1.0, search[0] * (after - before)
    # Not kept to where an increment has been too long: from here on the force may lie further on.
    further = -over * part < search[2] * gained
    return ACCEPT, -over * part / gained if further else search[2]

"""Coulomb friction at the contacts, elastic up to its limit, with a memory of its own (compiled).

Two places that touch are joined across their normal by a spring.  Its elongation e is the elastic part
of their relative displacement u; its force k e grows up to Coulomb's limit mu N and no further: beyond,
the places slide (return mapping, Jenkins element).  Over a load step from y0 to y, with d the vector
between the centre lines,

    u = P (R e0 + d - d0),   force = min(k |u|, mu N) u/|u|,   e = force/k,

where P takes the part across the normal n, and R carries the e0 of the start from the normal there to
n by the least rotation.  Normal force and normal are lagged, those of the last pass, so that a step
has a potential and a symmetric Hessian; passes are repeated until what they change is small.

k is a constant of the pair as long as it touches: a spring whose stiffness followed the normal force
could give energy.  What is dissipated over a step is the limit times the way slid, the limit that at
which sliding sets in and that at the end: never negative.  A pair that opens has no limit, so that its
spring slides back to nothing and what was in it is dissipated.  A pair that slides along the yarn
leaves the contact at one end while new ones enter, unstrained, at the other: along a contact of length
a, all but a part e/a of the force is remembered.

Friction acts between centre lines: the spin of the yarn about its own axis is not followed.
"""

import math
from typing import NamedTuple

import numpy as np

from knitsim.equilibrium.kernels.contact import add_pushes, separation
from knitsim.equilibrium.kernels.pairs import CHUNK
from knitsim.jit import njit

WHOLE, LEAST_SHARE, MOST_SHARE = 5, 0.2, 3.0  # passes; shares: see share_of

# One place that rubs over a load step.  pair: i, k, g; start: d at the start (m); held: e0, facing: the
# normal there; normal: lagged unit normal, anchor: d0 - R e0; limit: lagged mu N (N), before: at the
# start; stiffness: k (N/m).  asked, shift: of the last pass, mu N found, and by how much it was more than
# the limit (N).
RUB = np.dtype(
    [
        ("pair", "i8", 3),
        *((name, "f8", 3) for name in ("start", "held", "facing", "normal", "anchor")),
        *((name, "f8") for name in ("limit", "before", "stiffness", "asked", "shift")),
    ],
    align=True,
)

# What a place remembers between load steps: e (m) and the normal that it belongs to.
MEMORY = np.dtype([("pair", "i8", 3), ("held", "f8", 3), ("facing", "f8", 3)], align=True)


class Rub(NamedTuple):
    """Friction of a fabric.

    friction: Coulomb's coefficient; shell: tangential stiffness of a contact per length of the one
    yarn and of the other (N/m3).  couple: :class:`.lag.Couple` of friction within the yarn, or ().
    """

    friction: float
    shell: float
    couple: tuple


class Memory(NamedTuple):
    """All that friction remembers.

    pairs (MEMORY): in the order of the pair search; wraps (cylinders, points) of MEMORY: on rigid
    cylinders; lags: what the yarn itself remembers (:mod:`.lag`).
    """

    pairs: np.ndarray
    wraps: np.ndarray
    lags: np.ndarray


class Slip(NamedTuple):
    """Friction of one load step.

    pairs (n,): a RUB for each listed pair; wraps (cylinders, points): one for every contact point on
    every rigid cylinder, its pair unused; lags: LAG of :mod:`.lag` for each Gauss point of the yarn, or
    none; share (2,): see :func:`share_of`, and the number of passes.
    """

    pairs: np.ndarray
    wraps: np.ndarray
    lags: np.ndarray
    share: np.ndarray


@njit
def across(d, start, n):
    """The part of d - start across the unit normal n, and its size (m)."""
    a, b, c = d[0] - start[0], d[1] - start[1], d[2] - start[2]
    along = a * n[0] + b * n[1] + c * n[2]
    u = (a - along * n[0], b - along * n[1], c - along * n[2])
    return u, math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])


@njit
def spring_at(size, stiffness, limit):
    """Potential (J), force over elongation (N/m), its slope less that (N/m), at an elongation (m)."""
    if stiffness * size <= limit:
        return 0.5 * stiffness * size * size, stiffness, 0.0
    return limit * (size - 0.5 * limit / stiffness), limit / size, -limit / size


@njit
def slip_matrix(f, bend, n, u):
    """f (I - n n^T) + bend u u^T as a tuple of rows."""
    return (
        (
            f * (1.0 - n[0] * n[0]) + bend * u[0] * u[0],
            -f * n[0] * n[1] + bend * u[0] * u[1],
            -f * n[0] * n[2] + bend * u[0] * u[2],
        ),
        (
            -f * n[1] * n[0] + bend * u[1] * u[0],
            f * (1.0 - n[1] * n[1]) + bend * u[1] * u[1],
            -f * n[1] * n[2] + bend * u[1] * u[2],
        ),
        (
            -f * n[2] * n[0] + bend * u[2] * u[0],
            -f * n[2] * n[1] + bend * u[2] * u[1],
            f * (1.0 - n[2] * n[2]) + bend * u[2] * u[2],
        ),
    )


@njit
def ask(rub, limit):
    """Note the limit (N) that a pass has found; how the change from pass to pass goes with the last (N2)."""
    shift = limit - rub.limit
    turned = shift - rub.shift
    along = rub.shift * turned
    rub.asked, rub.shift = limit, shift
    return along, turned * turned


@njit
def share_of(share, along, square):
    """Which part of what a pass asks for the limits take on; counts the pass.

    Where passes go to and fro, or hardly settle, whole changes do not get there: after a few, Aitken's
    rule by all limits together.  share (2,): of the pass before, passes; along, square: sums of ``ask``.
    """
    share[1] += 1.0
    if share[1] > WHOLE and square > 0.0:
        share[0] = min(max(-share[0] * along / square, LEAST_SHARE), MOST_SHARE)
    return share[0]


@njit
def turn(rub, d, place, share):
    """Give a RUB the normal along d, a share of the limit that was asked for, and its anchor.

    place: what moves against it, d itself for two yarns.  Returns how much its force would change by the
    whole of what was asked for (N), and the force itself.
    """
    before, size = across(place, rub.anchor, rub.normal)
    over = min(rub.stiffness, rub.limit / size) if size > 0.0 else 0.0
    distance = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    old = (rub.normal[0], rub.normal[1], rub.normal[2])
    n = (d[0] / distance, d[1] / distance, d[2] / distance)
    face(rub, n)
    after, size = across(place, rub.anchor, rub.normal)
    now = min(rub.stiffness, rub.asked / size) if size > 0.0 else 0.0
    change = 0.0
    for axis in range(3):
        change += (now * after[axis] - over * before[axis]) ** 2
    if share < 1.0:
        a = (1.0 - share) * old[0] + share * n[0]
        b = (1.0 - share) * old[1] + share * n[1]
        c = (1.0 - share) * old[2] + share * n[2]
        long = math.sqrt(a * a + b * b + c * c)
        face(rub, (a / long, b / long, c / long))
    rub.limit = max(rub.limit + share * (rub.asked - rub.limit), 0.0)
    return math.sqrt(change), now * size


@njit
def face(rub, n):
    """Give a RUB the unit normal n and the anchor that goes with it."""
    shared, leant = 1.0, 0.0
    for axis in range(3):
        rub.normal[axis] = n[axis]
        shared += n[axis] * rub.facing[axis]
        leant += n[axis] * rub.held[axis]
    for axis in range(3):
        turned = rub.held[axis] - leant / shared * (rub.facing[axis] + n[axis])
        rub.anchor[axis] = rub.start[axis] - turned


@njit
def begin(rub, d, place, limit, stiffness):
    """Start a step of a RUB that holds what it remembers of the last one."""
    rub.stiffness, rub.before, rub.asked = stiffness, limit, limit
    for axis in range(3):
        rub.start[axis] = place[axis]
    turn(rub, d, place, 1.0)


@njit
def end(rub, d, place, memory):
    """Energy lost over the step (J) and held in the spring at its end (J); fills a MEMORY.

    d, place: as of :func:`turn`, at the end.
    """
    if rub.limit == 0.0:  # no pass asks for the normal of a place that has opened
        distance = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        face(rub, (d[0] / distance, d[1] / distance, d[2] / distance))
    u, size = across(place, rub.anchor, rub.normal)
    k, limit = rub.stiffness, rub.limit
    kept, lost = 1.0, 0.0
    if k * size > limit:
        kept = limit / (k * size)
        lost = 0.5 * (onset(rub, u, size) + limit) * (1.0 - kept) * size
    for axis in range(3):
        memory.held[axis], memory.facing[axis] = kept * u[axis], rub.normal[axis]
        memory.pair[axis] = rub.pair[axis]
    return lost, 0.5 * k * (kept * size) ** 2


@njit
def onset(rub, u, size):
    """Limit (N) at which a place starts to slide that slides at the end of the step.

    Over the step the elongation without sliding goes straight from e0 to u and the limit from that
    before to that at the end.
    """
    low, high = rub.before, rub.limit
    held = along = 0.0
    for axis in range(3):
        e = rub.start[axis] - rub.anchor[axis]
        held += e * e
        along += e * u[axis]
    # |e0 + t (u - e0)| k = low + t (high - low)
    k2 = rub.stiffness * rub.stiffness
    a = k2 * (size * size - 2.0 * along + held) - (high - low) ** 2
    b = k2 * (along - held) - low * (high - low)
    c = k2 * held - low * low
    root = math.sqrt(max(b * b - a * c, 0.0))
    # The root at which a t^2 + 2 b t + c, below zero at first, rises above it.
    t = 1.0
    if b >= 0.0:
        t = -c / (b + root) if c < 0.0 else 0.0
    elif a > 0.0:
        t = (root - b) / a
    return low + min(t, 1.0) * (high - low)


@njit
def precedes(a, i, k, g):
    """Whether the pair a comes before (i, k, g) in the order of the pair search."""
    if a[2] != g:
        return a[2] < g
    if a[0] // CHUNK != i // CHUNK:
        return a[0] // CHUNK < i // CHUNK
    if a[1] // CHUNK != k // CHUNK:
        return a[1] // CHUNK < k // CHUNK
    return a[0] < i if a[0] != i else a[1] < k


@njit
def recall(rubs, memory):
    """Hand each remembered elongation to the RUB of the same pair; both in the order of the search."""
    at = 0
    for j in range(rubs.size):
        i, k, g = rubs[j].pair[0], rubs[j].pair[1], rubs[j].pair[2]
        while at < memory.size and precedes(memory[at].pair, i, k, g):
            at += 1
        if at == memory.size:
            return
        pair = memory[at].pair
        if pair[0] == i and pair[1] == k and pair[2] == g:
            for axis in range(3):
                rubs[j].held[axis] = memory[at].held[axis]
                rubs[j].facing[axis] = memory[at].facing[axis]


@njit
def add_flat_friction(scene, lattice, slip, order, work):
    """Potential of the friction forces (J); order as in ``add_flat_contact``."""
    touch, points = scene.touch, work.points
    room = slip.pairs.size if order > 0 else 0
    near, push = np.empty((room, 3), dtype=np.int64), np.empty((room, 9))
    energy, count = 0.0, 0
    for j in range(slip.pairs.size):
        rub = slip.pairs[j]
        if rub.limit == 0.0:
            continue
        pair = (rub.pair[0], rub.pair[1], rub.pair[2])
        u, size = across(separation(touch, points, lattice, pair), rub.anchor, rub.normal)
        v, f, bend = spring_at(size, rub.stiffness, rub.limit)
        energy += v
        if order == 0:
            continue
        h = slip_matrix(f, bend / (size * size) if bend != 0.0 else 0.0, rub.normal, u)
        for axis in range(3):
            near[count, axis], push[count, axis] = pair[axis], f * u[axis]
        push[count, 3], push[count, 4], push[count, 5] = h[0][0], h[0][1], h[0][2]
        push[count, 6], push[count, 7], push[count, 8] = h[1][1], h[1][2], h[2][2]
        count += 1
    if count > 0:
        add_pushes(touch, near[:count], push[:count], order, work.expanded, work.half)
    return energy

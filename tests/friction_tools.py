"""Friction of a step for tests: how a step with a history is made, and a slow twin of the law.

The twin follows the law by its words, a pair at a time in plain numpy: a spring across the normal,
carried along by the least rotation, cut off at Coulomb's limit.
"""

import itertools

import numpy as np

from knitsim.equilibrium.kernels.energy import new_work
from knitsim.equilibrium.kernels.friction import MEMORY, Memory, Rub, across
from knitsim.equilibrium.kernels.lag import LAG_MEMORY, Couple, turning_at
from knitsim.equilibrium.kernels.pairs import expand, pairs_at, place_points
from knitsim.equilibrium.kernels.slip import begin_slip, end_slip, lag_slip, vector_of

# Limit and stiffness of the yarn's own friction at which some points of a disturbed loop stick.
LAGGING = Couple(1e-6, 2e-8)


def rub_of(fabric, friction=0.3, couple=()):
    return Rub(friction, fabric.contact.shell(fabric.diameter), couple)


def virgin(rub, wraps=(0, 0)):
    """What is remembered before anything has moved."""
    lags = np.zeros(0, LAG_MEMORY) if rub.couple else ()
    return Memory(np.zeros(0, MEMORY), np.zeros(wraps, MEMORY), lags)


def slip_through(scene, ways, rub, skin, work):
    """Friction of the last of the steps between the unknowns ``ways``, its normal forces taken there.

    Returns the Slip and the Memory at the start of that step.
    """
    memory = virgin(rub)
    for start, end in itertools.pairwise(ways):
        before = memory
        listed = pairs_at(scene, start, skin, work)
        slip = begin_slip(scene, start, listed, rub, memory, work)
        lag_slip(scene, end, slip, rub, work)
        memory, _, _ = end_slip(scene, end, slip, work)
    return slip, before


def elongations(scene, y, slip):
    """Of all springs of pairs, and of the yarn's own, at y."""
    work = new_work(scene)
    lattice = expand(scene.map, y, work.x)
    place_points(scene.touch, work.x, work.points)
    pairs = [
        across(vector_of(scene, lattice, tuple(rub["pair"]), work), rub["anchor"], rub["normal"])[1]
        for rub in slip.pairs
    ]
    lags = [
        abs(lag["axis"] @ turning_at(scene, lattice, p, work) - lag["anchor"])
        for p, lag in enumerate(slip.lags)
    ]
    return np.array(pairs), np.array(lags)


def sticking_and_sliding(elements, size):
    """How many of the springs that are under force stick, and how many slide.

    elements: RUB or LAG; size: their elongations.
    """
    loaded = elements["limit"] > 0.0
    sliding = elements["stiffness"] * size > elements["limit"]
    return int((loaded & ~sliding).sum()), int((loaded & sliding).sum())


def turned(e, facing, normal):
    """e, carried from one normal to another by the least rotation (Rodrigues)."""
    if not facing.any():
        return np.zeros(3)
    v, c = np.cross(facing, normal), facing @ normal
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return (np.eye(3) + skew + skew @ skew / (1.0 + c)) @ e


def stretched(start, end, normal, e, facing):
    """Elongation (3,) of a spring without a limit, moved from ``start`` to ``end``."""
    moved = turned(e, facing, normal) + end - start
    return moved - normal * (normal @ moved)


def potential_of(size, stiffness, limit):
    """Energy (J) up to an elongation: the force by its trapezia, kink included exactly."""
    yielding = min(size, limit / stiffness)
    return 0.5 * stiffness * yielding**2 + limit * (size - yielding)

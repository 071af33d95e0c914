"""Compiled functions that do nothing: what it costs to hand a scene over from Python."""

from knitsim.jit import njit


@njit
def no_energy(scene, y, pairs, slip, order, work):
    """Takes the arguments of energy_of."""
    return 0.0


@njit
def no_pairs(scene, y, skin, work):
    """Takes the arguments of pairs_at."""
    return 0.0

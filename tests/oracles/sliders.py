"""Sliders in parallel under any history, in closed form: Masing's rule and return-point memory.

Each slider is a spring k in series with a block that holds up to the force L; all of them follow one
displacement x from a state without force.  The first way out gives phi(x) = sum of min(k |x|, L) with
the sign of x.  After a turn at (x_r, F_r) every slider may change its force by 2 L before it slides
again, so that F = F_r + 2 phi((x - x_r)/2); where this branch comes back to the turn before the last,
both are forgotten and the older branch goes on.  No step in between matters.
"""

import numpy as np


def virgin(x, stiffness, limit):
    """phi(x) (N) of the sliders (n,)."""
    return float(np.sign(x) * np.minimum(stiffness * abs(x), limit).sum())


def spring_energy(x, stiffness, limit):
    """Energy (J) that the springs hold on the first way out."""
    return float((np.minimum(stiffness * abs(x), limit) ** 2 / (2.0 * stiffness)).sum())


def forces(places, stiffness, limit):
    """Forces (N) at the places of a history that goes straight from one to the next, from 0 on."""
    stiffness, limit = np.asarray(stiffness, float), np.asarray(limit, float)
    turns, found, last, way = [], [], 0.0, 0.0
    force = 0.0
    for x in places:
        if x != last:
            if way * (x - last) < 0.0:
                turns.append((last, force))
            way = x - last
        # Past the turn before the last: the loop between the two is closed and forgotten.
        while len(turns) >= 2 and (x - turns[-2][0]) * way > 0.0:
            del turns[-2:]
        # Past the mirror of the first turn: the first way out goes on.
        if len(turns) == 1 and abs(x) > abs(turns[0][0]) and x * turns[0][0] < 0.0:
            turns.clear()
        if turns:
            x_turn, f_turn = turns[-1]
            force = f_turn + 2.0 * virgin(0.5 * (x - x_turn), stiffness, limit)
        else:
            force = virgin(x, stiffness, limit)
        found.append(force)
        last = x
    return np.array(found)


def loop_area(amplitude, stiffness, limit):
    """Energy (J) lost in one cycle between -amplitude and amplitude: 4 L (a - L/k) of each that slides."""
    return float((4.0 * limit * np.maximum(amplitude - limit / stiffness, 0.0)).sum())

"""Random plain knits to be bent: the fabrics of :mod:`campaign`, drawn anew, and which are possible.

Fixed before the campaign is run; knows nothing of the solver.

>>> float(path()[0]), float(abs(path()).max())
(0.0, 250.0)
"""

import numpy as np

from knitsim.verification import campaign
from knitsim.verification.stress import THICK, TIGHTEST

SEED = 20252  # of the campaign; trials before it used others
CASES = 300
CURVATURE = 250.0  # 1/m, either way
LEVELS = 4  # from the flat fabric to the largest curvature
PAIR = 0.01  # of the largest: before each level another state so much nearer


def draw(number, seed=SEED):
    """Fabric ``number`` (0 on): a :class:`campaign.Case`, whose strains are not asked."""
    return campaign.draw(number, seed)


def path():
    """Curvatures asked (1/m): 0 to 250, through 0 to -250, and back to 0, in pairs close together.

    After the start and each turn another state comes first, where friction sets in or turns over.
    """
    out = CURVATURE * np.arange(1, LEVELS + 1) / LEVELS
    step = PAIR * CURVATURE
    there, back = np.stack([out - step, out], axis=1).ravel(), np.append(out[-2::-1], 0.0)
    back = np.stack([back + step, back], axis=1).ravel()
    way = np.concatenate([there, [CURVATURE - step], back])
    return np.concatenate([[0.0, step], way, -way])


def impossible(case):
    """Why the fabric cannot be bent so far, from its inputs alone: reasons; none if it can.

    The reasons of :func:`campaign.impossible` that do not concern a strain, and the thickness.
    """
    reasons = [r for r in campaign.impossible(case) if " strain: " not in r]
    if CURVATURE * THICK * case.diameter > TIGHTEST:
        reasons.append("curvature too tight for the thickness")
    return tuple(reasons)

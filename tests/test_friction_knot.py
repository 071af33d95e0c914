"""The loose open trefoil knot: friction in long contact in space, against beam theory and its publication.

F h^2/B = e^4/2 + mu s e^3 (Audoly, Clauvelin and Neukirch, Phys. Rev. Lett. 99, 164301, 2007), h the radius
of the rod, B its rigidity, e = sqrt(h/R) small, R the radius of the loop.
"""

import numpy as np
import pytest
from knot_scene import BENDING, RADIUS, Knot
from oracles import braid

S = 0.492
# Tightened by four radii of the rod at either end and loosened by five.
WAYS = RADIUS * np.array([*np.arange(0.5, 4.1, 0.5), *np.arange(3.5, -1.1, -0.5)])
SLIDING = (slice(4, 8), slice(-4, None))  # where all slides one way, the other way


def test_braid_of_beam_theory_is_the_published_one():
    assert braid.friction_of_braid() == pytest.approx(S, abs=1e-3)


def of_coulomb(knot, friction):
    """What friction adds to the pull, and what it loses, over mu times the normal forces; both ways.

    The strands slide along each other by as much as the ends move apart.
    """
    force, states, y = knot.pulled(WAYS, friction)
    assert (np.diff(states.lost) >= 0.0).all()
    off = states.work - states.terms.sum(1) - states.lost
    assert np.ptp(off) < 0.01 * states.lost[-1]
    found = []
    for place, sign in zip(SLIDING, (1.0, -1.0), strict=True):
        smooth, _, _ = knot.pulled(WAYS[place], 0.0)
        normal = friction * np.array([knot.normal_forces(one) for one in y[place]])
        moved = 2.0 * np.abs(np.diff(WAYS[place]))
        lost = np.diff(states.lost[place]) / moved * RADIUS**2 / BENDING
        between = 0.5 * (normal[1:] + normal[:-1])
        found.append([np.mean(sign * (force[place] - smooth) / normal), np.mean(lost / between)])
    return np.array(found)


def test_friction_of_the_braid_is_coulombs():
    np.testing.assert_allclose(of_coulomb(Knot(0.14), 0.05), 1.0, atol=0.04)


@pytest.mark.slow
def test_pull_of_a_loose_knot_is_the_published_law():
    """As e goes to zero; the next terms go with e and e^2, of the pull the first one is known."""
    sizes = np.array([0.2, 0.14, 0.1, 0.07, 0.05])
    pull, normal = [], []
    for size in sizes:
        # Points twice as close as usual: the strands roll from point to point, which is 1 % of the pull else.
        knot = Knot(size, spacing=0.05)
        without, _, y = knot.pulled(WAYS[:8], 0.0)
        e = knot.size_at(WAYS[:8])
        pull.append(np.mean(without / (0.5 * e**4)))
        normal.append(np.mean([knot.normal_forces(one) for one in y] / e**3))
        if size > 0.08:
            # The strands cross under a small angle, of e.
            np.testing.assert_allclose(of_coulomb(knot, 0.05), 1.0, atol=0.03 + 0.5 * size**2)
    assert np.polyfit(sizes, normal, 2)[-1] == pytest.approx(S, rel=0.03)
    assert np.polyfit(sizes, pull, 2)[-1] == pytest.approx(1.0, abs=0.03)
    more = np.linalg.lstsq(np.stack([sizes, sizes**2], axis=1), np.array(pull) - 1.0, rcond=None)
    assert more[0][0] == pytest.approx(braid.next_of_pull(), abs=0.2)

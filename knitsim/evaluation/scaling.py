"""Cost of the equilibrium solver with more and more points in a loop and loops in a cell."""

import time
from dataclasses import dataclass

from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.relax import relax, settle
from knitsim.equilibrium.tension import tensile

DISTURBED = 1e-3  # relative change of the shape along and across, from which a cell is relaxed
COURSE_STRAINS = (0.02, 0.04)


@dataclass(frozen=True)
class Cost:
    """Process time (s) of relaxing and of two course states, and Newton steps of both.

    points, contacts: per loop; loops: in the cell.
    """

    points: int
    contacts: int
    loops: int
    relax: float
    tension: float
    relax_steps: int
    tension_steps: int

    @property
    def total(self):
        return self.relax + self.tension


def cost_of(fabric, resolution, repeats=1):
    """The least :class:`Cost` of relaxing a cell anew and pulling it by 2 and 4 % along the course.

    The relaxed cell is disturbed, 0.1 % wider and 0.1 % shorter, and relaxed again: a larger cell that
    is filled with loops at rest would have nothing to do.  Everything must have been compiled.
    """
    state = relax(fabric, resolution)
    model = state.model
    start, free = state.y.copy(), model.free(0, 3)
    for axis, part in ((0, 1.0 + DISTURBED), (1, 1.0 - DISTURBED)):
        used = model.cell.slot[:, axis]
        start[used[used >= 0]] *= part
        start[model.lattice + 3 * axis] *= part
    costs = []
    for _ in range(repeats):
        begin = time.process_time()
        again = settle(model, start, free)
        middle = time.process_time()
        curve = tensile(again, "course", COURSE_STRAINS)
        end = time.process_time()
        costs.append(
            Cost(
                model.cell.points,
                model.cell.contacts,
                model.loops,
                middle - begin,
                end - middle,
                again.iterations,
                int(curve.iterations.sum()),
            )
        )
    return min(costs, key=lambda cost: cost.total)


def loops_scaling(fabric, sides=(1, 2, 4, 10, 20), repeats=1):
    """:class:`Cost` of cells of side by side whole loops."""
    return [
        cost_of(fabric, Resolution(cell="full", wales=side, courses=side), repeats)
        for side in sides
    ]


def points_scaling(fabric, points=(40, 80, 160, 320), contacts=None, repeats=3):
    """:class:`Cost` of one loop with more and more control points.

    contacts: contact points of each; where None eight for every control point.
    """
    return [
        cost_of(fabric, Resolution(n, 8 * n if contacts is None else contacts), repeats)
        for n in points
    ]

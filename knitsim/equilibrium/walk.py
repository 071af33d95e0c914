"""A test under way: from one asked value, or force, to the next, keeping what was asked for."""

import numpy as np

from knitsim.equilibrium.fold import overlooked
from knitsim.equilibrium.kernels.accept import CROSSINGS_LOST, FOUND, REACHED
from knitsim.equilibrium.kernels.follow import March, Standing, new_trail
from knitsim.equilibrium.relax import REASONS
from knitsim.equilibrium.result import LOADING, RECOVERY
from knitsim.equilibrium.solve import follow, force_at

_STATES = ("closest", "residual", "work", "lost", "iterations", "increments")


class Walk:
    """The current state of a test and the rows so far.

    start: unknowns at the start, in equilibrium; memory: of friction there, None for none.  free:
    lattice entries that equilibrium decides; driven: unknowns that are prescribed; over: for each the
    unknown that it is divided by in what is asked for, or -1.  largest: largest change of what is asked
    for in one increment; exact, widest: as in :class:`.kernels.follow.March`.  told: function of an asked
    row that says it in words.  rub: friction, where not that of the model.
    """

    def __init__(
        self, model, scene, start, *, free, driven, largest, told, over=None, exact=0.0,
        widest=np.inf, memory=None, rub=None,
    ):  # fmt: skip
        self.model, self.scene, self.told = model, scene, told
        self.rub = model.rub if rub is None else rub
        over = [-1] * len(driven) if over is None else over
        self.march = March(
            model.free(*free), np.array(driven), np.array(over), float(largest), float(exact),
            float(widest), model.trace, model.expected, model.control,
        )  # fmt: skip
        memory = model.virgin if memory is None else memory
        force = force_at(model, scene, start, self.rub, memory)
        self.here = Standing(start.copy(), force, np.zeros(start.size + 1), memory)
        self.work = self.lost = 0.0
        self.rows, self.labels = [], []
        self.segment, self.reason, self.ended = -1, "", REACHED

    @property
    def y(self):
        return self.here.y

    @property
    def force(self):
        return self.here.force

    def force_per_width(self, entry, width):
        """Force on an unknown of the lattice over a width (N/m)."""
        return self.force[entry] / self.model.loops / width

    def _go(self, targets, phase, cycle, until=np.nan):
        """Go through targets, or up to the force ``until`` (N per cell): a status, FOUND at the force."""
        self.segment += 1
        here = Standing(*(part.copy() for part in self.here[:3]), self.here.memory)
        trail = new_trail(len(targets), here.y.size)
        targets = np.ascontiguousarray(targets, dtype=float)
        march = self.march._replace(until=float(until), scale=max(abs(until), self._largest()))
        reached, status, memory = follow(
            self.model, self.scene, here, targets, march, self.rub, trail
        )
        if not self.model.fabric.pattern.uniform:
            for n in range(reached):
                if overlooked(self.model, trail.y[n]):
                    reached, status = n, CROSSINGS_LOST
                    break
        for row, *state in zip(trail.states[:reached], trail.y, trail.force, strict=False):
            kept = {name: row[name] for name in _STATES}
            kept["work"] += self.work
            kept["lost"] += self.lost
            self.rows.append((*state, row.terms.copy(), kept))
            self.labels.append((phase, cycle, self.segment))
        if reached:
            self.here = here._replace(memory=memory)
            self.work, self.lost = kept["work"], kept["lost"]
        self.reached = here.y
        if status not in (REACHED, FOUND):
            self.ended = status
            self.reason = f"{REASONS[status]}; stopped before {self.told(targets[reached])}"
        return status

    def _largest(self):
        """Largest force so far on the driven unknown (N)."""
        at = self.march.driven[0]
        return max(abs(force[at]) for force in (self.force, *(row[1] for row in self.rows)))

    def forward(self, targets, phase=LOADING, cycle=1, top=None):
        """Go through targets, or up to the force ``top`` (N per cell) on the driven unknown.

        Whether it got there: True where all was reached.
        """
        status = self._go(targets, phase, cycle, np.nan if top is None else top)
        if top is not None and status == REACHED:
            self.reason = "the last strain was reached before the force that was asked for"
        return status in (REACHED, FOUND)

    def to_force(self, targets, wanted, phase=LOADING, cycle=1):
        """Go through targets up to the force ``wanted`` (N per cell), from either side."""
        status = self._go(targets, phase, cycle, wanted)
        if status == REACHED:
            self.reason = f"no force of {wanted / self.model.loops:.4g} N per loop on the way"
        return status == FOUND

    def back(self, targets, cycle=1):
        """Go back through targets until the force is zero, where it says why not if it never is."""
        if self.force[self.march.driven[0]] <= 0.0:
            return True
        status = self._go(targets, RECOVERY, cycle, 0.0)
        if status == REACHED:
            self.reason = "shortened to the end of the way back, the fabric is still under tension"
        return status == FOUND

    def states(self):
        """The rows as what :class:`.result.States` takes, and the forces by all unknowns (steps, unknowns).

        Energies, work and losses are per loop.
        """
        loops, steps = self.model.loops, len(self.rows)
        size = self.here.y.size
        y = np.array([row[0] for row in self.rows]).reshape(steps, size)
        force = np.array([row[1] for row in self.rows]).reshape(steps, size)
        column = {name: np.array([row[3][name] for row in self.rows]) for name in _STATES}
        labels = np.array(self.labels, dtype=np.int64).reshape(steps, 3)
        closest = column["closest"] / self.model.fabric.diameter
        return dict(
            model=self.model,
            phase=labels[:, 0],
            cycle=labels[:, 1],
            segment=labels[:, 2],
            energy=np.array([row[2] for row in self.rows]).reshape(steps, 4) / loops,
            work=column["work"] / loops,
            dissipated=column["lost"] / loops,
            min_distance=np.where(np.isfinite(closest), closest, np.nan),
            residual=column["residual"],
            iterations=column["iterations"],
            increments=column["increments"],
            y=y,
            memory=self.here.memory,
            stop_reason=self.reason,
            ended=int(self.ended),
            numerical_error=np.full(steps, np.nan),
        ), force


def ways_of(places):
    """Number of the turning point, from 0, that each of the curvatures or angles (n,) is on the way to."""
    steps = np.diff(places, prepend=0.0)
    moved = np.flatnonzero(steps)
    turns = np.zeros(len(places), dtype=np.int64)
    turns[moved[1:]] = steps[moved[1:]] * steps[moved[:-1]] < 0.0
    return np.cumsum(turns)

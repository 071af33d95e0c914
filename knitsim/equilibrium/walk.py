"""A test under way: from one asked value, or force, to the next, keeping what was asked for."""

import numpy as np

from knitsim.equilibrium.fold import overlooked
from knitsim.equilibrium.kernels.accept import CROSSINGS_LOST, NOT_SETTLED, REACHED
from knitsim.equilibrium.kernels.follow import March, Standing, new_trail
from knitsim.equilibrium.relax import REASONS
from knitsim.equilibrium.result import LOADING, RECOVERY
from knitsim.equilibrium.solve import follow, force_at

# Of the largest force, where a force is asked for.  With friction a state is known no better than the
# friction force is settled.
FORCE_TOLERANCE, RUBBED_TOLERANCE = 1e-6, 1e-4
TRIES = 40  # at most, to find it
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
        self.spent = {"iterations": 0, "increments": 0}  # on the way to the next row
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

    def _go(self, targets):
        """Follow targets from the current state without moving on: trail, where it ends, reached, status."""
        here = Standing(*(part.copy() for part in self.here[:3]), self.here.memory)
        trail = new_trail(len(targets), here.y.size)
        targets = np.ascontiguousarray(targets, dtype=float)
        reached, status, memory = follow(
            self.model, self.scene, here, targets, self.march, self.rub, trail
        )
        if not self.model.fabric.pattern.uniform:
            for n in range(reached):
                if overlooked(self.model, trail.y[n]):
                    return trail, here._replace(memory=memory), n, CROSSINGS_LOST
        return trail, here._replace(memory=memory), reached, status

    def _keep(self, trail, there, count, phase, cycle):
        """Append the first ``count`` rows of a trail and move on to where it ends."""
        for i in range(count):
            row = trail.states[i]
            state = {name: row[name] for name in _STATES}
            state["work"] += self.work
            state["lost"] += self.lost
            if i == 0:
                for name, spent in self.spent.items():
                    state[name] += spent
                self.spent = dict.fromkeys(self.spent, 0)
            self.rows.append((trail.y[i], trail.force[i], row.terms.copy(), state))
            self.labels.append((phase, cycle, self.segment))
        if count:
            self.here = there
            self.work += trail.states.work[count - 1]
            self.lost += trail.states.lost[count - 1]

    def _pass(self, trail, there):
        """Move on to where the one row of a trail ends, and keep no row."""
        row = trail.states[0]
        self.here = there
        self.work += row["work"]
        self.lost += row["lost"]
        for name in self.spent:
            self.spent[name] += row[name]

    def _largest(self):
        """Largest force so far on the driven unknown (N)."""
        at = self.march.driven[0]
        return max((abs(row[1][at]) for row in self.rows), default=abs(self.force[at]))

    def _stop(self, status, target):
        self.ended = status
        self.reason = f"{REASONS[status]}; stopped before {self.told(target)}"

    def forward(self, targets, phase=LOADING, cycle=1, top=None):
        """Go through targets, or up to the force ``top`` (N per cell) on the driven unknown.

        Whether it got there: True where all was reached.
        """
        self.segment += 1
        if top is None:
            trail, there, reached, status = self._go(targets)
            self._keep(trail, there, reached, phase, cycle)
            self.reached = there.y
            if status != REACHED:
                self._stop(status, targets[reached])
            return status == REACHED
        if not self._to(targets, top, phase, cycle):
            return False
        if not self.arrived:
            self.reason = "the last strain was reached before the force that was asked for"
        return True

    def to_force(self, targets, wanted, phase=LOADING, cycle=1):
        """Go through targets up to the force ``wanted`` (N per cell), from either side."""
        self.segment += 1
        if self._to(targets, wanted, phase, cycle) and not self.arrived:
            self.reason = f"no force of {wanted / self.model.loops:.4g} N per loop on the way"
        return self.arrived

    def _to(self, targets, wanted, phase, cycle):
        at, self.arrived = self.march.driven[0], False
        sign = 1.0 if self.force[at] < wanted else -1.0
        for target in targets:
            trail, there, _, status = self._go(target[None])
            # Where yarns lock, the way may end short of the target and yet beyond the force.
            if sign * (there.force[at] - wanted) >= 0.0:
                self.arrived = self._to_force(wanted, trail, there, status, phase, cycle)
                return self.arrived
            if status != REACHED:
                self._stop(status, target)
                return False
            self._keep(trail, there, 1, phase, cycle)
        return True

    def back(self, targets, cycle=1):
        """Go back through targets until the force is zero, where it says why not if it never is."""
        self.segment += 1
        at = self.march.driven[0]
        zero = FORCE_TOLERANCE * self._largest()
        for target in targets:
            trail, there, _, status = self._go(target[None])
            if status != REACHED:
                self._stop(status, target)
                return False
            force = trail.force[0, at]
            if force < -zero:
                return self._to_force(0.0, trail, there, status, RECOVERY, cycle)
            self._keep(trail, there, 1, RECOVERY, cycle)
            if force <= zero:
                return True
        self.reason = "shortened to the end of the way back, the fabric is still under tension"
        return False

    def _to_force(self, wanted, trail, there, status, phase, cycle):
        """The state at a force between the current one and that of ``trail`` (secants).

        With friction the force at a strain depends on the increments that led there, and jumps where it
        takes one more of them.  So a try that falls short is gone to before the next: what remains to
        the force is then one short increment.  status: of the way there; one that ended before its target
        tells a force all the same.
        """
        i = self.march.driven[0]
        near, tried = [(at.y[i], at.force[i] - wanted) for at in (self, there)]
        if near[1] * tried[1] > 0.0:
            # Already there at the start of the step.
            return True
        largest = max(abs(wanted), self._largest())
        known = RUBBED_TOLERANCE if self.rub != () else FORCE_TOLERANCE
        weight = 1.0
        for n in range(TRIES):
            enough = min(FORCE_TOLERANCE * 10 ** (n // 2), known) * largest
            if abs(tried[1]) <= enough and status == REACHED:
                self._keep(trail, there, 1, phase, cycle)
                return True
            if near[1] * tried[1] > 0.0:
                if status == REACHED:
                    self._pass(trail, there)
                near, tried, weight = tried, near, 1.0
            target = near[0] - weight * near[1] * (tried[0] - near[0]) / (
                tried[1] - weight * near[1]
            )
            # Illinois: the near end counts half where it stays.
            weight *= 0.5
            trail, there, _, status = self._go(np.array([[target]]))
            if status != REACHED and there.y[i] == self.y[i]:
                self._stop(status, [target])
                return False
            tried = there.y[i], there.force[i] - wanted
        self._stop(NOT_SETTLED, [target])
        return False

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

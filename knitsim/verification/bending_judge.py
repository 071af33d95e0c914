"""Is a test of a fabric right that keeps few states, by tension or by bending?

Judged by code that shares nothing with the solver (:mod:`bending_judge_energy`), from what the solver
says and what an engineer could measure on the shapes alone.  Where :mod:`judge` integrates the force
over many stored states, this one reads pairs of states close together: the work between them, by
their mean load, is what was stored and rubbed away.  The limits that both share are those of
:mod:`judge`; the values here were taken on trial cases of other seeds.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.verification.bending_judge_energy import BentEnergy
from knitsim.verification.judge import (
    COULOMB,
    FINE_CONTACTS,
    FINE_FORCE,
    FINE_GAUSS,
    FORCE,
    GAUSS,
    LAGGED,
    RESIDUAL,
    ROUND_OFF,
    SAME,
    Finding,
    above,
    no_splines,
    not_finite,
    not_interlooped,
)
from knitsim.verification.judge_energy import ROUNDED_STRAIN, control_of

# Checks that a fabric fails too that snaps from one shape to another.
UNBALANCED, LOST = SNAPPING = ("work is not stored or lost", "energy lost without friction")
CLOSE = 0.03  # of the largest load coordinate: states at most this far apart are a pair
# Of the work between a pair, of what is stored or of what is lost, that may go astray.
PAIR = {"friction": 0.06, "none": 0.03}
WHOLE = 1e-4  # of the largest work: may go astray between any pair
# Work done less stored less lost, over the largest of the three so far, with friction; without it the
# work is what is stored.  The method claims 3 % of each increment, which may add up: 3.1 % at most in
# trials, 1.7 % with 16 times as many increments.
BALANCE = 0.05
BEND = 0.1  # of the change of the load between a pair that a chord may miss
# The same where friction sets in or turns over, at an unknown place between the pair.  There yarns slip
# to and fro, further than from one state straight to the other: in trials up to 1.36 times the energy
# of the straight way is lost, and no less with increments of 1/64.
SHARP_BEND, SHARP_COULOMB = 0.5, 2.0
UNLOADED = 1e-3  # of the largest force: a test that went back to zero force ends below it
FORCES = 5  # states whose equilibrium is measured
VIEWED = 5  # states whose crossings are read


@dataclass(frozen=True)
class Test:
    """What was asked of a fabric.

    kind: "tension" or "bending"; direction: "course" or "wale", that was pulled or bent; free: whether
    the other spacing (in bending both) was free or held; asked: strains or curvatures (1/m) that the
    test says it has reached, in order, None where it stopped early; unloads: whether it says that its
    last state is back at zero force; fine_steps: whether its steps were those of the method, so that
    its work is exact to BALANCE.
    """

    __test__ = False  # no test of pytest

    kind: str
    direction: str
    free: bool = True
    asked: tuple | None = None
    unloads: bool = False
    fine_steps: bool = True


@dataclass(frozen=True, eq=False)
class TestStates:
    """States of a test, the first flat and at rest; (n,) unless said.

    centreline (n, 2 points + 1, 3), m, in the fabric's own flat coordinates: as in :class:`judge.States`;
    wale_spacing, course_spacing (m, in the mean plane); coordinate: strain or curvature (1/m); load:
    force along the pull (N per loop), or moment over the transverse spacing at rest (N); energy (n, 3):
    stretch, bending, contact (J per loop); work, dissipated: cumulative (J per loop); min_distance: in
    diameters, NaN where nothing is near; numerical_error: what the solver says that the load may be off
    by, over max(|load|, 1 % of the largest), NaN where it does not say.
    """

    __test__ = False

    centreline: np.ndarray
    wale_spacing: np.ndarray
    course_spacing: np.ndarray
    coordinate: np.ndarray
    load: np.ndarray
    energy: np.ndarray
    work: np.ndarray
    dissipated: np.ndarray
    min_distance: np.ndarray
    numerical_error: np.ndarray


def judge_test(given, states, test):
    """Findings (a list, empty for right) about the states of one test.

    given: :class:`judge_energy.Given`; states: TestStates; test: Test.  States that are not numbers, or
    whose shape is not what it should be, are not judged further.
    """
    return (
        _sound(given, states, test)
        or not_interlooped(states, _spread(len(states.load), VIEWED))
        or _Judge(given, states, test).findings()
    )


def _sound(given, states, test):
    """Finite, of the right shape, at the strains or curvatures that were asked."""
    findings = not_finite(states)
    if findings:
        return findings
    findings = no_splines(given, states)
    for i, (line, width) in enumerate(zip(states.centreline, states.wale_spacing, strict=True)):
        # The plane to which spacings and curvature belong is the mean of the centre line.
        off = abs(control_of(line[:-1:2], width)[:, 2].mean())
        if off > SAME * given.diameter:
            findings.append(Finding("mean plane is not at zero thickness", i, off, SAME))
    spacing = states.wale_spacing if test.direction == "course" else states.course_spacing
    held = []
    if test.kind == "tension":
        off = np.abs(spacing / spacing[0] - 1.0 - states.coordinate)
        findings += above("strain is not that of the spacing", off, SAME)
        if not test.free:
            held = [states.course_spacing if test.direction == "course" else states.wale_spacing]
    elif not test.free:
        held = [states.wale_spacing, states.course_spacing]
    for values in held:
        findings += above("a held spacing has changed", np.abs(values / values[0] - 1.0), SAME)
    if test.asked is not None:
        asked = np.asarray(test.asked)
        if len(asked) > len(states.coordinate):
            last = len(states.coordinate) - 1
            findings.append(Finding("asked states are missing", last, last + 1, len(asked)))
        else:
            off = np.abs(states.coordinate[: len(asked)] - asked)
            findings += above("asked state not reached", off / max(np.abs(asked).max(), 1e-3), SAME)
    return findings


class _Judge:
    """Measurements of sound states."""

    def __init__(self, given, states, test):
        self.given, self.states, self.test = given, states, test
        self.bends = test.kind == "bending"
        self.rubs = "friction" if given.friction > 0.0 else "none"
        bent = 1 if test.direction == "wale" else 0
        self.pulled = bent
        self.energy = BentEnergy(given, GAUSS, given.contacts, ROUNDED_STRAIN, bent)
        self.curvature = states.coordinate if self.bends else np.zeros(len(states.load))
        self.shapes = [self.energy.shape(*self._placed(i)) for i in range(len(states.load))]
        slope = given.law_tension[1] / given.law_strain[1]
        self.noise = RESIDUAL * given.bending_rigidity / given.diameter**2 + ROUND_OFF * slope
        # The load of one loop and the coordinate that it works along: in bending the couple, and the
        # angle that the loop spans.
        self.load, self.along = states.load, np.array([s.lattice[bent] for s in self.shapes])
        if self.bends:
            self.load = states.load * self.shapes[0].lattice[1 - bent]
            self.along = self.curvature * self.along

    def _fine(self):
        """The same energy by finer integrals, the law without rounded kinks."""
        contacts = FINE_CONTACTS * self.given.contacts
        return BentEnergy(self.given, FINE_GAUSS, contacts, 0.0, self.energy.axes[0])

    def _placed(self, i):
        s = self.states
        control = control_of(s.centreline[i][:-1:2], s.wale_spacing[i])
        return control, s.wale_spacing[i], s.course_spacing[i], self.curvature[i]

    def findings(self):
        stored = np.array([self.energy.terms(shape) for shape in self.shapes])
        return [
            *self._energies(stored),
            *self._distances(),
            *self._forces(),
            *self._balance(stored.sum(1)),
            *self._pairs(stored.sum(1)),
        ]

    def _energies(self, stored):
        whole = stored.sum(1)
        off = np.abs(self.states.energy - stored).max(1) / whole
        yield from above("energy is not that of the shape", off, SAME)
        if not self.bends:
            # At rest a fabric has the least energy near it, but for what the residual there does on
            # the way from it; further away it may have less only if that was lost on the way.  A bent
            # one may have less, as it curls.
            moved = np.array([self._moved(i, 0) for i in range(len(whole))])
            below = whole[0] - whole - self.states.dissipated - self.noise * moved
            yield from above("energy is below that at rest", below / whole[0], SAME)

    def _distances(self):
        own = np.array([shape.distance.min(initial=np.inf) for shape in self.shapes])
        near = np.isfinite(own)
        off = np.abs(self.states.min_distance * self.given.diameter / own - 1.0)
        yield from above(
            "smallest distance is not that of the shape", np.where(near, off, 0.0), SAME
        )
        # Closer than half their own spacing, contact points no longer see a crossing.
        apart = 0.5 * self.given.loop_length / self.given.contacts
        fine = self._fine()
        for i in {0, len(self.shapes) - 1, int(np.argmin(own))}:
            nearest = fine.closest(*self._placed(i), apart)
            if nearest < apart:
                yield Finding("yarns closer than contact points can tell", i, nearest, apart)

    def _forces(self):
        """Equilibrium of every control point and free spacing, and the load."""
        for i in _spread(len(self.shapes), FORCES):
            shape = self.shapes[i]
            on_points, on_lattice = self.energy.gradient(shape)
            by_curvature = self.energy.moment(shape) if self.bends else 0.0
            if not self.test.free:
                # Held spacings hold the mean plane where it is, by a pressure.
                on_points[:, 2] -= on_points[:, 2].mean()
            limit, slack, loose = np.full(on_points.shape, self.noise), np.full(2, self.noise), 0.0
            # In the first state nothing has rubbed.
            if self.given.friction > 0.0 and i > 0:
                rub = self.energy.coulomb(shape)
                limit += COULOMB * rub[0] + LAGGED * rub[0].max()
                slack += COULOMB * rub[1] + LAGGED * rub[1].max()
                loose = (COULOMB + LAGGED) * rub[2]
            worst = np.unravel_index(np.argmax(np.abs(on_points) / limit), limit.shape)
            if not abs(on_points[worst]) <= limit[worst]:
                value, bound = abs(on_points[worst]), limit[worst]
                yield Finding("a control point is not in equilibrium", int(i), value, bound)
            yield from self._spacings(i, on_points, on_lattice, slack, by_curvature, loose)
        largest = np.abs(self.load).max()
        if self.test.unloads and not abs(self.load[-1]) <= UNLOADED * largest:
            last = len(self.load) - 1
            yield Finding("the test does not end at zero force", last, self.load[-1], UNLOADED)

    def _spacings(self, i, on_points, on_lattice, slack, by_curvature, loose):
        """Forces on free spacings, force on the pulled one, moment.

        on_points, on_lattice: derivatives of a loop's energy (N); by_curvature: that by the curvature
        (J m); slack, loose: what friction and round-off may add to the derivatives by the spacings and
        by the curvature.
        """
        pulled, shape = self.pulled, self.shapes[i]
        held, known = np.zeros(2), [self.test.free or i == 0] * 2
        exact = FORCE * max(abs(self.load[i]), 0.01 * np.abs(self.load).max())
        if self.bends:
            width = shape.lattice[pulled]
            # A free spacing makes the energy least at a given angle kappa w, not at a given kappa.
            held[pulled] = shape.curvature / width * by_curvature
            slack[pulled] += abs(shape.curvature) / width * loose
            off, bound = abs(by_curvature / width - self.load[i]), exact + loose / width
            bound += self._by_residual(i, on_points, on_lattice - held)
            if not off <= bound:
                yield Finding("moment is not the slope of the energy", int(i), off, bound)
        else:
            held[pulled], known[pulled] = self.load[i], True
            slack[pulled] += exact
        for name, off, bound, judged in zip(
            ("wale", "course"), np.abs(held - on_lattice), slack, known, strict=True
        ):
            if judged and not off <= bound:
                yield Finding(f"force on the {name} spacing is wrong", int(i), off, bound)

    def _by_residual(self, i, on_points, on_spacings):
        """What the forces left in the state i add to its moment (N m), the way that to the nearest state.

        The moment of equilibrium is the slope of the least energy by the angle.  The slope at this
        very shape misses it by the forces left times how all that is free moves with the angle; both
        are measured, the forces up to the noise.  With friction, what is left may be friction.
        """
        apart = np.where(self.along == self.along[i], np.inf, np.abs(self.along - self.along[i]))
        k = int(np.argmin(apart))
        one, two = self.shapes[i], self.shapes[k]
        work = np.clip(on_points, -self.noise, self.noise) * (two.control - one.control)
        slack = np.clip(on_spacings, -self.noise, self.noise) * (two.lattice - one.lattice)
        return abs(work.sum() + slack.sum()) / apart[k]

    def _balance(self, stored):
        """Work reported, against what the shapes store and what is reported lost."""
        s = self.states
        yield from above(
            "friction gives energy", -np.diff(s.dissipated, prepend=0.0) / stored, SAME
        )
        if self.given.friction == 0.0:
            yield from above(LOST, np.abs(s.dissipated) / stored, SAME)
        work, gain, lost = (v - v[0] for v in (s.work, stored, s.dissipated))
        whole = max(np.abs(v).max() for v in (work, gain, lost))
        if not whole > 0.0 or not self.test.fine_steps:
            return
        doubt = np.zeros(len(work))
        for i in self._close():
            doubt[i:] += SHARP_BEND * self._change(i) if self._sharply(i) else 0.0
        off = np.maximum(np.abs(work - gain - lost) - doubt, 0.0) / whole
        limit = BALANCE if self.given.friction > 0.0 else SAME
        yield from above(UNBALANCED, off, limit)

    def _close(self):
        """Numbers i of the states that lie close to the state i - 1; so does a single one."""
        step = np.abs(np.diff(self.along))
        near = CLOSE * np.ptp(self.along) if len(step) > 1 else np.inf
        return np.flatnonzero((step > 0.0) & (step <= near)) + 1

    def _change(self, i):
        """Change of the load between the states i - 1 and i, times the way (J)."""
        return abs((self.load[i] - self.load[i - 1]) * (self.along[i] - self.along[i - 1]))

    def _sharply(self, i):
        """Whether the load may bend sharply between the states i - 1 and i.

        Near the start, where the test turns and friction turns over, or after long steps.
        """
        steps = np.diff(self.along[: i + 1])
        start = min(abs(self.along[i - 1 : i + 1] - self.along[0])) <= SAME * np.ptp(self.along)
        turned = i == 1 or steps[-1] * steps[-2] < 0.0
        return start or turned or not self.test.fine_steps

    def _pairs(self, stored):
        """Between states close together: mean load against what is stored and lost."""
        s, along, load = self.states, self.along, self.load
        close = self._close()
        for i in close:
            step = along[i] - along[i - 1]
            work = 0.5 * (load[i] + load[i - 1]) * step
            lost = s.dissipated[i] - s.dissipated[i - 1]
            sharply = self._sharply(i)
            # What the residual does on the way, and round-off of energies that hardly differ.
            noise = self.noise * self._moved(i, i - 1) + SAME * SAME * stored[i]
            doubt = WHOLE * np.abs(s.work).max() + noise
            gain = stored[i] - stored[i - 1]
            # Near zero force little work is done, and what is stored goes into friction.
            off, bent = self._astray(work - gain - lost, i, close)
            limit = bent + doubt + PAIR[self.rubs] * max(abs(work), abs(gain), lost)
            if not (sharply or off <= limit):
                yield Finding("load is not the slope of the energy", i, off, limit)
            if self.given.friction > 0.0:
                limit = SHARP_COULOMB if sharply else COULOMB
                limit *= self.energy.rubbed(self.shapes[i - 1], self.shapes[i])
                limit += noise
                if not lost <= limit:
                    yield Finding("friction takes more than Coulomb's law", i, lost, limit)
            if i == close[-1] and np.isfinite(s.numerical_error[i]) and not sharply:
                fine = self._fine()
                shapes = [fine.shape(*self._placed(k)) for k in (i - 1, i)]
                gain = np.diff([fine.terms(shape).sum() for shape in shapes])[0]
                # The mean load is off by the mean of what both are said to be off by.
                ends = slice(i - 1, i + 1)
                scale = np.maximum(np.abs(load[ends]), 0.01 * np.abs(load).max()) * abs(step)
                off, bent = self._astray(work - gain - lost, i, close)
                said = np.mean(np.fmax(FINE_FORCE, s.numerical_error[ends]) * scale)
                limit = said + bent + doubt
                if not off <= limit:
                    check = "load is not the slope of the energy, finer integrals"
                    yield Finding(check, i, off, limit)

    def _astray(self, off, i, close):
        """Size of ``off``, work by the chord less work, and what the bend of the load may do to it (J).

        Where a state before is close too, the load is known to set out between the slope there and its
        own chord, and to go on one way: to its side of the chord, the bend may do as much.
        """
        change = self._change(i)
        bent = BEND * change
        if i - 1 in close:
            there = slice(i - 2, i + 1)
            before, here = np.diff(self.load[there]) / np.diff(self.along[there])
            steep = max(abs(before), abs(here))
            flat = max(np.copysign(min(abs(before), abs(here)), before * here), 0.0)
            # Of a load that falls steeply first, the chord is above it, and so on.
            if steep > 0.0 and off * (here - before) > 0.0:
                bent = max(bent, 0.5 * (1.0 - flat / steep) * change)
        return abs(off), bent

    def _moved(self, i, since):
        """Lengths (m) that all control points move between two states, added up."""
        return np.abs(self.shapes[i].control - self.shapes[since].control).sum()


def _spread(count, most):
    """At most ``most`` numbers below count, spread evenly, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).astype(int))

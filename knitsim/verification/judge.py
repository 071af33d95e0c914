"""Is a result of the equilibrium model right?  Judged by code that shares nothing with the solver.

What is read: the centre line of one loop and the spacings in every stored state, and the numbers that
the solver reports beside them.  The judge measures the shape itself (:mod:`judge_energy`) and compares.
The limits follow from what the method claims and were fixed before the campaign.  The checks of work,
friction and slope took their form, and FROM, MORE, LESS, COULOMB and LAGGED their values, on 20 trial
cases of another seed.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.verification.judge_energy import ROUNDED_STRAIN, Energy, control_of, design

# The method's tolerance is 1e-6 B/d^2 on a quarter of a loop, whose points stand for up to four; the
# factor covers the points on the symmetry lines and the one that holds the mean thickness.
RESIDUAL = 4e-6
ROUND_OFF = 1e-12  # of the yarn's stiffness: forces below it are noise
SAME = 1e-6  # relative: the same sum, reported and measured
# Without friction the force is the derivative of the energy at this very state.
FORCE = 1e-3
# Work done less energy stored less energy lost, over the work so far: the method claims 2 % of force
# with friction, and half of that is added for what happens between stored states.
BALANCE = 0.03
# Force against the slope of the energy measured by finer integrals, the law without rounded kinks:
# at most this, or what the solver itself says that it may be off by.
FINE_FORCE = 0.05
FROM = 0.25  # balances are read against this part of the whole work at least
WORK = 0.02  # reported work against the integral of the reported force
# Energy lost, over the work: all pairs slipping take the most, and most of them do slip.
MORE, LESS = 0.02, 0.10
# Coulomb's law with normal forces lagged by one pass: a quarter more than the force of the moment,
# and a tenth of the largest where contact is just lost.
COULOMB, LAGGED = 1.25, 0.1
GAUSS = 3  # Gauss points per span that the method states
FINE_GAUSS, FINE_CONTACTS = 8, 2
JUDGED = 6  # states of a test whose forces are measured
SETTLED = 3  # slopes of the energy are read after this state
VIEW = 4  # vertices per span of the polyline whose crossings are read

# Read along the loop from its head, from the technical face: (neighbour course, over).
PLAIN_KNIT = (
    (1, False), (1, True), (-1, True), (-1, False),
    (-1, False), (-1, True), (1, True), (1, False),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class States:
    """States of a fabric, the first at rest; (n,) unless said.

    centreline (n, 2 points + 1, 3), m: two samples per span from the sinker arc on, the last is the
    first, one wale further; wale_spacing, course_spacing (m); strain: along the pull from the first
    state; force: along the pull (N per loop); energy (n, 3): stretch, bending, contact (J); work,
    dissipated: from the first state on (J); min_distance: in diameters, NaN where nothing is near;
    numerical_error: what the solver says that its force may be off by, over max(|force|, 1 % of the
    largest), NaN where it does not say.
    """

    centreline: np.ndarray
    wale_spacing: np.ndarray
    course_spacing: np.ndarray
    strain: np.ndarray
    force: np.ndarray
    energy: np.ndarray
    work: np.ndarray
    dissipated: np.ndarray
    min_distance: np.ndarray
    numerical_error: np.ndarray


@dataclass(frozen=True)
class Finding:
    """Something wrong: which check, in which state, the value found and the limit that it breaks."""

    check: str
    state: int
    value: float
    limit: float

    def __str__(self):
        return f"{self.check} (state {self.state}: {self.value:.3g}, limit {self.limit:.3g})"


def judge(given, states, direction=None, asked=None):
    """Findings (a list, empty for right) about the states of a rest or a test.

    given: :class:`knitsim.verification.judge_energy.Given`.  direction: "course" or "wale" for a test
    that was pulled with the other spacing free; None for a single state at rest.  asked: the strain
    that the test says it reached, or None where it says that it stopped.

    States that are not numbers, or whose shape is not what it should be, are not judged further.
    """
    findings = _sound(given, states, direction, asked) or not_interlooped(
        states, range(len(states.strain))
    )
    if findings:
        return findings
    return _Judge(given, states, direction).findings()


def _sound(given, states, direction, asked):
    """Finite, of the right shape, at the strains that it says."""
    findings = not_finite(states)
    if findings:
        return findings
    findings = no_splines(given, states)
    if direction:
        spacing = states.wale_spacing if direction == "course" else states.course_spacing
        off = np.abs(spacing / spacing[0] - 1.0 - states.strain)
        findings += above("strain is not that of the spacing", off, SAME)
    last = len(states.strain) - 1
    if asked is not None and abs(states.strain[-1] - asked) > SAME:
        findings.append(Finding("asked strain not reached", last, states.strain[-1], asked))
    return findings


def not_finite(states):
    """Findings about numbers that are none; min_distance and numerical_error need not be numbers."""
    findings = []
    for name, values in vars(states).items():
        bad = ~np.isfinite(values).reshape(len(values), -1).all(1)
        if name not in ("min_distance", "numerical_error"):
            findings += [
                Finding(f"{name} is not finite", int(i), np.nan, 0.0) for i in np.flatnonzero(bad)
            ]
    return findings


def no_splines(given, states):
    """Findings about centre lines that are no periodic cubic splines."""
    findings, n = [], given.points
    middle, turns = design(n, np.arange(n) + 0.5)
    for i, line in enumerate(states.centreline):
        width = states.wale_spacing[i]
        spline = middle @ control_of(line[:-1:2], width)
        spline[:, 0] += turns * width
        off = max(
            np.abs(spline - line[1::2]).max(), np.abs(line[-1] - line[0] - [width, 0.0, 0.0]).max()
        )
        if off > SAME * given.diameter:
            findings.append(Finding("centre line is no periodic cubic spline", i, off, SAME))
    return findings


def crossings(line, wale_spacing, course_spacing):
    """Crossings of a loop with the neighbour courses from its head: a list of (neighbour, over).

    line: vertices (m + 1, 3) of one loop.  Every segment is intersected with every segment of three
    loops on either side of the courses above and below, seen along the thickness axis.
    """
    head = np.argmax(line[:-1, 1])
    found = []
    start, step = line[:-1], np.diff(line, axis=0)
    for course in (1, -1):
        for wale in range(-3, 4):
            shift = np.array([wale * wale_spacing, course * course_spacing, 0.0])
            own, other = _within(line, line + shift), _within(line + shift, line)
            a, b = step[own][:, None], step[other][None]
            gap = start[other][None] + shift - start[own][:, None]
            area = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                p = (gap[..., 0] * b[..., 1] - gap[..., 1] * b[..., 0]) / area
                q = (gap[..., 0] * a[..., 1] - gap[..., 1] * a[..., 0]) / area
            for i, k in np.argwhere((p >= 0.0) & (p < 1.0) & (q >= 0.0) & (q < 1.0)):
                above = p[i, k] * a[i, 0, 2] - gap[i, k, 2] - q[i, k] * b[0, k, 2]
                found.append(((own[i] + p[i, k] - head) % len(start), course, bool(above > 0.0)))
    return [(course, over) for _, course, over in sorted(found)]


def _within(line, other):
    """Numbers of the segments of a line whose boxes, seen from above, meet the box of the other."""
    low, high = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    meets = (high >= other.min(0)) & (low <= other.max(0))
    return np.flatnonzero(meets[:, :2].all(1))


def not_interlooped(states, which):
    """Findings about the states ``which`` whose crossings are not those of plain knit."""
    findings = []
    points = (states.centreline.shape[1] - 1) // 2
    matrix, turns = design(points, np.arange(VIEW * points + 1) / VIEW)
    for i in which:
        line, width = states.centreline[i], states.wale_spacing[i]
        vertices = matrix @ control_of(line[:-1:2], width)
        vertices[:, 0] += turns * width
        read = tuple(crossings(vertices, width, states.course_spacing[i]))
        if not any(read[k:] + read[:k] == PLAIN_KNIT for k in range(len(read))):
            findings.append(Finding("crossings are not those of plain knit", int(i), len(read), 8))
    return findings


class _Judge:
    """Measurements of sound states."""

    def __init__(self, given, states, direction):
        self.given, self.states, self.direction = given, states, direction
        # The first spacing, between wales, is the one that a pull along the course prescribes.
        self.pulled = 1 if direction == "wale" else 0
        self.same = Energy(given, GAUSS, given.contacts, ROUNDED_STRAIN)
        self.fine = Energy(given, FINE_GAUSS, FINE_CONTACTS * given.contacts, 0.0)
        self.shapes = self._shapes(self.same, range(len(states.strain)))
        last = len(self.shapes) - 1
        self.judged = np.unique(np.linspace(min(1, last), last, JUDGED).astype(int))
        # Slopes are taken between the states on either side, away from where friction sets in.
        self.sloped = self.judged[(self.judged > SETTLED) & (self.judged < last)]
        slope = given.law_tension[1] / given.law_strain[1]
        self.noise = RESIDUAL * given.bending_rigidity / given.diameter**2 + ROUND_OFF * slope

    def _shapes(self, energy, which):
        s = self.states
        return [
            energy.shape(
                control_of(s.centreline[i][:-1:2], s.wale_spacing[i]),
                s.wale_spacing[i], s.course_spacing[i],
            )
            for i in which
        ]  # fmt: skip

    def findings(self):
        stored = np.array([self.same.terms(shape) for shape in self.shapes])
        which = np.unique([0, *self.judged, *(self.sloped - 1), *(self.sloped + 1)])
        fine = dict(zip(which.tolist(), self._shapes(self.fine, which), strict=True))
        findings = [*self._energies(stored), *self._distances(fine), *self._forces()]
        if self.direction:
            findings += [*self._balances(stored.sum(1)), *self._slopes(fine)]
        return findings

    def _energies(self, stored):
        whole = self.states.energy.sum(1)
        off = np.abs(self.states.energy - stored).max(1) / whole
        yield from above("energy is not that of the shape", off, SAME)
        # At rest a fabric has the least energy near it; without work there is no way below.
        yield from above("energy is below that at rest", 1.0 - whole / whole[0], SAME)

    def _distances(self, fine):
        own = np.array([shape.distance.min(initial=np.inf) for shape in self.shapes])
        touching = np.isfinite(own)
        off = np.abs(self.states.min_distance * self.given.diameter / own - 1.0)
        yield from above(
            "smallest distance is not that of the shape", np.where(touching, off, 0.0), SAME
        )
        # Closer than half their own spacing, contact points no longer see a crossing.
        apart = 0.5 * self.given.loop_length / self.given.contacts
        for i, shape in fine.items():
            nearest = shape.distance.min(initial=np.inf)
            if nearest < apart:
                yield Finding("yarns closer than contact points can tell", i, nearest, apart)
                return

    def _forces(self):
        """Equilibrium of every control point and free spacing, and the force on the pulled one."""
        largest = np.abs(self.states.force).max()
        for i in self.judged if self.direction else [0]:
            on_points, on_lattice = self.same.gradient(self.shapes[i])
            held, slack = np.zeros(2), np.full(2, self.noise)
            if self.direction:
                held[self.pulled] = self.states.force[i]
                slack[self.pulled] += FORCE * max(abs(self.states.force[i]), 0.01 * largest)
            limit = np.full(on_points.shape, self.noise)
            # At rest nothing has rubbed.
            if self.given.friction > 0.0 and self.direction:
                rub = self.same.coulomb(self.shapes[i])
                limit += COULOMB * rub[0] + LAGGED * rub[0].max()
                slack += COULOMB * rub[1] + LAGGED * rub[1].max()
            worst = np.unravel_index(np.argmax(np.abs(on_points) / limit), limit.shape)
            if not abs(on_points[worst]) <= limit[worst]:
                value, bound = abs(on_points[worst]), limit[worst]
                yield Finding("a control point is not in equilibrium", int(i), value, bound)
            for name, off, bound in zip(
                ("wale", "course"), np.abs(held - on_lattice), slack, strict=True
            ):
                if not off <= bound:
                    yield Finding(f"force on the {name} spacing is wrong", int(i), off, bound)

    def _balances(self, stored):
        states = self.states
        spacing = np.array([shape.lattice[self.pulled] for shape in self.shapes])
        work, trapezia = integral(spacing, states.force), integral(spacing, states.force, order=1)
        whole = np.abs(work).max()
        if not whole > 0.0:
            yield Finding("no work was done", len(work) - 1, whole, 0.0)
            return
        against = np.maximum(np.abs(work), FROM * whole)
        # What the integral itself may be off by: its smoothness, the error that the solver states for
        # the forces (which wavers from state to state: added by squares), and friction that sets in
        # at an unknown place of the first step.
        doubt = 0.5 * np.abs(work - trapezia)
        stated = np.nan_to_num(states.numerical_error) * np.maximum(
            np.abs(states.force), 0.01 * np.abs(states.force).max()
        )
        parts = 0.5 * (stated[1:] + stated[:-1]) * np.abs(np.diff(spacing))
        doubt[1:] += np.sqrt(np.cumsum(parts**2))
        most = np.zeros(len(work))
        if self.given.friction > 0.0:
            doubt[1:] += 0.5 * abs(states.force[1] * (spacing[1] - spacing[0]))
            steps = zip(self.shapes[:-1], self.shapes[1:], strict=True)
            most[1:] = np.cumsum([self.same.rubbed(*pair) for pair in steps])

        def off(values):
            return np.maximum(np.abs(values) - doubt, 0.0) / against

        lost = states.dissipated
        yield from above(
            "work is not stored or lost", off(work - stored + stored[0] - lost), BALANCE
        )
        yield from above("reported work is not that of the force", off(states.work - work), WORK)
        yield from above("friction takes more than Coulomb's law", (lost - most) / against, MORE)
        yield from above("friction takes less than it must", (most - lost) / against, LESS)
        yield from above("friction gives energy", -np.diff(lost, prepend=0.0) / against, SAME)

    def _slopes(self, fine):
        """Mean force between two states against what was stored and lost, measured more finely."""
        s = self.states
        largest = np.abs(s.force).max()
        for i in self.sloped:
            near = slice(i - 1, i + 2)
            x = np.array([shape.lattice[self.pulled] for shape in self.shapes[near]])
            work = integral(x, s.force[near])[-1]
            gain = (self.fine.terms(fine[i + 1]) - self.fine.terms(fine[i - 1])).sum()
            gain += s.dissipated[i + 1] - s.dissipated[i - 1]
            scale = max(abs(s.force[i]), 0.01 * largest) * abs(x[2] - x[0])
            yield from above(
                "force is not the slope of the energy, finer integrals",
                np.array([abs(work - gain) / scale]), np.fmax(FINE_FORCE, s.numerical_error[i]), i,
            )  # fmt: skip


def above(check, values, limit, first=0):
    """The worst state (numbered from ``first``), if it breaks the limit; what is no number does."""
    if not (values <= limit).all():
        worst = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
        yield Finding(check, int(first) + worst, float(values[worst]), float(limit))


def integral(x, y, order=3):
    """Integral of y over x from the first point to every one, (n,).

    order 1: trapezia; 3: on each interval the mean of the parabolas through it and either neighbour.
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    h = np.diff(x)
    parts = 0.5 * h * (y[1:] + y[:-1])
    if order > 1 and len(h) > 1:
        slope = np.diff(y) / h
        bend = np.diff(slope) / (x[2:] - x[:-2])  # second divided differences
        bends = 0.5 * (np.concatenate([bend[:1], bend]) + np.concatenate([bend, bend[-1:]]))
        parts -= bends * h**3 / 6.0
    return np.concatenate([[0.0], np.cumsum(parts)])

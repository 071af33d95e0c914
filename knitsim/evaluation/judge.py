"""Is a result of the equilibrium model right?  Judged by code that shares nothing with the solver.

What is read: the centre line of one loop and the spacings in every stored state, and the numbers that
the solver reports beside them.  The judge measures the shape itself (:mod:`judge_energy`) and compares.
The limits follow from what the method claims, not from its results; each stands with its reason.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.evaluation.judge_energy import ROUNDED_STRAIN, Energy, control_of, design

# The method's tolerance is 1e-6 B/d^2 on a quarter of a loop, whose points stand for up to four; the
# factor covers the points on the symmetry lines and the one that holds the mean thickness.
RESIDUAL = 4e-6
ROUND_OFF = 1e-12  # of the yarn's stiffness: forces below it are noise
SAME = 1e-6  # relative: the same sum, reported and measured
# Without friction the force is the derivative of the energy at this very state.
FORCE = 1e-3
# Work done less energy stored less energy lost, over the work so far: the method's 2 % at friction and
# half of that for what is read between the stored states.
BALANCE = 0.03
# The same with the energy measured by finer integrals and the law without rounded kinks.
FINE_BALANCE = 0.05
FROM = 0.1  # balances are read against this part of the whole work at least
WORK = 0.02  # reported work against the integral of the reported force
# Reported and measured energy lost, over the work: the slip is read between stored states, between
# which the solver takes several steps.
LOST = 0.05
# Coulomb's law with a normal force lagged by one pass.
COULOMB = 1.25
FINE_GAUSS, FINE_CONTACTS = 8, 4
JUDGED = 5  # states of a test whose forces are measured
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
    dissipated: from the first state on (J); min_distance: in diameters, NaN where nothing is near.
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

    given: :class:`knitsim.evaluation.judge_energy.Given`.  direction: "course" or "wale" for a test
    that was pulled with the other spacing free; None for a single state at rest.  asked: the strain
    that the test says it reached, or None where it says that it stopped.

    States that are not numbers, or whose shape is not what it should be, are not judged further.
    """
    findings = _sound(given, states, direction, asked) or _interlooped(states)
    if findings:
        return findings
    return _Judge(given, states, direction).findings()


def _sound(given, states, direction, asked):
    """Finite, of the right shape, at the strains that it says."""
    findings = []
    for name, values in vars(states).items():
        if name == "min_distance":
            continue
        bad = ~np.isfinite(values).reshape(len(values), -1).all(1)
        findings += [Finding(f"{name} is not finite", int(i), np.nan, 0.0) for i in np.nonzero(bad)[0]]
    if findings:
        return findings
    n = given.points
    middle, turns = design(n, np.arange(n) + 0.5)
    base = (states.wale_spacing if direction == "course" else states.course_spacing)[0]
    for i, line in enumerate(states.centreline):
        width = states.wale_spacing[i]
        spline = middle @ control_of(line[:-1:2], width)
        spline[:, 0] += turns * width
        off = max(
            np.abs(spline - line[1::2]).max(), np.abs(line[-1] - line[0] - [width, 0.0, 0.0]).max()
        )
        if off > SAME * given.diameter:
            findings.append(Finding("centre line is no periodic cubic spline", i, off, SAME))
        spacing = width if direction == "course" else states.course_spacing[i]
        off = abs(spacing / base - 1.0 - states.strain[i])
        if direction and off > SAME:
            findings.append(Finding("strain is not that of the spacing", i, off, SAME))
    last = len(states.strain) - 1
    if asked is not None and abs(states.strain[-1] - asked) > SAME:
        findings.append(Finding("asked strain not reached", last, states.strain[-1], asked))
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
            other = start + [wale * wale_spacing, course * course_spacing, 0.0]
            gap = other[None] - start[:, None]
            area = step[:, None, 0] * step[None, :, 1] - step[:, None, 1] * step[None, :, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                p = (gap[..., 0] * step[None, :, 1] - gap[..., 1] * step[None, :, 0]) / area
                q = (gap[..., 0] * step[:, None, 1] - gap[..., 1] * step[:, None, 0]) / area
            for i, k in np.argwhere((p >= 0.0) & (p < 1.0) & (q >= 0.0) & (q < 1.0)):
                own = start[i, 2] + p[i, k] * step[i, 2]
                height = other[k, 2] + q[i, k] * step[k, 2]
                found.append(((i + p[i, k] - head) % len(start), course, bool(own > height)))
    return [(course, over) for _, course, over in sorted(found)]


def _interlooped(states):
    findings = []
    points = (states.centreline.shape[1] - 1) // 2
    matrix, turns = design(points, np.arange(VIEW * points + 1) / VIEW)
    for i, line in enumerate(states.centreline):
        width = states.wale_spacing[i]
        vertices = matrix @ control_of(line[:-1:2], width)
        vertices[:, 0] += turns * width
        read = tuple(crossings(vertices, width, states.course_spacing[i]))
        if not any(read[k:] + read[:k] == PLAIN_KNIT for k in range(len(read))):
            findings.append(Finding("crossings are not those of plain knit", i, len(read), 8))
    return findings


class _Judge:
    """Measurements of sound states."""

    def __init__(self, given, states, direction):
        self.given, self.states, self.direction = given, states, direction
        # The first spacing, between wales, is the one that a pull along the course prescribes.
        self.pulled = 1 if direction == "wale" else 0
        self.lattices = np.stack([states.wale_spacing, states.course_spacing], axis=1)
        self.shapes = [
            (control_of(line[:-1:2], lattice[0]), lattice)
            for line, lattice in zip(states.centreline, self.lattices, strict=True)
        ]
        self.same = Energy(given, 3, given.contacts, ROUNDED_STRAIN)
        self.fine = Energy(given, FINE_GAUSS, FINE_CONTACTS * given.contacts, 0.0)
        last = len(self.shapes) - 1
        self.judged = np.unique(np.linspace(min(1, last), last, JUDGED).astype(int))
        slope = given.law_tension[1] / given.law_strain[1]
        self.noise = RESIDUAL * given.bending_rigidity / given.diameter**2 + ROUND_OFF * slope

    def findings(self):
        stored = np.array([self.same.terms(*shape) for shape in self.shapes])
        return [
            *self._energies(stored),
            *self._distances(),
            *self._forces(),
            *(self._balances(stored.sum(1)) if self.direction else ()),
        ]

    def _energies(self, stored):
        scale = self.states.energy.sum(1)
        off = np.abs(self.states.energy - stored).max(1) / scale
        yield from self._above("energy is not that of the shape", off, SAME)
        # At rest a fabric has the least energy near it; without work there is no way below.
        yield from self._above("energy is below that at rest", 1.0 - scale / scale[0], SAME)

    def _distances(self):
        given, reported = self.given, self.states.min_distance
        apart = given.loop_length / given.contacts / given.diameter
        for i, shape in enumerate(self.shapes):
            sizes = [_nearest(energy, shape) / given.diameter for energy in (self.same, self.fine)]
            if sizes[0] < 1.0 and not abs(reported[i] / sizes[0] - 1.0) <= SAME:
                yield Finding("smallest distance is not that of the shape", i, reported[i], sizes[0])
            # Closer than half their own spacing, contact points no longer see a crossing.
            if sizes[1] < 0.5 * apart:
                yield Finding("yarns closer than contact points can tell", i, sizes[1], 0.5 * apart)

    def _forces(self):
        """Equilibrium of every control point and free spacing, and the force on the pulled one."""
        largest = np.abs(self.states.force).max()
        for i in self.judged if self.direction else [0]:
            on_points, on_lattice = self.same.gradient(*self.shapes[i])
            held, slack = np.zeros(2), np.full(2, self.noise)
            if self.direction:
                held[self.pulled] = self.states.force[i]
                slack[self.pulled] += FORCE * max(abs(self.states.force[i]), 0.01 * largest)
            most = np.zeros((self.given.points, 3)), np.zeros(2)
            # At rest nothing has rubbed.
            if self.given.friction > 0.0 and self.direction and i > 0:
                most = self.same.coulomb(*self.shapes[i])
            limit = COULOMB * most[0] + self.noise
            worst = np.unravel_index(np.argmax(np.abs(on_points) / limit), limit.shape)
            if abs(on_points[worst]) > limit[worst]:
                yield Finding(
                    "a control point is not in equilibrium", int(i), on_points[worst], limit[worst]
                )
            for name, value, bound in zip(
                ("wale", "course"), held - on_lattice, COULOMB * most[1] + slack, strict=True
            ):
                if abs(value) > bound:
                    yield Finding(f"force on the {name} spacing is wrong", int(i), value, bound)

    def _balances(self, stored):
        states, given = self.states, self.given
        work = integral(self.lattices[:, self.pulled], states.force)
        if not np.abs(work).max() > 0.0:
            yield Finding("no work was done", len(work) - 1, 0.0, 0.0)
            return
        lost = np.zeros(len(work))
        if given.friction > 0.0:
            steps = zip(self.shapes[:-1], self.shapes[1:], strict=True)
            lost[1:] = np.cumsum([self.same.rubbed(*pair) for pair in steps])
        against = np.maximum(np.abs(work), FROM * np.abs(work).max())
        yield from self._above(
            "work is not stored or lost", np.abs(work - stored + stored[0] - lost) / against, BALANCE
        )
        fine = self.fine
        gain = np.full(len(work), stored[0])
        for i in self.judged:
            gain[i] = fine.terms(*self.shapes[i]).sum()
        gain -= fine.terms(*self.shapes[0]).sum()
        off = np.zeros(len(work))
        off[self.judged] = (np.abs(work - gain - lost) / against)[self.judged]
        yield from self._above("work is not stored or lost, finer integrals", off, FINE_BALANCE)
        yield from self._above(
            "reported work is not that of the force", np.abs(states.work - work) / against, WORK
        )
        yield from self._above(
            "reported loss is not friction times slip",
            np.abs(states.dissipated - lost) / against, LOST,
        )  # fmt: skip
        fall = -np.diff(states.dissipated, prepend=0.0) / against
        yield from self._above("friction gives energy", fall, SAME)

    @staticmethod
    def _above(check, values, limit):
        """The worst state of a check, if it breaks the limit; what is not a number does."""
        bad = ~(values <= limit)
        if bad.any():
            worst = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
            yield Finding(check, worst, float(values[worst]), limit)


def integral(x, y):
    """Integral of y over x from the first point to every one, (n,): fourth order on smooth data.

    On each interval the mean of the parabolas through it and either neighbour.
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    h = np.diff(x)
    parts = 0.5 * h * (y[1:] + y[:-1])
    if len(h) > 1:
        slope = np.diff(y) / h
        bend = np.diff(slope) / (x[2:] - x[:-2])  # second divided differences
        bends = 0.5 * (np.concatenate([bend[:1], bend]) + np.concatenate([bend, bend[-1:]]))
        parts -= bends * h**3 / 6.0
    return np.concatenate([[0.0], np.cumsum(parts)])


def _nearest(energy, shape):
    """Smallest distance between contact points that may touch (m); inf where none do."""
    gap = energy.pairs(energy.points(shape[0], shape[1][0]), shape[1])[3]
    return np.sqrt((gap**2).sum(1)).min(initial=np.inf)

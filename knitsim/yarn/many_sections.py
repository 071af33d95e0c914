"""The yarn of many sections: what :mod:`knitsim.yarn.section` reduces to one, solved in full.

Every point of every section moves in three directions.  The ends are images: the section after the
last is the image of the first, carried on by the length of all.  Springs are written out point by
point, apart from the kernels of the one section, so that the two solutions check each other.

A spring inside a section acts on the distance in the section and, just as stiffly, against its
ends slipping past each other along the yarn.  (With a plain spring, fibres could slip at no cost
and the compressed section of a pulled yarn would fold out of its plane.)  In the uniform yarn
nothing slips.

The uniform yarn is the answer as long as bending springs are weak beside tension springs, EI/h^2
far below EA, as in any real fibre.  The paper's k2 as a bending spring is not: see the tests.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, eye_array
from scipy.sparse.linalg import splu

from knitsim.errors import ComputationError, InputError
from knitsim.yarn.bracing import section_springs

ITERATIONS = 100


@dataclass(frozen=True, eq=False)
class ManySections:
    """Equilibrium of a yarn of many sections at one axial strain.

    points: (sections, n, 3), the third along the yarn (m).  tension (N), energy per metre of
    unstrained yarn (J/m; on loading it includes what plastic fibres dissipate).
    iterations: of Newton's method.  perturbed_by: largest distance (m) of a point at the start from
    where it is as built.
    """

    points: np.ndarray
    tension: float
    energy: float
    iterations: int
    perturbed_by: float


def solve_many_sections(yarn, strain, sections=8, perturbation=0.02, seed=1):
    """Equilibrium of ``yarn`` (SimulatedYarn), ``sections`` sections strained once to ``strain``.

    The start is the yarn as built with every coordinate moved by a random share, at most
    ``perturbation``, of the yarn's radius (random numbers from ``seed``).  Returns ManySections;
    raises InputError for a yarn with nothing to solve, ComputationError if no equilibrium is found.
    """
    if not yarn.deformable:
        raise InputError(f"{yarn.where}.section_stiffness", yarn.section_stiffness, "rigid yarn")
    if not (sections == int(sections) and sections >= 2):
        raise InputError("sections", sections, "must be a whole number of at least 2")
    if not -1 < strain < math.inf:
        raise InputError("strain", strain, "must be finite and above -1")
    problem = _ManySections(yarn, sections, strain)
    rough = np.random.default_rng(seed).uniform(-1.0, 1.0, problem.shape)
    start = problem.built + perturbation * 0.5 * yarn.layout.diameter * rough
    points, iterations = _newton(problem, start)
    energy, along = problem.energy_and_tension(points)
    return ManySections(
        points=problem.in_space(points),
        tension=along,
        energy=energy / (sections * yarn.spacing),
        iterations=iterations,
        perturbed_by=float(np.linalg.norm(start - problem.built, axis=-1).max()),
    )


class _ManySections:
    """Energy, gradient and Hessian by y (sections, n, 3).

    y are the coordinates of a point in the frame of its section: section j stands at j S along the
    axis and is turned by M^j, so that all sections look alike and the first follows the last.
    """

    def __init__(self, yarn, sections, strain):
        self.yarn, self.sections = yarn, sections
        fibres = yarn.layout.fibres
        self.shape = (sections, fibres, 3)
        self.built = np.zeros(self.shape)
        self.built[:, :, :2] = yarn.layout.positions
        self.turn = np.eye(3)
        self.turn[:2, :2] = yarn.turn
        self.step = np.array([0.0, 0.0, yarn.spacing * (1.0 + strain)])
        built_step = np.array([0.0, 0.0, yarn.spacing])
        chord = yarn.layout.positions @ (yarn.turn - np.eye(2)).T
        chord = np.column_stack([chord, np.zeros(fibres)]) + built_step
        self.length = np.linalg.norm(chord, axis=1)
        self.angle = _angle(chord, chord @ self.turn.T)
        self.angle[self.angle < 1e-9] = 0.0
        self.bend = yarn.bending_rigidity / self.length + yarn.bending_constant * yarn.spacing
        self.pairs = section_springs(yarn.layout.positions)
        self.spring = yarn.section_stiffness * yarn.spacing
        span = yarn.layout.positions[self.pairs[:, 0]] - yarn.layout.positions[self.pairs[:, 1]]
        self.rest = np.hypot(span[:, 0], span[:, 1])
        # The two motions that cost nothing: along the axis, and the turn (or shift) of the section.
        self.held = [2, self._held_in_section()]
        self._number()

    def _held_in_section(self):
        if self.yarn.twist_form == "corrected":
            return 3 * int(np.argmax(np.abs(self.built[0, :, 0]))) + 1
        half = math.pi * self.yarn.twist * self.yarn.spacing
        return 0 if abs(math.cos(half)) >= abs(math.sin(half)) else 1

    def _number(self):
        """Unknowns of each element, and the linear maps from them to what the element sees."""
        number = np.arange(math.prod(self.shape)).reshape(self.shape)
        one = np.eye(3)
        ahead, behind = np.roll(number, -1, axis=0), np.roll(number, 1, axis=0)
        # chord from section j to j + 1, in the frame of j: M y_(j+1) + S - y_j
        self.chord_unknowns = np.concatenate([number, ahead], axis=2).reshape(-1, 6)
        self.chord_map = np.hstack([-one, self.turn])
        # the chords before and after section j, in its frame
        self.bend_unknowns = np.concatenate([behind, number, ahead], axis=2).reshape(-1, 9)
        none = np.zeros((3, 3))
        self.bend_map = np.block([[-self.turn.T, one, none], [none, -one, self.turn]])
        first, second = number[:, self.pairs[:, 0]], number[:, self.pairs[:, 1]]
        self.pair_unknowns = np.concatenate([first, second], axis=2).reshape(-1, 6)
        self.pair_map = np.hstack([one, -one])

    def in_space(self, y):
        """Points in the frame of the first section, (sections, n, 3)."""
        points = np.empty_like(y)
        turn = np.eye(3)
        for j in range(self.sections):
            points[j] = y[j] @ turn.T + j * self.step
            turn = turn @ self.turn
        return points

    def _chords(self, y):
        return y.ravel()[self.chord_unknowns] @ self.chord_map.T + self.step

    def _bends(self, y):
        both = y.ravel()[self.bend_unknowns] @ self.bend_map.T
        return both[:, :3] + self.step, both[:, 3:] + self.step

    def _pairs(self, y):
        span = y.ravel()[self.pair_unknowns] @ self.pair_map.T
        distance = np.hypot(span[:, 0], span[:, 1])
        return span, distance, np.tile(self.rest, self.sections)

    def _tiled(self, values):
        return np.tile(values, self.sections)

    def _strain(self, chords):
        chord = np.linalg.norm(chords, axis=1)
        return chord, chord / self._tiled(self.length) - 1.0

    def energy(self, y):
        """Energy of all sections (J)."""
        _, strain = self._strain(self._chords(y))
        total = (self.yarn.law.energy_at(strain) * self._tiled(self.length)).sum()
        bent = _angle(*self._bends(y)) - self._tiled(self.angle)
        total += 0.5 * (self._tiled(self.bend) * bent**2).sum()
        span, distance, rest = self._pairs(y)
        return total + 0.5 * self.spring * ((distance - rest) ** 2 + span[:, 2] ** 2).sum()

    def energy_and_tension(self, y):
        """Energy (J) and its derivative by the length of all sections, the mean tension (N)."""
        chords = self._chords(y)
        chord, strain = self._strain(chords)
        along = (self.yarn.law.tension_at(strain) * chords[:, 2] / chord).sum()
        slopes, _ = self._bend_terms(y)
        along += slopes[:, [2, 5]].sum()
        return self.energy(y), along / self.sections

    def _bend_terms(self, y):
        """Gradient (k, 6) and Hessian (k, 6, 6) of the bending energy by the two chords."""
        a, b = self._bends(y)
        built, constant = self._tiled(self.angle), self._tiled(self.bend)
        la, lb = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        a, b = a / la[:, None], b / lb[:, None]
        phi = _angle(a, b)
        cos = (a * b).sum(axis=1)
        # Energy by c = cos phi; near 0 the series of phi/sin phi and its derivative.
        small = phi < 1e-3
        sine = np.where(small, 1.0, np.sin(phi))
        straight = np.where(small, 1.0 + phi**2 / 6.0, phi / sine)
        curved = np.where(small, 1.0 / 3.0, (1.0 - phi * np.cos(phi) / sine) / sine**2)
        tilted = built > 0.0
        sine = np.where(tilted, np.sin(np.maximum(phi, 1e-300)), 1.0)
        lever = np.where(tilted, built / sine, 0.0)
        by_c = -constant * (straight - lever)
        by_cc = constant * (curved + lever * np.cos(phi) / sine**2)
        # c by the chords a and b, and its second derivatives.
        one = np.eye(3)
        along_a = (b - cos[:, None] * a) / la[:, None]
        along_b = (a - cos[:, None] * b) / lb[:, None]
        c_first = np.concatenate([along_a, along_b], axis=1)
        outer = np.einsum
        c_second = np.empty((len(cos), 6, 6))
        for own, (u, v, length) in enumerate(((a, b, la), (b, a, lb))):
            mixed = outer("ki,kj->kij", u, v)
            block = cos[:, None, None] * (3.0 * outer("ki,kj->kij", u, u) - one)
            block -= mixed + mixed.transpose(0, 2, 1)
            part = slice(3 * own, 3 * own + 3)
            c_second[:, part, part] = block / length[:, None, None] ** 2
        cross = one - outer("ki,kj->kij", a, a) - outer("ki,kj->kij", b, b)
        cross = (cross + cos[:, None, None] * outer("ki,kj->kij", a, b)) / (la * lb)[:, None, None]
        c_second[:, :3, 3:] = cross
        c_second[:, 3:, :3] = cross.transpose(0, 2, 1)
        hessian = by_cc[:, None, None] * outer("ki,kj->kij", c_first, c_first)
        return by_c[:, None] * c_first, hessian + by_c[:, None, None] * c_second

    def _stretch_terms(self, y):
        chords = self._chords(y)
        chord, strain = self._strain(chords)
        tension = self.yarn.law.tension_at(strain)
        slope = self.yarn.law.stiffness_at(strain) / self._tiled(self.length)
        u = chords / chord[:, None]
        along = np.einsum("ki,kj->kij", u, u)
        across = (np.eye(3) - along) * (tension / chord)[:, None, None]
        return tension[:, None] * u, slope[:, None, None] * along + across

    def _pair_terms(self, y):
        span, distance, rest = self._pairs(y)
        u = span / distance[:, None]
        u[:, 2] = 0.0
        gradient = (distance - rest)[:, None] * u
        gradient[:, 2] = span[:, 2]
        along = np.einsum("ki,kj->kij", u, u)
        across = (np.diag([1.0, 1.0, 0.0]) - along) * (1.0 - rest / distance)[:, None, None]
        hessian = along + across
        hessian[:, 2, 2] = 1.0
        return self.spring * gradient, self.spring * hessian

    def gradient_and_hessian(self, y):
        """Gradient (3 n sections,), sparse Hessian and the largest force that balances (N)."""
        size = y.size
        gradient, force = np.zeros(size), 0.0
        hessian = csc_array((size, size))
        for terms, linear, unknowns in (
            (self._stretch_terms, self.chord_map, self.chord_unknowns),
            (self._bend_terms, self.bend_map, self.bend_unknowns),
            (self._pair_terms, self.pair_map, self.pair_unknowns),
        ):
            first, second = terms(y)
            first = first @ linear
            second = np.einsum("ai,kab,bj->kij", linear, second, linear, optimize=True)
            force = max(force, np.abs(first).max(initial=0.0))
            gradient += np.bincount(unknowns.ravel(), first.ravel(), size)
            width = unknowns.shape[1]
            rows = np.repeat(unknowns, width, axis=1).ravel()
            columns = np.tile(unknowns, (1, width)).ravel()
            hessian = hessian + coo_array((second.ravel(), (rows, columns)), (size, size)).tocsc()
        return gradient, hessian, force


def _angle(a, b):
    """Angle between the vectors a and b (k, 3), exact also where it is small."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


def _newton(problem, y):
    free = np.setdiff1d(np.arange(y.size), problem.held)
    energy = problem.energy(y)
    for iteration in range(ITERATIONS):
        gradient, hessian, force = problem.gradient_and_hessian(y)
        slope = gradient[free]
        if np.abs(slope).max() <= 1e-12 * force:
            return y, iteration
        step = np.zeros(y.size)
        step[free] = _descent(hessian[free][:, free], slope)
        share, falls = 1.0, float(slope @ step[free])
        while True:
            trial = y + share * step.reshape(y.shape)
            new = problem.energy(trial)
            # Close to the equilibrium the energy differs by its rounding error only.
            if new <= energy + 1e-4 * share * falls or abs(new - energy) <= 1e-13 * abs(energy):
                break
            share *= 0.5
            if share < 1e-12:
                raise ComputationError(f"{problem.yarn.where}: no descent from {energy:g} J")
        y, energy = trial, new
        if np.abs(step).max() <= 1e-13 * problem.yarn.layout.diameter:
            return y, iteration + 1
    raise ComputationError(
        f"{problem.yarn.where}: no equilibrium of {problem.sections} sections in {ITERATIONS} "
        f"iterations; residual {np.abs(slope).max():.3g} N of {force:.3g} N"
    )


def _descent(hessian, gradient):
    """Newton's step; the diagonal is raised until all pivots are positive."""
    largest, raised = np.abs(hessian.diagonal()).max(), 0.0
    while True:
        shifted = (hessian + raised * largest * eye_array(len(gradient))).tocsc()
        try:
            factor = splu(
                shifted, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
            if (factor.U.diagonal() > 0).all():
                return factor.solve(-gradient)
        except RuntimeError:  # an exact zero pivot
            pass
        raised = max(1e-8, 10.0 * raised)
        if not raised < 1e8:
            raise ComputationError("the Hessian of the yarn of many sections is not finite")

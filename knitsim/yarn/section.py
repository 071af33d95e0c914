"""The simulated yarn of the paper (section 2, Figs 1, 2), reduced to one of its sections.

Sections of mass points, one a fibre, stand ``spacing`` apart along the axis.  Tension springs join
a fibre's points in neighbouring sections, bending springs three successive ones, further springs
hold the section together.  Twist, eq (1), makes each section the image M x of the one before; ends
do not untwist.  As all sections of a uniform yarn are images of one, that one is solved: its
unknowns are the in-section positions.  :mod:`knitsim.yarn.many_sections` shows that nothing is
lost.

>>> from knitsim.yarn.law import bilinear
>>> from knitsim.yarn.packing import pack
>>> fibre = bilinear(6.34, 2.41, 0.02, 0.08)
>>> yarn = SimulatedYarn(pack(72, 0.25e-3), fibre, spacing=0.1e-3, twist=200.0)
>>> test = tensile_test(yarn, 0.05, steps=50, velocity=0.005, gauge_length=0.25)
>>> round(float(test.tension[50]), 2), round(test.residual_strain, 4)
(14.15, 0.0185)
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from knitsim.errors import ComputationError, InputError
from knitsim.yarn import section_kernels
from knitsim.yarn.bracing import section_springs
from knitsim.yarn.packing import check_length
from knitsim.yarn.section_kernels import ANGLE, BEND, LARGEST, LENGTH
from knitsim.yarn.simulated_yarn import SimulatedYarn, fibre_path, turn_matrix

__all__ = [
    "SectionProblem",
    "SectionState",
    "SimulatedYarn",
    "TensileTest",
    "fibre_path",
    "section_springs",
    "solve_section",
    "tangent_stiffness",
    "tensile_test",
    "turn_matrix",
]


class SectionProblem:
    """The arrays of :mod:`knitsim.yarn.section_kernels` for one yarn.

    Fibres are renumbered so that springs join near numbers (a narrow band); ``order[k]`` is the
    layout's number of fibre k.  ``fibres`` carries the plastic state, which :meth:`yield_` changes.
    """

    def __init__(self, yarn):
        self.yarn = yarn
        spacing, positions = yarn.spacing, yarn.layout.positions
        pairs = section_springs(positions) if yarn.deformable else np.empty((0, 2), np.int64)
        self.order = _narrow_order(pairs, len(positions))
        rank = np.argsort(self.order)
        self.ends = rank[pairs].astype(np.int64)
        self.built = np.ascontiguousarray(positions[self.order])
        self.springs = np.empty((len(pairs), 2))
        span = self.built[self.ends[:, 0]] - self.built[self.ends[:, 1]]
        self.springs[:, 0] = np.hypot(span[:, 0], span[:, 1])
        # A rigid section has no springs: nothing moves.
        self.springs[:, 1] = yarn.section_stiffness * spacing if len(pairs) else 0.0
        law = yarn.law
        self.law = np.stack([law.strain, law.tension, law.energy_at_vertices])

        change = yarn.turn - np.eye(2)
        form = change.T @ change
        # The eigenvalues of Q: both the same for a rotation, 0 and 4 for a reflection.
        kappa = float(np.linalg.eigvalsh(form)[1])
        self.turn = np.array([form[0, 0], form[0, 1], form[1, 1], kappa])
        q = np.maximum(np.einsum("ia,ab,ib->i", self.built, form, self.built), 0.0)
        self.fibres = np.empty((len(positions), 4))
        chord = self.fibres[:, LENGTH] = np.sqrt(spacing**2 + q)
        angle = 2.0 * np.arcsin(np.sqrt(0.25 * kappa * q) / chord)
        # A fibre within rounding of the axis is straight.
        self.fibres[:, ANGLE] = np.where(angle > 1e-9, angle, 0.0)
        self.fibres[:, BEND] = yarn.bending_rigidity / chord + yarn.bending_constant * spacing
        self.fibres[:, LARGEST] = 0.0 if law.plastic else -math.inf
        self.held = self._held_unknown()

    def _held_unknown(self):
        """The unknown that fixes the neutral motion, see section_kernels.equilibrium."""
        if self.yarn.twist_form == "corrected":
            # The section turns freely: hold the fibre farthest along the first axis sideways.
            return 2 * int(np.argmax(np.abs(self.built[:, 0]))) + 1
        half = math.pi * self.yarn.twist * self.yarn.spacing
        return 0 if abs(math.cos(half)) >= abs(math.sin(half)) else 1

    def solve(self, x, strain):
        """Move x (n, 2) to the equilibrium at the axial strain; returns Newton's iterations."""
        if not self.yarn.deformable:
            return 0
        spacing = self.yarn.spacing * (1.0 + strain)
        iterations = section_kernels.equilibrium(
            x, spacing, self.turn, self.fibres, self.law, self.ends, self.springs, self.held
        )
        if iterations < 0:
            raise ComputationError(
                f"{self.yarn.where}: no equilibrium of the section found at strain {strain:g}; its "
                f"springs ({self.yarn.section_stiffness:g} Pa) may be too soft for the yarn's twist"
            )
        return iterations

    def states(self, x, strain):
        """Per fibre (n, 5), columns as section_kernels.fibre_states."""
        out = np.empty((len(x), 5))
        section_kernels.fibre_states(
            x, self.yarn.spacing * (1.0 + strain), self.turn, self.fibres, self.law, out
        )
        return out

    def yield_(self, states):
        """Take over the strains of ``states`` as seen by the fibres."""
        if self.yarn.law.plastic:
            np.maximum(self.fibres[:, LARGEST], states[:, 0], out=self.fibres[:, LARGEST])

    def measure(self, x, strain):
        """SectionState at x."""
        states = self.states(x, strain)
        spacing, law = self.yarn.spacing, self.yarn.law
        stored = states[:, 2]
        if law.plastic:
            stored = states[:, 1] ** 2 / (2.0 * law.initial_stiffness) * self.fibres[:, LENGTH]
        span = x[self.ends[:, 0]] - x[self.ends[:, 1]]
        stretched = np.hypot(span[:, 0], span[:, 1]) - self.springs[:, 0]
        radius = _mean_radius(self.built)
        unsorted = np.empty_like(self.order)
        unsorted[self.order] = np.arange(len(x))
        return SectionState(
            strain=strain,
            positions=x[unsorted],
            tension=float(states[:, 4].sum()),
            stretch_energy=float(stored.sum() / spacing),
            bending_energy=float(states[:, 3].sum() / spacing),
            section_energy=float(0.5 * (self.springs[:, 1] * stretched**2).sum() / spacing),
            plastic_energy=float((states[:, 2] - stored).sum() / spacing),
            radius_ratio=_mean_radius(x) / radius if radius > 0 else 1.0,
            fibre_strain=states[unsorted, 0],
            fibre_tension=states[unsorted, 1],
        )


@dataclass(frozen=True, eq=False)
class SectionState:
    """A yarn at one axial strain.

    positions: (n, 2) fibre centres (m).  tension: of the yarn (N), the derivative of its energy per
    reference length by the strain.  Energies per metre of unstrained yarn (J/m): stored in the
    stretch of fibres, their bending and the springs of the section; plastic_energy is dissipated.
    radius_ratio: mean distance of fibres from their centroid, over that as built (1 for one fibre).
    fibre_strain, fibre_tension (N): shape (n,).
    """

    strain: float
    positions: np.ndarray
    tension: float
    stretch_energy: float
    bending_energy: float
    section_energy: float
    plastic_energy: float
    radius_ratio: float
    fibre_strain: np.ndarray
    fibre_tension: np.ndarray


def solve_section(yarn, strain):
    """SectionState of ``yarn`` strained once from its built state to ``strain`` (above -1)."""
    if not -1 < strain < math.inf:
        raise InputError("strain", strain, "must be finite and above -1")
    problem = SectionProblem(yarn)
    x = problem.built.copy()
    problem.solve(x, strain)
    return problem.measure(x, strain)


def tangent_stiffness(yarn, strain_step=1e-5):
    """dT/dstrain (N) at zero strain, by a central difference (second order in the step)."""
    ahead, back = (solve_section(yarn, sign * strain_step).tension for sign in (1.0, -1.0))
    return (ahead - back) / (2.0 * strain_step)


@dataclass(frozen=True, eq=False)
class TensileTest:
    """A tensile test, one entry for each of its points: shape (points,).

    Loading from 0 to the largest strain, then recovery to zero force; the turning point stands
    twice, as the last of the loading and the first of the recovery: friction changes sign there.
    tension (N): of the machine, fibres and friction.  friction (N): c v loading, -c v in recovery.
    Energies (J per metre of unstrained yarn) as SectionState; plastic_energy and friction_energy
    are dissipated, work is done by the machine (trapezoidal rule over the points).
    time (s).  beyond_break: whether a fibre is strained beyond its breaking strain.
    sections: (points, n, 2), m.  iterations: of Newton's method, 0 where nothing had to be solved.
    """

    strain: np.ndarray
    loading: np.ndarray
    time: np.ndarray
    tension: np.ndarray
    friction: np.ndarray
    stretch_energy: np.ndarray
    bending_energy: np.ndarray
    section_energy: np.ndarray
    plastic_energy: np.ndarray
    friction_energy: np.ndarray
    work: np.ndarray
    radius_ratio: np.ndarray
    beyond_break: np.ndarray
    iterations: np.ndarray
    sections: np.ndarray = field(repr=False)

    @property
    def residual_strain(self):
        """Strain at the end of the test: where the tension is zero again after recovery."""
        return float(self.strain[-1])


def tensile_test(
    yarn, max_strain, steps, velocity, gauge_length, friction_coefficient=0.0, recovery=True
):
    """Pull ``yarn`` to ``max_strain`` in ``steps`` equal steps, then let it back to zero force.

    velocity: of the clamp (m/s), gauge_length: between the clamps (m).  friction_coefficient: c of
    the paper's F = c v (N s/m).  Quasi-static: inertia is left out.  Recovery takes ``steps`` equal
    steps too, at the same velocity.

    Returns TensileTest; raises InputError for a value out of range and ComputationError where there
    is no equilibrium, or where friction alone exceeds the tension at ``max_strain``.
    """
    for name, value in (
        ("max_strain", max_strain),
        ("velocity", velocity),
        ("gauge_length", gauge_length),
    ):
        check_length(value, name)
    if not (steps == int(steps) and steps >= 1):
        raise InputError("steps", steps, "must be a whole number above 0")
    if not 0 <= friction_coefficient < math.inf:
        raise InputError(
            "friction_coefficient", friction_coefficient, "must be finite and not below 0"
        )
    friction = friction_coefficient * velocity

    problem = SectionProblem(yarn)
    x = problem.built.copy()
    points, iterations = [], []

    def go_to(strain):
        iterations.append(problem.solve(x, strain))
        points.append(problem.measure(x, strain))
        problem.yield_(problem.states(x, strain))

    strains = max_strain * np.arange(steps + 1) / steps
    for strain in strains:
        go_to(strain)
    if recovery:
        at_turn = points[-1].tension
        if not at_turn > friction:
            raise ComputationError(
                f"{yarn.where}: friction c v = {friction:g} N is not below the tension "
                f"{at_turn:g} N at strain {max_strain:g}, so nothing recovers"
            )
        points.append(points[-1])
        iterations.append(0)
        strain = max_strain
        end = _zero_force(problem, x, strain, max_strain, friction)
        for k in range(1, steps):
            strain = max_strain + (end - max_strain) * k / steps
            go_to(strain)
        # A soft section may arrive in another state than straight from the turn: end from here.
        go_to(_zero_force(problem, x, strain, max_strain, friction))
    return _collect(points, iterations, steps, friction, gauge_length / velocity, yarn)


def _zero_force(problem, x, start, max_strain, friction):
    """Strain in recovery at which the tension less friction is zero; x: equilibrium at ``start``.

    Secants, the first with the unstretched yarn's slope, kept inside the bracket found so far:
    pushed well beyond the slack yarn, fibres would buckle.
    """

    def force(strain):
        trial = x.copy()
        problem.solve(trial, strain)
        return problem.states(trial, strain)[:, 4].sum() - friction

    slope = problem.yarn.law.initial_stiffness * len(x)
    if friction == 0 and not problem.yarn.law.plastic:
        # An elastic yarn is slack as built, unless a soft section has taken on another shape.
        if abs(force(0.0)) <= 1e-10 * slope * max_strain:
            return 0.0
    low, high = -math.inf, max_strain
    least = 1e-14 * slope * max_strain
    strain, left = start, force(start)
    for _ in range(100):
        low, high = (low, strain) if left > 0 else (strain, high)
        guess = max(0.0, strain - left / slope)
        if not low < guess < high:
            guess = 0.5 * (max(low, 0.0) + high)
        value = force(guess)
        slack = abs(value) <= least or (guess == 0.0 and value > 0)
        if slack or abs(guess - strain) <= 1e-15 * max_strain:
            return guess
        if value != left:
            slope = (value - left) / (guess - strain)
        strain, left = guess, value
    raise ComputationError(f"{problem.yarn.where}: no strain of zero force found in recovery")


def _collect(points, iterations, steps, friction, time_per_strain, yarn):
    strain = np.array([p.strain for p in points])
    loading = np.arange(len(points)) <= steps
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(strain)))])
    friction = np.where(loading, friction, -friction)
    tension = np.array([p.tension for p in points]) + friction
    work = np.cumsum(0.5 * (tension[1:] + tension[:-1]) * np.diff(strain))
    energies = ("stretch_energy", "bending_energy", "section_energy", "plastic_energy")
    return TensileTest(
        strain=strain,
        loading=loading,
        time=path * time_per_strain,
        tension=tension,
        friction=friction,
        **{name: np.array([getattr(p, name) for p in points]) for name in energies},
        friction_energy=np.abs(friction) * path,
        work=np.concatenate([[0.0], work]),
        radius_ratio=np.array([p.radius_ratio for p in points]),
        # A rounding error beyond it is not.
        beyond_break=np.array([p.fibre_strain.max() for p in points])
        > yarn.law.breaking_strain * (1 + 1e-9),
        iterations=np.array(iterations),
        sections=np.array([p.positions for p in points]),
    )


def _narrow_order(pairs, count):
    if not len(pairs):
        return np.arange(count)
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count)).tocsr()
    return reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True)


def _mean_radius(x):
    return float(np.hypot(*(x - x.mean(axis=0)).T).mean())

"""What a test of a fabric gives: one row for every asked state, and why it ended."""

import functools
from dataclasses import dataclass, field, replace

import numpy as np

from knitsim.equilibrium.cell import placed
from knitsim.equilibrium.kernels.yarn import stretch_at
from knitsim.equilibrium.model import Model, centrelines
from knitsim.equilibrium.relax import Relaxed, is_intact
from knitsim.loop.repeat import rolled

LOADING, RECOVERY = 0, 1
DIRECTIONS = {"course": 0, "wale": 1}


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class States:
    """States of a test, in the order visited; arrays of shape (steps,) unless said.

    Names, units and signs follow the result store: SI, strains from the relaxed state, energies per
    loop.  phase: 0 loading, 1 recovery; cycle: from 1; segment: number of the turning point that was
    walked towards, from 0.  energy (steps, 4): stretch, bend, contact, and what friction holds without
    sliding; work, dissipated (J): cumulative.  min_distance: diameters, NaN where nothing is near;
    residual (N); iterations of Newton's method and increments since the last row.  start: the fabric at
    rest that the test began with.  y (steps, unknowns):
    the states themselves.  memory: what friction remembers at the end.  stop_reason: not empty where a
    test ends early; it then has fewer rows; ended: the status of the solver that says so.  increment:
    largest change, of what is asked for, in one solved step with friction; NaN without.
    numerical_error (1): estimated error of the force or moment over max(|it|, 1 % of the largest); NaN
    where it was not asked for or not found.
    """

    model: Model
    start: Relaxed
    phase: np.ndarray
    cycle: np.ndarray
    segment: np.ndarray
    energy: np.ndarray
    work: np.ndarray
    dissipated: np.ndarray
    min_distance: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    increments: np.ndarray
    y: np.ndarray
    memory: tuple = field(default=(), repr=False)
    stop_reason: str = ""
    ended: int = 0
    increment: float = np.nan
    numerical_error: np.ndarray

    @property
    def steps(self):
        return len(self.y)

    @property
    def wale_spacing(self):
        return self.y[:, self.model.lattice]

    @property
    def course_spacing(self):
        return self.y[:, self.model.lattice + 3]

    @functools.cached_property
    def crossings_intact(self):
        """Crossings of each state as in plain knit, read again on the whole loop, (steps,) bool.

        A state that the solver's own check refuses is never in a curve; this is a second reading by
        other code (:mod:`knitsim.loop.lattice`).
        """
        return np.array([is_intact(self.model, y) for y in self.y], dtype=bool)

    @property
    def centrelines(self):
        """Points of every loop of the cell in every state, (steps, loops, points, 3), m."""
        return np.array([centrelines(self.model, y) for y in self.y])

    @property
    def centreline(self):
        """Points of the first loop in every state, (steps, points, 3), m."""
        return self.centrelines[:, 0]

    @property
    def yarn_strain(self):
        """Mean strain of the yarn over the cell."""
        return self._yarn[0]

    @property
    def yarn_tension(self):
        """Mean tension of the yarn over the cell (N)."""
        return self._yarn[1]

    @functools.cached_property
    def _yarn(self):
        rod, stretch = self.model.scene.rod, self.model.scene.stretch
        parts = rod.weight / rod.weight.sum()
        strain, tension = np.empty(self.steps), np.empty(self.steps)
        for i, y in enumerate(self.y):
            x = placed(self.model.cell.map, y)[rod.first[:, None] + np.arange(4)]
            along, place = (np.einsum("ma,mak->mk", d, x) for d in (rod.d1, rod.d0))
            along[:, self._bent[0]] *= 1.0 + self._bent[1][i] * place[:, 2]
            e = np.linalg.norm(along, axis=1) / rod.span - 1.0
            strain[i] = parts @ e
            tension[i] = parts @ [stretch_at(one, stretch)[1] for one in e]
        return strain, tension

    @property
    def _bent(self):
        """Direction that is curved, and the curvature (1/m) of each state."""
        return 0, np.zeros(self.steps)

    def replaced(self, **changes):
        """These states with other values of some fields."""
        return replace(self, **changes)

    def _told(self, what, reached):
        ended = f"; ended early: {self.stop_reason}" if self.stop_reason else ""
        return f"<{what}: {self.steps} states, {reached}{ended}>"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Curve(States):
    """A test in the plane of the fabric.

    test: "course", "wale", "biaxial" or "shear"; strain: engineering strain along the pull, in shear the
    angle (rad), for biaxial tests that along the course; wale_strain likewise along the wale.
    force_per_loop (N): derivative of one loop's energy by the spacing pulled; force_per_width (N/m): that
    over the transverse spacing of the relaxed state.  forces (steps, 4): derivatives by all lattice
    entries (N).  status: 0 for a state that was reached.  driven, free: lattice entries that were
    prescribed and left to equilibrium; load (4,): dead load on them (N per loop).
    """

    test: str
    strain: np.ndarray
    wale_strain: np.ndarray
    force_per_loop: np.ndarray
    force_per_width: np.ndarray
    forces: np.ndarray
    status: np.ndarray
    driven: int
    free: tuple
    load: np.ndarray

    def __repr__(self):
        most = np.argmax(np.abs(self.force_per_width)) if self.steps else 0
        largest = f"{self.force_per_width[most]:.4g} N/m at {self.strain[most]:.3g}"
        return self._told(f"{self.test} test", f"largest force {largest}")

    @property
    def value(self):
        """What the test measures, for error estimates: the force per loop (N)."""
        return self.force_per_loop

    @property
    def place(self):
        """Where: the strain along the pull (1)."""
        return self.strain

    @property
    def transverse_strain(self):
        """Strain across the pull, from the relaxed state."""
        if self.test == "course":
            return self.course_spacing / self.start.course_spacing - 1.0
        return self.wale_spacing / self.start.wale_spacing - 1.0


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class BendingCurve(States):
    """A bending test.

    Spacings are those in the mean plane, centre lines those of the loop before it is rolled up.
    direction: that which becomes curved; spacings: "free" or "held"; width (m): transverse spacing at
    rest.  curvature (1/m); phase: 0 where it grows in size; cycle: a new one where the curvature sets out
    to the side of the first again; moment_per_width (N); flat_moment (N, one number): moment per width
    of the flat fabric at rest.  change_error (1): estimated error of the moment's change from
    flat_moment, over the largest change; NaN where not asked for.
    """

    direction: str
    spacings: str
    width: float
    flat_moment: float
    curvature: np.ndarray
    moment_per_width: np.ndarray
    change_error: np.ndarray

    def __repr__(self):
        return self._told(f"{self.direction} bending", f"flat {1e3 * self.flat_moment:.4g} mN")

    @property
    def value(self):
        """What the test measures, for error estimates: the moment per width (N)."""
        return self.moment_per_width

    @property
    def place(self):
        """Where: the curvature (1/m)."""
        return self.curvature

    @property
    def _bent(self):
        return DIRECTIONS[self.direction], self.curvature

    def centrelines_bent(self, step, wales=0, courses=0):
        """Points in space (loops, points, 3) of the cell this many wales and courses on, in one state.

        The axis of the cylinder lies at thickness -1/curvature over the origin.
        """
        bent = DIRECTIONS[self.direction]
        points = centrelines(self.model, self.y[step])
        points[..., 0] += wales * self.wale_spacing[step]
        points[..., 1] += courses * self.course_spacing[step]
        along = points[..., bent].copy()
        points[..., bent] = 0.0
        return rolled(points, self.curvature[step], along, bent)

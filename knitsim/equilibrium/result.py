"""What a test of a fabric gives: one row for every asked state, and why it ended."""

import functools
from dataclasses import dataclass, replace

import numpy as np

from knitsim.equilibrium.cell import control_points
from knitsim.equilibrium.kernels.yarn import stretch_at
from knitsim.equilibrium.model import Model, centrelines
from knitsim.equilibrium.relax import is_intact

LOADING, RECOVERY = 0, 1


class States:
    """What the states y (steps, unknowns) of any test of a model say about the fabric."""

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

    def replaced(self, **changes):
        """This curve with other values of some fields."""
        return replace(self, **changes)


@dataclass(frozen=True, eq=False)
class Curve(States):
    """States of a test, in the order visited; arrays of shape (steps,) unless said.

    Names, units and signs follow the result store: SI, strains from the relaxed state, energies per
    loop.  test: "course", "wale", "biaxial" or "shear"; strain: engineering strain along the pull,
    in shear the angle (rad), for biaxial tests that along the course; wale_strain likewise along the
    wale.  phase: 0 loading, 1 recovery; cycle: from 1.  force_per_loop (N): derivative of one
    loop's energy by the spacing pulled; force_per_width (N/m): that over the transverse spacing of
    the relaxed state.  forces (steps, 4): derivatives by all lattice entries (N).  energy (steps, 3):
    stretch, bend, contact.  work, dissipated (J): cumulative.  y (steps, unknowns): the states
    themselves.  status: 0 for a state that was reached; a curve that ends early has fewer rows and
    a stop_reason that is not empty.  numerical_error (1): estimated error of the force over
    max(|force|, 1 % of the largest); NaN where it was not asked for.
    """

    model: Model
    test: str
    strain: np.ndarray
    wale_strain: np.ndarray
    phase: np.ndarray
    cycle: np.ndarray
    force_per_loop: np.ndarray
    force_per_width: np.ndarray
    forces: np.ndarray
    energy: np.ndarray
    work: np.ndarray
    dissipated: np.ndarray
    min_distance: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    status: np.ndarray
    y: np.ndarray
    driven: int
    free: tuple
    load: np.ndarray
    stop_reason: str
    numerical_error: np.ndarray

    @property
    def yarn_strain(self):
        """Mean strain of the yarn over the loop."""
        return self._yarn[0]

    @property
    def yarn_tension(self):
        """Mean tension of the yarn over the loop (N)."""
        return self._yarn[1]

    @functools.cached_property
    def _yarn(self):
        rod = self.model.scene.rod
        parts = rod.weight / rod.weight.sum()
        strain, tension = np.empty(self.steps), np.empty(self.steps)
        for i, y in enumerate(self.y):
            x = control_points(self.model.cell, y)[rod.first[:, None] + np.arange(4)]
            e = np.linalg.norm(np.einsum("ma,mak->mk", rod.d1, x), axis=1) / rod.span - 1.0
            strain[i] = parts @ e
            tension[i] = parts @ [stretch_at(one, self.model.scene.stretch)[1] for one in e]
        return strain, tension

    def transverse_strain(self, relaxed):
        """Strain across the pull, from the relaxed state."""
        if self.test == "course":
            return self.course_spacing / relaxed.course_spacing - 1.0
        return self.wale_spacing / relaxed.wale_spacing - 1.0

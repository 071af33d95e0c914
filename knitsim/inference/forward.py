"""What the model says of a fabric's tests, as one row of numbers for each set of inputs.

Strain along and across the pull at given forces per width, along course and wale, on first loading from
the fabric at rest, and the spacings at rest.  With friction the path is that: a fabric that lay slack and
was never pulled before.
"""

from dataclasses import dataclass, replace

import numpy as np

from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.errors import ComputationError, InputError
from knitsim.inference.continuation import States, common_resolution
from knitsim.inference.emulator import told
from knitsim.inference.inputs import fabric_at
from knitsim.inference.trials import Pull, strains_for
from knitsim.measured.test import from_pretension

QUANTITIES = ("strain", "lateral_strain")
SMALLEST = 0.01  # strain of the first solved state, about
INCREMENT = 0.05  # of strain, with friction
POINTS = 40
STEP = 0.5  # standard deviations, of differences
DENSER = (1, 2)  # contact points, where yarns are pressed closer together than the fewer can tell
_FAILURES = (ComputationError, InputError)


@dataclass(frozen=True)
class Place:
    """One number of a row: test ("course", "wale" or "rest"), quantity ("strain", "lateral_strain", or
    "wale_spacing", "course_spacing" of the fabric at rest), at: force per width (N/m), 0 at rest."""

    test: str
    quantity: str
    at: float


def places_of(forces):
    """All places of a row; forces: {"course" or "wale": (n,) N/m, rising}."""
    rest = [Place("rest", f"{name}_spacing", 0.0) for name in ("wale", "course")]
    return tuple(rest) + tuple(
        Place(test, quantity, float(force))
        for test, own in forces.items() for quantity in QUANTITIES for force in own
    )  # fmt: skip


class Forward:
    """The model as a function of the standard normal numbers of its uncertain inputs.

    fabric: with all other inputs; inputs: :class:`knitsim.inference.inputs.Input`; forces: {direction:
    (n,) N/m}; resolution: of all; pretension: {direction: N/m} from which strain counts, from rest
    without; states: solved ones up to the strain ``even``; increment: of strain, with friction.
    Rows do not depend on the order in which they are asked for.
    """

    def __init__(
        self, fabric, inputs, forces, resolution=None, *, pretension=None, states=12, even=None,
        increment=INCREMENT,
    ):  # fmt: skip
        self.fabric, self.inputs = fabric, tuple(inputs)
        self.forces = {name: np.asarray(own, dtype=float) for name, own in forces.items()}
        self.places, self.pretension = places_of(self.forces), pretension or {}
        self.states_count, self.increment = states, increment
        self.even = {"course": 0.5, "wale": 0.3} | (even or {})
        self.resolution = common_resolution(self._corners(), resolution or Resolution(POINTS))
        self.bases = {}

    def _corners(self):
        """Fabrics at two standard deviations of each input, for contact points that suit all."""
        found = [self.fabric]
        for k in range(len(self.inputs)):
            for way in (-2.0, 2.0):
                z = np.zeros(len(self.inputs))
                z[k] = way
                try:
                    found.append(fabric_at(self.fabric, self.inputs, z))
                except InputError:
                    continue
        return found

    def rest(self, z, denser=1):
        """The fabric at rest at z (inputs,), a knitsim.inference.continuation.Rest; denser: how many
        times as many contact points."""
        states = States(replace(self.resolution, contacts=denser * self.resolution.contacts))
        if denser not in self.bases:
            states.rest(fabric_at(self.fabric, self.inputs, np.zeros(len(self.inputs))))
            self.bases[denser] = states.last
        states.last = self.bases[denser]
        return states.rest(fabric_at(self.fabric, self.inputs, z))

    def row(self, z):
        """(Values (places,), "") or (None, why not) at z (inputs,); NaN at forces that are not reached."""
        for denser in DENSER:
            values, why = self._row(np.asarray(z, dtype=float), denser)
            if values is not None:
                break
        return values, why

    def _row(self, z, denser):
        try:
            rest = self.rest(z, denser).relaxed
            values = [rest.wale_spacing, rest.course_spacing]
            for direction, forces in self.forces.items():
                values.extend(self._pulled(rest, direction, forces))
        except _FAILURES as error:
            return None, str(error)
        return np.array(values), ""

    def _pulled(self, rest, direction, forces):
        curve = tensile(
            rest, direction, strains_for(SMALLEST, self.even[direction], self.states_count),
            to_force=float(forces[-1]), increment=self.increment,
        )  # fmt: skip
        pulled = Pull(
            curve, rest, np.append(0.0, curve.strain), np.append(0.0, curve.force_per_width),
            np.append(0, curve.phase),
        )  # fmt: skip
        strain = pulled.strain_at(np.append(forces, self.pretension.get(direction, 0.0)))
        across = np.interp(strain, pulled.strain, np.append(0.0, curve.transverse_strain))
        return np.concatenate([from_pretension(own[:-1], own[-1]) for own in (strain, across)])


class Linearised:
    """The model about one z (inputs,), told in the scale of comparison: row(z) + J (z - z0).

    J from differences of solved rows, one for each input, STEP standard deviations towards the middle of
    its distribution.  covariance: of its own errors; none, the rows themselves are solved.  Raises
    ComputationError where the row at z has no equilibrium or does not reach all forces.
    """

    def __init__(self, forward, z):
        self.inputs, self.places, self.z = forward.inputs, forward.places, np.array(z, dtype=float)
        self.row, self.solved = self._told(forward, self.z, needed=True), 1
        self.jacobian = np.zeros((len(self.places), len(self.z)))
        for k in range(len(self.z)):
            way = -STEP if self.z[k] > 0.0 else STEP
            for step in (way, -way):
                moved = self.z.copy()
                moved[k] += step
                other = self._told(forward, moved)
                self.solved += 1
                if other is not None and np.isfinite(other).all():
                    self.jacobian[:, k] = (other - self.row) / step
                    break
        self.covariance = np.zeros((len(self.places),) * 2)

    def _told(self, forward, z, needed=False):
        row, why = forward.row(z)
        if row is None or not np.isfinite(row).all():
            if needed:
                raise ComputationError(f"no row to begin from: {why or 'a force was not reached'}")
            return None
        return told(self.places, row)

    def rows(self, z):
        """Rows (n, places) at z (n, inputs)."""
        return self.row + (np.atleast_2d(z) - self.z) @ self.jacobian.T

    def slopes(self, z):
        """Derivatives (places, inputs)."""
        return self.jacobian

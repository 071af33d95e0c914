"""What the judge is told of a fabric: yarn, contact law, pattern; its own splines and tension law.

Nothing here is shared with the solver.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Barrier:
    """Contact energy K (1 - x^2)^2/x^2 per length squared, x = distance/diameter; K in N/m."""

    stiffness: float
    core = 0.0

    def at(self, distance, diameter):
        """Energy v (N/m) and force -dv/dD (N/m2) at distances below the diameter."""
        x = distance / diameter
        a = 1.0 / x - x
        return self.stiffness * a**2, 2.0 * self.stiffness * a * (1.0 / x**2 + 1.0) / diameter


@dataclass(frozen=True)
class Core:
    """A stiff core in a soft shell: with z = (D - core)/delta, delta = diameter - core (m),

    v = k delta^2/(p (p-1)) [z^(1-p) - 1 - (p-1)(1-z)] per length squared; k in N/m3.
    """

    core: float
    stiffness: float
    exponent: float

    def at(self, distance, diameter):
        """As :meth:`Barrier.at`; infinite inside the core."""
        delta, p = diameter - self.core, self.exponent
        z = np.maximum((distance - self.core) / delta, 0.0)
        with np.errstate(divide="ignore"):
            power = z ** (1.0 - p)
            force = self.stiffness * delta / p * (z**-p - 1.0)
        v = self.stiffness * delta**2 / (p * (p - 1.0)) * (power - 1.0 - (p - 1.0) * (1.0 - z))
        return v, force


@dataclass(frozen=True, eq=False)
class Given:
    """What a fabric is made of (SI), and how finely it was solved.

    law_strain, law_tension: vertices of the yarn's tension law, from (0, 0), without jumps; contact:
    Barrier, Core or any other with ``core`` and ``at``; friction: Coulomb's coefficient; points,
    contacts: control and contact points per loop of the solution under judgement; wales, courses:
    loops in its cell.  pattern: the stitches, k or p, rows from the bottom up, repeated over the cell.
    set_fraction: rest curvature over that of the cell held flat; held: (its centre lines
    (courses, m + 1, 3), its lattice (4,)).  bending_hysteresis: couple (N m) by which the yarn's moment lags.
    tangential_ratio: stiffness of a contact across its normal over that along it where it first
    touches; stuck_ratio: of the yarn's stiffness before its fibres slide over its bending rigidity.
    """

    loop_length: float
    diameter: float
    bending_rigidity: float
    law_strain: tuple
    law_tension: tuple
    contact: Barrier | Core
    friction: float
    points: int
    contacts: int
    wales: int = 1
    courses: int = 1
    pattern: tuple = ("k",)
    set_fraction: float = 0.0
    held: tuple | None = None
    bending_hysteresis: float = 0.0
    tangential_ratio: float = 1.0
    stuck_ratio: float = 20.0

    @property
    def rubs(self):
        return self.friction > 0.0 or self.bending_hysteresis > 0.0


def control_of(knots, step):
    """Control points (n, 3) of the cubic spline with r(i) = knots[i], r(i + n) = r(i) + step (3,)."""
    n = len(knots)
    matrix = (4.0 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)) / 6.0
    matrix[0, -1] = matrix[-1, 0] = 1.0 / 6.0
    right = np.array(knots, dtype=float)
    # The two rows that reach round the end take a control point one period away.
    right[0] += np.asarray(step) / 6.0
    right[-1] -= np.asarray(step) / 6.0
    return np.linalg.solve(matrix, right)


def controls_of(lines, lattice, wales):
    """Control points (yarns, spans, 3) of centre lines (yarns, m + 1, 3) of a cell, two samples per span."""
    step = wales * np.append(lattice[:2], 0.0)
    return np.array([control_of(line[:-1:2], step) for line in lines])


def design(points, u, derivative=0):
    """(matrix (m, points), turns (m,)): r(u) = matrix @ control + turns step; or a derivative."""
    u = np.asarray(u, dtype=float)
    span = np.floor(u).astype(int)
    t = u - span
    if derivative == 0:
        weights = [(1 - t) ** 3 / 6, 2 / 3 - t**2 + t**3 / 2, None, t**3 / 6]
        weights[2] = 1.0 - weights[0] - weights[1] - weights[3]
    elif derivative == 1:
        weights = [-((1 - t) ** 2) / 2, 1.5 * t**2 - 2 * t, None, t**2 / 2]
        weights[2] = -(weights[0] + weights[1] + weights[3])
    else:
        weights = [1 - t, 3 * t - 2, 1 - 3 * t, t]
    matrix, turns = np.zeros((len(u), points)), np.zeros(len(u))
    rows = np.arange(len(u))
    for k, weight in enumerate(weights):
        turn, column = np.divmod(span + k - 1, points)
        matrix[rows, column] += weight
        turns += weight * turn
    return matrix, turns


def law_energy(strain, given, rounding):
    """Energy per length at strains; kinks rounded over +-rounding (0: as given)."""
    at, tension = np.array(given.law_strain), np.array(given.law_tension)
    slopes = np.diff(tension) / np.diff(at)
    gaps = np.diff(np.concatenate([at[:-1], [np.inf]]))
    energy = 0.5 * slopes[0] * strain**2
    for k in range(1, len(slopes)):
        half = min(rounding, 0.5 * gaps[k - 1], 0.5 * gaps[k])
        x, rise = strain - at[k], slopes[k] - slopes[k - 1]
        # Inside, the stiffness grows linearly with x + half; beyond, it is the new slope.
        if half > 0.0:
            inside = np.where(x > -half, np.where(x < half, x + half, 2.0 * half), 0.0)
            energy = energy + rise * inside**3 / (12.0 * half)
        beyond = np.where(x > half, x - half, 0.0)
        energy = energy + rise * (half * beyond + 0.5 * beyond**2)
    return energy

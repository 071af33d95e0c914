"""Energy of a plain-knit loop in a fabric bent to a cylinder, and what follows from it, in plain numpy.

Shares nothing with the solver, like :mod:`judge_energy`, whose formulation it carries over: the same
yarn in the same lattice, but the fabric point (x, y, z), x along the bent direction, lies at the angle
kappa x of a cylinder about the other direction, at the radius 1/kappa + z.  Positions are taken in
space and derivatives numerically (complex step), not by the chain rule.  A curvature of
zero is the flat fabric, so that tension is judged by the same code.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from knitsim.verification.judge_energy import NEIGHBOURS, REACH, Energy, law_energy, size_of

_STEP = 1e-30  # of complex derivatives: exact to round-off, whatever the unit


def in_space(x, y, z, curvature):
    """Points in space (..., 3) of the fabric points (x bent, y along the axis, z thickness).

    The origin of space is the fabric's origin, whatever the curvature (1/m).
    """
    if curvature == 0.0:
        return np.stack([x, y, z], axis=-1)
    angle = curvature * x
    along = (1.0 / curvature + z) * np.sin(angle)
    return np.stack([along, y, z * np.cos(angle) - 2.0 * np.sin(0.5 * angle) ** 2 / curvature], -1)


@dataclass(frozen=True, eq=False)
class BentShape:
    """One state of a loop: control points (n, 3), lattice (wale and course spacing), curvature (1/m).

    points (contacts, 3): contact points in the fabric's own flat coordinates, bent axis first.
    i, k, image (pairs, 2), gap (pairs, 3), distance: unordered pairs of contact points closer than a
    diameter, i against k moved by image (wales, courses), and the vector between them in space (m),
    seen from the middle of the pair.
    """

    control: np.ndarray
    lattice: np.ndarray
    curvature: float
    points: np.ndarray
    i: np.ndarray
    k: np.ndarray
    image: np.ndarray
    gap: np.ndarray
    distance: np.ndarray


class BentEnergy(Energy):
    """Energy of one loop by one quadrature.

    given: :class:`judge_energy.Given`; gauss: points of the yarn's own energy per span; contacts:
    contact points per loop; rounding: see :func:`judge_energy.law_energy`; bent: the axis that
    becomes curved (0 course, 1 wale).
    """

    def __init__(self, given, gauss, contacts, rounding, bent=0):
        super().__init__(given, gauss, contacts, rounding)
        self.axes = np.array([bent, 1 - bent, 2])

    # ------------------------------------------------------------ shapes

    def shape(self, control, width, height, curvature=0.0):
        """A :class:`BentShape` at wale spacing ``width`` and course spacing ``height`` (m)."""
        lattice = np.array([width, height])
        points = self.place @ control
        points[:, 0] += self.place_turns * width
        points = points[:, self.axes]
        i, k, image = self._pairs(points, lattice, curvature)
        gap = self._gaps(points, i, k, image, lattice, curvature)
        return BentShape(control, lattice, curvature, points, i, k, image, gap, size_of(gap))

    def _shifts(self, image, lattice):
        """Moves of the images (pairs, 2) in the fabric's coordinates, bent axis first."""
        return (image * lattice)[:, self.axes[:2]]

    def _gaps(self, points, i, k, image, lattice, curvature):
        """Vectors (pairs, 3) in space from the image of k to i, seen from the middle between them.

        There the cylinder's tangent is the first axis, so that a fabric that only rolls up further
        along its course does not seem to move.
        """
        a, b = points[i], points[k]
        b = np.column_stack([b[:, :2] + self._shifts(image, lattice), b[:, 2]])
        half = 0.5 * (a[:, 0] - b[:, 0])
        return in_space(half, a[:, 1], a[:, 2], curvature) - in_space(
            -half, b[:, 1], b[:, 2], curvature
        )

    def gaps(self, shape, i, k, image):
        """As in the flat fabric, between points in space."""
        return self._gaps(shape.points, i, k, image, shape.lattice, shape.curvature)

    def _pairs(self, points, lattice, curvature):
        """(i, k, image) of all pairs of contact points closer than a diameter in space."""
        found = []
        for i, k, image, _ in self._near(points, lattice, curvature, self.given.diameter):
            order = np.lexsort((k, i))
            found.append((i[order], k[order], np.tile(image, (len(i), 1))))
        return tuple(np.concatenate(column) for column in zip(*found, strict=True))

    def _near(self, points, lattice, curvature, reach):
        """For every image (wales, courses): i, k, the image and distances of pairs closer than reach.

        Each unordered pair once, arc neighbours left out, and pairs half a turn of the cylinder and
        more apart: pure bending is that of a strip too short to meet itself.
        """
        tree = cKDTree(in_space(*points.T, curvature))
        for courses in range(REACH + 1):
            for wales in range(-REACH, REACH + 1):
                if courses == 0 and wales < 0:
                    continue
                image = np.array([wales, courses])
                moved = points[:, :2] + self._shifts(image[None], lattice)
                other = cKDTree(in_space(*moved.T, points[:, 2], curvature))
                near = tree.sparse_distance_matrix(other, reach, output_type="ndarray")
                i, k = near["i"].astype(np.int64), near["j"].astype(np.int64)
                keep = np.abs(curvature * (points[i, 0] - moved[k, 0])) < np.pi
                if courses == 0:
                    apart = self.arc[i] - self.arc[k] - wales * self.given.loop_length
                    keep &= np.abs(apart) >= NEIGHBOURS * self.given.diameter
                    if wales == 0:
                        keep &= i < k
                yield i[keep], k[keep], image, near["v"][keep]

    def closest(self, control, width, height, curvature, below):
        """Smallest distance in space (m) of contact points that are closer than ``below``, or inf."""
        points = self.place @ control
        points[:, 0] += self.place_turns * width
        found = self._near(points[:, self.axes], np.array([width, height]), curvature, below)
        return min(distance.min(initial=np.inf) for *_, distance in found)

    # ------------------------------------------------------------ energies

    def _local(self, shape):
        """Position and its derivatives by u at the Gauss points, (9, m): axis by axis, bent first."""
        rows = []
        for matrix, turns in self.yarn:
            values = matrix @ shape.control
            values[:, 0] += turns * shape.lattice[0]
            rows += list(values.T[self.axes])
        return np.array(rows)

    def _yarn_energies(self, local, curvature):
        """Stretch and bending energy (J per length) at the Gauss points; local: as _local.

        In the frame of the cylinder at the point the velocity is (m x', y', z'), m = 1 + kappa z,
        and the acceleration has the terms of polar coordinates.
        """
        _, _, z, x1, y1, z1, x2, y2, z2 = local
        m, turn = 1.0 + curvature * z, curvature * x1
        v = (m * x1, y1, z1)
        a = (m * x2 + 2.0 * z1 * turn, y2, z2 - m * x1 * turn)
        square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
        cross = (
            (v[1] * a[2] - v[2] * a[1]) ** 2
            + (v[2] * a[0] - v[0] * a[2]) ** 2
            + (v[0] * a[1] - v[1] * a[0]) ** 2
        )
        stretch, _ = law_energy(np.sqrt(square) / self.span - 1.0, self.given, self.rounding)
        return stretch, 0.5 * self.given.bending_rigidity * cross / (square * self.span) ** 2

    def terms(self, shape):
        """Stretch, bending and contact energy of a loop (J)."""
        stretch, bend = self._yarn_energies(self._local(shape), shape.curvature)
        contact = self.barrier(shape.distance)[0].sum()
        return np.array([self.weight @ stretch, self.weight @ bend, contact])

    def gradient(self, shape):
        """Derivatives by the control points (n, 3) and by wale and course spacing (2,), N."""
        local = self._local(shape).astype(complex)
        by_control, by_lattice = np.zeros_like(shape.control), np.zeros(2)
        for row in range(9):
            moved = local.copy()
            moved[row] += 1j * _STEP
            stretch, bend = self._yarn_energies(moved, shape.curvature)
            slope = self.weight * (stretch + bend).imag / _STEP
            (matrix, turns), axis = self.yarn[row // 3], self.axes[row % 3]
            by_control[:, axis] += matrix.T @ slope
            by_lattice[0] += turns @ slope if axis == 0 else 0.0
        pull = -self.barrier(shape.distance)[1] / shape.distance
        on_i, on_k = self._pushed(shape, pull[:, None] * shape.gap)
        at = self._gathered(shape.i, on_i) + self._gathered(shape.k, on_k)
        by_control += self.place.T @ at
        by_lattice[0] += self.place_turns @ at[:, 0]
        by_lattice += (shape.image * on_k[:, :2]).sum(0)
        return by_control, by_lattice

    def _sides(self, shape):
        """For each end of the pairs the three derivatives (pairs, 3, 3) of its place in space.

        [p, a] is how the end moves in space with its fabric coordinate a, bent axis first.
        """
        a, b = shape.points[shape.i], shape.points[shape.k]
        half = 0.5 * (a[:, 0] - b[:, 0] - self._shifts(shape.image, shape.lattice)[:, 0])
        sides = []
        for angle, z in ((shape.curvature * half, a[:, 2]), (-shape.curvature * half, b[:, 2])):
            one, zero = np.ones_like(angle), np.zeros_like(angle)
            m = 1.0 + shape.curvature * z
            by = (
                (m * np.cos(angle), zero, -m * np.sin(angle)),
                (zero, one, zero),
                (np.sin(angle), zero, np.cos(angle)),
            )
            sides.append(np.stack([np.stack(column, axis=-1) for column in by], axis=1))
        return sides

    def _pushed(self, shape, force):
        """Energy derivatives (pairs, 3) by the fabric coordinates of i and of k's image, axes in order.

        force: derivative of the energy by the gap (pairs, 3).
        """
        ends = []
        for side, sign in zip(self._sides(shape), (1.0, -1.0), strict=True):
            by = np.empty_like(force)
            by[:, self.axes] = sign * np.einsum("pac,pc->pa", side, force)
            ends.append(by)
        return ends

    def moment(self, shape):
        """Derivative of a loop's energy by the curvature (J m).

        Control points and lattice, in the fabric's own coordinates, stay as they are.
        """
        stretch, bend = self._yarn_energies(self._local(shape), shape.curvature + 1j * _STEP)
        pull = -self.barrier(shape.distance)[1] / shape.distance
        touching = pull @ (shape.gap * self._turned(shape)).sum(1)
        return self.weight @ (stretch + bend).imag / _STEP + touching

    def _turned(self, shape):
        """Derivatives (pairs, 3) of the gaps by the curvature (m2)."""
        curvature = shape.curvature + 1j * _STEP
        pairs = shape.points, shape.i, shape.k, shape.image, shape.lattice
        return self._gaps(*pairs, curvature).imag / _STEP

    # ------------------------------------------------------------ friction

    def coulomb(self, shape):
        """Largest that friction can do to control points (n, 3), spacings (2,), and the moment (J m).

        Every pair rubs with the coefficient times its normal force, all in the same sense: what
        Coulomb's law cannot exceed.
        """
        rub = self.given.friction * self.barrier(shape.distance)[1]
        normal = shape.gap / shape.distance[:, None]
        ends = []
        for side in self._sides(shape):
            along = np.einsum("pac,pc->pa", side, normal)
            across = np.sqrt(np.maximum((side**2).sum(2) - along**2, 0.0))
            by = np.empty_like(across)
            by[:, self.axes] = rub[:, None] * across
            ends.append(by)
        at = self._gathered(shape.i, ends[0]) + self._gathered(shape.k, ends[1])
        # What the spacing moves is the gap: each turn of k's image, less that of i along the yarn.
        turns = self.place_turns[shape.i] - self.place_turns[shape.k] - shape.image[:, 0]
        worst = np.maximum(ends[0], ends[1])
        on_lattice = np.array(
            [np.abs(turns) @ worst[:, 0], np.abs(shape.image[:, 1]) @ worst[:, 1]]
        )
        slope = self._turned(shape)
        slope -= (slope * normal).sum(1)[:, None] * normal
        return np.abs(self.place).T @ at, on_lattice, rub @ size_of(slope)

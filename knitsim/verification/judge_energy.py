"""Energy of a plain-knit loop and its gradient, in plain numpy: what the judge measures with.

Nothing here is shared with the solver: no symmetry, no unknowns, no compiled code.  One whole loop,
its neighbours by translation, every integral a sum over points of the loop.  The formulation is the
one that the equilibrium model states: per reference length W(strain) of the tension law and
B/2 kappa^2 (straight rest shape), and the barrier K (1 - x^2)^2/x^2, x = distance/diameter < 1, per
length squared of unordered pairs, without neighbours on one yarn closer than 1.6 diameters of arc.
"""

from dataclasses import dataclass

import numpy as np

NEIGHBOURS = 1.6  # diameters of arc below which two places of one yarn do not touch
ROUNDED_STRAIN = 4e-4  # half width over which the solver says that it rounds kinks of the law
REACH = 2  # wales and courses to the furthest images that can touch
_RUN = 12  # contact points per bounding box


@dataclass(frozen=True)
class Given:
    """What a fabric is made of (SI), and how finely it was solved.

    law_strain, law_tension: vertices of the yarn's tension law, from (0, 0), without jumps;
    contact_stiffness K (N/m); friction: Coulomb's coefficient; points, contacts: control points and
    contact points per loop of the solution under judgement.
    """

    loop_length: float
    diameter: float
    bending_rigidity: float
    law_strain: tuple
    law_tension: tuple
    contact_stiffness: float
    friction: float
    points: int
    contacts: int


def control_of(knots, width):
    """Control points (n, 3) of the cubic spline with r(i) = knots[i], r(i + n) = r(i) + (width, 0, 0)."""
    n = len(knots)
    matrix = (4.0 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)) / 6.0
    matrix[0, -1] = matrix[-1, 0] = 1.0 / 6.0
    right = np.array(knots, dtype=float)
    # The two rows that reach round the end take a control point one wale away.
    right[0, 0] += width / 6.0
    right[-1, 0] -= width / 6.0
    return np.linalg.solve(matrix, right)


def design(points, u, derivative=0):
    """(matrix (m, points), turns (m,)): r(u) = matrix @ control + turns (width, 0, 0); or a derivative."""
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
    """Energy per length and tension (N) at strains; kinks rounded over +-rounding (0: as given)."""
    at, tension = np.array(given.law_strain), np.array(given.law_tension)
    slopes = np.diff(tension) / np.diff(at)
    gaps = np.diff(np.concatenate([at[:-1], [np.inf]]))
    energy, force = 0.5 * slopes[0] * strain**2, slopes[0] * strain
    for k in range(1, len(slopes)):
        half = min(rounding, 0.5 * gaps[k - 1], 0.5 * gaps[k])
        x, rise = strain - at[k], slopes[k] - slopes[k - 1]
        beyond = np.maximum(x - half, 0.0)
        # Inside, the stiffness grows linearly with x + half; beyond, it is the new slope.
        inside = np.clip(x + half, 0.0, 2.0 * half)
        if half > 0.0:
            energy = energy + rise * inside**3 / (12.0 * half)
            force = force + rise * inside**2 / (4.0 * half)
        energy = energy + rise * (half * beyond + 0.5 * beyond**2)
        force = force + rise * beyond
    return energy, force


class Energy:
    """Energy of one loop by one quadrature.

    gauss: points of the yarn's own energy per span; contacts: contact points per loop, in the middle
    of equal parts; rounding: see :func:`law_energy`.
    """

    def __init__(self, given, gauss, contacts, rounding):
        self.given, self.rounding = given, rounding
        n = given.points
        place, weight = np.polynomial.legendre.leggauss(gauss)
        u = (np.arange(n)[:, None] + 0.5 * (1.0 + place)).ravel()
        self.span = given.loop_length / n
        self.weight = np.tile(0.5 * weight, n) * self.span
        self.yarn = [design(n, u, order) for order in (0, 1, 2)]
        u = (np.arange(contacts) + 0.5) * n / contacts
        self.arc = u * self.span
        self.length = given.loop_length / contacts
        self.place, self.place_turns = design(n, u)

    def shape(self, control, width, height):
        """A :class:`Shape` at the wale spacing ``width`` and the course spacing ``height`` (m)."""
        points = self.place @ control
        points[:, 0] += self.place_turns * width
        return Shape(
            control, np.array([width, height]), points, *self._pairs(points, width, height)
        )

    def _pairs(self, points, width, height):
        d = self.given.diameter
        found = []
        for courses in range(REACH + 1):
            for wales in range(-REACH, REACH + 1):
                if courses == 0 and wales < 0:
                    continue
                shift = np.array([wales * width, courses * height, 0.0])
                i, k = near(points, points + shift, d)
                if courses == 0:
                    # The same yarn: each pair once, arc neighbours left out.
                    apart = self.arc[i] - self.arc[k] - wales * self.given.loop_length
                    keep = np.abs(apart) >= NEIGHBOURS * d
                    if wales == 0:
                        keep &= i < k
                    i, k = i[keep], k[keep]
                found.append(
                    (i, k, np.tile((wales, courses), (len(i), 1)), points[i] - points[k] - shift)
                )
        i, k, image, gap = (np.concatenate(column) for column in zip(*found, strict=True))
        return i, k, image, gap, size_of(gap)

    def gaps(self, shape, i, k, image):
        """Vectors (pairs, 3) from the contact points k, moved by image, to i in a shape (m)."""
        shift = np.concatenate([image * shape.lattice, np.zeros((len(image), 1))], axis=1)
        return shape.points[i] - shape.points[k] - shift

    def barrier(self, distance):
        """Energy of pairs (J) and the force between them (N), positive when they repel."""
        x = distance / self.given.diameter
        scale = self.given.contact_stiffness * self.length**2
        return (
            scale * (1.0 / x - x) ** 2,
            2.0 * scale * (1.0 / x - x) * (1.0 / x**2 + 1.0) / self.given.diameter,
        )

    def terms(self, shape):
        """Stretch, bending and contact energy of a loop (J)."""
        v, a = self._derivatives(shape)
        stretch, _ = law_energy(size_of(v) / self.span - 1.0, self.given, self.rounding)
        turning = (np.cross(v, a) ** 2).sum(1) / (v**2).sum(1) ** 2
        bend = 0.5 * self.given.bending_rigidity * turning / self.span**2
        contact = self.barrier(shape.distance)[0].sum()
        return np.array([self.weight @ stretch, self.weight @ bend, contact])

    def _derivatives(self, shape):
        """dr/du and d2r/du2 at the Gauss points."""
        v, a = (matrix @ shape.control for matrix, _ in self.yarn[1:])
        v[:, 0] += self.yarn[1][1] * shape.lattice[0]
        a[:, 0] += self.yarn[2][1] * shape.lattice[0]
        return v, a

    def gradient(self, shape):
        """Derivatives by the control points (n, 3) and by wale and course spacing (2,), N.

        The control points stay where they are when a spacing changes; their images move.
        """
        v, a = self._derivatives(shape)
        size = size_of(v)
        _, tension = law_energy(size / self.span - 1.0, self.given, self.rounding)
        # Bending is B/2 |v x a|^2/|v|^4 per span^2.
        cross = np.cross(v, a)
        square = (cross**2).sum(1)
        factor = (0.5 * self.given.bending_rigidity / self.span**2) * self.weight
        by_v = 2.0 * np.cross(a, cross) / size[:, None] ** 4
        by_v -= (4.0 * square / size**6)[:, None] * v
        by_a = 2.0 * np.cross(cross, v) / size[:, None] ** 4
        by_v *= factor[:, None]
        by_v += (self.weight * tension / (self.span * size))[:, None] * v
        by_a *= factor[:, None]
        pull = -(self.barrier(shape.distance)[1] / shape.distance)[:, None] * shape.gap
        at = self._gathered(shape.i, pull) - self._gathered(shape.k, pull)
        (first, first_turns), (second, second_turns) = self.yarn[1:]
        by_control = first.T @ by_v + second.T @ by_a + self.place.T @ at
        by_width = first_turns @ by_v[:, 0] + second_turns @ by_a[:, 0]
        by_width += self.place_turns @ at[:, 0] - shape.image[:, 0] @ pull[:, 0]
        return by_control, np.array([by_width, -(shape.image[:, 1] @ pull[:, 1])])

    def _gathered(self, number, values):
        """Sums (contacts, 3) of values (pairs, 3) by contact point."""
        return np.stack([np.bincount(number, column, len(self.arc)) for column in values.T], axis=1)

    def coulomb(self, shape):
        """Largest that friction can do to each control point (n, 3) and spacing (2,), N.

        Every pair rubs with the coefficient times its normal force, all in the same sense: what
        Coulomb's law cannot exceed.
        """
        rub = self.given.friction * self.barrier(shape.distance)[1]
        normal = shape.gap / shape.distance[:, None]
        most = rub[:, None] * np.sqrt(np.maximum(1.0 - normal**2, 0.0))
        at = self._gathered(shape.i, most) + self._gathered(shape.k, most)
        turns = self.place_turns[shape.i] - self.place_turns[shape.k] - shape.image[:, 0]
        return np.abs(self.place).T @ at, np.array(
            [np.abs(turns) @ most[:, 0], shape.image[:, 1] @ most[:, 1]]
        )

    def rubbed(self, before, after):
        """Most energy that friction can take (J) between two shapes that lie close together.

        Each pair that touches slips by the change of its vector across its mean normal, against the
        coefficient times the mean of its two normal forces.  Pairs that stick take less.
        """
        key = [
            ((s.i * len(self.arc) + s.k) * (2 * REACH + 1) + s.image[:, 0] + REACH) * (REACH + 1)
            + s.image[:, 1]
            for s in (before, after)
        ]
        _, which = np.unique(np.concatenate(key), return_index=True)
        i, k, image = (
            np.concatenate([getattr(before, name), getattr(after, name)])[which]
            for name in ("i", "k", "image")
        )
        gaps, forces = [], []
        for s in (before, after):
            gaps.append(self.gaps(s, i, k, image))
            forces.append(self.barrier(np.minimum(size_of(gaps[-1]), self.given.diameter))[1])
        normal = gaps[0] + gaps[1]
        normal /= size_of(normal)[:, None]
        slip = gaps[1] - gaps[0]
        slip -= (slip * normal).sum(1)[:, None] * normal
        return float(self.given.friction * 0.5 * ((forces[0] + forces[1]) @ size_of(slip)))


@dataclass(frozen=True, eq=False)
class Shape:
    """One state of a loop: control points (n, 3), lattice (wale and course spacing), contact points.

    i, k, image (pairs, 2), gap (pairs, 3), distance: unordered pairs of contact points closer than a
    diameter, i against k moved by image (wales, courses), and the vector between them (m).
    """

    control: np.ndarray
    lattice: np.ndarray
    points: np.ndarray
    i: np.ndarray
    k: np.ndarray
    image: np.ndarray
    gap: np.ndarray
    distance: np.ndarray


def near(points, others, reach):
    """Numbers (i, k) of all points[i] and others[k] closer than reach.

    Boxes around runs of points are compared first; boxes further apart than reach hold no such pair.
    """
    runs = -(-len(points) // _RUN)
    index = np.minimum(np.arange(runs * _RUN).reshape(runs, _RUN), len(points) - 1)
    own, other = points[index], others[index]
    gap = np.maximum(
        other.min(1)[None] - own.max(1)[:, None], own.min(1)[:, None] - other.max(1)[None]
    ).max(2)
    a, b = np.nonzero(gap < reach)
    square = ((own[a][:, :, None] - other[b][:, None]) ** 2).sum(-1)
    p, q, r = np.nonzero(square < reach * reach)
    i, k = a[p] * _RUN + q, b[p] * _RUN + r
    real = (i < len(points)) & (k < len(points))
    return i[real], k[real]


def size_of(vectors):
    """Lengths (...) of vectors (..., 3)."""
    return np.sqrt((vectors**2).sum(-1))

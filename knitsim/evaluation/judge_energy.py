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
        self.first, self.first_turns = design(n, u, 1)
        self.second, self.second_turns = design(n, u, 2)
        u = (np.arange(contacts) + 0.5) * n / contacts
        self.arc = u * self.span
        self.length = given.loop_length / contacts
        self.place, self.place_turns = design(n, u)

    def points(self, control, width):
        """Contact points (contacts, 3), m."""
        points = self.place @ control
        points[:, 0] += self.place_turns * width
        return points

    def pairs(self, points, lattice):
        """Unordered pairs closer than a diameter: i, k, image (wales, courses), vector k to i."""
        d = self.given.diameter
        found = []
        for courses in range(REACH + 1):
            for wales in range(-REACH, REACH + 1):
                if courses == 0 and wales < 0:
                    continue
                shift = np.array([wales * lattice[0], courses * lattice[1], 0.0])
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
        return tuple(np.concatenate(column) for column in zip(*found, strict=True))

    def barrier(self, distance):
        """Energy of pairs (J) and the force between them (N), positive when they repel."""
        x = distance / self.given.diameter
        scale = self.given.contact_stiffness * self.length**2
        return (
            scale * (1.0 / x - x) ** 2,
            2.0 * scale * (1.0 / x - x) * (1.0 / x**2 + 1.0) / self.given.diameter,
        )

    def terms(self, control, lattice):
        """Stretch, bending and contact energy of a loop (J); lattice: wale and course spacing."""
        v, a = self._derivatives(control, lattice)
        stretch, _ = law_energy(_size(v) / self.span - 1.0, self.given, self.rounding)
        bend = 0.5 * self.given.bending_rigidity * _turning(v, a) / self.span**2
        distance = _size(self.pairs(self.points(control, lattice[0]), lattice)[3])
        return np.array([self.weight @ stretch, self.weight @ bend, self.barrier(distance)[0].sum()])

    def _derivatives(self, control, lattice):
        v, a = self.first @ control, self.second @ control
        v[:, 0] += self.first_turns * lattice[0]
        a[:, 0] += self.second_turns * lattice[0]
        return v, a

    def gradient(self, control, lattice):
        """Derivatives by the control points (n, 3) and by wale and course spacing (2,), N.

        The control points stay where they are when a spacing changes; their images move.
        """
        v, a = self._derivatives(control, lattice)
        size = _size(v)
        _, tension = law_energy(size / self.span - 1.0, self.given, self.rounding)
        # |v x a|^2/|v|^6 |v|^2: derivatives by v and a of |v x a|^2/|v|^4.
        cross = np.cross(v, a)
        square = (cross**2).sum(1)
        factor = (0.5 * self.given.bending_rigidity / self.span**2) * self.weight
        by_v = 2.0 * np.cross(a, cross) / size[:, None] ** 4
        by_v -= (4.0 * square / size**6)[:, None] * v
        by_a = 2.0 * np.cross(cross, v) / size[:, None] ** 4
        by_v *= factor[:, None]
        by_v += (self.weight * tension / (self.span * size))[:, None] * v
        by_a *= factor[:, None]
        i, k, image, gap = self.pairs(self.points(control, lattice[0]), lattice)
        distance = _size(gap)
        pull = -(self.barrier(distance)[1] / distance)[:, None] * gap
        at = np.zeros((len(self.arc), 3))
        for axis in range(3):
            at[:, axis] = np.bincount(i, pull[:, axis], len(at)) - np.bincount(
                k, pull[:, axis], len(at)
            )
        by_control = self.first.T @ by_v + self.second.T @ by_a + self.place.T @ at
        by_width = self.first_turns @ by_v[:, 0] + self.second_turns @ by_a[:, 0]
        by_width += self.place_turns @ at[:, 0]
        by_width -= image[:, 0] @ pull[:, 0]
        return by_control, np.array([by_width, -(image[:, 1] @ pull[:, 1])])

    def coulomb(self, control, lattice):
        """Largest that friction can do to each control point (n, 3) and spacing (2,), N.

        Every pair rubs with the coefficient times its normal force, all in the same sense: what
        Coulomb's law cannot exceed.
        """
        i, k, image, gap = self.pairs(self.points(control, lattice[0]), lattice)
        distance = _size(gap)
        rub = self.given.friction * self.barrier(distance)[1]
        most = rub[:, None] * np.sqrt(np.maximum(1.0 - (gap / distance[:, None]) ** 2, 0.0))
        at = np.zeros((len(self.arc), 3))
        for axis in range(3):
            at[:, axis] = np.bincount(i, most[:, axis], len(at)) + np.bincount(
                k, most[:, axis], len(at)
            )
        turns = np.abs(self.place_turns[i] - self.place_turns[k] - image[:, 0])
        return np.abs(self.place).T @ at, np.array([turns @ most[:, 0], image[:, 1] @ most[:, 1]])

    def rubbed(self, before, after):
        """Energy lost by friction (J) between two states, each (control, lattice).

        Each pair that touches slips by the change of its vector across its mean normal, against the
        coefficient times the mean of its two normal forces.
        """
        points = [self.points(control, lattice[0]) for control, lattice in (before, after)]
        listed = set()
        for at, (_, lattice) in zip(points, (before, after), strict=True):
            i, k, image, _ = self.pairs(at, lattice)
            listed.update(zip(i, k, image[:, 0], image[:, 1], strict=True))
        if not listed:
            return 0.0
        i, k, wales, courses = np.array(sorted(listed)).T
        gaps, forces = [], []
        for at, (_, lattice) in zip(points, (before, after), strict=True):
            shift = np.stack([wales * lattice[0], courses * lattice[1], 0.0 * wales], axis=1)
            gaps.append(at[i] - at[k] - shift)
            forces.append(
                self.barrier(np.minimum(_size(gaps[-1]), self.given.diameter))[1]
            )
        normal = gaps[0] + gaps[1]
        normal /= _size(normal)[:, None]
        slip = gaps[1] - gaps[0]
        slip -= (slip * normal).sum(1)[:, None] * normal
        return float(self.given.friction * 0.5 * ((forces[0] + forces[1]) @ _size(slip)))


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


def _size(vectors):
    return np.sqrt((vectors**2).sum(-1))


def _turning(v, a):
    """Squared turning of the tangent per unit of the parameter, |v x a|^2/|v|^4."""
    return (np.cross(v, a) ** 2).sum(1) / (v**2).sum(1) ** 2

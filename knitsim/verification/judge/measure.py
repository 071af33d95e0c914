"""Energies of a knitted cell and their derivatives in plain numpy: what the judge measures with.

Nothing here is shared with the solver: no symmetry, no unknowns, no compiled code.  Whole loops, their
neighbours by translation, every integral a sum over points, derivatives by complex step.  The
formulation is the one that the equilibrium model states: per reference length W(strain) of the
tension law and B/2 |k - R k_0|^2, k the curvature vector, k_0 a part of that of the held loop and R the
least rotation between the tangents there and here; and between yarns an energy per length squared of
unordered pairs, without neighbours on one yarn closer than 1.6 diameters of arc.

Where the fabric is bent, the point (x, y, z), x along the bent direction, lies at the angle kappa x of
a cylinder about the other direction, at the radius 1/kappa + z; a curvature of zero is the flat fabric.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from knitsim.verification.judge.contact import SPREAD, cell_mean, cell_press, cell_slopes, cells
from knitsim.verification.judge.given import controls_of, design, law_energy

RUN = 8  # contact points that are searched for together
NEIGHBOURS = 1.6  # diameters of arc below which two places of one yarn do not touch
ROUNDED_STRAIN = (
    4e-4  # half width over which the solver says that it rounds kinks of the tension law
)
_STEP = 1e-30  # of complex derivatives: exact to round-off, whatever the unit


@dataclass(frozen=True, eq=False)
class Shape:
    """One state of a cell, in the fabric's own flat coordinates.

    control (yarns, spans, 3); lattice (4,): the steps to the next wale and to the next course (m);
    curvature (1/m); points (contacts, 3): contact points of all yarns.  Unordered pairs of contact
    points that may touch: i, k, image (pairs, 2) by which k is moved (cells along the course and the
    wale), gap (pairs, 3): from k to i in space, and its length distance (m).
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


class Energy:
    """Energy of one cell by one quadrature.

    gauss: points of the yarn's own energy per span; contacts: contact points per loop, in the middle
    of equal parts; stated: whether kinks of the tension law are rounded and the contact law is averaged
    over cells (:mod:`.contact`) as the solver says that it does, or both are taken as given; bent: the
    axis that becomes curved (0 course, 1 wale).
    """

    def __init__(self, given, gauss, contacts, stated, bent=0):
        self.given, self.bent, self.stated = given, bent, stated
        self.rounding = ROUNDED_STRAIN if stated else 0.0
        self.loops = given.wales * given.courses
        n = given.points * given.wales
        place, weight = np.polynomial.legendre.leggauss(gauss)
        u = (np.arange(n)[:, None] + 0.5 * (1.0 + place)).ravel()
        self.span = given.loop_length / given.points
        self.weight = np.tile(0.5 * weight, n) * self.span
        self.yarn = [design(n, u, order) for order in (0, 1, 2)]
        self.rest = None
        if given.set_fraction > 0.0:
            lines, lattice = given.held
            own = controls_of(lines, lattice, given.wales)
            v, a = (
                np.moveaxis(self.placed(*one, own, lattice), -1, 0)[[bent, 1 - bent, 2]]
                for one in self.yarn[1:]
            )
            # Tangent and rest curvature, in the frame in which the fabric bends.
            self.rest = v / np.sqrt((v**2).sum(0)), given.set_fraction * self._turn(v, a)
        u = (np.arange(contacts * given.wales) + 0.5) * given.points / contacts
        self.arc = np.tile(u * self.span, given.courses)
        self.of_yarn = np.repeat(np.arange(given.courses), len(u))
        self.length = given.loop_length / contacts
        self.place, self.turns = design(n, u)
        # Steps to the next contact points, and second differences.
        part = given.points / contacts
        self.frames = [
            tuple(part**order * x for x in design(n, u, order))
            for order in ((1, 2) if stated else ())
        ]

    # ------------------------------------------------------------ shapes

    def cell(self, lattice):
        """The two steps of the cell in the plane, (2, 2): m."""
        counts = [[self.given.wales], [self.given.courses]]
        return np.reshape(lattice, (2, 2)) * counts

    def shape(self, control, lattice, curvature=0.0):
        """A :class:`Shape`; control (yarns, spans, 3), or (spans, 3) of one yarn."""
        control, lattice = np.atleast_3d(control), np.asarray(lattice, dtype=float)
        control = control.reshape(self.given.courses, -1, 3)
        points = self.placed(self.place, self.turns, control, lattice).reshape(-1, 3)
        reach = self.given.diameter + self.stated * SPREAD * self.length
        i, k, image = self.near(points, lattice, curvature, reach)
        bare = Shape(control, lattice, curvature, points, i, k, image, None, None)
        gap = self.gaps(bare, i, k, image)
        return Shape(control, lattice, curvature, points, i, k, image, gap, size_of(gap))

    def placed(self, matrix, turns, control, lattice):
        """Values (yarns, m, 3) of a design at control points."""
        values = matrix @ control
        values[..., :2] += turns[:, None] * self.cell(lattice)[0]
        return values

    def near(self, points, lattice, curvature, reach):
        """Pairs i, k, image of contact points closer than reach in space.

        Each unordered pair once, arc neighbours left out, and pairs half a turn of the cylinder and
        more apart: pure bending is that of a strip too short to meet itself.
        """
        given, m = self.given, len(points)
        # On the inside of a bend, what touches may be twice as far apart in the flat fabric.
        images = images_around(points, self.cell(lattice), 2.0 * reach)
        moved = np.repeat(points[None], len(images), axis=0)
        moved[..., :2] += (images @ self.cell(lattice))[:, None]
        moved = moved.reshape(-1, 3)
        own, other = self.in_space(points, curvature), self.in_space(moved, curvature)
        i, far = self._candidates(own, other, images, reach)
        k, image = far % m, images[far // m]
        apart = size_of(own[i] - other[far])
        across = points[i, self.bent] - moved[far, self.bent]
        keep = (apart < reach) & (np.abs(curvature * across) < np.pi)
        home = (image == 0).all(1)
        keep &= ~home | (i < k)
        keep &= ~self._are_neighbours(i, k, image, NEIGHBOURS * given.diameter)
        order = np.lexsort((k, i, far // m))
        order = order[keep[order]]
        return i[order], k[order], image[order]

    def _are_neighbours(self, i, k, image, arc):
        """Whether points i and k, this moved by image (pairs, 2), lie on one yarn less than arc (m) apart."""
        period = self.given.wales * self.given.loop_length
        apart = np.abs(self.arc[i] - self.arc[k] - image[:, 0] * period)
        return (image[:, 1] == 0) & (self.of_yarn[i] == self.of_yarn[k]) & (apart < arc)

    def _candidates(self, own, other, images, reach):
        """Pairs of places of own (m, 3) and other (images m, 3) that may be closer than reach.

        Runs of RUN places are searched by their middles; those of which all are neighbours are left out.
        """
        m, each = len(own), len(own) // self.given.courses
        first = np.concatenate(
            [np.arange(0, each, RUN) + n * each for n in range(self.given.courses)]
        )
        size = np.diff(np.append(first, m))
        starts = (first + m * np.arange(len(images))[:, None]).ravel()
        sizes = np.tile(size, len(images))
        theirs = np.add.reduceat(other, starts) / sizes[:, None]
        # The cell itself is the image that moves nothing.
        home = int(np.flatnonzero((images == 0).all(1))[0]) * len(first)
        ours = theirs[home : home + len(first)]
        reach = reach + 2.0 * size_of(other - np.repeat(theirs, sizes, axis=0)).max()
        kept = (
            ((theirs >= ours.min(0) - reach) & (theirs <= ours.max(0) + reach)).all(1).nonzero()[0]
        )
        found = cKDTree(ours).sparse_distance_matrix(
            cKDTree(theirs[kept]), reach, output_type="ndarray"
        )
        i, far = found["i"].astype(np.int64), kept[found["j"].astype(np.int64)]
        k, image = far % len(first), images[far // len(first)]
        least = NEIGHBOURS * self.given.diameter - 2.0 * RUN * self.length
        there = ~self._are_neighbours(first[i], first[k], image, least)
        i, far = i[there], far[there]
        step = np.arange(RUN)
        a = first[i][:, None, None] + step[:, None]
        b = starts[far][:, None, None] + step
        whole = step[:, None] < size[i][:, None, None]
        whole = whole & (step < sizes[far][:, None, None])
        a, b = np.broadcast_arrays(a, b)
        return a[whole], b[whole]

    def in_space(self, points, curvature):
        """Places in space (..., 3) of fabric points (..., 3); the origin stays."""
        if curvature == 0.0:
            return points
        placed, angle = points.copy(), curvature * points[..., self.bent]
        placed[..., self.bent] = (1.0 / curvature + points[..., 2]) * np.sin(angle)
        placed[..., 2] = points[..., 2] * np.cos(angle) - 2.0 * np.sin(0.5 * angle) ** 2 / curvature
        return placed

    def gaps(self, shape, i, k, image):
        """Vectors (pairs, 3) in space from k, moved by image, to i: (bent axis, other, thickness).

        Seen from the middle of the pair, where the cylinder's tangent is the first axis, so that a
        fabric that only rolls up further along its course does not seem to move.
        """
        return _gap(*self._apart(shape, i, k, image), shape.curvature)

    def _apart(self, shape, i, k, image):
        """What a gap depends on, (4, pairs): along the bent axis, along the other, both thicknesses."""
        a, b, shift = shape.points[i], shape.points[k], image @ self.cell(shape.lattice)
        flat = a[:, :2] - b[:, :2] - shift
        return np.stack([flat[:, self.bent], flat[:, 1 - self.bent], a[:, 2], b[:, 2]])

    def by_gap(self, shape, pairs=None):
        """Derivatives (5, pairs, 3) of the gaps by what they depend on, the curvature last."""
        pairs = (shape.i, shape.k, shape.image) if pairs is None else pairs
        parts = [*self._apart(shape, *pairs), shape.curvature]
        return np.array([_gap(*moved).imag / _STEP for moved in _moved(parts)])

    # ------------------------------------------------------------ contact

    def _cells(self, shape, i, k, image):
        """What cells of pairs depend on, as :func:`.contact.cells` takes it: 17 rows, the curvature last."""
        at = self._apart(shape, i, k, image)
        order, away = [self.bent, 1 - self.bent, 2], np.array([[-1.0], [-1.0], [1.0]])
        steps = [
            self.placed(*one, shape.control, shape.lattice).reshape(-1, 3)[:, order].T
            for one in self.frames
        ]
        own, other = ([step[:, ends] for step in steps] for ends in (i, k))
        return [*at, *own[0], *(away * other[0]), *own[1], *(away * other[1]), shape.curvature]

    def energies(self, shape):
        """Energies of the pairs (J)."""
        if self.stated:
            parts = self._cells(shape, shape.i, shape.k, shape.image)
            return cell_mean(self.given, *_cells_of(parts)) * self.length**2
        return self.given.contact.at(shape.distance, self.given.diameter)[0] * self.length**2

    def press(self, shape, pairs=None):
        """Forces (pairs,) between the points of pairs (those of the shape if None), repelling (N)."""
        pairs = (shape.i, shape.k, shape.image) if pairs is None else pairs
        if self.stated:
            q, a, b = _cells_of(self._cells(shape, *pairs))
            far = size_of(self.gaps(shape, *pairs))
            return cell_press(self.given, q, a, b, far) * self.length**2
        near = np.minimum(size_of(self.gaps(shape, *pairs)), self.given.diameter)
        return self.given.contact.at(near, self.given.diameter)[1] * self.length**2

    def _by_contact(self, shape):
        """Derivatives of the contact energy by control points, cell and curvature."""
        if not self.stated:
            return self.pulled(shape, -(self.press(shape) / shape.distance)[:, None] * shape.gap)
        parts = self._cells(shape, shape.i, shape.k, shape.image)
        force = cell_slopes(self.given, *_cells_of(parts)) * self.length**2
        by = [(np.imag(_cells_of(moved)) / _STEP * force).sum(0) for moved in _moved(parts)]
        pairs = shape.i, shape.k, shape.image
        found = self._spread(shape, by[:4], (self.place, self.turns), pairs)
        for n, frame in enumerate(self.frames):
            own, other = (by[4 + 6 * n + 3 * end : 7 + 6 * n + 3 * end] for end in (0, 1))
            moved = self._scattered(
                shape, frame, self.by_axis(*own), self.by_axis(-other[0], -other[1], other[2])
            )
            found = tuple(a + b for a, b in zip(found, moved, strict=True))
        return *found, by[16].sum()

    # ------------------------------------------------------------ energies

    def terms(self, shape):
        """Stretch, bending and contact energy of a loop (J)."""
        stretch, bend = self._yarn_energies(self._local(shape), shape.curvature)
        yarn = (self.weight * [stretch.sum(0), bend.sum(0)]).sum(1)
        return np.array([*yarn, self.energies(shape).sum()]) / self.loops

    def _local(self, shape):
        """Place and its derivatives by u at the Gauss points, (9, yarns, m): axis by axis."""
        values = [self.placed(*one, shape.control, shape.lattice) for one in self.yarn]
        return np.concatenate([np.moveaxis(v, -1, 0) for v in values])

    def _motion(self, local, curvature):
        """Velocity and acceleration (3, ...) by u in the frame of the cylinder at the point.

        The velocity is (m x', y', z'), m = 1 + kappa z; the acceleration has the terms of polar
        coordinates.
        """
        b, c = self.bent, 1 - self.bent
        m, turn = 1.0 + curvature * local[2], curvature * local[3 + b]
        v = (m * local[3 + b], local[3 + c], local[5])
        a = (
            m * local[6 + b] + 2.0 * local[5] * turn,
            local[6 + c],
            local[8] - m * turn * local[3 + b],
        )
        return np.stack(v), np.stack(a)

    def _turn(self, v, a):
        """Turning of the tangent per reference length, a vector (3, ...), 1/m."""
        cross = np.stack(
            [v[1] * a[2] - v[2] * a[1], v[2] * a[0] - v[0] * a[2], v[0] * a[1] - v[1] * a[0]]
        )
        return cross / ((v**2).sum(0) * self.span)

    def _yarn_energies(self, local, curvature):
        """Stretch and bending energy (J per length) at the Gauss points, (yarns, m) each."""
        v, a = self._motion(local, curvature)
        speed = np.sqrt((v**2).sum(0))
        turn = self._turn(v, a)
        if self.rest is not None:
            # R k_0 = k_0 - (k_0.t) (t_0 + t)/(1 + t_0.t), as k_0 lies across t_0.
            tangent, (was, rest) = v / speed, self.rest
            leant = (rest * tangent).sum(0) / (1.0 + (was * tangent).sum(0))
            turn = turn - rest + leant * (was + tangent)
        stretch = law_energy(speed / self.span - 1.0, self.given, self.rounding)
        return stretch, 0.5 * self.given.bending_rigidity * (turn**2).sum(0)

    def _by_local(self, shape, values):
        """For each of the nine local numbers: its design, its axis, and the slope of values(local)."""
        local = self._local(shape).astype(complex)
        for row in range(9):
            moved = local.copy()
            moved[row] += 1j * _STEP
            yield self.yarn[row // 3], row % 3, values(moved).imag / _STEP

    def gradient(self, shape):
        """Derivatives of a cell's energy by control points (yarns, spans, 3), N; of a loop's by the
        lattice (4,), N, and by the curvature, J m.

        What is not named stays as it is; when the lattice changes, images and ends of yarns move.
        """
        on_control, on_cell, by_curvature = self._by_contact(shape)
        rows = self._by_local(shape, lambda x: sum(self._yarn_energies(x, shape.curvature)))
        for (matrix, turns), axis, slope in rows:
            on_control[..., axis] += (self.weight * slope) @ matrix
            if axis < 2:
                on_cell[0, axis] += ((self.weight * slope) @ turns).sum()
        turned = sum(self._yarn_energies(self._local(shape), shape.curvature + 1j * _STEP))
        by_curvature += (self.weight * turned.imag / _STEP).sum()
        return self.told((on_control, on_cell, by_curvature))

    def pulled(self, shape, pull, pairs=None):
        """Derivatives by control points, cell (2, 2) and curvature, from those by the gaps (pairs, 3)."""
        pairs = (shape.i, shape.k, shape.image) if pairs is None else pairs
        by = (self.by_gap(shape, pairs) * pull).sum(-1)
        found = self._spread(shape, by[:4], (self.place, self.turns), pairs)
        return *found, by[4].sum()

    def _spread(self, shape, by, frame, pairs):
        """Derivatives by control points and cell, from those (4, pairs) by what gaps depend on."""
        on_k = self.by_axis(-by[0], -by[1], by[3])
        on_control, on_cell = self._scattered(shape, frame, self.by_axis(*by[:3]), on_k, pairs)
        return on_control, on_cell + pairs[2].T @ on_k[:, :2]

    def _scattered(self, shape, frame, on_i, on_k, pairs=None):
        """The same from derivatives (pairs, 3) by values of a frame at both ends of the pairs."""
        at, on_cell = self.gathered(shape, on_i, on_k, pairs), np.zeros((2, 2))
        on_cell[0] = (frame[1] @ at).sum(0)[:2]
        return frame[0].T @ at, on_cell

    def by_axis(self, along, other, thick):
        """Values (pairs, 3) by the fabric's axes, from those by the bent one, the other, thickness."""
        values = np.empty((len(along), 3))
        values[:, self.bent], values[:, 1 - self.bent], values[:, 2] = along, other, thick
        return values

    def gathered(self, shape, on_i, on_k, pairs=None):
        """Sums (yarns, contacts, 3) by contact point of what acts on both ends of the pairs."""
        i, k = (shape.i, shape.k) if pairs is None else pairs[:2]
        ends, values = np.concatenate([i, k]), np.concatenate([on_i, on_k])
        sums = [np.bincount(ends, column, len(self.arc)) for column in values.T]
        return np.stack(sums, axis=1).reshape(self.given.courses, -1, 3)

    def _per_loop(self, on_cell):
        """From derivatives of the cell's energy by its steps (2, 2) to those of a loop by its own (4,)."""
        counts = np.array([[self.given.wales], [self.given.courses]])
        return (on_cell * counts).ravel() / self.loops

    # ------------------------------------------------------------ friction

    def told(self, derivatives):
        """By control points, cell and curvature: the latter two of one loop."""
        on_control, on_cell, by_curvature = derivatives
        return on_control, self._per_loop(on_cell), by_curvature / self.loops

    def turn_of(self, shape, local=None, more=0.0):
        """The yarn's turning (3, yarns, m), 1/m; more: added to the curvature of the fabric."""
        local = self._local(shape) if local is None else local
        return self._turn(*self._motion(local, shape.curvature + more))

    def lagging(self, shape, weigh, derivatives, size=np.asarray):
        """Derivatives with those of the lagging couples added.

        weigh: from slopes of the turning (3, yarns, m) to those of the couples' work over the couple.
        """
        on_control, on_cell, by_curvature = derivatives
        couple = self.given.bending_hysteresis * self.weight
        for (matrix, turns), axis, slope in self._by_local(shape, lambda x: self.turn_of(shape, x)):
            on_control[..., axis] += (couple * weigh(slope)) @ size(matrix)
            if axis < 2:
                on_cell[0, axis] += ((couple * weigh(slope)) @ size(turns)).sum()
        slope = self.turn_of(shape, more=1j * _STEP).imag / _STEP
        return on_control, on_cell, by_curvature + (couple * weigh(slope)).sum()


def images_around(points, cell, reach):
    """Cells (n, 2) along the course and the wale whose points come within reach (m), one of two opposites.

    points (n, 3); cell (2, 2): its steps (m).
    """
    wide, high = np.ptp(points[:, :2], axis=0) + reach
    up = int(high / cell[1, 1])
    across = int((wide + up * abs(cell[1, 0])) / cell[0, 0])
    return np.array(
        [(p, q) for q in range(up + 1) for p in range(-across, across + 1) if q or p >= 0]
    )


def _gap(along, other, z_i, z_k, curvature):
    """The vector (..., 3) between two places in space, seen from the middle between them."""
    angle = 0.5 * curvature * along
    arm = 0.5 * along if curvature == 0.0 else np.sin(angle) / curvature
    parts = (2.0 + curvature * (z_i + z_k)) * arm, other, (z_i - z_k) * np.cos(angle)
    return np.stack(parts, axis=-1)


def _cells_of(parts):
    """:func:`.contact.cells` of its 17 rows."""
    return cells(parts[:4], parts[4:7], parts[7:10], parts[10:13], parts[13:16], parts[16])


def _moved(parts):
    """Copies of a list of values, in each of which one has taken a complex step."""
    for n in range(len(parts)):
        yield [*parts[:n], parts[n] + 1j * _STEP, *parts[n + 1 :]]


def size_of(vectors):
    """Lengths (...) of vectors (..., 3)."""
    return np.sqrt((vectors**2).sum(-1))

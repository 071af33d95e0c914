"""A specimen between clamps: how much stiffer it pulls than a fabric that is free to contract everywhere.

The fabric is a membrane whose energy per area depends on the stretches along course and wale and on the
shear angle between them, W(a, b, g) = W2(a, b) + G g^2/2: W2 tabulated from the loop's own biaxial states,
G from its shear at rest.  A quarter of the specimen is cut into bilinear elements with 2 x 2 Gauss points;
the clamp holds the width.  With friction there is no energy: the table is that of the fabric without, and
the factor on the force is taken over (assumed: the clamps change where the fabric is strained, not how it
slips).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from knitsim.equilibrium.pull import PULLED, biaxial, shear, tensile
from knitsim.errors import ComputationError, InputError

ELEMENTS = (10, 10)  # along and across the pull, in a quarter
GRID = 13  # stretches of the table each way
TOLERANCE, TRIES, HALVINGS = 1e-7, 60, 20
SHEARED = 0.05  # rad, at which G is read
MARKS = 0.5  # part of the length between marks inside the specimen
_GAUSS = 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3.0)


@dataclass(frozen=True, eq=False)
class Membrane:
    """Energy per area of the fabric at rest (J/m2): spline of (course stretch, wale stretch), shear modulus
    (N/m); error: of the table, over the largest energy, at points between the tabulated ones; along,
    across: strains of the table, known (n, m): whether the state was solved, else it is only continued."""

    energy: RectBivariateSpline
    modulus: float
    error: float
    along: np.ndarray
    across: np.ndarray
    known: np.ndarray

    def holds(self, a, b):
        """Whether strains (n,) lie between solved states of the table, (n,) bool."""
        i, j = (np.searchsorted(x, v) for x, v in ((self.along, a), (self.across, b)))
        n, m = self.known.shape
        inside = (i > 0) & (i < n) & (j > 0) & (j < m)
        i, j = np.clip(i, 1, n - 1), np.clip(j, 1, m - 1)
        whole = (
            self.known[i, j]
            & self.known[i - 1, j]
            & self.known[i, j - 1]
            & self.known[i - 1, j - 1]
        )
        return inside & whole

    def at(self, a, b):
        """W2 and its derivatives by both stretches, (n,) each: W, Wa, Wb, Waa, Wab, Wbb."""
        orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        return tuple(self.energy.ev(a, b, dx=i, dy=j) for i, j in orders)


def tabulated(relaxed, course=(-0.35, 0.6), wale=(-0.3, 0.35), grid=GRID):
    """The :class:`Membrane` of a frictionless fabric at rest over ranges of strain.

    States that cannot be had (yarn straight both ways) are continued, and a specimen that comes there is
    refused.  Raises InputError with friction.
    """
    if relaxed.model.fabric.friction > 0.0:
        raise InputError(
            "friction", relaxed.model.fabric.friction, "must be 0: there is no energy with it"
        )
    area = relaxed.wale_spacing * relaxed.course_spacing
    along, across = _around(*course, grid), _around(*wale, grid)
    energy = np.full((grid, grid), np.nan)
    lead = _contracting(relaxed, along, across)
    for i, strain in enumerate(along):
        # There with free contraction, and from there along the wale both ways.
        way = [[x, free] for x, free in lead if 0.0 < x < strain or strain < x < 0.0]
        way = sorted(way, key=lambda one: abs(one[0])) + [[strain, dict(lead)[strain]]]
        for rows in (across[across >= way[-1][1]], across[across < way[-1][1]][::-1]):
            try:
                curve = biaxial(relaxed, np.array(way + [[strain, row] for row in rows]))
            except ComputationError:
                continue
            reached = max(curve.steps - len(way), 0)
            own = np.searchsorted(across, rows[:reached])
            energy[i, own] = curve.energy[len(way) :].sum(axis=1) / area
    known = np.isfinite(energy)
    filled = _continued(energy)
    spline = RectBivariateSpline(along, across, filled, kx=3, ky=3)
    coarse = RectBivariateSpline(along[::2], across[::2], filled[::2, ::2], kx=3, ky=3)
    # Cubics: half the spacing has a sixteenth of the error.
    error = np.abs(coarse(along, across) - filled)[known].max() / 15.0 / np.ptp(energy[known])
    modulus = float(shear(relaxed, [SHEARED]).force_per_width[-1]) / SHEARED
    return Membrane(spline, modulus, float(error), along, across, known)


def _contracting(relaxed, along, across):
    """Pairs (course strain, wale strain) about which the columns of the table are solved: with free
    contraction where the course is stretched, and what keeps the wale free where it is pushed together."""
    course = tensile(relaxed, "course", along[along > 0.0])
    wale = tensile(relaxed, "wale", across[across > 0.0])
    x = np.concatenate([wale.transverse_strain[::-1], [0.0], course.strain])
    y = np.concatenate([wale.strain[::-1], [0.0], course.transverse_strain])
    return [(float(strain), float(np.interp(strain, x, y))) for strain in along]


def _around(low, high, count):
    """Strains from low to high, 0 among them."""
    below = max(2, round((count - 1) * -low / (high - low)))
    return np.append(np.linspace(low, 0.0, below + 1), np.linspace(0.0, high, count - below)[1:])


def _continued(energy):
    """The table with its unknown states continued by parabolas from the nearest known ones, each way."""
    filled = energy.copy()
    for rows in (filled, filled.T):
        for row in rows:
            known = np.flatnonzero(np.isfinite(row))
            if len(known) < 4:
                continue
            for k in range(known[-1] + 1, len(row)):
                row[k] = 3.0 * row[k - 1] - 3.0 * row[k - 2] + row[k - 3]
            for k in range(known[0] - 1, -1, -1):
                row[k] = 3.0 * row[k + 1] - 3.0 * row[k + 2] + row[k + 3]
    return np.nan_to_num(filled, nan=float(np.nanmax(filled)))


class Clamped:
    """A clamped specimen: membrane; direction pulled; length, width (m, only their ratio counts)."""

    def __init__(self, membrane, direction, length, width, elements=ELEMENTS):
        if direction not in PULLED:
            raise InputError("direction", direction, "must be course or wale")
        if not (length > 0 and width > 0):
            raise InputError("specimen", [length, width], "length and width must be above 0")
        self.membrane, self.direction = membrane, direction
        nx, ny = elements
        self.size = np.array([0.5 * length, 0.5 * width])
        # Finer towards the clamp and its corner, where the strain varies.
        x = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, nx + 1)) * self.size[0]
        y = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, ny + 1)) * self.size[1]
        self.x = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        node = np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
        self.cells = np.stack(
            [node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], -1
        ).reshape(-1, 4)
        self.clamp, self.middle, self.axis = node[-1], node[0], node[:, 0]
        self.gradients, self.weights = self._gradients()
        fixed = np.zeros(2 * len(self.x), dtype=bool)
        fixed[2 * self.middle] = fixed[2 * self.axis + 1] = True
        fixed[2 * self.clamp] = fixed[2 * self.clamp + 1] = True
        self.free = np.flatnonzero(~fixed)

    def _gradients(self):
        """Shape gradients (cells, Gauss, 4, 2) and weights (cells, Gauss)."""
        found, weights = [], []
        corner = self.x[self.cells]
        for s in _GAUSS:
            for t in _GAUSS:
                by = np.array([[-(1 - t), -(1 - s)], [1 - t, -s], [t, s], [-t, 1 - s]])
                jacobian = np.einsum("cni,nj->cij", corner, by)
                found.append(np.einsum("nj,cji->cni", by, np.linalg.inv(jacobian)))
                weights.append(0.25 * np.linalg.det(jacobian))
        return np.stack(found, 1), np.stack(weights, 1)

    def energy(self, u):
        """Energy (J), gradient (n,) and Hessian (sparse) at displacements u (2 nodes,)."""
        first, second = self._lines(u)
        p, q = np.linalg.norm(first, axis=-1), np.linalg.norm(second, axis=-1)
        course_first = self.direction == "course"
        a, b = (p, q) if course_first else (q, p)
        W, Wa, Wb, Waa, Wab, Wbb = (
            v.reshape(a.shape) for v in self.membrane.at(a.ravel() - 1.0, b.ravel() - 1.0)
        )
        Wp, Wq, Wpp, Wqq = (Wa, Wb, Waa, Wbb) if course_first else (Wb, Wa, Wbb, Waa)
        c = (first * second).sum(-1)
        G = self.membrane.modulus
        # The shear angle by its sine, c/(p q): equal to second order, and smooth.
        m, n = first / p[..., None], second / q[..., None]
        sine = c / (p * q)
        ds1 = n / p[..., None] - sine[..., None] * m / p[..., None]
        ds2 = m / q[..., None] - sine[..., None] * n / q[..., None]
        P1 = Wp[..., None] * m + G * sine[..., None] * ds1
        P2 = Wq[..., None] * n + G * sine[..., None] * ds2
        eye = np.eye(2)

        def outer(x, y):
            return x[..., :, None] * y[..., None, :]

        def stiff(value, derivative, direction, length):
            return derivative[..., None, None] * outer(direction, direction) + (value / length)[
                ..., None, None
            ] * (eye - outer(direction, direction))

        # The curvature of the sine itself is left out of the Hessian: small, and Newton only slower.
        A11 = stiff(Wp, Wpp, m, p) + G * outer(ds1, ds1)
        A22 = stiff(Wq, Wqq, n, q) + G * outer(ds2, ds2)
        A12 = Wab[..., None, None] * outer(m, n) + G * outer(ds1, ds2)
        A12 = A12 + (G * sine / (p * q))[..., None, None] * eye
        g, w = self.gradients, self.weights
        P = np.stack([P1, P2], axis=-1)
        gradient = np.einsum("cg,cgij,cgnj->cni", w, P, g)
        blocks = np.einsum("cg,cgik,cgn,cgm->cnimk", w, A11, g[..., 0], g[..., 0])
        blocks += np.einsum("cg,cgik,cgn,cgm->cnimk", w, A22, g[..., 1], g[..., 1])
        cross = np.einsum("cg,cgik,cgn,cgm->cnimk", w, A12, g[..., 0], g[..., 1])
        blocks += cross + cross.transpose(0, 3, 4, 1, 2)
        place = (2 * self.cells[:, :, None] + np.arange(2)).reshape(len(self.cells), 8)
        total = np.zeros(u.size)
        np.add.at(total, place, gradient.reshape(len(place), 8))
        rows, columns = np.repeat(place, 8, axis=1), np.tile(place, (1, 8))
        matrix = coo_matrix((blocks.reshape(-1), (rows.ravel(), columns.ravel())), (u.size, u.size))
        return float((w * (W + 0.5 * G * sine**2)).sum()), total, matrix.tocsr()

    def _lines(self, u):
        """Images of unit lines along and across the pull, (cells, Gauss, 2) each."""
        local = u.reshape(-1, 2)[self.cells]
        F = np.eye(2) + np.einsum("cni,cgnj->cgij", local, self.gradients)
        return F[..., 0], F[..., 1]

    def _stretches(self, u):
        """Strains along course and wale at all Gauss points, (n,) each."""
        both = [np.linalg.norm(v, axis=-1).ravel() - 1.0 for v in self._lines(u)]
        return both if self.direction == "course" else both[::-1]

    def pull(self, strains):
        """(force per width (N/m), strain between marks, lateral strain in the middle), (n,) each, at
        strains of the clamps (n,), rising.  Raises ComputationError where no equilibrium is found."""
        u = np.zeros(2 * len(self.x))
        found, last = [], 0.0
        table = self.membrane.along if self.direction == "course" else self.membrane.across
        for strain in strains:
            # Somewhere between the clamps the fabric is stretched as much as they say, or more.
            if strain > table[-1]:
                raise self._beyond(strain)
            u = u.reshape(-1, 2)
            u[:, 0] += (strain - last) * self.x[:, 0]
            u = self._settled(u.ravel())
            last = strain
            if not self.membrane.holds(*self._stretches(u)).all():
                raise self._beyond(strain)
            gradient = self.energy(u)[1]
            force = gradient[2 * self.clamp].sum() / self.size[1]
            at = u.reshape(-1, 2)[self.axis, 0]
            mark = MARKS * self.size[0]
            inside = np.interp(mark, self.x[self.axis, 0], at) / mark
            edge = self.middle[-1]
            found.append((force, inside, u[2 * edge + 1] / self.size[1]))
        return np.transpose(found)

    def _beyond(self, strain):
        return ComputationError(f"membrane: beyond its table at {100 * strain:.3g} % of the clamps")

    def _settled(self, u):
        value, gradient, hessian = self.energy(u)
        scale = self.membrane.modulus * self.size.max()
        for _ in range(TRIES):
            if np.abs(gradient[self.free]).max() <= TOLERANCE * scale:
                return u
            inner = hessian[self.free][:, self.free].tocsc()
            shift = 0.0
            for _ in range(HALVINGS):
                step = np.zeros(u.size)
                held = inner + shift * scale * _identity(len(self.free)) / self.size.max()
                step[self.free] = -spsolve(held, gradient[self.free])
                if step @ gradient < 0.0:
                    break
                shift = max(4.0 * shift, 1e-3)
            for part in 0.5 ** np.arange(HALVINGS):
                tried = self.energy(u + part * step)
                if tried[0] <= value + 1e-4 * part * (step @ gradient):
                    break
            u, (value, gradient, hessian) = u + part * step, tried
        raise ComputationError("membrane: Newton's method did not reach the tolerance")


def _identity(n):
    from scipy.sparse import identity

    return identity(n, format="csc")


def force_factor(relaxed, direction, length, width, strains, membrane=None):
    """Force per width of a clamped specimen over that of the fabric free to contract, (n,), at strains
    (n,) between marks inside, and the same by the strain of the clamps: (by marks, by clamps)."""
    membrane = tabulated(relaxed) if membrane is None else membrane
    strains = np.asarray(strains, dtype=float)
    force, inside, _ = Clamped(membrane, direction, length, width).pull(strains)
    free = tensile(relaxed, direction, strains)
    by_clamps = force / free.force_per_width
    by_marks = force / np.interp(inside, free.strain, free.force_per_width)
    return by_marks, by_clamps

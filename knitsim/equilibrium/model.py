"""From a fabric and a resolution to the arrays of the compiled solver."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import newton

from knitsim.equilibrium import cell as cells
from knitsim.equilibrium import spline
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.friction import MEMORY, RUB, Memory, Rub, Slip
from knitsim.equilibrium.kernels.lag import LAG_MEMORY, Couple
from knitsim.equilibrium.kernels.newton import Control
from knitsim.equilibrium.kernels.records import KINK, LATTICE, Scene, Stretch, Touch, records

NEIGHBOURS = 1.6  # diameters of arc below which two places of one yarn do not touch
# Of B/d^2 and of B/l^2, whichever is less: in an open fabric forces are of the order of the latter.
TOLERANCE, OPEN_TOLERANCE = 1e-6, 4e-4
STEP_CAP = 0.15  # diameters
SKIN = 0.15  # diameters
ITERATIONS = 60
FULL_ITERATIONS = 100  # loops that exchange yarn do so slowly
FOLDED_ITERATIONS = 400  # what folds may snap from one shape to another on the way
SPARSE_FROM = 4  # loops in a cell
TRUST = 0
ROUNDED_STRAIN = 4e-4  # half width of the rounding of the tension law's kinks
SET_ROUNDING = 0.02  # rounding of |kappa| near zero, times 2 pi / loop length


@dataclass(frozen=True, eq=False)
class Model:
    """A fabric at a resolution: its scene, the vertices for the crossing check, the settings.

    sparse: whether the Hessian is kept as a sparse matrix, which is faster in large cells.  held: unknowns
    of the state in which the yarn took its set, None without.

    The lattice stands in the unknowns from ``lattice`` on.
    """

    fabric: Fabric
    resolution: Resolution
    cell: cells.Cell
    scene: Scene
    trace: Touch
    expected: np.ndarray
    control: Control
    sparse: bool
    held: np.ndarray | None = None

    @property
    def lattice(self):
        return self.cell.count

    @property
    def loops(self):
        """Loops that the energy of the cell stands for."""
        return self.cell.wales * self.cell.courses

    def free(self, *entries):
        """Numbers of the unknowns that equilibrium decides: all q, and these entries of L."""
        lattice = [self.lattice + e for e in sorted(entries)]
        return np.array([*range(self.cell.count), *lattice], dtype=np.int64)

    def with_load(self, load):
        """Scene under dead loads on the lattice; load: (4,), N per loop."""
        loads = np.zeros(self.cell.count + LATTICE)
        loads[self.lattice : self.lattice + 4] = np.asarray(load) * self.loops
        return self.scene._replace(load=loads)

    @property
    def dense(self):
        """The same model with a dense Hessian, which alone knows how to bend."""
        return replace(self, sparse=False) if self.sparse else self

    @property
    def rub(self):
        """Friction between and within the yarns for the kernels; () where there is none."""
        fabric = self.fabric
        if fabric.friction == 0.0 and fabric.bending_hysteresis == 0.0:
            return ()
        couple = ()
        if fabric.bending_hysteresis > 0.0:
            couple = Couple(fabric.bending_hysteresis, fabric.stuck_ratio * fabric.bending_rigidity)
        shell = fabric.tangential_ratio * fabric.contact.shell(fabric.diameter)
        return Rub(float(fabric.friction), float(shell), couple)

    @property
    def virgin(self):
        """What friction remembers before anything has moved."""
        rub = self.rub
        if rub == ():
            return ()
        lags = np.zeros(0, LAG_MEMORY) if rub.couple else ()
        return Memory(np.zeros(0, MEMORY), np.zeros((0, 0), MEMORY), lags)

    @property
    def at_ease(self):
        """Friction that acts nowhere, for the kernels: as that between the yarns of tests, which most fabrics
        have, so that what finds the state at rest, without it, is compiled once with what pulls it."""
        return Slip(records(RUB, 0), np.zeros((0, 0), RUB), (), np.array([1.0, 0.0]))


def rounded_law(law):
    """The tension law with rounded kinks for the kernels (:class:`Stretch`).

    law: TensionLaw.  Each kink is rounded over +-4e-4 strain, less where kinks lie closer together
    or closer to zero.
    """
    strain, tension = law.strain, law.tension
    width = np.diff(strain)
    slope = np.diff(tension)[width > 0] / width[width > 0]
    kinks = np.unique(strain[1:-1])
    jump = np.zeros(len(kinks))
    for i, kink in enumerate(kinks):
        at = tension[strain == kink]
        jump[i] = at[-1] - at[0]
    gaps = np.diff(np.concatenate([[0.0], kinks, [np.inf]]))
    half = np.minimum(ROUNDED_STRAIN, 0.5 * np.minimum(gaps[:-1], gaps[1:]))
    rounded = records(
        KINK, len(kinks), strain=kinks, slope=np.diff(slope), jump=jump, half_width=half
    )
    return Stretch(float(slope[0]), rounded)


def build_model(fabric, resolution=None, kept=None, sparse=None, slides=False):
    """The :class:`Model` of a fabric (no set).  Raises InputError for a resolution that is too coarse.

    kept: which symmetries of the pattern are used (:data:`.cell.KEPT`), where None all or, in a full
    cell, none.  sparse: whether to use the sparse Hessian, where None in cells of SPARSE_FROM loops or
    more without symmetry.  slides: as in :class:`.cell.Cell`.
    """
    resolution = Resolution() if resolution is None else resolution
    contacts = resolution.contacts_for(fabric)
    kept = kept or ("all" if resolution.cell == "symmetric" else "none")
    cell = cells.cell_of(
        fabric.pattern, resolution.points, contacts, kept, resolution.wales, resolution.courses,
        slides,
    )  # fmt: skip
    lengths = fabric.lengths(cell.courses)
    touch = cells.touch_of(cell, lengths, NEIGHBOURS * fabric.diameter)
    large = cell.wales * cell.courses >= SPARSE_FROM if sparse is None else sparse
    unknowns = cell.count + LATTICE
    scale = np.full(unknowns, 1.0 / (cell.wales * cell.courses))
    scale[: cell.count] = 1.0 / cell.copies
    scale[-1] /= fabric.loop_length  # a couple by the angle
    scene = Scene(
        cell.map,
        cells.rod_of(cell, lengths, fabric.bending_rigidity),
        rounded_law(fabric.law),
        touch,
        fabric.contact.for_kernels(fabric.diameter),
        np.zeros(unknowns),
        scale,
        (),
        (),
    )
    d = fabric.diameter
    limit = ITERATIONS if cell.symmetric else FULL_ITERATIONS
    limit = limit if fabric.pattern.uniform else FOLDED_ITERATIONS
    control = Control(
        fabric.bending_rigidity * min(TOLERANCE / d**2, OPEN_TOLERANCE / fabric.loop_length**2),
        STEP_CAP * d,
        SKIN * d,
        limit,
        TRUST,
        not fabric.pattern.uniform,
    )
    return Model(
        fabric,
        resolution,
        cell,
        scene,
        cells.trace_of(cell, touch),
        cells.expected_crossings(cell),
        control,
        large and not cell.symmetric,
    )


def rubbing(relaxed, fabric):
    """The relaxed state (without set) of a fabric with friction: that of the fabric without."""
    m = relaxed.model
    other = build_model(fabric, m.resolution, m.cell.symmetries, m.sparse, m.cell.slides)
    return replace(relaxed, model=other, others={})


def with_set(model, y):
    """The model whose yarn has taken the set fraction of its curvature in the state y."""
    rod, fabric = model.scene.rod.copy(), model.fabric
    at = cells.placed(model.cell.map, y)[rod.first[:, None] + np.arange(4)]
    v = np.einsum("ma,mak->mk", rod.d1, at)
    a = np.einsum("ma,mak->mk", rod.d2, at)
    speed = np.linalg.norm(v, axis=1)[:, None]
    curvature = fabric.set_fraction * np.cross(v, a) / (speed**2 * rod.span[:, None])
    if fabric.spin == "free":
        rod.rest = np.linalg.norm(curvature, axis=1)
        rod.rounding = SET_ROUNDING * 2.0 * np.pi / fabric.loop_length
        return replace(model, scene=model.scene._replace(rod=rod), held=y)
    rod.facing, rod.turning = v / speed, curvature
    return replace(model, scene=model.scene._replace(rod=rod), held=y)


def with_diameter(model, diameter):
    """The same model with contact from another diameter on, for continuation in the diameter."""
    contact = model.fabric.contact.grown(diameter / model.fabric.diameter)
    return replace(model, scene=model.scene._replace(law=contact.for_kernels(diameter)))


def resampled(model, y, other):
    """Unknowns of another model of the same cell, with other points, for the curves of y."""
    long, n, m = _continued(model, y, 2), model.cell.spans, other.cell.spans
    step = model.cell.wales * np.array([*y[model.lattice : model.lattice + 2], 0.0])
    if m == 2 * n:
        # Subdivided, a spline is the very same curve.
        even = (long[:, :-3] + 6.0 * long[:, 1:-2] + long[:, 2:-1]) / 8.0
        odd = 0.5 * (long[:, 1:-2] + long[:, 2:-1])
        control = np.stack([even, odd], axis=2).reshape(len(long), -1, 3)
    else:
        at = np.arange(m) * n / m
        control = np.array(
            [spline.interpolate_periodic(spline.evaluate(chain, at), step) for chain in long]
        )
    return cells.pack(other.cell, control, y[model.lattice :])


def carried(model, other, y):
    """Unknowns of ``model`` for the shape y of another model of the same fabric and points.

    The model's cell holds whole cells of the other, or fewer unknowns by symmetries that the shape has.
    """
    loops, lattice = cells.loops_of(other.cell, y), y[other.lattice :]
    wide = model.cell.wales // other.cell.wales
    high = model.cell.courses // other.cell.courses
    a1 = np.array([lattice[0], lattice[1], 0.0]) * other.cell.wales
    a2 = np.array([lattice[2], lattice[3], 0.0]) * other.cell.courses
    loops = np.concatenate([loops + i * a1 for i in range(wide)], axis=1)
    loops = np.concatenate([loops + j * a2 for j in range(high)], axis=0)
    alike = model.cell.symmetries == other.cell.symmetries
    if not alike or model.cell.slides < other.cell.slides:
        loops = _in_gauge(model.cell, loops, wide * a1)
    return cells.pack(model.cell, loops, lattice)


def _in_gauge(cell, loops, step):
    """Control points of all loops moved and slid along their yarns to where a cell with fewer symmetries
    holds them (:meth:`.cell._Layout._gauge`), for the same shapes.
    """
    sign, loops = np.array([one.sign for one in cell.symmetries]), loops.copy()
    left, right, first = cell.points // 4, 3 * cell.points // 4, cell.pieces[0]
    if (sign[:, 1] > 0).all():
        for course in dict.fromkeys(piece.course for piece in cell.pieces):
            if not cell.slides:
                loops[course] = _slid(loops[course], step, left, right)
        loops[..., 1] -= loops[first.course, left, 1]
    if (sign[:, 0] > 0).all():
        loops[..., 0] -= loops[first.course, first.first, 0]
    if (sign[:, 2] > 0).all():
        loops[..., 2] -= loops[..., 2].mean()
    return loops


def _slid(control, step, left, right):
    """Control points of the same curve slid along it until two of them are at the same height."""
    chain, n = np.concatenate([control[-1:] - step, control, control[:2] + step]), len(control)

    def moved(by):
        turns, u = np.divmod(np.arange(n) + by, n)
        points = spline.evaluate(chain, u) + turns[:, None] * step
        return spline.interpolate_periodic(points, step)

    def apart(by):
        there = moved(by)
        return there[right, 1] - there[left, 1]

    if abs(control[right, 1] - control[left, 1]) <= 1e-12 * abs(step[0]):
        return control
    try:
        by = newton(apart, 0.0, x1=0.1, tol=1e-9)
    except RuntimeError:  # no such place: what settles the shape moves it there
        return control
    return moved(by)


def centrelines(model, y, per_span=2):
    """Points along every loop of the cell, ``per_span`` a span and the end, m.

    (loops, points per_span + 1, 3); loops course by course, along the yarn.
    """
    long, n = _continued(model, y, 2), model.cell.points
    u = np.arange(n * per_span + 1) / per_span
    found = [
        spline.evaluate(chain[i * n : (i + 1) * n + 3], u)
        for chain in long
        for i in range(model.cell.wales)
    ]
    return np.array(found)


def centreline(model, y, per_span=2):
    """Points along the first loop of the cell, (points per_span + 1, 3), m."""
    return centrelines(model, y, per_span)[0]


def _continued(model, y, beyond):
    """Control points of all courses with one more before and ``beyond`` more after, (courses, n, 3)."""
    loops, lattice = cells.loops_of(model.cell, y), y[model.lattice :]
    step = model.cell.wales * np.array([lattice[0], lattice[1], 0.0])
    return np.concatenate([loops[:, -1:] - step, loops, loops[:, :beyond] + step], axis=1)

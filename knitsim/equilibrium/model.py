"""From a fabric and a resolution to the arrays of the compiled solver."""

from dataclasses import dataclass, replace

import numpy as np

from knitsim.equilibrium import cell as cells
from knitsim.equilibrium import spline
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.friction import MEMORY, Memory, Rub
from knitsim.equilibrium.kernels.lag import LAG_MEMORY, Couple
from knitsim.equilibrium.kernels.newton import Control
from knitsim.equilibrium.kernels.records import KINK, LATTICE, Scene, Stretch, Touch, records

NEIGHBOURS = 1.6  # diameters of arc below which two places of one yarn do not touch
# Of B/d^2 and of B/l^2, whichever is less: in an open fabric forces are of the order of the latter.
TOLERANCE, OPEN_TOLERANCE = 1e-6, 1e-4
STEP_CAP = 0.15  # diameters
SKIN = 0.15  # diameters
ITERATIONS = 60
FULL_ITERATIONS = 100  # loops that exchange yarn do so slowly
SPARSE_FROM = 4  # loops in a cell
TRUST = 0
ROUNDED_STRAIN = 4e-4  # half width of the rounding of the tension law's kinks
SET_ROUNDING = 0.02  # rounding of |kappa| near zero, times 2 pi / loop length


@dataclass(frozen=True, eq=False)
class Model:
    """A fabric at a resolution: its scene, the vertices for the crossing check, the settings.

    sparse: whether the Hessian is kept as a sparse matrix, which is faster in large cells.

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
            couple = Couple(
                fabric.bending_hysteresis, fabric.stuck_rigidity * fabric.bending_rigidity
            )
        shell = fabric.sticking * fabric.contact.shell(fabric.diameter)
        return Rub(float(fabric.friction), float(shell), couple)

    @property
    def virgin(self):
        """What friction remembers before anything has moved."""
        rub = self.rub
        if rub == ():
            return ()
        lags = np.zeros(0, LAG_MEMORY) if rub.couple else ()
        return Memory(np.zeros(0, MEMORY), np.zeros((0, 0), MEMORY), lags)


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


def build_model(fabric, resolution=None, sparse=None):
    """The :class:`Model` of a fabric (no set).  Raises InputError for a resolution that is too coarse.

    sparse: whether to use the sparse Hessian, where None in cells of SPARSE_FROM loops or more.
    """
    resolution = Resolution() if resolution is None else resolution
    contacts = resolution.contacts_for(fabric)
    if resolution.cell == "quarter":
        cell = cells.quarter(resolution.points, contacts)
    else:
        cell = cells.full(resolution.points, contacts, resolution.wales, resolution.courses)
    touch = cells.touch_of(cell, fabric.loop_length, NEIGHBOURS * fabric.diameter)
    large = cell.wales * cell.courses >= SPARSE_FROM if sparse is None else sparse
    unknowns = cell.count + LATTICE
    scale = np.full(unknowns, 1.0 / (cell.wales * cell.courses))
    scale[: cell.count] = 1.0 / cell.copies
    scale[-1] /= fabric.wale_spacing  # a couple by the angle
    scene = Scene(
        cell.map,
        cells.rod_of(cell, fabric.loop_length, fabric.bending_rigidity),
        rounded_law(fabric.law),
        touch,
        fabric.contact.array(fabric.diameter),
        np.zeros(unknowns),
        scale,
        (),
        (),
    )
    d = fabric.diameter
    control = Control(
        fabric.bending_rigidity * min(TOLERANCE / d**2, OPEN_TOLERANCE / fabric.loop_length**2),
        STEP_CAP * d,
        SKIN * d,
        ITERATIONS if cell.kind == "quarter" else FULL_ITERATIONS,
        TRUST,
    )
    return Model(
        fabric,
        resolution,
        cell,
        scene,
        cells.trace_of(cell, touch),
        cells.expected_crossings(cell),
        control,
        cell.kind == "full" and large,
    )


def with_set(model, y):
    """The model whose yarn has taken the set fraction of its curvature in the state y."""
    scene = model.scene
    rod = scene.rod
    x = cells.control_points(model.cell, y)
    at = x[rod.first[:, None] + np.arange(4)]
    v = np.einsum("ma,mak->mk", rod.d1, at)
    a = np.einsum("ma,mak->mk", rod.d2, at)
    curvature = np.linalg.norm(np.cross(v, a), axis=1) / ((v**2).sum(1) * rod.span)
    rounding = SET_ROUNDING * 2.0 * np.pi / model.fabric.loop_length
    rod = rod.copy()
    rod.rest, rod.rounding = model.fabric.set_fraction * curvature, rounding
    return replace(model, scene=scene._replace(rod=rod))


def with_diameter(model, diameter):
    """The same model with contact from another diameter on, for continuation in the diameter."""
    contact = model.fabric.contact.grown(diameter / model.fabric.diameter)
    return replace(model, scene=model.scene._replace(law=contact.array(diameter)))


def refine(model, y, fine):
    """Unknowns of the ``fine`` model (twice the points) for exactly the curve of y."""
    loop = cells.loop_of(model.cell, y)[: model.cell.points]
    lattice = y[model.lattice :]
    step = np.array([lattice[0], lattice[1], 0.0])
    n = len(loop)
    long = np.concatenate([loop[-1:] - step, loop, loop[:1] + step])
    even = (long[:-2] + 6.0 * long[1:-1] + long[2:]) / 8.0
    odd = 0.5 * (long[1:-1] + long[2:])
    doubled = np.stack([even, odd], axis=1).reshape(2 * n, 3)
    return cells.pack(fine.cell, doubled, lattice)


def centreline(model, y, per_span=2):
    """Points along one loop, ``per_span`` per span and the end: (points per_span + 1, 3), m."""
    loop = cells.loop_of(model.cell, y)[: model.cell.points]
    lattice = y[model.lattice :]
    step = np.array([lattice[0], lattice[1], 0.0])
    chain = np.concatenate([loop[-1:] - step, loop, loop[:2] + step])
    return spline.evaluate(chain, np.arange(len(loop) * per_span + 1) / per_span)

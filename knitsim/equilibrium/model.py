"""From a fabric and a resolution to the arrays of the compiled solver."""

from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium import cell as cells
from knitsim.equilibrium import spline
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.newton import Control
from knitsim.equilibrium.kernels.records import (
    COUPLE,
    CYLINDER,
    KINK,
    LATTICE,
    Bend,
    Scene,
    Stretch,
    Touch,
    records,
)

NEIGHBOURS = 1.6  # diameters of arc below which two places of one yarn do not touch
TOLERANCE = 1e-6  # of B/d^2
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

    The lattice stands in the unknowns at ``lattice`` .. ``lattice`` + 3.
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
        loads[self.lattice :] = np.asarray(load) * self.loops
        return self.scene._replace(load=loads)


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
    scene = Scene(
        cell.map,
        cells.rod_of(cell, fabric.loop_length, fabric.bending_rigidity),
        rounded_law(fabric.law),
        touch,
        records(CYLINDER, 0),
        records(COUPLE, 0),
        Bend(0.0, 0, False),
        fabric.contact.array(fabric.diameter),
        np.zeros(unknowns),
        scale,
    )
    d = fabric.diameter
    control = Control(
        TOLERANCE * fabric.bending_rigidity / d**2,
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
    return _replaced(model, scene._replace(rod=rod))


def with_diameter(model, diameter):
    """The same model with contact from another diameter on, for continuation in the diameter."""
    contact = model.fabric.contact.grown(diameter / model.fabric.diameter)
    return _replaced(model, model.scene._replace(law=contact.array(diameter)))


def _replaced(model, scene):
    return Model(
        model.fabric,
        model.resolution,
        model.cell,
        scene,
        model.trace,
        model.expected,
        model.control,
        model.sparse,
    )


def refine(model, y, fine):
    """Unknowns of the ``fine`` model (twice the points) for exactly the curves of y."""
    doubled = []
    for loop, step in _courses(model, y):
        long = np.concatenate([loop[-1:] - step, loop, loop[:1] + step])
        even = (long[:-2] + 6.0 * long[1:-1] + long[2:]) / 8.0
        odd = 0.5 * (long[1:-1] + long[2:])
        doubled.append(np.stack([even, odd], axis=1).reshape(-1, 3))
    return cells.pack(fine.cell, np.concatenate(doubled), y[model.lattice :])


def centrelines(model, y, per_span=2):
    """Points along every loop of the cell, (loops, points per_span + 1, 3), m.

    The loops of a course stand in turn, then those of the next; the last point of a loop is the first
    of the next one in its course.
    """
    size = model.cell.points * per_span
    lines = []
    for loop, step in _courses(model, y):
        chain = np.concatenate([loop[-1:] - step, loop, loop[:2] + step])
        line = spline.evaluate(chain, np.arange(len(loop) * per_span + 1) / per_span)
        lines += [line[k : k + size + 1] for k in range(0, len(line) - 1, size)]
    return np.array(lines)


def centreline(model, y, per_span=2):
    """The first of the :func:`centrelines`; there is no other in a cell of one loop."""
    return centrelines(model, y, per_span)[0]


def _courses(model, y):
    """(control points (m, 3), step to their next image) of each yarn of the cell."""
    lattice = y[model.lattice :]
    step = model.cell.wales * np.array([lattice[0], lattice[1], 0.0])
    loops = cells.loop_of(model.cell, y)
    return [(yarn, step) for yarn in np.split(loops, model.cell.courses)]

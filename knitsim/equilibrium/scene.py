"""What the compiled solver reads: plain arrays, grouped by what they describe.

The unknowns are y = (q, L): the free numbers q of the control points and the lattice L =
(a1 course, a1 wale, a2 course, a2 wale), where a1 carries a loop to the next wale and a2 to the next
course (m).  The control points follow by an affine map, x = C y + x0, stored row by row; symmetry,
periodicity, clamps and the gauge are all rows of this map, so that no kernel knows about them.

Energies are in J per cell (all control points, whatever part of them is unknown); a cell of the
quarter carries its copies in the weights.
"""

from typing import NamedTuple

import numpy as np

LATTICE = 4  # entries of L: a1 course, a1 wale, a2 course, a2 wale


class Map(NamedTuple):
    """The affine map from y to the components of the control points and to L itself.

    start (rows + 1,), column, value: rows in compressed form; offset (rows,): x0.  Row 3 i + axis is
    a component of control point i; the last LATTICE rows are L.
    """

    start: np.ndarray
    column: np.ndarray
    value: np.ndarray
    offset: np.ndarray


class Rod(NamedTuple):
    """Gauss points of the yarn's own energy.

    first: first of the four control points; d0, d1, d2 (m, 4): the basis and its derivatives by the
    parameter; span: reference length of a unit of the parameter (m); weight: reference length that
    the point stands for, times the copies of the cell (m); rest: rest curvature (1/m); stiffness:
    bending rigidity (N m2); rounding (1/m): kappa is taken as sqrt(kappa^2 + rounding^2) where the
    rest curvature is not zero.
    """

    first: np.ndarray
    d0: np.ndarray
    d1: np.ndarray
    d2: np.ndarray
    span: np.ndarray
    weight: np.ndarray
    rest: np.ndarray
    stiffness: np.ndarray
    rounding: float


class Stretch(NamedTuple):
    """A piecewise-linear tension law with rounded kinks (see :mod:`yarn_kernels`)."""

    stiffness: float
    strain: np.ndarray
    slope: np.ndarray
    jump: np.ndarray
    half_width: np.ndarray


class Touch(NamedTuple):
    """Contact points and the operations that carry them to their images.

    first, basis (m, 4): position as in Rod; length (m,): arc length each stands for; arc (m,): place
    along its yarn; yarn (m,): number of its yarn.  Operation g takes x to sign[g] x + m1 a1 + m2 a2
    and the arc s to arc_sign[g] s + arc_shift[g]; inverse[g] is its inverse, or -1 where that is not
    in the list; same[g] tells that it keeps a yarn on itself.  copies: how often the cell counts.
    exclude (m): yarn neighbours closer than this along the arc do not touch.
    """

    first: np.ndarray
    basis: np.ndarray
    length: np.ndarray
    arc: np.ndarray
    yarn: np.ndarray
    sign: np.ndarray
    steps: np.ndarray
    arc_sign: np.ndarray
    arc_shift: np.ndarray
    same: np.ndarray
    inverse: np.ndarray
    copies: float
    exclude: float


class Cylinders(NamedTuple):
    """Rigid cylinders: a point of the axis and its direction (m, 3), contact law (m, 6).

    The law is that of yarn contact with the sum of the radii as diameter; its energy counts per
    length of yarn, so that its K is in N and its k in N/m2.
    """

    point: np.ndarray
    axis: np.ndarray
    law: np.ndarray


class Couples(NamedTuple):
    """Couples that turn the tangent at a place of a yarn.

    first, d1 (m, 4): the place, as in Rod; moment (N m); normal (m, 3): axis of the couple;
    reference (m, 3): direction from which the angle counts, within half a turn of the tangent.
    """

    first: np.ndarray
    d1: np.ndarray
    moment: np.ndarray
    normal: np.ndarray
    reference: np.ndarray


class Bend(NamedTuple):
    """Curvature of the fabric (1/m), positive with the face convex; direction that becomes curved
    (0 course, 1 wale); active: whether the curved energies are taken at all.
    """

    curvature: float
    direction: int
    active: bool


def no_cylinders():
    return Cylinders(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 6)))


def no_couples():
    return Couples(
        np.zeros(0, dtype=np.int64),
        np.zeros((0, 4)),
        np.zeros(0),
        np.zeros((0, 3)),
        np.zeros((0, 3)),
    )


class Scene(NamedTuple):
    """All that the energy of a scene depends on, besides y.

    law (6,): kind of the contact law (0 barrier, 1 core), K (N/m), diameter (m), core (m),
    k (N/m3), p.  load (y size): dead loads, the energy falls by load . y.  scale (y size): the
    residual of unknown i is |gradient_i| scale_i (N), the force on one control point or on L.
    """

    map: Map
    rod: Rod
    stretch: Stretch
    touch: Touch
    cylinders: Cylinders
    couples: Couples
    bend: Bend
    law: np.ndarray
    load: np.ndarray
    scale: np.ndarray

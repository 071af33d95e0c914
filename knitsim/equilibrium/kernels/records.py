"""What the compiled solver reads: plain arrays, grouped by what they describe.

The unknowns are y = (q, L): the free numbers q of the control points and the lattice L =
(a1 course, a1 wale, a2 course, a2 wale, angle), where a1 carries a loop to the next wale and a2 to the
next course (m); angle (rad) is what one loop spans about the axis of a bent fabric, zero in a flat one.
The control points follow by an affine map, x = C y + x0, stored row by row; symmetry, periodicity,
clamps and the gauge are all rows of this map, so that no kernel knows about them.

Energies are in J per cell (all control points, whatever part of them is unknown); a cell of the
quarter carries its copies in the weights.  What a scene does not have is an empty tuple in it, and the
kernels for it are not compiled (:func:`knitsim.jit.choose`).
"""

from typing import NamedTuple

import numpy as np

LATTICE = 5  # entries of L: a1 course, a1 wale, a2 course, a2 wale, angle
# Which of them: the spacings, how far a course is moved along the next by shear, the angle of a loop.
WALE_SPACING, SHEAR, COURSE_SPACING, ANGLE = 0, 2, 3, 4


# A row of each table.  Tables rather than an array per column: with many arrays in the arguments,
# Numba compiles several times as long.
MAP_ROW = np.dtype([("start", "i8"), ("stop", "i8"), ("offset", "f8")], align=True)
MAP_ENTRY = np.dtype([("column", "i8"), ("value", "f8")], align=True)

# Gauss point of the yarn's own energy.  first: first of the four control points; d0, d1, d2: the
# basis and its derivatives by the parameter; span: reference length of a unit of the parameter (m);
# weight: reference length that the point stands for, times the copies of the cell (m); rest: rest
# curvature (1/m) of a yarn that turns freely about itself; stiffness: bending rigidity (N m2); rounding
# (1/m): kappa is taken as sqrt(kappa^2 + rounding^2) where that is not zero.  facing, turning: unit tangent
# and rest curvature vector (1/m) of a yarn that does not turn about itself, zero of one that turns freely.
ROD = np.dtype(
    [
        ("first", "i8"),
        *((name, "f8", 4) for name in ("d0", "d1", "d2")),
        *((name, "f8") for name in ("span", "weight", "rest", "stiffness", "rounding")),
        *((name, "f8", 3) for name in ("facing", "turning")),
    ],
    align=True,
)

# Kink of a tension law at a strain: rise of the slope (N), jump of the tension (N), half width of the
# rounding.
KINK = np.dtype([(name, "f8") for name in ("strain", "slope", "jump", "half_width")], align=True)

# Contact point.  first, basis: position as in ROD; along, turn: the same of its first and second
# derivative by the number of the contact point; length (m): arc length it stands for; arc (m):
# place along its yarn; yarn: number of its yarn.
TOUCH_POINT = np.dtype(
    [
        ("first", "i8"),
        ("yarn", "i8"),
        *((name, "f8", 4) for name in ("basis", "along", "turn")),
        ("length", "f8"),
        ("arc", "f8"),
    ],
    align=True,
)

# Operation that makes an image: x to sign x + steps[0] a1 + steps[1] a2, the arc s to arc_sign s +
# arc_shift, yarn number j to turn j + up; inverse: number of its inverse.
IMAGE = np.dtype(
    [
        ("sign", "f8", 3),
        ("steps", "f8", 2),
        ("arc_sign", "f8"),
        ("arc_shift", "f8"),
        *((name, "i8") for name in ("turn", "up", "inverse")),
    ],
    align=True,
)

# Rigid cylinder: a point of the axis and its direction; the barrier law with the sum of the radii as
# distance, whose energy counts per length of yarn, so that its stiffness is in N.  shell: its stiffness
# where it is first touched, per length of yarn (N/m2).
CYLINDER = np.dtype(
    [
        ("point", "f8", 3),
        ("axis", "f8", 3),
        *((name, "f8") for name in ("distance", "stiffness", "shell")),
    ],
    align=True,
)

# Couple that turns the tangent at a place of a yarn.  first, d1: the place, as in ROD; moment (N m);
# normal: axis of the couple; reference: direction from which the angle counts, within half a turn of
# the tangent.
COUPLE = np.dtype(
    [
        ("first", "i8"),
        ("d1", "f8", 4),
        ("moment", "f8"),
        ("normal", "f8", 3),
        ("reference", "f8", 3),
    ],
    align=True,
)


def records(row, size, **columns):
    """Record array (size,) with rows of the type ``row`` (one of those above), columns as given."""
    made = np.zeros(size, dtype=row).view(np.recarray)
    for name, values in columns.items():
        made[name] = values
    return made


class Map(NamedTuple):
    """The affine map from y to the components of the control points and to L itself.

    rows (MAP_ROW): row r has the entries start .. stop - 1 and the offset x0.  Row 3 i + axis is a
    component of control point i; the last LATTICE rows are L.  entries (MAP_ENTRY): column of y,
    value.
    """

    rows: np.ndarray
    entries: np.ndarray


class Stretch(NamedTuple):
    """A piecewise-linear tension law with rounded kinks (see :mod:`yarn_kernels`).

    stiffness: the first slope (N); kinks (KINK).
    """

    stiffness: float
    kinks: np.ndarray


class Touch(NamedTuple):
    """Contact points and the operations that carry them to their images.

    points (TOUCH_POINT), images (IMAGE).  copies: how often the cell counts.  exclude (m): yarn
    neighbours closer than this along the arc do not touch.  far: most spacings of any one image.
    """

    points: np.ndarray
    images: np.ndarray
    copies: float
    exclude: float
    far: float


class Law(NamedTuple):
    """A contact law: what :mod:`.contact` takes.

    diameter, core (m): at which it begins, below which nothing comes; stiffness: K of the barrier (N/m) or
    k of a core law (N/m3).  soft: () for the barrier, else kind and parameters or table.
    """

    diameter: float
    core: float
    stiffness: float
    soft: np.ndarray


class Bend(NamedTuple):
    """A fabric bent to a cylinder with the face convex where the angle is positive.

    direction that becomes curved: 0 course, 1 wale.  The curvature is the angle of a loop over the
    spacing along that direction.
    """

    direction: int


class Fixtures(NamedTuple):
    """What only the scenes of open yarns have: cylinders (CYLINDER), couples (COUPLE)."""

    cylinders: np.ndarray
    couples: np.ndarray


class Scene(NamedTuple):
    """All that the energy of a scene depends on, besides y and friction.

    rod (ROD): a table.  law: the contact law.
    load (y size): dead loads, the energy falls by load . y.  scale (y size): the residual of unknown i
    is |gradient_i| scale_i (N), the force on one control point or on L.  bend: Bend or ().
    fixtures: Fixtures or ().
    """

    map: Map
    rod: np.ndarray
    stretch: Stretch
    touch: Touch
    law: Law
    load: np.ndarray
    scale: np.ndarray
    bend: Bend
    fixtures: Fixtures


class Bent(NamedTuple):
    """Where the energies of a bent fabric add their derivatives by the curvature kappa.

    by_kappa (2,): first and second derivative; mixed (map rows): derivative of the expanded gradient
    by kappa.
    """

    by_kappa: np.ndarray
    mixed: np.ndarray


class Work(NamedTuple):
    """Buffers of one scene.

    x (n, 3): control points; points (m, 9): contact points, with their first and second derivatives by
    the number of the point; expanded (map rows): gradient by control
    points and lattice; half: a matrix A with their Hessian = A + A^T; gradient, hessian: by y;
    factor: upper Cholesky factor; terms (3,): stretch, bending, contact energy (J); closest (1,):
    smallest squared distance of contact points (m2); bent.
    """

    x: np.ndarray
    points: np.ndarray
    expanded: np.ndarray
    half: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray
    factor: np.ndarray
    terms: np.ndarray
    closest: np.ndarray
    bent: Bent


def no_pairs():
    return np.empty((0, 3), dtype=np.int64), np.empty(0)

"""Where the fibres lie in the cross-section of a yarn.

Each fibre is given the same share of the yarn's area, so a fibre that has i - 1 others inside it
lies at the radius R sqrt((i - 1/2)/n).  From 20 fibres on they stand at successive golden angles
(H. Vogel, Math. Biosci. 44 (1979) 179), which spreads them evenly; fewer stand on balanced rings.
"""

import math
from dataclasses import dataclass

import numpy as np

from knitsim.errors import InputError

MOST_FIBRES = 1000
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))

# Fibres on each ring, from the inside; the arrangements of circles packed closest in a circle.
RINGS = {
    1: (1,), 2: (2,), 3: (3,), 4: (4,), 5: (5,), 6: (1, 5), 7: (1, 6), 8: (1, 7), 9: (1, 8),
    10: (2, 8), 11: (3, 8), 12: (3, 9), 13: (3, 10), 14: (4, 10), 15: (5, 10), 16: (5, 11),
    17: (1, 5, 11), 18: (1, 6, 11), 19: (1, 6, 12),
}  # fmt: skip

# Vogel's lattice is tightest round its centre: its fibres touch at a packing fraction of 0.598.
# Turning the first eight on their circles by these angles (rad) lets them be packed to 0.687.
CORE_TURN = (-0.090, 0.010, -0.071, 0.079, 0.006, 0.0, -0.033, -0.090)


@dataclass(frozen=True, eq=False)
class FibreLayout:
    """The fibres of one cross-section.

    positions: (n, 2), fibre centres about the yarn axis (m), n from 1 to 1000, all different.
    diameter: of the yarn (m).  fibre_diameter (m): None where fibres are points without a size.

    Raises InputError if these are not finite and positive, a fibre centre lies outside the yarn,
    or fibres overlap.
    """

    positions: np.ndarray
    diameter: float
    fibre_diameter: float | None = None
    where: str = "yarn"

    def __post_init__(self):
        positions = np.array(self.positions, dtype=float)
        positions.setflags(write=False)
        object.__setattr__(self, "positions", positions)
        if positions.ndim != 2 or positions.shape[1] != 2:
            raise InputError(f"{self.where}.fibres", positions.shape, "must have the shape (n, 2)")
        check_fibre_count(self.fibres, self.where)
        check_length(self.diameter, f"{self.where}.diameter")
        if self.fibre_diameter is not None:
            check_length(self.fibre_diameter, f"{self.where}.fibre_diameter")
        reach = self.radii.max()
        if not reach <= 0.5 * self.diameter * (1 + 1e-9):
            raise InputError(
                f"{self.where}.fibres",
                f"a centre at {reach:.6g} m from the axis",
                f"must be finite and inside the yarn's radius, {0.5 * self.diameter:.6g} m",
            )
        if not self.smallest_distance > 0:
            raise InputError(f"{self.where}.fibres", "two at one place", "must all be different")
        self._check_overlap()

    def _check_overlap(self):
        if self.fibre_diameter is None:
            return
        # A rounding error must not part fibres that just touch.
        room = min(self.smallest_distance, self.diameter / math.sqrt(self.fibres)) * (1 + 1e-9)
        if self.fibre_diameter > room:
            wider = self.diameter * self.fibre_diameter / room
            raise InputError(
                f"{self.where}.diameter_mm",
                f"{1e3 * self.diameter:.6g}",
                f"{self.fibres} fibres of {1e3 * self.fibre_diameter:.4g} mm overlap; must be at least "
                f"{above(1e3 * wider)} mm, or fibres thinner than {below(1e3 * room)} mm",
            )

    @property
    def fibres(self):
        """Number of fibres n."""
        return len(self.positions)

    @property
    def radii(self):
        """Distance of each fibre centre from the yarn axis (m), shape (n,)."""
        return np.hypot(self.positions[:, 0], self.positions[:, 1])

    @property
    def smallest_distance(self):
        """Smallest distance between two fibre centres (m); infinite for a single fibre."""
        return _smallest_distance(self.positions)

    @property
    def packing_fraction(self):
        """Fibre area over yarn area, n d_f^2 / d^2; None without a fibre diameter."""
        if self.fibre_diameter is None:
            return None
        return self.fibres * (self.fibre_diameter / self.diameter) ** 2


def pack(fibres, diameter, fibre_diameter=None, where="yarn"):
    """``fibres`` (1 to 500) fibres with equal shares of a disc of ``diameter`` (m).

    A ring of several fibres stands at the radius that halves the area its fibres share.  From 20
    fibres on, each has its own radius and circles of fibres touch at a packing fraction of 0.687.

    Returns FibreLayout; raises InputError (its keys start with ``where``) for a count or a size out
    of range and for fibres of ``fibre_diameter`` (m) that would overlap.
    """
    check_fibre_count(fibres, where)
    check_length(diameter, f"{where}.diameter")
    unit = _rings(RINGS[fibres]) if fibres in RINGS else _spiral(fibres)
    return FibreLayout(0.5 * diameter * unit, diameter, fibre_diameter, where)


def solid_diameter(linear_density, fibres, density):
    """Diameter (m) of round, solid fibres; linear_density (kg/m) of the yarn, density (kg/m3) of them."""
    return math.sqrt(4.0 * linear_density / (fibres * math.pi * density))


def _spiral(fibres):
    """Vogel's lattice in the unit disc with its core loosened, shape (fibres, 2)."""
    order = np.arange(1, fibres + 1)
    angle = order * GOLDEN_ANGLE
    angle[: len(CORE_TURN)] += CORE_TURN
    radius = np.sqrt((order - 0.5) / fibres)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _rings(counts):
    """Rings of equal shares in the unit disc, each turned to be farthest from those inside it."""
    placed = np.empty((0, 2))
    for count in counts:
        radius = 0.0 if count == 1 else math.sqrt((len(placed) + 0.5 * count) / sum(counts))
        around = 2.0 * math.pi * np.arange(count) / count
        best, room = None, -1.0
        for turn in 2.0 * math.pi / count * np.arange(180) / 180:
            ring = radius * np.stack([np.cos(around + turn), np.sin(around + turn)], axis=1)
            both = np.concatenate([placed, ring])
            distance = _smallest_distance(both)
            # Equal turns differ by rounding only; the first of them is kept.
            if best is None or distance > room + 1e-9:
                best, room = both, distance
        placed = best
    return placed


def _smallest_distance(positions):
    if len(positions) < 2:
        return math.inf
    one, other = np.triu_indices(len(positions), 1)
    return float(np.hypot(*(positions[one] - positions[other]).T).min())


def check_fibre_count(fibres, where):
    """Raise InputError unless ``fibres`` is a whole number from 1 to 500."""
    whole = not isinstance(fibres, bool) and 1 <= fibres <= MOST_FIBRES and fibres % 1 == 0
    if not whole:
        raise InputError(
            f"{where}.fibres", fibres, f"must be a whole number from 1 to {MOST_FIBRES}"
        )


def check_length(value, where):
    """Raise InputError unless ``value`` is finite and above 0."""
    if not 0 < value < math.inf:
        raise InputError(where, value, "must be finite and above 0")


def below(value):
    """A limit as text to six digits, rounded so that the number shown is itself within it."""
    return f"{value * (1 - 5e-6):.6g}"


def above(value):
    """As :func:`below` for a least value."""
    return f"{value * (1 + 5e-6):.6g}"

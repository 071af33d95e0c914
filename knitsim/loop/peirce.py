"""Peirce's loop: circular arcs and straight legs, laid on a cylinder.

F. T. Peirce, Geometrical principles applicable to the design of functional fabrics, Textile
Research Journal 17 (1947) 123.  Unrolled from its cylinder, whose generators run course-wise, the
tight loop is an arc of radius 1.5 d about the sinker centre, the straight tangent and an arc of
radius 1.5 d about the head's centre, 2 d further course-wise and 2 sqrt(3) d wale-wise; the sinker
centres of the next course lie level with these heads.  Its length is 16.66 d.  Bent onto the
cylinder it stands 3.364 d high between the centres, and that is the course spacing.

An open loop has straight pieces inserted: (w - 4 d)/2 course-wise in the head and in the sinker
loop, (c - 3.364 d)/2 along the wale on either end of each leg.  The length is then

    l = 2 c + w + 5.94 d.

The cylinder is made wider so that the height between centres stays equal to c.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from knitsim.errors import InputError
from knitsim.units import from_si

TIGHT_WALE = 4.0  # closest wale spacing, in diameters: heads touch
TIGHT_COURSE = 3.364  # closest course spacing, in diameters, on the cylinder
IN_ARCS = 5.94  # diameters of length beside 2 c + w
_ARC = 1.5  # radius of the arcs, in diameters
_HEIGHT = 2 * math.sqrt(3)  # between the centres of head and sinker loop, unrolled, in diameters
_LEAN = math.atan2(_HEIGHT, 2.0) + math.asin(2 * _ARC / 4.0)  # of the leg, from the course
_LEG = math.sqrt(7)  # straight tangent between the two arcs, in diameters


def peirce_length(wale_spacing, course_spacing, diameter):
    """Loop length (m) of Peirce's own loop, 2 c + w + 5.94 d."""
    return 2.0 * course_spacing + wale_spacing + IN_ARCS * diameter


@dataclass(frozen=True)
class Peirce:
    """One loop; lengths in m.  radius: of the cylinder; loop_length: exact, on the cylinder."""

    wale_spacing: float
    course_spacing: float
    diameter: float
    radius: float
    loop_length: float

    def points(self, arc):
        """Points (..., 3), m, at arc length (...), 0 at the sinker loop's middle to loop_length."""
        arc = np.asarray(arc, dtype=float)
        mirrored = arc > 0.5 * self.loop_length
        half = np.where(mirrored, self.loop_length - arc, arc)
        # The half loop maps onto itself by half a turn about the middle of its leg.
        upper = half > 0.25 * self.loop_length
        course, wale = self._quarter(np.where(upper, 0.5 * self.loop_length - half, half))
        course = np.where(upper, 0.5 * self.wale_spacing - course, course)
        wale = np.where(upper, -wale, wale)
        course = np.where(mirrored, self.wale_spacing - course, course)
        # From the bottom of the sinker loop, as the curve of Choi and Lo.
        bottom = self._quarter(np.zeros(()))[1] / self.radius
        turn = wale / self.radius
        height = self.radius * (np.sin(turn) - np.sin(bottom))
        thickness = self.radius * (np.cos(turn) - np.cos(bottom))
        return np.stack([course, height, thickness], axis=-1)

    def _quarter(self, arc):
        """Course and wale coordinate, unrolled, from the sinker loop's middle to the leg's."""
        d = self.diameter
        level = 0.25 * (self.wale_spacing - TIGHT_WALE * d)
        rise = 0.5 * (self.course_spacing - TIGHT_COURSE * d)
        centre = -0.5 * (_HEIGHT * d + 2 * rise)
        r = _ARC * d
        lengths = (level, r * math.pi / 2, rise, r * (_LEAN - math.pi / 2))
        # How far along each piece: level, lower arc, rise, upper arc, leg.
        part, rest = [], arc
        for length in lengths:
            part.append(np.clip(rest, 0.0, length))
            rest = rest - length
        part.append(np.maximum(rest, 0.0))
        angle = (part[1] + part[3]) / r
        course = part[0] + r * np.sin(angle) + part[4] * math.cos(_LEAN)
        wale = centre - r * np.cos(angle) + part[2] + part[4] * math.sin(_LEAN)
        return course, wale

    def joints(self):
        """Arc lengths (17,), m, where the pieces of one loop join, with the middles of the legs."""
        d, r = self.diameter, _ARC * self.diameter
        level = 0.25 * (self.wale_spacing - TIGHT_WALE * d)
        rise = 0.5 * (self.course_spacing - TIGHT_COURSE * d)
        ends = np.cumsum([level, r * math.pi / 2, rise, r * (_LEAN - math.pi / 2)])
        quarter = np.concatenate([[0.0], ends, [0.25 * self.loop_length]])
        half = np.concatenate([quarter, 0.5 * self.loop_length - quarter[-2::-1]])
        joints = np.concatenate([half, self.loop_length - half[-2::-1]])
        keep = np.concatenate([[True], np.diff(joints) > 1e-9 * self.loop_length])
        return joints[keep]


def peirce(wale_spacing, course_spacing, diameter, where="loop"):
    """Peirce's loop for spacings and diameter in m.

    Raises InputError, with ``where`` in front, for sizes that are not positive and for spacings
    tighter than 4 d and 3.364 d, where loops are jammed.
    """
    for name, size in (
        ("wale_spacing", wale_spacing), ("course_spacing", course_spacing), ("diameter", diameter)
    ):  # fmt: skip
        if not (math.isfinite(size) and size > 0):
            raise InputError(f"{where}.{name}", size, "must be a finite number above 0")
    for name, size, tight in (
        ("wale_spacing_mm", wale_spacing, TIGHT_WALE),
        ("course_spacing_mm", course_spacing, TIGHT_COURSE),
    ):
        # Tolerance: a tight loop stated in decimal units may fall short by rounding.
        if size < tight * diameter * (1 - 1e-9):
            raise InputError(
                f"{where}.{name}", f"{from_si(size, 'mm'):.5g}",
                f"must be at least {tight:g} yarn diameters, "
                f"{from_si(tight * diameter, 'mm'):.5g} mm, for Peirce's loop",
            )  # fmt: skip
    d = diameter
    w, c = max(wale_spacing, TIGHT_WALE * d), max(course_spacing, TIGHT_COURSE * d)
    height = _HEIGHT * d + (c - TIGHT_COURSE * d)
    # The chord of the unrolled height is c; x = half the angle it spans.
    x = brentq(lambda x: math.sin(x) / x - c / height, 1e-3, 1.0, xtol=1e-15, rtol=1e-14)
    length = (w - TIGHT_WALE * d) + 2 * (c - TIGHT_COURSE * d) + (4 * _ARC * _LEAN + 2 * _LEG) * d
    return Peirce(w, c, d, 0.5 * height / x, length)

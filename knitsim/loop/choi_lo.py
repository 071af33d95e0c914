"""The loop of Choi and Lo, source of the anchors of the paper's loop (Fig. 3).

K. F. Choi and T. Y. Lo, Textile Research Journal 73 (2003) 739.  It stands in for the paper's own
reference for its six anchors, Fukuta, Ohta and Kinari (2011), which could not be had.

Half a loop runs from the middle of the sinker loop (t = 0) to the head (t = 1)::

    course(t)    = a t^3 - 1.5 a t^2 + 0.5 (a + w) t
    wale(t)      = 0.5 (c + 2 e) (1 - cos pi t)
    thickness(t) = 0.5 (h - d) (1 - cos 2 pi t)

and its mirror image about course = w/2 follows for t in [1, 2].  The leg turns back course-wise at
b1 and b2 = 1 - b1.  Two conditions fix a and e: the turns lie chi d apart course-wise and one
course spacing apart wale-wise.  The third fixes h: where the loop, seen from the face, meets the
next course (t3 on the upper, t4 on the lower), the two lie one diameter apart in thickness.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from knitsim.errors import InputError
from knitsim.units import from_si


@dataclass(frozen=True)
class ChoiLo:
    """One solved curve: spacings, diameter, a, e, h in m; chi, b1, t3, t4 without unit."""

    wale_spacing: float
    course_spacing: float
    diameter: float
    chi: float
    a: float
    e: float
    h: float
    b1: float
    t3: float
    t4: float

    def points(self, t):
        """Points (..., 3), m, at parameters t (...) in [0, 2], one wale spacing from end to end."""
        t = np.asarray(t, dtype=float)
        half = np.where(t > 1.0, 2.0 - t, t)
        course = _course(self.a, self.wale_spacing, half)
        wale = (self.course_spacing + 2 * self.e) * np.sin(0.5 * np.pi * half) ** 2
        thickness = (self.h - self.diameter) * np.sin(np.pi * half) ** 2
        course = np.where(t > 1.0, self.wale_spacing - course, course)
        return np.stack([course, wale, thickness], axis=-1)

    def derivative(self, t):
        """d points / dt, shape (..., 3), m, for t in [0, 2]."""
        t = np.asarray(t, dtype=float)
        half = np.where(t > 1.0, 2.0 - t, t)
        course = self.a * half * (3 * half - 3) + 0.5 * (self.a + self.wale_spacing)
        height = self.course_spacing + 2 * self.e
        wale = 0.5 * np.pi * height * np.sin(np.pi * half)
        thickness = np.pi * (self.h - self.diameter) * np.sin(2 * np.pi * half)
        back = np.where(t > 1.0, -1.0, 1.0)
        return np.stack([course, back * wale, back * thickness], axis=-1)

    def anchor_parameters(self):
        """t (11,) of the anchors: six on each half loop, the head shared, the last closing."""
        half = np.array([0.0, self.t3, self.b1, 1 - self.b1, 1 - self.t3, 1.0])
        return np.concatenate([half, 2.0 - half[-2::-1]])

    def anchors(self):
        """The anchors (11, 3) in m; the last is the first moved by one wale spacing."""
        points = self.points(self.anchor_parameters())
        points[-1] = points[0] + (self.wale_spacing, 0.0, 0.0)
        return points


def _course(a, wale_spacing, t):
    return t * (a * t * (t - 1.5) + 0.5 * (a + wale_spacing))


def choi_lo(wale_spacing, course_spacing, diameter, chi, where="loop"):
    """Solve the curve for spacings and diameter (m) and chi (1) > 0.

    Raises InputError, with ``where`` in front, for sizes that are not positive, or if the loop does
    not meet the next course (no t3).  The other unknowns always have one real solution:
    with y = a - 2 w and delta = chi d, the course-wise condition is y^3 = 108 delta^2 (y + 2 w),
    which has one positive root, and b1 lies between 0.2113 and 0.5.
    """
    for name, size in (
        ("wale_spacing", wale_spacing), ("course_spacing", course_spacing),
        ("diameter", diameter), ("chi", chi),
    ):  # fmt: skip
        if not (math.isfinite(size) and size > 0):
            raise InputError(f"{where}.{name}", size, "must be a finite number above 0")
    solved = solve(wale_spacing, course_spacing, diameter, chi)
    if solved is None:
        raise InputError(
            f"{where}.chi", f"{chi:g}",
            "gives a loop so wide that it passes beside the next course (no t3); must be below "
            f"{wale_spacing / (2 * diameter):.4g} to be sure, at a wale spacing of "
            f"{from_si(wale_spacing, 'mm'):.4g} mm and a diameter of "
            f"{from_si(diameter, 'mm'):.4g} mm",
        )  # fmt: skip
    return solved


def solve(wale_spacing, course_spacing, diameter, chi):
    """As :func:`choi_lo` for sizes known to be positive; None where there is no t3."""
    w, c, d = wale_spacing, course_spacing, diameter
    delta2 = (chi * d) ** 2
    bound = math.sqrt(108 * delta2) + (216 * w * delta2) ** (1 / 3)
    y = brentq(
        lambda y: y**3 - 108 * delta2 * (y + 2 * w), 0.0, bound, xtol=1e-15 * bound, rtol=1e-14
    )
    a = 2 * w + y
    b1 = 0.5 * (1 - math.sqrt(y / (3 * a)))
    e = 0.5 * c * (1 / math.cos(math.pi * b1) - 1)

    # wale(t4) - wale(t3) = c gives t4; cos(pi b1) = c / (c + 2 e).
    drop = 2 * math.cos(math.pi * b1)

    def upper(t3):
        return math.acos(min(1.0, max(-1.0, math.cos(math.pi * t3) - drop))) / math.pi

    def gap(t3):
        return _course(a, w, t3) - _course(a, w, upper(t3))

    # A root needs t4 >= b1: before the turn the course coordinate only rises.  Beyond, the gap
    # rises up to chi d at t3 = b1, so that one root lies below b1 or none.  (The pair above b1,
    # mirrored about t = 1/2, gives h < 0.)
    t4_at_turn = math.cos(math.pi * b1) + drop
    low = math.acos(t4_at_turn) / math.pi if t4_at_turn < 1 else 0.0
    if gap(low) >= 0:
        return None
    t3 = brentq(gap, low, b1, xtol=1e-16, rtol=1e-14)
    t4 = upper(t3)
    h = d * (2 / (math.cos(2 * math.pi * t3) - math.cos(2 * math.pi * t4)) + 1)
    return ChoiLo(w, c, d, chi, a, e, h, b1, t3, t4)

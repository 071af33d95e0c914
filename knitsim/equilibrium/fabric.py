"""What the equilibrium model must know of a fabric, and how finely it is to be solved."""

import math
from dataclasses import dataclass, field

import numpy as np

from knitsim.equilibrium.contact import BarrierContact, ContactLaw
from knitsim.equilibrium.pattern import Pattern
from knitsim.errors import InputError
from knitsim.yarn.law import TensionLaw

LEAST_POINTS = 24
# Loop length over diameter below which nobody has knitted anything, however soft the yarn.  What has no
# room above that is found by the search for a start.
LEAST_BULK = 4.0
JERSEY = Pattern.of("jersey")


def _within(where, value, low, high, unit=""):
    if not (isinstance(value, (int, float, np.number)) and low <= value <= high):
        raise InputError(where, value, f"must be between {low:g} and {high:g}{unit}")


@dataclass(frozen=True, eq=False)
class Fabric:
    """A weft knit and the yarn in it; all SI.

    wale_spacing, course_spacing: as stated (m), those at which the yarn took its set; None where they
    are not known, which a fabric without set can do without.  loop_length: of yarn in a stitch, the mean
    over the cell (m); diameter (m); bending_rigidity (N m2); law: tension of the yarn, taken as
    reversible; contact: compression of the yarn; friction: Coulomb's coefficient between yarns;
    set_fraction: rest curvature of the yarn as a part of the curvature magnitude of the loop held at the
    stated spacings (0 straight, 1 fully set); bending_hysteresis: couple by which the yarn's moment lags
    behind its curvature (N m), half the width of the yarn's own hysteresis loop.  tangential_ratio: stiffness
    of a contact along the yarns before they slide, over that across them where they first touch;
    stuck_ratio: how much stiffer the yarn bends before its fibres slide, over its bending rigidity.
    spin: whether the yarn turns about itself as its shape changes: "held" (not at all, so that its set
    keeps its direction) or "free" (without resistance).  pattern: of knit and purl; course_lengths: loop
    length of each course of the pattern over the mean, empty where all are the same (yarn slides from
    stitch to stitch within a course, so that only the length of a whole course counts).

    Raises InputError for values that make no sense.
    """

    wale_spacing: float | None
    course_spacing: float | None
    loop_length: float
    diameter: float
    bending_rigidity: float
    law: TensionLaw
    contact: ContactLaw = field(default_factory=BarrierContact)
    friction: float = 0.0
    set_fraction: float = 0.0
    bending_hysteresis: float = 0.0
    tangential_ratio: float = 1.0
    stuck_ratio: float = 20.0
    spin: str = "held"
    pattern: Pattern = JERSEY
    course_lengths: tuple = ()

    def __post_init__(self):
        for name in ("wale_spacing", "course_spacing", "loop_length", "diameter"):
            if getattr(self, name) is not None or not name.endswith("spacing"):
                _within(name.replace("_", " "), getattr(self, name), 1e-6, 1.0, " m")
        _within("bending rigidity", self.bending_rigidity, 1e-15, 1e-2, " N m2")
        _within("friction", self.friction, 0.0, 1.0)
        _within("set fraction", self.set_fraction, 0.0, 1.0)
        _within("bending hysteresis", self.bending_hysteresis, 0.0, 1.0, " N m")
        _within("tangential ratio", self.tangential_ratio, 1e-3, 1e3)
        _within("stuck ratio", self.stuck_ratio, 1e-3, 1e6)
        if self.spin not in ("held", "free"):
            raise InputError("spin", self.spin, "must be held or free")
        if not isinstance(self.law, TensionLaw):
            raise InputError("law", self.law, "must be a TensionLaw")
        object.__setattr__(self, "pattern", Pattern.of(self.pattern))
        if self.course_lengths and len(self.course_lengths) != self.pattern.courses:
            raise InputError(
                "loop length", self.course_lengths, f"must be one, or one for each of the "
                f"{self.pattern.courses} courses of the pattern",
            )  # fmt: skip
        self.contact.check(self.diameter)
        if self.loop_length < LEAST_BULK * self.diameter:
            raise InputError(
                "diameter", self.diameter,
                f"yarn too thick for its loop: must be {1e3 * self.loop_length / LEAST_BULK:.4g} mm thick or "
                f"less, or the loop length {1e3 * LEAST_BULK * self.diameter:.4g} mm or more",
            )  # fmt: skip
        if self.set_fraction > 0.0 and None in (self.wale_spacing, self.course_spacing):
            raise InputError(
                "set", self.set_fraction,
                "needs wale and course spacing: those at which the yarn took its set",
            )  # fmt: skip

    def lengths(self, courses):
        """Loop length (m) of each of a number of courses, (courses,)."""
        parts = self.course_lengths or (1.0,)
        return self.loop_length * np.resize(np.array(parts) / np.mean(parts), courses)


@dataclass(frozen=True)
class Resolution:
    """How finely a fabric is solved.

    points: control points per loop, a multiple of 4; contacts: contact points per loop, a multiple
    of 4, or None for the spacing that the contact law needs; cell: "symmetric" (as little of the yarn as
    the symmetry of the pattern leaves) or "full", the latter with wales by courses periods of the
    pattern.
    """

    points: int = 48
    contacts: int | None = None
    cell: str = "symmetric"
    wales: int = 1
    courses: int = 1

    def __post_init__(self):
        if self.points < LEAST_POINTS or self.points % 4:
            raise InputError(
                "points", self.points, f"must be a multiple of 4, {LEAST_POINTS} or more"
            )
        if self.cell not in ("symmetric", "full"):
            raise InputError("cell", self.cell, "must be symmetric or full")
        if self.wales < 1 or self.courses < 1:
            raise InputError("cell", f"{self.wales} x {self.courses}", "must hold 1 period or more")
        if self.cell == "symmetric" and (self.wales, self.courses) != (1, 1):
            raise InputError("cell", "symmetric", "must be full for more than one period")

    def contacts_for(self, fabric):
        """Contact points per loop for a fabric.  Raises InputError where the stated ones are few."""
        spacing = fabric.contact.spacing(fabric.diameter, fabric.bending_rigidity)
        needed = 4 * math.ceil(fabric.loop_length / spacing / 4.0 - 1e-2)
        if self.contacts is None:
            return max(needed, 2 * self.points)
        if self.contacts % 4:
            raise InputError("contacts", self.contacts, "must be a multiple of 4")
        # Half of them still resolve the contact, with four times the error.
        needed = 4 * math.ceil(needed / 8.0)
        if self.contacts < needed:
            raise InputError(
                "contacts",
                self.contacts,
                f"too coarse for the contact law: {needed} contact points per loop or more",
            )
        return self.contacts

    def refined(self, fabric):
        """Twice the control points and contact points."""
        return Resolution(
            2 * self.points, 2 * self.contacts_for(fabric), self.cell, self.wales, self.courses
        )

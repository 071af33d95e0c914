"""What the equilibrium model must know of a fabric, and how finely it is to be solved."""

import math
from dataclasses import dataclass, field

import numpy as np

from knitsim.equilibrium.contact import BarrierContact, ContactLaw
from knitsim.errors import InputError
from knitsim.yarn.law import TensionLaw

LEAST_POINTS = 24
# Below this ratio of loop length to diameter no plain loop closes without deep compression.
LEAST_BULK_SOFT, LEAST_BULK_HARD = 7.5, 12.0


def _within(where, value, low, high, unit=""):
    if not (isinstance(value, (int, float, np.number)) and low <= value <= high):
        raise InputError(where, value, f"must be between {low:g} and {high:g}{unit}")


@dataclass(frozen=True, eq=False)
class Fabric:
    """A plain knit: stated spacings and the yarn in it; all SI.

    wale_spacing, course_spacing: as stated (m), where the search for equilibrium starts;
    loop_length (m); diameter (m); bending_rigidity (N m2); law: tension of the yarn, taken as
    reversible; contact: compression of the yarn; friction: Coulomb's coefficient between yarns;
    set_fraction: rest curvature of the yarn as a part of the curvature magnitude of the loop held at
    the stated spacings (0 straight, 1 fully set); bending_hysteresis: couple by which the yarn's
    moment lags behind its curvature (N m), half the width of the yarn's own hysteresis loop.  sticking:
    stiffness of a contact along the yarns before they slide, over that across them where they first
    touch; stuck_rigidity: how much stiffer the yarn bends before its fibres slide, over its bending
    rigidity.

    Raises InputError for a fabric that cannot exist.
    """

    wale_spacing: float
    course_spacing: float
    loop_length: float
    diameter: float
    bending_rigidity: float
    law: TensionLaw
    contact: ContactLaw = field(default_factory=BarrierContact)
    friction: float = 0.0
    set_fraction: float = 0.0
    bending_hysteresis: float = 0.0
    sticking: float = 1.0
    stuck_rigidity: float = 20.0

    def __post_init__(self):
        for name in ("wale_spacing", "course_spacing", "loop_length", "diameter"):
            _within(name.replace("_", " "), getattr(self, name), 1e-6, 1.0, " m")
        _within("bending rigidity", self.bending_rigidity, 1e-15, 1e-2, " N m2")
        _within("friction", self.friction, 0.0, 1.0)
        _within("set fraction", self.set_fraction, 0.0, 1.0)
        _within("bending hysteresis", self.bending_hysteresis, 0.0, 1.0, " N m")
        _within("sticking", self.sticking, 1e-3, 1e3)
        _within("stuck rigidity", self.stuck_rigidity, 1e-3, 1e6)
        if not isinstance(self.law, TensionLaw):
            raise InputError("law", self.law, "must be a TensionLaw")
        self.contact.check(self.diameter)
        core = self.contact.core(self.diameter)
        bulk = self.loop_length / self.diameter
        least = LEAST_BULK_SOFT if core else LEAST_BULK_HARD
        if bulk < least:
            raise InputError(
                "diameter",
                self.diameter,
                f"yarn too thick for its loop: loop length over diameter is {bulk:.3g}, "
                f"must be {least:g} or more",
            )
        hard = core or 0.8 * self.diameter
        for name, value, least in (
            ("wale spacing", self.wale_spacing, 2.0),
            ("course spacing", self.course_spacing, 1.0),
        ):
            if value < least * hard:
                raise InputError(
                    name,
                    value,
                    f"no room for the yarn: {name} must be {1e3 * least * hard:.4g} mm or more",
                )
        # Two legs that reach beyond a course spacing at each end, and the way across.
        shortest = math.hypot(self.wale_spacing, 2.0 * (self.course_spacing + hard))
        if self.loop_length < shortest:
            raise InputError(
                "loop length",
                self.loop_length,
                f"loop too short to reach the next course: must be {1e3 * shortest:.4g} mm or more",
            )
        longest = 4.0 * (self.wale_spacing + 2.0 * self.course_spacing)
        if self.loop_length > longest:
            raise InputError(
                "loop length",
                self.loop_length,
                f"loop too long to stay looped at these spacings: must be {1e3 * longest:.4g} mm or less",
            )


@dataclass(frozen=True)
class Resolution:
    """How finely a fabric is solved.

    points: control points per loop, a multiple of 4; contacts: contact points per loop, a multiple
    of 4, or None for the spacing that the contact law needs; cell: "quarter" (a symmetric loop) or
    "full", the latter with wales by courses loops.
    """

    points: int = 48
    contacts: int | None = None
    cell: str = "quarter"
    wales: int = 1
    courses: int = 1

    def __post_init__(self):
        if self.points < LEAST_POINTS or self.points % 4:
            raise InputError(
                "points", self.points, f"must be a multiple of 4, {LEAST_POINTS} or more"
            )
        if self.cell not in ("quarter", "full"):
            raise InputError("cell", self.cell, "must be quarter or full")
        if self.wales < 1 or self.courses < 1:
            raise InputError("cell", f"{self.wales} x {self.courses}", "must hold 1 loop or more")
        if self.cell == "quarter" and (self.wales, self.courses) != (1, 1):
            raise InputError("cell", "quarter", "must be full for more than one loop")

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

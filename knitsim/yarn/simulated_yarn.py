"""A uniform yarn of twisted fibres, as data: what it is made of and how its sections follow."""

import math
from dataclasses import dataclass

import numpy as np

from knitsim.errors import InputError
from knitsim.yarn import hearle
from knitsim.yarn.law import TensionLaw
from knitsim.yarn.packing import FibreLayout, below, check_length

STEEPEST_ANGLE = math.radians(60.0)
WIDEST_TURN = math.radians(45.0)


@dataclass(frozen=True, eq=False)
class SimulatedYarn:
    """A uniform yarn of n fibres.

    layout: its section as built.  law: tension law of one fibre; if plastic it must not stiffen.
    spacing: between sections (m).  twist: turns per metre, positive Z (right-handed helix),
    negative S.  twist_form: "corrected" turns each section by 2 pi twist spacing; "printed" is eq (1) as
    printed, a reflection, which does not accumulate.
    bending_rigidity: EI of a fibre (N m2), energy 1/2 (EI/h)(phi - phi_built)^2 at each of its
    points, h its distance between sections.  bending_constant (N): adds a bending spring of this
    constant times the spacing, the other reading of the paper's k2.
    section_stiffness (Pa): of a spring inside the section, N/m per metre of yarn, so that the yarn
    does not depend on the spacing; infinite: the section is rigid.

    Raises InputError, with keys that start with ``where``.
    """

    layout: FibreLayout
    law: TensionLaw
    spacing: float
    twist: float
    twist_form: str = "corrected"
    bending_rigidity: float = 0.0
    bending_constant: float = 0.0
    section_stiffness: float = math.inf
    where: str = "yarn"

    def __post_init__(self):
        check_twist(self.twist, self.spacing, self.layout.diameter, self.twist_form, self.where)
        for key in ("bending_rigidity", "bending_constant"):
            value = getattr(self, key)
            if not 0 <= value < math.inf:
                raise InputError(f"{self.where}.{key}", value, "must be finite and not below 0")
        if not self.section_stiffness > 0:
            raise InputError(
                f"{self.where}.section_stiffness",
                self.section_stiffness,
                "must be above 0 (infinite: a rigid section)",
            )
        slopes = np.diff(self.law.tension) / np.maximum(np.diff(self.law.strain), 1e-300)
        if self.law.plastic and slopes.max() > slopes[0] * (1 + 1e-9):
            raise InputError(
                f"{self.where}.law",
                f"slopes {slopes.tolist()} N",
                "a plastic law must not stiffen: it unloads along its first slope",
            )
        if self.deformable and (np.diff(self.law.strain) == 0).any():
            raise InputError(
                f"{self.where}.law",
                self.law.strain.tolist(),
                "a law that jumps needs a rigid section: a fibre at a jump has no equilibrium",
            )

    @property
    def turn(self):
        """The matrix M (2, 2) that maps a section onto the next."""
        return turn_matrix(self.twist, self.spacing, self.twist_form)

    @property
    def deformable(self):
        """Whether there is a section to solve; if not, each fibre is evaluated by itself.

        Nothing moves in a rigid section, without twist, or where all fibres lie on the axis.
        """
        across = (self.turn - np.eye(2)) @ self.layout.positions.T
        return bool(math.isfinite(self.section_stiffness) and (across != 0).any())


def as_corrected(law, layout, fibre_modulus, **options):
    """SimulatedYarn of fibres that share the ``law`` of the whole yarn and bend elastically.

    k1 and k2 of the paper are then the elastic and the post-yield stiffness of a filament.  fibre_modulus:
    Young's modulus of the fibre (Pa); options: further fields of SimulatedYarn.
    """
    rigidity = fibre_modulus * (math.pi * layout.fibre_diameter**4 / 64.0)
    return SimulatedYarn(
        layout, law.scaled(1.0 / layout.fibres), bending_rigidity=rigidity, **options
    )


def as_printed(law, layout, **options):
    """As section 2 of the paper has it: k1 the tension spring, k2 the bending spring, eq (1) as printed.

    None if the ``law`` of the whole yarn is not one of these two constants.
    """
    fibre = law.scaled(1.0 / layout.fibres)
    if not (fibre.plastic and fibre.strain.size == 3):
        return None
    (k1, k2), end = np.diff(fibre.tension) / np.diff(fibre.strain), fibre.breaking_strain
    tension = TensionLaw([0.0, end], [0.0, k1 * end], end)
    return SimulatedYarn(layout, tension, bending_constant=k2, twist_form="printed", **options)


def check_twist(twist, spacing, diameter, form, where="yarn"):
    """Raise InputError for a twist (turns/m) that cannot be built, or not at this spacing (m)."""
    check_length(spacing, f"{where}.spacing")
    if not math.isfinite(twist):
        raise InputError(f"{where}.twist", twist, "must be finite")
    if form not in ("corrected", "printed"):
        raise InputError(f"{where}.twist_form", form, 'must be "corrected" or "printed"')
    angle = hearle.surface_angle(twist, diameter)
    if angle > STEEPEST_ANGLE:
        raise InputError(
            f"{where}.twist",
            f"{twist:g} turns/m",
            f"puts the surface fibres at {math.degrees(angle):.1f} deg to the axis, above 60; at "
            f"most {below(hearle.twist_of(STEEPEST_ANGLE, diameter))} turns/m at this diameter",
        )
    turn = 2.0 * math.pi * abs(twist) * spacing
    if turn > WIDEST_TURN * (1 + 1e-9):
        most = WIDEST_TURN / (2.0 * math.pi * abs(twist))
        raise InputError(
            f"{where}.spacing",
            f"{spacing * 1e3:g} mm",
            f"a twist of {twist:g} turns/m turns {math.degrees(turn):.1f} deg per section; "
            f"use at most {below(most * 1e3)} mm",
        )


def turn_matrix(twist, spacing, form="corrected"):
    """Eq (1): the matrix (2, 2) from one section to the next.

    Corrected it is a rotation; as printed, [[cos, sin], [sin, -cos]], a reflection, whose square is
    the identity.
    """
    angle = 2.0 * math.pi * twist * spacing
    cos, sin = math.cos(angle), math.sin(angle)
    if form == "printed":
        return np.array([[cos, sin], [sin, -cos]])
    return np.array([[cos, -sin], [sin, cos]])


def fibre_path(layout, spacing, twist, sections, twist_form="corrected"):
    """Points of each fibre in successive sections (Figs 1, 2).

    Returns (sections, n, 3) in m: the two directions of the section and the one along the yarn.
    """
    check_twist(twist, spacing, layout.diameter, twist_form, layout.where)
    if not (sections == int(sections) and sections >= 1):
        raise InputError("sections", sections, "must be a whole number above 0")
    turn = turn_matrix(twist, spacing, twist_form)
    points = np.empty((sections, layout.fibres, 3))
    points[0, :, :2] = layout.positions
    for j in range(1, sections):
        points[j, :, :2] = points[j - 1, :, :2] @ turn.T
    points[:, :, 2] = spacing * np.arange(sections)[:, None]
    return points

"""What textile people state: from which of it the rest follows, and what their names are called here."""

import math

from knitsim import units
from knitsim.study.keys import Follows, Missing

COTTON = 1520.0  # density of the fibre of Peirce's yarns, kg/m3
# Share of fibre in a cotton yarn of Peirce's diameter: about 0.6.
PACKING = 4.0 / (math.pi * COTTON * units.peirce_diameter(1.0) ** 2)
FIBRE_COUNT = units.to_si(1.7, "dtex")  # of a fibre where their number is not stated
MOST_DRAWN = 1000  # fibres that a yarn is drawn with
MODULUS = 2.0  # N/tex, of a spun yarn: 14 cN/tex at 7 %
# Loop length over the spacings of a plain fabric at rest, wet relaxed (Munden 1959, Knapton et al. 1968).
KC, KW = 5.3, 4.1


def packing_rule(yarn):
    """0.6, that of Peirce's diameter for cotton; 0.5 for two fibres, 1 for a monofilament."""
    if yarn["fibres"] == 1:
        return Follows(1.0, "one fibre fills the yarn")
    return 0.5 if yarn["fibres"] == 2 else PACKING


def diameter_rule(yarn):
    """sqrt(4 count/(pi density packing)): for cotton Peirce's 1/(28 sqrt(Ne)) inch."""
    area = yarn["linear_density"] / (yarn["density"] * yarn["packing"])
    diameter = math.sqrt(4.0 * area / math.pi)
    if yarn["fibres"] != 1:
        return diameter
    return Follows(diameter, "that of the one fibre, sqrt(4 count/(pi density))")


def fibres_rule(yarn):
    """Those of the count, such as 150/48 den; else as many of 1.7 dtex as the count has, 2 to 1000."""
    if "filaments" in yarn:
        return Follows(yarn["filaments"], "the filaments of the count")
    return min(max(2, round(yarn["linear_density"] / FIBRE_COUNT)), MOST_DRAWN)


def modulus_rule(yarn):
    """2, where neither tension_law nor tension_curve is given."""
    if yarn["tension_law"] is None and yarn["tension_curve"] is None:
        return units.to_si(MODULUS, "N_per_tex")
    return None


def loop_length_rule(fabric):
    """From tightness_factor and count, or from mass_per_area, density and count."""
    count = fabric["linear_density"]
    if fabric.get("tightness_factor") is not None:
        tex, factor = units.from_si(count, "tex"), fabric["tightness_factor"]
        return Follows(
            math.sqrt(tex) / factor * 1e-2,
            f"sqrt({tex:.4g} tex)/tightness factor {factor:.4g} tex^0.5/cm",
        )
    if fabric.get("mass_per_area") is None:
        raise Missing(
            "give loop_length_mm, or tightness_factor, or mass_per_area_g_per_m2 beside wales and courses"
        )
    w, c = fabric.get("wale_spacing"), fabric.get("course_spacing")
    if w is None or c is None:
        raise Missing(
            "mass per area gives it with both wales_per_cm and courses_per_cm; state both"
        )
    mass, tex = units.from_si(fabric["mass_per_area"], "g_per_m2"), units.from_si(count, "tex")
    return Follows(
        fabric["mass_per_area"] * w * c / count,
        f"mass per area {mass:.4g} g/m2/(wales {1e-2 / w:.4g} per cm x courses {1e-2 / c:.4g} per cm x "
        f"{tex:.4g} tex)",
    )


def _of_jersey(fabric, key):
    """True for jersey, None for a pattern whose density only the equilibrium model knows."""
    if fabric["pattern"] == "jersey":
        return True
    if fabric["set"] > 0.0:
        raise Missing(f"set is of the loop at a stated density; give {key}")
    return None


def wale_spacing_rule(fabric):
    """loop length/4.1, Munden's constant kw; of another pattern than jersey none."""
    return _of_jersey(fabric, "wales_per_cm") and fabric["loop_length"] / KW


def course_spacing_rule(fabric):
    """loop length/5.3, Munden's constant kc; of another pattern than jersey none."""
    return _of_jersey(fabric, "courses_per_cm") and fabric["loop_length"] / KC


# Names of the trade, in small letters, and the keys that they mean here.
MEANT = {
    **dict.fromkeys(
        ("yarn_count", "linear_density", "titre", "titer", "fineness", "yarn_number", "size"), ("count",)
    ),
    **{
        f"{name}_{unit.lower()}": (f"count_{unit}",)
        for name in ("linear_density", "titre", "titer", "fineness", "yarn_count", "yarn_number")
        for unit in units.COUNT_UNITS
    },
    **{name: (f"count_{unit}",) for name, unit in (
        ("tex", "tex"), ("dtex", "dtex"), ("denier", "den"), ("den", "den"), ("ne", "Ne"), ("nm", "Nm"),
        ("nec", "Ne"), ("count_denier", "den"), ("count_decitex", "dtex"), ("cotton_count", "Ne"),
        ("metric_count", "Nm"), ("decitex", "dtex"),
    )},
    **dict.fromkeys(
        ("fibers", "filaments", "fibre_number", "number_of_fibres", "number_of_filaments", "fils"),
        ("fibres",),
    ),
    **dict.fromkeys(
        ("weight", "weight_gsm", "gram_per_m2", "grammage", "areal_density", "areal_mass", "mass_per_area",
         "areal_density_g_per_m2", "weight_g_per_m2", "fabric_weight", "g_per_m2", "mass_gsm"),
        ("mass_per_area_g_per_m2",),
    ),
    **dict.fromkeys(
        ("stitch_length_mm", "stitch_length", "stitch_length_cm", "loop_length", "course_length_mm", "sl_mm",
         "yarn_per_stitch_mm", "l_mm", "lu_mm"),
        ("loop_length_mm",),
    ),
    **dict.fromkeys(("cover_factor", "tf", "k_factor", "tightness", "tightness_factor_tex0.5_per_cm"),
                    ("tightness_factor",)),
    **dict.fromkeys(("wales", "wpc", "wale_density", "wales_cm", "wale_per_cm"), ("wales_per_cm",)),
    **dict.fromkeys(("courses", "cpc", "course_density", "courses_cm", "course_per_cm"), ("courses_per_cm",)),
    **dict.fromkeys(("wpi", "wales_inch", "wales_per_in"), ("wales_per_inch",)),
    **dict.fromkeys(("cpi", "courses_inch", "courses_per_in"), ("courses_per_inch",)),
    **dict.fromkeys(("tpm", "turns_per_m", "twist", "turns_per_metre"), ("twist_per_m",)),
    **dict.fromkeys(("tpi", "turns_per_inch", "twist_per_in"), ("twist_per_inch",)),
    **dict.fromkeys(("mu", "coefficient_of_friction", "friction_coefficient"), ("friction",)),
    **dict.fromkeys(("yarn_diameter_mm", "yarn_diameter", "diameter"), ("diameter_mm",)),
    **dict.fromkeys(("fibre_density", "fiber_density", "density", "fibre_density_g_per_cm3",
                     "specific_gravity"), ("density_g_per_cm3",)),
    **dict.fromkeys(("material", "fibre", "fiber", "fibre_type", "fiber_type", "fibre_material", "polymer"),
                    ("density_g_per_cm3", "fibre_modulus_GPa")),
    **dict.fromkeys(("elongation_at_break", "breaking_elongation", "strain_at_break"), ("breaking_strain",)),
    **dict.fromkeys(("initial_modulus", "modulus", "initial_modulus_n_per_tex", "tenacity_modulus"),
                    ("modulus_N_per_tex",)),
    **dict.fromkeys(("bending_stiffness", "flexural_rigidity", "ei", "bending_rigidity"),
                    ("bending_rigidity_N_mm2",)),
}  # fmt: skip


FAR = 0.15  # of the stated density: that at rest is said to be another


def far_from_stated(fabric, wale_spacing, course_spacing):
    """Lines for spacings at rest (m) that are far from those stated."""
    found = []
    now = {"wale_spacing": wale_spacing, "course_spacing": course_spacing}
    for quantity, what in (("wale_spacing", "wales"), ("course_spacing", "courses")):
        if not fabric.is_stated(quantity):
            continue
        stated, rest = 1e-2 / fabric[quantity], 1e-2 / float(now[quantity])
        if abs(rest / stated - 1.0) > FAR:
            inch = ", per inch?" if abs(stated / rest - 2.54) < 0.6 else ""
            found.append(
                f"{rest:.3g} {what} per cm at rest, {stated:.3g} stated{inch}: tests begin at rest. Was the "
                "fabric relaxed, is the loop length right?"
            )
    return found

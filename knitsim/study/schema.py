"""The table of every key of yarns.yaml, fabrics.yaml and scenes.yaml.

Validation, defaults, conversion to SI, the assumption ledger and the key reference in
config/README.md all come from this one table.  To add a key, add a line; to add a test of a yarn or
fabric, add a section to SCENE and its stage to STAGES.
"""

import math

from knitsim import units
from knitsim.equilibrium.pattern import NAMED
from knitsim.study.contact_keys import Live, barrier_key, law_sections
from knitsim.study.keys import REQUIRED, Key, Section
from knitsim.study.measured_keys import (
    CALIBRATIONS,
    FILE_KEYS,
    MEASURED,
    PREDICTION,
    ZERO_KEY,
)
from knitsim.study.memory_keys import FRICTION_KEYS, HISTORY
from knitsim.study.scene_keys import SCENE as SCENE
from knitsim.study.trade import (
    course_spacing_rule,
    diameter_rule,
    fibres_rule,
    loop_length_rule,
    modulus_rule,
    packing_rule,
    wale_spacing_rule,
)

# Stages of the work, and the stages whose input each needs as well.  Key.stages refers to these.
STAGES = {
    "law": (),
    "yarn": ("law",),
    "centre_line": (),
    "loop": ("centre_line",),
    "kinematic_tension": ("loop", "law"),
    "kinematic_bending": ("loop", "law"),
    "equilibrium": ("centre_line", "law"),
    "equilibrium_rest": ("equilibrium",),
    "equilibrium_tension": ("equilibrium_rest",),
    "equilibrium_shear": ("equilibrium_rest",),
    "equilibrium_bending": ("equilibrium_rest",),
    "yarn_to_fabric": ("equilibrium_rest",),
    "calibration": ("equilibrium_rest",),
    "sensitivity": ("equilibrium_rest",),
}


def closure(stage):
    """``stage`` and every stage that it needs, as a set.  Raises KeyError for an unknown one."""
    return {stage}.union(*(closure(needed) for needed in STAGES[stage]))


# Rules: defaults that follow from values already resolved (SI in, SI out).  The key reference shows
# their docstrings.


def twist_rule(yarn):
    """3.2 sqrt(Ne) turns per inch, at most 45 degrees at the surface."""
    usual = units.twist_from_multiplier(yarn["linear_density"], 3.2)
    return min(usual, 1.0 / (math.pi * yarn["diameter"]))


def section_spacing_rule(yarn):
    """15 degrees of twist from section to section, at most 0.1 mm."""
    return 1e-4 if yarn["twist"] == 0 else min(1e-4, 15.0 / 360.0 / yarn["twist"])


def breaking_rule(yarn):
    """0.07; for a law by points, the strain of its last point."""
    law = yarn["tension_law"]
    return law["strain"][-1] if law and law["kind"] == "points" else 0.07


def bending_rule(yarn):
    """The sum of the bending rigidities of round, solid fibres."""
    area = yarn["linear_density"] / yarn["fibres"] / yarn["density"]
    return yarn["fibres"] * yarn["fibre_modulus"] * area**2 / (4.0 * math.pi)


# A table, laid out by hand.
# fmt: off
ALL = tuple(STAGES)
COUNT = ("law", "yarn", "loop", "equilibrium")

TENSION_LAW = Section(
    name="tension_law",
    about="Tension against strain, stated.",
    stage="law",
    keys=(
        Key("kind", "kind", "choice", "bilinear: k1 to the yield strain, then k2, plastic. secant: "
            "the paper's k3, low e, then high e - offset. points: "
            "straight lines through points.", choices=("bilinear", "secant", "points"),
            default=REQUIRED),
        Key("per", "per", "choice", "Whether the newtons are those of the whole yarn or of each "
            "filament (all fibres side by side).", choices=("yarn", "filament"), default="yarn"),
        Key("k1_N", "k1", "number", "Stiffness (force per strain) up to the yield strain.",
            unit="N", allowed="(0, 1e6]", default=REQUIRED, when=("bilinear",)),
        Key("k2_N", "k2", "number", "Stiffness beyond the yield strain.", unit="N",
            allowed="(0, 1e6]", default=REQUIRED, when=("bilinear",)),
        Key("yield_strain", "yield_strain", "number", "Strain at which k2 takes over.",
            allowed="(0, 1)", default=0.02, when=("bilinear",), plausible=(0.01, 0.04),
            because="not stated; drawn filament yarns yield at 1 to 4 % strain"),
        Key("low_N", "low", "number", "Slope below the switch.", unit="N", allowed="(0, 1e6]",
            default=REQUIRED, when=("secant",)),
        Key("high_N", "high", "number", "Slope above the switch.", unit="N", allowed="(0, 1e6]",
            default=REQUIRED, when=("secant",)),
        Key("offset_N", "offset", "number", "Tension taken off above the switch.", unit="N",
            allowed="(0, 1e6]", default=REQUIRED, when=("secant",)),
        Key("switch_strain", "switch_strain", "number", "Strain of the switch as printed.",
            allowed="(0, 1)", default=REQUIRED, when=("secant",)),
        Key("form", "form", "choice",
            "continuous: break where the two lines meet. printed: jump at the switch strain.",
            choices=("continuous", "printed"), default="continuous", when=("secant",)),
        Key("strain", "strain", "numbers", "Strains of the points, from 0, rising.",
            allowed="[0, 10]", default=REQUIRED, when=("points",)),
        Key("tension_N", "tension", "numbers", "Tensions at these strains, from 0, not falling.",
            unit="N", allowed="[0, 1e6]", default=REQUIRED, when=("points",)),
        Key("plastic", "plastic", "flag", "Unload along the first slope (true) or along the curve.",
            default=False, when=("points",)),
    ),
)

TENSION_CURVE = Section(
    name="tension_curve",
    about="A measured curve that the law is calibrated from. The calibrated law is used; a "
    "tension_law beside it is compared with it.",
    stage="law",
    keys=(
        *FILE_KEYS,
        Key("kind", "kind", "choice", "bilinear: softer beyond yield (filament yarn). two_slope: "
            "stiffer beyond the break (spun yarn, the paper's k3).",
            choices=("bilinear", "two_slope"), default=REQUIRED),
        Key("gauge_length_mm", "gauge_length", "number",
            "Length between the clamps, if the file gives extension and does not state it.",
            unit="mm", allowed="(0, 1e5]"),
        ZERO_KEY,
        Key("rebuilt", "rebuilt", "flag", "Whether the curve was computed from stated constants "
            "instead of measured: a fit to it then finds no more than these.", default=False),
    ),
)

COMPRESSION_CURVE = Section(
    name="compression_curve",
    about="A measured force-thickness curve of two yarns of this kind crossed at right angles; the "
    "compression stiffness is calibrated from it.",
    stage="equilibrium",
    keys=FILE_KEYS,
)

YARN = Section(
    name="yarn",
    about="One yarn.",
    sections=Live(lambda: [TENSION_LAW, TENSION_CURVE, COMPRESSION_CURVE, *law_sections()]),
    keys=(
        Key("source", "source", "text", "Where the data come from.", stages=ALL),
        Key("count_dtex", "linear_density", "count", "Yarn count, g per 10 km.", unit="dtex",
            allowed="(0, 1e6]", default=REQUIRED, stages=COUNT),
        Key("count_tex", "linear_density", "count", "Yarn count, g per km.", unit="tex",
            allowed="(0, 1e5]"),
        Key("count_den", "linear_density", "count", "Yarn count, g per 9 km.", unit="den",
            allowed="(0, 1e6]"),
        Key("count_Ne", "linear_density", "count", "English cotton count, hanks of 840 yd per lb.",
            unit="Ne", allowed="(0, 1000]"),
        Key("count_Nm", "linear_density", "count", "Metric count, m per g.", unit="Nm",
            allowed="(0, 1e4]"),
        Key("count", "linear_density", "count", "Yarn count as the trade writes it, with its unit: 30/1, "
            "30/2 Ne, 2/28 Nm (plies), 150/48 den (filaments), Ne=30.", unit="tex", allowed="(0, 1e5]"),
        Key("fibres", "fibres", "integer", "Fibres (filaments) in the cross-section; 1 is a monofilament. "
            "1000 at most where fibres are drawn.", allowed="[1, 100000]", default=fibres_rule,
            plausible=(0.5, 2.0), stages=COUNT,
            because="not stated; fibres of 1.7 dtex, those of cotton and staple polyester 1.2 to 3"),
        Key("density_g_per_cm3", "density", "number", "Density of the fibre.", unit="g_per_cm3",
            allowed="[0.5, 10]", default=1.52, plausible=(1.14, 1.55), stages=("yarn", "loop", "equilibrium"),
            because="that of cotton; nylon 1.14, acrylic 1.17, wool 1.31, polyester 1.38"),
        Key("packing", "packing", "number", "Share of fibre in the yarn's cross-section, which gives its "
            "diameter where none is stated.", allowed="(0, 1]", default=packing_rule,
            stages=("centre_line",)),
        Key("fibre_modulus_GPa", "fibre_modulus", "number",
            "Young's modulus of the fibre, for its own bending.", unit="GPa", allowed="[0, 1000]",
            default=8.0, plausible=(2.0, 20.0), stages=("yarn", "equilibrium"),
            because="wool and nylon near 2 GPa, cotton 5 to 12, polyester to 20"),
        Key("diameter_mm", "diameter", "number", "Yarn diameter.", unit="mm", allowed="(0, 20]",
            default=diameter_rule, plausible=(0.95, 1.15), stages=("yarn", "centre_line"),
            because="not stated; Peirce's diameter, of cotton a specific volume of 1.1 cm3/g; "
            "yarns lie between 1.0 and 1.45"),
        Key("twist_per_m", "twist", "number", "Turns per metre.", unit="per_m", allowed="[0, 1e5]",
            default=twist_rule, plausible=(0.8, 1.2), stages=("yarn", "loop"),
            because="not stated; spun knitting yarn, English twist multiplier 3.2"),
        Key("twist_per_inch", "twist", "number", "Turns per inch.", unit="per_inch",
            allowed="[0, 2540]"),
        Key("twist_direction", "twist_direction", "choice",
            "Z: right-handed helix. S: left-handed.", choices=("Z", "S"), default="Z",
            stages=("yarn", "loop"), because="not stated; most single yarns are Z"),
        Key("section_spacing_mm", "section_spacing", "number",
            "Distance of neighbouring sections of the simulated yarn.", unit="mm",
            allowed="(0, 10]", default=section_spacing_rule, stages=("yarn",)),
        Key("section_stiffness_MPa", "section_stiffness", "number",
            "Stiffness, per length of yarn, of each spring that holds a section of the simulated "
            "yarn together.", unit="MPa", allowed="(0, 1e6]", default=100.0,
            plausible=(50.0, 1000.0), stages=("yarn",),
            because="not stated; between a loose bundle and the fibres' own transverse "
            "modulus"),
        Key("bending_rigidity_N_mm2", "bending_rigidity", "number", "Bending rigidity of the yarn.",
            unit="N_mm2", allowed="[0, 1e6]", default=bending_rule, plausible=(1.0, 5.0),
            stages=("equilibrium",),
            because="the sum over fibres that slip freely: the least that a yarn can have"),
        barrier_key(),
        Key("friction", "friction", "number", "Coulomb friction coefficient of yarn on yarn.",
            allowed="[0, 1]", default=0.2, plausible=(0.1, 0.3), stages=("equilibrium",),
            because="not stated; waxed to unwaxed spun yarn"),
        *FRICTION_KEYS,
        Key("modulus_N_per_tex", "modulus", "number", "Tension per strain and count, constant up to the "
            "break; for a yarn without tension_law and tension_curve.", unit="N_per_tex", allowed="(0, 1000]",
            default=modulus_rule, plausible=(0.5, 4.0), stages=("law",),
            because="not stated; spun yarns break near 14 cN/tex at 7 %; at the forces of wear yarn hardly "
            "stretches"),
        Key("breaking_strain", "breaking_strain", "number",
            "Strain at break; states beyond it are marked.", allowed="(0, 10]",
            default=breaking_rule, plausible=(0.7, 1.4), stages=("law",),
            because="not stated; cotton yarn breaks near 7 %; a law by "
            "points ends at its last point"),
        Key("scene", "scene", "text", "The test programme: a name in scenes.yaml.",
            default="paper_yarn"),
    ),
)

FABRIC = Section(
    name="fabric",
    about="One weft-knitted fabric.",
    sections=(MEASURED, CALIBRATIONS, PREDICTION),
    keys=(
        Key("source", "source", "text", "Where the data come from.", stages=ALL),
        Key("yarn", "yarn", "text", "A name in yarns.yaml.", default=REQUIRED),
        Key("pattern", "pattern", "pattern", "Knit (k) and purl (p) as seen from the technical face: a "
            f"name ({', '.join(NAMED)}), or the rows of the repeat from the bottom up, `kp/pk` or "
            "`[kp, pk]`, at most 8 x 8. The kinematic model has jersey only: its tests are left out of "
            "other patterns.", default="jersey", stages=("centre_line",)),
        Key("set", "set", "number", "Part of the stated loop's curvature that the yarn has taken "
            "as its rest shape.", allowed="[0, 1]", default=0.0, plausible=(0.0, 0.9),
            stages=("equilibrium",),
            because="not stated; 0 is a yarn that would be straight"),
        Key("loop_length_mm", "loop_length", "number", "Length of yarn in one loop (stitch), the "
            "mean of the pattern.", unit="mm",
            allowed="(0, 200]", default=loop_length_rule, stages=("centre_line",)),
        Key("tightness_factor", "tightness_factor", "number", "Instead of the loop length: sqrt(tex) over "
            "loop length in cm.", allowed="[2, 40]", stages=("centre_line",), gives="loop_length"),
        Key("mass_per_area_g_per_m2", "mass_per_area", "number", "Instead of the loop length: mass of the "
            "fabric per area, beside wales and courses.", unit="g_per_m2", allowed="(0, 1e5]",
            stages=("centre_line",), gives="loop_length"),
        Key("gsm", "mass_per_area", "number", "The same.", unit="g_per_m2", allowed="(0, 1e5]",
            stages=("centre_line",), gives="loop_length"),
        Key("wales_per_cm", "wale_spacing", "number", "Wales per cm of width, of face "
            "and back together.", unit="loops_per_cm",
            allowed="(0, 100]", default=wale_spacing_rule, plausible=(0.9, 1.1), stages=("centre_line",),
            because="not stated; a plain fabric at rest, whose loop length is 3.7 to 4.5 wale spacings; at "
            "rest the equilibrium model finds its own"),
        Key("wales_per_inch", "wale_spacing", "number", "Wales per inch of width.",
            unit="loops_per_inch", allowed="(0, 250]"),
        Key("wale_spacing_mm", "wale_spacing", "number", "Width of one loop.", unit="mm",
            allowed="(0, 100]"),
        Key("courses_per_cm", "course_spacing", "number", "Courses per cm of length.",
            unit="loops_per_cm", allowed="(0, 100]", default=course_spacing_rule, plausible=(0.9, 1.1),
            stages=("centre_line",),
            because="not stated; a plain fabric at rest, whose loop length is 4.7 to 5.9 course spacings; "
            "at rest the equilibrium model finds its own"),
        Key("courses_per_inch", "course_spacing", "number", "Courses per inch of length.",
            unit="loops_per_inch", allowed="(0, 250]"),
        Key("course_spacing_mm", "course_spacing", "number", "Height of one course.", unit="mm",
            allowed="(0, 100]"),
        Key("density_checked", "density_checked", "flag", "That the fabric really has fewer courses than "
            "wales, loops far from those of plain fabrics of its density, or too short for its yarn, which "
            "is asked about.",
            default=False, stages=("centre_line",)),
        Key("course_length_ratios", "course_length_ratios", "numbers", "Loop lengths of the courses of the "
            "pattern to each other, from the bottom up, where they differ; yarn slides from stitch to "
            "stitch within a course.", allowed="(0, 100]", stages=("equilibrium",)),
        Key("centre_line", "centre_line", "choice",
            "spline: through the six anchors of each half loop, as in the "
            "paper. curve: Choi and Lo's curve itself.", choices=("spline", "curve"),
            default="spline", stages=("centre_line",),
            because="the paper's spline; its anchors' reference is not available, "
            "so they are taken from the curve of Choi and Lo (2003)"),
        Key("sections_per_loop", "sections_per_loop", "integer", "Yarn sections along one loop.",
            allowed="[16, 10000]", default=100, stages=("loop",)),
        HISTORY,
        Key("scene", "scene", "text", "The test programme: a name in scenes.yaml.",
            default="paper_fabric"),
    ),
)

MODEL_ASSUMPTIONS = (
    ("torsion_energy", "none", ("equilibrium",),
     "not in the paper; a round section without an end couple carries no torque"),
    ("loop_anchors", "Choi and Lo (2003)", ("centre_line",),
     "the paper's own reference for its six anchors is not available"),
    ("fibre_packing", "equal areas in a disc", ("yarn", "loop"),
     "not in the paper beyond one mass point a fibre"),
    ("yarn_ends", "held against turning", ("yarn",),
     "not in the paper; as between the clamps of a tensile tester"),
)
# fmt: on

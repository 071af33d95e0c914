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
    SENSITIVITY,
    ZERO_KEY,
)
from knitsim.study.memory_keys import FRICTION_KEYS, HISTORY, PROGRAMME, REST_LINE
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
            because="not in the paper; drawn filament yarns yield at 1 to 4 % strain"),
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
            default=8.0, plausible=(2.0, 20.0), stages=("yarn",),
            because="wool and nylon near 2 GPa, cotton 5 to 12, polyester to 20"),
        Key("diameter_mm", "diameter", "number", "Yarn diameter.", unit="mm", allowed="(0, 20]",
            default=diameter_rule, plausible=(0.95, 1.15), stages=("yarn", "centre_line"),
            because="not stated; Peirce's diameter, of cotton a specific volume of 1.1 cm3/g; "
            "yarns lie between 1.0 and 1.45"),
        Key("twist_per_m", "twist", "number", "Turns per metre.", unit="per_m", allowed="[0, 1e5]",
            default=twist_rule, plausible=(0.8, 1.2), stages=("yarn", "loop"),
            because="not in the paper; spun knitting yarn, English twist multiplier 3.2"),
        Key("twist_per_inch", "twist", "number", "Turns per inch.", unit="per_inch",
            allowed="[0, 2540]"),
        Key("twist_direction", "twist_direction", "choice",
            "Z: right-handed helix. S: left-handed.", choices=("Z", "S"), default="Z",
            stages=("yarn", "loop"), because="not in the paper; most single yarns are Z"),
        Key("section_spacing_mm", "section_spacing", "number",
            "Distance of neighbouring sections of the simulated yarn.", unit="mm",
            allowed="(0, 10]", default=section_spacing_rule, stages=("yarn",)),
        Key("section_stiffness_MPa", "section_stiffness", "number",
            "Stiffness, per length of yarn, of each spring that holds a section of the simulated "
            "yarn together.", unit="MPa", allowed="(0, 1e6]", default=100.0,
            plausible=(50.0, 1000.0), stages=("yarn",),
            because="not in the paper; between a loose bundle and the fibres' own transverse "
            "modulus"),
        Key("bending_rigidity_N_mm2", "bending_rigidity", "number", "Bending rigidity of the yarn.",
            unit="N_mm2", allowed="[0, 1e6]", default=bending_rule, plausible=(1.0, 5.0),
            stages=("equilibrium",),
            because="the sum over fibres that slip freely: the least that a yarn can have"),
        barrier_key(),
        Key("friction", "friction", "number", "Coulomb friction coefficient of yarn on yarn.",
            allowed="[0, 1]", default=0.2, plausible=(0.1, 0.3), stages=("equilibrium",),
            because="not in the paper; waxed to unwaxed spun yarn"),
        *FRICTION_KEYS,
        Key("modulus_N_per_tex", "modulus", "number", "Tension per strain and count, constant up to the "
            "break; for a yarn without tension_law and tension_curve.", unit="N_per_tex", allowed="(0, 1000]",
            default=modulus_rule, plausible=(0.5, 4.0), stages=("law",),
            because="not stated; spun yarns break near 14 cN/tex at 7 %; at the forces of wear yarn hardly "
            "stretches"),
        Key("breaking_strain", "breaking_strain", "number",
            "Strain at break; states beyond it are marked.", allowed="(0, 10]",
            default=breaking_rule, plausible=(0.7, 1.4), stages=("law",),
            because="not in the paper; cotton yarn breaks near 7 %; a law by "
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
            because="not in the paper; 0 is a yarn that would be straight"),
        Key("loop_length_mm", "loop_length", "number", "Length of yarn in one loop (stitch), the "
            "mean of the pattern.", unit="mm",
            allowed="(0, 200]", default=loop_length_rule, stages=("centre_line",)),
        Key("tightness_factor", "tightness_factor", "number", "Instead of the loop length: sqrt(tex) over "
            "loop length in cm.", allowed="(0, 1000]", stages=("centre_line",), gives="loop_length"),
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
            "wales, which is asked about.", default=False, stages=("centre_line",)),
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

READINGS = Key("readings", "readings", "choices",
    "The corrected equations, the printed ones, or both.",
    choices=("corrected", "printed"), default=("corrected", "printed"))
DIRECTIONS = Key("directions", "directions", "choices", "Directions tested.",
    choices=("course", "wale"), default=("course", "wale"))
STORE = Key("store", "store", "choices", "Positions stored for every step.",
    choices=("centreline", "fibres"), default=("centreline",), may_be_empty=True)


def viscous_key(default, high):
    return Key("viscous_coefficient_N_s_per_m", "viscous_coefficient", "number",
        "c of the paper's friction F = c v.", unit="N_s_per_m", allowed="[0, 1e9]", default=default,
        plausible=(0.0, high), because="not in the paper; about 1 % of the largest tension")


TENSILE_TEST = Section(
    name="tensile_test",
    about="The simulated yarn pulled at a set velocity.",
    of="yarn",
    stage="yarn",
    keys=(
        Key("max_strain", "max_strain", "number", "Largest strain.", allowed="(0, 1]", default=0.05,
            plausible=(0.02, 0.07), because="not in the paper; past yield and short of the break"),
        Key("steps", "steps", "integer", "Steps up to the largest strain.", allowed="[2, 100000]",
            default=100),
        Key("velocity_mm_per_s", "velocity", "number", "Velocity of the moving clamp.",
            unit="mm_per_s", allowed="(0, 1e6]", default=500 / 60, plausible=(4.0, 85.0),
            because="not in the paper; 500 mm/min, as ISO 2062 has it"),
        Key("gauge_length_mm", "gauge_length", "number", "Length between the clamps.", unit="mm",
            allowed="(0, 1e5]", default=500.0, plausible=(250.0, 500.0),
            because="not in the paper; as ISO 2062 has it"),
        viscous_key(10.0, 50.0),
        READINGS,
        Key("recovery", "recovery", "flag", "Recover to zero force after loading.", default=True),
    ),
)

# How the paper's kinematic tension test is read.  A variant restates any of them.
READING_KEYS = (
    Key("positions", "positions", "choice",
        "Eqs (4), (5). corrected: displacement in proportion to the "
        "distance from the fixed centre. printed: B' = B OB/OC.", choices=("corrected", "printed"),
        default="corrected"),
    Key("contraction", "contraction", "choice",
        "How the lateral contraction grows. isometric: the yarn keeps "
        "its length until the limit. linear: reaches the limit at the largest strain.",
        choices=("isometric", "linear", "none"), default="isometric",
        because="not in the paper, which gives the limit only"),
    Key("limit", "limit", "choice", "Limit of the contraction. half: half of the loop. "
        "course_spacing: course-wise, the loop gets lower by one course spacing.",
        choices=("half", "course_spacing"), default="half",
        because="the paper says half and the same as one course spacing; the two differ"),
    Key("strain", "strain", "choice",
        "The strain in tension = k3 strain: of the yarn or of the fabric.",
        choices=("yarn", "fabric"), default="yarn", because="not said in the paper"),
    Key("law", "law", "choice", "A secant law taken continuous or as printed.",
        choices=("continuous", "printed"), default="continuous"),
    Key("viscous", "viscous", "flag", "Add the paper's friction F = c v.", default=False),
)

VARIANTS = Section(
    name="variants",
    about="Readings of the test, each by a name of your own; the first is the reference. A variant "
    "states what differs from the section.",
    keys=READING_KEYS,
    named=True,
    default_entries={
        "isometric": {},
        "linear": {"contraction": "linear"},
        "linear_other_limit": {"contraction": "linear", "limit": "course_spacing"},
        "fabric_strain": {"strain": "fabric"},
        "law_printed": {"law": "printed"},
        "viscous": {"viscous": True},
        "printed": {"positions": "printed", "contraction": "linear", "law": "printed"},
    },
)

KINEMATIC_TENSION = Section(
    name="kinematic_tension",
    about="The paper's tension test, eqs (4), (5), loading and recovery.",
    of="fabric",
    stage="kinematic_tension",
    sections=(VARIANTS,),
    keys=(
        DIRECTIONS,
        Key("max_strain_course", "max_strain_course", "number",
            "Largest fabric strain, course-wise.", allowed="(0, 5]", default=0.6,
            plausible=(0.4, 0.8),
            because="not in the paper; what plain jersey is stretched to in wear"),
        Key("max_strain_wale", "max_strain_wale", "number", "Largest fabric strain, wale-wise.",
            allowed="(0, 5]", default=0.3, plausible=(0.2, 0.4),
            because="not in the paper; what plain jersey is stretched to in wear"),
        Key("steps", "steps", "integer", "Steps up to the largest strain, and back.",
            allowed="[2, 100000]", default=200),
        *READING_KEYS,
        viscous_key(1000.0, 5000.0),
        Key("velocity_mm_per_s", "velocity", "number", "Velocity of the moving clamp.",
            unit="mm_per_s", allowed="(0, 1e6]", default=0.1, plausible=(0.05, 2.0),
            because="not in the paper; that of the KES tensile tester"),
        STORE,
    ),
)

KINEMATIC_BENDING = Section(
    name="kinematic_bending",
    about="The paper's pure bending, eqs (6) to (11), face and back, through zero curvature.",
    of="fabric",
    stage="kinematic_bending",
    keys=(
        DIRECTIONS,
        Key("max_curvature_per_cm", "max_curvature", "number", "Largest curvature, to both sides.",
            unit="per_cm", allowed="(0, 100]", default=2.5),
        Key("steps", "steps", "integer", "Steps from the one side to the other.",
            allowed="[2, 100000]", default=200),
        Key("loops", "loops", "number", "Length L of the bent model in loops; K = kappa L.",
            allowed="(0, 1000]", default=1.0, plausible=(1.0, 10.0),
            because="not in the paper; one loop is the least that repeats"),
        READINGS,
        STORE,
    ),
)

EQUILIBRIUM_REST = Section(
    name="equilibrium_rest",
    about="The fabric at rest in the equilibrium model, beside the stated density and Munden's "
    "constants; start of the equilibrium tests.",
    of="fabric",
    stage="equilibrium_rest",
    keys=(
        Key("accuracy", "accuracy", "number", "Relative error of spacings, forces and moments (of 1 % "
            "of the largest where they are less) that is asked for. Points, contact points and "
            "increments of each equilibrium test are chosen by its estimated error; each result says "
            "in its attribute settings what was taken.", allowed="[1e-4, 0.5]", default=0.01),
        Key("points", "points", "integer", "Instead of an accuracy: control points of the spline of "
            "one loop, a multiple of 4. The error is then estimated, not acted on.",
            allowed="[24, 640]"),
        Key("cell", "cell", "choice", "symmetric: only what the symmetry of pattern and test leaves of "
            "the cell is solved. full: all of it, without symmetry.", choices=("symmetric", "full"),
            default="symmetric"),
        REST_LINE,
        Key("fit_density", "fit_density", "flag", "Also fit loop length and set so that the fabric at "
            "rest has the stated density.", default=False),
        Key("set_compared", "set_compared", "numbers", "Fractions of set at which the relaxed "
            "density is compared over loop length.", allowed="[0, 1]", default=(0.0, 0.9)),
        Key("loop_length_low", "loop_length_low", "number", "Shortest loop length compared, over "
            "the fabric's own.", allowed="(0, 1]", default=0.95),
        Key("loop_length_high", "loop_length_high", "number", "Longest loop length compared, over "
            "the fabric's own.  Much longer, the loop held at the stated density, from which set is "
            "taken, buckles.", allowed="[1, 3]", default=1.1),
    ),
)

# What one variant of an equilibrium tension test may restate.
EQUILIBRIUM_TENSION_KEYS = (
    Key("friction", "friction", "flag", "Coulomb friction between yarns, with the coefficient of "
        "the yarn; false leaves it out.", default=False),
    Key("lateral", "lateral", "choice", "The spacing across the pull: free to follow, held at "
        "that of rest, or loaded (biaxial).", choices=("free", "held", "loaded"), default="free"),
    Key("lateral_load_gf_per_cm", "lateral_load", "number", "Force per width across the pull, "
        "where lateral is loaded.", unit="gf_per_cm", allowed="[0, 1e5]", default=1.0),
    Key("recovery", "recovery", "flag", "Recover to zero force after loading.", default=False),
    Key("cycles", "cycles", "integer", "Times that the fabric is loaded and recovers.",
        allowed="[1, 1000]", default=1),
    PROGRAMME,
    Key("to_force_gf_per_cm", "to_force", "number", "Loading ends at this force per width where it "
        "comes before the largest strain; KES: 50 for knits, 500.", unit="gf_per_cm",
        allowed="(0, 1e6]"),
    Key("max_strain_course", "max_strain_course", "number", "Largest fabric strain, course-wise.",
        allowed="(0, 5]", default=1.5),
    Key("max_strain_wale", "max_strain_wale", "number", "Largest fabric strain, wale-wise.",
        allowed="(0, 5]", default=0.9),
    Key("states", "states", "integer", "Stored states up to the largest strain, at equal steps.",
        allowed="[2, 10000]", default=30),
)

EQUILIBRIUM_TENSION = Section(
    name="equilibrium_tension",
    about="The tension test in the equilibrium model, from the fabric's own relaxed state.",
    of="fabric",
    stage="equilibrium_tension",
    sections=(
        Section(
            name="variants",
            about="Conditions of the test, each by a name of your own; the first is the "
            "reference. A variant states what differs from the section.",
            keys=EQUILIBRIUM_TENSION_KEYS,
            named=True,
            default_entries={
                "frictionless": {},
                "friction": {
                    "friction": True, "recovery": True, "max_strain_course": 0.6,
                    "max_strain_wale": 0.4,
                },
                "held": {"lateral": "held", "max_strain_course": 0.6, "max_strain_wale": 0.4},
                "kes": {"friction": True, "recovery": True, "to_force_gf_per_cm": 50.0},
            },
        ),
    ),
    keys=(DIRECTIONS, *EQUILIBRIUM_TENSION_KEYS),
)

EQUILIBRIUM_SHEAR = Section(
    name="equilibrium_shear",
    about="Shear in the equilibrium model: from 0 to the largest angle, to the negative one, and "
    "back to 0; courses slide over each other. Always solved on the full cell.",
    of="fabric",
    stage="equilibrium_shear",
    keys=(
        Key("max_angle_deg", "max_angle", "number", "Largest angle, to both sides.", unit="deg",
            allowed="(0, 45]", default=8.0),
        Key("states", "states", "integer", "Stored states up to the largest angle.",
            allowed="[2, 10000]", default=16),
        Key("tension_gf_per_cm", "tension", "number", "Force per width along the wale, kept "
            "throughout.", unit="gf_per_cm", allowed="[0, 1e4]", default=10.0,
            plausible=(5.0, 20.0), because="KES shears woven fabric under 10 gf/cm"),
        Key("friction", "friction", "flag", "Coulomb friction between yarns.", default=True),
    ),
)

# What one variant of an equilibrium bending test may restate.
EQUILIBRIUM_BENDING_KEYS = (
    Key("friction", "friction", "flag", "Coulomb friction between yarns, with the coefficient of "
        "the yarn, and the yarn's own bending hysteresis; false leaves both out.", default=False),
    Key("spacings", "spacings", "choice", "Wale and course spacing: free to follow, or held at "
        "those of rest.", choices=("free", "held"), default="free"),
    Key("set", "set", "number", "Set of the yarn in this test, instead of the fabric's own.",
        allowed="[0, 1]"),
    Key("max_curvature_per_cm", "max_curvature", "number", "Largest curvature, to both sides; KES: "
        "2.5.", unit="per_cm", allowed="(0, 100]", default=2.5),
    Key("states", "states", "integer", "Stored states up to the largest curvature, at equal steps.",
        allowed="[2, 10000]", default=10),
    Key("cycles", "cycles", "integer", "Times that the fabric is bent to the face, to the back and "
        "back to flat.", allowed="[1, 1000]", default=1),
)

EQUILIBRIUM_BENDING = Section(
    name="equilibrium_bending",
    about="Pure bending in the equilibrium model, from the fabric's own relaxed state held flat: to "
    "the largest curvature with the face convex, to the same with the back convex, and back to flat.",
    of="fabric",
    stage="equilibrium_bending",
    sections=(
        Section(
            name="variants",
            about="Conditions of the test, each by a name of your own; the first is the "
            "reference. A variant states what differs from the section.",
            keys=EQUILIBRIUM_BENDING_KEYS,
            named=True,
            default_entries={
                "frictionless": {},
                "friction": {"friction": True},
                "held": {"spacings": "held"},
                "set_90": {"set": 0.9, "friction": True},
            },
        ),
    ),
    keys=(DIRECTIONS, *EQUILIBRIUM_BENDING_KEYS),
)

YARN_TO_FABRIC = Section(
    name="yarn_to_fabric",
    about="Rigidity and curl of the fabric over those of its yarn, in the equilibrium model without "
    "friction, while loop length, yarn diameter and set change one at a time.",
    of="fabric",
    stage="yarn_to_fabric",
    keys=(
        Key("loop_length_low", "loop_length_low", "number", "Shortest loop length, over the "
            "fabric's own.", allowed="(0, 1]", default=0.95),
        Key("loop_length_high", "loop_length_high", "number", "Longest loop length, over the "
            "fabric's own; see equilibrium_rest.", allowed="[1, 3]", default=1.1),
        Key("diameter_low", "diameter_low", "number", "Thinnest yarn, over the fabric's own.",
            allowed="(0, 1]", default=0.8),
        Key("diameter_high", "diameter_high", "number", "Thickest yarn, over the fabric's own.",
            allowed="[1, 3]", default=1.1),
        Key("set_compared", "set_compared", "numbers", "Fractions of set at which loop length and "
            "diameter change.", allowed="[0, 1]", default=(0.0, 0.9)),
        Key("set_high", "set_high", "number", "Largest set, where it changes from 0 on.",
            allowed="(0, 1]", default=0.95),
        Key("points", "points", "integer", "Fabrics compared over each range.", allowed="[2, 1000]",
            default=7),
    ),
)

SCENE = Section(
    name="scene",
    about="A test programme of a yarn or of a fabric. A test that is left out is not run.",
    sections=(
        TENSILE_TEST, KINEMATIC_TENSION, KINEMATIC_BENDING, EQUILIBRIUM_REST, EQUILIBRIUM_TENSION,
        EQUILIBRIUM_SHEAR, EQUILIBRIUM_BENDING, YARN_TO_FABRIC, SENSITIVITY,
    ),
)

# What the model takes for granted where the paper is silent and no key says otherwise: name, what
# is taken, the stages that it bears on, the reason.
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

"""The keys of scenes.yaml: the tests of a yarn and of a fabric, in both models."""

from knitsim.study.keys import Key, Section
from knitsim.study.measured_keys import SENSITIVITY
from knitsim.study.memory_keys import PROGRAMME, REST_LINE

# A table, laid out by hand.
# fmt: off
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
        plausible=(0.0, high), because="not stated; about 1 % of the largest tension")


TENSILE_TEST = Section(
    name="tensile_test",
    about="The simulated yarn pulled at a set velocity.",
    of="yarn",
    stage="yarn",
    keys=(
        Key("max_strain", "max_strain", "number", "Largest strain.", allowed="(0, 1]", default=0.05,
            plausible=(0.02, 0.07), because="not stated; past yield and short of the break"),
        Key("steps", "steps", "integer", "Steps up to the largest strain.", allowed="[2, 100000]",
            default=100),
        Key("velocity_mm_per_s", "velocity", "number", "Velocity of the moving clamp.",
            unit="mm_per_s", allowed="(0, 1e6]", default=500 / 60, plausible=(4.0, 85.0),
            because="not stated; 500 mm/min, as ISO 2062 has it"),
        Key("gauge_length_mm", "gauge_length", "number", "Length between the clamps.", unit="mm",
            allowed="(0, 1e5]", default=500.0, plausible=(250.0, 500.0),
            because="not stated; as ISO 2062 has it"),
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
            because="not stated; what plain jersey is stretched to in wear"),
        Key("max_strain_wale", "max_strain_wale", "number", "Largest fabric strain, wale-wise.",
            allowed="(0, 5]", default=0.3, plausible=(0.2, 0.4),
            because="not stated; what plain jersey is stretched to in wear"),
        Key("steps", "steps", "integer", "Steps up to the largest strain, and back.",
            allowed="[2, 100000]", default=200),
        *READING_KEYS,
        viscous_key(1000.0, 5000.0),
        Key("velocity_mm_per_s", "velocity", "number", "Velocity of the moving clamp.",
            unit="mm_per_s", allowed="(0, 1e6]", default=0.1, plausible=(0.05, 2.0),
            because="not stated; that of the KES tensile tester"),
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
            because="not stated; one loop is the least that repeats"),
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
            "of the largest where they are less; on ways back, where forces fall steeply, the distance "
            "of the curve over its size) that is asked for. Points, contact points and "
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


# Largest strains of a test that goes to no force; to one it may need twice that.
EASY = {"course": 1.5, "wale": 0.9}


def course_rule(test):
    """1.5; to a force 3, which a rib needs."""
    return EASY["course"] * (1.0 if test["to_force"] is None else 2.0)


def wale_rule(test):
    """0.9; to a force 1.8."""
    return EASY["wale"] * (1.0 if test["to_force"] is None else 2.0)


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
        allowed="(0, 5]", default=course_rule),
    Key("max_strain_wale", "max_strain_wale", "number", "Largest fabric strain, wale-wise.",
        allowed="(0, 5]", default=wale_rule),
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
                    "friction": True, "recovery": True, "cycles": 3, "max_strain_course": 0.6,
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
# fmt: on

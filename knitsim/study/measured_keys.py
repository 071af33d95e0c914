"""The keys of a fabric's measured curves, of what is calibrated on them and what is predicted."""

from dataclasses import dataclass

from knitsim.study.contact_keys import LawParameters, Live
from knitsim.study.keys import REQUIRED, Interval, Key, Section

STAGE = "calibration"
MOST_FREE = 3
# Name of the prediction with every parameter as given; no calibration may bear it.
GIVEN = "as_given"


@dataclass(frozen=True)
class Parameter:
    """A parameter that a calibration may free.

    key: where its value stands, from the fabric on, with dots; unit: of that key; si: of the value
    inside; low, high: what its bounds may be at most, in unit; needs: the section of the yarn without
    which it has no meaning; alone: whether it has none beside such a section; field: its name in a
    knitsim.equilibrium.fabric.Fabric, or in its contact ("contact.stiffness").  least_free: the least
    value (SI) tried without stated bounds; within_yarn: a length that the diameter bounds.
    """

    key: str
    unit: str | None
    si: str
    low: float
    high: float
    about: str
    field: str
    needs: str = ""
    alone: bool = False
    least_free: float = 0.0
    within_yarn: bool = False

    @property
    def is_of_yarn(self):
        return self.key.startswith("yarn.")

    def meaningless(self, laws):
        """Why it has no meaning for a yarn with these sections (names); "" where it has."""
        if self.needs and self.needs not in laws:
            return f"needs {self.needs}, and the yarn has none"
        return f"has no effect: the yarn has a {laws[0]}" if self.alone and laws else ""


def _of_law(key, q, field, section):
    """The Parameter of a contact law's Quantity."""
    interval = Interval.parse(q.allowed)
    return Parameter(
        key, q.unit, q.si, interval.low, interval.high, q.about, field, needs=section,
        alone=not section, least_free=q.least_free, within_yarn=q.length,
    )  # fmt: skip


PARAMETERS = LawParameters(
    {
        "friction": Parameter(
            "yarn.friction", None, "1", 0.0, 1.0, "Coulomb friction of yarn on yarn.", "friction"
        ),
        "set": Parameter(
            "set", None, "1", 0.0, 1.0, "Part of the curvature that the yarn has taken as set.",
            "set_fraction",
        ),
        "bending_rigidity": Parameter(
            "yarn.bending_rigidity_N_mm2", "N_mm2", "N m2", 0.0, 1e6,
            "Bending rigidity of the yarn.", "bending_rigidity",
        ),
        "diameter": Parameter(
            "yarn.diameter_mm", "mm", "m", 0.0, 20.0, "Yarn diameter.", "diameter"
        ),
        "loop_length": Parameter(
            "loop_length_mm", "mm", "m", 0.0, 200.0, "Length of yarn in one loop.", "loop_length"
        ),
    },
    _of_law,
)  # fmt: skip


def key_name(name):
    """The parameter's name with its unit, as a key of bounds: ``core_diameter_mm``."""
    unit = PARAMETERS[name].unit
    return f"{name}_{unit}" if unit else name


def _bounds_key(name):
    one = PARAMETERS[name]
    return Key(
        key_name(name), name, "numbers", f"{one.about[:-1]}: [lowest, highest].", unit=one.unit,
        allowed=f"[{one.low:g}, {one.high:g}]",
    )  # fmt: skip


# Uncertain inputs beside the parameters: of yarns in contact, and a factor on the yarn's tension.
UNCERTAIN = {
    "tangential_ratio": "Stiffness of a contact along the yarns before they slide, over that across them "
    "where they first touch.",
    "stretch": "Factor on the tension of the yarn.",
}


def _range_key(name):
    if name in PARAMETERS:
        return _bounds_key(name)
    return Key(
        name, name, "numbers", f"{UNCERTAIN[name][:-1]}: [lowest, highest].", allowed="[0, 1e4]"
    )


def _tolerance_key(name):
    about = PARAMETERS[name].about if name in PARAMETERS else UNCERTAIN[name]
    return Key(f"{name}_percent", name, "number", about, unit="percent", allowed="[0, 1000]")


# fmt: off
# Where a measured curve stands, and what answers a question that its file leaves open.
FILE_KEYS = (
    Key("file", "file", "text", "File as the machine or Excel wrote it (CSV, text or .xlsx), relative "
        "to the study or the directory above it, else to config/."),
    Key("files", "files", "words", "Instead of it several files, one of each specimen: their mean counts, "
        "and its spread as the band."),
    Key("sheet", "sheet", "text", "Sheet of a workbook; without it that which holds a curve."),
    Key("columns", "columns", "mapping", "Which column is what, where its heading does not say so: quantity "
        "with unit, and the heading or the number of the column, `{extension_mm: Elongation, force_N: 3}`."),
    Key("unit", "unit", "mapping", "Unit of a quantity, or of a heading, that states none or a wrong one: "
        "`{force: gf, strain: percent}`."),
    Key("skip", "skip", "lines", "Lines of the file to pass over: how many at its beginning, or a list of "
        "line numbers."),
    Key("decimal_sign", "decimal_sign", "choice", "Of a file whose numbers leave it open.",
        choices=("comma", "point")),
)
ZERO_KEY = Key("zero", "zero", "choice", "Zero of the load cell. keep: the force is right as it stands. "
    "start: what is read before the test is taken off. tail: what is read after the break. Without it a "
    "force at no strain is asked about.", choices=("keep", "start", "tail"))

MEASURED = Section(
    name="measured",
    about="Measured curves of this fabric, each by a name of your own. What the file states need not be "
    "stated here; what is stated here comes first.",
    stage=STAGE,
    named=True,
    keys=(
        Key("test", "test", "choice", "tension: strain and force, loading and, if it is there, "
            "recovery. bending: curvature and moment per width in the order of the test; "
            "the mean of both ways is compared.", choices=("tension", "bending"),
            default="tension"),
        Key("direction", "direction", "choice", "Direction pulled, or that becomes curved.",
            choices=("course", "wale"), default=REQUIRED),
        *FILE_KEYS,
        Key("gauge_length_mm", "gauge_length", "number", "Length of the specimen between the clamps.",
            unit="mm", allowed="(0, 1e5]"),
        Key("width_mm", "width", "number", "Width of the specimen, across the pull.", unit="mm",
            allowed="(0, 1e5]"),
        Key("pretension_N_per_mm", "pretension", "number", "Force per width at which the strain was "
            "set to zero.", unit="N_per_mm", allowed="(0, 1e3]"),
        Key("pretension_gf_per_cm", "pretension", "number", "The same.", unit="gf_per_cm",
            allowed="(0, 1e6]"),
        Key("cycle", "cycle", "integer", "Which cycle of a file that holds several. Of a bending test in a "
            "file of one cycle, which one of the test it is: friction remembers those before.",
            allowed="[1, 100]", default=1),
        ZERO_KEY,
        Key("slack", "slack", "choice", "find: strain counts from where the specimen is taut, if it hung "
            "slack. keep: as it stands. start: from the first row, if the extension was not zeroed.",
            choices=("find", "keep", "start"),
            default="find"),
        Key("machine_compliance_mm_per_N", "machine_compliance", "number", "Extension of the machine "
            "and its clamps per force, subtracted from the extension.", unit="mm_per_N",
            allowed="(0, 1e3]"),
    ),
)

CALIBRATIONS = Section(
    name="calibrations",
    about="Calibrations on measured curves, each by a name of your own; all other measured curves "
    f"are predicted. With all parameters as given the prediction is made as well, as `{GIVEN}`.",
    stage=STAGE,
    named=True,
    sections=(
        Section(
            name="bounds",
            about="Between which values a free parameter may lie; without, its range in the ledger, "
            "or half to twice its value.",
            keys=Live(lambda: [_bounds_key(name) for name in PARAMETERS]),
        ),
        Section(
            name="range",
            about="Without free parameters: inputs of which any value between these is as likely, evenly in "
            "the logarithm where the ends lie tenfold apart; equal ends make an input certain. Else those of "
            "the ledger.",
            keys=Live(lambda: [_range_key(name) for name in (*PARAMETERS, *UNCERTAIN)]),
        ),
        Section(
            name="tolerance",
            about="Without free parameters: inputs known within so much of their value, two standard "
            "deviations; 0 makes an input certain. Else that of its kind of measurement.",
            keys=Live(lambda: [_tolerance_key(name) for name in (*PARAMETERS, *UNCERTAIN)]),
        ),
    ),
    keys=(
        Key("fit", "fit", "words", "Measured curves to fit, by name.", default=REQUIRED),
        Key("free", "free", "choices", f"Free parameters, at most {MOST_FREE}; each starts from its "
            "value, all others hold as given. Without it every input is as uncertain as its `range` or "
            "`tolerance` says, and the curves narrow them.", choices=PARAMETERS, default=(),
            may_be_empty=True),
        Key("use", "use", "choices", "Without free parameters: what counts of the measured tests, and the "
            "stated spacings at rest.", choices=("strain", "lateral_strain", "rest"),
            default=("strain", "rest")),
        Key("fabrics", "fabrics", "integer", "Without free parameters: how many fabrics, drawn from what "
            "is known of the inputs, are solved.", allowed="[40, 4096]", default=128),
        Key("residual", "residual", "choice", "strain: at given force. force: at given strain.",
            choices=("strain", "force"), default="strain"),
        Key("misfit", "misfit", "choice", "relative: over the measured value. absolute: all points "
            "alike. band: over half the measured band.", choices=("relative", "absolute", "band"),
            default="relative"),
        Key("on_request", "on_request", "flag", "Made by `snakemake calibration` only, not by "
            "default: for fits that take long.", default=False),
    ),
)

PREDICTION = Section(
    name="prediction",
    about="How far the tests of this fabric are predicted, with the parameters of each calibration "
    "and as given.",
    stage=STAGE,
    keys=(
        Key("calibrated_on", "calibrated_on", "text", "Another fabric of the same yarn, of any pattern: this "
            "one is predicted with each of its calibrations that frees inputs of the yarn alone."),
        Key("to_force_N_per_mm", "to_force", "number", "Largest force per width in tension; without "
            "it the largest measured one, or 0.049 N/mm (50 gf/cm).", unit="N_per_mm",
            allowed="(0, 1e3]"),
        Key("to_force_gf_per_cm", "to_force", "number", "The same.", unit="gf_per_cm",
            allowed="(0, 1e6]"),
        Key("max_curvature_per_cm", "max_curvature", "number", "Largest curvature, to both sides; 0 "
            "for no bending test.", unit="per_cm", allowed="[0, 100]", default=2.0),
        Key("states", "states", "integer", "States of each curve.", allowed="[4, 1000]", default=24),
    ),
)

SENSITIVITY = Section(
    name="sensitivity",
    about="What one per cent of each input does to the strain at a given force, to B and 2HB and to "
    "the density at rest: which inputs must be measured how well. In the equilibrium model.",
    of="fabric",
    stage="sensitivity",
    keys=(
        Key("inputs", "inputs", "choices", "Inputs that are changed; those without meaning for the "
            "yarn are left out.", choices=PARAMETERS, default=tuple(PARAMETERS)),
        Key("change_percent", "change", "number", "Change of each input, both ways, and twice that.",
            unit="percent", allowed="(0, 10]", default=1.0),
        Key("force_gf_per_cm", "force", "number", "Force per width at which the strain is read.",
            unit="gf_per_cm", allowed="(0, 1e5]", default=50.0),
        Key("friction", "friction", "flag", "Coulomb friction between yarns; without it there is no "
            "2HB.", default=True),
    ),
)
# fmt: on

"""Result files: which there are, where each lies, and by what they are found.

The one table of it, for the writer, the reader, the figures, the stages and the workflow's rules.
Nothing heavy is imported here, for the Snakefile reads it.
"""

from dataclasses import dataclass

# Attributes of every file that say what it is about; empty where one does not apply.
LABELS = ("kind", "yarn", "fabric", "pattern", "model", "direction", "calibration")
MODELS = ("kinematic", "equilibrium")
DIRECTIONS = ("course", "wale")


@dataclass(frozen=True)
class Result:
    """The files that one stage makes.

    path: below the root of the store; its fields are labels, or wildcards of the workflow.  about:
    what one file is of, "yarn", "fabric" or "study".  model: the one that made it, empty for none or
    both.  keywords: what is in it, for catalogues of data.
    """

    stage: str
    kind: str
    path: str
    model: str = ""
    about: str = "fabric"
    keywords: str = ""

    @property
    def has_direction(self):
        return "{direction}" in self.path


_TESTS = {
    "tension": ("tensile", "tensile test, load-extension curve"),
    "bending": ("bending", "bending test, moment-curvature curve, curl"),
}

RESULTS = {
    result.stage: result
    for result in (
        Result("yarn", "yarn", "yarn/{yarn}.nc", about="yarn", keywords="yarn, tensile test, fibres"),
        Result("loop", "loop", "loop/{fabric}.nc", "kinematic", keywords="knitted loop, geometry"),
        Result(
            "equilibrium_rest", "relaxed", "relaxed/{fabric}.nc", "equilibrium",
            keywords="relaxed fabric, stitch density",
        ),
        *(
            Result(
                f"{model}_{test}", kind, f"{kind}/{{fabric}}/{model}_{{direction}}.nc", model,
                keywords=keywords,
            )
            for model in MODELS
            for test, (kind, keywords) in _TESTS.items()
        ),
        Result(
            "equilibrium_shear", "shear", "shear/{fabric}/equilibrium.nc", "equilibrium",
            keywords="shear test",
        ),
        Result(
            "yarn_to_fabric", "yarn_to_fabric", "yarn_to_fabric/{fabric}.nc", "equilibrium",
            keywords="bending rigidity, curl, set",
        ),
        Result("kes", "kes", "kes/{fabric}.nc", keywords="KES, Kawabata evaluation system"),
        Result(
            "sensitivity", "sensitivity", "sensitivity/{fabric}.nc", "equilibrium",
            keywords="sensitivity analysis",
        ),
        Result("sweep", "sweep", "sweep/{fabric}.nc", "equilibrium", keywords="parameter study"),
        Result(
            "calibration", "measured", "measured/{fabric}/{calibration}.nc", "equilibrium",
            keywords="calibration, prediction, measured curves",
        ),
        Result(
            "verification", "verification", "verification/cases.nc", "equilibrium", "study",
            "verification, exact solutions",
        ),
    )
}  # fmt: skip


def path_of(stage, **labels):
    """Path of a stage's file below the root; a label that is not given stays a ``{field}``."""
    path = RESULTS[stage].path
    for name, value in labels.items():
        path = path.replace(f"{{{name}}}", value)
    return path


def labels_of(stage, fabric="", yarn="", **more):
    """The attributes :data:`LABELS` of a file of ``stage`` about a fabric or a yarn, by their names.

    more: pattern, direction or calibration.
    """
    known = {"kind": RESULTS[stage].kind, "model": RESULTS[stage].model, "fabric": fabric}
    known |= {"yarn": yarn, **more}
    return {name: known.get(name, "") for name in LABELS}

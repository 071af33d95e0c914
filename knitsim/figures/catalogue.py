"""Every figure: its file, the module that draws it, and the result files that it is drawn from.

The Snakefile reads this table, so nothing heavy is imported here.
"""

from dataclasses import dataclass

from knitsim.store.results import DIRECTIONS, RESULTS, path_of

# Result files, by the name of the argument that takes them: their stage and labels.  The last two stand
# for all calibrations of a fabric, a mapping by name.
FILES = {
    "yarn": ("yarn", {}),
    "loop": ("loop", {}),
    "relaxed": ("equilibrium_rest", {}),
    **{
        f"{name}_{direction}": (stage, {"direction": direction})
        for name, stage in (
            ("tension", "kinematic_tension"), ("bending", "kinematic_bending"),
            ("equilibrium", "equilibrium_tension"), ("bent", "equilibrium_bending"),
        )
        for direction in DIRECTIONS
    },
    "kes": ("kes", {}),
    "rigidity": ("yarn_to_fabric", {}),
    "sensitivity": ("sensitivity", {}),
    "verification": ("verification", {}),
    "measured": ("calibration", {}),
    "fitted": ("calibration", {}),
}  # fmt: skip


def files_of(of, subject):
    """{argument: path below the store's root} of the results about one yarn or fabric."""
    return {
        name: path_of(stage, **labels, **{of: subject})
        for name, (stage, labels) in FILES.items()
        if RESULTS[stage].about == of
    }


@dataclass(frozen=True)
class Figure:
    """name: of the file and of the function in knitsim.figures.<module> that draws it.

    group: drawn by one job.  of: yarn, fabric or study.  needs: files without which it is not drawn;
    takes: files that it shows as well where they exist.
    """

    name: str
    group: str
    module: str
    of: str
    needs: tuple
    takes: tuple = ()


_BOTH = ("tension_course", "tension_wale")
_SOLVED = ("equilibrium_course", "equilibrium_wale")
_BENT = ("bending_course", "bending_wale")
_CURLED = ("bent_course", "bent_wale")

FIGURES = (
    Figure("fig01_yarn_springs", "yarn", "yarn", "yarn", ("yarn",)),
    Figure("fig02_fibre_sections", "yarn", "yarn", "yarn", ("yarn",)),
    Figure("fig12_yarn_tension", "yarn", "yarn_tension", "yarn", ("yarn",)),
    Figure("fig03_loop_anchors", "loop", "loop", "fabric", ("loop",)),
    Figure("fig04_yarn_into_loop", "loop", "loop", "fabric", ("loop",)),
    Figure("fig05_connected_loops", "loop", "loop", "fabric", ("loop",)),
    Figure(
        "fig06_course_deformation", "tension", "loop_tension", "fabric", ("tension_course",)
    ),
    Figure(
        "fig07_course_contraction", "tension", "loop_tension", "fabric", ("tension_course",),
        ("equilibrium_course",),
    ),
    Figure("fig08_wale_deformation", "tension", "loop_tension", "fabric", ("tension_wale",)),
    Figure(
        "fig09_wale_contraction", "tension", "loop_tension", "fabric", ("tension_wale",),
        ("equilibrium_wale",),
    ),
    Figure("fig10_bending_curvature", "bending", "bending", "fabric", _BENT),
    Figure("fig11_bending", "bending", "bending", "fabric", _BENT),
    Figure(
        "fig13_fabric_under_tension", "tension", "tension", "fabric", _BOTH,
        _SOLVED,
    ),
    Figure(
        "fig14_fabric_tension", "tension", "tension", "fabric", _BOTH,
        _SOLVED,
    ),
    Figure("fig15_relaxed_fabric", "equilibrium", "relaxed", "fabric", ("relaxed", "loop")),
    Figure(
        "fig16_equilibrium_tension", "equilibrium", "equilibrium_tension", "fabric",
        _SOLVED,
    ),
    Figure(
        "fig18_equilibrium_bending", "bent", "equilibrium_bending", "fabric", _CURLED, _BENT,
    ),
    Figure("fig19_bent_shapes", "bent", "equilibrium_bending", "fabric", _CURLED, _BENT),
    Figure("fig20_kes_chart", "bent", "kes_chart", "fabric", ("kes", "relaxed")),
    Figure("fig21_yarn_to_fabric", "bent", "yarn_to_fabric", "fabric", ("rigidity",)),
    Figure("fig22_set", "bent", "yarn_to_fabric", "fabric", ("rigidity",)),
    Figure("fig33_sensitivity", "sensitivity", "sensitivity", "fabric", ("sensitivity",)),
    Figure("fig17_verification", "verification", "verification", "study", ("verification",)),
    Figure("fig30_calibration", "measured", "measured", "fabric", ("measured",)),
    Figure("fig31_prediction", "measured", "measured", "fabric", ("measured",)),
    Figure("fig32_misfit_profile", "measured", "measured", "fabric", ("fitted",)),
)  # fmt: skip

GROUPS = tuple(dict.fromkeys(figure.group for figure in FIGURES))


def drawable(group, of, available):
    """The figures of a group of a yarn or fabric for which the ``available`` files suffice."""
    return [
        figure
        for figure in FIGURES
        if (figure.group, figure.of) == (group, of) and set(figure.needs) <= set(available)
    ]


def modules(group):
    """Modules that draw the figures of a group."""
    return sorted({f"knitsim.figures.{f.module}" for f in FIGURES if f.group == group})

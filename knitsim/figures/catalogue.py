"""Every figure: its file, the module that draws it, and the result files that it is drawn from.

The Snakefile reads this table, so nothing heavy is imported here.
"""

from dataclasses import dataclass

from knitsim.store.results import DIRECTIONS, RESULTS, path_of

# Result files, by the name of the argument that takes them: their stage and labels.  The last three stand
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
    "inferred": ("calibration", {}),
}  # fmt: skip


def files_of(of, subject):
    """{argument: path below the store's root} of the results about one yarn or fabric."""
    return {
        name: path_of(stage, **labels, **{of: subject})
        for name, (stage, labels) in FILES.items()
        if RESULTS[stage].about == of
    }


CYCLES = "cycles"


@dataclass(frozen=True)
class Figure:
    """name: of the file and of the function in knitsim.figures.<module> that draws it.

    group: drawn by one job.  of: yarn, fabric or study.  needs: files without which it is not drawn;
    takes: files that it shows as well where they exist.  only: CYCLES, of scenes that pull a fabric more
    than once.  caption: what is to be seen, whatever the yarn or fabric; numbers in it are those of the
    default study.
    """

    name: str
    group: str
    module: str
    of: str
    needs: tuple
    caption: str
    takes: tuple = ()
    only: tuple = ()


_KINEMATIC = ("tension_course", "tension_wale")
_SOLVED = ("equilibrium_course", "equilibrium_wale")
_BENDING = ("bending_course", "bending_wale")
_BENT = ("bent_course", "bent_wale")

FIGURES = (
    Figure(
        "fig00_load_extension", "solved", "tension", "fabric", _SOLVED,
        "Load per width against extension along the course and along the wale, from rest to the same"
        " load and back, in the equilibrium model with friction between the yarns. The extension that is"
        " left when the load is gone is friction's alone: the yarn itself is elastic.",
    ),
    Figure(
        "fig01_yarn_springs", "yarn", "yarn", "yarn", ("yarn",),
        "Fig. 1 of the paper: the simulated yarn, mass points in successive sections and three kinds of"
        " springs, and all its fibres at true size and twist.",
    ),
    Figure(
        "fig02_fibre_sections", "yarn", "yarn", "yarn", ("yarn",),
        "Fig. 2 of the paper: eq. (1) as printed is a reflection, so that fibres go there and back and"
        " no twist accumulates; corrected it is a rotation, and the fibres are helices.",
    ),
    Figure(
        "fig12_yarn_tension", "yarn", "yarn_tension", "yarn", ("yarn",),
        "Fig. 12 of the paper: the simulated tensile test of the yarn, its law and the curve given. A curve"
        " that was rebuilt from constants, as those of the paper's yarns are, finds these again and proves"
        " nothing. A twisted yarn carries less than its law, which is shared out among its fibres: they"
        " lie at an angle, and the section gives way; a thick soft yarn, such as the paper's acrylic, so"
        " carries less than half. The fabric's tests take the law as it stands.",
    ),
    Figure(
        "fig03_loop_anchors", "paper", "loop", "fabric", ("loop",),
        "Fig. 3 of the paper: a spline through six anchors a half, taken from Choi and Lo's curve, as the"
        " paper's own are not available; beside it Peirce's loop.",
    ),
    Figure(
        "fig04_yarn_into_loop", "paper", "loop", "fabric", ("loop",),
        "Fig. 4 of the paper: the twisted yarn laid into the loop. Sections by eqs. (2), (3) as printed"
        " miss the yarn's direction and turn over where it runs backwards; a rotation-minimising frame"
        " does not.",
    ),
    Figure(
        "fig05_connected_loops", "paper", "loop", "fabric", ("loop",),
        "Fig. 5 of the paper: connected loops, from both sides and in section. The ridges show the"
        " direction of twist; they are no fibres.",
    ),
    Figure(
        "fig06_course_deformation", "paper", "loop_tension", "fabric", ("tension_course",),
        "Fig. 6 of the paper: a loop pulled along the course. By eq. (4) as printed the edge stays where"
        " it is and the yarns run into each other; corrected, every section moves in proportion.",
    ),
    Figure(
        "fig07_course_contraction", "paper", "loop_tension", "fabric", ("tension_course",),
        "Fig. 7 of the paper: how the loop contracts along the wale under course tension. The paper gives"
        " the limit only, in two ways that differ; the equilibrium model needs none.",
        ("equilibrium_course",),
    ),
    Figure(
        "fig08_wale_deformation", "paper", "loop_tension", "fabric", ("tension_wale",),
        "Fig. 8 of the paper: a loop pulled along the wale, eq. (5) as printed and corrected.",
    ),
    Figure(
        "fig09_wale_contraction", "paper", "loop_tension", "fabric", ("tension_wale",),
        "Fig. 9 of the paper: how the loop contracts along the course under wale tension.",
        ("equilibrium_wale",),
    ),
    Figure(
        "fig10_bending_curvature", "paper", "bending", "fabric", _BENDING,
        "Fig. 10 of the paper: angle, curvature and place of the sections of the bent fabric. Eqs. (10),"
        " (11) as printed put every section near the far edge L.",
    ),
    Figure(
        "fig11_bending", "paper", "bending", "fabric", _BENDING,
        "Fig. 11 of the paper: the fabric in pure bending to either side, and one model of length L as"
        " printed.",
    ),
    Figure(
        "fig13_fabric_under_tension", "paper", "tension", "fabric", _KINEMATIC,
        "Fig. 13 of the paper: the fabric under tension in both models, to one scale. Affine loops are"
        " pressed into each other (closest centre lines well below one diameter); in equilibrium they"
        " slide and bend instead.", _SOLVED,
    ),
    Figure(
        "fig14_fabric_tension", "paper", "tension", "fabric", _KINEMATIC,
        "Fig. 14 of the paper: force of the fabric against strain in both models, the small forces once"
        " more, and the tension of the yarn, which the paper plots, in each of its readings. The affine"
        " model has no force until its loop has contracted as far as it may, and then hundreds of times"
        " that of the loop in equilibrium.", _SOLVED,
    ),
    Figure(
        "fig15_relaxed_fabric", "solved", "relaxed", "fabric", ("relaxed", "loop"),
        "The fabric at rest in the equilibrium model beside its stated density, and its density over loop"
        " length and set beside Munden's constants and Peirce's loop.",
    ),
    Figure(
        "fig16_equilibrium_tension", "solved", "equilibrium_tension", "fabric", _SOLVED,
        "Tension in the equilibrium model in every condition of the scene, with its estimated error,"
        " contraction and energies. Along the wale the force turns up sharply where the two legs of a"
        " loop come to touch each other at their feet, and those of neighbouring loops at their heads (the"
        " strain is marked, read from the stored states): until then yarns touch where loops interlace"
        " only, and from there on the legs must be squeezed.",
    ),
    Figure(
        "fig18_equilibrium_bending", "solved", "equilibrium_bending", "fabric", _BENT,
        "Pure bending in the equilibrium model. The moment at zero curvature, which holds the fabric"
        " flat, is that with which plain jersey curls; B and 2HB are read from the change.", _BENDING,
    ),
    Figure(
        "fig19_bent_shapes", "solved", "equilibrium_bending", "fabric", _BENT,
        "The fabric bent to either side in the equilibrium model; where the kinematic one was solved, both"
        " from the side.",
        _BENDING,
    ),
    Figure(
        "fig20_kes_chart", "solved", "kes_chart", "fabric", ("kes", "relaxed"),
        "KES parameters of the fabric in tension to 50 gf/cm, bending and shear. B with friction is that"
        " of a first bending, which slipping resists; without friction it is lower.",
    ),
    Figure(
        "fig21_yarn_to_fabric", "solved", "yarn_to_fabric", "fabric", ("rigidity",),
        "Bending rigidity of the fabric over that of its yarn, and the moment that holds it flat, over"
        " loop length, yarn diameter and set, without friction. Straight yarns as close as in the fabric,"
        " and the loop's yarn bent piece by piece, are far stiffer: the yarn gives way by turning.",
    ),
    Figure(
        "fig22_set", "solved", "yarn_to_fabric", "fabric", ("rigidity",),
        "What set of the yarn changes: rigidity and curl without friction, and the density at rest beside"
        " Munden's constants of dry relaxed fabrics.",
    ),
    Figure(
        "fig23_cycles", "solved", "cycles", "fabric", (*_SOLVED, "relaxed"),
        "Pulled and released again and again with friction: loops of load and extension, peak force,"
        " energy lost and strain left in each cycle, and the spacings in which friction lets the fabric"
        " rest, a line from that after a pull along the wale to that after one along the course.",
        only=(CYCLES,),
    ),
    Figure(
        "fig33_sensitivity", "solved", "sensitivity", "fabric", ("sensitivity",),
        "Per cent of each result for one per cent of each input, with friction; bars at the ends show"
        " what numerical noise leaves uncertain. Loop length is the input to measure best.",
    ),
    Figure(
        "fig17_verification", "verification", "verification", "study", ("verification",),
        "The kernels of the equilibrium model against exact answers, over the number of elements.",
    ),
    Figure(
        "fig30_calibration", "measured", "measured", "fabric", ("measured",),
        "Each choice of parameters beside the measured curves of the direction that was fitted.",
    ),
    Figure(
        "fig31_prediction", "measured", "measured", "fabric", ("measured",),
        "What each choice of parameters predicts of every other test: how far they lie apart is what the"
        " measured curves leave open.",
    ),
    Figure(
        "fig32_misfit_profile", "measured", "measured", "fabric", ("fitted",),
        "Misfit along each calibrated parameter, the others fitted again at every point.",
    ),
    Figure(
        "fig34_prediction_bands", "measured", "inferred", "fabric", ("inferred",),
        "Every measured tension test beside its prediction with all inputs uncertain: median, the bands"
        " that hold 50 and 95 %, and behind them what was known before any curve was measured.",
    ),
)  # fmt: skip

# Captions of the figures that are drawn from tables, by the rules of their own.
TABLE_CAPTIONS = {
    "run_time_against_error": "Run time of every solver against its error: each setting a point, the"
    " front of the best a line, the default a star.",
    "stress_map": "Every case of the stress campaign on maps of its inputs, and what became of it.",
}

GROUPS = tuple(dict.fromkeys(figure.group for figure in FIGURES))


def drawable(group, of, available):
    """The figures of a group of a yarn or fabric for which ``available``, files and CYCLES, suffices."""
    return [
        figure
        for figure in FIGURES
        if (figure.group, figure.of) == (group, of)
        and {*figure.needs, *figure.only} <= set(available)
    ]


def modules(group):
    """Modules that draw the figures of a group."""
    return sorted({f"knitsim.figures.{f.module}" for f in FIGURES if f.group == group})

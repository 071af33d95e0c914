"""The paper's pure bending of a fabric, corrected and as printed."""

from functools import partial

import numpy as np

from knitsim.kinematic.bending import bending_test, bent_points, fibre_points, sweep
from knitsim.stages.described import describe_stage
from knitsim.stages.kinematic import (
    TIMED_STEPS,
    readings_dataset,
    section_points,
    states_dataset,
    time_test,
)
from knitsim.stages.laws import ledger_laws
from knitsim.stages.loop import loop_of
from knitsim.store.schema import VARIABLES
from knitsim.store.timing import Timings

STAGE = "kinematic_bending"
_STATES = VARIABLES["status"].flags


def _curve(fabric, law, direction, form, steps=None):
    test = fabric.scene[STAGE]
    curvature, towards_zero = sweep(test["max_curvature"], steps or test["steps"])
    return bending_test(
        loop_of(fabric), law, direction, curvature, towards_zero, form=form, loops=test["loops"]
    )


def _dataset(fabric, curve):
    loop, steps = loop_of(fabric), curve.curvature.size
    status = np.where(curve.beyond_breaking_strain, _STATES.index("beyond_breaking_strain"), 0)
    if curve.form == "printed":
        # 0/0 at zero curvature, as printed.
        status = np.where(curve.curvature == 0, _STATES.index("not_defined"), 0)
    variables = {
        "moment_per_width": curve.moment_per_width,
        "yarn_tension": curve.yarn_tension,
        "yarn_strain": curve.yarn_strain,
        "wale_spacing": np.full(steps, loop.wale_spacing),
        "course_spacing": np.full(steps, loop.course_spacing),
        "status": status.astype(np.int8),
    }

    def fibres(layout, twist, sections):
        if curve.form == "printed":  # it has no sections
            return np.full((steps, sections, len(layout), 3), np.nan)
        return fibre_points(loop, curve, layout, twist, sections)

    points, store = bent_points(curve, section_points(fabric)), fabric.scene[STAGE]["store"]
    return states_dataset("curvature", curve, variables, points, fibres, fabric, store)


def headlines(fabric, direction):
    """{name: (value, units)} of the corrected form that the ledger follows."""
    curve = _curve(fabric, ledger_laws(fabric.yarn)["continuous"], direction, "corrected")
    largest = int(np.argmax(np.abs(curve.moment_per_width)))
    return {
        "largest moment per width": (curve.moment_per_width[largest], "N"),
        "largest yarn strain": (curve.yarn_strain.max(), "1"),
    }


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput bent in one direction; laws: TensionLaw by form."""
    timings = Timings(STAGE, fabric.name, direction)
    test, loop, law = fabric.scene[STAGE], loop_of(fabric), laws["continuous"]
    with timings.measure("all readings, all steps", whole=True):
        forms = {
            form: _dataset(fabric, _curve(fabric, law, direction, form))
            for form in test["readings"]
        }
    followed = partial(headlines, direction=direction)
    dataset = readings_dataset(fabric, STAGE, forms, followed, timings)
    spacing = loop.wale_spacing if direction == "course" else loop.course_spacing
    dataset["model_length"] = test["loops"] * spacing
    describe_stage(
        dataset, fabric, STAGE, direction=direction, references=("paper",),
        title=f"Kinematic bending of {fabric.name}, {direction} direction curved",
        summary="The paper's eqs (6) to (11), as printed and corrected.",
    )  # fmt: skip
    forces = partial(_curve, fabric, law, direction, "corrected", TIMED_STEPS)
    time_test(timings, fabric.yarn, forces, partial(fibre_points, loop))
    return dataset, timings

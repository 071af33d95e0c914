"""The paper's pure bending of a fabric, corrected and as printed."""

from functools import partial

import numpy as np

from knitsim.kinematic.bending import bending_test, bent_points, fibre_points, sweep
from knitsim.stages.described import describe_stage
from knitsim.stages.laws import ledger_laws
from knitsim.stages.ledger import effect_dataset
from knitsim.stages.loop import loop_of
from knitsim.stages.needs import stores_fibres
from knitsim.stages.yarn import layout_of, signed_twist
from knitsim.store.schema import VARIABLES
from knitsim.store.tensile import stack_variants, test_dataset
from knitsim.store.timing import Timings
from knitsim.study.schema import closure

STAGE = "kinematic_bending"
_TIMED_STEPS, _TIMED_SECTIONS, _TIMED_FIBRES = 200, 100, 72
_STATES = VARIABLES["status"].flags


def _curve(loop, law, test, direction, form, steps=None):
    curvature, towards_zero = sweep(test["max_curvature"], steps or test["steps"])
    return bending_test(
        loop, law, direction, curvature, towards_zero, form=form, loops=test["loops"]
    )


def _dataset(loop, curve, fabric, store):
    count = fabric["sections_per_loop"]
    u, _ = loop.sections(count)
    steps = curve.curvature.size
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
    if "centreline" in store:
        points = np.concatenate([loop.points(u), loop.points([1.0])])
        variables["centreline"] = bent_points(curve, points)
    dataset = test_dataset(
        "curvature", curve.curvature, curve.recovery, variables, stretch_energy=curve.energy
    )
    if stores_fibres(store):
        layout = layout_of(fabric.yarn)
        shape = (steps, count, layout.fibres, 3)
        fibres = np.full(shape, np.nan)
        if curve.form == "corrected":
            fibres = fibre_points(loop, curve, layout.positions, signed_twist(fabric.yarn), count)
        dataset["fibre_point"] = (("step", "section", "fibre", "axis"), fibres)
    return dataset


def headlines(fabric, direction):
    """{name: (value, units)} of the corrected form that the ledger follows."""
    law = ledger_laws(fabric.yarn)["continuous"]
    curve = _curve(loop_of(fabric), law, fabric.scene[STAGE], direction, "corrected")
    largest = int(np.argmax(np.abs(curve.moment_per_width)))
    return {
        "largest moment per width": (curve.moment_per_width[largest], "N"),
        "largest yarn strain": (curve.yarn_strain.max(), "1"),
    }


def _time(timings, loop, law, test, direction, fabric):
    layout = layout_of(fabric.yarn).positions[:_TIMED_FIBRES]
    twist = signed_twist(fabric.yarn)

    def forces():
        return _curve(loop, law, test, direction, "corrected", _TIMED_STEPS)

    timings.repeat(f"{direction}: {_TIMED_STEPS} steps, forces and spacings", forces)
    timings.repeat(
        f"{direction}: {_TIMED_STEPS} steps, positions of {len(layout)} fibres in"
        f" {_TIMED_SECTIONS} sections",
        lambda: fibre_points(loop, forces(), layout, twist, _TIMED_SECTIONS),
    )


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput bent in one direction; laws: TensionLaw by form."""
    timings = Timings(STAGE, fabric.name)
    test = fabric.scene[STAGE]
    loop = loop_of(fabric)
    law = laws["continuous"]
    with timings.measure(f"{direction}: all readings, all steps"):
        forms = {
            form: _dataset(
                loop, _curve(loop, law, test, direction, form), fabric, test["store"]
            )
            for form in test["readings"]
        }  # fmt: skip
    with timings.measure(f"{direction}: effect of the assumptions"):
        effects = effect_dataset(fabric, closure(STAGE), partial(headlines, direction=direction))
    dataset = stack_variants(forms).merge(effects)
    spacing = loop.wale_spacing if direction == "course" else loop.course_spacing
    dataset["model_length"] = test["loops"] * spacing
    dataset["diameter"] = loop.diameter
    describe_stage(
        dataset, fabric, STAGE,
        title=f"Kinematic bending of {fabric.name}, {direction} direction curved",
        summary="The paper's eqs (6) to (11), as printed and corrected.",
        references=("paper",),
    )  # fmt: skip
    _time(timings, loop, law, test, direction, fabric)
    return dataset, timings

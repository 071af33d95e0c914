"""The paper's tensile test of a fabric, in every reading that its scene names."""

from functools import partial

import numpy as np

from knitsim.kinematic.tension import (
    Reading,
    deformed_points,
    deformed_spacings,
    fibre_points,
    loop_height,
    smallest_distances,
    tensile_test,
)
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
from knitsim.store.timing import Timings
from knitsim.store.writer import to_json

STAGE = "kinematic_tension"


def _curve(fabric, laws, direction, choice, steps=None):
    test = fabric.scene[STAGE]
    reading = Reading(**{name: choice[name] for name in (*Reading.CHOICES, "viscous")})
    steps = steps or test["steps"]
    return tensile_test(
        loop_of(fabric), laws[reading.law], direction,
        test[f"max_strain_{direction}"] * np.arange(steps + 1) / steps, reading,
        friction_coefficient=test["viscous_coefficient"], velocity=test["velocity"],
    )  # fmt: skip


def _dataset(fabric, curve):
    loop = loop_of(fabric)
    points = deformed_points(loop, curve, section_points(fabric))
    wale, course = deformed_spacings(loop, curve)
    variables = {
        "force_per_loop": curve.force_per_loop,
        "force_per_width": curve.force_per_width,
        "yarn_tension": curve.yarn_tension,
        "yarn_strain": curve.yarn_strain,
        "friction_force": curve.friction_force,
        "transverse_strain": curve.scale_across - 1.0,
        "wale_spacing": wale,
        "course_spacing": course,
        "work": curve.work,
        "dissipated": curve.dissipated,
        "min_distance": smallest_distances(loop, curve, points),
        "status": curve.beyond_breaking_strain.astype(np.int8),
    }
    fibres = partial(fibre_points, loop, curve)
    store = fabric.scene[STAGE]["store"]
    return states_dataset("strain", curve, variables, points, fibres, fabric, store)


def headlines(fabric, direction):
    """{name: (value, units)} of the reference reading that the ledger follows."""
    choice = next(iter(fabric.scene[STAGE]["variants"].values()))
    curve = _curve(fabric, ledger_laws(fabric.yarn), direction, choice)
    top = int(np.argmax(curve.strain))
    loaded = curve.yarn_tension[: top + 1] > 0
    onset = curve.strain[np.argmax(loaded)] if loaded.any() else np.nan
    broken = curve.beyond_breaking_strain[: top + 1]
    at_break = curve.strain[np.argmax(broken)] if broken.any() else np.nan
    return {
        "strain where the yarn breaks": (at_break, "1"),
        "strain where the yarn takes up load": (onset, "1"),
        "force per width at largest strain": (curve.force_per_width[top], "N m-1"),
        "yarn tension at largest strain": (curve.yarn_tension[top], "N"),
    }


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput pulled in one direction; laws: TensionLaw by form."""
    timings = Timings(STAGE, fabric.name, direction)
    # The paper gives the limit of one course spacing course-wise only.
    choices = {
        name: choice
        for name, choice in fabric.scene[STAGE]["variants"].items()
        if direction == "course" or choice["limit"] != "course_spacing"
    }
    with timings.measure("all readings, all steps, loading and recovery", whole=True):
        readings = {
            name: _dataset(fabric, _curve(fabric, laws, direction, choice))
            for name, choice in choices.items()
        }
    followed = partial(headlines, direction=direction)
    dataset = readings_dataset(fabric, STAGE, readings, followed, timings)
    loop = loop_of(fabric)
    dataset["loop_height"] = loop_height(loop)
    dataset.attrs["readings"] = to_json(choices)
    describe_stage(
        dataset, fabric, STAGE, direction=direction, references=("paper",),
        title=f"Kinematic tensile test of {fabric.name}, {direction} direction",
        summary="The paper's eqs (4), (5), as printed and corrected, loading and recovery.",
    )  # fmt: skip

    def fibres(curve, layout, twist, sections):
        return fibre_points(loop, curve, layout, twist, sections, np.arange(TIMED_STEPS + 1))

    reference = next(iter(choices.values()))
    forces = partial(_curve, fabric, laws, direction, reference, TIMED_STEPS)
    time_test(timings, fabric.yarn, forces, fibres)
    return dataset, timings

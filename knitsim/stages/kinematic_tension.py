"""The paper's tensile test of a fabric, in every reading that its scene names."""

from functools import partial

import numpy as np

from knitsim.kinematic.tension import (
    Reading,
    deformed_points,
    fibre_points,
    loop_height,
    tensile_test,
)
from knitsim.loop.lattice import smallest_distance
from knitsim.stages.described import describe_stage
from knitsim.stages.laws import ledger_laws
from knitsim.stages.ledger import effect_dataset
from knitsim.stages.loop import loop_of
from knitsim.stages.needs import stores_fibres
from knitsim.stages.yarn import layout_of, signed_twist
from knitsim.store.tensile import stack_variants, test_dataset
from knitsim.store.timing import Timings
from knitsim.store.writer import to_json
from knitsim.study.schema import closure

STAGE = "kinematic_tension"
# The state of the art that the paper's run time is compared with: 200 steps, 72 fibres, 100 sections.
_TIMED_STEPS, _TIMED_SECTIONS, _TIMED_FIBRES = 200, 100, 72


def _curve(loop, laws, test, direction, choice, steps=None):
    reading = Reading(**{name: choice[name] for name in (*Reading.CHOICES, "viscous")})
    steps = steps or test["steps"]
    return tensile_test(
        loop, laws[reading.law], direction,
        test[f"max_strain_{direction}"] * np.arange(steps + 1) / steps, reading,
        friction_coefficient=test["viscous_coefficient"], velocity=test["velocity"],
    )  # fmt: skip


def _closest(loop, curve, points):
    """Smallest distance of yarn centre lines in every state (1, in diameters)."""
    along = curve.direction == "course"
    wale = loop.wale_spacing * (curve.scale_along if along else curve.scale_across)
    course = loop.course_spacing * (curve.scale_across if along else curve.scale_along)
    found = np.empty(curve.strain.size)
    for k, state in enumerate(points):
        lattice = np.array([[wale[k], 0.0, 0.0], [0.0, course[k], 0.0]])
        found[k] = smallest_distance(state, lattice, loop.diameter).distance / loop.diameter
    return found, wale, course


def _dataset(loop, curve, fabric, store):
    count = fabric["sections_per_loop"]
    u, _ = loop.sections(count)
    points = deformed_points(loop, curve, np.concatenate([loop.points(u), loop.points([1.0])]))
    closest, wale, course = _closest(loop, curve, points)
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
        "min_distance": closest,
        "status": curve.beyond_breaking_strain.astype(np.int8),
    }
    if "centreline" in store:
        variables["centreline"] = points
    dataset = test_dataset(
        "strain", curve.strain, curve.recovery, variables, stretch_energy=curve.energy
    )
    if stores_fibres(store):
        layout = layout_of(fabric.yarn)
        fibres = fibre_points(loop, curve, layout.positions, signed_twist(fabric.yarn), count)
        dataset["fibre_point"] = (("step", "section", "fibre", "axis"), fibres)
    return dataset


def headlines(fabric, direction):
    """{name: (value, units)} of the reference reading that the ledger follows."""
    loop = loop_of(fabric)
    test = fabric.scene["kinematic_tension"]
    choice = next(iter(test["variants"].values()))
    curve = _curve(loop, ledger_laws(fabric.yarn), test, direction, choice)
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


def _time(timings, loop, laws, test, direction, fabric):
    """Run times of the test as the paper would run it, once compiled."""
    choice = next(iter(test["variants"].values()))
    layout = layout_of(fabric.yarn).positions[:_TIMED_FIBRES]
    twist = signed_twist(fabric.yarn)

    def forces():
        return _curve(loop, laws, test, direction, choice, _TIMED_STEPS)

    def positions():
        up = np.arange(_TIMED_STEPS + 1)
        return fibre_points(loop, forces(), layout, twist, _TIMED_SECTIONS, up)

    timings.repeat(f"{direction}: {_TIMED_STEPS} steps, forces and spacings", forces)
    timings.repeat(
        f"{direction}: {_TIMED_STEPS} steps, positions of {len(layout)} fibres in"
        f" {_TIMED_SECTIONS} sections", positions,
    )  # fmt: skip


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput pulled in one direction; laws: TensionLaw by form."""
    timings = Timings(STAGE, fabric.name)
    test = fabric.scene[STAGE]
    loop = loop_of(fabric)
    readings = {}
    with timings.measure(f"{direction}: all readings, all steps, loading and recovery"):
        for name, choice in test["variants"].items():
            if direction == "wale" and choice["limit"] == "course_spacing":
                continue  # the paper gives this limit course-wise only
            curve = _curve(loop, laws, test, direction, choice)
            readings[name] = _dataset(loop, curve, fabric, test["store"])
    with timings.measure(f"{direction}: effect of the assumptions"):
        effects = effect_dataset(fabric, closure(STAGE), partial(headlines, direction=direction))
    dataset = stack_variants(readings).merge(effects)
    dataset["diameter"] = loop.diameter
    dataset["loop_height"] = loop_height(loop)
    dataset.attrs["readings"] = to_json({name: test["variants"][name] for name in readings})
    describe_stage(
        dataset, fabric, STAGE,
        title=f"Kinematic tensile test of {fabric.name}, {direction} direction",
        summary="The paper's eqs (4), (5), as printed and corrected, loading and recovery.",
        references=("paper",),
    )  # fmt: skip
    _time(timings, loop, laws, test, direction, fabric)
    return dataset, timings

"""What the stages of the kinematic tests share."""

import numpy as np

from knitsim.stages.ledger import effect_dataset
from knitsim.stages.loop import loop_of
from knitsim.stages.needs import stores_fibres
from knitsim.stages.yarn import layout_of, signed_twist
from knitsim.store.tensile import stack_variants, test_dataset
from knitsim.study.schema import closure

# What the paper's run times are compared with: 200 steps, 72 fibres, 100 sections.
TIMED_STEPS, TIMED_SECTIONS, TIMED_FIBRES = 200, 100, 72


def section_points(fabric):
    """Points (m, 3) of the loop of a FabricInput at its sections, the last the first of the next."""
    loop = loop_of(fabric)
    u, _ = loop.sections(fabric["sections_per_loop"])
    return np.concatenate([loop.points(u), loop.points([1.0])])


def states_dataset(along, curve, variables, points, fibres, fabric, store):
    """Dataset of one reading of a test, with what of its shape the scene stores.

    along: ``strain`` or ``curvature``; variables: arrays by schema name; points (steps, m, 3): the
    section_points in every state; fibres(layout, twist, sections): the fibres in every state.
    """
    if "centreline" in store:
        variables["centreline"] = points
    dataset = test_dataset(
        along, getattr(curve, along), curve.recovery, variables, stretch_energy=curve.energy
    )
    if stores_fibres(store):
        yarn = layout_of(fabric.yarn).positions, signed_twist(fabric.yarn)
        dims = ("step", "section", "fibre", "axis")
        dataset["fibre_point"] = (dims, fibres(*yarn, fabric["sections_per_loop"]))
    return dataset


def readings_dataset(fabric, stage, readings, headlines, timings):
    """Dataset of a test in all its readings {name: Dataset}, with the effect of the assumptions."""
    with timings.measure("effect of the assumptions"):
        effects = effect_dataset(fabric, closure(stage), headlines)
    dataset = stack_variants(readings).merge(effects)
    dataset["diameter"] = loop_of(fabric).diameter
    return dataset


def time_test(timings, yarn, forces, fibres):
    """Run times of a test as the paper would run it, once compiled.

    forces(): its curve; fibres(curve, layout, twist, sections): the fibres of its states.
    """
    layout, twist = layout_of(yarn).positions[:TIMED_FIBRES], signed_twist(yarn)
    timings.repeat(f"{TIMED_STEPS} steps, forces and spacings", forces)
    timings.repeat(
        f"{TIMED_STEPS} steps, positions of {len(layout)} fibres in {TIMED_SECTIONS} sections",
        lambda: fibres(forces(), layout, twist, TIMED_SECTIONS), whole=True,
    )  # fmt: skip

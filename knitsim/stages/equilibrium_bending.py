"""The bending test in the equilibrium model, in every condition that the scene names."""

from functools import partial

import numpy as np

from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.dataset import bend_dataset
from knitsim.errors import ComputationError, InputError
from knitsim.kes.rigidity import rigidity_and_curl
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import (
    at_rest,
    at_rest_again,
    both_ways,
    followed_at,
    settings_of,
    variants_dataset,
)
from knitsim.store.timing import Timings
from knitsim.units import from_si

STAGE = "equilibrium_bending"
LEAST_CURL = 1e-3  # of the moment that bends the fabric to a curvature of one over its wale spacing


def curvatures_of(choice):
    """Flat, then both ways in every cycle (1/m)."""
    cycle = both_ways(choice["max_curvature"], choice["states"])
    return np.concatenate([[0.0], *[cycle] * choice["cycles"]])


def relaxed_for(fabric, law, choice, resolution):
    """The fabric at rest as a condition has it: its friction, its set."""
    return at_rest(fabric, law, resolution, friction=choice["friction"], set_fraction=choice["set"])


def bent(fabric, relaxed, direction, variant, **options):
    """The BendingCurve; a curvature that the fabric is too thick for is refused by its key."""
    choice = fabric.scene[STAGE]["variants"][variant]
    try:
        curve = bend(
            relaxed, direction, curvatures_of(choice), spacings=choice["spacings"], **options,
        )  # fmt: skip
    except InputError as error:
        if error.where != "curvature":
            raise
        key = f"{STAGE}.variants.{variant}.max_curvature_per_cm"
        raise InputError(
            fabric.scene.where(key), f"{from_si(choice['max_curvature'], 'per_cm'):g}",
            f"fabric {fabric.name}: {error.right}",
        ) from error  # fmt: skip
    if not curve.steps:
        raise ComputationError(
            f"bending of {fabric.name}, {direction}, {variant}: no state was reached: "
            f"{curve.stop_reason}"
        )
    return curve


def headlines(fabric, resolution, direction):
    """{name: (value, units)} that the ledger follows, without friction and with spacings free.

    What changes 2HB stands in the table of sensitivities.
    """
    relaxed = at_rest_again(fabric, resolution)
    rigidity, curl = rigidity_and_curl(relaxed, direction)
    # A balanced pattern, such as a rib, has none: what is left is the solver's error.
    curl = curl if abs(curl) > LEAST_CURL * rigidity / relaxed.wale_spacing else 0.0
    return {"rigidity B": (rigidity, "N m"), "moment that holds it flat": (curl, "N")}


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput bent in one direction; laws: TensionLaw by form."""
    timings, settings = Timings(STAGE, fabric.name, direction), settings_of(fabric)
    solved, curves = {}, {}
    for name, choice in fabric.scene[STAGE]["variants"].items():
        with timings.measure(f"{name}, with its error estimate"):
            relaxed = relaxed_for(fabric, laws["continuous"], choice, settings.resolution)
            curve = bent(fabric, relaxed, direction, name, **settings.errors)
        curves[name] = curve
        solved[name] = curve, partial(bend_dataset, curve)
        timings.repeat(
            f"{name}, {curve.steps} states from flat",
            partial(bent, fabric, curve.start, direction, name),
        )
    followed = partial(headlines, resolution=followed_at(curves.values()), direction=direction)
    dataset = variants_dataset(fabric, STAGE, solved, followed, timings)
    describe_stage(
        dataset, fabric, STAGE, direction=direction, settings=settings.told(curves), references=("munden",),
        title=f"Equilibrium bending of {fabric.name}, {direction} direction curved",
        summary="One interlooped yarn in a lattice rolled about a cylinder, in equilibrium in every"
        " state; the moment is that about the mean plane of the centre line.",
    )  # fmt: skip
    return dataset, timings

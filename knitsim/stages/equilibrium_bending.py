"""The bending test in the equilibrium model, in every condition that the scene names."""

from dataclasses import replace
from functools import partial

import numpy as np

from knitsim.equilibrium import pull as tension
from knitsim.equilibrium.bend import FRICTION_INCREMENT, bend
from knitsim.equilibrium.dataset import bend_dataset
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError
from knitsim.kes.rigidity import rigidity_and_curl
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import (
    at_rest_again,
    both_ways,
    resolution_for,
    settings_of,
    solver_fabric,
    variants_dataset,
)
from knitsim.store.timing import Timings
from knitsim.units import from_si

STAGE = "equilibrium_bending"


def curvatures_of(choice):
    """Flat, then both ways in every cycle (1/m)."""
    cycle = both_ways(choice["max_curvature"], choice["states"])
    return np.concatenate([[0.0], *[cycle] * choice["cycles"]])


def _relaxed(fabric, law, choice, settings):
    built = solver_fabric(fabric, law, friction=choice["friction"], set_fraction=choice["set"])
    if choice["friction"]:
        built = replace(built, bending_hysteresis=fabric.yarn["bending_hysteresis"])
    return relax(built, resolution_for(fabric, settings))


def _turn(choice, settings):
    """Largest change of curvature of one step with friction, finer as that of strain; None: bend's."""
    finer = settings.increment / tension.FRICTION_INCREMENT
    return finer * FRICTION_INCREMENT if finer != 1.0 and choice["friction"] else None


def bent(fabric, relaxed, direction, variant, settings, **options):
    """The BendingCurve; a curvature that the fabric is too thick for is refused by its key."""
    choice = fabric.scene[STAGE]["variants"][variant]
    try:
        curve = bend(
            relaxed, direction, curvatures_of(choice), spacings=choice["spacings"],
            increment=_turn(choice, settings), **options,
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


def headlines(fabric, stated, settings, direction):
    """{name: (value, units)} that the ledger follows, without friction and with spacings free.

    What changes 2HB stands in the table of sensitivities.
    """
    relaxed, _ = at_rest_again(fabric, stated, settings)
    rigidity, curl = rigidity_and_curl(relaxed, direction)
    return {"rigidity B": (rigidity, "N m"), "moment that holds it flat": (curl, "N")}


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput bent in one direction; laws: TensionLaw by form."""
    timings, settings = Timings(STAGE, fabric.name, direction), settings_of(fabric)
    solved = {}
    for name, choice in fabric.scene[STAGE]["variants"].items():
        with timings.measure(f"{name}, with its error estimate"):
            relaxed = _relaxed(fabric, laws["continuous"], choice, settings)
            curve = bent(fabric, relaxed, direction, name, settings, estimate_error=True)
        solved[name] = curve, partial(bend_dataset, curve)
        timings.repeat(
            f"{name}, {curve.steps} states from flat",
            partial(bent, fabric, relaxed, direction, name, settings),
        )
    followed = partial(headlines, stated=fabric, settings=settings, direction=direction)
    dataset = variants_dataset(fabric, STAGE, solved, followed, timings)
    describe_stage(
        dataset, fabric, STAGE, direction=direction, settings=settings, references=("munden",),
        title=f"Equilibrium bending of {fabric.name}, {direction} direction curved",
        summary="One interlooped yarn in a lattice rolled about a cylinder, in equilibrium in every"
        " state; the moment is that about the mean plane of the centre line.",
    )  # fmt: skip
    return dataset, timings

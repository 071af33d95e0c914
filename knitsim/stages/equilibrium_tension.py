"""The tension test in the equilibrium model, in every condition that the scene names."""

from functools import partial

import numpy as np

from knitsim.equilibrium.dataset import pull_dataset
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.whole_test import pulled
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import (
    at_rest,
    at_rest_again,
    finest,
    settings_of,
    variants_dataset,
)
from knitsim.store.timing import Timings

STAGE = "equilibrium_tension"
# Strains at which the ledger follows the force.
HEADLINE_STRAINS = (0.2, 0.6)


def strains_of(choice, direction):
    top = choice[f"max_strain_{direction}"]
    return top * np.arange(1, choice["states"] + 1) / choice["states"]


def conditions_of(choice):
    """Arguments of knitsim.equilibrium.pull.tensile that one condition stands for."""
    lateral = choice["lateral_load"] if choice["lateral"] == "loaded" else choice["lateral"]
    kept = {name: choice[name] for name in ("recovery", "cycles", "to_force")}
    return {"lateral": lateral, **kept}


def headlines(fabric, resolution, direction):
    """{name: (value, units)} that the ledger follows: of the reference condition, and with friction."""
    choices = fabric.scene[STAGE]["variants"]
    tests = {"": (next(iter(choices.values()))["friction"], HEADLINE_STRAINS)}
    if any(choice["friction"] for choice in choices.values()):
        tests[", with friction"] = (True, HEADLINE_STRAINS[:1])
    found = {}
    for what, (friction, strains) in tests.items():
        relaxed = at_rest_again(fabric, resolution, friction=friction)
        curve = tensile(relaxed, direction, strains)
        for k, strain in enumerate(strains):
            force = curve.force_per_width[k] if k < curve.steps else np.nan
            found[f"force per width at {100 * strain:g} % strain{what}"] = (force, "N m-1")
    return found


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput pulled in one direction; laws: TensionLaw by form."""
    timings, settings = Timings(STAGE, fabric.name, direction), settings_of(fabric)
    solved, curves = {}, {}
    for name, choice in fabric.scene[STAGE]["variants"].items():
        strains, conditions = strains_of(choice, direction), conditions_of(choice)
        with timings.measure(f"{name}, with its error estimate"):
            relaxed = at_rest(
                fabric, laws["continuous"], settings.resolution, friction=choice["friction"]
            )
            curve = pulled(relaxed, direction, strains, **conditions, **settings.errors)
        curves[name] = curve
        solved[name] = curve, partial(pull_dataset, curve)
        timings.repeat(
            f"{name}, {curve.steps - 1} states from rest",
            partial(tensile, curve.start, direction, strains, **conditions),
        )
    followed = partial(headlines, resolution=finest(curves.values()), direction=direction)
    dataset = variants_dataset(fabric, STAGE, solved, followed, timings)
    describe_stage(
        dataset, fabric, STAGE, direction=direction, settings=settings.told(curves), references=("munden",),
        title=f"Equilibrium tensile test of {fabric.name}, {direction} direction",
        summary="One interlooped yarn in a periodic lattice, in equilibrium in every state.",
    )  # fmt: skip
    return dataset, timings

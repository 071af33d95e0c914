"""The tension test in the equilibrium model, in every condition that the scene names."""

from functools import partial

import numpy as np

from knitsim.equilibrium.dataset import pull_dataset
from knitsim.equilibrium.programme import programme
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.whole_test import from_rest, pulled
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import (
    at_rest,
    at_rest_again,
    followed_at,
    settings_of,
    variants_dataset,
)
from knitsim.stages.memory import cycles_dataset, turns_of
from knitsim.store.timing import Timings

STAGE = "equilibrium_tension"
BEYOND = 1.02  # times the strain that is reached
# Strains at which the ledger follows the force.
HEADLINE_STRAINS = (0.2, 0.6)


def strains_of(choice, direction, relaxed):
    """Strains up to the largest, or a little beyond that at which the force which ends the test is reached,
    so that the states resolve the way to it.
    """
    top, parts = (
        choice[f"max_strain_{direction}"],
        np.arange(1, choice["states"] + 1) / choice["states"],
    )
    if choice["to_force"] is not None:
        once = conditions_of(choice) | {"recovery": False, "cycles": 1}
        first = tensile(relaxed, direction, top * parts, **once)
        if not first.stop_reason:
            top = min(top, float(f"{BEYOND * first.strain.max():.3g}"))
    return top * parts


def conditions_of(choice):
    """Arguments of knitsim.equilibrium.pull.tensile that one condition stands for, strains excepted."""
    kept = {name: choice[name] for name in ("recovery", "cycles", "to_force")}
    return {"lateral": _lateral(choice), **kept}


def _lateral(choice):
    return choice["lateral_load"] if choice["lateral"] == "loaded" else choice["lateral"]


def tests_of(choice, direction, relaxed):
    """(whole test from rest on, the test alone), functions of the fabric at rest; relaxed: one such."""
    lateral = _lateral(choice)
    if choice["programme"] is not None:
        alone = partial(
            programme, direction=direction, turns=turns_of(choice["programme"]) * choice["cycles"],
            lateral=lateral, states=choice["states"],
        )  # fmt: skip

        def whole(relaxed, **errors):
            curve = alone(relaxed, **errors)
            return curve if choice["lateral"] == "loaded" else from_rest(curve)

        return whole, alone
    test = {
        "direction": direction, "strains": strains_of(choice, direction, relaxed), **conditions_of(choice),
    }  # fmt: skip
    return partial(pulled, **test), partial(tensile, **test)


def _dataset(curve, cycles, steps):
    return pull_dataset(curve, steps).merge(cycles_dataset(curve, cycles))


def headlines(fabric, resolution, direction, reached=np.inf):
    """{name: (value, units)} that the ledger follows: of the reference condition, and with friction.

    reached: the strain at which the reference condition ended where it went to a force.  What lies beyond is
    not followed: a fabric near locking takes long.
    """
    choices = fabric.scene[STAGE]["variants"]
    first = next(iter(choices.values()))
    ends = reached if first["to_force"] is not None else np.inf
    tests = {"": (first["friction"], [s for s in HEADLINE_STRAINS if s <= ends])}
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
    curves = {}
    for name, choice in fabric.scene[STAGE]["variants"].items():
        with timings.measure(f"{name}, with its error estimate"):
            relaxed = at_rest(
                fabric, laws["continuous"], settings.resolution, friction=choice["friction"]
            )
            whole, alone = tests_of(choice, direction, relaxed)
            curve = whole(relaxed, **settings.errors)
        curves[name] = curve
        timings.repeat(f"{name}, {curve.steps - 1} states from rest", partial(alone, curve.start))
    cycles = max(int(curve.cycle.max(initial=1)) for curve in curves.values())
    solved = {name: (curve, partial(_dataset, curve, cycles)) for name, curve in curves.items()}
    followed = partial(
        headlines, resolution=followed_at(curves.values()), direction=direction,
        reached=next(iter(curves.values())).strain.max(),
    )  # fmt: skip
    dataset = variants_dataset(fabric, STAGE, solved, followed, timings)
    describe_stage(
        dataset, fabric, STAGE, direction=direction, settings=settings.told(curves), references=("munden",),
        title=f"Equilibrium tensile test of {fabric.name}, {direction} direction",
        summary="One interlooped yarn in a periodic lattice, in equilibrium in every state.",
    )  # fmt: skip
    return dataset, timings

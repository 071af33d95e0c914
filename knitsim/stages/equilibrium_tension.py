"""The tension test in the equilibrium model, in every condition that the scene names."""

from functools import partial

import numpy as np

from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import (
    curve_dataset,
    from_rest,
    resolution_of,
    settings_of,
    solver_fabric,
    variants_dataset,
)
from knitsim.stages.laws import ledger_laws
from knitsim.stages.ledger import effect_dataset
from knitsim.stages.needs import solves_recovery
from knitsim.stages.reversible import there_and_back
from knitsim.store.timing import Timings
from knitsim.study.schema import closure

STAGE = "equilibrium_tension"
# Strains at which the ledger follows the force.
HEADLINE_STRAINS = (0.2, 0.6)


def _strains(choice, direction):
    top = choice[f"max_strain_{direction}"]
    return top * np.arange(1, choice["states"] + 1) / choice["states"]


def _conditions(fabric, choice):
    """Arguments of knitsim.equilibrium.pull.tensile that one condition stands for."""
    lateral = choice["lateral_load"] if choice["lateral"] == "loaded" else choice["lateral"]
    return {
        "lateral": lateral,
        "recovery": choice["recovery"],
        "cycles": choice["cycles"],
        "to_force": choice["to_force"],
        "increment": settings_of(fabric).increment,
    }


def _solve(fabric, law, choice, direction):
    """(Relaxed, Curve) of one condition, with its error estimate."""
    built = solver_fabric(fabric, law, friction=choice["friction"])
    relaxed = relax(built, resolution_of(fabric))
    strains = _strains(choice, direction)
    # Under a lateral load the fabric at its relaxed spacing carries a force: it does not start at rest.
    loaded = choice["lateral"] == "loaded"
    conditions = _conditions(fabric, choice)
    back = conditions["recovery"] and not solves_recovery(choice) and not loaded
    one_way = conditions | {"recovery": False, "cycles": 1}
    curve = tensile(
        relaxed, direction, strains, estimate_error=True, **(one_way if back else conditions)
    )
    if back and curve.dissipated.any():
        # A fabric that snaps comes back by another way.
        curve = tensile(relaxed, direction, strains, estimate_error=True, **conditions)
    elif back:
        curve = there_and_back(curve, relaxed, choice["cycles"])
    return relaxed, curve if loaded else from_rest(curve, relaxed)


def headlines(fabric, direction):
    """{name: (value, units)} that the ledger follows: of the reference condition, and with friction."""
    law = ledger_laws(fabric.yarn)["continuous"]
    choices = fabric.scene[STAGE]["variants"]
    tests = {"": (next(iter(choices.values()))["friction"], HEADLINE_STRAINS)}
    if any(choice["friction"] for choice in choices.values()):
        tests[", with friction"] = (True, HEADLINE_STRAINS[:1])
    found = {}
    for what, (friction, strains) in tests.items():
        built = solver_fabric(fabric, law, friction=friction)
        relaxed = relax(built, resolution_of(fabric))
        curve = tensile(relaxed, direction, strains, increment=settings_of(fabric).increment)
        for k, strain in enumerate(strains):
            force = curve.force_per_width[k] if k < curve.steps else np.nan
            found[f"force per width at {100 * strain:g} % strain{what}"] = (force, "N m-1")
    return found


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput pulled in one direction; laws: TensionLaw by form."""
    timings = Timings(STAGE, fabric.name)
    law = laws["continuous"]
    choices = fabric.scene[STAGE]["variants"]
    solved, reasons = {}, {}
    for name, choice in choices.items():
        with timings.measure(f"{direction}: {name}, with its error estimate"):
            solved[name] = _solve(fabric, law, choice, direction)
        relaxed, curve = solved[name]
        reasons[name] = curve.stop_reason
        timings.repeat(
            f"{direction}: {name}, {curve.steps - 1} states from rest",
            partial(
                tensile,
                relaxed,
                direction,
                _strains(choice, direction),
                **_conditions(fabric, choice),
            ),
        )
    steps = max(curve.steps for _, curve in solved.values())
    states = {
        name: curve_dataset(curve, relaxed, law.breaking_strain, steps)
        for name, (relaxed, curve) in solved.items()
    }
    with timings.measure(f"{direction}: effect of the assumptions"):
        effects = effect_dataset(fabric, closure(STAGE), partial(headlines, direction=direction))
    dataset = variants_dataset(fabric, STAGE, states, reasons, effects)
    describe_stage(
        dataset, fabric, STAGE,
        title=f"Equilibrium tensile test of {fabric.name}, {direction} direction",
        summary="One interlooped yarn in a periodic lattice, in equilibrium in every state.",
        references=("munden",),
    )  # fmt: skip
    return dataset, timings

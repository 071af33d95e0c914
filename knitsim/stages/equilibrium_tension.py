"""The tension test in the equilibrium model, in every condition that the scene names."""

from functools import partial

import numpy as np

from knitsim.equilibrium.dataset import pull_dataset
from knitsim.equilibrium.programme import programme
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.result import LOADING
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
from knitsim.study.scene_keys import EASY

STAGE = "equilibrium_tension"
# Times the strain at which a first pull has reached the force: finer steps may need a little more.
BEYOND = (1.02, 1.1, 1.3)
STEEP = 0.25  # of the force: a step over which it changes by more is divided
DIVIDED = 3  # times at most
# Strains at which the ledger follows the force.
HEADLINE_STRAINS = (0.2, 0.6)
SHORT = 0.6  # of the strain that is reached, where that is less


def _strains_to(curve, choice, top):
    """Strains (n,) up to a little beyond that at which loading ended in a curve, the last force of the test.

    These lie evenly along strain and force together, each over its last: a curve that runs steeply into
    locking has states there too, between which it can be read.
    """
    strain, force = _loaded(curve)
    way = strain / strain[-1] + force / force[-1]
    even = np.interp(2.0 * np.arange(1, choice["states"]) / choice["states"], way, strain)
    found = np.append(even, np.multiply(BEYOND, strain[-1]))
    return np.unique([min(top, float(f"{one:.4g}")) for one in found])


def _loaded(curve):
    """Strain, and the largest force per width so far, from rest to the end of the first loading."""
    first = (curve.phase == LOADING) & (curve.cycle <= 1)
    force = np.maximum.accumulate(curve.force_per_width[first])
    return np.append(0.0, curve.strain[first]), np.append(0.0, force)


def _tensile(choice, direction, relaxed, **errors):
    """(curve from rest on, its strains) of a tension test."""
    top, test = choice[f"max_strain_{direction}"], conditions_of(choice)
    strains = top * np.arange(1, choice["states"] + 1) / choice["states"]
    if choice["to_force"] is None:
        return pulled(relaxed, direction, strains, **test, **errors), strains
    # Beyond what a test goes to without a force, a first pull has more states.
    count = int(np.ceil(choice["states"] * max(1.0, top / EASY[direction])))
    strains = top * np.arange(1, count + 1) / count
    once = test | {"recovery": False, "cycles": 1}
    curve = tensile(relaxed, direction, strains, **once)
    for _ in range(DIVIDED):
        if not curve.stop_reason:
            strains = _strains_to(curve, choice, top)
        curve = pulled(relaxed, direction, strains, **test, **errors)
        _, force = _loaded(curve)
        if curve.stop_reason or np.diff(force).max() <= STEEP * force[-1]:
            break
    return curve, strains


def conditions_of(choice):
    """Arguments of knitsim.equilibrium.pull.tensile that one condition stands for, strains excepted."""
    kept = {name: choice[name] for name in ("recovery", "cycles", "to_force")}
    return {"lateral": _lateral(choice), **kept}


def _lateral(choice):
    return choice["lateral_load"] if choice["lateral"] == "loaded" else choice["lateral"]


def tested(choice, direction, relaxed, **errors):
    """(curve of one condition from rest on, the same test alone as a function of the fabric at rest).

    errors: arguments that ask for error estimates.
    """
    lateral = _lateral(choice)
    if choice["programme"] is not None:
        alone = partial(
            programme, direction=direction, turns=turns_of(choice["programme"]) * choice["cycles"],
            lateral=lateral, states=choice["states"],
        )  # fmt: skip
        curve = alone(relaxed, **errors)
        return curve if choice["lateral"] == "loaded" else from_rest(curve), alone
    curve, strains = _tensile(choice, direction, relaxed, **errors)
    return curve, partial(tensile, direction=direction, strains=strains, **conditions_of(choice))


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
    # Of a fabric that comes to the force before them, one that it comes by.
    strains = [s for s in HEADLINE_STRAINS if s <= ends] or [float(f"{SHORT * ends:.1g}")]
    tests = {"": (first["friction"], strains)}
    if any(choice["friction"] for choice in choices.values()):
        tests[", with friction"] = (True, strains[:1])
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
            curve, alone = tested(choice, direction, relaxed, **settings.errors)
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

"""What the equilibrium stages share: a fabric's input as the solver wants it, states as a dataset."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.pull import FRICTION_INCREMENT
from knitsim.equilibrium.relax import relax
from knitsim.equilibrium.to_accuracy import Settings, settings_for
from knitsim.errors import InputError
from knitsim.measured.read import read_entry
from knitsim.stages.laws import calibration_of, laws_of, ledger_laws
from knitsim.stages.ledger import effect_dataset
from knitsim.stages.needs import cell_of
from knitsim.store.tensile import stack_variants
from knitsim.store.writer import to_json
from knitsim.study.contact_keys import stated_contact
from knitsim.study.schema import closure
from knitsim.yarn.compression import fit_barrier_test

# Keys of the scene that say how finely a fabric is solved.
_FINENESS = ("equilibrium_rest.points", "equilibrium_rest.accuracy")


def contact_of(yarn):
    """Contact law of a YarnInput: a core law, a calibrated stiffness or the stated one."""
    if (stated := stated_contact(yarn)) is not None:
        return stated
    if yarn["compression_curve"] is not None:
        test = read_entry(yarn["compression_curve"], yarn.compression_paths, "yarn_compression")
        return BarrierContact(fit_barrier_test(test, yarn["diameter"]).stiffness)
    return BarrierContact(yarn["compression_stiffness"])


def solver_fabric(fabric, law, *, friction=False, set_fraction=None, loop_length=None):
    """knitsim.equilibrium Fabric of a FabricInput; law: TensionLaw of its yarn.

    set_fraction, loop_length: instead of the stated ones.
    """
    yarn = fabric.yarn
    return Fabric(
        fabric["wale_spacing"], fabric["course_spacing"],
        fabric["loop_length"] if loop_length is None else loop_length,
        yarn["diameter"], yarn["bending_rigidity"], law,
        contact=contact_of(yarn),
        friction=yarn["friction"] if friction else 0.0,
        set_fraction=fabric["set"] if set_fraction is None else set_fraction,
    )  # fmt: skip


@contextmanager
def named_by_key(fabric):
    """Refusals of the solver about a quantity of a FabricInput name the key that states it."""
    try:
        yield
    except InputError as error:
        quantity = error.where.replace(" ", "_")
        given = next((one for one in (fabric, fabric.yarn) if quantity in one.values), None)
        if given is None:
            raise
        raise InputError(*given.stated(quantity), f"fabric {fabric.name}: {error.right}") from error


def settings_of(fabric):
    """Settings (of knitsim.equilibrium.to_accuracy) that the scene of a FabricInput asks for.

    They follow from the input alone; those for an accuracy are sought, which takes computing.  Raises
    InputError where none reaches the accuracy.
    """
    test = fabric.scene["equilibrium_rest"]
    if test["accuracy"] is None:
        return Settings(Resolution(points=test["points"]), FRICTION_INCREMENT, None)
    return _settings_for(fabric, test["accuracy"])


def _settings_for(fabric, accuracy):
    law = laws_of(fabric.yarn, calibration_of(fabric.yarn))["continuous"]
    tests = [
        choice
        for name in ("equilibrium_tension", "equilibrium_bending")
        for choice in (fabric.scene[name] or {"variants": {}})["variants"].values()
    ] + [fabric.scene["equilibrium_shear"] or {"friction": False}]
    built = solver_fabric(fabric, law, friction=any(choice["friction"] for choice in tests))
    strains = {
        direction: [choice[key] for choice in tests if key in choice]
        for direction in ("course", "wale")
        for key in [f"max_strain_{direction}"]
    }
    largest = {direction: min(found) for direction, found in strains.items() if found}
    try:
        return settings_for(built, accuracy, largest or None)
    except InputError as error:
        where, value = fabric.scene.stated("equilibrium_rest.accuracy")
        raise InputError(where, value, f"fabric {fabric.name}: {error.right}") from error


def resolution_for(fabric, settings, test="equilibrium_rest"):
    """Resolution of an equilibrium test of the scene of a FabricInput under these settings."""
    return replace(settings.resolution, cell=cell_of(fabric.scene, test))


def resolution_of(fabric):
    """As :func:`resolution_for` of the fabric at rest, under the settings that it asks for."""
    return resolution_for(fabric, settings_of(fabric))


def at_rest(fabric, law, settings, test="equilibrium_rest", **options):
    """A FabricInput at rest under these settings; law, options: as :func:`solver_fabric` takes them."""
    return relax(solver_fabric(fabric, law, **options), resolution_for(fabric, settings, test))


def settings_again(fabric, stated, settings):
    """Settings for what with_value made of ``stated``, whose own are ``settings``.

    They stay, so that the effect of an assumption is not that of other points, unless the scene asks
    for others.
    """
    same = all(fabric.scene[key] == stated.scene[key] for key in _FINENESS)
    return settings if same else settings_of(fabric)


def at_rest_again(fabric, stated, settings, **options):
    """(RelaxedFabric, its settings) without a calibration, the settings by :func:`settings_again`."""
    settings = settings_again(fabric, stated, settings)
    return at_rest(fabric, ledger_laws(fabric.yarn)["continuous"], settings, **options), settings


def both_ways(largest, states):
    """Values of a test: to the largest, back to 0, to its negative, and back; the ends hit exactly."""
    up = largest * np.arange(1, states + 1) / states
    back = np.append(up[-2::-1], 0.0)
    return np.concatenate([up, back, -up, -back])


def variants_dataset(fabric, stage, solved, headlines, timings):
    """Dataset of a test in all its conditions, with the effect of the assumptions.

    solved: {condition: (its curve, a function of the number of rows that gives its Dataset)}; headlines:
    as ledger.effect_dataset takes them.  Where a curve ended early stands in ``stop_reason``.
    """
    steps = max(curve.steps for curve, _ in solved.values())
    dataset = stack_variants({name: dataset_of(steps) for name, (_, dataset_of) in solved.items()})
    with timings.measure("effect of the assumptions"):
        dataset = dataset.merge(effect_dataset(fabric, closure(stage), headlines))
    dataset["diameter"] = fabric.yarn["diameter"]
    dataset.attrs["readings"] = to_json(fabric.scene[stage]["variants"])
    dataset.attrs["stop_reason"] = "; ".join(
        f"{name}: {curve.stop_reason}" for name, (curve, _) in solved.items() if curve.stop_reason
    )
    return dataset

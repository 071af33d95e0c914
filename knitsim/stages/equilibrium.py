"""What the equilibrium stages share: a fabric's input as the solver wants it, states as a dataset."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import xarray as xr

from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.pull import FRICTION_INCREMENT
from knitsim.equilibrium.to_accuracy import Settings, settings_for
from knitsim.errors import InputError
from knitsim.measured.read import read_entry
from knitsim.stages.laws import calibration_of, laws_of
from knitsim.stages.needs import cell_of
from knitsim.store.schema import AXES, ENERGY_TERMS, PHASES, VARIABLES
from knitsim.store.tensile import stack_variants
from knitsim.store.writer import to_json
from knitsim.study.contact_keys import stated_contact
from knitsim.yarn.compression import fit_barrier_test

_STATES = VARIABLES["status"].flags


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

    Those for an accuracy are sought once, for a fabric and what with_value makes of it.  Raises
    InputError where none reaches the accuracy.
    """
    if fabric.settings is None:
        test = fabric.scene["equilibrium_rest"]
        if test["accuracy"] is None:
            found = Settings(Resolution(points=test["points"]), FRICTION_INCREMENT, None)
        else:
            found = _settings_for(fabric, test["accuracy"])
        fabric.settings = found
    return fabric.settings


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


def resolution_of(fabric, test="equilibrium_rest"):
    """Resolution that an equilibrium test of the scene asks for."""
    return replace(settings_of(fabric).resolution, cell=cell_of(fabric.scene, test))


def from_rest(curve, relaxed):
    """The Curve with the relaxed state as its first: strain, force, work and their error are zero."""
    first = {
        "energy": relaxed.energy,
        "min_distance": relaxed.min_distance,
        "residual": relaxed.residual,
        "iterations": relaxed.iterations,
        "cycle": 1,
        "y": relaxed.y,
    }
    names = (
        "strain", "wale_strain", "phase", "cycle", "force_per_loop", "force_per_width", "forces",
        "energy", "work", "dissipated", "min_distance", "residual", "iterations", "status", "y",
        "numerical_error",
    )  # fmt: skip
    rows = {}
    for name in names:
        values = np.asarray(getattr(curve, name))
        row = np.broadcast_to(np.asarray(first.get(name, 0)), values.shape[1:])
        rows[name] = np.concatenate([row[None], values]).astype(values.dtype)
    return curve.replaced(**rows)


def padding(reached, steps=None):
    """A function that fills an array (reached, ...) up to ``steps`` rows, by default as it is.

    It takes the array and what stands in the rows that were not reached, not a number by default.
    """
    steps = reached if steps is None else steps

    def padded(values, fill=np.nan):
        values = np.asarray(values)
        out = np.full((steps, *values.shape[1:]), fill, dtype=np.result_type(values, type(fill)))
        out[:reached] = values
        return out

    return padded


def status_of(yarn_strain, breaking_strain, steps=None):
    """Status flags (int8) of states by their yarn strain (reached,), padded to ``steps``."""
    status = np.where(
        yarn_strain > breaking_strain,
        _STATES.index("beyond_breaking_strain"),
        _STATES.index("valid"),
    )
    missing = _STATES.index("not_converged")
    return padding(status.size, steps)(status, missing).astype(np.int8)


def curve_dataset(curve, relaxed, breaking_strain, steps=None, along="strain"):
    """Dataset of a knitsim.equilibrium Curve, padded to ``steps`` stored states.

    along: name of the coordinate that the test goes through, ``strain`` or ``shear_angle``.  Rows
    that were not reached hold no numbers and the status not_converged.
    """
    status = status_of(curve.yarn_strain, breaking_strain, steps)
    own = {
        "force_per_loop": curve.force_per_loop,
        "force_per_width": curve.force_per_width,
        "yarn_tension": curve.yarn_tension,
        "yarn_strain": curve.yarn_strain,
        "transverse_strain": curve.transverse_strain,
    }
    return states_dataset(curve, own, curve.centreline, {along: curve.strain}, status)


def states_dataset(curve, own, centreline, coordinate, status):
    """Dataset of the states of a tensile, shear or bending test, padded to the rows of ``status``.

    own: arrays (states,) of this kind of test, by name, beside what all of them store; coordinate:
    {name: (states,)}, what the test goes through.
    """
    padded = padding(curve.steps, status.size)
    data = {name: ("step", padded(values)) for name, values in own.items()}
    for name in (
        "wale_spacing", "course_spacing", "work", "dissipated", "min_distance", "residual",
        "numerical_error",
    ):  # fmt: skip
        data[name] = ("step", padded(getattr(curve, name)))
    data["iterations"] = ("step", padded(curve.iterations, 0))
    intact = padded(curve.crossings_intact.astype(np.int8), 0).astype(np.int8)
    data["crossings_intact"] = ("step", intact)
    data["status"] = ("step", status)
    data["energy"] = (("step", "term"), padded(curve.energy))
    data["centreline"] = (("step", "point", "axis"), padded(centreline))
    phase = np.array(PHASES)[padded(curve.phase, 0).astype(int)]
    return xr.Dataset(
        data,
        {
            "step": np.arange(status.size),
            "term": list(ENERGY_TERMS),
            "point": np.arange(centreline.shape[1]),
            "axis": list(AXES),
            **{name: ("step", padded(values)) for name, values in coordinate.items()},
            "phase": ("step", phase),
            "cycle": ("step", padded(curve.cycle, 1)),
        },
    )


def variants_dataset(fabric, stage, states, reasons, effects):
    """Dataset of a test in all its variants.

    states: {variant: Dataset}; reasons: {variant: why its curve ended early, or nothing}; effects:
    Dataset of what the assumptions change.
    """
    dataset = stack_variants(states).merge(effects)
    dataset["diameter"] = fabric.yarn["diameter"]
    dataset.attrs["readings"] = to_json(fabric.scene[stage]["variants"])
    dataset.attrs["stop_reason"] = "; ".join(f"{n}: {r}" for n, r in reasons.items() if r)
    return dataset

"""From the yarn's bending rigidity to the fabric's: over loop length, yarn diameter and set."""

from dataclasses import replace

import numpy as np
import xarray as xr

from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError
from knitsim.kes.rigidity import affine_rigidity, rigidity_and_curl
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.store.results import DIRECTIONS
from knitsim.store.timing import Timings

STAGE = "yarn_to_fabric"


def swept_fabrics(built, test):
    """[(what is swept, Fabric)] of a scene's section; built: the knitsim.equilibrium Fabric itself.

    The yarn's rigidity, compression and tension law and the stated spacings stay.
    """
    count = test["points"]
    for quantity, own in (("loop_length", built.loop_length), ("diameter", built.diameter)):
        factors = np.linspace(test[f"{quantity}_low"], test[f"{quantity}_high"], count)
        for fraction in test["set_compared"]:
            for factor in factors:
                yield quantity, {quantity: factor * own, "set_fraction": fraction}
    for fraction in np.linspace(0.0, test["set_high"], count):
        yield "set", {"set_fraction": float(fraction)}


def _compared(fabric, resolution):
    """(wale spacing, course spacing, rigidities, curl moments, affine rigidities) of a Fabric."""
    relaxed = relax(fabric, resolution)
    spacings = relaxed.wale_spacing, relaxed.course_spacing
    found = np.array([rigidity_and_curl(relaxed, direction) for direction in DIRECTIONS])
    affine = affine_rigidity(relaxed.centreline, fabric.bending_rigidity, *spacings)
    return *spacings, found[:, 0], found[:, 1], affine


def run(fabric, laws):
    """(dataset, timings) of a FabricInput; laws: TensionLaw of its yarn by form."""
    timings = Timings(STAGE, fabric.name)
    test = fabric.scene[STAGE]
    built, settings = solver_fabric(fabric, laws["continuous"]), settings_of(fabric)
    resolution = settings.resolution
    rows, swept, reasons = [], [], []
    with timings.measure("rigidity over loop length, diameter and set"):
        for quantity, changes in swept_fabrics(built, test):
            named = ", ".join(f"{name} {value:.4g}" for name, value in changes.items())
            missing = (np.full(2, np.nan),) * 3
            try:
                one = replace(built, **changes)
                found = _compared(one, resolution)
            except (InputError, ComputationError) as error:
                reasons.append(f"{named}: {error}")
                found = (np.nan, np.nan, *missing)
            values = {
                "loop_length": built.loop_length, "diameter": built.diameter, **changes
            }  # fmt: skip
            swept.append(quantity)
            rows.append((values["loop_length"], values["diameter"], values["set_fraction"], *found))
    names = (
        "swept_loop_length", "swept_diameter", "swept_set", "wale_spacing", "course_spacing",
        "fabric_rigidity", "curl_moment", "affine_rigidity",
    )  # fmt: skip
    columns = dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))
    dataset = xr.Dataset(
        {
            name: (("row", "direction")[: values.ndim], values)
            for name, values in columns.items()
        }
        | {
            "yarn_rigidity": built.bending_rigidity,
            "diameter": built.diameter,
            "loop_length": built.loop_length,
        },
        {"row": np.arange(len(rows)), "direction": list(DIRECTIONS), "swept": ("row", swept)},
    )  # fmt: skip
    dataset.attrs["not_reached"] = "; ".join(reasons)
    describe_stage(
        dataset, fabric, STAGE,
        title=f"Bending rigidity of fabric {fabric.name} over that of its yarn",
        summary="Loop length, yarn diameter and set change one at a time; equilibrium without"
        " friction, spacings free.",
        references=("munden",), settings=settings.fixed,
    )  # fmt: skip
    return dataset, timings

"""The shear test in the equilibrium model."""

import numpy as np

from knitsim.equilibrium.pull import shear
from knitsim.equilibrium.relax import relax
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import curve_dataset, resolution_of, settings_of, solver_fabric
from knitsim.store.timing import Timings

STAGE = "equilibrium_shear"


def angles_of(test):
    """0 to the largest angle, to the negative one, and back to 0 (rad), the ends hit exactly."""
    up = test["max_angle"] * np.arange(1, test["states"] + 1) / test["states"]
    down = up[::-1][1:]
    return np.concatenate([up, down, [0.0], -up, -down, [0.0]])


def run(fabric, laws):
    """(dataset, timings) of a FabricInput; laws: TensionLaw of its yarn by form."""
    timings = Timings(STAGE, fabric.name)
    test = fabric.scene[STAGE]
    law = laws["continuous"]
    built = solver_fabric(fabric, law, friction=test["friction"])
    relaxed = relax(built, resolution_of(fabric, STAGE))
    with timings.measure("shear, with its error estimate"):
        curve = shear(
            relaxed, angles_of(test), tension=test["tension"],
            increment=settings_of(fabric).increment, estimate_error=True,
        )  # fmt: skip
    dataset = curve_dataset(curve, relaxed, law.breaking_strain, along="shear_angle")
    dataset = dataset.drop_vars("transverse_strain")
    dataset["diameter"] = fabric.yarn["diameter"]
    dataset.attrs["stop_reason"] = curve.stop_reason
    describe_stage(
        dataset, fabric, STAGE, title=f"Equilibrium shear test of {fabric.name}",
        summary="Shear in the plane of the fabric under tension along the wale; the force is that"
        " along the course.",
        references=("munden",),
    )  # fmt: skip
    return dataset, timings

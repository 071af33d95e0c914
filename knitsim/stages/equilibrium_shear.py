"""The shear test in the equilibrium model."""

from knitsim.equilibrium.dataset import pull_dataset
from knitsim.equilibrium.pull import shear
from knitsim.equilibrium.relax import relax
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import both_ways, resolution_for, settings_of, solver_fabric
from knitsim.store.timing import Timings

STAGE = "equilibrium_shear"


def run(fabric, laws):
    """(dataset, timings) of a FabricInput; laws: TensionLaw of its yarn by form."""
    timings, settings = Timings(STAGE, fabric.name), settings_of(fabric)
    test = fabric.scene[STAGE]
    built = solver_fabric(fabric, laws["continuous"], friction=test["friction"])
    relaxed = relax(built, resolution_for(fabric, settings, STAGE))
    with timings.measure("shear, with its error estimate"):
        curve = shear(
            relaxed, both_ways(test["max_angle"], test["states"]), tension=test["tension"],
            increment=settings.increment, estimate_error=True,
        )  # fmt: skip
    dataset = pull_dataset(curve, relaxed, along="shear_angle")
    dataset["diameter"] = fabric.yarn["diameter"]
    dataset.attrs["stop_reason"] = curve.stop_reason
    describe_stage(
        dataset, fabric, STAGE, title=f"Equilibrium shear test of {fabric.name}",
        summary="Shear in the plane of the fabric under tension along the wale; the force is that"
        " along the course.",
        references=("munden",), settings=settings,
    )  # fmt: skip
    return dataset, timings

"""The shear test in the equilibrium model."""

from knitsim.equilibrium.dataset import pull_dataset
from knitsim.equilibrium.pull import shear
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import at_rest, both_ways, settings_of
from knitsim.stages.memory import history_json
from knitsim.store.timing import Timings

STAGE = "equilibrium_shear"


def run(fabric, laws):
    """(dataset, timings) of a FabricInput; laws: TensionLaw of its yarn by form."""
    timings, settings = Timings(STAGE, fabric.name), settings_of(fabric)
    test = fabric.scene[STAGE]
    relaxed = at_rest(fabric, laws["continuous"], settings.resolution, friction=test["friction"])
    with timings.measure("shear, with its error estimate"):
        curve = shear(
            relaxed, both_ways(test["max_angle"], test["states"]), tension=test["tension"],
            **settings.errors,
        )  # fmt: skip
    dataset = pull_dataset(curve, along="shear_angle")
    dataset["diameter"] = fabric.yarn["diameter"]
    dataset.attrs["fabric_history"] = history_json(fabric)
    dataset.attrs["stop_reason"] = curve.stop_reason
    if curve.start.stable is False:
        dataset.attrs["not_stable"] = (
            "without friction the fabric would leave its flat, unsheared state at rest by itself"
        )
    describe_stage(
        dataset, fabric, STAGE, title=f"Equilibrium shear test of {fabric.name}",
        summary="Shear in the plane of the fabric under tension along the wale; the force is that"
        " along the course.",
        references=("munden",), settings=settings.told({"shear": curve}),
    )  # fmt: skip
    return dataset, timings

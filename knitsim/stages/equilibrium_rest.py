"""The fabric at rest in the equilibrium model, beside the stated density, Peirce and Munden."""

from functools import partial

import numpy as np

from knitsim.equilibrium.accuracy import rest_to
from knitsim.equilibrium.density import fit_density
from knitsim.equilibrium.programme import rest_line
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import (
    at_rest_again,
    compressed,
    named_by_key,
    settings_of,
    solver_fabric,
)
from knitsim.stages.ledger import effect_dataset
from knitsim.store.schema import ENERGY_TERMS
from knitsim.store.tensile import loop_coordinates
from knitsim.store.timing import Timings
from knitsim.store.writer import to_json
from knitsim.study.schema import closure

STAGE = "equilibrium_rest"
LOOP_LENGTHS = 9


def headlines(fabric, resolution):
    """{name: (value, units)} of the relaxed state that the ledger follows."""
    relaxed = at_rest_again(fabric, resolution)
    return {
        "relaxed wale spacing": (relaxed.wale_spacing, "m"),
        "relaxed course spacing": (relaxed.course_spacing, "m"),
    }


def _over_loop_length(fabric, law, resolution):
    """Relaxed spacings over loop length and set: (sets, loop lengths, spacings (set, length, 2), reasons)."""
    test = fabric.scene[STAGE]
    low, high = test["loop_length_low"], test["loop_length_high"]
    factors = np.linspace(low, high, LOOP_LENGTHS if high > low else 1)
    # Set is of the loop held at the stated density.
    stated = fabric["wale_spacing"] is not None
    sets = [fraction for fraction in test["set_compared"] if stated or not fraction]
    spacings = np.full((len(sets), factors.size, 2), np.nan)
    reasons = []
    for i, fraction in enumerate(sets):
        for j, factor in enumerate(factors):
            length = factor * fabric["loop_length"]
            try:
                built = solver_fabric(fabric, law, set_fraction=fraction, loop_length=length)
                relaxed = relax(built, resolution)
            except (InputError, ComputationError) as error:
                reasons.append(f"set {fraction:g}, loop length {1e3 * length:.4g} mm: {error}")
                continue
            spacings[i, j] = relaxed.wale_spacing, relaxed.course_spacing
    return sets, factors * fabric["loop_length"], spacings, reasons


def mass_per_area(fabric, relaxed):
    """Mass per area (kg/m2) of a FabricInput at rest: count times loop length over the area of a loop."""
    mass = fabric.yarn["linear_density"] * fabric["loop_length"]
    return mass / (relaxed.wale_spacing * relaxed.course_spacing)


def rest_dataset(fabric, relaxed, error):
    """Dataset of a FabricInput at rest; error: estimated relative error of its spacings.

    A density that nobody stated is not a number.
    """
    import xarray as xr  # late: it takes long to load, and a curve on the screen needs none

    lines = relaxed.centrelines
    wale, course = np.array(fabric.stated_spacings, dtype=float)
    cell, said = relaxed.model.cell, {}
    if relaxed.jammed:
        said["jammed"] = (
            "the loop is too short for so thick a yarn: at rest more energy goes into squeezing and"
            f" stretching it than into bending, to {100.0 * relaxed.min_distance:.0f} % of its diameter"
        )
    return xr.Dataset(
        {
            "centreline": (("loop", "point", "axis"), lines),
            "wale_spacing": relaxed.wale_spacing,
            "course_spacing": relaxed.course_spacing,
            "stated_wale_spacing": wale,
            "stated_course_spacing": course,
            "loop_length": fabric["loop_length"],
            "diameter": fabric.yarn["diameter"],
            "kc": fabric["loop_length"] / relaxed.course_spacing,
            "kw": fabric["loop_length"] / relaxed.wale_spacing,
            "thickness": np.ptp(lines[..., 2]) + fabric.yarn["diameter"],
            "areal_mass": mass_per_area(fabric, relaxed),
            "energy": ("term", relaxed.energy),
            "residual": relaxed.residual,
            "min_distance": relaxed.min_distance,
            "crossings_intact": np.int8(relaxed.crossings_intact),
            "iterations": relaxed.iterations,
            "spacing_error": error,
        },
        {
            **loop_coordinates(lines.shape[1], cell.wales, cell.courses),
            "term": list(ENERGY_TERMS),
        },
        said,
    )


def run(fabric, laws):
    """(dataset, timings) of a FabricInput; laws: TensionLaw of its yarn by form."""
    import xarray as xr  # late: it takes long to load, and a curve on the screen needs none

    timings = Timings(STAGE, fabric.name)
    law, test = laws["continuous"], fabric.scene[STAGE]
    settings = settings_of(fabric)
    resolution = settings.resolution
    with named_by_key(fabric, law):
        built = solver_fabric(fabric, law)
        relaxed = timings.repeat("relaxing", lambda: relax(built, resolution))
    with timings.measure("its error"):
        passed = relaxed.passed
        relaxed, error = rest_to(relaxed, settings.accuracy)
    with timings.measure("relaxed density over loop length and set"):
        sets, lengths, spacings, reasons = _over_loop_length(fabric, law, resolution)
    compared = xr.Dataset(
        {
            "compared_loop_length": ("compared", lengths),
            "compared_spacing": (("set", "compared", "spacing"), spacings),
        },
        {
            "set": sets,
            "compared": np.arange(lengths.size),
            "spacing": ["wale", "course"],
        },
    )
    dataset = rest_dataset(fabric, relaxed, error).merge(compared)
    if test["rest_line"] and fabric.yarn["friction"] > 0.0:
        with timings.measure("spacings in which friction lets it rest"):
            rubbed = relax(solver_fabric(fabric, law, friction=True), relaxed.model.resolution)
            line = rest_line(rubbed)
        dataset["rest_line_spacing"] = (("rest_state", "spacing"), line)
        dataset = dataset.assign_coords(rest_state=np.arange(len(line)))
    if test["fit_density"]:
        with timings.measure("loop length and set fitted to the stated density"):
            fit = fit_density(built, resolution)
        dataset["fitted_loop_length"] = fit.loop_length
        dataset["fitted_set"] = fit.set_fraction
        dataset["fitted_misfit"] = ("spacing", fit.misfit)
    with timings.measure("effect of the assumptions"):
        followed = partial(headlines, resolution=relaxed.model.resolution)
        dataset = dataset.merge(effect_dataset(fabric, closure(STAGE), followed))
    dataset.attrs["passed_rest_states"] = to_json(passed)
    dataset.attrs["not_reached"] = "; ".join(reasons)
    if (test := compressed(fabric.yarn)) is not None:
        dataset.attrs["measured_tests"] = to_json({"compression_curve": test.record()})
    describe_stage(
        dataset, fabric, STAGE, title=f"Fabric {fabric.name} at rest in the equilibrium model",
        summary="One interlooped yarn in a periodic lattice, both spacings free, no load.",
        references=("peirce", "munden"), settings=settings.told({"rest": relaxed}),
    )  # fmt: skip
    return dataset, timings

"""What one per cent of each input does to a fabric's tests, and how well it must be measured."""

import numpy as np
import xarray as xr

from knitsim.inference.continuation import value_of
from knitsim.inference.sensitivity import sensitivity_table, standard_results
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.store.reader import opened
from knitsim.store.timing import Timings, write_csv
from knitsim.study.measured_checks import meaningless
from knitsim.study.measured_keys import PARAMETERS

STAGE = "sensitivity"
COLUMNS = (
    "fabric", "input", "input_value", "input_units", "name", "value", "units", "per_cent_per_cent",
    "noise", "needed_percent", "says",
)  # fmt: skip
WANTED = 10.0  # per cent of a result for which the table says how well an input must be known
VIOLENT = 5.0  # per cent per per cent
_RESULT_UNITS = {"spacing": "m", "strain": "1", "B": "N m", "2HB": "N"}


def run(fabric, laws):
    """(dataset, timings) of a FabricInput; laws: TensionLaw of its yarn by form."""
    timings = Timings(STAGE, fabric.name)
    test = fabric.scene[STAGE]
    built = solver_fabric(fabric, laws["continuous"], friction=test["friction"])
    names = [name for name in test["inputs"] if not meaningless(fabric.yarn, name)]
    if not test["friction"]:
        names = [name for name in names if name != "friction"]
    force = test["force"]
    settings = settings_of(fabric)
    with timings.measure(f"{len(names)} inputs, four changes each"):
        rows = sensitivity_table(
            built, names, standard_results(force, force), step=test["change"],
            resolution=settings.resolution,
        )  # fmt: skip
    units = np.array([PARAMETERS[name].si for name in names], dtype=object)
    results = list(dict.fromkeys(row.result for row in rows))
    shape = (len(names), len(results))

    def table(field):
        return (("input", "result"), np.array([getattr(row, field) for row in rows]).reshape(shape))

    notes = np.array([row.note for row in rows], dtype=object).reshape(shape)
    dataset = xr.Dataset(
        {
            "input_value": ("input", [value_of(built, name) for name in names]),
            "result_value": ("result", [row.value for row in rows[: len(results)]]),
            "per_cent_per_cent": table("per_cent"),
            "per_cent_noise": table("noise"),
        },
        {
            "input": np.array(names, dtype=object),
            "parameter_units": ("input", units),
            "result": np.array(results, dtype=object),
            "result_units": (
                "result",
                np.array([_RESULT_UNITS[r.rpartition("_")[2]] for r in results], dtype=object),
            ),
            "refused": (("input", "result"), notes),
        },
    )
    dataset.attrs["force_per_width"] = force
    describe_stage(
        dataset, fabric, STAGE, title=f"Sensitivity of fabric {fabric.name} to its inputs",
        summary="Change of strain at a given force, B, 2HB and density at rest for one per cent of each"
        " input, by two-sided differences in the equilibrium model.",
        references=("munden", "kawabata"), settings=settings.fixed,
    )  # fmt: skip
    return dataset, timings


def says(change, noise, value):
    """What a change (per cent per per cent) by an input of this value asks of whoever measures it.

    An input that is zero is changed by 0.01 instead of 1 %.
    """
    if not np.isfinite(change):
        return "no result with the input changed"
    if abs(change) <= 2.0 * noise:
        return "no effect that can be told from noise"
    needed = WANTED / abs(change)
    if needed > 100.0:
        return "little effect"
    text = f"for {WANTED:g} % measure it to "
    text += f"{needed:.2g} %" if value else f"{0.01 * needed:.2g}"
    return f"violent: {text}" if abs(change) >= VIOLENT else text


def write_table(files, path):
    """Write ``tables/sensitivity.csv`` from the result files; the most violent input comes first."""
    rows = []
    for dataset in opened(files):
        fabric = dataset.attrs["fabric"]
        change = dataset.per_cent_per_cent.values
        worst = np.nanmax(np.where(np.isfinite(change), np.abs(change), 0.0), axis=1)
        for i in np.argsort(-worst, kind="stable"):
            one = dataset.isel(input=int(i))
            for k, result in enumerate(dataset.result.values):
                value, noise = float(one.per_cent_per_cent[k]), float(one.per_cent_noise[k])
                known = np.isfinite(value) and value
                text = says(value, noise, float(one.input_value))
                if not np.isfinite(value) and str(one.refused.values[k]):
                    text += f": {one.refused.values[k]}"
                rows.append((
                    fabric, str(one.input.values), f"{float(one.input_value):.6g}",
                    str(one.parameter_units.values), str(result),
                    f"{float(one.result_value[k]):.6g}", str(one.result_units.values[k]),
                    f"{value:.4g}" if np.isfinite(value) else "", f"{noise:.2g}",
                    f"{WANTED / abs(value):.3g}" if known else "", text,
                ))  # fmt: skip
    write_csv(path, COLUMNS, rows)

"""KES parameters of every test in the store that has them."""

import json
import math
from pathlib import Path

import numpy as np
import xarray as xr

from knitsim.errors import InputError
from knitsim.evaluation import kes
from knitsim.store.timing import write_csv

COLUMNS = (
    "fabric", "test", "model", "direction", "variant", "name", "value", "units", "kes_value",
    "kes_units", "error", "definition", "left_out",
)  # fmt: skip
# Maximum forces at which the tensile parameters are read: for knits, and the standard one.
MAX_FORCES = {"50 gf/cm": kes.KNIT_FORCE, "500 gf/cm": kes.STANDARD_FORCE}


def _tension(one):
    for label, force in MAX_FORCES.items():
        yield label, kes.tension(
            one["strain"].values, one["force_per_width"].values, phase=one["phase"].values,
            cycle=one["cycle"].values, max_force=force,
        )  # fmt: skip


def _bending(one):
    yield "", kes.bending(one["curvature"].values, one["moment_per_width"].values)


def _shear(one):
    yield "", kes.shear(one["shear_angle"].values, one["force_per_width"].values)


_TESTS = {"tensile": _tension, "bending": _bending, "shear": _shear}


def _variants(dataset):
    """(name, dataset) of each variant without the states that hold no numbers."""
    along = next(name for name in ("strain", "curvature", "shear_angle") if name in dataset.coords)
    names = dataset["variant"].values if "variant" in dataset.dims else [None]
    for name in names:
        one = dataset if name is None else dataset.sel(variant=name)
        force = one["moment_per_width" if along == "curvature" else "force_per_width"].values
        held = np.isfinite(one[along].values) & np.isfinite(force)
        yield "" if name is None else str(name), one.isel(step=np.flatnonzero(held))


def kes_table(files, path):
    """Write ``tables/kes.csv`` from the result files; what cannot be had stands with its reason."""
    rows = []
    for file in map(Path, files):
        test = next((part for part in file.parts[::-1] if part in _TESTS), None)
        if test is None:
            continue
        model, _, direction = file.stem.partition("_")
        with xr.open_dataset(file, engine="netcdf4") as opened:
            dataset = opened.load()
        fabric = json.loads(dataset.attrs["configuration"])["name"]
        for variant, one in _variants(dataset):
            known = (fabric, test, model, direction, variant)
            if not one.sizes["step"]:
                continue
            try:
                for label, evaluation in _TESTS[test](one):
                    for row in evaluation.rows():
                        name = f"{row['parameter']} {label}".strip()
                        rows.append((*known, name, *_cells(row)))
            except InputError as error:
                rows.append((*known, "all", "", "", "", "", "", "", str(error)))
    write_csv(path, COLUMNS, rows)


def _cells(row):
    names = ("value", "units", "kes_value", "kes_units", "error", "definition", "left_out")
    for name in names:
        cell = row[name]
        if isinstance(cell, float):
            yield "" if math.isnan(cell) else f"{cell:.8g}"
        else:
            yield cell

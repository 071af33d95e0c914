"""KES parameters of every test of one fabric, read from its result files."""

import json
import math
from pathlib import Path

import numpy as np
import xarray as xr

from knitsim import kes
from knitsim.errors import InputError
from knitsim.store.writer import describe

STAGE = "kes"
# Maximum forces at which the tensile parameters are read: for knits, and the standard one.
MAX_FORCES = {"50 gf/cm": kes.KNIT_FORCE, "500 gf/cm": kes.STANDARD_FORCE}
LABELS = ("test", "model", "direction", "variant")
TEXTS = ("kes_parameter", "value_units", "kes_units", "definition", "left_out")
NUMBERS = ("parameter_value", "kes_value", "parameter_error")


def tension_of(one):
    """[(maximum force in words, Evaluation)] of one variant of a tensile test."""
    return [
        (
            label,
            kes.tension(
                one["strain"].values, one["force_per_width"].values, phase=one["phase"].values,
                cycle=one["cycle"].values, max_force=force,
            ),
        )
        for label, force in MAX_FORCES.items()
    ]  # fmt: skip


def bending_of(one):
    """[("", Evaluation)] of the first cycle of one variant of a bending test."""
    values = (one[name].values for name in ("curvature", "moment_per_width"))
    return [("", kes.bending(*values, cycle=one["cycle"].values))]


def shear_of(one):
    """[("", Evaluation)] of a shear test."""
    return [("", kes.shear(one["shear_angle"].values, one["force_per_width"].values))]


TESTS = {"tensile": tension_of, "bending": bending_of, "shear": shear_of}


def test_of(path):
    """(kind of test, model, direction) of a result file, or None for any other file."""
    kind = next((part for part in Path(path).parts[::-1] if part in TESTS), None)
    model, _, direction = Path(path).stem.partition("_")
    return kind and (kind, model, direction)


def variants_of(dataset):
    """[(name, dataset)] of each variant without the states that hold no numbers."""
    along = next(name for name in ("strain", "curvature", "shear_angle") if name in dataset.coords)
    force = "moment_per_width" if along == "curvature" else "force_per_width"
    names = dataset["variant"].values if "variant" in dataset.dims else [None]
    found = []
    for name in names:
        one = dataset if name is None else dataset.sel(variant=name)
        held = np.isfinite(one[along].values) & np.isfinite(one[force].values)
        found.append(("" if name is None else str(name), one.isel(step=np.flatnonzero(held))))
    return found


def rows_of(path):
    """Rows {column: value} of one result file; what cannot be had stands with its reason."""
    known = test_of(path)
    if known is None:
        return []
    with xr.open_dataset(path, engine="netcdf4") as opened:
        dataset = opened.load()
    rows = []
    for variant, one in variants_of(dataset):
        labels = dict(zip(LABELS, (*known, variant), strict=True))
        if not one.sizes["step"]:
            continue
        try:
            for label, evaluation in TESTS[known[0]](one):
                rows += [labels | _cells(row, label) for row in evaluation.rows()]
        except InputError as error:
            empty = dict.fromkeys(TEXTS, "") | dict.fromkeys(NUMBERS, math.nan)
            rows.append(labels | empty | {"kes_parameter": "all", "left_out": str(error)})
    return rows


def _cells(row, label):
    return {
        "kes_parameter": f"{row['parameter']} {label}".strip(),
        "value_units": row["units"],
        "kes_units": row["kes_units"],
        "definition": row["definition"],
        "left_out": row["left_out"],
        "parameter_value": row["value"],
        "kes_value": row["kes_value"],
        "parameter_error": row["error"],
    }


def run(name, files):
    """Dataset of the KES parameters of the fabric ``name``, one a row; files: its result files."""
    rows, tests, assumed = [], {}, {}
    for path in map(Path, files):
        rows += rows_of(path)
        with xr.open_dataset(path, engine="netcdf4") as dataset:
            configuration = json.loads(dataset.attrs["configuration"])
            configuration.pop("assumed", None)  # stands in the attribute assumptions
            tests["_".join(filter(None, test_of(path)))] = configuration
            for row in json.loads(dataset.attrs["assumptions"]):
                assumed[json.dumps(row, sort_keys=True)] = row
    dataset = xr.Dataset(
        {
            column: ("row", np.array([row[column] for row in rows], dtype=float))
            for column in NUMBERS
        },
        {"row": np.arange(len(rows))}
        | {
            column: ("row", np.array([row[column] for row in rows], dtype=object))
            for column in (*LABELS, *TEXTS)
        },
    )
    return describe(
        dataset, title=f"KES parameters of fabric {name}",
        summary="Kawabata's parameters as read from each test of the fabric.", references=("kawabata",),
        configuration={"name": name, "tests": tests}, assumptions=list(assumed.values()),
        modules=["knitsim.stages.kes"],
    )  # fmt: skip

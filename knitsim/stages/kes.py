"""KES parameters of every test of one fabric, read from its result files."""

import json
import math

import numpy as np
import xarray as xr

from knitsim import kes
from knitsim.errors import InputError
from knitsim.store.reader import attributes, opened
from knitsim.store.results import labels_of
from knitsim.store.writer import describe

STAGE = "kes"
# Maximum forces at which the tensile parameters are read: for knits, and the standard one.
MAX_FORCES = {"50 gf/cm": kes.KNIT_FORCE, "500 gf/cm": kes.STANDARD_FORCE}
# Columns that say of what test a row is, and the attributes that say it of a file.
LABELS, LABELED = ("test", "model", "direction", "variant"), ("kind", "model", "direction")
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


def rows_of(dataset):
    """Rows {column: value} of one test; what cannot be had stands with its reason."""
    about, rows = [dataset.attrs[name] for name in LABELED], []
    for variant, one in variants_of(dataset):
        labels = dict(zip(LABELS, (*about, variant), strict=True))
        if not one.sizes["step"]:
            continue
        try:
            for label, evaluation in TESTS[about[0]](one):
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


def run(files):
    """Dataset of the KES parameters of a fabric, one a row; files: the results of its tests."""
    rows, tests, assumed, first = [], {}, {}, attributes(next(iter(files)))
    about = {name: first[name] for name in ("fabric", "yarn", "pattern")}
    for test in opened(files):
        rows += rows_of(test)
        configuration = json.loads(test.attrs["configuration"])
        configuration.pop("assumed", None)  # stands in the attribute assumptions
        tests["_".join(filter(None, (test.attrs[n] for n in LABELED)))] = configuration
        for row in json.loads(test.attrs["assumptions"]):
            assumed[json.dumps(row, sort_keys=True)] = row
    columns = {
        column: ("row", np.array([row[column] for row in rows], dtype=kind))
        for names, kind in ((NUMBERS, float), ((*LABELS, *TEXTS), object))
        for column in names
    }
    dataset = xr.Dataset(
        {column: columns.pop(column) for column in NUMBERS},
        {"row": np.arange(len(rows)), **columns},
    )
    return describe(
        dataset, STAGE, labels_of(STAGE, **about), title=f"KES parameters of fabric {about['fabric']}",
        summary="Kawabata's parameters as read from each test of the fabric.", references=("kawabata",),
        configuration={"name": about["fabric"], "tests": tests}, assumptions=list(assumed.values()),
    )  # fmt: skip

"""The tables of the KES parameters and of the curl, over all fabrics of the study."""

import json
import math
from pathlib import Path

import numpy as np
import xarray as xr

from knitsim.errors import InputError
from knitsim.stages import kes
from knitsim.store.timing import write_csv
from knitsim.units import from_si

COLUMNS = (
    "fabric", "test", "model", "direction", "variant", "name", "value", "units", "kes_value",
    "kes_units", "error", "definition", "left_out",
)  # fmt: skip
CURL_COLUMNS = (
    "fabric", "model", "direction", "variant", "edges", "moment_at_zero_curvature_N",
    "moment_at_zero_curvature_gf_cm_per_cm", "moment_error_N", "rolls_to", "known_to_roll_to",
    "curvature_at_zero_moment_per_cm", "curvature_error_per_cm", "why_not",
)  # fmt: skip
# Direction that becomes curved: the edges that roll up then, and where plain jersey is known to roll.
EDGES = {"course": ("sides", "back"), "wale": ("top and bottom", "face")}


def _fabric_of(dataset):
    return json.loads(dataset.attrs["configuration"])["name"]


def _shown(value):
    return "" if math.isnan(value) else f"{value:.8g}"


def kes_table(files, path):
    """Write ``tables/kes.csv`` from the files of KES parameters, one a fabric."""
    rows = []
    for file in map(Path, files):
        with xr.open_dataset(file, engine="netcdf4") as opened:
            dataset = opened.load()
        columns = (*kes.LABELS, *kes.TEXTS, *kes.NUMBERS)
        for values in zip(*(dataset[column].values for column in columns), strict=True):
            row = dict(zip(columns, values, strict=True))
            rows.append((
                _fabric_of(dataset), *(row[label] for label in kes.LABELS), row["kes_parameter"],
                _shown(row["parameter_value"]), row["value_units"], _shown(row["kes_value"]),
                row["kes_units"], _shown(row["parameter_error"]), row["definition"], row["left_out"],
            ))  # fmt: skip
    write_csv(path, COLUMNS, rows)


def rolls_to(moment, error):
    """Side to which a fabric rolls that this moment per width (N) holds flat, within its error.

    A positive moment makes the face convex.  Let go, the fabric bends against it: where it takes a
    positive moment to hold the fabric flat, the face becomes hollow, and the edges roll to it.
    """
    if abs(moment) <= error:
        return "neither"
    return "face" if moment > 0.0 else "back"


def numerical_error(one):
    """Estimated error (N) of the moment of one variant, (steps,); zero where the file has none."""
    moment = np.abs(one["moment_per_width"].values)
    if "numerical_error" not in one:
        return np.zeros_like(moment)
    return one["numerical_error"].values * np.fmax(moment, 0.01 * moment.max())


def curl_of(one):
    """Cells of the curl table, from the moment on, of one variant of a bending test."""
    [(_, found)] = kes.bending_of(one)
    error, curvature = numerical_error(one), one["curvature"].values
    if "M0" not in found:
        return {"why_not": found.left_out["M0"]}
    moment = found["M0"]
    flat = int(np.argmin(np.abs(curvature)))
    uncertain = error[flat] + _between_states(moment, curvature)
    cells = {
        "moment_at_zero_curvature_N": _shown(moment.value),
        "moment_at_zero_curvature_gf_cm_per_cm": _shown(moment.kes_value),
        "moment_error_N": _shown(uncertain),
        "rolls_to": rolls_to(moment.value, uncertain),
    }
    if "K0" in found:
        at = found["K0"]
        near = int(np.argmin(np.abs(curvature - at.value)))
        slope = abs(found["B"].value) if "B" in found else 0.0
        uncertain = error[near] / slope + np.nan_to_num(at.error) if slope else math.nan
        return cells | {
            "curvature_at_zero_moment_per_cm": _shown(from_si(at.value, "per_cm")),
            "curvature_error_per_cm": _shown(from_si(uncertain, "per_cm")),
        }
    return cells | _not_reached(one, found.left_out["K0"])


def _between_states(parameter, curvature):
    """Error of reading at zero curvature; none where a state is flat."""
    return 0.0 if (curvature == 0.0).any() else np.nan_to_num(parameter.error)


def _not_reached(one, reason):
    """Cells for a curve that does not come to zero moment, with the bound where there is one."""
    moment, curvature = one["moment_per_width"].values, one["curvature"].values
    if moment.min() <= 0.0 <= moment.max():
        return {"curvature_at_zero_moment_per_cm": "not reached", "why_not": reason}
    # The moment rises with the curvature: what is above zero everywhere is zero further down.
    above = moment.max() < 0.0
    bound = from_si(curvature.max() if above else curvature.min(), "per_cm")
    lies = f"not reached: {'above' if above else 'below'} {bound:.6g}"
    least, most = moment.min(), moment.max()
    why = f"moment from {least:.6g} to {most:.6g} N over the whole test, not extrapolated"
    return {"curvature_at_zero_moment_per_cm": lies, "why_not": why}


def curl_table(files, path):
    """Write ``tables/curl.csv`` from the result files of bending tests (others are passed over)."""
    rows = []
    for file in map(Path, files):
        known = kes.test_of(file)
        if known is None or known[0] != "bending":
            continue
        with xr.open_dataset(file, engine="netcdf4") as opened:
            dataset = opened.load()
        _, model, direction = known
        edges, side = EDGES[direction]
        for variant, one in kes.variants_of(dataset):
            if not one.sizes["step"]:
                continue
            labels = {
                "fabric": _fabric_of(dataset), "model": model, "direction": direction,
                "variant": variant, "edges": edges, "known_to_roll_to": side,
            }  # fmt: skip
            try:
                cells = curl_of(one)
            except InputError as error:
                cells = {"why_not": str(error)}
            rows.append(dict.fromkeys(CURL_COLUMNS, "") | labels | cells)
    write_csv(path, CURL_COLUMNS, rows)

"""The tables of the KES parameters and of the curl, over all fabrics of the study."""

import math

from knitsim.errors import InputError
from knitsim.kes.curl import EDGES, Curl, curl, rest_text
from knitsim.stages import kes
from knitsim.store.reader import opened
from knitsim.store.tensile import absolute_error
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


def _shown(value):
    return "" if math.isnan(value) else f"{value:.8g}"


def kes_table(files, path):
    """Write ``tables/kes.csv`` from the files of KES parameters, one a fabric."""
    rows = []
    for dataset in opened(files):
        columns = (*kes.LABELS, *kes.TEXTS, *kes.NUMBERS)
        for values in zip(*(dataset[column].values for column in columns), strict=True):
            row = dict(zip(columns, values, strict=True))
            rows.append((
                dataset.attrs["fabric"], *(row[label] for label in kes.LABELS), row["kes_parameter"],
                _shown(row["parameter_value"]), row["value_units"], _shown(row["kes_value"]),
                row["kes_units"], _shown(row["parameter_error"]), row["definition"], row["left_out"],
            ))  # fmt: skip
    write_csv(path, COLUMNS, rows)


def _curl_of(one):
    """The Curl of one variant of a bending test; the kinematic model has no numerical error."""
    moment = one["moment_per_width"].values
    error = absolute_error(
        moment, one["numerical_error"].values if "numerical_error" in one else 0.0
    )
    try:
        return curl(one["curvature"].values, moment, error, one["cycle"].values)
    except InputError as refused:
        return Curl(why_not=str(refused))


def curl_table(files, path):
    """Write ``tables/curl.csv`` from the result files of bending tests (others are passed over)."""
    rows = []
    for dataset in opened(files, kind="bending"):
        about = [dataset.attrs[label] for label in ("fabric", "model", "direction")]
        edges, known = EDGES[about[-1]]
        known = known if dataset.attrs["pattern"] == "jersey" else ""
        for variant, one in kes.variants_of(dataset):
            if not one.sizes["step"]:
                continue
            found = _curl_of(one)
            rows.append((
                *about, variant, edges, *map(_shown, (found.moment, found.kes_moment)),
                _shown(found.moment_error), found.rolls_to, known, rest_text(found),
                _shown(from_si(found.curvature_error, "per_cm")), found.why_not,
            ))  # fmt: skip
    write_csv(path, CURL_COLUMNS, rows)

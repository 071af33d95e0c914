"""Every load-extension curve of a study in one table, for a spreadsheet."""

import numpy as np

from knitsim.stages.kes import variants_of
from knitsim.store.reader import opened
from knitsim.store.timing import write_csv
from knitsim.units import from_si

COLUMNS = (
    "fabric", "model", "direction", "condition", "phase", "cycle", "strain_percent",
    "force_gf_per_cm", "force_N_per_m", "transverse_strain_percent", "numerical_error_percent",
)  # fmt: skip


def curve_table(files, path):
    """Write the states of all tensile tests among the result files, in the order of the test."""
    rows = []
    for dataset in opened(files, kind="tensile"):
        about = [dataset.attrs[label] for label in ("fabric", "model", "direction")]
        for variant, one in variants_of(dataset):
            force = one["force_per_width"].values
            numbers = (
                100.0 * one["strain"].values, from_si(force, "gf_per_cm"), force,
                100.0 * one["transverse_strain"].values,
                100.0 * one["numerical_error"].values
                if "numerical_error" in one else np.full(force.size, np.nan),
            )  # fmt: skip
            for phase, cycle, *values in zip(
                one["phase"].values, one["cycle"].values, *numbers, strict=True
            ):
                cells = [f"{value:.6g}" if np.isfinite(value) else "" for value in values]
                rows.append((*about, variant, phase, int(cycle), *cells))
    write_csv(path, COLUMNS, rows)

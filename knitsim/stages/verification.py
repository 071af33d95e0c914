"""The solver against exact answers: the cases of verification as a dataset and a table."""

import numpy as np
import xarray as xr

from knitsim.store.results import labels_of
from knitsim.store.timing import Timings, write_csv
from knitsim.store.writer import describe
from knitsim.verification.case import CONTACT_LIMIT, ELEMENTS, LIMIT, check
from knitsim.verification.cases import cases

ACCURACY_COLUMNS = (
    "case", "name", "value", "exact", "error", "elements", "observed_order", "limit",
    "within_limit", "note",
)  # fmt: skip


def _over_elements(found, name):
    """Values of one attribute of the Checked, (comparison, elements), NaN where none was computed."""
    table = np.full((len(found), len(ELEMENTS)), np.nan)
    for row, one in zip(table, found, strict=True):
        row[[ELEMENTS.index(n) for n in one.case.elements]] = getattr(one, name)
    return table


def run(studied=None):
    """(dataset, table rows, timings) of the verification; studied: Cases, all where None."""
    timings = Timings("verification", "all")
    found = []
    for case in cases() if studied is None else studied:
        with timings.measure(case.name, note="all numbers of elements"):
            found += check(case)
    dims = ("comparison", "elements")
    dataset = xr.Dataset(
        {
            "computed_value": (dims, _over_elements(found, "value")),
            "exact_value": (dims, _over_elements(found, "exact")),
            "relative_error": (dims, _over_elements(found, "error")),
            "residual": (dims, _over_elements(found, "residual")),
            "iterations": (dims, _over_elements(found, "iterations")),
            "observed_order": ("comparison", [one.order for one in found]),
            "error_limit": ("comparison", [one.case.limit for one in found]),
            "error_floor": ("comparison", [one.floor for one in found]),
        },
        {
            "comparison": [f"{one.case.name}: {one.quantity}" for one in found],
            "case": ("comparison", [one.case.name for one in found]),
            "case_group": ("comparison", [one.case.group for one in found]),
            "compared_quantity": ("comparison", [one.quantity for one in found]),
            "elements": list(ELEMENTS),
        },
    )
    configuration = {
        "name": "verification",
        "elements": list(ELEMENTS),
        "limit": LIMIT,
        "contact_limit": CONTACT_LIMIT,
    }
    describe(
        dataset, "verification", labels_of("verification"),
        title="Verification of the equilibrium solver against exact answers",
        summary="Scenes of open yarns on the kernels of the fabric, each with more and more elements.",
        references=("bisshopp", "love", "romero"), configuration=configuration, assumptions=[],
    )  # fmt: skip
    return dataset, [_row(one) for one in found], timings


def _number(value):
    """Ten digits; round-off about 0 is 0."""
    return f"{round(float(value), 12):.10g}"


def _row(one):
    """Row of the table of a Checked: what it has come to with the most elements."""
    order = f"{one.order:.2f}" if np.isfinite(one.order) else ""
    error = one.error[-1]
    return (
        one.case.name, one.quantity, _number(one.value[-1]), _number(one.exact[-1]),
        f"{error:.2e}", one.case.elements[-1], order, f"{one.case.limit:g}",
        "yes" if error <= one.case.limit else "no",
        f"errors below about {one.floor:.0e}: {one.case.note}",
    )  # fmt: skip


def accuracy_table(rows, path):
    """Write the table rows of :func:`run` as CSV."""
    write_csv(path, ACCURACY_COLUMNS, rows)

"""Datasets of tensile and bending tests, one place for both models: names as in the schema."""

import numpy as np
import xarray as xr

from knitsim.store.schema import AXES, ENERGY_TERMS, PHASES


def stack_variants(datasets):
    """Datasets of one test, by the name of their variant, along the labelled dimension ``variant``."""
    return xr.concat(
        list(datasets.values()),
        dim=xr.DataArray(list(datasets), dims="variant", name="variant"),
        coords="different",
        compat="equals",
        join="exact",
    )


def test_dataset(along, values, recovery, variables, *, stretch_energy, cycle=None):
    """A dataset with the dimension ``step`` and the coordinates of a test.

    along: ``strain`` or ``curvature``; values, recovery, stretch_energy: shape (steps,); variables:
    arrays by schema name, (steps,), or (steps, points, 3) for the centre line.  Energy terms that
    the model does not have are zero.
    """
    steps = values.size
    energy = np.zeros((steps, len(ENERGY_TERMS)))
    energy[:, ENERGY_TERMS.index("stretch")] = stretch_energy
    data = {"energy": (("step", "term"), energy)}
    for name, array in variables.items():
        dims = ("step", "point", "axis")[: array.ndim]
        data[name] = (dims, array)
    coords = {
        "step": np.arange(steps),
        "term": list(ENERGY_TERMS),
        along: ("step", values),
        "phase": ("step", np.array(PHASES)[recovery.astype(int)]),
        "cycle": ("step", np.ones(steps, dtype=np.int32) if cycle is None else cycle),
    }
    if "centreline" in variables:
        coords |= {"point": np.arange(variables["centreline"].shape[1]), "axis": list(AXES)}
    return xr.Dataset(data, coords)

"""What a test in the equilibrium model says, under the names of the result store."""

import numpy as np

from knitsim.store.schema import ENERGY_TERMS, PHASES, VARIABLES
from knitsim.store.tensile import loop_coordinates

_STATUS = VARIABLES["status"].flags
_NOT_REACHED = VARIABLES["crossings_intact"].flags.index("not_reached")


def _padding(reached, steps):
    """A function that fills an array (reached, ...) up to ``steps`` rows.

    It takes the array and what stands in the rows that were not reached, not a number by default.
    """

    def padded(values, fill=np.nan):
        values = np.asarray(values)
        out = np.full((steps, *values.shape[1:]), fill, dtype=np.result_type(values, type(fill)))
        out[:reached] = values
        return out

    return padded


def pull_dataset(curve, steps=None, along="strain"):
    """Dataset of a Curve; steps: rows, more than were reached where another curve stands beside it.

    along: the coordinate that the test goes through, ``strain`` or ``shear_angle``.  Rows that were not
    reached hold no numbers and the status not_converged.
    """
    own = {name: getattr(curve, name) for name in ("force_per_loop", "force_per_width")}
    if along == "strain":
        own["transverse_strain"] = curve.transverse_strain
    return _states(curve, own, curve.centrelines, {along: curve.strain}, steps)


def bend_dataset(curve, steps=None):
    """Dataset of a BendingCurve, as :func:`pull_dataset`; the centre lines lie on the cylinder."""
    own = {name: getattr(curve, name) for name in ("moment_per_width", "change_error")}
    lines = np.array([curve.centrelines_bent(k) for k in range(curve.steps)])
    return _states(curve, own, lines, {"curvature": curve.curvature}, steps)


def _states(curve, own, lines, along, steps):
    """own: arrays (states,) of this kind of test; lines: (states, loops, points, 3), m."""
    import xarray as xr  # late: it takes long to load, and a curve on the screen needs none

    steps = curve.steps if steps is None else steps
    padded = _padding(curve.steps, steps)
    for name in (
        "yarn_tension", "yarn_strain", "wale_spacing", "course_spacing", "work", "dissipated",
        "min_distance", "residual", "numerical_error", "iterations", "increments",
    ):  # fmt: skip
        own[name] = getattr(curve, name)
    broken = curve.yarn_strain > curve.model.fabric.law.breaking_strain
    flags = {
        "status": (
            np.where(broken, _STATUS.index("beyond_breaking_strain"), _STATUS.index("valid")),
            _STATUS.index("not_converged"),
        ),
        "crossings_intact": (curve.crossings_intact, _NOT_REACHED),
    }
    data = {name: ("step", padded(values)) for name, values in own.items()}
    for name, (values, missing) in flags.items():
        data[name] = ("step", padded(values.astype(np.int8), missing).astype(np.int8))
    data["energy"] = (("step", "term"), padded(curve.energy))
    data["centreline"] = (("step", "loop", "point", "axis"), padded(lines))
    coords = {
        "step": np.arange(steps),
        "term": list(ENERGY_TERMS),
        **loop_coordinates(lines.shape[2], curve.model.cell.wales, curve.model.cell.courses),
        **{name: ("step", padded(values)) for name, values in along.items()},
        "phase": ("step", np.array(PHASES)[padded(curve.phase, 0).astype(int)]),
        "cycle": ("step", padded(curve.cycle, 1)),
        "segment": ("step", padded(curve.segment, 0)),
    }
    return xr.Dataset(data, coords)

"""Datasets of tensile and bending tests, one place for both models: names as in the schema."""

import numpy as np
from scipy.interpolate import CubicSpline

from knitsim.store.schema import AXES, ENERGY_TERMS, PHASES

SMALLEST_OF_LARGEST = 0.01  # numerical_error is relative to no less than that of the largest value
LATER_SMALLEST = 0.1  # the same for what counts of it after the first turning point


def stack_variants(datasets):
    """Datasets of one test, by the name of their variant, along the labelled dimension ``variant``.

    Where they were solved with different numbers of points, all centre lines get those of the finest, by
    cubic splines.
    """
    import xarray as xr  # late: it takes long to load, and a curve on the screen needs none

    points = max((one.sizes.get("point", 0) for one in datasets.values()), default=0)
    return xr.concat(
        [_with_points(one, points) for one in datasets.values()],
        dim=xr.DataArray(list(datasets), dims="variant", name="variant"),
        coords="different",
        compat="equals",
        join="exact",
    )


def _with_points(dataset, points):
    own = dataset.sizes.get("point", 0)
    if own == points:
        return dataset
    lines = dataset["centreline"].values
    drawn = np.full((*lines.shape[:2], points, lines.shape[3]), np.nan)
    held = np.isfinite(lines).all(axis=(1, 2, 3))  # the rows that were reached
    if held.any():
        spline = CubicSpline(np.arange(own), lines[held], axis=2)
        drawn[held] = spline(np.linspace(0.0, own - 1.0, points))
    finer = dataset.drop_dims("point").assign_coords(point=np.arange(points))
    return finer.assign(centreline=(dataset["centreline"].dims, drawn))


def test_dataset(along, values, recovery, variables, *, stretch_energy):
    """A dataset with the dimension ``step`` and the coordinates of a test of one loop.

    along: ``strain`` or ``curvature``; values, recovery, stretch_energy: shape (steps,); variables:
    arrays by schema name, (steps,), or (steps, points, 3) for the centre line.  Energy terms that
    the model does not have are zero.
    """
    import xarray as xr  # late: it takes long to load, and a curve on the screen needs none

    steps = values.size
    energy = np.zeros((steps, len(ENERGY_TERMS)))
    energy[:, ENERGY_TERMS.index("stretch")] = stretch_energy
    data = {name: ("step", array) for name, array in variables.items() if array.ndim == 1}
    data["energy"] = (("step", "term"), energy)
    coords = {
        "step": np.arange(steps),
        "term": list(ENERGY_TERMS),
        along: ("step", values),
        "phase": ("step", np.array(PHASES)[recovery.astype(int)]),
        "cycle": ("step", np.ones(steps, dtype=np.int32)),
    }
    if "centreline" in variables:
        lines = variables["centreline"][:, None]
        data["centreline"] = (("step", "loop", "point", "axis"), lines)
        coords |= loop_coordinates(lines.shape[2])
    return xr.Dataset(data, coords)


def absolute_error(values, relative):
    """Error of forces or moments (steps,) from the ``relative`` one that the store keeps of them."""
    size = np.abs(values)
    return relative * np.fmax(size, SMALLEST_OF_LARGEST * np.nanmax(size, initial=0.0))


def loop_coordinates(points, wales=1, courses=1):
    """Coordinates of the loops of a cell, a course after the other, and of the ``points`` of each."""
    return {
        "loop": np.arange(wales * courses),
        "loop_wale": ("loop", np.tile(np.arange(wales), courses)),
        "loop_course": ("loop", np.repeat(np.arange(courses), wales)),
        "point": np.arange(points),
        "axis": list(AXES),
    }


def counted_scale(values, along, segment):
    """Over what (steps,) an error of forces or moments counts where an accuracy is asked for.

    On the first way over the value, 1 % of the largest at least.  On later ones forces fall steeply to
    zero, and what counts is how far the curve is off: along the force, over the force or 10 % of the
    largest, and along the strain, over the whole way, together as the distance of two curves in a picture
    of them.  values, along: forces over strains, or moments over curvatures; segment: number of the way.
    """
    values, along, segment = np.asarray(values), np.asarray(along), np.asarray(segment)
    size = np.abs(values)
    largest = np.nanmax(size, initial=0.0)
    scale = np.fmax(size, SMALLEST_OF_LARGEST * largest)
    for one in np.unique(segment[segment > 0]):
        mine = np.flatnonzero(segment == one)
        # A way begins at the end of the one before.
        way = np.concatenate([mine[:1] - 1, mine])
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.gradient(values[way], along[way])[1:]
        steep = np.nan_to_num(slope, posinf=0.0, neginf=0.0) * (np.nanmax(along) - np.nanmin(along))
        scale[mine] = np.hypot(np.fmax(size[mine], LATER_SMALLEST * largest), steep)
    return scale


def counted_error(values, along, segment, numerical_error):
    """What counts of numerical errors (steps,): over :func:`counted_scale`."""
    off = absolute_error(values, numerical_error)
    return off / np.fmax(counted_scale(values, along, segment), np.finfo(float).tiny)

"""ParaView files of the fabric states in result files: the reference reading, loading only."""

import json
from pathlib import Path

import numpy as np
import xarray as xr

from knitsim.loop.repeat import bent_courses, fabric_courses
from knitsim.store.vtk import write_series, write_yarns

LOOPS = 2  # loops each way in a file
MOST_POINTS = 50  # points a loop: files of about 50 kB


def _states(dataset, axis):
    """(number, polylines, field data, point data) of each state that has positions."""
    bent = "curvature" in dataset.coords
    reference = dataset.isel(variant=0)
    lines = reference["centreline"].values
    stride = max(1, (lines.shape[1] - 1) // MOST_POINTS)
    keep = np.unique(np.append(np.arange(0, lines.shape[1], stride), lines.shape[1] - 1))
    along, shown = "curvature" if bent else "strain", set()
    for k in range(reference.sizes["step"]):
        if not bent and reference["phase"].values[k] != "loading":
            continue
        spacings = float(reference["wale_spacing"][k]), float(reference["course_spacing"][k])
        value = float(reference[along][k])
        if bent and value in shown:
            continue  # on the way back, or in another cycle
        shown.add(value)
        if bent:
            courses = bent_courses(lines[k, keep], *spacings, LOOPS, LOOPS, value, axis)
        else:
            courses = fabric_courses(lines[k, keep], *spacings, LOOPS, LOOPS)
        if not np.isfinite(courses).all():
            continue
        fields = {along: value, "step": k, "variant": str(reference["variant"].values)}
        points = {
            "course": list(range(LOOPS)),
            "yarn_tension": [float(reference["yarn_tension"][k])] * LOOPS,
            "yarn_strain": [float(reference["yarn_strain"][k])] * LOOPS,
        }
        yield k, courses, fields, points


def run(files, directory):
    """Write one series a result file (``tensile`` or ``bending``) into ``directory``."""
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    for file in map(Path, files):
        with xr.open_dataset(file, engine="netcdf4") as opened:
            if "centreline" not in opened:
                continue
            dataset = opened.load()
        model, _, direction = file.stem.partition("_")
        name = f"{model}_{file.parent.parent.name}_{direction}"
        fabric = json.loads(dataset.attrs["configuration"])["name"]
        series = []
        axis = ("course", "wale").index(direction)
        for step, courses, fields, points in _states(dataset, axis):
            path = directory / f"{name}_{step:04d}.vtp"
            radius = 0.5 * float(dataset["diameter"])
            write_yarns(
                path, courses, radius, point_data=points, field_data={"fabric": fabric, **fields}
            )
            series.append((step, path))
        write_series(directory / f"{name}.pvd", series)

"""ParaView files of the fabric states in result files: the reference reading, loading only."""

from pathlib import Path

import numpy as np

from knitsim.figures.vtk import write_series, write_yarns
from knitsim.loop.repeat import bent_courses, fabric_courses
from knitsim.store.reader import opened
from knitsim.store.results import DIRECTIONS

KINDS = ("tensile", "bending")
LOOPS = 2  # loops each way in a file, more where the repeating cell has more
MOST_POINTS = 50  # points a loop: files of about 50 kB


def _states(dataset):
    """(number, polylines, field data, point data) of each state that has positions."""
    bent = "curvature" in dataset.coords
    axis = DIRECTIONS.index(dataset.attrs["direction"])
    reference = dataset.isel(variant=0).load()
    lines = reference["centreline"].values
    stride = max(1, (lines.shape[2] - 1) // MOST_POINTS)
    keep = np.unique(np.append(np.arange(0, lines.shape[2], stride), lines.shape[2] - 1))
    wales, courses = (int(reference[f"loop_{of}"].max()) + 1 for of in ("wale", "course"))
    wide, high = max(LOOPS, wales), max(LOOPS, courses)
    along, shown = "curvature" if bent else "strain", set()
    for k in range(reference.sizes["step"]):
        if not bent and reference["phase"].values[k] != "loading":
            continue
        spacings = float(reference["wale_spacing"][k]), float(reference["course_spacing"][k])
        value = float(reference[along][k])
        if bent and value in shown:
            continue  # on the way back, or in another cycle
        shown.add(value)
        given = lines[k][:, keep], *spacings, wide, high
        if bent:
            yarns = bent_courses(*given, value, axis, courses=courses)
        else:
            yarns = fabric_courses(*given, courses=courses)
        if not all(np.isfinite(yarn).all() for yarn in yarns):
            continue
        fields = {along: value, "step": k, "variant": str(reference["variant"].values)}
        points = {"course": list(range(high))}
        for name in ("yarn_tension", "yarn_strain"):
            points[name] = [float(reference[name][k])] * high
        yield k, yarns, fields, points


def run(files, directory):
    """Write one series a result file (``tensile`` or ``bending``) into ``directory``."""
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    for dataset in opened(files):
        if dataset.attrs["kind"] not in KINDS or "centreline" not in dataset:
            continue
        name = "_".join(dataset.attrs[label] for label in ("model", "kind", "direction"))
        radius, series = 0.5 * float(dataset["diameter"]), []
        for step, yarns, fields, points in _states(dataset):
            path = directory / f"{name}_{step:04d}.vtp"
            fields = {"fabric": dataset.attrs["fabric"], **fields}
            write_yarns(path, yarns, radius, point_data=points, field_data=fields)
            series.append((step, path))
        write_series(directory / f"{name}.pvd", series)

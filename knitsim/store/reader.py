"""Reading the result store: lazily as one labelled tree, or as one tidy table of scalars."""

from pathlib import Path

import netCDF4
import pandas as pd
import xarray as xr

from knitsim.errors import InputError
from knitsim.store.results import LABELS
from knitsim.store.table import read_table


def _files(root):
    """(path, labels) of every result file below ``root``, sorted; labels as its attributes say."""
    for path in sorted(root.glob("*/**/*.nc")):
        with netCDF4.Dataset(path) as file:
            held = set(file.ncattrs()) & set(LABELS)
            labels = {name: str(file.getncattr(name)) for name in LABELS if name in held}
        yield path, {name: value for name, value in labels.items() if value}


def open_store(
    root="results",
    *,
    kind=None,
    yarn=None,
    fabric=None,
    pattern=None,
    model=None,
    direction=None,
    calibration=None,
):
    """The store below ``root`` as an xarray.DataTree with one node a file; arrays are unpacked when used.

    Nodes are named as the files are: ``/tensile/<fabric>/kinematic_course``.  Every label given keeps
    the files whose attribute of that name has this value: kind (``yarn``, ``loop``, ``relaxed``,
    ``tensile``, ``bending``, ...), fabric, yarn, model (``kinematic``, ``equilibrium``), direction
    (``course``, ``wale``), pattern (``jersey``), calibration.

    Raises InputError if nothing fits, saying what there is.  Close the tree with ``tree.close()`` or
    use it as a context manager.
    """
    root = Path(root)
    if not root.is_dir():
        raise InputError(str(root), None, "no such directory; knitsim run DIR makes DIR/results")
    asked = (kind, yarn, fabric, pattern, model, direction, calibration)
    wanted = {n: value for n, value in zip(LABELS, asked, strict=True) if value is not None}
    found, seen = {}, {}
    for path, labels in _files(root):
        for name, value in labels.items():
            seen.setdefault(name, set()).add(value)
        if all(labels.get(name) == value for name, value in wanted.items()):
            found[str(path.relative_to(root).with_suffix(""))] = path
    if not found:
        asked = ", ".join(f"{name} = {value}" for name, value in wanted.items()) or "anything"
        there = "; ".join(
            f"{name}: {', '.join(sorted(seen[name]))}" for name in (wanted or seen) if name in seen
        )
        raise InputError(
            str(root), None, f"holds no result with {asked} ({there or 'it is empty'})"
        )
    datasets = {name: _in_memory(path) for name, path in found.items()}
    tree = xr.DataTree.from_dict(datasets)
    tree.set_close(lambda: [dataset.close() for dataset in datasets.values()] and None)
    return tree


def _in_memory(path):
    """The dataset of a result file, which is read as a whole and closed.

    A file that is open twice, and closed once, ends the next reading of its attributes in a crash of the
    netCDF library.
    """
    file = netCDF4.Dataset(path.name, memory=path.read_bytes())
    return xr.open_dataset(xr.backends.NetCDF4DataStore(file))


def opened(files, **labels):
    """The datasets of result files, each open until the next: those with these attributes.

    Those of tests that were stopped, which hold no numbers, are passed over: see :func:`stopped`.
    """
    for file in files:
        with xr.open_dataset(file, engine="netcdf4") as dataset:
            if "stopped" not in dataset.attrs and all(
                dataset.attrs[name] == value for name, value in labels.items()
            ):
                yield dataset


def attributes(path):
    """The global attributes of a result file."""
    with netCDF4.Dataset(path) as file:
        return {name: file.getncattr(name) for name in file.ncattrs()}


def stopped(files):
    """[(attributes, reason)] of those result files that hold a reason instead of numbers."""
    found = map(attributes, files)
    return [(about, about["stopped"]) for about in found if "stopped" in about]


def scalar_table(root="results"):
    """All scalar results of the store as one tidy pandas.DataFrame.

    Columns: the labels of results (kind, yarn, fabric, model, ...), variant, name, value, units,
    long_name.  A scalar is a variable without dimensions, or one with the dimension ``variant`` or
    ``quantity`` alone.  The tables that the workflow writes (run times, assumptions, KES, ...) follow
    with kind ``table/...`` where they have the columns ``name`` and ``value``.
    Raises InputError where there is no such directory.
    """
    root = Path(root)
    if not root.is_dir():
        raise InputError(str(root), None, "no such directory; knitsim run DIR makes DIR/results")
    rows = []
    for path, labels in _files(root):
        with xr.open_dataset(path, engine="netcdf4") as dataset:
            for name, variable in dataset.data_vars.items():
                if not set(variable.dims) <= {"variant", "quantity"}:
                    continue
                loaded = variable.load()
                for cell in loaded.stack(cell=loaded.dims) if loaded.dims else [loaded]:
                    row = {**labels, "name": str(name), "value": cell.item()}
                    for dim in loaded.dims:
                        row["variant" if dim == "variant" else "name"] = str(cell[dim].item())
                    row["units"] = variable.attrs.get("units", "")
                    if "quantity_units" in loaded.coords:
                        row["units"] = str(cell["quantity_units"].item())
                    row["long_name"] = variable.attrs.get("long_name", "")
                    rows.append(row)
    for path in sorted((root / "tables").glob("*.csv")):
        table = read_table(path)
        if {"name", "value"} <= set(table.columns):
            rows.extend({"kind": f"table/{path.stem}", **row} for row in table.to_dict("records"))
    columns = [*LABELS, "variant", "name", "value", "units", "long_name"]
    frame = pd.DataFrame(rows)
    for column in columns:
        if column not in frame:
            frame[column] = None
    return frame[columns + [column for column in frame if column not in columns]]

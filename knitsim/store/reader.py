"""Reading the result store: lazily as one labelled tree, or as one tidy table of scalars."""

from pathlib import Path

import pandas as pd
import xarray as xr

from knitsim.errors import InputError
from knitsim.store.table import read_table

# Kinds of result files: how the path below the store's root spells its labels.
_KINDS = {
    "yarn": ("yarn",),
    "loop": ("fabric",),
    "relaxed": ("fabric",),
    "tensile": ("fabric", "test"),
    "bending": ("fabric", "test"),
    "shear": ("fabric", "test"),
    "yarn_to_fabric": ("fabric",),
    "kes": ("fabric",),
    "sensitivity": ("fabric",),
    "measured": ("fabric", "calibration"),
}
_MODELS = ("kinematic", "equilibrium")


def _files(root):
    """(path, kind, labels) of every result file below ``root``, sorted."""
    for path in sorted(root.glob("*/**/*.nc")):
        kind, *parts = path.relative_to(root).with_suffix("").parts
        names = _KINDS.get(kind)
        if names is None or len(parts) != len(names):
            yield path, kind, {"name": "/".join(parts)}
            continue
        labels = dict(zip(names, parts, strict=True))
        if "test" in labels:
            labels["model"], _, labels["direction"] = labels.pop("test").partition("_")
        yield path, kind, labels


def open_store(root="results", *, kind=None, fabric=None, yarn=None, model=None, direction=None):
    """The store below ``root`` as a lazily read xarray.DataTree with one node a file.

    Nodes are named as the files are: ``/tensile/<fabric>/kinematic_course``.  Every label given keeps
    the files that carry it with this value: kind (``yarn``, ``loop``, ``relaxed``, ``tensile``,
    ``bending``, ...), fabric, yarn, model (``kinematic``, ``equilibrium``), direction (``course``,
    ``wale``).

    Raises InputError if nothing fits, saying what there is.  Close the tree with ``tree.close()`` or
    use it as a context manager.
    """
    root = Path(root)
    wanted = {
        "kind": kind, "fabric": fabric, "yarn": yarn, "model": model, "direction": direction
    }  # fmt: skip
    wanted = {name: value for name, value in wanted.items() if value is not None}
    found, seen = {}, {}
    for path, file_kind, labels in _files(root):
        labels = {"kind": file_kind, **labels}
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
    datasets = {name: xr.open_dataset(path, engine="netcdf4") for name, path in found.items()}
    tree = xr.DataTree.from_dict(datasets)
    tree.set_close(lambda: [dataset.close() for dataset in datasets.values()] and None)
    return tree


def scalar_table(root="results"):
    """All scalar results of the store as one tidy pandas.DataFrame.

    Columns: kind, yarn, fabric, model, direction, variant, name, value, units, long_name.  A scalar is a
    variable without dimensions, or one with the dimension ``variant`` or ``quantity`` alone.  The
    tables that the workflow writes (run times, assumptions, KES, ...) follow with kind ``table/...``
    where they have the columns ``name`` and ``value``.
    """
    root = Path(root)
    rows = []
    for path, kind, labels in _files(root):
        with xr.open_dataset(path, engine="netcdf4") as dataset:
            for name, variable in dataset.data_vars.items():
                if not set(variable.dims) <= {"variant", "quantity"}:
                    continue
                loaded = variable.load()
                for cell in loaded.stack(cell=loaded.dims) if loaded.dims else [loaded]:
                    row = {"kind": kind, **labels, "name": str(name), "value": cell.item()}
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
    columns = ["kind", "yarn", "fabric", "model", "direction", "variant", "name", "value", "units"]
    columns.append("long_name")
    frame = pd.DataFrame(rows)
    for column in columns:
        if column not in frame:
            frame[column] = None
    return frame[columns + [column for column in frame if column not in columns]]

"""Draw the figures of the catalogue from result files."""

from importlib import import_module

import xarray as xr

from knitsim.figures import style


def draw(figures, files, stems):
    """Draw ``figures`` (of the catalogue) from ``files`` {argument: path} as ``stems`` {name: stem}.

    The path may be a list: then the argument is {calibration: dataset}.  Each figure is written as PNG
    and SVG.
    """
    data = {name: _loaded(path) for name, path in files.items()}
    for figure in figures:
        style.save(drawn(figure, data), stems[figure.name], figure.caption)


def _loaded(path):
    if isinstance(path, (str, bytes)) or hasattr(path, "__fspath__"):
        return xr.load_dataset(path, engine="netcdf4")
    return {one.attrs["calibration"]: one for one in map(_loaded, path)}


def drawn(figure, data):
    """The matplotlib figure of an entry of the catalogue, from what of its datasets is in ``data``."""
    function = getattr(import_module(f"knitsim.figures.{figure.module}"), figure.name)
    arguments = {name: data[name] for name in (*figure.needs, *figure.takes) if name in data}
    with style.context():
        return function(**arguments)

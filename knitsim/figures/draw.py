"""Draw the figures of the catalogue from result files."""

import sys
import traceback
from importlib import import_module
from textwrap import fill

import xarray as xr

from knitsim.figures import style


def draw(figures, files, stems, log=None):
    """Draw ``figures`` (of the catalogue) from ``files`` {argument: path} as ``stems`` {name: stem}.

    The path may be a list: then the argument is {calibration: dataset}.  Each figure is written as PNG
    and SVG.  One that cannot be drawn costs no other: in its place stands why.  log: a file where
    tracebacks go.
    """
    loaded = {name: _loaded(path) for name, path in files.items()}
    data = {name: one for name, (one, _) in loaded.items() if one}
    for figure in figures:
        missing = [loaded[name][1] for name in figure.needs if name not in data]
        try:
            picture = left_out(missing[0]) if missing else drawn(figure, data)
        except (OSError, MemoryError):
            raise
        except Exception as error:
            why = f"{figure.name} cannot be drawn: {error}"
            print(f"knitsim: {why}", file=sys.stderr)
            if log is not None:
                with open(log, "a", encoding="utf-8") as file:
                    file.write(traceback.format_exc())
            picture = left_out(why)
        style.save(picture, stems[figure.name], figure.caption)


def _loaded(path):
    """(dataset, "") of a result file, or (None, why there are no numbers in it); a list: see draw."""
    if isinstance(path, (str, bytes)) or hasattr(path, "__fspath__"):
        dataset = xr.load_dataset(path, engine="netcdf4")
        why = dataset.attrs.get("stopped")
        return (dataset, "") if why is None else (None, f"{dataset.attrs['title']}: {why}")
    several = [_loaded(one) for one in path]
    found = {one.attrs["calibration"]: one for one, _ in several if one is not None}
    return found, "; ".join(why for _, why in several if why)


def left_out(why):
    """The figure that stands where none can be drawn: the reason in words."""
    with style.context():
        fig = style.page(height_mm=30.0)
        fig.text(0.02, 0.5, fill(f"Not drawn. {why}", 120), va="center")
        return fig


def drawn(figure, data):
    """The matplotlib figure of an entry of the catalogue, from what of its datasets is in ``data``."""
    function = getattr(import_module(f"knitsim.figures.{figure.module}"), figure.name)
    arguments = {name: data[name] for name in (*figure.needs, *figure.takes) if name in data}
    with style.context():
        return function(**arguments)

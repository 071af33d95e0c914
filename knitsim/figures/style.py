"""The look of every figure, and how it is written: same data, same bytes.

Draw inside ``with style.context():`` on a figure from :func:`figure`; nothing here touches
matplotlib's pyplot or its global settings.
"""

import io
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from knitsim.errors import InputError
from knitsim.files import replacing
from knitsim.units import INCH, to_si

DPI = 150
COLUMN_MM, PAGE_MM = 88.0, 180.0  # widths of a journal's column and page

# Okabe and Ito's colours, told apart by colour-blind readers and in print.
BLACK, GREY = "#000000", "#7F7F7F"
ORANGE, SKY, GREEN, YELLOW = "#E69F00", "#56B4E9", "#009E73", "#F0E442"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"

# What a colour means, the same in all figures.
COLOURS = {
    "kinematic": BLUE,
    "equilibrium": VERMILION,
    "printed": PURPLE,
    "corrected": GREEN,
    "measured": BLACK,
    "exact": BLACK,
    "course": SKY,
    "wale": ORANGE,
    "other": GREY,
}
LINES = {"loading": "-", "recovery": "--"}

# Colours of drawn yarns: undyed cotton, indigo and madder.
YARN_COLOURS = {"pale": "#EFEAE0", "dark": "#56699C", "marked": "#C8553D"}

TENSION_MAP = "viridis"  # for values along a yarn

RC = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib, so the same everywhere
    "mathtext.fontset": "dejavusans",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.4,
    "lines.markersize": 4.0,
    "axes.prop_cycle": matplotlib.cycler(
        color=[BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK]
    ),
    "image.cmap": TENSION_MAP,
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "figure.constrained_layout.use": True,
    "figure.facecolor": "white",
    "svg.hashsalt": "knitsim",
    "svg.fonttype": "path",
    "path.simplify": True,
}


def context():
    """Context manager in which figures look like knitsim's; matplotlib is as before after it."""
    return matplotlib.rc_context({**matplotlib.rcParamsDefault, **RC, "backend": "agg"})


def page(width_mm=PAGE_MM, height_mm=80.0):
    """An empty figure.  Call it, and draw, within :func:`context`."""
    for name, value in (("width_mm", width_mm), ("height_mm", height_mm)):
        if not value > 0:
            raise InputError(name, value, "must be above 0")
    fig = Figure(figsize=[to_si(value, "mm") / INCH for value in (width_mm, height_mm)])
    FigureCanvasAgg(fig)
    return fig


def figure(width_mm=PAGE_MM, height_mm=80.0, rows=1, columns=1, **options):
    """A :func:`page` and its axes (rows, columns), always a two-dimensional array.

    options go to ``Figure.subplots`` (``sharex``, ``width_ratios``, ...).
    """
    fig = page(width_mm, height_mm)
    return fig, fig.subplots(rows, columns, squeeze=False, **options)


def _lay_out(fig):
    """Work the layout out once, not anew for every file, and to a millionth of the figure's size.

    The solver's last bits vary from run to run, and names inside an SVG file hang on every bit.
    """
    engine = fig.get_layout_engine()
    if engine is None or not fig.axes:
        return
    engine.execute(fig)
    fig.set_layout_engine(None)
    for ax in fig.axes:
        ax.set_position(np.round(ax.get_position(original=True).bounds, 6))


def save(fig, path_stem, caption=""):
    """Write fig as ``path_stem.png`` and ``path_stem.svg``, the caption inside; returns both paths.

    Each appears whole or not at all, and holds no time and no version.  Missing directories are
    made.  A dot in the stem stays part of the name.  Afterwards the figure keeps its layout.
    """
    stem, said = Path(path_stem), {"Description": caption} if caption else {}
    paths = []
    # With any layout engine left, and after each file one is made as the settings say, the figure
    # would be laid out and drawn twice for a file.
    with context(), matplotlib.rc_context({"figure.constrained_layout.use": False}):
        _lay_out(fig)
        for suffix, options in (
            # Zlib's level 3 is twice as fast as the usual 6, and on drawn yarns as small.
            (".png", {"metadata": {"Software": None, **said}, "pil_kwargs": {"compress_level": 3}}),
            (".svg", {"metadata": {"Date": None, "Creator": None, **said}}),
        ):
            content = io.BytesIO()
            fig.savefig(content, format=suffix[1:], dpi=DPI, **options)
            path = stem.with_name(stem.name + suffix)
            with replacing(path) as partial:
                partial.write_bytes(content.getvalue())
            paths.append(path)
    return tuple(paths)

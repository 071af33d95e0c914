"""Run time against error of every solver, from the benchmark's table."""

import csv
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from knitsim.figures import style
from knitsim.figures.panels import heading, letter, note

_PANELS = (
    ("relaxing", lambda solver, test: test == "relaxing"),
    ("tension", lambda solver, test: solver == "equilibrium" and test.endswith("tension")),
    ("with friction", lambda solver, test: test.endswith("with friction")),
    ("bending", lambda solver, test: solver == "equilibrium" and test.endswith("bending")),
    ("simulated yarn", lambda solver, test: solver == "yarn"),
    ("kinematic tests", lambda solver, test: solver == "kinematic"),
)
_COLOURS = (
    style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY, style.BLACK,
    style.GREY,
)  # fmt: skip
_LEAST = 1e-9  # errors below are round-off and drawn here
_TARGETS = (0.1, 0.01, 1e-3, 1e-4)


def read(path):
    """Rows of the table of run time against error, as mappings."""
    with Path(path).open(newline="", encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def run_time_against_error(rows):
    """Every setting as a point, the front of the best as a line, the default as a star.

    rows: mappings with solver, test, quantity, seconds, error, reference_error, on_front, default.
    """
    fig, axes = style.figure(height_mm=140.0, rows=2, columns=3)
    heading(fig, "Run time against error: CPU time of one core, kernels compiled")
    for ax, (title, belongs), text in zip(axes.flat, _PANELS, "abcdef", strict=True):
        own = [row for row in rows if belongs(row["solver"], row["test"])]
        handles = []
        lines = dict.fromkeys((row["test"], row["quantity"]) for row in own)
        for (test, quantity), colour in zip(lines, _COLOURS, strict=False):
            mine = [r for r in own if (r["test"], r["quantity"]) == (test, quantity)]
            name = quantity if len({t for t, _ in lines}) == 1 else f"{test}: {quantity}"
            handles.append(_draw(ax, mine, colour, name.replace(" with friction", "")))
        for target in _TARGETS:
            ax.axhline(target, color=style.GREY, linewidth=0.5, linestyle=":")
        ax.set_xscale("log")
        ax.set_yscale("log")
        least, most = ax.get_xlim()
        # Less than a decade: a few even numbers, which do not touch.
        few = most < 5.0 * least
        ax.xaxis.set_major_locator(MaxNLocator(5) if few else LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{1e3 * x:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
        letter(ax, text, title)
        # Room for the legend above the data.
        low, high = np.log10(ax.get_ylim())
        share = 0.07 * len(handles)
        ax.set_ylim(10**low, 10 ** (high + share / (1.0 - share) * (high - low)))
        ax.legend(handles=handles, fontsize=6.0, loc="upper right")
    for ax in axes[:, 0]:
        ax.set_ylabel("relative error (1)")
    for ax in axes[-1]:
        ax.set_xlabel("CPU time (ms)")
    note(
        fig,
        "A point is a setting, a line joins those that no other beats in both, a star is the default."
        "  Bars at the left: the reference is not known better.  Dotted: 10 %, 1 %, 0.1 %, 0.01 %."
        f"  Errors below {_LEAST:g} are drawn there.",
    )
    return fig


def _draw(ax, rows, colour, name):
    """One quantity of one test; its entry of the legend."""
    rows = [row for row in rows if row["seconds"] and row["error"]]
    seconds = np.array([float(row["seconds"]) for row in rows])
    error = np.maximum([float(row["error"]) for row in rows], _LEAST)
    on = np.array([row["on_front"] == "yes" for row in rows])
    default = np.array([row["default"] == "yes" for row in rows])
    ax.plot(seconds, error, ".", color=colour, markersize=3.0, alpha=0.5)
    order = np.flatnonzero(on)[np.argsort(seconds[on])]
    line = ax.plot(seconds[order], error[order], "-", color=colour, linewidth=1.1)[0]
    line.set_gid(name)
    ax.plot(
        seconds[default], error[default], "*", color=colour, markersize=9.0,
        markeredgecolor=style.BLACK, markeredgewidth=0.5, linestyle="none",
    )  # fmt: skip
    if rows:
        bound = max(float(rows[0]["reference_error"]), _LEAST)
        ax.plot([0.0, 0.04], [bound] * 2, color=colour, transform=ax.get_yaxis_transform())
    return Line2D([], [], color=colour, label=name)

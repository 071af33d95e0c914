"""The solver against exact answers: error over the number of elements."""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

from knitsim.figures import style
from knitsim.figures.panels import heading, letter, note, say

_LEAST = 1e-8  # errors below are round-off and drawn here
_MARKERS = "os^Dv<>PX"
_COLOURS = (
    style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY, style.BLACK,
    style.GREY, "#7A4B12",
)  # fmt: skip


def fig17_verification(verification):
    """Error against the number of elements, a line a case with its observed order.

    verification: dataset of the verification.  The error with the most elements must not exceed the
    limit drawn.
    """
    groups = list(dict.fromkeys(verification.case_group.values.tolist()))
    fig, axes = style.figure(height_mm=128.0, columns=len(groups), sharex=True, sharey=True)
    heading(fig, "The equilibrium solver against exact answers, on the kernels of the fabric", 17)
    elements = verification.elements.values
    for ax, group, text in zip(axes[0], groups, "abcdefgh", strict=False):
        own = verification.isel(comparison=np.flatnonzero(verification.case_group == group))
        for limit in np.unique(own.error_limit):
            ax.axhline(limit, color=style.GREY, linewidth=0.9, linestyle=":")
            end = {"xycoords": ax.get_yaxis_transform(), "fontsize": 6.5}
            say(ax, f"limit\n{limit:g}", (1.0, limit), (2, 0), **end)
        handles = []
        for number, case in enumerate(dict.fromkeys(own.case.values.tolist())):
            handles.append(_line(ax, _largest(own, case), case, number))
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylim(0.6 * _LEAST, 5.0)
        ax.grid(True)
        ax.xaxis.set_major_locator(FixedLocator(elements))
        ax.xaxis.set_minor_locator(NullLocator())
        ax.xaxis.set_major_formatter(ScalarFormatter())
        ax.set_xlabel("elements (1)")
        letter(ax, text, group)
        ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.14), fontsize=6.3)
    axes[0, 0].set_ylabel("relative error (1)")
    note(
        fig,
        "Of each case the quantity with the largest error at the right (of those that show an order)."
        "  Order: fitted to the errors above the level that more elements cannot lower (stretch of the"
        f" yarn, compliance of the contact, rounding of the law).  Hollow: below {_LEAST:g}.",
    )
    return fig


def _largest(own, case):
    """The comparison of a case with the largest error at the end, of those with an order if any."""
    of_case = own.isel(comparison=np.flatnonzero(own.case == case))
    ordered = np.flatnonzero(np.isfinite(of_case.observed_order))
    if ordered.size:
        of_case = of_case.isel(comparison=ordered)
    return of_case.isel(comparison=int(of_case.relative_error.values[:, -1].argmax()))


def _line(ax, one, case, number):
    """Draw one comparison; its entry of the legend."""
    error = one.relative_error.values
    known = np.isfinite(error)
    look = {"color": _COLOURS[number % 9], "marker": _MARKERS[number % 9], "linewidth": 1.2}
    line = ax.plot(one.elements.values[known], np.maximum(error[known], _LEAST), **look)[0]
    low = known & (error < _LEAST)
    ax.plot(
        one.elements.values[low], np.full(low.sum(), _LEAST), linestyle="none",
        marker=look["marker"], color=look["color"], markerfacecolor="white",
    )  # fmt: skip
    line.set_gid(str(one.comparison.item()))
    order = float(one.observed_order)
    text = f"order {order:.1f}" if np.isfinite(order) else "no order"
    return Line2D([], [], label=f"{case}: {text}", **look)

"""Figures from yarn to fabric: bending rigidity and curl over loop length, diameter and set."""

import numpy as np
from matplotlib.lines import Line2D

from knitsim.figures import panels, style
from knitsim.figures.relaxed import MUNDEN
from knitsim.figures.style import COLOURS
from knitsim.store.results import DIRECTIONS
from knitsim.units import from_si

SWEPT = {
    "loop_length": ("swept_loop_length", "loop length (mm)", "mm"),
    "diameter": ("swept_diameter", "yarn diameter (mm)", "mm"),
    "set": ("swept_set", "set of the yarn (%)", "percent"),
}
# Of the sets compared, in order.
SET_LINES = ("-", "--", "-.", ":")
AFFINE_LINE = (0, (1, 1))


def straight_rigidity(rows, direction):
    """Rigidity per width over that of the yarn (1/m) of straight yarns as close as in the fabric.

    One yarn along the course in every course spacing; two legs along the wale in every wale spacing.
    """
    return 1.0 / rows.course_spacing if direction == "course" else 2.0 / rows.wale_spacing


def fig21_yarn_to_fabric(rigidity):
    """Rigidity of the fabric over its yarn's, and curl, over loop length, diameter and set."""
    fig, axes = style.figure(height_mm=168.0, rows=3, columns=3, sharey="row")
    panels.heading(
        fig, "its bending rigidity over that of the yarn, and curl, without friction", 21, rigidity
    )
    for column, (swept, (name, label, unit)) in enumerate(SWEPT.items()):
        rows = rigidity.isel(row=np.flatnonzero(rigidity.swept.values == swept))
        for line, part in _sets(rows, swept):
            x = from_si(part[name].values, unit)
            for ax, direction in zip(axes[:2, column], DIRECTIONS, strict=True):
                _rigidities(ax, x, part, float(rigidity.yarn_rigidity), direction, line)
            for direction in DIRECTIONS:
                curl = from_si(part.curl_moment.sel(direction=direction).values, "mN")
                axes[2, column].plot(x, curl, line, color=COLOURS[direction], marker="o",
                                     markersize=2.5)  # fmt: skip
        axes[2, column].axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
        for ax, key in zip(axes[:, column], ("adg", "beh", "cfi")[column], strict=True):
            ax.set_xlabel(label)
            panels.letter(ax, key, f"over {label.partition(' (')[0]}")
    for ax, direction in zip(axes[:2, 0], DIRECTIONS, strict=True):
        ax.set_ylabel(f"bent along the {direction}:\nfabric over yarn rigidity (1/mm)")
    for ax in axes[:2].flat:
        ax.set_ylim(bottom=0.0)
    axes[2, 0].set_ylabel("moment that\nholds it flat (mN)")
    missing = "Some fabrics were not reached; the file says why."
    panels.legend(fig, _legend(rigidity), note=missing if rigidity.attrs["not_reached"] else "")
    return fig


def _sets(rows, swept):
    """(line style, rows) for each set compared; one where the set itself is swept."""
    if swept == "set":
        return [(SET_LINES[0], rows)]
    fractions = list(dict.fromkeys(rows.swept_set.values.tolist()))
    return [
        (SET_LINES[k % len(SET_LINES)], rows.isel(row=np.flatnonzero(rows.swept_set.values == f)))
        for k, f in enumerate(fractions)
    ]


def _rigidities(ax, x, part, yarn, direction, line):
    """Rigidity over the yarn's (1/mm): in equilibrium; of the first set also the two estimates."""
    own = part.fabric_rigidity.sel(direction=direction).values / yarn
    ax.plot(
        x, from_si(own, "per_mm"), line, color=COLOURS["equilibrium"], marker="o", markersize=2.5
    )
    if line != SET_LINES[0]:
        return
    ax.plot(x, from_si(straight_rigidity(part, direction).values, "per_mm"), color="black",
            linewidth=1.0)  # fmt: skip
    affine = part.affine_rigidity.sel(direction=direction).values / yarn
    ax.plot(x, from_si(affine, "per_mm"), color=style.GREY, linestyle=AFFINE_LINE)


def _legend(rigidity):
    compared = rigidity.isel(row=np.flatnonzero(rigidity.swept.values != "set"))
    fractions = list(dict.fromkeys(compared.swept_set.values.tolist()))
    handles = {
        f"equilibrium, set {from_si(fraction, 'percent'):.0f} %": Line2D(
            [], [], color=COLOURS["equilibrium"], linestyle=SET_LINES[k % len(SET_LINES)], marker="o",
            markersize=2.5,
        )
        for k, fraction in enumerate(fractions)
    }  # fmt: skip
    handles |= {
        "straight yarns: B/c (course), 2 B/w (wale)": Line2D([], [], color="black", linewidth=1.0),
        "loop's yarn bent with the fabric, piece by piece": Line2D(
            [], [], color=style.GREY, linestyle=AFFINE_LINE
        ),
        "moment, bent along the course": Line2D(
            [], [], color=COLOURS["course"], marker="o", markersize=2.5
        ),
        "moment, bent along the wale": Line2D(
            [], [], color=COLOURS["wale"], marker="o", markersize=2.5
        ),
    }
    return handles


def fig22_set(rigidity):
    """What set of the yarn does to rigidity, curl and Munden's constants."""
    rows = rigidity.isel(row=np.flatnonzero(rigidity.swept.values == "set"))
    x, length = from_si(rows.swept_set.values, "percent"), rows.swept_loop_length
    fig, axes = style.figure(height_mm=62.0, rows=1, columns=4)
    panels.heading(fig, "what set of the yarn changes", 22, rigidity)
    values = {
        "B (mN mm)": from_si(rows.fabric_rigidity, "mN_mm"),
        "holding moment (mN)": from_si(rows.curl_moment, "mN"),
    }
    for ax, (label, by_direction) in zip(axes[0], values.items(), strict=False):
        for direction in DIRECTIONS:
            ax.plot(x, by_direction.sel(direction=direction).values, "o-", markersize=2.5,
                    color=COLOURS[direction], label=f"bent along the {direction}")  # fmt: skip
        ax.set_ylabel(label)
    constants = {
        "kc": (length / rows.course_spacing, COLOURS["course"]),
        "kw": (length / rows.wale_spacing, COLOURS["wale"]),
        "ratio": (rows.wale_spacing / rows.course_spacing, COLOURS["equilibrium"]),
    }
    labels = {"kc": "kc = l/c", "kw": "kw = l/w", "ratio": "w/c"}
    for name, (found, colour) in constants.items():
        ax = axes[0, 3 if name == "ratio" else 2]
        ax.plot(x, found.values, "o-", markersize=2.5, color=colour, label=labels[name])
        ax.axhline(MUNDEN[name], color=colour, linestyle="--", linewidth=1.0,
                   label=f"{labels[name]}, Munden (1959)")  # fmt: skip
    axes[0, 2].set_ylabel("Munden's constants (1)")
    axes[0, 3].set_ylabel("shape of the loop w/c (1)")
    axes[0, 0].set_ylim(bottom=0.0)
    axes[0, 1].axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
    panels.second_axis(axes[0, 0], "mN_mm", "gf_cm2_per_cm", "B (gf cm2/cm)")
    titles = ("B, no friction", "curl", "density at rest", "loop at rest")
    for ax, key, title in zip(axes[0], "abcd", titles, strict=True):
        ax.set_xlabel("set of the yarn (%)")
        panels.letter(ax, key, title)
    panels.legend(fig, panels.labelled(axes[0]), ncols=4)
    return fig

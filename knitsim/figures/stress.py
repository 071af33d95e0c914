"""Where the limits of the equilibrium model lie: every case of the stress campaign on maps of its inputs."""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

from knitsim.figures import style
from knitsim.figures.panels import heading, letter, say

# Drawn in this order, so that what went astray lies on top.
_OUTCOMES = {
    "verified": (style.SKY, "o", 5.0, "converged and verified"),
    "refused": (style.GREY, "x", 9.0, "refused with a reason"),
    "stopped": (style.ORANGE, "^", 14.0, "stopped early with a reason"),
    "wrong": (style.VERMILION, "D", 18.0, "wrong"),
}


def stress_map(rows, limits):
    """Maps of the cases by their inputs, and what became of each family.

    rows: mappings by knitsim.stages.trials.COLUMNS, values as text; limits: that stage's LIMITS.
    Cases called impossible from their inputs are pale; dashed lines are where the rule draws the limit.
    Inputs that no fabric has are counted, but stand on no map.
    """
    every, rows = rows, [row for row in rows if row["family"] != "no input"]
    fig, axes = style.figure(height_mm=150.0, rows=2, columns=3)
    heading(fig, f"Stability of the equilibrium model: {len(every)} random and worst cases")
    value = {name: np.array([float(row[name]) for row in rows]) for name in _USED}
    d, length = value["diameter"], value["loop_length"]
    slope = np.array([_slope(row) for row in rows])
    rigidity = 16.0 * value["bending_rigidity"] / (slope * d**2)
    compression = value["contact_stiffness"] * d / slope
    barrier = np.array([not row["core"] for row in rows])
    bulk = length / d
    room = (length - 2.0 * value["course_spacing"] - value["wale_spacing"]) / d
    pulled, bends = (
        np.array([row["kind"] == kind for row in rows]) for kind in ("tension", "bending")
    )
    ax = axes[0, 0]
    _scatter(ax, rows, compression, rigidity, barrier)
    # B/(K d^3) of the narrowest contact that contact points resolve.
    ends = np.array([compression[barrier].min(), compression[barrier].max()])
    ax.plot(ends, 16.0 * limits["narrow"] * ends, color=style.BLACK, linestyle="--", linewidth=0.8)
    ax.set(xscale="log", yscale="log", xlabel=r"compression $K d / k_1$ (1)")
    ax.set_ylabel(r"bending rigidity $16 B / (k_1 d^2)$ (1)")
    letter(ax, "a", "barrier law: bending and compression")
    ax = axes[0, 1]
    _scatter(ax, rows, bulk, room, np.ones(len(rows), dtype=bool))
    ax.axhline(limits["room"], color=style.BLACK, linestyle="--", linewidth=0.8)
    ax.axvline(limits["bulk"], color=style.BLACK, linestyle="--", linewidth=0.8)
    ax.set(xscale="log", xlabel=r"loop length $l / d$ (1)", ylabel=r"$(l - 2c - w) / d$ (1)")
    ax.set_yscale("symlog", linthresh=10.0)
    for axis, ticks in ((ax.xaxis, (12, 20, 40, 80)), (ax.yaxis, (0, 5, 10, 20, 50))):
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(ScalarFormatter())
    letter(ax, "b", "tight and open fabrics")
    ax = axes[0, 2]
    _scatter(ax, rows, 1e2 * value["largest"], value["friction"], pulled)
    ax.set(xlabel="strain asked (%)", ylabel="friction (1)")
    letter(ax, "c", "tension: strain and friction")
    ax = axes[1, 0]
    _scatter(ax, rows, value["largest"] * d, rigidity, bends)
    ax.axvline(limits["curvature"], color=style.BLACK, linestyle="--", linewidth=0.8)
    ax.set(xscale="log", yscale="log", xlabel=r"curvature $|\kappa| d$ (1)")
    ax.set_ylabel(r"bending rigidity $16 B / (k_1 d^2)$ (1)")
    letter(ax, "d", "bending: curvature")
    _families(axes[1, 1], every, limits["families"], "yes")
    letter(axes[1, 1], "e", "possible cases")
    _families(axes[1, 2], every, limits["families"], "no")
    axes[1, 2].set_yticklabels([])
    letter(axes[1, 2], "f", "cases called impossible")
    fig.legend(handles=_legend(), loc="outside lower center", ncols=3)
    return fig


_USED = (
    "diameter", "loop_length", "wale_spacing", "course_spacing", "bending_rigidity",
    "contact_stiffness", "friction", "largest",
)  # fmt: skip


def _slope(row):
    """First slope (N) of the tension law."""
    strain, tension = (
        [float(v) for v in str(row[name]).split()] for name in ("law_strain", "law_tension")
    )
    return tension[1] / strain[1]


def _scatter(ax, rows, x, y, which):
    """Cases as points; impossible ones pale."""
    outcome = np.array([row["outcome"] for row in rows])
    possible = np.array([row["possible"] == "yes" for row in rows])
    for pale in (True, False):
        for name, (colour, marker, size, _) in _OUTCOMES.items():
            chosen = which & (outcome == name) & (possible != pale)
            line = {} if marker == "x" else {"linewidths": 0.0}
            ax.scatter(
                x[chosen], y[chosen], s=0.6 * size if pale else size, c=colour, marker=marker,
                alpha=0.25 if pale else 0.8, rasterized=True, **(line or {"linewidths": 0.6}),
            )  # fmt: skip
    ax.grid(True)


def _families(ax, rows, families, possible):
    """Shares of the outcomes of each family, per cent, with the number of cases."""
    names = list(families)[::-1]
    for place, family in enumerate(names):
        own = [r["outcome"] for r in rows if r["family"] == family and r["possible"] == possible]
        left = 0.0
        for outcome, (colour, *_) in _OUTCOMES.items():
            share = 100.0 * own.count(outcome) / max(len(own), 1)
            ax.barh(place, share, left=left, color=colour, height=0.7)
            left += share
        say(ax, f" {len(own)}", (100.0, place), fontsize=6.5, annotation_clip=False)
    ax.set_yticks(range(len(names)), names)
    ax.set(xlim=(0.0, 100.0), xlabel="share of the cases (%)")


def _legend():
    handles = [
        Line2D([], [], linestyle="none", marker=marker, color=colour, markersize=4.5, label=text)
        for colour, marker, _, text in _OUTCOMES.values()
    ]
    handles.append(
        Line2D([], [], linestyle="none", marker="o", color=style.SKY, alpha=0.25, markersize=3.5,
               label="pale: called impossible from the inputs")
    )  # fmt: skip
    handles.append(
        Line2D([], [], linestyle="--", color=style.BLACK, linewidth=0.8, label="limit of that rule")
    )
    return handles

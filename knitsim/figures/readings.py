"""What the figures of the tensile test share: its readings, how they look, and fabric in a state."""

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D

from knitsim.figures import style
from knitsim.figures.states import (
    BEYOND_BREAK,
    PERCENT,
    breaking_strain,
    is_beyond_break,
    loading,
    readings,
    state_at,
)
from knitsim.figures.style import COLOURS, LINES, YARN_COLOURS
from knitsim.figures.tubes import fabric_polylines
from knitsim.units import from_si

OTHER = {"course": "wale", "wale": "course"}
BREAK_COLOUR = style.VERMILION
PRINTED_LINE = (0, (5, 1.5))


def reading_label(choices):
    """How the loop contracts, or that its positions are the printed ones."""
    if choices["positions"] == "printed":
        return "positions as printed"
    if choices["contraction"] == "linear" and choices["limit"] != "half":
        return "linear, to one course spacing less"
    return {
        "isometric": "isometric, then at the limit",
        "linear": "linear, to half",
        "none": "no contraction",
    }[choices["contraction"]]


def reading_style(choices):
    """Colour and line of a reading; its contraction law decides."""
    if choices["positions"] == "printed":
        return {"color": COLOURS["printed"], "linestyle": PRINTED_LINE}
    if choices["contraction"] == "isometric":
        return {"color": COLOURS["corrected"], "linestyle": "-"}
    if choices["limit"] != "half":
        return {"color": style.SKY, "linestyle": "-"}
    return {"color": style.BLUE if choices["contraction"] == "linear" else style.GREY}


def _plain(choices):
    """Whether a reading differs from the reference in its contraction or positions only."""
    return (choices["strain"], choices["viscous"]) == ("yarn", False) and (
        choices["positions"] == "printed" or choices["law"] == "continuous"
    )


def reference_and_printed(tension):
    """The reference reading of a test, the first one, as a dataset; the printed one, or None."""
    found = readings(tension)
    printed = next((n for n, c in found.items() if c["positions"] == "printed"), None)
    return (
        tension.sel(variant=next(iter(found))),
        None if printed is None else tension.sel(variant=printed),
    )


def contractions(tension):
    """{variant: choices} of the readings that differ in how the loop contracts, and the printed."""
    return {name: c for name, c in readings(tension).items() if _plain(c)}


def fabric_of(state, wide, high, colour=None):
    """Yarns of a state, one loop set off; where the set-off loop lies, as (course, wale) shift (m)."""
    points = state.centreline.values
    spacing = float(state.wale_spacing), float(state.course_spacing)
    yarns = fabric_polylines(points, *spacing, wide, high, colours=YARN_COLOURS["pale"])
    column, row = wide // 2, high // 2
    count = len(points) - 1
    begin = column * count
    marked = np.tile(to_rgb(colour or YARN_COLOURS["marked"]), (count + 1, 1))
    yarns.colours[row] = yarns.colours[row].copy()
    yarns.colours[row][begin : begin + count + 1] = marked
    return yarns, np.array([column * spacing[0], row * spacing[1], 0.0])


def state_text(state):
    """Strains of a state in words, and whether the yarn would have broken."""
    text = (
        f"fabric {from_si(float(state.strain), PERCENT):+.0f} %,"
        f" yarn {percent_text(float(state.yarn_strain))} %"
    )
    return text + (" (beyond break)" if is_beyond_break(state) else "")


def percent_text(strain):
    # No "-0.0": a yarn at rest has rounding errors of either sign.
    return f"{round(from_si(strain, PERCENT), 1) + 0.0:+.1f}"


def step_at_share(tension, share):
    """Number of the state at that share of the test's largest strain."""
    return state_at(tension, "strain", share * tension.strain.values.max())


def draw_equilibrium(ax, dataset, values):
    """Values (variant, step) of the equilibrium model against strain, loading and recovery.

    Each variant has its own states; those that were not reached hold no numbers.
    """
    for name in dataset.variant.values:
        curve, y = dataset.sel(variant=name), values.sel(variant=name).values
        strain = from_si(curve.strain.values, PERCENT)
        label = f"equilibrium, {name}"
        for cycle in np.unique(curve.cycle.values):
            for phase, line in LINES.items():
                states = (curve.cycle.values == cycle) & (curve.phase.values == phase)
                states &= np.isfinite(strain) & np.isfinite(y)
                ax.plot(
                    strain[states], y[states], color=COLOURS["equilibrium"], linestyle=line,
                    label=label,
                )  # fmt: skip
                label = None


def break_handle(tension):
    """{text: line} for the legend: where the yarn breaks."""
    limit = from_si(breaking_strain(tension), PERCENT)
    return {
        f"the yarn breaks ({limit:.3g} %); dotted: beyond": Line2D(
            [], [], color=BREAK_COLOUR, marker="X", linestyle=":", markersize=5
        )
    }


def plot_loading(ax, curve, values, *, label=None, **look):
    """A reading's values (steps,) on loading against strain; beyond the breaking strain dotted.

    A cross marks where the yarn breaks; returns its (strain in percent, value), or None.
    """
    up = loading(curve)
    strain, values = from_si(curve.strain.values[up], PERCENT), values[up]
    beyond = curve.status.values[up] == BEYOND_BREAK
    ax.plot(strain, np.where(beyond, np.nan, values), label=label, **look)
    if not beyond.any():
        return None
    ax.plot(strain, np.where(beyond, values, np.nan), color=look["color"], linestyle=":")
    end = strain[beyond][0], values[beyond][0]
    ax.plot(*end, marker="X", color=BREAK_COLOUR, markersize=5, linestyle="none", zorder=5)
    return end

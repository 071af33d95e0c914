"""What the figures of the kinematic tensile test share: its readings, and fabric in a state."""

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D

from knitsim.figures import stored, style
from knitsim.figures.style import COLOURS, YARN_COLOURS
from knitsim.figures.tubes import fabric_polylines
from knitsim.units import from_si, to_si

OTHER = {"course": "wale", "wale": "course"}
BREAK_COLOUR = style.VERMILION
PRINTED_LINE = (0, (5, 1.5))
BREAK = "break"  # name of the marks where the yarn breaks


def reading_label(choices):
    """How the loop contracts, or that its positions are the printed ones."""
    if choices["positions"] == "printed":
        return "kinematic: positions as printed"
    if choices["contraction"] == "linear" and choices["limit"] != "half":
        return "kinematic: linear, to one course spacing less"
    law = {
        "isometric": "isometric, then at the limit",
        "linear": "linear, to half",
        "none": "no contraction",
    }[choices["contraction"]]
    return f"kinematic: {law}"


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
    found = stored.readings(tension)
    printed = next((n for n, c in found.items() if c["positions"] == "printed"), None)
    return (
        tension.sel(variant=next(iter(found))),
        None if printed is None else tension.sel(variant=printed),
    )


def contractions(tension):
    """{variant: choices} of the readings that differ in how the loop contracts, and the printed."""
    return {name: c for name, c in stored.readings(tension).items() if _plain(c)}


def fabric_of(state, wide, high, colour=None):
    """Yarns of a state, one loop set off; where the set-off loop lies, as (course, wale) shift (m).

    The loop set off is an image of the first of the cell.
    """
    spacing = float(state.wale_spacing), float(state.course_spacing)
    loops, courses = state.centreline.values, stored.courses_of(state)
    loops = loops[None] if loops.ndim == 2 else loops
    yarns = fabric_polylines(
        loops, *spacing, wide, high, courses=courses, colours=YARN_COLOURS["pale"]
    )
    wales, count = len(loops) // courses, loops.shape[1] - 1
    column, row = wide // 2 // wales * wales, high // 2 // courses * courses
    begin = column * count
    yarns.colours[row][begin : begin + count + 1] = to_rgb(colour or YARN_COLOURS["marked"])
    return yarns, np.array([column * spacing[0], row * spacing[1], 0.0])


def state_text(state):
    """Strains of a state in words, and whether the yarn would have broken."""
    text = (
        f"fabric {from_si(float(state.strain), 'percent'):+.0f} %,"
        f" yarn {percent_text(float(state.yarn_strain))} %"
    )
    return text + (" (beyond break)" if stored.is_beyond_break(state) else "")


def percent_text(strain):
    # No "-0.0": a yarn at rest has rounding errors of either sign.
    return f"{round(from_si(strain, 'percent'), 1) + 0.0:+.1f}"


def step_at_share(tension, share):
    """Number of the state at that share of the test's largest strain."""
    return stored.state_at(tension, "strain", share * tension.strain.values.max())


def starting_spacings(equilibrium, direction):
    """(wale, course) spacing (m) at strain 0, where the test in equilibrium starts.

    From any state, since under a load across the pull none of strain 0 is stored.
    """
    first = equilibrium.stack(state=("variant", "step")).dropna("state", subset=["wale_spacing"])
    first = first.isel(state=0)
    spacing = {name: float(first[f"{name}_spacing"]) for name in OTHER}
    # A course pull widens the wales.
    spacing[OTHER[direction]] /= 1.0 + float(first.strain)
    spacing[direction] /= 1.0 + float(first.transverse_strain)
    return spacing["wale"], spacing["course"]


def _starts(direction, tension, equilibrium):
    """[(model, colour, (wale, course) spacing (m) at strain 0)] of the models that are shown."""
    stated = tuple(float(tension[f"{name}_spacing"].values.flat[0]) for name in ("wale", "course"))
    starts = [("kinematic model", style.BLACK, stated)]
    if equilibrium is not None:
        rest = starting_spacings(equilibrium, direction)
        starts.append(("equilibrium model", COLOURS["equilibrium"], rest))
    return starts


def starting_texts(tension, equilibrium, direction):
    """Lines that say from where the models that are shown count their strains."""
    states = ("the stated density", "its own state at rest")
    starts = _starts(direction, tension, equilibrium)
    return [
        f"Strain 0 of the {model}: {where}, wales {from_si(wale, 'mm'):.3f} mm, courses"
        f" {from_si(course, 'mm'):.3f} mm."
        for (model, _, (wale, course)), where in zip(starts, states, strict=False)
    ]


def spacing_axis(ax, direction, tension, equilibrium):
    """Above the fabric's strain (%) the spacing that is pulled: in equilibrium, if that is shown."""
    model, colour, spacings = _starts(direction, tension, equilibrium)[-1]
    rest = from_si(spacings[0 if direction == "course" else 1], "mm")
    side = ax.secondary_xaxis(
        1.0,
        functions=(
            lambda strain: rest * (1.0 + to_si(strain, "percent")),
            lambda spacing: from_si(spacing / rest - 1.0, "percent"),
        ),
    )
    side.set_xlabel(f"{OTHER[direction]} spacing, {model} (mm)", color=colour, fontsize=7)
    side.tick_params(colors=colour, pad=1)
    side.spines["top"].set(visible=True, color=colour)


def break_handle(tension, axes):
    """{text: line} for the legend: where the yarn breaks, if any of the axes shows it."""
    if not any(line.get_gid() == BREAK for ax in axes for line in ax.lines):
        return {}
    limit = from_si(stored.breaking_strain(tension), "percent")
    line = Line2D([], [], color=BREAK_COLOUR, marker="X", linestyle=":", markersize=5)
    return {f"the yarn breaks ({limit:.3g} %); dotted: beyond": line}


def plot_loading(ax, curve, values, *, label=None, **look):
    """A reading's values (steps,) on loading against strain; beyond the breaking strain dotted.

    A cross marks where the yarn breaks; returns its (strain in percent, value), or None.
    """
    up = stored.loading(curve)
    strain, values = from_si(curve.strain.values[up], "percent"), values[up]
    beyond = curve.status.values[up] == stored.BEYOND_BREAK
    ax.plot(strain, np.where(beyond, np.nan, values), label=label, **look)
    if not beyond.any():
        return None
    dotted = np.where(stored.with_neighbours(beyond), values, np.nan)
    ax.plot(strain, dotted, color=look["color"], linestyle=":")
    end = strain[beyond][0], values[beyond][0]
    ax.plot(
        *end, marker="X", color=BREAK_COLOUR, markersize=5, linestyle="none", zorder=5, gid=BREAK
    )
    return end

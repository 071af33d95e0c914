"""Figure of cycles with friction: loops of load and extension, what wears from cycle to cycle, rest."""

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.ticker import MaxNLocator

from knitsim.figures import panels, solved, style
from knitsim.figures.stored import readings
from knitsim.store.results import DIRECTIONS
from knitsim.units import from_si

PALE = 0.75  # how much white the last cycle's colour holds
CLOSED = 1.0  # per cent: a change of the peak below it is a loop that has closed
# What is read of each cycle: variable, text, mark.
WORN = (
    ("cycle_peak_force_per_width", "peak force, over the first", "o-"),
    ("cycle_dissipated", "energy lost, over the first", "s-"),
    ("cycle_residual_strain", "strain left at no force", "D--"),
)


def fig23_cycles(equilibrium_course, equilibrium_wale, relaxed):
    """Loops of load and extension, what each cycle gives, and where friction lets the fabric rest."""
    given = dict(zip(DIRECTIONS, (equilibrium_course, equilibrium_wale), strict=True))
    fig, axes = style.figure(height_mm=116.0, rows=2, columns=3, width_ratios=[1.25, 1.0, 1.0])
    panels.heading(fig, "cycles with friction between the yarns", 23, equilibrium_course)
    said = []
    for row, (direction, test), letters in zip(axes, given.items(), ("ab", "de"), strict=True):
        name = most_cycled(test)
        if name is None:
            said.append(f"{direction}: no condition of the scene has friction and way back.")
            continue
        curve = test.sel(variant=name)
        _loops(row[0], curve, direction)
        _worn(row[1], curve)
        panels.letter(row[0], letters[0], f"{direction}, condition {name}")
        panels.letter(row[1], letters[1], "each cycle")
        said.append(_closing(curve, direction))
    for ax, direction, key in zip(axes[:, 2], DIRECTIONS, "cf", strict=True):
        _rest(ax, relaxed, given[direction], direction)
        panels.letter(ax, key, f"{direction}, at rest")
    handles = panels.labelled(axes[:, 0]) | panels.RECOVERY
    handles |= panels.labelled(axes[:, 1]) | panels.labelled(axes[:, 2])
    panels.legend(fig, handles, ncols=4, note="\n".join(said))
    return fig


def most_cycled(test):
    """The condition with friction that recovers most often; None where none does."""
    found = {
        name: int(np.isfinite(test.cycle_residual_strain.sel(variant=name)).sum())
        for name, choices in readings(test).items()
        if choices["friction"]
    }
    name = max(found, key=found.get, default=None)
    return name if name is not None and found[name] else None


def _shade(share):
    """From black, the first cycle, to pale."""
    black = np.array(to_rgb(style.BLACK))
    return tuple(black + PALE * share * (1.0 - black))


def _loops(ax, curve, direction):
    force = from_si(curve.force_per_width.values, "N_per_mm")
    strain = from_si(curve.strain.values, "percent")
    last = max(int(np.nanmax(curve.cycle.values)) - 1, 1)
    for phase, states in solved.runs(curve):
        cycle = int(curve.cycle.values[states[-1]])
        # Later ones often lie on earlier ones.
        share = (cycle - 1) / last
        ax.plot(
            strain[states], force[states], style.LINES[phase], color=_shade(share),
            linewidth=2.2 - 1.4 * share, label=f"cycle {cycle}" if phase == "loading" else None,
        )  # fmt: skip
    ax.set(xlabel=f"{direction} strain (%)", ylabel="force per width (N/mm)", ylim=(0.0, None))
    ax.set_xlim(left=0.0)


def _worn(ax, curve):
    """Peak and energy lost over those of the first cycle, and the residual strain, in per cent."""
    for name, text, mark in WORN:
        value = curve[name].values
        whole = value[0] if name != "cycle_residual_strain" else 1.0
        ax.plot(curve["round"].values, 100.0 * value / whole, mark, color=style.BLACK, markersize=3.5,
                markerfacecolor="white", label=text)  # fmt: skip
    last = int(curve["round"].max())
    ax.set_xlim(0.5, last + 0.5)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    ax.set(xlabel="cycle (1)", ylabel="share, or strain (%)", ylim=(0.0, 110.0))


def _closing(curve, direction):
    """When the loops close, and how the fabric grows, in words."""
    closes, growth = float(curve.cycles_to_close), 100.0 * float(curve.growth)
    if curve.sizes["round"] == 1:
        return f"Along the {direction} there is one cycle only."
    when = (
        f"from cycle {closes:.0f} on the peak changes by less than {CLOSED:g} %"
        if np.isfinite(closes)
        else f"the peak still changes by more than {CLOSED:g} %"
    )
    left = (
        f"{growth:.2g} % more strain is left" if abs(growth) >= 1e-3 else "no more strain is left"
    )
    return f"Along the {direction} {when}; from the first to the last cycle {left}."


def _rest(ax, relaxed, test, direction):
    """The spacings in which friction lets the fabric rest, and those after each cycle."""
    if "rest_line_spacing" in relaxed:
        wale, course = from_si(relaxed.rest_line_spacing.values.T, "mm")
        label = "between these friction lets it rest"
        ax.plot(wale, course, "-", color=style.GREY, linewidth=1.2, label=label)
    own = [from_si(float(relaxed[f"{name}_spacing"]), "mm") for name in ("wale", "course")]
    ax.plot(*own, "o", color=style.BLACK, markersize=4.5, label="at rest without friction")
    name = most_cycled(test)
    if name is not None:
        curve = test.sel(variant=name)
        ends = [s[-1] for phase, s in solved.runs(curve) if phase == "recovery"]
        for k, state in enumerate(ends):
            at = [from_si(float(curve[f"{n}_spacing"][state]), "mm") for n in ("wale", "course")]
            label = "released after each cycle" if k == 0 else None
            ax.plot(*at, "D", color=_shade(k / max(len(ends) - 1, 1)), markeredgecolor=style.BLACK,
                    markersize=4.5, label=label, zorder=4.0 - 0.1 * k)  # fmt: skip
    ax.set(xlabel="wale spacing (mm)", ylabel="course spacing (mm)")
    ax.margins(0.12)
    ax.locator_params(axis="x", nbins=4)

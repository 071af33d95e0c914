"""Figure of the tensile test in the equilibrium model: forces, shape, energies and the fabric."""

from textwrap import fill

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import EngFormatter, MaxNLocator

from knitsim.figures import style
from knitsim.figures.readings import (
    OTHER,
    draw_equilibrium,
    equilibrium_styles,
    residual_handle,
    runs,
    starting_spacings,
    with_states,
)
from knitsim.figures.states import (
    GF_PER_CM,
    N_PER_MM,
    PER_CM,
    PERCENT,
    courses_of,
    fabric_name,
    heading,
    is_beyond_break,
    letter,
    readings,
    thinned,
    with_centreline,
)
from knitsim.figures.tubes import draw_tubes, fabric_polylines
from knitsim.units import from_si, to_si

# Stacked from below; the energy that friction took last.
ENERGY_COLOURS = {
    "bend": style.SKY,
    "contact": style.ORANGE,
    "stretch": style.GREEN,
    "lost to friction": "#C8C8C8",
}
SMALLEST_OF_LARGEST = 0.01  # numerical_error is relative to no less than that of the largest force


def fig16_equilibrium_tension(equilibrium_course, equilibrium_wale):
    """Load and extension with its error, contraction, energies and fabric, in both directions."""
    given = {"course": equilibrium_course, "wale": equilibrium_wale}
    ended = [f"{direction} pull, ended early: {test.attrs['stop_reason']}"
             for direction, test in given.items() if test.attrs["stop_reason"]]  # fmt: skip
    tests = {
        direction: with_states(test)
        for direction, test in given.items() if with_states(test) is not None
    }  # fmt: skip
    fig = style.page(height_mm=232.0)
    heading(
        fig,
        f"Fig. 16  Fabric {fabric_name(equilibrium_course)} under tension in the equilibrium model:"
        " course (above) and wale",
    )
    if ended:
        fig.supxlabel("\n".join(fill(text, 120) for text in ended), fontsize=7)
    if not tests:
        return fig
    curves, energies, fabrics = fig.add_gridspec(3, 1, height_ratios=[2.4, 1.0, 0.75])
    grid = curves.subgridspec(len(tests), 4).subplots(squeeze=False)
    for row, (direction, test), letters in zip(grid, tests.items(), ("abcd", "efgh"), strict=False):
        _curves(row, test, direction, letters)
    panels = [(d, test, name) for d, test in tests.items() for name in _told_apart(test)]
    row = energies.subgridspec(1, len(panels)).subplots(squeeze=False)[0]
    for ax, (direction, test, name), key in zip(row, panels, "ijkl", strict=False):
        curve = test.sel(variant=name)
        _energies(ax, curve)
        if _is_recovered(curve):
            _say_left_over(ax, curve)
        ax.set_xlabel(f"{direction} strain (%)")
        ax.set_ylabel("energy per loop (J)" if ax is row[0] else "")
        letter(ax, f"({key}) {name}")
    _fabrics(fig, fabrics, tests)
    handles = {
        _condition(name, readings(test)[name]): Line2D([], [], **look)
        for test in tests.values() for name, look in equilibrium_styles(test).items()
    } | {
        "loading": Line2D([], [], color=style.GREY, linestyle=style.LINES["loading"]),
        "recovery": Line2D([], [], color=style.GREY, linestyle=style.LINES["recovery"]),
        "estimated numerical error": Patch(color=style.GREY, alpha=0.35, linewidth=0),
    }  # fmt: skip
    handles |= residual_handle()
    handles |= {name: Patch(color=colour) for name, colour in ENERGY_COLOURS.items()}
    handles["work done, from the energy at rest"] = Line2D([], [], color="black", linestyle=":")
    fig.legend(handles.values(), handles, loc="outside lower center", ncols=3)
    return fig


def _condition(name, choices):
    """A condition by its name, and in words."""
    width = {"loaded": f"under {from_si(choices['lateral_load'], N_PER_MM):.3g} N/mm"}
    return (
        f"{name}: {'with' if choices['friction'] else 'no'} friction,"
        f" width {width.get(choices['lateral'], choices['lateral'])}"
    )


def _curves(row, test, direction, letters):
    """Load and extension, whole and small forces; contraction; how close the yarns come."""
    force = from_si(test.force_per_width, N_PER_MM)
    for ax in row[:2]:
        for name, look in equilibrium_styles(test).items():
            _error_band(ax, test.sel(variant=name), look["color"])
        draw_equilibrium(ax, test, force, residual=ax is row[1])
        ax.set_ylim(bottom=0.0)
        side = ax.secondary_yaxis(
            "right",
            functions=(
                lambda force: from_si(to_si(force, N_PER_MM), GF_PER_CM),
                lambda force: from_si(to_si(force, GF_PER_CM), N_PER_MM),
            ),
        )
    row[0].set_ylabel("force per width (N/mm)")
    side.set_ylabel("force per width (gf/cm)")
    _show_small(row[1], test, force)
    draw_equilibrium(row[2], test, from_si(test.transverse_strain, PERCENT))
    row[2].set_ylabel(f"strain along the {OTHER[direction]} (%)")
    draw_equilibrium(row[3], test, test.min_distance)
    row[3].axhline(1.0, color=style.GREY, linewidth=0.8, linestyle=":")
    row[3].set_ylabel("closest centre lines (diameters)")
    titles = ("load", "small loads", "contraction", "closest yarns")
    for ax, key, title in zip(row, letters, titles, strict=True):
        ax.set_xlim(left=0.0)
        ax.set_xlabel(f"{direction} strain (%)")
        ax.locator_params(axis="x", nbins=4)
        letter(ax, f"({key}) {title}")


def force_error(curve):
    """Estimated error (N/m) of the force per width of one variant, (steps,)."""
    force = np.abs(curve.force_per_width.values)
    return curve.numerical_error.values * np.fmax(force, SMALLEST_OF_LARGEST * np.nanmax(force))


def _error_band(ax, curve, colour):
    force, error = curve.force_per_width.values, force_error(curve)
    low, high = from_si(np.array([force - error, force + error]), N_PER_MM)
    strain = from_si(curve.strain.values, PERCENT)
    for _, states in runs(curve):
        ax.fill_between(
            strain[states], low[states], high[states], color=colour, alpha=0.35, linewidth=0
        )


def _is_recovered(curve):
    return any(phase == "recovery" for phase, _ in runs(curve))


def _show_small(ax, test, force):
    """Limit the panel to the strains and loads of the condition that recovers."""
    recovered = [name for name in readings(test) if _is_recovered(test.sel(variant=name))]
    shown = test.sel(variant=recovered[:1]) if recovered else test
    share = 1.15 if recovered else 0.1
    ax.set_ylim(top=share * float(force.sel(variant=shown.variant).max()))
    ax.set_xlim(0.0, 1.1 * from_si(float(shown.strain.max()), PERCENT))


def _say_left_over(ax, curve):
    """What the first recovery leaves of the strain, and its cycle takes of the work."""
    (_, up), (_, down) = runs(curve)[:2]
    lost = from_si(float(curve.dissipated[down[-1]] / curve.work[up[-1]]), PERCENT)
    left = from_si(float(curve.strain[down[-1]]), PERCENT)
    ax.annotate(
        f"strain left {left:.1f} %\nwork lost {lost:.0f} %", (0.05, 0.06), xycoords="axes fraction",
        fontsize=7,
    )  # fmt: skip


def _told_apart(test):
    """The reference condition, and the first one with friction."""
    found = readings(test)
    rough = [name for name, choices in found.items() if choices["friction"]]
    return list(dict.fromkeys([next(iter(found)), *rough[:1]]))


def _energies(ax, curve):
    """Energies of a loop stacked over the first loading and recovery; the work as a line."""
    found = runs(curve)[:2]
    states = np.concatenate([found[0][1], *(part[1:] for _, part in found[1:])])
    strain = from_si(curve.strain.values[states], PERCENT)
    path = strain[0] + np.append(0.0, np.cumsum(np.abs(np.diff(strain))))
    energy = curve.energy.sel(term=["bend", "contact", "stretch"]).values[states].T
    parts = dict(zip(("bend", "contact", "stretch"), energy, strict=True))
    lost = curve.dissipated.values[states]
    if lost.any():
        parts["lost to friction"] = lost
    total, work = energy.sum(0) + lost, curve.work.values[states]
    work = total[0] - work[0] + work
    ax.stackplot(
        path, *parts.values(), linewidth=0,
        colors=[ENERGY_COLOURS[name] for name in parts],
    )  # fmt: skip
    ax.plot(path, work, ":", color="black")
    ax.set_xlim(0.0, path[-1])
    ax.set_ylim(0.0, 1.08 * max(work.max(), total.max()))
    ax.yaxis.set_major_formatter(EngFormatter(sep=""))  # 50µ
    if len(found) > 1:  # out and back: the axis goes on, its numbers turn round
        turn = path[found[0][1].size - 1]
        ax.axvline(turn, color=style.GREY, linewidth=0.6)
        ticks = MaxNLocator(3).tick_values(0.0, turn)
        ticks = ticks[(ticks >= 0) & (ticks <= turn)]
        back = 2.0 * turn - ticks[::-1]
        back = back[(back > turn) & (back <= path[-1])]
        ax.set_xticks([*ticks, *back], [f"{x:g}" for x in (*ticks, *(2.0 * turn - back))])


def curvature(points):
    """Curvature (1/m) of one loop's centre line (n + 1, 3) (m) at its points, (n + 1,).

    That of the circle through each point and its neighbours; the last point is the first one of
    the next loop.
    """
    steps = np.diff(points, axis=0)
    before, after = np.roll(steps, 1, axis=0), steps
    doubled = np.linalg.norm(np.cross(before, after), axis=1)
    sides = [np.linalg.norm(side, axis=1) for side in (before, after, before + after)]
    found = 2.0 * doubled / np.prod(sides, axis=0)
    return np.append(found, found[0])


def _fabrics(fig, place, tests):
    """The reference fabric at thirds of its largest strain, its yarn coloured by curvature."""
    drawn = []
    for direction, test in tests.items():
        curve = with_centreline(test).isel(variant=0)
        states = runs(curve)[0][1]
        for share in (1, 2, 3):
            asked = curve.strain.values[states[-1]] * share / 3
            step = states[np.argmin(np.abs(curve.strain.values[states] - asked))]
            drawn.append((direction, thinned(curve.isel(step=step))))
    bent = [np.array([curvature(loop) for loop in state.centreline.values]) for _, state in drawn]
    scale = Normalize(0.0, from_si(max(values.max() for values in bent), PER_CM))
    count = len(drawn)
    *axes, bar = place.subgridspec(1, count + 1, width_ratios=[1.0] * count + [0.08]).subplots()
    direction, test = next(iter(tests.items()))
    reach = np.array(starting_spacings(test, direction)) * [1.5, 2.0]
    window = (-reach[0], reach[0], -reach[1], reach[1])
    colours = colormaps[style.TENSION_MAP]
    for ax, (direction, state), values in zip(axes, drawn, bent, strict=True):
        spacings = np.array([float(state.wale_spacing), float(state.course_spacing)])
        yarns = fabric_polylines(
            state.centreline.values, *spacings, *(2 * np.ceil(reach / spacings).astype(int) + 3),
            courses=courses_of(state),
            colours=colours(scale(from_si(values, PER_CM)))[..., :3], centred=True,
        )  # fmt: skip
        draw_tubes(ax, yarns.polylines, 0.5 * float(state.diameter), yarns.colours, window=window)
        force = from_si(float(state.force_per_width), N_PER_MM)
        broken = "\nbeyond break" if is_beyond_break(state) else ""
        ax.set_title(
            f"{direction} {from_si(float(state.strain), PERCENT):+.0f} %\n{force:.2g} N/mm{broken}",
            fontsize=7,
        )
        ax.set_xlabel("course (mm)")
        ax.set_ylabel("wale (mm)")
        ax.locator_params(nbins=3)
        if ax is not axes[0]:
            ax.yaxis.set_visible(False)
    fig.colorbar(ScalarMappable(scale, colours), cax=bar, label="curvature (1/cm)")

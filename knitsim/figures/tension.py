"""Figures 13 and 14 of the paper: the fabric pulled along the course and the wale, by both models."""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from knitsim.figures import style
from knitsim.figures.readings import (
    BREAK_COLOUR,
    break_handle,
    draw_equilibrium,
    fabric_of,
    percent_text,
    plot_loading,
    reading_label,
    reading_style,
    reference_and_printed,
    residual_handle,
    runs,
    spacing_axes,
    starting_texts,
    step_at_share,
    with_states,
)
from knitsim.figures.states import (
    BEYOND_BREAK,
    GF_PER_CM,
    N_PER_MM,
    PERCENT,
    breaking_strain,
    fabric_name,
    first_loop,
    heading,
    is_beyond_break,
    law_source,
    letter,
    loading,
    readings,
    recovery,
    thinned,
    with_centreline,
)
from knitsim.figures.style import LINES
from knitsim.figures.tubes import draw_tubes
from knitsim.units import from_si, to_si


def fig13_fabric_under_tension(
    tension_course, tension_wale, equilibrium_course=None, equilibrium_wale=None
):
    """Fabric at rest and under tension, both directions and models, to one scale."""
    tests = {
        "course": (tension_course, with_states(equilibrium_course)),
        "wale": (tension_wale, with_states(equilibrium_wale)),
    }
    rows = []
    for direction, (tension, equilibrium) in tests.items():
        rows.append((direction, _kinematic_row(tension)))
        if equilibrium is not None:
            rows.append((direction, _equilibrium_row(tension, equilibrium)))
    both = len(rows) > len(tests)
    fig, axes = style.figure(
        height_mm=20.0 + 45.0 * len(rows), rows=len(rows),
        columns=max(len(row) for _, row in rows), sharex=True, sharey=True,
    )  # fmt: skip
    heading(
        fig,
        f"Fig. 13  Fabric {fabric_name(tension_course)} under course tension (above) and wale tension"
        " (below)" + (", kinematic and in equilibrium" if both else ""),
    )
    rest = tension_course.isel(variant=0, step=0)
    reach = 1.6 * float(rest.wale_spacing), 1.95 * float(rest.course_spacing)
    for ax in axes.flat:
        ax.set_axis_off()
    for row_of_axes, (direction, row) in zip(axes, rows, strict=True):
        for ax, (model, state) in zip(row_of_axes, row, strict=False):
            if state is None:
                continue
            ax.set_axis_on()
            _draw_piece(ax, thinned(state), reach)
            broken = is_beyond_break(state)
            if broken:
                for spine in ax.spines.values():
                    spine.set(visible=True, color=BREAK_COLOUR, linewidth=1.8)
            ax.set_title(
                _piece_text(model, state, direction),
                color=BREAK_COLOUR if broken else "black", fontsize=6.5,
            )  # fmt: skip
            ax.label_outer()
    for ax in axes[:-1].flat:
        ax.xaxis.set_visible(False)
    for ax in axes[:, 1:].flat:
        ax.yaxis.set_visible(False)
    limit = from_si(breaking_strain(tension_course), PERCENT)
    fig.supxlabel(
        "All to one scale.  Closest: smallest distance of yarn centre lines, in diameters d.  Framed:"
        f" beyond the yarn's breaking strain of {limit:.3g} %.\nAs printed, the positions along the pull do"
        " not depend on it."
        + ("\nStrain 0 is the stated density in the kinematic model, in equilibrium the fabric's own"
           " state at rest." if both else ""),
        fontsize=7,
    )  # fmt: skip
    return fig


def _kinematic_row(tension):
    """[(name, state)] at rest and at thirds of the largest strain; then as printed."""
    corrected, printed = reference_and_printed(with_centreline(tension))
    row = [("corrected", corrected.isel(step=step_at_share(tension, k / 3))) for k in range(4)]
    if printed is not None:
        row.append(("as printed", printed.isel(step=step_at_share(tension, 1.0))))
    return row


def _equilibrium_row(tension, equilibrium):
    """As :func:`_kinematic_row`: at the same strains as far as they are stored, and the last state.

    A state is None where the reference condition holds none within one of its steps.
    """
    curve = with_centreline(equilibrium).isel(variant=0)
    stored = runs(curve)[0][1]
    strain = curve.strain.values[stored]
    states = []
    for k in range(4):
        away = np.abs(strain - float(tension.strain[step_at_share(tension, k / 3)]))
        near = away.min() < np.diff(strain, prepend=0.0).max()
        states.append(curve.isel(step=stored[np.argmin(away)]) if near else None)
    states.append(curve.isel(step=stored[-1]))
    return [("equilibrium", state) for state in states]


def _piece_text(model, state, direction):
    """The model, strain and force of a state, the yarn's strain, and how close yarns come."""
    force = from_si(float(state.force_per_width), N_PER_MM)
    lines = [
        model + (", beyond break" if is_beyond_break(state) else ""),
        f"{direction} {from_si(float(state.strain), PERCENT):+.0f} %",
        f"{'0' if abs(force) < 1e-9 else f'{force:.2g}'} N/mm",
        f"yarn {percent_text(float(state.yarn_strain))} %",
        f"closest {float(state.min_distance):.2f} d",
    ]
    return "\n".join(lines)


def _draw_piece(ax, state, reach):
    """Fabric that fills the window of half sizes ``reach`` (m) round the set-off loop."""
    w, c = float(state.wale_spacing), float(state.course_spacing)
    # Odd numbers, so that there is a middle; one loop more than the window holds on every side.
    wide, high = (
        2 * int(np.ceil(half / step)) + 3 for half, step in zip(reach, (w, c), strict=True)
    )
    yarns, shift = fabric_of(state, wide, high)
    points = first_loop(state)
    centre = shift + 0.5 * (points.min(0) + points.max(0)) * [1.0, 1.0, 0.0]
    window = (-reach[0], reach[0], -reach[1], reach[1])
    lines = [line - centre for line in yarns.polylines]
    draw_tubes(ax, lines, 0.5 * float(state.diameter), yarns.colours, window=window)


def fig14_fabric_tension(
    tension_course, tension_wale, equilibrium_course=None, equilibrium_wale=None
):
    """Tension against strain, loading and recovery: both models, then every kinematic reading."""
    tests = {
        "course": (tension_course, with_states(equilibrium_course)),
        "wale": (tension_wale, with_states(equilibrium_wale)),
    }
    groups = {d: _force_groups(tension) for d, (tension, _) in tests.items()}
    titles = list(dict.fromkeys(title for found in groups.values() for title in found))
    fig = style.page(height_mm=252.0)
    above, below = fig.add_gridspec(2, 1, height_ratios=[1.0, 2.0])
    overview = above.subgridspec(1, 2).subplots()
    axes = below.subgridspec(4, len(titles)).subplots(squeeze=False)
    heading(
        fig,
        f"Fig. 14  Tension of the fabric {fabric_name(tension_course)} against strain: both models, and"
        " every reading of the kinematic test",
    )
    for ax, (direction, (tension, equilibrium)) in zip(overview, tests.items(), strict=True):
        _both_models(ax, direction, tension, equilibrium, groups[direction].get(YARN_GROUP, ()))
    for i, (direction, (tension, _)) in enumerate(tests.items()):
        for j, title in enumerate(titles):
            names = groups[direction].get(title, ())
            for ax, variable in zip(
                axes[2 * i : 2 * i + 2, j], ("yarn_tension", "force_per_loop"), strict=True
            ):
                if not names:
                    ax.set_axis_off()
                    continue
                if title == FRICTION_GROUP:
                    for name in names:
                        _friction_part(ax, tension.sel(variant=name), variable)
                else:
                    _force_curves(ax, tension, names, variable)
                ax.axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
                _force_axes(ax, tension, direction, variable, j == 0)
                ax.locator_params(axis="x", nbins=4)
                if variable == "yarn_tension":  # the panel below has the same strains
                    ax.tick_params(labelbottom=False)
                else:
                    ax.set_xlabel(f"{direction} strain (%)")
                letter(ax, title if variable == "yarn_tension" else "")
    labels = {}
    for ax in fig.axes:
        labels |= dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    labels |= {
        "loading": Line2D([], [], color="black", linewidth=2.2),
        "recovery": Line2D([], [], color="black", linewidth=0.9, linestyle=LINES["recovery"]),
    } | break_handle(tension_course)
    if any(equilibrium is not None for _, equilibrium in tests.values()):
        labels |= residual_handle()
    fig.legend(
        labels.values(), labels.keys(), loc="outside lower center", ncols=3, title_fontsize=7,
        title="\n".join([law_source(tension_course), *starting_texts(*tests["course"], "course")]),
    )  # fmt: skip
    return fig


def _both_models(ax, direction, tension, equilibrium, names):
    """Force per width to a logarithmic scale; above it the spacing pulled, of either model."""
    found = readings(tension)
    for name in names:
        curve = tension.sel(variant=name)
        force = from_si(curve.force_per_width.values, N_PER_MM)
        plot_loading(
            ax, curve, force, label=reading_label(found[name]), **reading_style(found[name])
        )
    if equilibrium is not None:
        draw_equilibrium(
            ax, equilibrium, from_si(equilibrium.force_per_width, N_PER_MM), residual=True
        )
    spacing_axes(ax, direction, tension, equilibrium)
    ax.set_yscale("log")
    ax.set_ylim(*LOG_FORCES)
    ax.set_xlim(left=0.0)
    ax.set_xlabel(f"{direction} strain (%)")
    ax.set_ylabel("force per width (N/mm)")
    side = ax.secondary_yaxis(
        "right",
        functions=(
            lambda force: from_si(to_si(force, N_PER_MM), GF_PER_CM),
            lambda force: from_si(to_si(force, GF_PER_CM), N_PER_MM),
        ),
    )
    side.set_ylabel("force per width (gf/cm)")
    for axis in (ax.yaxis, side.yaxis):  # plain numbers, as textile engineers write them
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(NullLocator())
    ax.grid(axis="y")
    if equilibrium is not None and names:
        _say_gap(ax, tension.sel(variant=names[0]), equilibrium.isel(variant=0))


LOG_FORCES = 1e-3, 20.0  # N/mm


def _say_gap(ax, kinematic, equilibrium):
    """How far the models lie apart where the kinematic one, on loading, is about to break."""
    up = loading(kinematic)
    step = up[kinematic.status.values[up] != BEYOND_BREAK][-1]
    strain, high = float(kinematic.strain[step]), float(kinematic.force_per_width[step])
    states = runs(equilibrium)[0][1]
    known = equilibrium.strain.values[states]
    if not (high > 0 and known[0] <= strain <= known[-1]):
        return
    low = np.interp(strain, known, equilibrium.force_per_width.values[states])
    x = from_si(strain, PERCENT)
    high, low = from_si(np.array([high, low]), N_PER_MM)
    ax.annotate(
        "", (x, low), (x, high),
        arrowprops={"arrowstyle": "<->", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    ax.annotate(
        f"{high / low:.0f} times", (x, np.sqrt(high * low)), (4, 0), textcoords="offset points",
        va="center", fontsize=7,
    )  # fmt: skip


YARN_GROUP, FABRIC_GROUP = "strain of the yarn", "strain of the fabric"
PRINTED_GROUP, FRICTION_GROUP = "printed positions, k$_3$", "part of F = c v"


def _force_groups(tension):
    """{title of the panel: variants}, so that every reading can be read."""
    groups = {YARN_GROUP: [], FABRIC_GROUP: [], PRINTED_GROUP: [], FRICTION_GROUP: []}
    for name, choices in readings(tension).items():
        if choices["viscous"]:
            groups[FRICTION_GROUP].append(name)
        elif "printed" in (choices["positions"], choices["law"]):
            groups[PRINTED_GROUP].append(name)
        else:
            groups[FABRIC_GROUP if choices["strain"] == "fabric" else YARN_GROUP].append(name)
    return {title: names for title, names in groups.items() if names}


def _force_curves(ax, tension, names, variable):
    """Loading and recovery of these readings; the states beyond the breaking strain dotted."""
    found = readings(tension)
    strain = from_si(tension.strain.values, PERCENT)
    up, down = loading(tension), recovery(tension)
    ends = []
    for name in names:
        curve, look = tension.sel(variant=name), reading_style(found[name])
        force = curve[variable].values
        end = plot_loading(
            ax, curve, force, label=reading_label(found[name]), linewidth=2.4, **look
        )
        ends.append(end or (strain.max(), 0.0))
        valid = np.where(curve.status.values == BEYOND_BREAK, np.nan, force)
        ax.plot(
            strain[down], valid[down], color="black", linewidth=0.8, linestyle=LINES["recovery"]
        )
    if ends and max(ends)[0] < 0.4 * strain.max():
        # All yarns break early: show that part, and say where the rest goes.
        x, y = 2.5 * np.max(ends, axis=0)
        ax.set_xlim(0.0, x)
        ax.set_ylim(-0.04 * y, y)
        ax.annotate(
            f"to {force[up[-1]]:.3g} N\nat {strain.max():.3g} %",
            (0.98, 0.08), xycoords="axes fraction", ha="right", fontsize=6.5,
        )  # fmt: skip


def _friction_part(ax, curve, variable):
    """Half of what loading and recovery differ by, at the same strain."""
    up, down = loading(curve)[:-1], recovery(curve)[:0:-1]
    strain, force = from_si(curve.strain.values, PERCENT), curve[variable].values
    half = 0.5 * (force[up] - force[down])
    ax.plot(strain[up], half, color=style.BLACK, linewidth=2.2)
    ax.plot(strain[up], -half, color=style.BLACK, linewidth=0.9, linestyle=LINES["recovery"])


def _force_axes(ax, tension, direction, variable, first):
    """Labels of the force; in the first column, beside that of a loop, per width of the fabric."""
    if not first:
        return
    if variable == "yarn_tension":
        ax.set_ylabel("yarn tension (N)")
        return
    ax.set_ylabel("force that does the work,\nper loop (N)")
    # Across the pull along the courses lie the courses themselves, a course spacing apart.
    across = tension[f"{direction}_spacing"].values.flat[0]
    side = ax.secondary_yaxis(
        "right",
        functions=(
            lambda force: from_si(force / across, N_PER_MM),
            lambda force: to_si(force, N_PER_MM) * across,
        ),
    )
    side.set_ylabel("per width (N/mm)")

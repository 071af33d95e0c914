"""Figures 6 to 9, 13 and 14 of the paper: the fabric pulled along the course and the wale.

Every function takes result files of the tensile tests as xarray datasets and returns a matplotlib
Figure.  ``FIGURES`` maps the stem of a figure's files to its function and the inputs it needs.
"""

import numpy as np
from matplotlib.lines import Line2D

from knitsim.figures import style
from knitsim.figures.loop_tension import (
    fig06_course_deformation,
    fig07_course_contraction,
    fig08_wale_deformation,
    fig09_wale_contraction,
)
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
    step_at_share,
)
from knitsim.figures.states import (
    BEYOND_BREAK,
    N_PER_MM,
    PERCENT,
    breaking_strain,
    fabric_name,
    heading,
    is_beyond_break,
    law_source,
    letter,
    loading,
    readings,
    recovery,
    settled,
    with_centreline,
)
from knitsim.figures.style import LINES
from knitsim.figures.tubes import draw_tubes
from knitsim.units import from_si, to_si


def fig13_fabric_under_tension(tension_course, tension_wale):
    """Fabric at rest and under tension, both directions, corrected and as printed, to one scale."""
    rows = {}
    for direction, tension in (("course", tension_course), ("wale", tension_wale)):
        corrected, printed = reference_and_printed(with_centreline(tension))
        rows[direction] = [
            ("corrected", corrected.isel(step=step_at_share(tension, k / 3))) for k in range(4)
        ]
        if printed is not None:
            rows[direction].append(("as printed", printed.isel(step=step_at_share(tension, 1.0))))
    columns = max(len(row) for row in rows.values())
    fig, axes = style.figure(height_mm=118.0, rows=2, columns=columns, sharex=True, sharey=True)
    heading(
        fig,
        f"Fig. 13  Fabric {fabric_name(tension_course)} under course tension (above) and wale tension"
        " (below)",
    )
    rest = rows["course"][0][1]
    reach = 1.6 * float(rest.wale_spacing), 1.95 * float(rest.course_spacing)
    for ax in axes.flat:
        ax.set_axis_off()
    for row_of_axes, (direction, row) in zip(axes, rows.items(), strict=True):
        for ax, (what, state) in zip(row_of_axes, row, strict=False):
            ax.set_axis_on()
            _draw_piece(ax, state, reach)
            broken = is_beyond_break(state)
            if broken:
                for spine in ax.spines.values():
                    spine.set(visible=True, color=BREAK_COLOUR, linewidth=1.8)
            ax.set_title(
                f"{what}{', beyond break' if broken else ''}\n"
                f"{direction} {from_si(float(state.strain), PERCENT):+.0f} %\n"
                f"yarn {percent_text(float(state.yarn_strain))} %\n"
                f"closest {float(state.min_distance):.2f} d",
                color=BREAK_COLOUR if broken else "black", fontsize=7.0,
            )  # fmt: skip
            ax.label_outer()
    limit = from_si(breaking_strain(tension_course), PERCENT)
    fig.supxlabel(
        "All to one scale.  Closest: smallest distance of yarn centre lines, in diameters d.  Framed:"
        f" beyond the yarn's breaking strain of {limit:.3g} %.\nAs printed, the positions along the pull do"
        " not depend on it.",
        fontsize=7,
    )
    return settled(fig)


def _draw_piece(ax, state, reach):
    """Fabric that fills the window of half sizes ``reach`` (m) round the set-off loop."""
    w, c = float(state.wale_spacing), float(state.course_spacing)
    # Odd numbers, so that there is a middle; one loop more than the window holds on every side.
    wide, high = (
        2 * int(np.ceil(half / step)) + 3 for half, step in zip(reach, (w, c), strict=True)
    )
    yarns, shift = fabric_of(state, wide, high)
    points = state.centreline.values
    centre = shift + 0.5 * (points.min(0) + points.max(0)) * [1.0, 1.0, 0.0]
    window = (-reach[0], reach[0], -reach[1], reach[1])
    lines = [line - centre for line in yarns.polylines]
    draw_tubes(ax, lines, 0.5 * float(state.diameter), yarns.colours, window=window)


def fig14_fabric_tension(
    tension_course, tension_wale, equilibrium_course=None, equilibrium_wale=None
):
    """Tension against strain, loading and recovery: the paper's k3 strain and the force of work."""
    tests = {
        "course": (tension_course, equilibrium_course), "wale": (tension_wale, equilibrium_wale)
    }  # fmt: skip
    groups = {d: _force_groups(tension) for d, (tension, _) in tests.items()}
    titles = list(dict.fromkeys(title for found in groups.values() for title in found))
    fig, axes = style.figure(height_mm=205.0, rows=4, columns=len(titles))
    heading(
        fig,
        f"Fig. 14  Tension of the fabric {fabric_name(tension_course)} against strain, every reading"
        " of the test",
    )
    for i, (direction, (tension, equilibrium)) in enumerate(tests.items()):
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
                if equilibrium is not None and j == 0:
                    draw_equilibrium(ax, equilibrium, equilibrium[variable])
                ax.axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
                ax.set_xlabel(f"{direction} strain (%)")
                _force_axes(ax, tension, direction, variable, j == 0, j == len(titles) - 1)
                ax.locator_params(axis="x", nbins=4)
                letter(ax, title if variable == "yarn_tension" else "")
    labels = {}
    for ax in axes.flat:
        labels |= dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    labels |= {
        "loading": Line2D([], [], color="black", linewidth=2.2),
        "recovery": Line2D([], [], color="black", linewidth=0.9, linestyle=LINES["recovery"]),
    } | break_handle(tension_course)
    fig.legend(
        labels.values(), labels.keys(), loc="outside lower center", ncols=3, title=law_source(tension_course),
        title_fontsize=7,
    )  # fmt: skip
    return settled(fig)


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


def _force_axes(ax, tension, direction, variable, first, last):
    """Labels of the force; beside the force of a loop that per width of the fabric."""
    if variable == "yarn_tension":
        ax.set_ylabel("yarn tension (N)" if first else "")
        return
    ax.set_ylabel("force that does the work,\nper loop (N)" if first else "")
    # Across the pull along the courses lie the courses themselves, a course spacing apart.
    across = tension[f"{direction}_spacing"].values.flat[0]
    side = ax.secondary_yaxis(
        "right",
        functions=(
            lambda force: from_si(force / across, N_PER_MM),
            lambda force: to_si(force, N_PER_MM) * across,
        ),
    )
    side.set_ylabel("force per width (N/mm)" if last else "")


FIGURES = {
    "fig06_course_deformation": (fig06_course_deformation, ("tension_course",)),
    "fig07_course_contraction": (fig07_course_contraction, ("tension_course",)),
    "fig08_wale_deformation": (fig08_wale_deformation, ("tension_wale",)),
    "fig09_wale_contraction": (fig09_wale_contraction, ("tension_wale",)),
    "fig13_fabric_under_tension": (
        fig13_fabric_under_tension,
        ("tension_course", "tension_wale"),
    ),
    "fig14_fabric_tension": (fig14_fabric_tension, ("tension_course", "tension_wale")),
}

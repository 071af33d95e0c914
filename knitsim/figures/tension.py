"""The fabric pulled along the course and the wale: in short, and Figures 13 and 14 of the paper."""

import numpy as np

from knitsim.figures import panels, readings, solved, stored, style
from knitsim.figures.style import COLOURS, LINES
from knitsim.figures.tubes import draw_tubes
from knitsim.units import from_si


def recovering(test):
    """The condition that shows load and extension best, one variant: the one that is let go again.

    With friction rather than without, to a force rather than to a strain; else the reference.
    """
    found = stored.readings(test)

    def worth(name):
        choices = found[name]
        return choices["recovery"], choices["friction"], choices["to_force"] is not None

    return test.sel(variant=max(found, key=worth))


def fig00_load_extension(equilibrium_course, equilibrium_wale):
    """Load against extension in both directions, out and back, to linear scales."""
    tests = {
        "course": solved.with_states(equilibrium_course),
        "wale": solved.with_states(equilibrium_wale),
    }
    fig, axes = style.figure(width_mm=130.0, height_mm=92.0)
    ax = axes[0, 0]
    panels.heading(fig, "load and extension, equilibrium model", about=equilibrium_course)
    handles, recovered, labels = {}, {}, []
    for number, (direction, test) in enumerate(tests.items()):
        if test is None:
            continue
        curve, colour = recovering(test), COLOURS[direction]
        strain = from_si(curve.strain.values, "percent")
        force = from_si(curve.force_per_width.values, "gf_per_cm")
        for phase, states in solved.runs(curve):
            [line] = ax.plot(
                strain[states], force[states], LINES[phase], color=colour, linewidth=1.8
            )
            handles.setdefault(f"pulled along the {direction}", line)
        top = int(np.nanargmax(force))
        said = [f"{direction}: {strain[top]:.0f} % at {force[top]:.3g} gf/cm"]
        if solved.is_recovered(curve):
            left = strain[solved.runs(curve)[-1][1][-1]]
            ax.plot(left, 0.0, "D", color=colour, markerfacecolor="white", clip_on=False, zorder=5)
            said.append(f"{left:.1f} % left")
            recovered = panels.RECOVERY | solved.residual_handle()
        labels.append((", ".join(said), strain[top], force[top], 3 + 10 * number, colour))
    for text, x, y, above, colour in labels:
        # Towards the middle, so that no label runs over an axis.
        side = "right" if x > 0.5 * max(label[1] for label in labels) else "left"
        panels.say(ax, text, (x, y), (0, above), ha=side, color=colour, va="bottom")
    ax.set_xlim(left=0.0)
    ax.set_ylim(0.0, 1.12 * ax.get_ylim()[1])
    ax.set_xlabel("extension (%)")
    ax.set_ylabel("load per width (gf/cm)")
    panels.second_axis(ax, "gf_per_cm", "N_per_mm", "load per width (N/mm)")
    ax.grid(True)
    panels.legend(fig, handles | recovered, ncols=2, note="\n".join(solved.ended(tests)))
    return fig


def fig13_fabric_under_tension(
    tension_course, tension_wale, equilibrium_course=None, equilibrium_wale=None
):
    """Fabric at rest and under tension, both directions and models, to one scale."""
    tests = {
        "course": (tension_course, solved.with_states(equilibrium_course)),
        "wale": (tension_wale, solved.with_states(equilibrium_wale)),
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
    panels.heading(
        fig,
        "under course tension (above) and wale tension" + ", in both models" * both,
        13,
        tension_course,
    )
    rest = tension_course.isel(variant=0, step=0)
    reach = 1.6 * float(rest.wale_spacing), 1.95 * float(rest.course_spacing)
    for ax in axes.flat:
        ax.set_axis_off()
    keys = iter(panels.LETTERS)
    for row_of_axes, (direction, row) in zip(axes, rows, strict=True):
        for ax, (model, state) in zip(row_of_axes, row, strict=False):
            if state is None:
                continue
            ax.set_axis_on()
            _draw_piece(ax, stored.thinned(state), reach)
            broken = stored.is_beyond_break(state)
            if broken:
                for spine in ax.spines.values():
                    spine.set(visible=True, color=readings.BREAK_COLOUR, linewidth=1.8)
            ax.set_title(
                f"({next(keys)}) {_piece_text(model, state, direction)}",
                color=readings.BREAK_COLOUR if broken else "black", fontsize=6.5,
            )  # fmt: skip
            ax.label_outer()
    for ax in axes[:-1].flat:
        ax.xaxis.set_visible(False)
    for ax in axes[:, 1:].flat:
        ax.yaxis.set_visible(False)
    limit = from_si(stored.breaking_strain(tension_course), "percent")
    panels.note(
        fig,
        "All to one scale.  Closest: smallest distance of yarn centre lines, in diameters d.  Framed:"
        f" beyond the yarn's break at {limit:.3g}\u00a0%.\nAs printed, the positions along the pull do"
        " not depend on it."
        + ("\nStrain 0 is the stated density in the kinematic model, in equilibrium the fabric's own"
           " state at rest." if both else ""),
    )  # fmt: skip
    return fig


def _kinematic_row(tension):
    """[(name, state)] at rest and at thirds of the largest strain; then as printed."""
    corrected, printed = readings.reference_and_printed(stored.with_centreline(tension))
    row = [
        ("kinematic", corrected.isel(step=readings.step_at_share(tension, k / 3))) for k in range(4)
    ]
    if printed is not None:
        row.append(
            ("kinematic as printed", printed.isel(step=readings.step_at_share(tension, 1.0)))
        )
    return row


def _equilibrium_row(tension, equilibrium):
    """As :func:`_kinematic_row`: at the same strains as far as they are stored, and the last state.

    A state is None where the reference condition holds none within one of its steps.
    """
    curve = stored.with_centreline(equilibrium).isel(variant=0)
    reached = solved.runs(curve)[0][1]
    strain = curve.strain.values[reached]
    states = []
    for k in range(4):
        away = np.abs(strain - float(tension.strain[readings.step_at_share(tension, k / 3)]))
        near = away.min() < np.diff(strain, prepend=0.0).max()
        states.append(curve.isel(step=reached[np.argmin(away)]) if near else None)
    states.append(curve.isel(step=reached[-1]))
    return [("equilibrium", state) for state in states]


def _piece_text(model, state, direction):
    """The model, strain and force of a state, the yarn's strain, and how close yarns come."""
    force = from_si(float(state.force_per_width), "N_per_mm")
    lines = [
        model + (", beyond break" if stored.is_beyond_break(state) else ""),
        f"{direction} {from_si(float(state.strain), 'percent'):+.0f} %",
        f"{'0' if abs(force) < 1e-9 else f'{force:.2g}'} N/mm",
        f"yarn {readings.percent_text(float(state.yarn_strain))} %",
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
    yarns, shift = readings.fabric_of(state, wide, high)
    points = stored.first_loop(state)
    centre = shift + 0.5 * (points.min(0) + points.max(0)) * [1.0, 1.0, 0.0]
    window = (-reach[0], reach[0], -reach[1], reach[1])
    lines = [line - centre for line in yarns.polylines]
    draw_tubes(ax, lines, 0.5 * float(state.diameter), yarns.colours, window=window)


def fig14_fabric_tension(
    tension_course, tension_wale, equilibrium_course=None, equilibrium_wale=None
):
    """Force against strain: both models, the small forces, and the paper's readings of yarn tension."""
    tests = {
        "course": (tension_course, solved.with_states(equilibrium_course)),
        "wale": (tension_wale, solved.with_states(equilibrium_wale)),
    }
    both = any(equilibrium is not None for _, equilibrium in tests.values())
    fabric = [t for t, _ in tests.values() if _by_strain(t, "fabric")]
    rows = ["force"] + ["small"] * both + ["yarn"] + ["fabric"] * bool(fabric)
    fig, axes = style.figure(height_mm=60.0 + 47.0 * len(rows), rows=len(rows), columns=2)
    panels.heading(
        fig, f"pulled along course and wale: {'both models, and ' * both}the paper's readings", 14,
        tension_course,
    )  # fmt: skip
    for column, (direction, (tension, equilibrium)) in enumerate(tests.items()):
        for row, what in enumerate(rows):
            ax = axes[row, column]
            title = _DRAW[what](ax, direction, tension, equilibrium)
            # Above the second axis, if there is one.
            y = 1.3 if what == "force" else 1.02
            panels.letter(ax, panels.LETTERS[2 * row + column], f"{direction}: {title}", y)
            ax.set_xlabel(f"{direction} strain (%)")
            ax.axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
    lines = [
        stored.law_source(tension_course),
        *readings.starting_texts(*tests["course"], "course"),
    ]
    lines += _viscous(tension_course)
    handles = panels.labelled(axes.flat) | readings.break_handle(tension_course, axes.flat)
    if both:
        handles |= panels.RECOVERY | solved.residual_handle()
    panels.legend(fig, handles, ncols=2, note="\n".join(lines))
    return fig


def _by_strain(tension, strain):
    """Readings without F = c v that take the strain of the ``yarn`` or of the ``fabric``."""
    return {
        name: choices
        for name, choices in stored.readings(tension).items()
        if choices["strain"] == strain and not choices["viscous"]
    }


def _kinematic(ax, tension, names, variable, unit):
    """The readings on loading; each thinner than the one before, so that equal ones both show."""
    ends = []
    for k, (name, choices) in enumerate(names.items()):
        curve, look = tension.sel(variant=name), readings.reading_style(choices)
        look["linewidth"] = max(1.0, 2.6 - 0.5 * k)
        values = from_si(curve[variable].values, unit)
        ends.append(
            readings.plot_loading(ax, curve, values, label=readings.reading_label(choices), **look)
        )
    return ends


def _force(ax, direction, tension, equilibrium):
    """All forces per width; above them the spacing pulled."""
    names = readings.contractions(tension)
    _kinematic(ax, tension, names, "force_per_width", "N_per_mm")
    if equilibrium is not None:
        solved.draw(ax, equilibrium, from_si(equilibrium.force_per_width, "N_per_mm"), "percent")
        _say_gap(ax, tension.sel(variant=next(iter(names))), equilibrium.isel(variant=0))
    ax.set_xlim(left=0.0)
    ax.set_ylabel("force per width (N/mm)")
    readings.spacing_axis(ax, direction, tension, equilibrium)
    return "force"


def _small(ax, direction, tension, equilibrium):
    """The same up to the forces of the condition that recovers; the kinematic ones leave the panel."""
    _kinematic(ax, tension, readings.contractions(tension), "force_per_width", "N_per_mm")
    if equilibrium is not None:
        solved.draw(
            ax,
            equilibrium,
            from_si(equilibrium.force_per_width, "N_per_mm"),
            "percent",
            residual=True,
        )
        shown = recovering(equilibrium)
        ax.set_ylim(0.0, 1.15 * from_si(float(shown.force_per_width.max()), "N_per_mm"))
        ax.set_xlim(0.0, 1.25 * from_si(float(shown.strain.max()), "percent"))
    ax.set_ylabel("force per width (N/mm)")
    panels.second_axis(ax, "N_per_mm", "gf_per_cm", "force per width (gf/cm)")
    return "the small forces"


def _yarn(ax, direction, tension, _):
    """Tension of the yarn, which the paper plots."""
    _kinematic(ax, tension, _by_strain(tension, "yarn"), "yarn_tension", "N")
    ax.set_ylabel("yarn tension (N)")
    return "tension of the yarn"


def _fabric(ax, direction, tension, _):
    """The same with the strain of the fabric put for that of the yarn: the yarn breaks early."""
    names = _by_strain(tension, "fabric")
    ends = [end for end in _kinematic(ax, tension, names, "yarn_tension", "N") if end is not None]
    ax.set_ylabel("yarn tension (N)")
    if not names:
        ax.set_axis_off()
        return "no reading"
    top = from_si(float(tension.strain.max()), "percent")
    if ends and max(ends)[0] < 0.4 * top:
        x, y = 2.5 * np.max(ends, axis=0)
        ax.set(xlim=(0.0, x), ylim=(-0.04 * y, y))
        largest = max(float(tension.yarn_tension.sel(variant=name).max()) for name in names)
        text = f"to {largest:.3g} N at {top:.3g} %"
        panels.say(ax, text, (0.98, 0.1), xycoords="axes fraction", ha="right")
    return "the same, by the fabric's strain"


_DRAW = {"force": _force, "small": _small, "yarn": _yarn, "fabric": _fabric}


def _viscous(tension):
    """What F = c v adds, in words; its force depends on nothing else."""
    name = next(
        (name for name, choices in stored.readings(tension).items() if choices["viscous"]), None
    )
    if name is None:
        return []
    force = float(tension.friction_force.sel(variant=name).max())
    return [
        f"F = c v adds {force:.3g} N to the yarn's tension on loading and takes as much off on recovery;"
        " else the paper's recovery retraces its loading."
    ]


def _say_gap(ax, kinematic, equilibrium):
    """How far the models lie apart where the kinematic one, on loading, is about to break."""
    up = stored.loading(kinematic)
    step = up[kinematic.status.values[up] != stored.BEYOND_BREAK][-1]
    strain, high = float(kinematic.strain[step]), float(kinematic.force_per_width[step])
    states = solved.runs(equilibrium)[0][1]
    known = equilibrium.strain.values[states]
    if not (high > 0 and known[0] <= strain <= known[-1]):
        return
    low = np.interp(strain, known, equilibrium.force_per_width.values[states])
    x, high, low = from_si(strain, "percent"), from_si(high, "N_per_mm"), from_si(low, "N_per_mm")
    panels.arrow(ax, (x, low), (x, high))
    panels.say(ax, f"{high / low:.0f} times", (x, 0.5 * high), (4, 0))

"""Figures 6 to 9 of the paper: one loop and its sections, pulled along the course and the wale.

What is the paper's own is drawn as ``printed``, what is right as ``corrected``.
"""

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.patheffects import withStroke

from knitsim.figures import panels, readings, stored, style
from knitsim.figures.solved import draw, with_states
from knitsim.figures.style import COLOURS, YARN_COLOURS
from knitsim.figures.tubes import draw_tubes
from knitsim.units import from_si

AXES = {"course": 0, "wale": 1}
SYMBOL = {"course": "z", "wale": "y"}  # the paper's coordinates
SECTION_EVERY = 0.05  # of the loop: distance of the sections painted on the yarn


def _marked_sections(direction, count):
    """{letter: number of the point} of the sections that the figures name.

    Along the course as in Fig. 6: edges A and C, centre O in the head, B and D halfway.  Along the wale
    the bottom O stays, from which the paper measures h, and H is the top.
    """
    quarter = round(0.25 * count), count - round(0.25 * count)
    if direction == "course":
        return {"A": 0, "B": quarter[0], "O": count // 2, "D": quarter[1], "C": count}
    return {"O": 0, "B": quarter[0], "H": count // 2, "D": quarter[1]}


def _paint_sections(yarns, row, begin, count, marks):
    """Rings on the set-off loop: its sections, and in another colour the named ones."""
    every = max(2, round(SECTION_EVERY * count))
    colours = yarns.colours[row]
    colours[begin : begin + count + 1 : every] = np.array(to_rgb(YARN_COLOURS["dark"]))
    for point in marks.values():
        colours[begin + point] = to_rgb(style.YELLOW)


def _window(states, rest):
    """left, right, bottom, top (m) that hold the set-off loop in all these states, and letters."""
    points = np.concatenate([state.centreline.values for state in states])
    d = float(rest.diameter)
    # Room for the letters of the sections above and below.
    low, high = points.min(0)[:2] - [2.0 * d, 2.2 * d], points.max(0)[:2] + [2.0 * d, 2.9 * d]
    # Wide enough for the panel's heading above it.
    wider = max(0.0, 0.5 * (1.1 * (high[1] - low[1]) - (high[0] - low[0])))
    return low[0] - wider, high[0] + wider, low[1], high[1]


def _draw_loop(ax, state, direction, window, *, alone=False, colour=None):
    """A loop with its sections painted on, in its fabric or alone, as solid yarns."""
    count = state.sizes["point"] - 1
    yarns, shift = readings.fabric_of(state, 5, 5, colour)
    _paint_sections(yarns, 2, 2 * count, count, _marked_sections(direction, count))
    lines, colours = [line - shift for line in yarns.polylines], yarns.colours
    if alone:
        begin = slice(2 * count, 3 * count + 1)
        lines, colours = [lines[2][begin]], [colours[2][begin]]
    return draw_tubes(ax, lines, 0.5 * float(state.diameter), colours, "face", window=window)


def _letter_sections(ax, state, direction):
    """The letters of the named sections beside the loop."""
    points = from_si(state.centreline.values[:, :2], "mm")
    middle = points[:, 0].mean()
    for name, point in _marked_sections(direction, len(points) - 1).items():
        x, y = points[point]
        aside = 0.0 if abs(x - middle) < 0.1 * np.ptp(points[:, 0]) else np.sign(x - middle)
        above = 0.0 if name in "BD" else 1.0 if y > points[:, 1].mean() else -1.0
        _badge(ax, name, (x, y), (15.0 * aside, 14.0 * above))


def _badge(ax, name, where, offset):
    panels.say(
        ax, name, where, offset, ha="center", fontweight="bold",
        bbox={"boxstyle": "circle,pad=0.15", "facecolor": "white", "linewidth": 0.5},
        arrowprops={"arrowstyle": "-", "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip


def _strain_axis(ax, direction):
    ax.set_xlabel(f"{direction} strain of the fabric (%)")


def _deformation(tension, direction, number):
    """Figs 6 and 8: sections of the loop before and under tension, corrected and as printed."""
    tension = stored.one_loop(tension)
    corrected, printed = readings.reference_and_printed(tension)
    along, symbol = AXES[direction], SYMBOL[direction]
    rest = corrected.isel(step=0)
    half = readings.step_at_share(tension, 0.5)
    fig, axes = style.figure(height_mm=128.0, rows=2, columns=3)
    panels.heading(
        fig, f"sections of the loop under {direction} tension, corrected against printed eq ({4 + along})",
        number, tension,
    )  # fmt: skip
    pictures = [("starting state", rest), ("corrected", corrected.isel(step=half))]
    if printed is not None:
        pictures.append(("as printed", printed.isel(step=half)))
    else:
        axes[0, 2].set_axis_off()
    window = _window([state for _, state in pictures], rest)
    for ax, key, (what, state) in zip(axes[0], "abc", pictures, strict=False):
        _draw_loop(ax, state, direction, window)
        _letter_sections(ax, state, direction)
        panels.letter(ax, key, f"{what}\n{readings.state_text(state)}")

    start = rest.centreline.values[:, along]
    count = start.size - 1
    marks = _marked_sections(direction, count)
    position = from_si(start - start[marks["O"]], "mm")
    order = np.argsort(position, kind="stable")
    shown = [(corrected, step, COLOURS["corrected"]) for step in
             (half, readings.step_at_share(tension, 1.0))]  # fmt: skip
    if printed is not None:
        shown.append((printed, half, COLOURS["printed"]))
    for curve, step, colour in shown:
        moved = curve.centreline.values[step, :, along]
        broken = stored.is_beyond_break(curve.isel(step=step))
        line = ":" if broken else readings.PRINTED_LINE if colour == COLOURS["printed"] else "-"
        axes[1, 0].plot(
            position[order], from_si(moved - start, "mm")[order], color=colour, linestyle=line
        )
        # Sections that lie side by side, where the loop does not turn back.
        across = np.diff(start)
        kept = np.abs(across) > 0.2 * np.abs(across).mean()
        between = 0.5 * (position[1:] + position[:-1])[kept]
        local = (np.diff(moved)[kept] / across[kept])[np.argsort(between, kind="stable")]
        axes[1, 1].plot(np.sort(between), local, color=colour, linestyle=line)
        if colour != COLOURS["printed"]:
            ratio = 1.0 + float(tension.strain[step])
            last = from_si((moved - start)[np.argmax(position)], "mm")
            said = f"r = {ratio:.2f}" + ", beyond break" * broken
            look = {"fontsize": 6.5, "color": readings.BREAK_COLOUR if broken else colour}
            text = said.replace(", ", "\n")
            panels.say(axes[1, 0], text, (position.max(), last), (3, 0), **look)
            middle = 0.5 * (position.min() + position.max())
            look |= {"ha": "center", "va": "bottom", "bbox": panels.PLAIN}
            panels.say(axes[1, 1], said, (middle, ratio), (0, 2), **look)
    for ax in axes[1, :2]:
        ax.set_xlabel(f"position {symbol} - {symbol}$_O$ along the {direction} (mm)")
        ax.set_xlim(right=position.max() + 0.24 * np.ptp(position))
        levels = {}
        for name, point in marks.items():
            levels.setdefault(round(position[point], 3), []).append(name)
        for x, names in levels.items():
            ax.axvline(x, color="#CCCCCC", linewidth=0.6, zorder=0)
            look = {"xycoords": ax.get_xaxis_transform(), "ha": "center", "va": "bottom"}
            panels.say(ax, ", ".join(names), (x, 1.0), (0, 1), fontweight="bold", **look)
    axes[1, 0].set_ylabel(f"displacement {symbol}' - {symbol} (mm)")
    axes[1, 1].margins(y=0.15)  # room for the letters of the sections
    axes[1, 1].set_ylabel(f"local stretch d{symbol}'/d{symbol} (1)")
    panels.letter(axes[1, 0], "d", "displacement of the sections", y=1.09)
    panels.letter(axes[1, 1], "e", "stretch between sections", y=1.09)
    ax = axes[1, 2]
    ratio = "OB/OC" if direction == "course" else "h/H"
    for curve, colour, line, text in (
        (corrected, COLOURS["corrected"], "-",
         f"corrected: {symbol}' = {symbol}$_O$ + r ({symbol} - {symbol}$_O$)"),
        (printed, COLOURS["printed"], readings.PRINTED_LINE,
         f"as printed: B' = B {ratio}, the same for every r, the edge stays"),
    ):  # fmt: skip
        if curve is not None:
            readings.plot_loading(
                ax, curve, curve.min_distance.values, color=colour, linestyle=line, label=text
            )
    ax.axhline(1.0, color=style.GREY, linewidth=0.8, linestyle=":")
    panels.say(ax, "yarns touch", (0, 1.0), (2, 2), fontsize=6.5, va="bottom")
    ax.set_ylim(0.0, 1.15)
    _strain_axis(ax, direction)
    ax.set_ylabel("closest centre lines (diameters)")
    panels.letter(ax, "f", "do the yarns overlap?", y=1.09)
    panels.legend(fig, panels.labelled([ax]) | readings.break_handle(tension, [ax]), ncols=2)
    return fig


def _contraction(tension, direction, number, equilibrium):
    """Figs 7 and 9: how a section moves along and across the pull, and the contraction laws."""
    tension, equilibrium = stored.one_loop(tension), with_states(equilibrium)
    corrected, _ = readings.reference_and_printed(tension)
    along, across = AXES[direction], AXES[readings.OTHER[direction]]
    shown = readings.contractions(tension)
    up = stored.loading(tension)
    # The jam: the loop has contracted as far as it can.
    scale = 1.0 + corrected.transverse_strain.values[up]
    jam = up[np.argmax(scale <= scale.min() * (1.0 + 1e-9))]
    rest, pulled = corrected.isel(step=0), corrected.isel(step=jam)
    fig, axes = style.figure(height_mm=150.0, rows=2, columns=2)
    panels.heading(fig, f"contraction of the loop under {direction} tension", number, tension)

    _draw_section_path(axes[0, 0], rest, pulled, direction)
    panels.letter(
        axes[0, 0], "a", f"at rest (pale), at the limit (red)\n{readings.state_text(pulled)}"
    )
    b = _marked_sections(direction, rest.sizes["point"] - 1)["B"]

    ax = axes[0, 1]
    limits = {}
    for k, (name, choices) in enumerate(shown.items()):
        curve = tension.sel(variant=name)
        # Readings that coincide stay visible: each is thinner than the one before.
        look = readings.reading_style(choices) | {"linewidth": max(1.2, 2.8 - 0.8 * k)}
        if choices["positions"] == "corrected":
            limits.setdefault(_limit(curve, choices), choices)
            scale = 1.0 + curve.transverse_strain.values
            readings.plot_loading(ax, curve, scale, **look, label=readings.reading_label(choices))
        moved = from_si(curve.centreline.values[:, b] - rest.centreline.values[b], "mm")
        for panel, axis in ((axes[1, 0], along), (axes[1, 1], across)):
            readings.plot_loading(
                panel, curve, moved[:, axis], **look, label=readings.reading_label(choices)
            )
    for limit, choices in limits.items():
        ax.axhline(limit, color=style.GREY, linewidth=0.8, linestyle=":")
        text = f"{limit:.3g}: " + (
            f"half the {'height' if direction == 'course' else 'wale spacing'}"
            if choices["limit"] == "half" else "one course spacing shorter"
        )  # fmt: skip
        panels.say(ax, text, (0, limit), (2, -2), va="top", fontsize=6.5)
    if equilibrium is not None:
        draw(ax, equilibrium, 1.0 + equilibrium.transverse_strain, "percent")
    ax.set_ylim(0.0, 1.05)
    ax.set_ylabel(f"scale along the {readings.OTHER[direction]} (1)")
    readings.spacing_axis(ax, direction, tension, equilibrium)
    panels.letter(ax, "b", "contraction laws and their limits", y=1.27)
    for ax, axis, key in (
        (axes[1, 0], direction, "c"),
        (axes[1, 1], readings.OTHER[direction], "d"),
    ):
        ax.axhline(0.0, color=style.GREY, linewidth=0.6, zorder=0)
        ax.set_ylabel(f"displacement {SYMBOL[axis]}' - {SYMBOL[axis]} (mm)")
        panels.letter(ax, key, f"section B along the {axis}")
    for ax in axes.flat[1:]:
        _strain_axis(ax, direction)
    handles = panels.labelled([axes[1, 0], axes[0, 1]]) | readings.break_handle(tension, axes.flat)
    if equilibrium is not None:
        handles |= panels.RECOVERY
    note = "\n".join(readings.starting_texts(tension, equilibrium, direction))
    panels.legend(fig, handles, ncols=2, note=note)
    return fig


def _draw_section_path(ax, rest, pulled, direction):
    """The loop at rest and pulled, and how its section B moves: along, then across the pull."""
    window = _window([rest, pulled], rest)
    for state, colour in ((rest, YARN_COLOURS["pale"]), (pulled, YARN_COLOURS["marked"])):
        _draw_loop(ax, state, direction, window, alone=True, colour=colour)
    along = AXES[direction]
    b = _marked_sections(direction, rest.sizes["point"] - 1)["B"]
    before, after = from_si(np.array([rest.centreline[b], pulled.centreline[b]]), "mm")
    corner = np.where(np.arange(3) == along, after, before)
    # B lies on the left leg: letters to its left, the letter of the upper one higher.
    texts = {direction: (0.0, 8.0), readings.OTHER[direction]: (-9.0, 0.0)}
    if along:
        texts = {direction: (9.0, 0.0), readings.OTHER[direction]: (0.0, 8.0)}
    for start, end, axis in (
        (before, corner, direction),
        (corner, after, readings.OTHER[direction]),
    ):
        ax.annotate("", end[:2], start[:2], arrowprops={
            "arrowstyle": "-|>,head_width=0.16,head_length=0.3", "linewidth": 1.3,
            "facecolor": "black", "shrinkA": 0, "shrinkB": 0})  # fmt: skip
        look = {"fontsize": 8, "fontweight": "bold", "ha": "center"}
        look["path_effects"] = [withStroke(linewidth=2.0, foreground="white")]
        panels.say(ax, f"{SYMBOL[axis]}'", 0.5 * (start + end)[:2], texts[axis], **look)
    up = 14.0 if before[1] > after[1] else -14.0
    _badge(ax, "B", before[:2], (-40.0, up))
    _badge(ax, "B'", after[:2], (-40.0, -up))


def _limit(curve, choices):
    """Smallest scale across the pull that a reading allows."""
    if choices["limit"] == "half":
        return 0.5
    return 1.0 - float(curve.course_spacing[0]) / float(curve.loop_height)


def fig06_course_deformation(tension_course):
    """Fig. 6: sections of the loop before and under course tension."""
    return _deformation(tension_course, "course", 6)


def fig07_course_contraction(tension_course, equilibrium_course=None):
    """Fig. 7: how a section moves along and across the course, and how the loop contracts."""
    return _contraction(tension_course, "course", 7, equilibrium_course)


def fig08_wale_deformation(tension_wale):
    """Fig. 8: sections of the loop before and under wale tension."""
    return _deformation(tension_wale, "wale", 8)


def fig09_wale_contraction(tension_wale, equilibrium_wale=None):
    """Fig. 9: how a section moves along and across the wale, and how the loop contracts."""
    return _contraction(tension_wale, "wale", 9, equilibrium_wale)

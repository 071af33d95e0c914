"""Figures 10 and 11 of the paper: the fabric bent along the course and the wale.

Both read result files of the bending tests as xarray datasets.  Curvature is positive when the
technical face is convex.
"""

import numpy as np
from matplotlib.lines import Line2D

from knitsim.figures import panels, stored, style
from knitsim.figures.style import COLOURS, YARN_COLOURS
from knitsim.figures.tubes import draw_tubes, view_of
from knitsim.loop.repeat import bent_courses, rolled
from knitsim.store.results import DIRECTIONS
from knitsim.units import from_si

SYMBOL = {"course": "z", "wale": "y"}  # the paper's coordinates; x is the thickness
LOOPS = {"course": (8, 6), "wale": (8, 9)}  # wales and courses drawn of a fabric bent along it
VIEW = {"course": (-14.0, -50.0), "wale": (-44.0, -16.0)}  # along the cylinder's axis, from above
# From the largest negative to the largest positive curvature.
CURVATURE_COLOURS = (style.BLUE, style.SKY, style.ORANGE, style.VERMILION)
PRINTED_LINE = (0, (4, 1.5))


def _forms(bending):
    """(corrected, printed) of a test; None for a form that it does not hold."""
    bending = stored.one_loop(bending)
    held = bending.variant.values.tolist()
    return tuple(
        bending.sel(variant=form) if form in held else None for form in ("corrected", "printed")
    )


def _flat(corrected, along):
    """Coordinates (m) of the sections along the bent direction, before bending."""
    flat = corrected.isel(step=stored.state_at(corrected, "curvature", 0.0))
    return flat.centreline.values[:, along]


def states_of(bending):
    """Numbers of the states at the largest and half of it, to the back and to the face side."""
    curvature = bending.curvature.values
    face = [stored.state_at(bending, "curvature", share * curvature.max()) for share in (0.5, 1.0)]
    back = [stored.state_at(bending, "curvature", -curvature[step]) for step in face]
    return [*back[::-1], *face]


def angles_of_sections(points, curvature, along, form):
    """Angle (rad) of each section, read from its bent position (n, 3) (m).

    Corrected: the angle about the cylinder's axis.  As printed, eqs (8), (9): K' = 2 atan(-x'/z').
    """
    across, height = points[:, along], points[:, 2]
    if form == "printed":
        return 2.0 * np.arctan2(-height, across)
    # The axis lies at the height -1/curvature; below it the angle is counted the other way.
    side = np.sign(curvature)
    return side * np.arctan2(across, side * (height + 1.0 / curvature))


def fig10_bending_curvature(bending_course, bending_wale):
    """Angle, curvature and position of the sections along the bent model, for several curvatures."""
    tests = {"course": bending_course, "wale": bending_wale}
    fig, axes = style.figure(height_mm=142.0, rows=2, columns=3)
    panels.heading(
        fig, "curvature along the bent model of one loop, corrected against printed eqs (6) to (11)", 10,
        bending_course,
    )  # fmt: skip
    for row, (direction, bending) in zip(axes, tests.items(), strict=True):
        _curvature_row(row, bending, direction)
    handles = [
        Line2D([], [], color=colour, linewidth=3.0, label=_legend_text(tests.values(), step))
        for step, colour in zip(states_of(bending_course), CURVATURE_COLOURS, strict=True)
    ]
    handles += [
        Line2D(
            [],
            [],
            color="black",
            marker="o",
            markersize=3,
            linewidth=3.0,
            alpha=0.6,
            label="corrected",
        ),
        Line2D([], [], color="black", linestyle="--", label="as printed"),
    ]
    panels.legend(
        fig, {handle.get_label(): handle for handle in handles}, ncols=6,
        note="Positive curvature: technical face convex.  As printed, K' = 0 is 0/0, not a number:\n"
        "neither the flat fabric nor the section at the fixed edge has a position.",
    )  # fmt: skip
    return fig


def _legend_text(tests, step):
    """Curvature of a state, and whether the yarn is beyond break in it, bent along either direction."""
    states = [_forms(bending)[0].isel(step=step) for bending in tests]
    text = f"{_per_cm(float(states[0].curvature))} per cm"
    return text + (" (beyond break)" if any(map(stored.is_beyond_break, states)) else "")


def _curvature_row(axes, bending, direction):
    """Angle, curvature and positions of the sections for one bent direction."""
    along, symbol = DIRECTIONS.index(direction), SYMBOL[direction]
    forms = dict(zip(("corrected", "printed"), _forms(bending), strict=True))
    start = _flat(forms["corrected"], along)
    order = np.argsort(start, kind="stable")
    # Where the angle is next to nothing, so is what is known of the curvature.
    start = np.where(np.abs(start) < 0.02 * np.ptp(start), np.nan, start)
    length = float(bending.model_length)
    for step, colour in zip(states_of(bending), CURVATURE_COLOURS, strict=True):
        curvature = float(bending.curvature[step])
        for form, curve in forms.items():
            if curve is None:
                continue
            printed = form == "printed"
            points = curve.centreline.values[step]
            angle = angles_of_sections(points, curvature, along, form)
            look = {"color": colour, "linestyle": PRINTED_LINE if printed else "-"}
            if not printed:
                look |= {"linewidth": 2.6, "alpha": 0.6}
            axes[0].plot(from_si(start, "mm")[order], from_si(angle, "deg")[order], **look)
            # The curvature that puts a section where it is: with the angle on the arc from the edge to
            # the section; as printed with the angle on the length L, whichever the section.
            used = angle / (length if printed else start)
            axes[1].plot(from_si(start, "mm")[order], from_si(used, "per_cm")[order], **look)
            axes[2].plot(
                *from_si(points[:, [along, 2]], "mm").T, color=colour, linestyle="none",
                marker="x" if printed else "o", markersize=2.6 if printed else 1.6,
                markeredgewidth=0.6 if printed else 0.0,
            )  # fmt: skip
    for ax in axes[:2]:
        ax.axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
        ax.set_xlabel(f"position {symbol} along the {direction} (mm)")
    axes[1].axvline(from_si(length, "mm"), color=style.GREY, linewidth=0.8, linestyle=":")
    top = axes[1].get_xaxis_transform()
    panels.say(
        axes[1], "L", (from_si(length, "mm"), 1.0), (0, 2), xycoords=top, ha="center", va="bottom"
    )
    axes[0].set_ylabel("angle of the section (degrees)")
    axes[1].set_ylabel("curvature of the section (1/cm)")
    axes[2].set_xlabel(f"bent position {symbol}' (mm)")
    axes[2].set_ylabel("bent position x' (mm)")
    if forms["printed"] is not None:
        at = {"xycoords": "axes fraction", "ha": "right", "va": "top"}
        panels.say(axes[2], "printed: all near L", (0.98, 0.97), **at)
    axes[2].set_aspect("equal", adjustable="datalim")
    letters = "abc" if direction == "course" else "def"
    titles = (f"bent along the {direction}: angle", "curvature", "sections from the side")
    for ax, key, title in zip(axes, letters, titles, strict=True):
        panels.letter(ax, key, title)


def fig11_bending(bending_course, bending_wale):
    """Fabric bent to both sides, along course and wale, as solid yarns; and the printed form."""
    tests = {"course": bending_course, "wale": bending_wale}
    fig, axes = style.figure(height_mm=190.0, rows=4, columns=3)
    panels.heading(
        fig, "bent along course (above) and wale, to face and back side", 11, bending_course
    )
    keys = iter(panels.LETTERS)
    for k, (direction, bending) in enumerate(tests.items()):
        corrected, printed = _forms(bending)
        back, face = states_of(bending)[:2], states_of(bending)[2:]
        drawn = [
            bent_piece(corrected.isel(step=step), direction)
            for step in (*back, stored.state_at(bending, "curvature", 0.0), *face)
        ]
        if printed is not None:
            largest = int(np.argmax(bending.curvature.values))
            drawn.append(
                _printed(printed.isel(step=largest), corrected.isel(step=largest), direction)
            )
        drawn = [
            (courses, colours, f"({next(keys)}) {title}", ink)
            for courses, colours, title, ink in drawn
        ]
        draw_pieces(axes[2 * k : 2 * k + 2].flat, drawn, 0.5 * float(bending.diameter), direction)
        for panel in axes[2 * k : 2 * k + 2].flat[len(drawn) :]:
            panel.set_axis_off()
    panels.note(
        fig,
        "Images of the loop are turned about the cylinder's axis along the bent direction, and shifted"
        " across it.\nThe printed form has no images: it places one model of length L, and at zero"
        " curvature it is 0/0, not a number.",
    )
    return fig


def draw_pieces(axes, drawn, radius, direction, view=None):
    """Pieces as :func:`bent_piece` gives them, all to one scale; further axes are left alone.

    radius (m) of the yarn; view: as :func:`knitsim.figures.tubes.view_of` takes it, by default the
    slanted one of Fig. 11.
    """
    view = VIEW[direction] if view is None else view
    # One scale for all: every window as large as the largest.
    corners = []
    for courses, _, _, _ in drawn:
        seen = view_of(view).project(np.concatenate(courses))[:, :2]
        corners.append((seen.min(0) - 1.5 * radius, seen.max(0) + 1.5 * radius))
    half = 0.5 * np.max([high - low for low, high in corners], axis=0)
    for panel, (courses, colours, title, ink), (low, high) in zip(
        axes, drawn, corners, strict=False
    ):
        x, y = 0.5 * (low + high)
        window = (x - half[0], x + half[0], y - half[1], y + half[1])
        draw_tubes(panel, courses, radius, colours, view, window=window)
        panel.set_title(title, color=ink, fontsize=7.5)


def bent_piece(state, direction, along=None, across=None):
    """(courses, their colours, title and its colour) of the fabric in a state of a bending test.

    along, across: loops along the bent direction and across it.
    """
    wide, high = LOOPS[direction]
    if along is not None:
        wide, high = (along, across) if direction == "course" else (across, along)
    curvature, axis = float(state.curvature), DIRECTIONS.index(direction)
    spacings = float(state.wale_spacing), float(state.course_spacing)
    courses = bent_courses(
        stored.thinned(state).centreline.values, *spacings, wide, high, curvature, axis,
        courses=stored.courses_of(state),
    )  # fmt: skip
    # The middle of the piece lies flat, at the origin.
    middle = -0.5 * np.array([wide * spacings[0], high * spacings[1], 0.0])
    shift = np.where(np.arange(3) == axis, 0.0, middle)
    courses = [rolled(course, curvature, middle[axis], axis) + shift for course in courses]
    colours = [YARN_COLOURS["dark" if row % 2 else "pale"] for row in range(high)]
    side = "flat" if curvature == 0 else f"{'face' if curvature > 0 else 'back'} convex"
    broken = stored.is_beyond_break(state)
    strain = round(from_si(float(state.yarn_strain), "percent"), 2) + 0.0
    title = (
        f"{_per_cm(curvature)} per cm, {side}\nyarn {strain:+.2f} %"
        + (", beyond break" if broken else "")
    )  # fmt: skip
    return courses, colours, title, style.VERMILION if broken else "black"


def _per_cm(curvature):
    return "0" if curvature == 0 else f"{from_si(curvature, 'per_cm'):+.3g}"


def _printed(printed, corrected, direction):
    """As :func:`bent_piece`: one model as printed, among one as it should be, side by side across."""
    wide, high = LOOPS[direction]
    across = 1 - DIRECTIONS.index(direction)
    step = np.zeros(3)
    step[across] = float((printed.wale_spacing, printed.course_spacing)[across])
    lines, colours = [], []
    for state, colour in ((corrected, "pale"), (printed, "marked")):
        points = state.centreline.values
        points = points[np.isfinite(points).all(1)]
        for k in range(high if direction == "course" else wide):
            lines.append(points + k * step)
            colours.append(YARN_COLOURS[colour])
    title = (
        f"{_per_cm(float(printed.curvature))} per cm, one model of length L:\n"
        "as printed (red), corrected (pale)"
    )
    return lines, colours, title, COLOURS["printed"]

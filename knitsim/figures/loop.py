"""Figures of the loop, from its result file: its anchors (paper's Fig. 3), the yarn laid into it
(Fig. 4), connected loops (Fig. 5), and the README's picture.
"""

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.ticker import MaxNLocator

from knitsim.figures import panels, style
from knitsim.figures.stored import one_loop
from knitsim.figures.tubes import View, draw_tubes, fabric_polylines, render_tubes, view_of
from knitsim.figures.yarn import ALONG, fibre_colours, span, straight_fibres, twist_text
from knitsim.units import INCH, from_si

# The loop from its side with the wales upwards, as in the view of the face.
SIDE = View((0, 0, 1), (0, 1, 0), (-1, 0, 0), "thickness", "wale direction")
_PLAIN = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}


def _mm(values):
    return from_si(np.asarray(values, dtype=float), "mm")


def _size(loop):
    """The fabric's spacings, loop length and diameter as text."""
    sizes = {"w": "wale_spacing", "c": "course_spacing", "l": "loop_length", "d": "diameter"}
    return ", ".join(f"${k}$ = {_mm(loop[name]):#.4g} mm" for k, name in sizes.items())


def _fabric(loop, wide, high, **options):
    """Polylines and colours of a piece of the fabric whose loop this is."""
    spacings = float(loop["wale_spacing"]), float(loop["course_spacing"])
    return fabric_polylines(loop["centreline"].values, *spacings, wide, high, **options)


# Fig. 3 -----------------------------------------------------------------------------------------

_CURVES = {
    "centreline": ("centre line: spline through the anchors", style.BLUE, "-", 1.8),
    "curve_point": ("Choi and Lo's curve, source of the anchors", style.BLACK, "--", 1.0),
    "peirce_point": ("Peirce's own loop", style.ORANGE, "-.", 1.3),
}
# Where the numbers of the anchors 1 to 6 stand beside them, in points: seen from the face, on the
# left half, and from the side.
_BESIDE_FACE = ((2, 10), (3, 10), (11, -2), (-11, 2), (-9, 8), (0, 11))
_BESIDE_SIDE = ((0, -12), (16, 2), (19, -4), (19, 4), (-17, 0), (0, 11))


def fig03_loop_anchors(loop):
    """One loop from the face and from the side: six anchors a half, curves and dimensions."""
    loop = one_loop(loop)
    w, d = float(loop["wale_spacing"]), float(loop["diameter"])
    low, high = loop["centreline"].values.min(0), loop["centreline"].values.max(0)
    bottom, top = low[1] - 1.35 * d, high[1] + 1.0 * d
    middle, half = 0.5 * (low[2] + high[2]), 0.5 * float(loop["thickness"])
    left, right, reach = -0.85 * w, 1.85 * w, 1.7 * half
    fig, axes = style.figure(
        height_mm=104.0, rows=1, columns=2, width_ratios=[right - left, 2.0 * reach]
    )
    panels.heading(fig, f"its loop, {_size(loop)}", 3, loop)
    face, side = axes[0]
    _draw_loop(face, loop, "face", (left, right, bottom, top))
    _draw_loop(side, loop, SIDE, (middle - reach, middle + reach, bottom, top))
    anchors = _mm(loop["anchor_point"].values)
    head = len(anchors) // 2
    for k, place in enumerate(anchors):
        mirrored = k > head
        number = 2 * head - k + 1 if mirrored else k + 1
        offset = np.array(_BESIDE_FACE[number - 1]) * ([-1, 1] if mirrored else [1, 1])
        _number(face, place[:2], f"{number}{'′' * mirrored}", offset)
        if not mirrored:  # from the side both halves are one
            text = f"{number}" if k == head else f"{number}, {number}′"
            _number(side, place[[2, 1]], text, _BESIDE_SIDE[k])
    _mark_face(face, loop, low[1])
    ends, y = _mm([middle - half, middle + half]), _mm(low[1] - 1.0 * d)
    _dimension(side, (ends[0], y), (ends[1], y), f"{ends[1] - ends[0]:.3f}", _mm(low[1]))
    panels.letter(face, "a", "From the technical face")
    panels.letter(side, "b", "From the side")
    panels.legend(fig, panels.labelled([face]))
    return fig


def _draw_loop(ax, loop, view, window):
    """The loop among its neighbours as pale yarn, and the curves of :data:`_CURVES` on it."""
    shift = [2 * float(loop["wale_spacing"]), 2 * float(loop["course_spacing"]), 0.0]
    fabric = _fabric(loop, 5, 5, colours="#F4F2EE")
    n = len(loop["centreline"]) - 1
    here = slice(2 * n, 3 * n + 1)
    fabric.colours[2] = fabric.colours[2].copy()
    fabric.colours[2][here] = to_rgb("#D2C4A8")
    lines, colours = fabric.polylines, fabric.colours
    if view is SIDE:  # where neighbours would hide it
        lines, colours = [lines[2][here]], [colours[2][here]]
    # The middle loop goes where the file has it.
    lines = [points - shift for points in lines]
    drawn = draw_tubes(ax, lines, 0.5 * float(loop["diameter"]), colours, view, window=window)
    drawn.set_alpha(0.75)
    for name, (label, colour, line, width) in _CURVES.items():
        points = loop[name].values
        if np.isfinite(points).all():
            flat = _mm(view_of(view).project(points))
            ax.plot(*flat[:, :2].T, line, color=colour, linewidth=width, label=label)


def _number(ax, place, text, offset):
    ax.plot(*place, "o", color=style.BLUE, markersize=4, zorder=5)
    look = {"fontsize": 8, "color": style.BLUE, "fontweight": "bold", "bbox": _PLAIN, "zorder": 6}
    panels.say(ax, text, place, offset, ha="center", **look)


def _dimension(ax, start, end, text, witness, upright=False):
    """A dimension arrow; its witness lines begin at ``witness``, a y, or an x if it is upright."""
    for x, y in (start, end):
        line = ([x, witness], [y, y]) if upright else ([x, x], [y, witness])
        ax.plot(*line, color=style.BLACK, linewidth=0.4)
    panels.arrow(ax, start, end)
    middle = 0.5 * (np.asarray(start) + np.asarray(end))
    ax.text(*middle, text, ha="center", va="center", fontsize=7.5, bbox=_PLAIN, zorder=4)


def _mark_face(ax, loop, low):
    """Spacings, height from ``low`` (m) and, across the second leg, the diameter."""
    w, c, d = (_mm(loop[name]) for name in ("wale_spacing", "course_spacing", "diameter"))
    low, high = _mm([low, low + float(loop["loop_height"])])
    y = low - 1.0 * d
    _dimension(ax, (0.0, y), (w, y), f"$w$ = {w:.3f}", low)
    x = 1.62 * w
    _dimension(ax, (x, 0.0), (x, c), f"$c$ = {c:.3f}", w, upright=True)
    x = -0.58 * w
    _dimension(ax, (x, low), (x, high), f"height {high - low:.3f}", 0.5 * w, upright=True)
    line = _mm(loop["centreline"].values[:, :2])
    k = round(0.7 * len(line))
    along = line[k + 1] - line[k - 1]
    across = 0.5 * d * np.array([-along[1], along[0]]) / np.linalg.norm(along)
    panels.arrow(ax, line[k] - across, line[k] + across)
    panels.say(ax, f"$d$ = {d:.4f}", line[k] + across, (5, 0), fontsize=7.5, bbox=_PLAIN)


# Fig. 4 -----------------------------------------------------------------------------------------

_ORDERS = {
    "zx_first": (r"$\theta_{zx}$ first", style.PURPLE, "-"),
    "zy_first": (r"$\theta_{zy}$ first", style.PURPLE, "--"),
}
_DISCS = 26  # about so many sections are drawn
_DISC_VIEW = (-28.0, 24.0)


def fig04_yarn_into_loop(loop):
    """The straight twisted yarn, laid into the loop; its sections as printed and corrected."""
    loop = one_loop(loop)
    d, length, twist = (float(loop[name]) for name in ("diameter", "loop_length", "twist"))
    fibres = loop["fibre_point"].values
    positions = _fibre_positions(loop)
    colours = fibre_colours(len(positions), _outer_fibres(positions, 3))
    radius = 0.5 * float(loop["fibre_diameter"])
    fig, axes = style.figure(
        height_mm=146.0, rows=3, columns=4, height_ratios=[0.6, 2.6, 1.5],
        width_ratios=[1.2, 1, 1, 1],
    )  # fmt: skip
    panels.heading(
        fig, f"{len(positions)} fibres with {twist_text(twist)} laid into the loop", 4, loop
    )
    straight, errors = span(axes[0]), span(axes[2])
    draw_tubes(
        straight, list(straight_fibres(positions, twist, length, len(fibres))), radius, colours,
        ALONG, window=(0.0, length, -0.6 * d, 0.6 * d),
    )  # fmt: skip
    panels.letter(straight, "a", "The straight yarn of one loop, with all its fibres", y=1.1)
    draw_tubes(axes[1, 0], list(np.swapaxes(fibres, 0, 1)), radius, colours, "face")
    panels.letter(axes[1, 0], "b", "In the loop")
    axes[1, 0].yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    _draw_discs(axes[1, 1], loop, loop["tangent"].values, style.COLOURS["corrected"])
    panels.letter(axes[1, 1], "c", "Sections, corrected")
    for ax, key, (order, (label, colour, _)) in zip(
        axes[1, 2:], "de", _ORDERS.items(), strict=True
    ):
        _draw_discs(ax, loop, loop["printed_section_axis"].sel(order=order).values, colour)
        panels.letter(ax, key, f"Printed, {label}")
    _draw_errors(errors, loop)
    panels.letter(errors, "f", "Angle between the axis of the sections (arrows above) and the yarn")
    return fig


def _fibre_positions(loop):
    """Fibres (fibre, 2) (m) in the section of the straight yarn, found back from the first one."""
    first = loop["fibre_point"].values[0] - loop["centreline"].values[0]
    return np.stack([first @ loop[name].values[0] for name in ("normal", "binormal")], axis=-1)


def _outer_fibres(positions, count):
    """Numbers of ``count`` fibres near the surface, evenly round the yarn."""
    radius = np.linalg.norm(positions, axis=1)
    angle = np.arctan2(positions[:, 1], positions[:, 0])
    wanted = 2.0 * np.pi * np.arange(count)[:, None] / count
    away = np.abs(np.angle(np.exp(1j * (angle - wanted))))
    return np.argmin(np.where(radius >= 0.85 * radius.max(), away, np.inf), axis=1)


def _draw_discs(ax, loop, axis, colour):
    """Sections as discs, an arrow on each, with the given axes (section, 3); far ones first."""
    view = view_of(_DISC_VIEW)
    line = loop["centreline"].values
    radius = 0.5 * float(loop["diameter"])
    step = max(1, round(len(axis) / _DISCS))
    around = np.linspace(0.0, 2.0 * np.pi, 49)[:, None]
    rgb = np.array(to_rgb(colour))
    depth = view.project(line)[:, 2]
    outlines, places, arrows = [], [], []
    for i in np.argsort(depth[:-1:step], kind="stable") * step:
        aside = np.eye(3)[np.argmin(np.abs(axis[i]))]
        first = np.cross(axis[i], aside)
        first /= np.linalg.norm(first)
        second = np.cross(axis[i], first)
        rim = line[i] + radius * (np.cos(around) * first + np.sin(around) * second)
        outlines.append(_mm(view.project(rim)[:, :2]))
        places.append(view.project(line[i])[:2])
        arrows.append(view.project(2.0 * radius * axis[i])[:2])
    ax.add_collection(
        PolyCollection(
            outlines, facecolor=(*(0.35 * rgb + 0.65), 0.9), edgecolor=0.75 * rgb, linewidth=0.7
        )
    )
    ax.quiver(
        *_mm(places).T, *_mm(arrows).T, angles="xy", scale_units="xy", scale=1.0, color="black",
        width=0.011, headwidth=4.0, headlength=4.5, headaxislength=4.0, zorder=3,
    )  # fmt: skip
    flat = _mm(view.project(line)[:, :2])
    ax.plot(*flat.T, color=style.GREY, linewidth=0.8, zorder=1)
    low, high = flat.min(0) - 1.6 * _mm(radius), flat.max(0) + 1.6 * _mm(radius)
    bar = 0.5 if high[0] - low[0] > 1.2 else 0.2
    panels.scale_bar(ax, low, bar, f"{bar:g} mm")
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1] - 0.05 * (high[1] - low[1]), high[1])
    ax.set_aspect("equal")
    ax.set_axis_off()


def _degrees_between(a, b):
    """Angle (n,) in degrees between vectors (n, 3)."""
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return from_si(np.arctan2(sine, np.sum(a * b, axis=-1)), "deg")


def _draw_errors(ax, loop):
    arc = _mm(loop["arc_length"].values)
    line = loop["centreline"].values
    # Eqs (2), (3) incline section i by the step from section i - 1.
    steps = np.diff(line, axis=0)
    middle = 0.5 * (arc[:-1] + arc[1:])
    for order, (label, colour, dash) in _ORDERS.items():
        axis = np.roll(loop["printed_section_axis"].sel(order=order).values, -1, axis=0)
        median = from_si(float(loop["section_angle_error"].sel(order=order)), "deg")
        ax.plot(
            middle, _degrees_between(axis, steps), dash, color=colour,
            label=f"eqs (2), (3) as printed, {label}: median {median:.0f}°",
        )  # fmt: skip
    normal = np.cross(loop["normal"].values, loop["binormal"].values)
    error = _degrees_between(normal, loop["tangent"].values)
    ax.plot(
        arc[:-1], error, color=style.COLOURS["corrected"],
        label="corrected, rotation-minimising frame: 0",
    )  # fmt: skip
    backward = np.append(steps[:, 0] < 0, False)
    ax.fill_between(
        arc, 0.0, 180.0, where=backward, step="post", color="#EEEEEE", linewidth=0, zorder=0,
        label="course runs backwards: sections turned over",
    )  # fmt: skip
    ax.set_xlim(0.0, arc[-1])
    ax.set_ylim(-4.0, 184.0)
    ax.set_yticks([0, 45, 90, 135, 180])
    ax.set_xlabel("length along the yarn, from sinker loop to sinker loop (mm)")
    ax.set_ylabel("angle (°)")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.32), ncols=2)


# Fig. 5 -----------------------------------------------------------------------------------------


def fig05_connected_loops(loop):
    """A piece of fabric as solid yarn: face, back, and seen along its courses and its wales."""
    loop = one_loop(loop)
    w, c = float(loop["wale_spacing"]), float(loop["course_spacing"])
    fabric = _fabric(loop, 7, 8, centred=True)
    radius = 0.5 * float(loop["diameter"])
    half = 2.25 * w
    tall = round(2.0 * half / c) * 0.5 * c
    thickness = float(loop["thickness"])
    middle = 0.5 * np.ptp(loop["centreline"].values[:, 2]) + loop["centreline"].values[:, 2].min()
    low, high = middle - 1.1 * thickness, middle + 1.1 * thickness
    windows = {
        "face": (-half, half, -tall, tall),
        "back": (-half, half, -tall, tall),
        "side_course": (-half, half, low, high),
        "side_wale": (-tall, tall, low, high),
    }
    titles = ("Technical face", "Technical back", "Seen along the wales", "Seen along the courses")
    fig, axes = style.figure(
        height_mm=129.0, rows=2, columns=2, height_ratios=[2.0 * tall, high - low]
    )
    panels.heading(fig, f"connected loops, {_size(loop)}", 5, loop)
    for ax, (view, window), key, title in zip(
        axes.flat, windows.items(), "abcd", titles, strict=True
    ):
        draw_tubes(
            ax, fabric.polylines, radius, fabric.colours, view, window=window,
            twist=float(loop["twist"]),
        )  # fmt: skip
        panels.letter(ax, key, f"{title}", y=1.02 if ax in axes[0] else 1.08)
    return fig


def readme_picture(loop):
    """A piece of the fabric, seen obliquely, without axes: the picture of the README."""
    loop = one_loop(loop)
    fabric = _fabric(loop, 11, 11, centred=True)
    w = float(loop["wale_spacing"])
    columns, rows = 840, 360
    wide = 3.1 * w
    tall = wide * rows / columns
    picture = render_tubes(
        fabric.polylines, 0.5 * float(loop["diameter"]), fabric.colours, "oblique",
        twist=float(loop["twist"]), window=(-wide, wide, -tall, tall), pixel=2.0 * wide / columns,
    ).rgba  # fmt: skip
    size = (from_si(n / style.DPI * INCH, "mm") for n in (columns, rows))
    fig, axes = style.figure(*size)
    axes[0, 0].remove()
    # On white, and in steps of eight in 256, which are not seen and halve the file.
    alpha = picture[..., 3:] / 255.0
    opaque = picture[..., :3] * alpha + 255.0 * (1.0 - alpha)
    fig.figimage(opaque.astype(np.uint8) & 0b11111000 | 0b111)
    return fig

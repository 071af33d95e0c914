"""Figures of the yarn, from its result file: its springs (paper's Fig. 1), and fibres over
successive sections (Fig. 2).
"""

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from knitsim.figures import style
from knitsim.figures.panels import heading, letter, say, scale_bar
from knitsim.figures.tubes import View, draw_tubes, view_of
from knitsim.units import from_si

# A straight yarn lies along the course direction; its section's x is up, its y to the eye.
ALONG = View((1, 0, 0), (0, 1, 0), (0, 0, 1), "along the yarn", "across")
_OBLIQUE = (-42.0, 16.0)


def span(axes):
    """One axes in place of several neighbouring ones of a grid."""
    axes = np.asarray(axes)
    first, last = axes.flat[0], axes.flat[-1]
    rows, columns = (
        slice(getattr(first.get_subplotspec(), f"{k}span").start,
              getattr(last.get_subplotspec(), f"{k}span").stop)
        for k in ("row", "col")
    )  # fmt: skip
    fig, grid = first.figure, first.get_gridspec()
    for ax in axes.flat:
        ax.remove()
    return fig.add_subplot(grid[rows, columns])


def straight_fibres(positions, twist, length, steps):
    """Fibres of a straight twisted yarn (fibre, steps + 1, 3) (m), course along the yarn.

    positions: (fibre, 2) (m) in the section at 0, its x upwards, its y to the eye; twist in turns
    per metre, positive for Z: every section is the one at 0, turned by 2 pi twist times its place.
    """
    along = np.linspace(0.0, length, steps + 1)
    angle = 2.0 * np.pi * twist * along
    x, y = np.asarray(positions).T[:, :, None]
    return np.stack(
        [
            np.broadcast_to(along, (len(x), along.size)),
            x * np.cos(angle) - y * np.sin(angle),
            x * np.sin(angle) + y * np.cos(angle),
        ],
        axis=-1,
    )


def twist_text(twist):
    """A twist (1/m) in words."""
    return f"{abs(twist):.0f} turns/m {'Z' if twist > 0 else 'S'}" if twist else "no twist"


def fibre_colours(count, marked=()):
    """RGB (count, 3) of drawn fibres: shades of undyed yarn in turn, some of them set off."""
    pale = np.array(to_rgb(style.YARN_COLOURS["pale"]))
    shades = pale * np.array([1.0, 0.93, 0.86, 0.965, 0.895])[:, None]
    colours = shades[np.arange(count) % len(shades)]
    colours[list(marked)] = to_rgb(style.YARN_COLOURS["marked"])
    return colours


def _nearest(positions, targets):
    """Numbers of the fibres nearest to the targets (n, 2), each fibre once."""
    found = []
    for target in targets:
        fibre = int(np.argmin(np.linalg.norm(positions - target, axis=1)))
        if fibre not in found:
            found.append(fibre)
    return found


def _polar(radius, degrees):
    angle = np.radians(degrees)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


# Fig. 1 -----------------------------------------------------------------------------------------


def fig01_yarn_springs(yarn):
    """The simulated yarn's parts: mass points, its three kinds of springs, and all its fibres."""
    positions = yarn["fibre_position"].values
    diameter = float(yarn["diameter"])
    fig, axes = style.figure(
        height_mm=106.0, rows=2, columns=2, height_ratios=[3.6, 1], width_ratios=[1.75, 1]
    )
    dtex = from_si(float(yarn["linear_density"]), "dtex")
    heading(
        fig, f"{dtex:g} dtex, {from_si(diameter, 'um'):.1f} µm, {len(positions)} fibres of"
        f" {from_si(float(yarn['fibre_diameter']), 'um'):.1f} µm, {twist_text(float(yarn['twist']))}",
        1, yarn,
    )  # fmt: skip
    # Fibres of the side that is seen, so that their springs hide nothing.
    reach = np.linalg.norm(positions, axis=1).max()
    marked = _nearest(positions, _polar(reach, [5.0, 58.0, 102.0, 165.0]))
    _draw_springs(axes[0, 0], yarn, marked)
    _draw_section(axes[0, 1], yarn, marked)
    ax = span(axes[1])
    length = 14.0 * diameter
    fibres = straight_fibres(positions, float(yarn["twist"]), length, 60)
    draw_tubes(
        ax, list(fibres), 0.5 * float(yarn["fibre_diameter"]),
        fibre_colours(len(positions), marked), ALONG,
        window=(0.0, length, -0.58 * diameter, 0.58 * diameter),
    )  # fmt: skip
    letter(ax, "c", "All fibres at true size and twist; those of (a) set off", y=1.08)
    return fig


def _coil(start, end, amplitude, turns=6):
    """A coil spring between two points of the drawing, (n, 2)."""
    along = end - start
    length = np.linalg.norm(along)
    along = along / length
    across = np.array([-along[1], along[0]])
    phase = np.linspace(0.0, 2.0 * np.pi * turns, 24 * turns + 1)
    lead = 0.22 * length
    place = lead + (length - 2.0 * lead) * phase / phase[-1] + 0.7 * amplitude * (1 - np.cos(phase))
    coil = start + place[:, None] * along + amplitude * np.sin(phase)[:, None] * across
    return np.concatenate([[start], coil, [end]])


def _draw_springs(ax, yarn, marked):
    diameter, spacing = float(yarn["diameter"]), float(yarn["section_spacing"])
    stretch = max(1, round(1.45 * diameter / spacing))
    path = yarn["fibre_path"].sel(twist_form="corrected").values[:4]
    points = path[..., [2, 0, 1]] * [stretch, 1.0, 1.0]
    view = view_of(_OBLIQUE)
    flat = from_si(view.project(points)[..., :2], "um")
    edges = yarn["section_edge"].values
    around = np.linspace(0.0, 2.0 * np.pi, 121)
    rim = 0.5 * diameter * np.stack([0.0 * around, np.cos(around), np.sin(around)], axis=-1)
    size = np.clip(14.0 / np.sqrt(flat.shape[1]), 0.9, 3.4)
    outlines = [
        from_si(view.project(rim + section[:1] * [1.0, 0.0, 0.0])[:, :2], "um")
        for section in points
    ]
    for i in range(len(flat) - 1, -1, -1):  # the first section is the nearest
        ax.fill(
            *outlines[i].T, facecolor="#F3F1EC", edgecolor=style.GREY, linewidth=0.7, alpha=0.93
        )
        lines = np.insert(flat[i][edges], 2, np.nan, axis=1).reshape(-1, 2)
        label = "springs inside the section" if i == 0 else None
        ax.plot(*lines.T, color=style.GREEN, linewidth=0.45, label=label)
        label = "mass points, one a fibre" if i == 0 else None
        ax.plot(*flat[i].T, "o", color=style.BLACK, markersize=size, markeredgewidth=0, label=label)
        if i == 0:
            continue
        for k in marked:
            label = "tension springs (of some fibres)" if (i, k) == (1, marked[0]) else None
            coil = _coil(flat[i - 1, k], flat[i, k], 0.022 * from_si(diameter, "um"))
            ax.plot(*coil.T, color=style.BLUE, linewidth=0.9, label=label)
            ax.plot(*flat[i, k], "o", color=style.VERMILION, markersize=3.4, markeredgewidth=0)
    for k in marked:
        ax.plot(*flat[0, k], "o", color=style.VERMILION, markersize=3.4, markeredgewidth=0)
    k = max(marked, key=lambda fibre: flat[0, fibre, 1])  # over the topmost one there is room
    for i in range(len(flat) - 2):
        chord = flat[i + 2, k] - flat[i, k]
        up = np.array([-chord[1], chord[0]]) * (0.16 + 0.05 * (i % 2))
        t = np.linspace(0.0, 1.0, 41)[:, None]
        arc = flat[i, k] + t * chord + 4.0 * t * (1.0 - t) * up
        label = "bending springs (of one fibre)" if i == 0 else None
        ax.plot(*arc.T, color=style.PURPLE, linewidth=1.2, label=label)
    ax.set_aspect("equal")
    ax.set_axis_off()
    low, high = np.min(outlines, axis=(0, 1)), np.max(outlines, axis=(0, 1))
    bar, y = 100.0, low[1] - 0.1 * from_si(diameter, "um")
    text = f"{bar:g} µm across the yarn; along it drawn {stretch} times as long"
    scale_bar(ax, (low[0], y), bar, text)
    ax.set_xlim(low[0] - 12.0, high[0] + 12.0)
    ax.set_ylim(y - 12.0, high[1] + 0.2 * from_si(diameter, "um"))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2, handlelength=1.6)
    letter(ax, "a", "Mass points and springs of successive sections")


def _draw_section(ax, yarn, marked):
    positions = from_si(yarn["fibre_position"].values, "um")
    yarn_radius = 0.5 * from_si(float(yarn["diameter"]), "um")
    ax.add_patch(
        Circle((0.0, 0.0), yarn_radius, facecolor="#F3F1EC", edgecolor=style.GREY, linewidth=0.8)
    )
    size = np.full(len(positions), from_si(float(yarn["fibre_diameter"]), "um"))
    ax.add_collection(
        EllipseCollection(
            size, size, np.zeros(len(positions)), units="xy", offsets=positions,
            offset_transform=ax.transData, edgecolor="#6B6255", linewidth=0.4,
            facecolor=[style.YARN_COLOURS["marked"] if k in marked else "#D9CFBC"
                       for k in range(len(positions))],
        ),
        autolim=False,
    )  # fmt: skip
    lines = np.insert(positions[yarn["section_edge"].values], 2, np.nan, axis=1).reshape(-1, 2)
    ax.plot(*lines.T, color=style.GREEN, linewidth=0.5)
    ax.plot(*positions.T, "o", color=style.BLACK, markersize=1.3, markeredgewidth=0)
    ax.set_aspect("equal")
    limit = 1.08 * yarn_radius
    ax.set_xlim(-limit, limit)
    ax.set_ylim(-limit, limit)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    ax.set_xlabel("x (µm)")
    ax.set_ylabel("y (µm)")
    letter(ax, "b", "Section at true size")


# Fig. 2 -----------------------------------------------------------------------------------------

_FIBRE_COLOURS = (style.BLUE, style.VERMILION, style.ORANGE, style.SKY)
_TWIST_FORMS = {
    "printed": (
        "Eq. (1) as printed: a reflection",
        "Along the yarn: there and back, no twist accumulates",
    ),
    "corrected": ("Corrected: a rotation", "Along the yarn: part of a helix"),
}


def fig02_fibre_sections(yarn):
    """Fibres over successive sections: eq (1) as printed reflects them, corrected turns them."""
    positions = yarn["fibre_position"].values
    reach = np.linalg.norm(positions, axis=1).max()
    targets = _polar(reach * np.array([1.0, 0.75, 0.5, 0.3]), np.array([42.0, 110.0, 215.0, 310.0]))
    fibres = _nearest(positions, targets)
    turn = np.degrees(2.0 * np.pi * float(yarn["twist"]) * float(yarn["section_spacing"]))
    fig, axes = style.figure(height_mm=112.0, rows=2, columns=2, width_ratios=[1, 1.9])
    heading(
        fig, f"fibres over {yarn.sizes['section']} successive sections, each turned by {abs(turn):.3g}°", 2,
        yarn,
    )  # fmt: skip
    rows = zip(_TWIST_FORMS.items(), "ac", "bd", strict=True)
    for row, ((form, (title, along)), left, right) in enumerate(rows):
        path = yarn["fibre_path"].sel(twist_form=form).values
        ends = ("0, 2, …", "1, 3, …") if form == "printed" else ("0", str(len(path) - 1))
        _draw_fibres(axes[row], yarn, path, fibres, ends)
        letter(axes[row, 0], left, f"{title}")
        letter(axes[row, 1], right, f"{along}")
    handles, labels = axes[0, 1].get_legend_handles_labels()
    for line, white, text in (("-", False, "x"), ("--", True, "y")):
        face = {"markerfacecolor": "white"} if white else {}
        handles += [Line2D([], [], color=style.GREY, linestyle=line, marker="o", **face)]
        labels += [text]
    fig.legend(handles, labels, loc="outside lower center", ncols=len(labels), handlelength=2.8)
    return fig


def _draw_fibres(axes, yarn, path, fibres, ends):
    """ends: what is written at the first section and at the last one of odd or even number."""
    across, along = axes
    around = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.stack([np.cos(around), np.sin(around)], axis=-1)
    across.plot(
        *(0.5 * from_si(float(yarn["diameter"]), "um") * circle).T, color=style.GREY, lw=0.8
    )
    for k, colour in zip(fibres, _FIBRE_COLOURS, strict=False):
        x, y = from_si(path[:, k, :2].T, "um")
        z = from_si(path[:, k, 2], "mm")
        radius = np.hypot(x[0], y[0])
        across.plot(*(radius * circle).T, color=colour, linewidth=0.5, alpha=0.5)
        across.plot(x, y, "-o", color=colour, linewidth=1.0, markersize=3.0)
        if k == fibres[0]:  # the outermost one has room beside it
            last = 1 if ends[1].startswith("1,") else len(x) - 1
            for number, text in zip((0, last), ends, strict=True):
                place = np.array([x[number], y[number]])
                offset, ha = 8.0 * place / max(radius, 1e-9), "left" if place[0] > 0 else "right"
                say(across, text, place, offset, ha=ha)
        along.plot(z, x, "-o", color=colour, markersize=3.2, label=f"radius {radius:.1f} µm")
        along.plot(
            z, y, "--o", color=colour, markersize=3.2, markerfacecolor="white", linewidth=1.0
        )
    limit = 0.64 * from_si(float(yarn["diameter"]), "um")
    across.set_aspect("equal")
    across.set_xlim(-limit, limit)
    for ax in axes:
        ax.set_ylim(-limit, limit)
    across.set_xlabel("x (µm)")
    across.set_ylabel("y (µm)")
    along.set_xlabel("along the yarn (mm)")
    along.set_ylabel("x, y (µm)")

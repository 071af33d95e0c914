"""Figure of the fabric at rest in the equilibrium model: its loop, and its density beside Munden's
and Peirce's.
"""

import numpy as np

from knitsim.figures import panels, style
from knitsim.figures.loop import SIDE
from knitsim.figures.readings import fabric_of
from knitsim.figures.solved import SET_COLOURS
from knitsim.figures.stored import first_loop
from knitsim.figures.tubes import draw_tubes
from knitsim.units import from_si

# D. L. Munden, Journal of the Textile Institute 50 (1959) T448: dry relaxed plain fabrics, loop
# length over course and wale spacing, and their ratio.
MUNDEN = {"kc": 5.0, "kw": 3.8, "ratio": 1.3}
# F. T. Peirce, Textile Research Journal 17 (1947) 123: loop length 2 c + w + 5.94 d, and of the
# tightest loop in diameters w, c and l.
PEIRCE_DIAMETERS = 5.94
PEIRCE_TIGHT = {"wale": 4.0, "course": 3.364, "length": 16.66}

_TITLES = {
    "kc": ("kc: courses", "l/c (1)"),
    "kw": ("kw: wales", "l/w (1)"),
    "ratio": ("shape of the loop", "w/c (1)"),
    "peirce": ("Peirce's length", "(2 c + w + 5.94 d)/l (1)"),
}


def constants(length, wale, course, diameter):
    """Munden's kc, kw and ratio, and Peirce's loop length over the true one; same units, any shape."""
    return {
        "kc": length / course,
        "kw": length / wale,
        "ratio": wale / course,
        "peirce": (2.0 * course + wale + PEIRCE_DIAMETERS * diameter) / length,
    }


def fig15_relaxed_fabric(relaxed, loop):
    """The stated loop and the one at rest, and the relaxed density over loop length and set."""
    fig = style.page(height_mm=142.0)
    above, below = fig.add_gridspec(2, 1, height_ratios=[1.25, 1.0])
    panels.heading(
        fig, "at rest in equilibrium, beside its stated density, Munden and Peirce", 15, relaxed
    )
    _draw_loops(fig, above, relaxed, loop)
    axes = dict(zip(_TITLES, below.subgridspec(1, 4).subplots(), strict=True))
    _draw_density(axes, relaxed)
    for (name, ax), key in zip(axes.items(), "efgh", strict=True):
        title, label = _TITLES[name]
        ax.set_xlabel("loop length l/d (1)")
        ax.set_ylabel(label)
        panels.letter(ax, key, title)
    missing = int(np.isnan(relaxed.compared_spacing.values[..., 0]).sum())
    panels.legend(
        fig, panels.labelled([axes["kc"]]), note="" if not missing else
        f"{missing} of {relaxed.compared_spacing[..., 0].size} fabrics found no state at rest; the"
        " reasons are in the result file.",
    )  # fmt: skip
    return fig


def _draw_loops(fig, place, relaxed, loop):
    """Face and side of the stated and of the relaxed loop, all to one scale."""
    states = {"as stated": loop, "at rest": relaxed}
    reach = (
        1.3 * max(float(state.wale_spacing) for state in states.values()),
        1.75 * max(float(state.course_spacing) for state in states.values()),
    )
    deep = 2.3 * max(
        np.ptp(state.centreline.values[..., 2]) + float(state.diameter) for state in states.values()
    )
    axes = place.subgridspec(1, 4, width_ratios=[2 * reach[0], 2 * reach[0], deep, deep]).subplots()
    for k, (name, state) in enumerate(states.items()):
        w, c = (from_si(float(state[f"{of}_spacing"]), "mm") for of in ("wale", "course"))
        yarns, shift = fabric_of(state, 7, 7)
        points = first_loop(state)
        centre = shift + 0.5 * (points.min(0) + points.max(0))
        lines = [line - centre for line in yarns.polylines]
        radius = 0.5 * float(state.diameter)
        face, side = axes[k], axes[2 + k]
        draw_tubes(
            face, lines, radius, yarns.colours, window=(-reach[0], reach[0], -reach[1], reach[1])
        )
        # From the side, without the wales that would hide the marked loop.
        begin = 3 * (len(points) - 1)
        draw_tubes(
            side, [line[begin:] for line in lines], radius,
            [colours[begin:] for colours in yarns.colours], SIDE,
            window=(-0.5 * deep, 0.5 * deep, -reach[1], reach[1]),
        )  # fmt: skip
        panels.letter(face, "ab"[k], f"{name}\nw = {w:.3f} mm, c = {c:.3f} mm")
        panels.letter(side, "cd"[k], f"{name},\nside")
        end = float(f"{from_si(0.35 * deep, 'mm'):.1g}")
        side.set_xticks([-end, 0.0, end], [f"{x:g}" for x in (-end, 0.0, end)])
        side.set_xlabel(side.get_xlabel(), fontsize=6.5)
    for ax in axes[1:]:
        ax.set_ylabel("")


def _draw_density(axes, relaxed):
    """Curves over loop length for every set, Munden, Peirce, and the fabric itself."""
    d, own = float(relaxed.diameter), float(relaxed.loop_length)
    lengths = relaxed.compared_loop_length.values
    shades = [style.COLOURS["equilibrium"], *SET_COLOURS]
    for k, fraction in enumerate(relaxed["set"].values):
        wale, course = relaxed.compared_spacing.sel(set=fraction).values.T
        for name, values in constants(lengths, wale, course, d).items():
            axes[name].plot(
                lengths / d, values, color=shades[k % len(shades)], marker="os^v"[k % 4], markersize=3,
                label=f"equilibrium, {from_si(fraction, 'percent'):.0f} % of the curvature set",
            )  # fmt: skip
    tight = constants(PEIRCE_TIGHT["length"], PEIRCE_TIGHT["wale"], PEIRCE_TIGHT["course"], 1.0)
    spacings = {
        ("this fabric as stated", "black", "D"): ("stated_wale_spacing", "stated_course_spacing"),
        ("this fabric at rest", style.COLOURS["equilibrium"], "D"): ("wale_spacing", "course_spacing"),
    }  # fmt: skip
    x = np.linspace(0.98 * PEIRCE_TIGHT["length"], 1.02 * lengths.max() / d, 50)
    munden = {
        **{name: np.full_like(x, value) for name, value in MUNDEN.items()},
        "peirce": 2.0 / MUNDEN["kc"] + 1.0 / MUNDEN["kw"] + PEIRCE_DIAMETERS / x,
    }
    for name, ax in axes.items():
        ax.plot(x, munden[name], "--", color=style.BLACK, linewidth=1.0,
                label="Munden (1959), dry relaxed: kc 5.0, kw 3.8, w/c 1.3")  # fmt: skip
        ax.plot(PEIRCE_TIGHT["length"], tight[name], "*", color=style.BLUE, markersize=8,
                label="Peirce (1947), tightest loop: w 4 d, c 3.364 d, l 16.66 d")  # fmt: skip
        for (label, colour, marker), (wale, course) in spacings.items():
            values = constants(own, float(relaxed[wale]), float(relaxed[course]), d)
            ax.plot(own / d, values[name], marker, color=colour, markersize=5.5, linestyle="none",
                    markerfacecolor="white", zorder=5, label=label)  # fmt: skip
    axes["peirce"].axhline(1.0, color=style.GREY, linewidth=0.8, linestyle=":")

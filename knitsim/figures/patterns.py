"""Figures of patterns of knit and purl from one yarn: at rest, pulled, and their curves."""

import numpy as np
import xarray as xr

from knitsim.figures import panels, style
from knitsim.figures.readings import fabric_of
from knitsim.figures.stored import state_at
from knitsim.figures.tubes import View, draw_tubes
from knitsim.units import from_si

_COLOURS = (style.BLUE, style.VERMILION, style.GREEN, style.PURPLE)
_END = View((1, 0, 0), (0, 0, 1), (0, -1, 0), "course direction", "thickness")
_SIDE = View((0, 0, 1), (0, 1, 0), (-1, 0, 0), "thickness", "wale direction")
WIDE, HIGH = 5, 6  # loops in a picture, each way
DIRECTIONS = ("course", "wale")
PULLED = 0.5  # strain at which fabrics are shown under tension
CAPTIONS = {
    "fig40_patterns_at_rest": "Fabrics of one yarn at rest, from the technical face, from the back, along the"
    " wale and along the course (the side), to one scale. In rib the purl wales fold behind the knit ones,"
    " in garter the courses lie on top of each other.",
    "fig41_patterns_pulled": "The same fabrics pulled along the course and along the wale.",
    "fig42_patterns_curves": "Force per width against strain of the four patterns in the equilibrium model,"
    " with the values calibrated on the curves of the jersey alone. Bands: 95 % of the fit, and the"
    " numerical error. Points: the measured curves of the jersey, the only ones that were used. Below:"
    " thickness and mass per area of the fabrics at rest.",
}


def _title(state):
    return state.attrs["pattern"].replace("_", " ")


def _drawn(ax, state, view, reach, yarns, shift):
    """One picture of a state, its middle loop in the middle."""
    middle = np.array([0.5 * float(state.wale_spacing), 0.5 * float(state.course_spacing), 0.0])
    lines = [line - shift - middle for line in yarns.polylines]
    draw_tubes(
        ax, lines, 0.5 * float(state.diameter), yarns.colours, view,
        window=(-reach[0], reach[0], -reach[1], reach[1]),
    )  # fmt: skip


def fig40_patterns_at_rest(rest):
    """rest: datasets of fabrics at rest."""
    fig = style.page(height_mm=48.0 * len(rest))
    panels.heading(fig, "four patterns of one yarn at rest", 40)
    axes = fig.subplots(len(rest), 4, squeeze=False, width_ratios=[1.0, 1.0, 1.0, 0.9])
    wide = 1.6 * max(float(one.wale_spacing) for one in rest)
    high = 1.9 * max(float(one.course_spacing) for one in rest)
    deep = 0.62 * max(float(one.thickness) for one in rest)
    letters = iter(panels.LETTERS)
    for row, state in zip(axes, rest, strict=True):
        cell = state.loop_wale.values.max() + 1, state.loop_course.values.max() + 1
        count = [
            2 * int(np.ceil(n / of)) * of + of for n, of in zip((WIDE, HIGH), cell, strict=True)
        ]
        yarns, shift = fabric_of(state, *count)
        for ax, view, reach, name in zip(
            row, ("face", "back", _END, _SIDE),
            ((wide, high), (wide, high), (wide, deep), (deep, high)),
            ("face", "back", "along the wale", "the side"), strict=True,
        ):  # fmt: skip
            _drawn(ax, state, view, reach, yarns, shift)
            panels.letter(ax, next(letters), f"{_title(state)}, {name}" if ax is row[0] else name)
        w, c, t = (
            from_si(float(state[n]), "mm") for n in ("wale_spacing", "course_spacing", "thickness")
        )
        mass = 1e3 * float(state.areal_mass)
        # Below the flattest picture there is room.
        told = f"w {w:.2f} mm, c {c:.2f} mm\nthickness {t:.2f} mm, {mass:.0f} g/m$^2$"
        row[2].set_xlabel(f"{row[2].get_xlabel()}\n{told}", fontsize=7)
        row[1].set_xlabel("from the back (mm)")
        for ax in row[1:3]:
            ax.set_ylabel("")
    return fig


def fig41_patterns_pulled(rest, course, wale):
    """rest: fabrics at rest; course, wale: their tensile tests."""
    fig = style.page(height_mm=52.0 * len(rest))
    panels.heading(fig, "four patterns of one yarn, at rest and pulled", 41)
    axes = fig.subplots(len(rest), 3, squeeze=False)
    letters = iter(panels.LETTERS)
    for row, state, *tests in zip(axes, rest, course, wale, strict=True):
        wide, high = 3.2 * float(state.wale_spacing), 3.2 * float(state.course_spacing)
        size = max(wide, high)
        shown = [(state, f"{_title(state)}, at rest")]
        for direction, test in zip(DIRECTIONS, tests, strict=True):
            one = test.isel(variant=0)
            step = state_at(one, "strain", PULLED)
            pulled = one.isel(step=step)
            strain = from_si(float(pulled.strain), "percent")
            shown.append((pulled, f"{strain:.0f} % along the {direction}"))
        for ax, (one, text) in zip(row, shown, strict=True):
            cell = state.loop_wale.values.max() + 1, state.loop_course.values.max() + 1
            count = [
                int(np.ceil(3.2 * size / (float(one[f"{of}_spacing"]) * n))) * n
                for of, n in zip(("wale", "course"), cell, strict=True)
            ]
            yarns, shift = fabric_of(one, *count)
            _drawn(ax, one, "face", (size, size), yarns, shift)
            panels.letter(ax, next(letters), text)
        for ax in row[1:]:
            ax.set_ylabel("")
    return fig


def fig42_patterns_curves(predicted, rest):
    """predicted: what the calibration says of each fabric; rest: fabrics at rest, for their names."""
    fig, axes = style.figure(height_mm=85.0, columns=2)
    panels.heading(fig, "four patterns of one yarn, calibrated on its jersey alone", 42)
    for ax, direction, key in zip(axes[0], DIRECTIONS, "ab", strict=True):
        for one, colour in zip(predicted, _COLOURS, strict=False):
            own = one.sel(direction=direction)
            force = from_si(own.predicted_force_per_width.values, "N_per_mm")
            low, high = (
                from_si(own.predicted_strain_band.sel(bound=end).values, "percent")
                for end in ("low", "high")
            )
            ax.fill_betweenx(force, low, high, color=colour, alpha=0.18, linewidth=0)
            strain = from_si(own.predicted_strain.values, "percent")
            fitted = "fitted" if one.sizes.get("curve", 0) else "predicted"
            name = one.attrs["pattern"].replace("_", " ")
            ax.plot(strain, force, color=colour, label=f"{name} ({fitted})")
            for i in np.flatnonzero(one.curve_direction.values == direction):
                measured = one.isel(curve=i)
                ax.plot(
                    from_si(measured.measured_strain.values, "percent"),
                    from_si(measured.measured_force_per_width.values, "N_per_mm"),
                    "o", color=colour, markersize=3, markerfacecolor="white", label=f"{name}, measured",
                )  # fmt: skip
        panels.letter(ax, key, f"along the {direction}")
        ax.set_xlabel("strain (%)")
        ax.set_xlim(left=0.0)
        ax.set_ylim(bottom=0.0)
    axes[0, 0].set_ylabel("force per width (N/mm)")
    sizes = "; ".join(
        f"{_title(one)} {from_si(float(one.thickness), 'mm'):.2f} mm thick, "
        f"{1e3 * float(one.areal_mass):.0f} g/m2"
        for one in rest
    )
    panels.legend(fig, panels.labelled(axes[0]), note=f"At rest: {sizes}.")
    return fig


def draw_patterns(files, folder):
    """Write the figures of :data:`CAPTIONS` into ``folder``; files: {rest, course, wale, predicted:
    paths}.
    """
    data = {name: [xr.load_dataset(path) for path in paths] for name, paths in files.items()}
    figures = {
        "fig40_patterns_at_rest": ("rest",),
        "fig41_patterns_pulled": ("rest", "course", "wale"),
        "fig42_patterns_curves": ("predicted", "rest"),
    }
    for name, needs in figures.items():
        with style.context():
            fig = globals()[name](*(data[need] for need in needs))
        style.save(fig, folder / name, CAPTIONS[name])

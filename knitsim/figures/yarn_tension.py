"""Figure of the yarn's simulated tensile test (paper's Fig. 12), from its result file."""

import json
from pathlib import PurePath

import numpy as np

from knitsim.errors import InputError
from knitsim.figures import panels, style
from knitsim.figures.stored import fabric_name
from knitsim.figures.yarn import span
from knitsim.units import from_si, to_si

REBUILT = "rebuilt from the paper's constants, not measured"
READINGS = {
    "corrected": "corrected: $k_1$ elastic, $k_2$ post-yield",
    "printed": "as printed: $k_1$ tension spring, $k_2$ bending spring",
}
_SAID = {"corrected": "corrected", "printed": "as printed"}


def fig12_yarn_tension(yarn):
    """Simulated tensile test in both readings of k1, k2 against the curve that was given.

    Raises InputError for a yarn without a tensile test.
    """
    if "yarn_tension" not in yarn:
        raise InputError(
            fabric_name(yarn), None, "has no tensile test; give its scene tensile_test"
        )
    variants = [str(name) for name in np.atleast_1d(yarn["variant"].values)]
    tests = {name: yarn.sel(variant=name) for name in variants}
    fig, axes = style.figure(height_mm=112.0, rows=len(variants), columns=2, width_ratios=[1.75, 1])
    panels.heading(fig, "simulated tensile test", 12, yarn)
    ax = span(axes[:, 0])
    _draw_tension(ax, yarn, tests)
    panels.letter(ax, "a", "Tension against strain")
    for right, (name, test), key in zip(axes[:, 1], tests.items(), "bc", strict=False):
        _draw_energy(right, test)
        panels.letter(right, key, f"Energy, {_SAID[name]}")
    lowest = min(right.get_ylim()[0] for right in axes[:, 1])
    highest = max(right.get_ylim()[1] for right in axes[:, 1])
    for right in axes[:, 1]:
        right.set_ylim(lowest, highest)
    handles = panels.labelled(axes[:, 1])
    axes[-1, 1].legend(
        handles.values(), handles, loc="upper center", ncols=2, handlelength=1.5,
        bbox_to_anchor=(0.5, -0.14 * len(variants)),
    )  # fmt: skip
    if "corrected" in tests:
        panels.note(fig, _share_of_law(yarn, tests["corrected"]))
    return fig


def _share_of_law(yarn, test):
    """How much of its law the simulated yarn carries, in words, and why it is not all of it."""
    law, top = yarn.sel(form="continuous"), int(np.argmax(test["strain"].values))
    strain, held = float(test["strain"][top]), np.isfinite(law["law_strain"].values)
    given = np.interp(strain, law["law_strain"].values[held], law["law_tension"].values[held])
    radius = np.linalg.norm(yarn["fibre_position"].values, axis=1)
    angle = np.arctan(2.0 * np.pi * radius * float(yarn["twist"]))
    inward = 1.0 - float(test["mean_radius_ratio"][top])
    return (
        f"At {from_si(strain, 'percent'):.3g} % the simulated yarn carries"
        f" {100.0 * float(test['yarn_tension'][top]) / given:.0f} % of its law.  The law is shared out"
        " among its fibres, which lie at up to"
        f" {np.degrees(np.abs(angle).max()):.0f}° to the yarn: with a rigid section"
        f" {100.0 * np.mean(np.cos(angle) ** 3):.0f} % are left (mean cos³ of their angle, Hearle 1969);"
        f" the section also gives way, by {100.0 * inward:.2g} % of its radius."
    )


def _draw_tension(ax, yarn, tests):
    percent = from_si(1.0, "percent")
    if "curve_tension" in yarn:
        given = f"given curve, {PurePath(yarn.attrs['calibration_source']).name}"
        ax.plot(
            percent * yarn["curve_strain"], yarn["curve_tension"], "o", color=style.BLACK,
            markersize=2.6, markerfacecolor="white", markeredgewidth=0.7, markevery=2,
            label=REBUILT if _is_rebuilt(yarn) else given,
        )  # fmt: skip
    law = yarn.sel(form="continuous")
    ax.plot(
        percent * law["law_strain"], law["law_tension"], color=style.GREY, linewidth=0.9,
        label="calibrated law" if "curve_tension" in yarn else "tension law",
    )  # fmt: skip
    recovered = "recovery" in yarn["phase"].values
    for name, test in tests.items():
        colour = style.COLOURS.get(name, style.GREY)
        said = f"simulated, {READINGS[name]}" if len(tests) > 1 else "simulated"
        _draw_phases(ax, test, test["yarn_tension"], colour, said)
        residual = percent * float(test["strain"][-1])
        if recovered and residual > 0.1:
            ax.plot(
                residual, 0.0, "D", color=colour, markersize=4, clip_on=False, zorder=5,
                label=f"strain left after recovery: {residual:.2f} %",
            )  # fmt: skip
    ax.plot(
        percent * float(law["breaking_strain"]), np.nanmax(law["law_tension"]), "X",
        color=style.BLACK, markersize=6, label="break",
    )  # fmt: skip
    if recovered:
        ax.plot([], [], style.LINES["recovery"], color=style.BLACK, label="recovery")
    _say_misfit(ax, tests)
    dtex = from_si(float(yarn["linear_density"]), "dtex")
    other = ax.secondary_yaxis(
        "right", functions=(lambda n: from_si(n, "cN") / dtex, lambda t: to_si(t * dtex, "cN"))
    )
    other.set_ylabel("tension (cN/dtex)")
    ax.set_xlim(left=0.0)
    ax.set_ylim(0.0, 1.45 * ax.get_ylim()[1])
    ax.set_xlabel("strain (%)")
    ax.set_ylabel("tension (N)")
    ax.legend(loc="upper left", borderaxespad=0.2)
    if "curve_tension" in yarn:
        for place, lines in zip((0.0, 0.6), _constants(yarn, tests), strict=True):
            look = {"xycoords": "axes fraction", "va": "top", "fontsize": 6.5, "linespacing": 1.4}
            panels.say(ax, "\n".join(lines), (place, 0.0), (0.0, -30.0), **look)


def _is_rebuilt(yarn):
    """Whether the yarn's curve was computed from stated constants, and not measured."""
    return bool(yarn["curve_origin"])


def _draw_phases(ax, test, values, colour, label, **options):
    """Loading full, recovery dashed; states beyond the breaking strain marked."""
    strain = from_si(test["strain"].values, "percent")
    values = np.asarray(values)
    loading = test["phase"].values == "loading"
    top = int(np.flatnonzero(loading)[-1])
    for phase, part in (("loading", slice(0, top + 1)), ("recovery", slice(top, None))):
        ax.plot(
            strain[part], values[part], style.LINES[phase], color=colour,
            label=label if phase == "loading" else None, **options,
        )  # fmt: skip
    beyond = test["status"].values == 1
    if beyond.any():
        said = "beyond the breaking strain"
        known = ax.get_legend_handles_labels()[1]
        ax.plot(strain[beyond], values[beyond], "x", color=colour, markersize=4,
                label=None if said in known else said)  # fmt: skip


def _say_misfit(ax, tests):
    """How far the printed reading lies from the corrected one where they were pulled furthest."""
    if len(tests) < 2:
        return
    top = {name: int(np.argmax(test["strain"].values)) for name, test in tests.items()}
    low, high = (float(tests[n]["yarn_tension"][top[n]]) for n in ("corrected", "printed"))
    strain = from_si(float(tests["printed"]["strain"][top["printed"]]), "percent")
    panels.arrow(ax, (strain, high), (strain, low))
    text = f"printed {high / low - 1.0:+.0%}".replace("%", " %").replace("-", "−")
    panels.say(ax, text, (strain, high), (0, 4), ha="center", va="bottom")


def _constants(yarn, tests):
    """Lines of text: the calibrated constants with their intervals; the misfits."""
    names = {"k1": "k_1", "k2": "k_2", "k_low": r"k_\mathrm{low}", "k_high": r"k_\mathrm{high}"}
    fibres = yarn.sizes["fibre"]
    law = json.loads(yarn.attrs["configuration"])["values"]["tension_law"]
    by_filament = law is not None and law.get("per") == "filament"
    rebuilt = _is_rebuilt(yarn)
    lines = [
        "Constants, found again in their curve:"
        if rebuilt else "Calibrated constants (95 % interval):"
    ]  # fmt: skip
    for k, name in enumerate(yarn["parameter"].values):
        value, unit = float(yarn["fitted_value"][k]), str(yarn["parameter_units"][k].values)
        low, high = yarn["fitted_interval"].values[k]
        if name in ("slack", "toe_half_width") and abs(value) < 1e-9:
            continue
        if unit == "1":
            value, low, high, unit = (*from_si(np.array([value, low, high]), "percent"), "%")
        symbol = f"${names[name]}$" if name in names else name.replace("_", " ")
        text = f"{symbol} = {value:.5g}"
        if np.isfinite(low):
            text += f" ± {_short(0.5 * (high - low))}"
        text += f" {unit}"
        if name in ("k1", "k2") and by_filament:
            text += f" = {fibres} × {value / fibres:.3g} {unit}"
        lines.append(text)
    law = from_si(float(yarn["fit_rms"]), "percent")
    misfits = ["Misfit, rms, of the curve's greatest tension:"]
    misfits += [] if rebuilt else [f"calibrated law {_short(law)} %"]
    for name, test in tests.items():
        misfits.append(f"simulated, {_SAID[name]} {_misfit(yarn, test):.1f} %")
    return lines, misfits


def _misfit(yarn, test):
    """Rms deviation (%) on loading from the given curve, over the curve's greatest tension."""
    strain, tension = yarn["curve_strain"].values, yarn["curve_tension"].values
    loading = test.isel(step=np.flatnonzero(test["phase"].values == "loading"))
    loading = loading.isel(step=np.flatnonzero(loading["strain"].values <= strain[-1]))
    off = loading["yarn_tension"].values - np.interp(loading["strain"].values, strain, tension)
    return from_si(np.sqrt(np.mean(off**2)) / tension.max(), "percent")


def _short(value):
    """A small positive number with one digit, as mathematical text."""
    if value == 0 or value >= 1e-3:
        return f"{value:.2g}"
    mantissa, exponent = f"{value:.0e}".split("e")
    return rf"${mantissa}\times10^{{{int(exponent)}}}$"


_ENERGIES = {
    "stretch_energy": ("tension springs", style.BLUE),
    "bend_energy": ("bending springs", style.VERMILION),
    "section_energy": ("section springs", style.GREEN),
    "plastic_dissipated": ("lost: plastic", style.BLACK),
    "friction_dissipated": (r"lost: $F = c\,v$", style.ORANGE),
}


def _draw_energy(ax, test):
    for name, (label, colour) in _ENERGIES.items():
        values = test[name].values
        # What rounding leaves where the term is zero is not shown.
        shown = np.where(values > 1e-12 * test["work_per_length"].values.max(), values, np.nan)
        if np.isfinite(shown).any():
            _draw_phases(ax, test, shown, colour, label, linewidth=1.2)
    ax.set_yscale("log")
    ax.set_xlim(left=0.0)
    ax.set_xlabel("strain (%)")
    ax.set_ylabel("energy per length (J/m)")

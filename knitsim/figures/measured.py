"""Calibrations on measured curves, and what they predict, side by side.

Every function takes the datasets of ``measured/<fabric>/`` by the name of their calibration; the
prediction with all parameters as given comes first.
"""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from knitsim.configuration.measured_keys import GIVEN
from knitsim.figures import style
from knitsim.figures.states import PERCENT, fabric_name, heading, letter
from knitsim.units import from_si, label

FORCE = "N_per_mm"
_COLOURS = (
    style.VERMILION, style.BLUE, style.GREEN, style.PURPLE, style.ORANGE, style.SKY, "#7A4B12",
    style.GREY,
)  # fmt: skip
_LINES = ("-", (0, (5, 1.5)), (0, (3, 1, 1, 1)), (0, (1.2, 1.2)))
_BAND = 0.18
HIGHEST = 4.0  # misfit shown in profiles, over the largest of the fits
_LETTERS = "abcdefghijklmnopqrstuvwxyz"
# Units in which values of parameters are written, by their SI unit.
_SHOWN = {"m": "mm", "N m2": "N_mm2", "N m-3": "N_per_mm3", "N m-1": "N_per_m"}


def ordered(datasets):
    """The datasets with the prediction without calibration first, in the order given else."""
    return {name: datasets[name] for name in sorted(datasets, key=lambda name: name != GIVEN)}


def _looks(datasets):
    """{calibration: line colour and style}; that without calibration is black."""
    looks, number = {}, 0
    for name in datasets:
        if name == GIVEN:
            looks[name] = {"color": style.BLACK, "linestyle": "-"}
            continue
        looks[name] = {
            "color": _COLOURS[number % len(_COLOURS)],
            "linestyle": _LINES[number % len(_LINES)],
        }
        number += 1
    return looks


def title_of(name):
    """What a calibration is called in a figure."""
    return "no calibration: as given" if name == GIVEN else name.replace("_", " ")


def value_text(value, units):
    """A parameter's value and the unit it is written in, as text."""
    unit = _SHOWN.get(units)
    number = f"{from_si(value, unit) if unit else value:.3g}"
    return number, label(unit) if unit else ""


def _parameters_text(dataset):
    """Calibrated values with their intervals, one line each."""
    lines = []
    for i, name in enumerate(dataset.parameter.values):
        units = str(dataset.parameter_units.values[i])
        value, unit = value_text(float(dataset.fitted_value[i]), units)
        low, high = (value_text(v, units)[0] for v in dataset.fitted_interval.values[i])
        lines.append(
            f"{str(name).replace('_', ' ')} {value} {unit} [{low}, {high}]".replace("  ", " ")
        )
    return "\n".join(lines)


def _measured(ax, dataset, curves):
    """Measured points of the tension ``curves`` (numbers) with their bands; legend handles."""
    markers, handles = "osD^v", []
    for k, number in enumerate(curves):
        one = dataset.isel(curve=number)
        strain = from_si(one.measured_strain.values, PERCENT)
        force = from_si(one.measured_force_per_width.values, FORCE)
        recovery = one.measured_phase.values.astype(bool)
        look = {"color": style.BLACK, "marker": markers[k % len(markers)], "markersize": 3.2}
        band = [from_si(one[f"measured_strain_{end}"].values, PERCENT) for end in ("low", "high")]
        if np.isfinite(band[0]).any():
            ax.errorbar(
                strain, force, xerr=[strain - band[0], band[1] - strain], color=style.BLACK,
                linestyle="none", linewidth=0.6, capsize=1.5,
            )  # fmt: skip
        for part, face in ((~recovery, "white"), (recovery, style.GREY)):
            ax.plot(strain[part], force[part], linestyle="none", markerfacecolor=face, **look)
        name = str(one.curve.values).replace("_", " ")
        handles.append(
            Line2D(
                [], [], linestyle="none", markerfacecolor="white", label=f"measured: {name}", **look
            )
        )
    return handles


def _curves_of(dataset, direction, test="tension"):
    """Numbers of the measured curves of a test in a direction."""
    found = (dataset.curve_direction.values == direction) & (dataset.curve_test.values == test)
    return np.flatnonzero(found)


def _strain_line(ax, dataset, direction, look, fill=True):
    """Predicted force against strain with its band."""
    one = dataset.sel(direction=direction)
    force = from_si(one.predicted_force_per_width.values, FORCE)
    ax.plot(from_si(one.predicted_strain.values, PERCENT), force, **look)
    low, high = from_si(one.predicted_strain_band.values.T, PERCENT)
    if fill:
        ax.fill_betweenx(force, low, high, color=look["color"], alpha=_BAND, linewidth=0)


def _tension_axes(ax, direction):
    ax.set_xlabel(f"{direction} strain (%)")
    ax.set_ylabel("force per width (N/mm)")
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=0.0)
    ax.grid(True)


def fitted_direction(datasets):
    """The direction of the tension curves that were fitted, or else measured; None without any."""
    for wanted in ("fitted", "predicted"):
        for dataset in datasets.values():
            roles = (dataset.curve_role.values == wanted) & (dataset.curve_test.values == "tension")
            if roles.any():
                return str(dataset.curve_direction.values[roles][0])
    return None


def fig30_calibration(datasets):
    """Each calibration beside the measured curve that it was fitted to, a panel each."""
    datasets = ordered(datasets)
    direction = fitted_direction(datasets) or "course"
    looks = _looks(datasets)
    columns = min(2, len(datasets))
    rows = -(-len(datasets) // columns)
    fig, axes = style.figure(
        height_mm=30.0 + 62.0 * rows, rows=rows, columns=columns, sharex=True, sharey=True
    )
    heading(
        fig,
        f"Fig. 30  Fabric {fabric_name(next(iter(datasets.values())))}, calibrated on measured curves:"
        f" {direction} direction",
    )
    for number, (ax, (name, dataset)) in enumerate(zip(axes.flat, datasets.items(), strict=False)):
        _strain_line(ax, dataset, direction, looks[name])
        curves = _curves_of(dataset, direction)
        handles = _measured(ax, dataset, curves)
        _tension_axes(ax, direction)
        ax.xaxis.label.set_visible(number >= len(datasets) - columns)
        ax.yaxis.label.set_visible(number % columns == 0)
        letter(ax, f"({_LETTERS[number]}) {title_of(name)}")
        handles += [
            Line2D([], [], label="model", **looks[name]),
            Patch(color=looks[name]["color"], alpha=_BAND, label="95 % band of the model"),
        ]
        ax.legend(handles=handles, loc="upper left", fontsize=6.3)
        texts = [_parameters_text(dataset)] if name != GIVEN else []
        for k in curves:
            one = dataset.isel(curve=k)
            role = "fitted" if str(one.curve_role.values) == "fitted" else "not fitted"
            curve = str(one.curve.values).replace("_", " ")
            rms = float(one.misfit_rms)
            shown = f"{100 * rms:.1f} % rms" if np.isfinite(rms) else "not reached"
            texts.append(f"{curve} ({role}): {shown}")
        ax.text(
            0.985, 0.03, "\n".join(texts), transform=ax.transAxes, ha="right", va="bottom", fontsize=6.3,
        )  # fmt: skip
    for ax in axes.flat[len(datasets) :]:
        ax.set_visible(False)
    return fig


def fig31_prediction(datasets):
    """What all calibrations predict, side by side: force and lateral strain, both directions."""
    datasets = ordered(datasets)
    looks = _looks(datasets)
    bent = [d for d in datasets.values() if "predicted_moment_per_width" in d]
    columns = 3 if bent else 2
    fig, axes = style.figure(height_mm=150.0, rows=2, columns=columns)
    first = next(iter(datasets.values()))
    heading(
        fig,
        f"Fig. 31  Fabric {fabric_name(first)}, predicted by each choice of parameters: how far they"
        " lie apart",
    )
    for row, direction in zip(axes, ("course", "wale"), strict=True):
        at = 0 if direction == "course" else columns
        ax = row[0]
        for name, dataset in datasets.items():
            _strain_line(ax, dataset, direction, looks[name])
        handles = _measured(ax, first, _curves_of(first, direction))
        _tension_axes(ax, direction)
        fitted = [
            n for n, d in datasets.items()
            if (d.curve_role.values[_curves_of(d, direction)] == "fitted").any()
        ]  # fmt: skip
        letter(ax, f"({_LETTERS[at]}) {direction}: {'fitted' if fitted else 'predicted'}")
        if handles:
            ax.legend(handles=handles, fontsize=6.3, loc="upper left")
        _lateral(row[1], datasets, direction, looks)
        letter(row[1], f"({_LETTERS[at + 1]}) {direction}: lateral strain")
        if bent:
            _bending(row[2], datasets, direction, looks)
            letter(row[2], f"({_LETTERS[at + 2]}) {direction}: bending")
    fig.legend(
        handles=[Line2D([], [], label=title_of(name), **looks[name]) for name in datasets],
        loc="outside lower center", ncols=min(4, len(datasets)), title_fontsize=7,
        title="Bands: 95 %, from the fit and the numerical error; inputs as given count as known.",
    )  # fmt: skip
    return fig


def _lateral(ax, datasets, direction, looks):
    for name, dataset in datasets.items():
        one = dataset.sel(direction=direction)
        strain = from_si(one.predicted_strain.values, PERCENT)
        across = from_si(one.predicted_transverse_strain.values, PERCENT)
        low, high = from_si(one.predicted_transverse_strain_band.values.T, PERCENT)
        ax.plot(strain, across, **looks[name])
        ax.fill_between(strain, low, high, color=looks[name]["color"], alpha=_BAND, linewidth=0)
    first = next(iter(datasets.values()))
    for number in _curves_of(first, direction):
        one = first.isel(curve=number)
        ax.plot(
            from_si(one.measured_strain.values, PERCENT),
            from_si(one.measured_transverse_strain.values, PERCENT),
            "o", color=style.BLACK, markersize=3.2, markerfacecolor="white",
        )  # fmt: skip
    ax.set_xlabel(f"{direction} strain (%)")
    ax.set_ylabel("strain across the pull (%)")
    ax.set_xlim(left=0.0)
    ax.grid(True)


def _bending(ax, datasets, direction, looks):
    for name, dataset in datasets.items():
        if "predicted_moment_per_width" not in dataset:
            continue
        one = dataset.sel(direction=direction)
        curvature = from_si(one.predicted_curvature.values, "per_cm")
        # N mm per mm of width is N.
        moment = from_si(one.predicted_moment_per_width.values, "mN")
        low, high = from_si(one.predicted_moment_per_width_band.values.T, "mN")
        ax.plot(curvature, moment, **looks[name])
        ax.fill_between(curvature, low, high, color=looks[name]["color"], alpha=_BAND, linewidth=0)
    first = next(iter(datasets.values()))
    for number in _curves_of(first, direction, "bending"):
        one = first.isel(curve=number)
        ax.plot(
            from_si(one.measured_curvature.values, "per_cm"),
            from_si(one.measured_moment_per_width.values, "mN"),
            "o", color=style.BLACK, markersize=3.2, markerfacecolor="white",
        )  # fmt: skip
    ax.set_xlabel("curvature (1/cm)")
    ax.set_ylabel("moment per width from flat (mN)")
    ax.grid(True)


def fig32_misfit_profile(datasets):
    """Misfit along each calibrated parameter, the others fitted again."""
    datasets = {name: d for name, d in ordered(datasets).items() if d.sizes.get("parameter", 0)}
    looks = _looks(datasets)
    names = list(dict.fromkeys(str(p) for d in datasets.values() for p in d.parameter.values))
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    fig, axes = style.figure(height_mm=26.0 + 62.0 * rows, rows=rows, columns=columns, sharey=True)
    heading(
        fig,
        f"Fig. 32  Fabric {fabric_name(next(iter(datasets.values())))}: misfit along each calibrated"
        " parameter, the others fitted again",
    )
    # Far from the fit the misfit is large, which hides where it is small.
    top = HIGHEST * from_si(max(float(d.fit_misfit) for d in datasets.values()), PERCENT)
    for number, (ax, parameter) in enumerate(zip(axes.flat, names, strict=False)):
        unit = ""
        for name, dataset in datasets.items():
            if parameter not in dataset.parameter.values:
                continue
            one = dataset.sel(parameter=parameter)
            shown = _SHOWN.get(str(one.parameter_units.values))
            unit = label(shown) if shown else "1"
            value, low, high, at = (
                from_si(v, shown) if shown else v
                for v in (
                    float(one.fitted_value),
                    *one.fitted_interval.values,
                    one.profile_value.values,
                )
            )
            look = looks[name]
            ax.plot(at, from_si(one.profile_misfit.values, PERCENT), marker=".", **look)
            ax.plot(value, from_si(float(dataset.fit_misfit), PERCENT), "D", color=look["color"])
            ax.axvspan(low, high, color=look["color"], alpha=0.10, linewidth=0)
        ax.set_ylim(0.0, top)
        ax.grid(True)
        ax.xaxis.set_major_locator(MaxNLocator(5))
        ax.set_xlabel(f"{parameter.replace('_', ' ')} ({unit})")
        if number % columns == 0:
            ax.set_ylabel("rms misfit (%)")
        letter(ax, f"({_LETTERS[number]}) {parameter.replace('_', ' ')}")
    for ax in axes.flat[len(names) :]:
        ax.set_visible(False)
    handles = [Line2D([], [], label=title_of(name), marker="D", **looks[name]) for name in datasets]
    handles.append(Patch(color=style.GREY, alpha=0.2, label="95 % interval"))
    fig.legend(handles=handles, loc="outside lower center", ncols=min(4, len(handles)))
    return fig

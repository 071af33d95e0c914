"""Calibrations on measured curves, and what they predict, side by side.

Every function takes the datasets of ``measured/<fabric>/`` by the name of their calibration; the
prediction with all parameters as given comes first.
"""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from knitsim.figures import panels, style
from knitsim.units import READ_IN, from_si, label, value_text

FORCE = "N_per_mm"
_COLOURS = (
    style.VERMILION, style.BLUE, style.GREEN, style.PURPLE, style.ORANGE, style.SKY, "#7A4B12",
    style.GREY,
)  # fmt: skip
_LINES = ("-", (0, (5, 1.5)), (0, (3, 1, 1, 1)), (0, (1.2, 1.2)))
WIDEST, NARROWER, NARROWEST = 2.2, 0.5, 0.7  # line widths
_MARKERS = "osD^v"
_POINTS = 3.0  # zorder of measured points, above all lines
_BAND = 0.18
ROOM = 1.05  # of the axis above the largest value
HIGHEST = 4.0  # misfit shown in profiles, over the largest of the fits
# Units in which values of parameters are written, by their SI unit.


def ordered(datasets):
    """The datasets with the prediction without calibration first, in the order given else."""
    return dict(sorted(datasets.items(), key=lambda one: not is_given(one[1])))


def is_given(dataset):
    """Whether it is the prediction with all parameters as given, none calibrated."""
    return not dataset.sizes.get("parameter", 0)


def _looks(datasets, nested=False):
    """{calibration: line colour and style}; that without calibration is black.

    nested: each is drawn over the one before and narrower, so that equal curves both show.
    """
    looks, number = {}, 0
    for place, (name, dataset) in enumerate(datasets.items()):
        given = is_given(dataset)
        looks[name] = {
            "color": style.BLACK if given else _COLOURS[number % len(_COLOURS)],
            "linestyle": "-" if given else _LINES[number % len(_LINES)],
        }
        if nested:
            width = max(WIDEST - NARROWER * place, NARROWEST)
            looks[name] |= {"linewidth": width, "zorder": 2.0 + 0.01 * place}
        number += not given
    return looks


def title_of(dataset):
    """What a calibration is called in a figure."""
    name = dataset.attrs["calibration"].replace("_", " ")
    return f"no calibration: {name}" if is_given(dataset) else name


MOST_TOLD = 3  # calibrated values in a panel


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
    if len(lines) > MOST_TOLD:  # all inputs: those that the curves narrow most
        kept = np.argsort(dataset.posterior_over_prior.values)[:MOST_TOLD]
        more = f"and {len(lines) - MOST_TOLD} more, in tables/calibration.csv"
        lines = [*(lines[k] for k in kept), more]
    return "\n".join(lines)


def _mark(k):
    """How the points of the k-th measured curve of a panel look."""
    return {"color": style.BLACK, "marker": _MARKERS[k % len(_MARKERS)], "markersize": 3.2,
            "zorder": _POINTS}  # fmt: skip


def _measured_handle(one, look):
    name = str(one.curve.values).replace("_", " ")
    return Line2D(
        [], [], linestyle="none", markerfacecolor="none", label=f"measured: {name}", **look
    )


def _measured(ax, dataset, curves):
    """Measured points of the tension ``curves`` (numbers) with their bands; legend handles.

    Strain counts from where it is predicted from.
    """
    handles = []
    for k, number in enumerate(curves):
        one = dataset.isel(curve=number)
        strain = from_si(one.shifted_strain.values, "percent")
        force = from_si(one.measured_force_per_width.values, FORCE)
        recovery = one.measured_phase.values.astype(bool)
        look = _mark(k)
        band = [from_si(one[f"shifted_strain_{end}"].values, "percent") for end in ("low", "high")]
        if np.isfinite(band[0]).any():
            ax.errorbar(
                strain, force, xerr=[strain - band[0], band[1] - strain], color=style.BLACK,
                linestyle="none", linewidth=0.6, capsize=1.5, zorder=_POINTS,
            )  # fmt: skip
        for part, face in ((~recovery, "none"), (recovery, style.GREY)):
            ax.plot(strain[part], force[part], linestyle="none", markerfacecolor=face, **look)
        handles.append(_measured_handle(one, look))
    return handles


def _curves_of(dataset, direction, test="tension"):
    """Numbers of the measured curves of a test in a direction."""
    found = (dataset.curve_direction.values == direction) & (dataset.curve_test.values == test)
    return np.flatnonzero(found)


def _strain_line(ax, dataset, direction, look, fill=True):
    """Predicted force against strain with its band."""
    one = dataset.sel(direction=direction)
    force = from_si(one.predicted_force_per_width.values, FORCE)
    ax.plot(from_si(one.predicted_strain.values, "percent"), force, **look)
    low, high = from_si(one.predicted_strain_band.values.T, "percent")
    if fill:
        ax.fill_betweenx(force, low, high, color=look["color"], alpha=_BAND, linewidth=0)


def _strain_label(dataset, direction):
    zero = from_si(float(dataset.predicted_pretension.sel(direction=direction)), FORCE)
    return f"{direction} strain" + (f" from {zero:.3g} N/mm (%)" if zero else " (%)")


def _tension_axes(ax, dataset, direction):
    ax.set_xlabel(_strain_label(dataset, direction))
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


def fig30_calibration(measured):
    """Each calibration beside the measured curve that it was fitted to, a panel each."""
    datasets = ordered(measured)
    direction = fitted_direction(datasets) or "course"
    looks = _looks(datasets)
    columns = min(2, len(datasets))
    rows = -(-len(datasets) // columns)
    fig, axes = style.figure(
        height_mm=30.0 + 62.0 * rows, rows=rows, columns=columns, sharex=True, sharey=True
    )
    first = next(iter(datasets.values()))
    panels.heading(fig, f"calibrated on measured curves, {direction} direction", 30, first)
    found = []
    for number, (ax, (name, dataset)) in enumerate(zip(axes.flat, datasets.items(), strict=False)):
        _strain_line(ax, dataset, direction, looks[name])
        curves = _curves_of(dataset, direction)
        handles = _measured(ax, dataset, curves)
        for handle, k in zip(handles, curves, strict=True):
            handle.set_label(f"{handle.get_label()}, {_misfit_text(dataset.isel(curve=k))}")
        _tension_axes(ax, dataset, direction)
        lowest = number >= len(datasets) - columns
        ax.xaxis.label.set_visible(lowest)
        ax.xaxis.set_tick_params(labelbottom=lowest)
        ax.yaxis.label.set_visible(number % columns == 0)
        panels.letter(ax, panels.LETTERS[number], title_of(dataset))
        covers = dataset.attrs["band_covers"].split(",")[0]
        handles += [
            Line2D([], [], label="model", **looks[name]),
            Patch(color=looks[name]["color"], alpha=_BAND, label=f"band: {covers}"),
        ]
        ax.legend(handles=handles, loc="upper left", fontsize=6.3)
        found.append("" if is_given(dataset) else _parameters_text(dataset))
    # Room for the legends, and what was found below them, above all curves; the panels share their axes.
    legend, lines = 0.09 * len(handles), max(text.count("\n") + bool(text) for text in found)
    room = 1.05 + legend + 0.07 * lines
    axes.flat[0].set_ylim(top=room * axes.flat[0].get_ylim()[1])
    for ax, text in zip(axes.flat, found, strict=False):
        ax.text(
            0.03, 1.0 - (legend + 0.04) / room, text, transform=ax.transAxes, va="top", fontsize=6.3
        )
    for ax in axes.flat[len(datasets) :]:
        ax.set_visible(False)
    return fig


def _misfit_text(one):
    """How far a measured curve lies from the model, and whether it was fitted."""
    role = "fitted, " if str(one.curve_role.values) == "fitted" else ""
    rms = float(one.misfit_rms)
    return role + (f"{100 * rms:.1f} % rms" if np.isfinite(rms) else "not reached")


def fig31_prediction(measured):
    """What all calibrations predict, side by side: force and lateral strain, both directions."""
    datasets = ordered(measured)
    looks = _looks(datasets, nested=True)
    bent = any("predicted_moment_per_width" in d for d in datasets.values()) or any(
        len(_curves_of(d, way, "bending")) for d in datasets.values() for way in ("course", "wale")
    )
    columns = 3 if bent else 2
    fig, axes = style.figure(height_mm=150.0, rows=2, columns=columns)
    first = next(iter(datasets.values()))
    panels.heading(
        fig, "predictions of each choice of parameters, and how far they lie apart", 31, first
    )
    shown = {}
    for row, direction in zip(axes, ("course", "wale"), strict=True):
        at = 0 if direction == "course" else columns
        ax = row[0]
        for name, dataset in datasets.items():
            _strain_line(ax, dataset, direction, looks[name])
        handles = _measured(ax, first, _curves_of(first, direction))
        _tension_axes(ax, first, direction)
        fitted = [
            n for n, d in datasets.items()
            if (d.curve_role.values[_curves_of(d, direction)] == "fitted").any()
        ]  # fmt: skip
        panels.letter(ax, panels.LETTERS[at], f"{direction}: {'fitted' if fitted else 'predicted'}")
        _lateral(row[1], datasets, direction, looks)
        panels.letter(row[1], panels.LETTERS[at + 1], f"{direction}: lateral strain")
        if bent:
            handles += _bending(row[2], datasets, direction, looks)
            panels.letter(row[2], panels.LETTERS[at + 2], f"{direction}: bending")
        shown |= {handle.get_label(): handle for handle in handles}
    handles = {title_of(d): Line2D([], [], **looks[name]) for name, d in datasets.items()} | shown
    panels.legend(
        fig, handles, ncols=min(4, len(handles)),
        note="Bands: " + "; ".join(
            dict.fromkeys(
                f"{'as given' if is_given(d) else 'calibrated'}: {d.attrs['band_covers']}"
                for d in datasets.values()
            )
        ) + ".  Inputs as given count as known.",
    )  # fmt: skip
    return fig


def _lateral(ax, datasets, direction, looks):
    for name, dataset in datasets.items():
        one = dataset.sel(direction=direction)
        strain = from_si(one.predicted_strain.values, "percent")
        across = from_si(one.predicted_transverse_strain.values, "percent")
        low, high = from_si(one.predicted_transverse_strain_band.values.T, "percent")
        ax.plot(strain, across, **looks[name])
        ax.fill_between(strain, low, high, color=looks[name]["color"], alpha=_BAND, linewidth=0)
    first = next(iter(datasets.values()))
    for k, number in enumerate(_curves_of(first, direction)):
        one = first.isel(curve=number)
        ax.plot(
            from_si(one.shifted_strain.values, "percent"),
            from_si(one.shifted_transverse_strain.values, "percent"),
            linestyle="none", markerfacecolor="none", **_mark(k),
        )  # fmt: skip
    ax.set_xlabel(_strain_label(first, direction))
    ax.set_ylabel("strain across the pull (%)")
    ax.set_xlim(left=0.0)
    ax.grid(True)


def _bending(ax, datasets, direction, looks):
    """Moment against curvature; legend handles of what was measured.

    Where a bending test was measured, the model goes through that test and both are the mean of both
    ways; else the fabric is bent from flat to either side.
    """
    first = next(iter(datasets.values()))
    measured = _curves_of(first, direction, "bending")
    for name, dataset in datasets.items():
        lines = []
        for number in measured:
            one = dataset.isel(curve=number)
            ends = (one[f"model_moment_per_width_{end}"].values for end in ("low", "high"))
            lines.append((one.measured_curvature.values, one.model_moment_per_width.values, *ends))
        if not len(measured) and "predicted_moment_per_width" in dataset:
            one = dataset.sel(direction=direction)
            ends = one.predicted_moment_per_width_band.values.T
            lines.append(
                (one.predicted_curvature.values, one.predicted_moment_per_width.values, *ends)
            )
        for curvature, *moments in lines:
            curvature = from_si(curvature, "per_cm")
            # N mm per mm of width is N.
            moment, low, high = (from_si(values, "mN") for values in moments)
            ax.plot(curvature, moment, **looks[name])
            ax.fill_between(
                curvature, low, high, color=looks[name]["color"], alpha=_BAND, linewidth=0
            )
    handles = []
    for k, number in enumerate(measured):
        one, look = first.isel(curve=number), _mark(k)
        ax.plot(
            from_si(one.measured_curvature.values, "per_cm"),
            from_si(one.measured_moment_per_width.values, "mN"),
            linestyle="none", markerfacecolor="none", **look,
        )  # fmt: skip
        handles.append(_measured_handle(one, look))
    ax.set_xlabel("curvature (1/cm)")
    what = "mean of both ways" if handles else "first bending"
    ax.set_ylabel(f"moment, {what} (mN)")
    ax.grid(True)
    return handles


def fig32_misfit_profile(fitted):
    """Misfit along each calibrated parameter, the others fitted again."""
    datasets = {name: d for name, d in ordered(fitted).items() if d.sizes.get("parameter", 0)}
    looks = _looks(datasets)
    names = list(dict.fromkeys(str(p) for d in datasets.values() for p in d.parameter.values))
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    fig, axes = style.figure(height_mm=26.0 + 62.0 * rows, rows=rows, columns=columns, sharey=True)
    first = next(iter(datasets.values()))
    panels.heading(
        fig, "misfit along each calibrated parameter, the others fitted again", 32, first
    )
    # Far from the fit the misfit may be large, which hides where it is small.
    fits = [float(d.fit_misfit) for d in datasets.values()]
    reached = [*fits, *(np.nanmax(d.profile_misfit.values, initial=0.0) for d in datasets.values())]
    top = ROOM * from_si(min(HIGHEST * max(fits), max(reached)), "percent")
    for number, (ax, parameter) in enumerate(zip(axes.flat, names, strict=False)):
        unit = ""
        for name, dataset in datasets.items():
            if parameter not in dataset.parameter.values:
                continue
            one = dataset.sel(parameter=parameter)
            shown = READ_IN.get(str(one.parameter_units.values))
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
            ax.plot(at, from_si(one.profile_misfit.values, "percent"), marker=".", **look)
            ax.plot(value, from_si(float(dataset.fit_misfit), "percent"), "D", color=look["color"])
            ax.axvspan(low, high, color=look["color"], alpha=0.10, linewidth=0)
        ax.set_ylim(0.0, top)
        ax.grid(True)
        ax.xaxis.set_major_locator(MaxNLocator(5))
        ax.set_xlabel(f"{parameter.replace('_', ' ')} ({unit})")
        if number % columns == 0:
            ax.set_ylabel("rms misfit (%)")
        panels.letter(ax, panels.LETTERS[number], parameter.replace("_", " "))
    for ax in axes.flat[len(names) :]:
        ax.set_visible(False)
    handles = {
        title_of(d): Line2D([], [], marker="D", **looks[name]) for name, d in datasets.items()
    }
    handles["95 % interval"] = Patch(color=style.GREY, alpha=0.2)
    panels.legend(fig, handles, ncols=min(4, len(handles)))
    return fig

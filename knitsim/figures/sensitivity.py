"""Figure of what one per cent of each input does to a fabric's tests."""

import numpy as np

from knitsim.figures import style
from knitsim.figures.panels import heading, labelled, legend, letter, say
from knitsim.units import from_si

_GROUPS = {
    "strain": ("course_strain", "wale_strain"),
    "B": ("course_B", "wale_B"),
    "2HB": ("course_2HB", "wale_2HB"),
    "spacing at rest": ("course_spacing", "wale_spacing"),
}
_LEAST_SHOWN = 0.005  # per cent; smaller ones are marked as none


def fig33_sensitivity(sensitivity):
    """Bars: per cent of each result for one per cent of each input, course- and wale-wise.

    sensitivity: dataset of the stage; the noise stands as an error bar.
    """
    known = set(sensitivity.result.values.tolist())
    groups = {title: names for title, names in _GROUPS.items() if known & set(names)}
    change = np.abs(sensitivity.per_cent_per_cent.values)
    order = np.argsort(np.nanmax(np.where(np.isfinite(change), change, 0.0), axis=1), kind="stable")
    inputs = [str(sensitivity.input.values[i]) for i in order]
    fig, axes = style.figure(height_mm=38.0 + 11.0 * len(inputs), columns=len(groups), sharey=True)
    force = from_si(sensitivity.attrs["force_per_width"], "N_per_mm")
    heading(
        fig, f"per cent of each result for 1 % of each input (strain at {force:.3g} N/mm, first loading)",
        33, sensitivity,
    )  # fmt: skip
    at = np.arange(len(inputs))
    for ax, text, (title, names) in zip(axes[0], "abcd", groups.items(), strict=False):
        for k, name in enumerate(names):
            if name not in known:
                continue
            one = sensitivity.sel(result=name).isel(input=order)
            values, noise = one.per_cent_per_cent.values, one.per_cent_noise.values
            place = at + (0.2 if k == 0 else -0.2)
            direction = name.split("_")[0]
            ax.barh(
                place, np.nan_to_num(values), 0.36, color=style.COLOURS[direction],
                label=f"{direction}", xerr=np.nan_to_num(noise),
                error_kw={"linewidth": 0.7, "capsize": 1.5},
            )  # fmt: skip
            for y, value, off in zip(place, values, np.nan_to_num(noise), strict=True):
                if not np.isfinite(value):
                    shown = "no result"
                else:
                    shown = f"{value:+.2f}" if abs(value) >= _LEAST_SHOWN else "0"
                right = not value < 0
                end = np.nan_to_num(value) + (off if right else -off)
                offset, ha = (6 if right else -6, 0), "left" if right else "right"
                say(ax, shown, (end, y), offset, ha=ha, fontsize=5.6)
        ax.axvline(0.0, color=style.BLACK, linewidth=0.6)
        ax.margins(x=0.55)
        ax.set_xlabel("% per %")
        ax.set_yticks(at, [name.replace("_", " ") for name in inputs])
        letter(ax, text, title)
    legend(fig, labelled(axes.flat), ncols=2)
    return fig

"""Predictions with all inputs uncertain, beside the measured tests: a figure, a panel a test."""

import json

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from knitsim.figures import panels, style
from knitsim.figures.measured import FORCE
from knitsim.units import from_si

_ALPHA = {95: 0.22, 50: 0.45}
_PRIOR = 0.25
_ROWS = (("strain", "strain"), ("transverse_strain", "lateral"))


def fig34_prediction_bands(inferred):
    """Along and across the pull, a column for each measured tension test of the first such calibration, and
    for a direction in which none was measured."""
    dataset = next(d for d in inferred.values() if "prior_strain_band" in d)
    curves = [dataset.isel(curve=k) for k in np.flatnonzero(dataset.curve_test.values == "tension")]
    told = [
        (str(one.curve_direction.values), f"{one.curve.values}, {one.curve_role.values}", one)
        for one in curves
    ]
    seen = {direction for direction, _, _ in told}
    told += [(str(d), f"{d}, predicted", None) for d in dataset.direction.values if d not in seen]
    fig, axes = style.figure(height_mm=150.0, rows=2, columns=len(told))
    panels.heading(
        fig, "predicted with all inputs uncertain, calibration "
        + dataset.attrs["calibration"].replace("_", " "), 34, dataset,
    )  # fmt: skip
    for column, (direction, title, one) in enumerate(told):
        for row, (quantity, words) in enumerate(_ROWS):
            known = _panel(axes[row, column], one, dataset.sel(direction=direction), quantity)
            lacking = "" if known else "\nnot measured"
            axes[row, column].set_xlabel(f"{words}, {direction} (%){lacking}")
        axes[0, column].set_title(
            f"({panels.LETTERS[column]}) {title.replace('_', ' ')}", loc="left", fontsize=7
        )
        for ax in axes[:, column]:
            ax.set_ylim(bottom=0.0)
            ax.set_ylabel("force per width (N/mm)" if column == 0 else "")
    handles = {
        "measured, band of the runs": Line2D([], [], linestyle="none", marker="o", markersize=3.2,
                          markerfacecolor="none", color=style.BLACK),
        "median": Line2D([], [], color=style.BLUE),
        "50 %": Patch(color=style.BLUE, alpha=_ALPHA[50]),
        "95 %": Patch(color=style.BLUE, alpha=_ALPHA[95]),
        "95 % before any curve": Patch(color=style.GREY, alpha=_PRIOR),
    }  # fmt: skip
    panels.legend(
        fig, handles, ncols=5, note=f"Bands: {dataset.attrs['band_covers']}. {_decides(dataset)}"
    )
    return fig


def _decides(dataset):
    """What the predicted strain hangs on most, in words."""
    said = []
    for direction, tests in json.loads(dataset.attrs["next_tests"]).items():
        what, left = next((one for one in tests if "pull" not in one[0]), tests[0])
        said.append(f"{direction}: {what}, leaves {100 * left:.0f} %")
    return "To narrow the band, measure next, " + "; ".join(said) + " of its deviation."


def _panel(ax, one, predicted, quantity):
    """Draw what was predicted and, of the measured test ``one``, if any, measured; whether it was."""
    force = from_si(predicted.predicted_force_per_width.values, FORCE)
    own = np.isfinite(predicted[f"predicted_{quantity}"].values)

    def fill(name, **look):
        low, high = from_si(predicted[name].values.T, "percent")
        ax.fill_betweenx(force[own], low[own], high[own], linewidth=0, **look)

    fill(f"prior_{quantity}_band", color=style.GREY, alpha=_PRIOR)
    fill(f"predicted_{quantity}_band", color=style.BLUE, alpha=_ALPHA[95])
    fill(f"predicted_{quantity}_band_50", color=style.BLUE, alpha=_ALPHA[50])
    middle = from_si(predicted[f"predicted_{quantity}"].values, "percent")
    ax.plot(middle[own], force[own], color=style.BLUE)
    ax.grid(True)
    if one is None or not np.isfinite(one[f"shifted_{quantity}"].values).any():
        return False
    strain = from_si(one[f"shifted_{quantity}"].values, "percent")
    measured = from_si(one.measured_force_per_width.values, FORCE)
    look = {"color": style.BLACK, "linestyle": "none", "zorder": 3.0}
    if quantity == "strain":
        low, high = (
            from_si(one[f"shifted_strain_{end}"].values, "percent") for end in ("low", "high")
        )
        if np.isfinite(low).any():
            ax.errorbar(
                strain,
                measured,
                xerr=[strain - low, high - strain],
                linewidth=0.6,
                capsize=1.5,
                **look,
            )
    ax.plot(strain, measured, marker="o", markersize=3.2, markerfacecolor="none", **look)
    return True

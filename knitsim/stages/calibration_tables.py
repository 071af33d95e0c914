"""The tables of calibrations and predictions: numbers, and what they mean in words."""

import json

import numpy as np

from knitsim.measured.test import LOADING, loading_at
from knitsim.store.reader import opened
from knitsim.store.timing import write_csv
from knitsim.study.measured_keys import GIVEN

CALIBRATION_COLUMNS = (
    "fabric", "calibration", "name", "value", "units", "low", "high", "start", "lowest", "highest",
    "correlated_with", "correlation", "fitted_to", "misfit", "trials", "failed", "says",
)  # fmt: skip
PREDICTION_COLUMNS = (
    "fabric", "calibration", "test", "name", "at", "value", "low", "high", "band", "units",
    "measured", "misfit", "says",
)  # fmt: skip
# Parts of the largest force at which predictions stand in the table.
PARTS = (0.1, 0.25, 0.5, 1.0)
SPREAD = "(all)"  # stands for all calibrations, in rows that compare them; none can have this name
# rms misfit up to which a curve is called so.
_GRADES = ((0.03, "very well"), (0.08, "well"), (0.15, "fairly"), (0.30, "roughly"))
ROUGHLY = _GRADES[-1][0]  # beyond, a curve is not agreed with
_ONE_SIDED = 0.8  # part of the rms misfit that is mean misfit, for the model to be one-sided


def grade(rms, mean, softer="too soft", stiffer="too stiff"):
    """A misfit in words; rms, mean of (model - measured)/measured, the model's strain above 0."""
    if not np.isfinite(rms):
        return "not reached by the model"
    how = next((word for limit, word in _GRADES if rms <= limit), "not at all")
    text = f"agrees {how}: {100 * rms:.3g} % rms"
    if abs(mean) >= _ONE_SIDED * rms:
        text += f", {softer if mean > 0 else stiffer} throughout by {abs(100 * mean):.3g} %"
    return text


def _number(value):
    return f"{value:.6g}" if np.isfinite(value) else ""


def _datasets(files):
    """(fabric, calibration, dataset) of each result file."""
    for dataset in opened(files):
        yield dataset.attrs["fabric"], dataset.attrs["calibration"], dataset.load()


def calibration_rows(fabric, name, dataset):
    """Rows of CALIBRATION_COLUMNS: one for each parameter, one for the fit as a whole."""
    if name == GIVEN:
        return []
    fitted = [
        str(c) for c, role in zip(dataset.curve.values, dataset.curve_role.values, strict=True)
        if role == "fitted"
    ]  # fmt: skip
    rows = []
    parameters = dataset.parameter.values.tolist()
    for i, parameter in enumerate(parameters):
        one = dataset.isel(parameter=i)
        other, value = "", np.nan
        if len(parameters) > 1:
            row = np.abs(one.correlation.values.copy())
            row[i] = -1.0
            other, value = parameters[int(row.argmax())], float(one.correlation[int(row.argmax())])
        low, high = one.fitted_interval.values
        rows.append((
            fabric, name, parameter, _number(one.fitted_value), str(one.parameter_units.values),
            _number(low), _number(high), _number(one.start_value),
            *map(_number, one.parameter_bound.values), other, _number(value), "; ".join(fitted),
            "", "", "", _of_parameter(float(one.fitted_value), low, high, one.parameter_bound.values)
            if "posterior_over_prior" not in one
            else f"{100.0 * float(one.posterior_over_prior):.3g} % of its deviation is left",
        ))  # fmt: skip
    says = [f"{c}: {grade(float(m.misfit_rms), float(m.misfit_mean))}" for c, m in _curves(dataset)
            if c in fitted]  # fmt: skip
    for kind in ("warnings", "notes"):
        says += json.loads(dataset.attrs[kind])
    rows.append((
        fabric, name, "all", "", "", "", "", "", "", "", "", "", "; ".join(fitted),
        _number(float(dataset.fit_misfit)), int(dataset.fit_evaluations), int(dataset.fit_failed),
        "; ".join(says),
    ))  # fmt: skip
    return rows


def _of_parameter(value, low, high, bounds):
    """How well a parameter is known, in words."""
    if (low, high) == tuple(bounds):
        return "not determined by the data: its interval is all that is allowed"
    for end, bound in zip(("lowest", "highest"), bounds, strict=True):
        if value == bound:
            return (
                f"on its {end} value allowed: the data want it beyond (bounds: of the calibration "
                "moves it)"
            )
    text = f"within {50.0 * (high - low) / abs(value):.3g} % (95 %)"
    cut = [end for end, at, bound in (("lowest", low, bounds[0]), ("highest", high, bounds[1]))
           if at == bound]  # fmt: skip
    return text + (f"; its interval reaches the {cut[0]} value allowed" if cut else "")


def _curves(dataset):
    """(name, dataset) of each measured curve."""
    for k, name in enumerate(dataset.curve.values):
        yield str(name), dataset.isel(curve=k)


def prediction_rows(fabric, name, dataset):
    """Rows of PREDICTION_COLUMNS of one calibration."""
    rows, band = [], dataset.attrs["band_covers"]
    for k, spacing in enumerate(dataset.spacing.values):
        value, stated = float(dataset.predicted_spacing[k]), float(dataset.stated_spacing[k])
        part = value / stated - 1.0
        low, high = dataset.predicted_spacing_band.values[k]
        rows.append((
            fabric, name, "at rest", f"{spacing} spacing", "", _number(value), _number(low),
            _number(high), band, "m", _number(stated), _number(part),
            f"{100 * part:+.3g} % from the stated one" if np.isfinite(stated) else "no density is stated",
        ))  # fmt: skip
    for curve, one in _curves(dataset):
        role = "fitted" if str(one.curve_role.values) == "fitted" else "predicted"
        rms, mean = float(one.misfit_rms), float(one.misfit_mean)
        says = f"{role}; {grade(rms, mean, *_sides(one))}"
        if np.isfinite(one.share_in_band):
            says += f"; {100 * float(one.share_in_band):.0f} % of the points in the measured band"
        test = f"{one.curve_test.values} {one.curve_direction.values}"
        rows.append((
            fabric, name, test, f"misfit of {curve}", "all points", _number(rms), "", "", "", "1",
            "", _number(rms), says,
        ))  # fmt: skip
    for direction, i, quantity, what in _asked(dataset):
        at = float(dataset.predicted_force_per_width[i])
        one = dataset.sel(direction=direction)
        value = float(one[f"predicted_{quantity}"][i])
        low, high = one[f"predicted_{quantity}_band"].values[i]
        measured, misfit, says = _beside(one, quantity, at, value)
        rows.append((
            fabric, name, f"tension {direction}", what, f"{at:.6g} N/m", _number(value),
            _number(low), _number(high), band, "1", _number(measured), _number(misfit), says,
        ))  # fmt: skip
    return rows + _judged(fabric, name, dataset)


def _judged(fabric, name, dataset):
    """Rows of how tests that were left out were predicted, where all inputs are uncertain, and of the
    measurements that would narrow a prediction most."""
    rows = []
    for k in range(dataset.sizes.get("scored", 0)):
        one = dataset.isel(scored=k)
        rows.append((
            fabric, name, f"{one.scored_test.values} {one.scored_quantity.values}",
            f"CRPS from {one.scored_fitted.values}", "all points", _number(float(one.score_crps)), "", "", "",
            "1", "", _number(float(one.score_rms)),
            f"{100 * float(one.score_inside_50):.0f} and {100 * float(one.score_inside_95):.0f} % of "
            f"{int(one.score_points)} points in the 50 and 95 % bands, {100 * float(one.score_rms):.3g} "
            "% off (rms)",
        ))  # fmt: skip
    for direction, tests in json.loads(dataset.attrs.get("next_tests", "{}")).items():
        for what, left in tests:
            rows.append((
                fabric, name, f"tension {direction}", f"next measurement: {what}", "", _number(left), "", "",
                "", "1", "", "", f"leaves {100 * left:.3g} % of the deviation of the predicted strain",
            ))  # fmt: skip
    return rows


def _asked(dataset):
    """(direction, number of the state, quantity, its name) of each predicted strain in the table."""
    force = dataset.predicted_force_per_width.values
    for direction in dataset.direction.values:
        for part in PARTS:
            i = int(np.abs(force - part * force[-1]).argmin())
            for quantity, what in (("strain", "strain"), ("transverse_strain", "lateral strain")):
                yield str(direction), i, quantity, what


def _beside(predicted, quantity, at, value):
    """(measured value, misfit, words) beside a predicted strain at the force per width ``at`` (N/m).

    Measured curves are read between their points, never beyond; the first number is of a fitted one,
    if there is any.
    """
    pretension = float(predicted.predicted_pretension)
    if not np.isfinite(value):
        below = at < pretension
        return np.nan, np.nan, "below the pretension" if below else "not reached by the model"
    found = {}
    for name, one in _curves(predicted):
        if (str(one.curve_test.values), str(one.curve_direction.values)) != (
            "tension", str(predicted.direction.values),
        ):  # fmt: skip
            continue
        force, strain = one.measured_force_per_width.values, one[f"shifted_{quantity}"].values
        own = np.isfinite(strain) & (one.measured_phase.values == LOADING)
        if not own.any():
            continue
        measured = float(loading_at(at, force[own], strain[own]))
        if np.isfinite(measured) and measured:
            fitted = str(one.curve_role.values) == "fitted"
            found[name] = measured, value / measured - 1.0, fitted
    if not found:
        return np.nan, np.nan, ""
    says = "; ".join(f"{100 * misfit:+.3g} % from {name}" for name, (_, misfit, _) in found.items())
    measured, misfit, _ = max(found.values(), key=lambda one: one[2])
    return measured, misfit, says


def _sides(one):
    if str(one.curve_test.values) == "bending":
        return "too stiff", "too soft"
    return "too soft", "too stiff"


def spread_rows(fabric, datasets):
    """How far the predictions of all calibrations of a fabric lie apart; datasets by name."""
    if len(datasets) < 2:
        return []
    rows = []
    first = next(iter(datasets.values()))
    for direction, i, quantity, what in _asked(first):
        values = np.array([
            float(d[f"predicted_{quantity}"].sel(direction=direction)[i]) for d in datasets.values()
        ])  # fmt: skip
        values = values[np.isfinite(values)]
        if len(values) < 2:
            continue
        middle = float(values.mean())
        apart = (values.max() - values.min()) / abs(middle) if middle else np.nan
        rows.append((
            fabric, SPREAD, f"tension {direction}", what,
            f"{float(first.predicted_force_per_width[i]):.6g} N/m", _number(middle),
            _number(values.min()), _number(values.max()), "least and largest of the choices", "1",
            "", "",
            f"{len(values)} choices of parameters lie {100 * apart:.3g} % of their mean apart",
        ))  # fmt: skip
    return rows


def write_tables(files, calibration, prediction):
    """Write both tables from the result files ``measured/<fabric>/<calibration>.nc``."""
    calibrations, predictions, of_fabric = [], [], {}
    for fabric, name, dataset in _datasets(files):
        calibrations += calibration_rows(fabric, name, dataset)
        predictions += prediction_rows(fabric, name, dataset)
        of_fabric.setdefault(fabric, {})[name] = dataset
    for fabric, datasets in of_fabric.items():
        predictions += spread_rows(fabric, datasets)
    write_csv(calibration, CALIBRATION_COLUMNS, calibrations)
    write_csv(prediction, PREDICTION_COLUMNS, predictions)

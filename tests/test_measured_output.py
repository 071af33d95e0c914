"""Tables and figures of calibrations, from result files with known numbers in them."""

import csv
import json

import numpy as np
import pytest
import xarray as xr

from knitsim.figures import measured as figures
from knitsim.figures import style
from knitsim.stages.calibration_tables import (
    CALIBRATION_COLUMNS,
    PREDICTION_COLUMNS,
    grade,
    prediction_rows,
    write_tables,
)
from knitsim.store.results import labels_of
from knitsim.store.writer import describe, write

FORCE = np.linspace(25.0, 300.0, 12)  # N/m
POINTS = 6


def curve(force, stiffness):
    return 0.3 * (force / stiffness) ** 0.5


def made(names, stiffness, misfit=0.0, bends=True, pretension=0.0, name="core"):
    """A result file in memory: strain 0.3 sqrt(force/stiffness) wale-wise, twice that course-wise.

    pretension (N/m): from which wale strain is predicted; it was measured from rest.
    """
    n = len(names)
    force = np.linspace(40.0, 280.0, POINTS)
    strain = np.full((2, POINTS), np.nan)
    strain[0] = curve(force, 300.0)
    model = strain * (1.0 + misfit)
    predicted = np.stack([2.0 * curve(FORCE, stiffness), curve(FORCE, stiffness)])
    predicted[1] = (1.0 + predicted[1]) / (1.0 + curve(pretension, stiffness)) - 1.0
    band = np.stack([0.9 * predicted, 1.1 * predicted], axis=-1)
    curvature = np.linspace(-100.0, 100.0, 5)
    moment = np.stack([2e-5 * curvature, 1e-5 * curvature])
    data = {
        "fitted_value": ("parameter", np.arange(1.0, n + 1.0)),
        "fitted_interval": (("parameter", "bound"), np.array([[k, k + 2.0] for k in range(n)]).reshape(n, 2)),
        "start_value": ("parameter", np.ones(n)),
        "parameter_bound": (("parameter", "bound"), np.tile([0.0, 5.0], (n, 1))),
        "correlation": (("parameter", "other_parameter"), np.where(np.eye(n) == 1, 1.0, -0.97)),
        "fit_misfit": abs(misfit), "fit_evaluations": 17, "fit_failed": 1,
        "profile_value": (("parameter", "profile_point"), np.tile(np.arange(5.0), (n, 1))),
        "profile_misfit": (("parameter", "profile_point"), np.tile((np.arange(5.0) - 1) ** 2, (n, 1))),
        "misfit_rms": ("curve", [abs(misfit), np.nan]),
        "misfit_mean": ("curve", [misfit, np.nan]),
        "misfit_largest": ("curve", [abs(misfit), np.nan]),
        "share_in_band": ("curve", [0.75, np.nan]),
        "pretension": ("curve", [0.0, np.nan]),
        "measured_phase": (("curve", "sample"), np.zeros((2, POINTS), dtype=np.int8)),
        "predicted_force_per_width": ("state", FORCE),
        "predicted_pretension": ("direction", [0.0, pretension]),
        "predicted_strain": (("direction", "state"), predicted),
        "predicted_strain_band": (("direction", "state", "bound"), band),
        "predicted_transverse_strain": (("direction", "state"), -0.5 * predicted),
        "predicted_transverse_strain_band": (("direction", "state", "bound"), -0.5 * band[..., ::-1]),
        "predicted_spacing": ("spacing", [3e-3, 2.1e-3]),
        "predicted_spacing_band": (("spacing", "bound"), [[2.9e-3, 3.1e-3], [2.0e-3, 2.2e-3]]),
        "stated_spacing": ("spacing", [2.5e-3, 2.0e-3]),
    }  # fmt: skip
    nothing = np.full((2, POINTS), np.nan)
    zero = curve(pretension, 300.0)
    shifted = (1.0 + strain) / (1.0 + zero) - 1.0
    bent, moments = nothing.copy(), nothing.copy()
    bent[1], moments[1] = np.linspace(-50.0, 50.0, POINTS), np.linspace(-1e-3, 1e-3, POINTS)
    for field, values in {
        "measured_strain": strain, "measured_strain_low": 0.9 * strain,
        "measured_strain_high": 1.1 * strain, "shifted_strain": shifted,
        "shifted_strain_low": shifted - 0.01, "shifted_strain_high": shifted + 0.01,
        "shifted_transverse_strain": nothing,
        "measured_force_per_width": np.stack([force, np.full(POINTS, np.nan)]),
        "measured_transverse_strain": nothing, "model_strain": model, "measured_curvature": bent,
        "measured_moment_per_width": moments, "model_moment_per_width": 1.2 * moments,
        "model_moment_per_width_low": 1.1 * moments, "model_moment_per_width_high": 1.3 * moments,
    }.items():  # fmt: skip
        data[field] = (("curve", "sample"), values)
    if bends:
        data["predicted_curvature"] = ("bent_state", curvature)
        data["predicted_moment_per_width"] = (("direction", "bent_state"), moment)
        data["predicted_moment_per_width_band"] = (
            ("direction", "bent_state", "bound"), np.stack([0.9 * moment, 1.1 * moment], axis=-1),
        )  # fmt: skip
    units = {"core_diameter": "m", "friction": "1", "bending_rigidity": "N m2"}

    def words(values):
        return np.array(values, dtype=object)

    coords = {
        "parameter": words(names), "other_parameter": words(names),
        "parameter_units": ("parameter", words([units[name] for name in names])),
        "bound": ["low", "high"], "direction": ["course", "wale"], "spacing": ["wale", "course"],
        "curve": words(["pulled", "bent"]), "curve_test": ("curve", words(["tension", "bending"])),
        "curve_direction": ("curve", words(["wale", "course"])),
        "curve_role": ("curve", words(["fitted" if n else "predicted", "predicted"])),
    }  # fmt: skip
    dataset = xr.Dataset(data, coords)
    dataset.attrs |= {
        "band_covers": "95 %, fit and numerical error" if n else "numerical error only",
        "notes": json.dumps(["friction = 0.9: no equilibrium"] if n else []),
        "warnings": json.dumps(["the data cannot tell them apart"] if n > 1 else []),
    }
    labels = labels_of("calibration", "jersey", "soft", calibration=name)
    return describe(
        dataset, "calibration", labels, title="t", summary="s", references=("munden",),
        configuration={"name": "jersey"}, assumptions=[], modules=["knitsim.units"],
    )  # fmt: skip


CALIBRATIONS = {
    "core": (["core_diameter"], 300.0, 0.05),
    "as_given": ([], 150.0, 0.25),
    "both": (["core_diameter", "friction"], 600.0, -0.01),
}


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """(calibration rows, prediction rows) of three result files."""
    folder = tmp_path_factory.mktemp("tables")
    files = []
    for name, given in CALIBRATIONS.items():
        files.append(folder / f"measured/jersey/{name}.nc")
        write(made(*given, name=name), files[-1])
    write_tables(files, folder / "calibration.csv", folder / "prediction.csv")
    found = []
    for name, columns in (("calibration", CALIBRATION_COLUMNS), ("prediction", PREDICTION_COLUMNS)):
        with (folder / f"{name}.csv").open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        assert tuple(rows[0]) == columns
        found.append(rows)
    return found


def test_the_calibration_table_holds_every_parameter_and_the_fit(tables):
    rows = {(row["calibration"], row["name"]): row for row in tables[0]}
    assert list(rows) == [
        ("core", "core_diameter"), ("core", "all"), ("both", "core_diameter"), ("both", "friction"),
        ("both", "all"),
    ]  # fmt: skip
    one = rows["both", "friction"]
    assert (one["value"], one["low"], one["high"], one["units"]) == ("2", "1", "3", "1")
    assert (one["correlated_with"], one["correlation"]) == ("core_diameter", "-0.97")
    assert one["says"] == "within 50 % (95 %)"
    # 1 within 0 to 2, and 0 is the lowest value allowed.
    assert rows["core", "core_diameter"]["says"] == (
        "within 100 % (95 %); its interval reaches the lowest value allowed"
    )
    assert rows["core", "core_diameter"]["correlated_with"] == ""
    whole = rows["both", "all"]
    assert (whole["fitted_to"], whole["trials"], whole["failed"]) == ("pulled", "17", "1")
    assert float(whole["misfit"]) == 0.01
    for text in ("very well", "1 % rms", "cannot tell", "no equilibrium"):
        assert text in whole["says"]


def test_the_prediction_table_says_how_good_every_test_is(tables):
    rows = {(r["calibration"], r["test"], r["name"], r["at"]): r for r in tables[1]}
    pulled = rows["as_given", "tension wale", "misfit of pulled", "all points"]
    assert pulled["says"].startswith("predicted; agrees roughly: 25 % rms, too soft throughout")
    assert "75 % of the points in the measured band" in pulled["says"]
    fitted = rows["both", "tension wale", "misfit of pulled", "all points"]
    assert fitted["says"].startswith("fitted; agrees very well: 1 % rms, too stiff throughout")
    bent = rows["both", "bending course", "misfit of bent", "all points"]
    assert (bent["value"], bent["says"]) == ("", "predicted; not reached by the model")
    rest = rows["core", "at rest", "wale spacing", ""]
    assert (rest["value"], rest["measured"], rest["low"]) == ("0.003", "0.0025", "0.0029")
    assert rest["says"] == "+20 % from the stated one"
    strain = rows["core", "tension course", "strain", "300 N/m"]
    assert (float(strain["value"]), float(strain["low"])) == pytest.approx((0.6, 0.54))


def test_measured_strain_stands_beside_the_predicted_one_within_its_range(tables):
    rows = {(r["calibration"], r["test"], r["name"], r["at"]): r for r in tables[1]}
    for force in (75.0, 150.0):
        own = rows["as_given", "tension wale", "strain", f"{force:g} N/m"]
        # Measured every 48 N/m, of which the chord is read: below the curve by up to
        # h^2/8 of the second derivative.
        chord = 48.0**2 / 8.0 * 0.25 * 0.3 / 300.0**0.5 * (force - 48.0) ** -1.5
        assert curve(force, 300.0) - chord <= float(own["measured"]) <= curve(force, 300.0)
        assert float(own["misfit"]) == pytest.approx(
            float(own["value"]) / float(own["measured"]) - 1.0, abs=2e-5
        )
        assert own["says"] == f"{100 * float(own['misfit']):+.3g} % from pulled"
    # Neither below nor above the measured forces, 40 to 280 N/m, nor in the other direction.
    for at, test in (("25 N/m", "wale"), ("300 N/m", "wale"), ("75 N/m", "course")):
        own = rows["as_given", f"tension {test}", "strain", at]
        assert own["measured"] == own["misfit"] == own["says"] == ""
    assert rows["as_given", "tension wale", "lateral strain", "75 N/m"]["measured"] == ""


def test_the_table_says_what_a_band_covers(tables):
    bands = {row["calibration"]: row["band"] for row in tables[1] if row["low"]}
    assert bands == {
        "core": "95 %, fit and numerical error", "both": "95 %, fit and numerical error",
        "as_given": "numerical error only", "(all)": "least and largest of the choices",
    }  # fmt: skip


def test_strain_measured_from_rest_is_compared_from_the_pretension():
    dataset = made(["core_diameter"], 300.0, pretension=88.0)
    (row,) = [
        row for row in prediction_rows("jersey", "core", dataset)
        if row[2:5] == ("tension wale", "strain", "150 N/m")
    ]  # fmt: skip
    # The model is the curve that was measured; 88 N/m is one of the measured points.
    zero = curve(88.0, 300.0)
    assert float(row[5]) == pytest.approx((1 + curve(150.0, 300.0)) / (1 + zero) - 1, rel=1e-5)
    assert float(row[10]) == pytest.approx(float(row[5]), rel=0.02)
    with style.context():
        fig = figures.fig30_calibration({"core": dataset})
    points = next(line for line in fig.axes[0].get_lines() if line.get_marker() == "o").get_xdata()
    strain = curve(np.linspace(40.0, 280.0, POINTS), 300.0)
    assert points == pytest.approx(100 * ((1 + strain) / (1 + zero) - 1))
    assert fig.axes[0].get_xlabel() == "wale strain from 0.088 N/mm (%)"


def test_the_spread_of_all_calibrations_is_a_row_of_its_own(tables):
    rows = {(r["test"], r["name"], r["at"]): r for r in tables[1] if r["calibration"] == "(all)"}
    own = rows["tension course", "strain", "300 N/m"]
    values = 0.6 * np.sqrt([300 / 300.0, 300 / 150.0, 300 / 600.0])
    assert float(own["value"]) == pytest.approx(values.mean(), rel=1e-5)
    assert float(own["low"]) == pytest.approx(values.min(), rel=1e-5)
    assert float(own["high"]) == pytest.approx(values.max(), rel=1e-5)
    apart = 100 * np.ptp(values) / values.mean()
    assert own["says"] == f"3 choices of parameters lie {apart:.3g} % of their mean apart"


def test_words_follow_the_numbers():
    assert grade(0.02, 0.001) == "agrees very well: 2 % rms"
    assert grade(0.07, -0.01) == "agrees well: 7 % rms"
    assert grade(0.12, 0.12) == "agrees fairly: 12 % rms, too soft throughout by 12 %"
    assert grade(0.5, -0.5) == "agrees not at all: 50 % rms, too stiff throughout by 50 %"
    assert grade(np.nan, np.nan) == "not reached by the model"


def datasets():
    return {name: made(*given, name=name) for name, given in CALIBRATIONS.items()}


def lines_of(ax):
    return [line for line in ax.get_lines() if line.get_linestyle() not in ("None", "")]


def test_a_panel_for_each_calibration_with_its_measured_points():
    with style.context():
        fig = figures.fig30_calibration(datasets())
    shown = [ax for ax in fig.axes if ax.get_visible()]
    titles = [ax.get_title(loc="left") for ax in shown]
    assert titles == ["(a) no calibration: as given", "(b) core", "(c) both"]
    for ax, name in zip(shown, figures.ordered(datasets()), strict=True):
        given = CALIBRATIONS[name]
        model = max(lines_of(ax), key=lambda line: len(line.get_xdata()))
        assert model.get_xdata() == pytest.approx(100 * curve(FORCE, given[1])), name
        assert model.get_ydata() == pytest.approx(1e-3 * FORCE)
        points = [line for line in ax.get_lines() if line.get_marker() == "o"]
        assert points[0].get_xdata() == pytest.approx(
            100 * curve(np.linspace(40.0, 280.0, POINTS), 300.0)
        )
    texts = " ".join(text.get_text() for text in shown[2].texts)
    assert "core diameter 1e+03 mm [0, 2e+03]" in texts
    labels = [text.get_text() for text in shown[2].get_legend().get_texts()]
    assert labels[0] == "measured: pulled, fitted, 1.0 % rms"


def test_predictions_stand_side_by_side():
    with style.context():
        fig = figures.fig31_prediction(datasets())
    course, lateral, bending = fig.axes[:3]
    assert course.get_title(loc="left") == "(a) course: predicted"
    assert fig.axes[3].get_title(loc="left") == "(d) wale: fitted"
    ends = sorted(line.get_xdata()[-1] for line in lines_of(course))
    assert ends == pytest.approx(sorted(60 * np.sqrt([1.0, 2.0, 0.5])))
    assert len(lines_of(lateral)) == len(lines_of(bending)) == 3
    # A bending test was measured course-wise: the model as it goes through that test.
    assert bending.get_ylabel() == "moment, mean of both ways (mN)"
    assert fig.axes[5].get_ylabel() == "moment, first bending (mN)"
    points = next(line for line in bending.get_lines() if line.get_marker() == "o")
    for line in lines_of(bending):
        assert line.get_xdata() == pytest.approx(points.get_xdata())
        assert line.get_ydata() == pytest.approx(1.2 * points.get_ydata())
    assert max(line.get_xdata().max() for line in lines_of(fig.axes[5])) == pytest.approx(1.0)
    # What is equal shows as a narrow line on a wide one.
    widths = [line.get_linewidth() for line in lines_of(course)]
    assert widths == sorted(widths, reverse=True) and len(set(widths)) == 3
    assert fig.legends[0].get_title().get_text() == (
        "Bands: as given: numerical error only; calibrated: 95 %, fit and numerical error."
        "  Inputs as given count as known."
    )
    assert [text.get_text() for text in fig.legends[0].get_texts()] == [
        "no calibration: as given", "core", "both", "measured: bent", "measured: pulled",
    ]  # fmt: skip
    with style.context():
        flat = figures.fig31_prediction({"core": made(*CALIBRATIONS["core"], bends=False)})
    # Without predicted bending the measured one is shown.
    assert len(flat.axes) == 6


def test_profiles_have_a_panel_for_each_parameter():
    with style.context():
        fig = figures.fig32_misfit_profile(datasets())
    assert [ax.get_xlabel() for ax in fig.axes] == ["core diameter (mm)", "friction (1)"]
    lines = [line for line in lines_of(fig.axes[0]) if len(line.get_xdata()) == 5]
    assert len(lines) == 2
    assert lines[0].get_xdata() == pytest.approx(1e3 * np.arange(5.0))
    # Four times the worst fit, 5 %; a profile that stays below is shown as far as it goes.
    assert fig.axes[0].get_ylim() == pytest.approx((0.0, 1.05 * 20.0))
    low = made(["core_diameter"], 300.0, 0.7)
    low.profile_misfit[:] = np.linspace(0.67, 0.99, 5)
    with style.context():
        fig = figures.fig32_misfit_profile({"core": low})
    assert fig.axes[0].get_ylim() == pytest.approx((0.0, 1.05 * 99.0))


def test_figures_are_written_the_same_every_time(tmp_path):
    written = []
    for k in range(2):
        with style.context():
            fig = figures.fig32_misfit_profile(datasets())
            paths = style.save(fig, tmp_path / f"{k}" / "fig32_misfit_profile")
        written.append([path.read_bytes() for path in paths])
    assert written[0] == written[1]

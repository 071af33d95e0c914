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
    write_tables,
)
from knitsim.store.writer import describe, write

FORCE = np.linspace(25.0, 300.0, 12)  # N/m
POINTS = 6


def curve(force, stiffness):
    return 0.3 * (force / stiffness) ** 0.5


def made(names, stiffness, misfit=0.0, bends=True):
    """A result file in memory: strain 0.3 sqrt(force/stiffness) wale-wise, twice that course-wise."""
    n = len(names)
    force = np.linspace(40.0, 280.0, POINTS)
    strain = np.full((2, POINTS), np.nan)
    strain[0] = curve(force, 300.0)
    model = strain * (1.0 + misfit)
    predicted = np.stack([2.0 * curve(FORCE, stiffness), curve(FORCE, stiffness)])
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
        "predicted_strain": (("direction", "state"), predicted),
        "predicted_strain_band": (("direction", "state", "bound"), band),
        "predicted_transverse_strain": (("direction", "state"), -0.5 * predicted),
        "predicted_transverse_strain_band": (("direction", "state", "bound"), -0.5 * band[..., ::-1]),
        "predicted_spacing": ("spacing", [3e-3, 2.1e-3]),
        "predicted_spacing_band": (("spacing", "bound"), [[2.9e-3, 3.1e-3], [2.0e-3, 2.2e-3]]),
        "stated_spacing": ("spacing", [2.5e-3, 2.0e-3]),
    }  # fmt: skip
    nothing = np.full((2, POINTS), np.nan)
    bent, moments = nothing.copy(), nothing.copy()
    bent[1], moments[1] = np.linspace(-50.0, 50.0, POINTS), np.linspace(-1e-3, 1e-3, POINTS)
    for field, values in {
        "measured_strain": strain, "measured_strain_low": 0.9 * strain,
        "measured_strain_high": 1.1 * strain,
        "measured_force_per_width": np.stack([force, np.full(POINTS, np.nan)]),
        "measured_transverse_strain": nothing, "model_strain": model, "measured_curvature": bent,
        "measured_moment_per_width": moments, "model_moment_per_width": nothing,
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
        "notes": json.dumps(["friction = 0.9: no equilibrium"] if n else []),
        "warnings": json.dumps(["the data cannot tell them apart"] if n > 1 else []),
    }
    return describe(
        dataset, title="t", summary="s", references=("munden",), configuration={"name": "jersey"},
        assumptions=[], modules=["knitsim.units"],
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
        write(made(*given), files[-1])
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


def test_the_spread_of_all_calibrations_is_a_row_of_its_own(tables):
    rows = {(r["test"], r["name"], r["at"]): r for r in tables[1] if r["calibration"] == "all"}
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
    return {name: made(*given) for name, given in CALIBRATIONS.items()}


def lines_of(ax):
    return [line for line in ax.get_lines() if line.get_linestyle() not in ("None", "")]


def test_a_panel_for_each_calibration_with_its_measured_points():
    with style.context():
        fig = figures.fig30_calibration(datasets())
    shown = [ax for ax in fig.axes if ax.get_visible()]
    titles = [ax.get_title(loc="left") for ax in shown]
    assert titles == ["(a) no calibration: as given", "(b) core", "(c) both"]
    for ax, (name, given) in zip(shown, figures.ordered(CALIBRATIONS).items(), strict=True):
        model = max(lines_of(ax), key=lambda line: len(line.get_xdata()))
        assert model.get_xdata() == pytest.approx(100 * curve(FORCE, given[1])), name
        assert model.get_ydata() == pytest.approx(1e-3 * FORCE)
        points = [line for line in ax.get_lines() if line.get_marker() == "o"]
        assert points[0].get_xdata() == pytest.approx(
            100 * curve(np.linspace(40.0, 280.0, POINTS), 300.0)
        )
    texts = " ".join(text.get_text() for text in shown[2].texts)
    assert "core diameter 1e+03 mm [0, 2e+03]" in texts
    assert "pulled (fitted): 1.0 % rms" in texts


def test_predictions_stand_side_by_side():
    with style.context():
        fig = figures.fig31_prediction(datasets())
    course, lateral, bending = fig.axes[:3]
    assert course.get_title(loc="left") == "(a) course: predicted"
    assert fig.axes[3].get_title(loc="left") == "(d) wale: fitted"
    ends = sorted(line.get_xdata()[-1] for line in lines_of(course))
    assert ends == pytest.approx(sorted(60 * np.sqrt([1.0, 2.0, 0.5])))
    assert len(lines_of(lateral)) == len(lines_of(bending)) == 3
    assert [text.get_text() for text in fig.legends[0].get_texts()] == [
        "no calibration: as given", "core", "both",
    ]  # fmt: skip
    with style.context():
        flat = figures.fig31_prediction({"core": made(*CALIBRATIONS["core"], bends=False)})
    assert len(flat.axes) == 4


def test_profiles_have_a_panel_for_each_parameter():
    with style.context():
        fig = figures.fig32_misfit_profile(datasets())
    assert [ax.get_xlabel() for ax in fig.axes] == ["core diameter (mm)", "friction (1)"]
    lines = [line for line in lines_of(fig.axes[0]) if len(line.get_xdata()) == 5]
    assert len(lines) == 2
    assert lines[0].get_xdata() == pytest.approx(1e3 * np.arange(5.0))


def test_figures_are_written_the_same_every_time(tmp_path):
    written = []
    for k in range(2):
        with style.context():
            fig = figures.fig32_misfit_profile(datasets())
            paths = style.save(fig, tmp_path / f"{k}" / "fig32_misfit_profile")
        written.append([path.read_bytes() for path in paths])
    assert written[0] == written[1]

"""The stage of calibrations: measured curves as a fit takes them, and a fit from end to end."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from measured_tools import tension

from knitsim.command.predict import said
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.figures.inferred import fig34_prediction_bands
from knitsim.measured.read import measured_test
from knitsim.stages import calibration as stage
from knitsim.stages import sensitivity
from knitsim.stages.calibration_tables import prediction_rows
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.stages.laws import ledger_laws
from knitsim.store.writer import write
from knitsim.study.measured_checks import config_of, names_of
from knitsim.study.measured_keys import GIVEN
from knitsim.study.study import load_study

CONFIG = Path(__file__).parents[1] / "config"
TRUTH = 1.3  # times the stated bending rigidity
TOP = 60.0  # N/m


def test_points_that_say_nothing_are_left_out():
    strain, force = [0.0, 0.1, 0.2, 0.3, 0.25, 0.1, 0.05], [0.0, 5.0, 10.0, 30.0, 31.0, 8.0, -0.1]
    one = tension("wale", "wale", force, strain, phase=[0, 0, 0, 0, 1, 1, 1]).to_fit()
    # No strain, more than the largest force of loading, less than none.
    assert list(one["strain"]) == [0.1, 0.2, 0.3, 0.1]
    assert list(one.phase) == [0, 0, 0, 1]
    under = tension("wale", "wale", force[1:4], strain[1:4], pretension=5.0).to_fit()
    assert list(under["force_per_width"]) == [10.0, 30.0]


def test_a_band_without_width_is_no_band():
    strain = np.array([0.1, 0.2, 0.3])
    wide = tension("wale", "wale", [1.0, 2.0, 3.0], strain, low=strain - 0.01, high=strain + 0.01)
    assert wide.to_fit().band[0] == pytest.approx(strain - 0.01)
    assert tension("wale", "wale", [1.0, 2.0, 3.0], strain, low=strain, high=strain).band is None


def test_measured_strain_is_counted_from_the_pretension_of_the_prediction():
    strain, force = np.array([0.1, 0.2, 0.3]), [10.0, 20.0, 40.0]
    one = tension("wale", "wale", force, strain, low=strain - 0.01, high=strain + 0.02)
    assert stage.shifted(one, 0.0) is one
    # 30 N/m lies half way from 0.2 to 0.3; 5 N/m half way from rest to the first point.
    for pretension, zero in ((30.0, 0.25), (5.0, 0.05)):
        shifted = stage.shifted(one, pretension)
        assert shifted["strain"] == pytest.approx((1.0 + strain) / (1.0 + zero) - 1.0)
        assert shifted["strain_high"] == pytest.approx((1.02 + strain) / (1.0 + zero) - 1.0)


@pytest.fixture(scope="module")
def fabric(tmp_path_factory):
    """A fabric whose wale curve was made by the model with a stiffer yarn."""
    folder = tmp_path_factory.mktemp("study")
    shutil.copytree(CONFIG / "small", folder, dirs_exist_ok=True)
    text = (folder / "yarns.yaml").read_text()
    (folder / "yarns.yaml").write_text(text + "  friction: 0\n")
    plain = load_study(folder).fabrics["small"]
    law = ledger_laws(plain.yarn)["continuous"]
    rigidity = plain.yarn["bending_rigidity"]
    true = plain.with_value("yarn.bending_rigidity_N_mm2", TRUTH * rigidity * 1e6)
    rest = relax(solver_fabric(true, law), settings_of(plain).resolution)
    lines = ["strain,force_per_width_N_per_m", "0,0"]
    strains = np.linspace(0.02, 2.0, 100)
    curve = tensile(rest, "wale", strains, to_force=TOP)
    lines += [
        f"{e:.10g},{f:.10g}" for e, f in zip(curve.strain, curve.force_per_width, strict=True)
    ]
    (folder / "wale.csv").write_text("\n".join(lines) + "\n")
    fabrics = yaml.safe_load((folder / "fabrics.yaml").read_text())
    fabrics["small"] |= {
        "measured": {"wale": {"direction": "wale", "file": "wale.csv"}},
        "calibrations": {
            "rigidity": {"fit": ["wale"], "free": ["bending_rigidity"]},
            "late": {"fit": ["wale"], "free": ["set"], "on_request": True},
            "all": {
                "fit": ["wale"],
                "fabrics": 40,
                "on_request": True,
                "use": ["strain"],
                "tolerance": {
                    "bending_rigidity_percent": 60,
                    "loop_length_percent": 1,
                    "diameter_percent": 0,
                    "compression_stiffness_percent": 0,
                    "set_percent": 0,
                    "stretch_percent": 0,
                },
            },
        },
        "prediction": {"to_force_N_per_mm": TOP / 1e3, "states": 8, "max_curvature_per_cm": 0.5},
    }
    (folder / "fabrics.yaml").write_text(yaml.safe_dump(fabrics, sort_keys=False))
    scenes = (folder / "scenes.yaml").read_text()
    (folder / "scenes.yaml").write_text(scenes + "  sensitivity: {friction: false}\n")
    found = load_study(folder).fabrics["small"]
    return found, true, law


def test_names_and_inputs_of_calibrations(fabric):
    small = fabric[0]
    assert names_of(small) == [GIVEN, "rigidity", "late", "all"]
    assert names_of(small, False) == [GIVEN, "rigidity"]
    assert names_of(small, True) == ["late", "all"]
    assert names_of(load_study(CONFIG / "small").fabrics["small"]) == []
    # One calibration does not depend on the others, all on the measured curves.
    assert list(config_of(small, "late")["values"]["calibrations"]) == ["late"]
    assert config_of(small, GIVEN)["values"]["calibrations"] == {}
    assert list(config_of(small, GIVEN)["values"]["measured"]) == ["wale"]


def test_forces_and_curvatures_that_are_asked(fabric):
    small = fabric[0]
    forces, half = stage.asked_of(small, {})
    assert forces == pytest.approx(TOP * np.arange(1, 9) / 8)
    assert half == pytest.approx([25.0, 50.0])
    measured = {"wale": measured_test(small, "wale")}
    plain = load_study(CONFIG / "small").fabrics["small"]
    forces, half = stage.asked_of(plain, measured)
    assert (len(forces), forces[-1]) == (24, pytest.approx(TOP, rel=1e-5))
    assert stage.asked_of(plain, {})[0][-1] == pytest.approx(49.03325)


@pytest.mark.slow
def test_with_all_inputs_uncertain_the_band_holds_the_true_yarn(fabric, tmp_path):
    small, true, law = fabric
    found, _ = stage.run(small, {"continuous": law}, "all")
    path = tmp_path / "all.nc"
    write(found, path)
    with xr.open_dataset(path) as opened:
        dataset = opened.load()
    assert list(dataset.parameter.values) == ["loop_length", "bending_rigidity", "discrepancy"]
    one = dataset.sel(parameter="bending_rigidity")
    low, high = one.fitted_interval.values
    assert low < TRUTH * small.yarn["bending_rigidity"] < high
    assert float(one.posterior_over_prior) < 0.9
    rest = relax(solver_fabric(true, law), settings_of(small).resolution)
    curve = tensile(rest, "course", np.linspace(0.02, 4.0, 200), to_force=TOP)
    one = dataset.sel(direction="course")
    known = np.isfinite(one.predicted_strain.values) & (one.predicted_force_per_width.values > 0.0)
    at = one.predicted_force_per_width.values[known]
    strain = np.interp(at, np.append(0, curve.force_per_width), np.append(0, curve.strain))
    (low, high), (least, most) = (
        one[name].values[known].T for name in ("predicted_strain_band", "prior_strain_band")
    )
    assert known.sum() >= 6 and ((low < strain) & (strain < high)).all()
    assert (high - low < most - least).mean() > 0.8
    assert any("course pull: strain" in line for line in said(dataset))
    told = {row[3]: row[12] for row in prediction_rows("small", "all", dataset)}
    assert any(name.startswith("next measurement: ") for name in told)
    # A panel for the direction that was not measured as well.
    labels = [ax.get_xlabel() for ax in fig34_prediction_bands({"all": dataset}).axes]
    assert sum(one.startswith("strain, course (%)") for one in labels) >= 1
    assert "strain, wale (%)" in labels or "strain, wale (%)\nnot measured" in labels


@pytest.mark.slow
def test_a_calibration_finds_the_yarn_and_predicts_the_other_direction(fabric, tmp_path):
    small, true, law = fabric
    laws = {"continuous": law}
    found, timings = stage.run(small, laws, "rigidity")
    path = tmp_path / "rigidity.nc"
    write(found, path)
    with xr.open_dataset(path) as opened:
        dataset = opened.load()
    wanted = TRUTH * small.yarn["bending_rigidity"]
    assert float(dataset.fitted_value[0]) == pytest.approx(wanted, rel=2e-3)
    assert float(dataset.misfit_rms.sel(curve="wale")) < 2e-3
    assert str(dataset.curve_role.values[0]) == "fitted"
    assert json.loads(dataset.attrs["configuration"])["name"] == "small"
    # The other direction, solved with the true yarn.
    rest = relax(solver_fabric(true, law), settings_of(small).resolution)
    curve = tensile(rest, "course", np.linspace(0.02, 4.0, 200), to_force=TOP)
    one = dataset.sel(direction="course")
    strain = np.interp(one.predicted_force_per_width, np.append(0, curve.force_per_width),
                       np.append(0, curve.strain))  # fmt: skip
    assert one.predicted_strain.values == pytest.approx(strain, rel=1e-2, abs=1e-3)
    assert float(one.predicted_strain[0]) == 0.0
    assert dataset.predicted_spacing.values == pytest.approx(
        [rest.wale_spacing, rest.course_spacing], rel=1e-3
    )
    low, high = dataset.predicted_strain_band.values.transpose(2, 0, 1)
    assert (low <= dataset.predicted_strain.values).all()
    assert (dataset.predicted_strain.values <= high).all()
    assert len(timings.rows) == 2
    # The same input gives the same bytes.
    again = tmp_path / "again.nc"
    write(stage.run(small, laws, "rigidity")[0], again)
    assert again.read_bytes() == path.read_bytes()


@pytest.mark.slow
def test_the_prediction_as_given_differs_and_says_so(fabric, tmp_path):
    small, _, law = fabric
    dataset, _ = stage.run(small, {"continuous": law}, GIVEN)
    write(dataset, tmp_path / "given.nc")
    assert "without calibration" in dataset.attrs["title"]
    assert dataset.sizes["parameter"] == 0
    assert list(dataset.curve_role.values) == ["predicted"]
    # A softer yarn than the true one gives more strain.
    assert float(dataset.misfit_mean.sel(curve="wale")) > 0.01


@pytest.mark.slow
def test_sensitivity_of_a_fabric(fabric, tmp_path):
    small, _, law = fabric
    dataset, _ = sensitivity.run(small, {"continuous": law})
    inputs = dataset.input.values.tolist()
    assert "core_diameter" not in inputs and "friction" not in inputs
    write(dataset, tmp_path / "s.nc")
    sensitivity.write_table([tmp_path / "s.nc"], tmp_path / "s.csv")
    # All forces twice as large, of a yarn that hardly stretches: B is twice as large, the density
    # as before.
    stiff = dataset.per_cent_per_cent.sel(input=["bending_rigidity", "compression_stiffness"])
    for result, total in (("course_B", 1.0), ("wale_B", 1.0), ("wale_spacing", 0.0)):
        assert float(stiff.sel(result=result).sum()) == pytest.approx(total, abs=0.02), result
    # All lengths twice as large: so are the spacings, but for what contact and rigidity do.
    sizes = dataset.per_cent_per_cent.sel(result="wale_spacing")
    total = sizes.sel(input=["loop_length", "diameter"]).sum()
    total += 2.0 * sizes.sel(input="bending_rigidity") - sizes.sel(input="compression_stiffness")
    assert float(total) == pytest.approx(1.0, abs=0.02)
    first = (tmp_path / "s.csv").read_text().splitlines()[1].split(",")
    assert first[:2] == ["small", "loop_length"]


def test_words_say_how_well_an_input_must_be_measured():
    assert sensitivity.says(2.0, 0.01, 1.0) == "for 10 % measure it to 5 %"
    assert sensitivity.says(-10.0, 0.01, 1.0) == "violent: for 10 % measure it to 1 %"
    assert sensitivity.says(2.0, 0.01, 0.0) == "for 10 % measure it to 0.05"
    assert sensitivity.says(0.05, 0.001, 1.0) == "little effect"
    assert sensitivity.says(0.05, 0.04, 1.0) == "no effect that can be told from noise"
    assert sensitivity.says(np.nan, np.nan, 1.0) == "no result with the input changed"

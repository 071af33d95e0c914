"""No model gates another; where none can compute a fabric, the refusal tells what would work."""

import re

import numpy as np
import pytest
import xarray as xr

import knitsim as ks
from knitsim.errors import InputError
from knitsim.figures.catalogue import FIGURES
from knitsim.figures.draw import draw
from knitsim.stages.check import check_study
from knitsim.stages.several import run
from knitsim.stages.skipping import run as skipped
from knitsim.store.reader import stopped
from knitsim.study.study import load_study

SCENES = """
y: {tensile_test: {steps: 2, max_strain: 0.01, readings: [corrected], recovery: false}}
both:
  kinematic_tension: {steps: 2, variants: {isometric: {}}}
  equilibrium_rest: {points: 48, loop_length_low: 1, loop_length_high: 1.02, set_compared: [0]}
  equilibrium_tension: {states: 2, max_strain_course: 0.1, max_strain_wale: 0.1, variants: {frictionless: {}}}
drawn: {kinematic_tension: {steps: 2}}
"""
# A relaxed jersey of Ne 30, kc 5.4 and kw 4.2, as knitters have it.
JERSEY = "wales_per_cm: 15, courses_per_cm: 19.29, loop_length_mm: 2.8"


def study_of(tmp_path, fabrics, yarn="count_Ne: 30"):
    (tmp_path / "yarns.yaml").write_text(f"y1: {{scene: y, {yarn}}}\n")
    (tmp_path / "fabrics.yaml").write_text(fabrics)
    (tmp_path / "scenes.yaml").write_text(SCENES)
    return load_study(tmp_path)


def test_a_loop_that_cannot_be_drawn_leaves_out_its_kinematic_tests(tmp_path, capsys):
    study = study_of(tmp_path, f"f1: {{yarn: y1, scene: both, {JERSEY}}}\n")
    check_study(study)
    assert "fabric f1: the kinematic tests are left out" in capsys.readouterr().err
    fabric = study.fabrics["f1"]
    yarn = tmp_path / "yarn.nc"
    run(study.yarns["y1"], [("yarn", "")], [yarn], tmp_path / "t.csv")
    tests = [("loop", ""), ("kinematic_tension", "course"), ("equilibrium_rest", ""),
             ("equilibrium_tension", "course")]  # fmt: skip
    files = [tmp_path / f"{stage}.nc" for stage, _ in tests]
    run(fabric, tests, files, tmp_path / "t.csv", yarn=yarn)
    reasons = {about["kind"]: why for about, why in stopped(files)}
    assert (
        set(reasons) == {"loop", "tensile"} and "brings centre lines as close as" in reasons["loop"]
    )
    with xr.open_dataset(files[3]) as pulled:
        assert np.isfinite(pulled["force_per_width"].values).all()
        assert pulled["force_per_width"].values.max() > 0
    rows = [row for row in skipped([fabric]) if row["skipped"] == "kinematic tests of f1"]
    assert len(rows) == 1 and rows[0]["because"] == reasons["loop"]
    assert rows[0]["tests"] == "kinematic_tension"
    # A figure of what was left out says so.
    figure = next(one for one in FIGURES if "loop" in one.needs)
    others = {name: files[2] for name in figure.needs}
    draw([figure], others | {"loop": files[0]}, {figure.name: tmp_path / "figure"})
    assert (
        "close as" in re.sub(r"\s+", " ", (tmp_path / "figure.svg").read_text())
        or (tmp_path / "figure.png").exists()
    )


def test_where_only_the_drawn_loop_is_tested_the_study_is_refused(tmp_path):
    study = study_of(tmp_path, f"f1: {{yarn: y1, scene: drawn, {JERSEY}}}\n")
    with pytest.raises(InputError, match="brings centre lines as close as"):
        check_study(study)


def test_a_yarn_whose_fibres_cannot_be_drawn_keeps_its_law(tmp_path, capsys):
    study = study_of(
        tmp_path, f"f1: {{yarn: y1, scene: both, {JERSEY}}}\n", "count_Ne: 30, fibres: 2000"
    )
    check_study(study)
    assert "the yarn y1 is not simulated" in capsys.readouterr().err
    yarn, rest = tmp_path / "yarn.nc", tmp_path / "rest.nc"
    run(study.yarns["y1"], [("yarn", "")], [yarn], tmp_path / "t.csv")
    assert "1000" in stopped([yarn])[0][1]
    run(study.fabrics["f1"], [("equilibrium_rest", "")], [rest], tmp_path / "t.csv", yarn=yarn)
    with xr.open_dataset(rest) as found:
        assert float(found["kc"]) > 4


def test_where_no_model_can_the_remedies_work(tmp_path):
    tight = "wales_per_cm: 25, courses_per_cm: 30, loop_length_mm: 0.6, density_checked: true"
    hard = "count_Ne: 30, compression_stiffness_N_per_m: 10000"
    study = study_of(tmp_path, f"f1: {{yarn: y1, scene: both, {tight}}}\n", hard)
    with pytest.raises(InputError, match="computed to work") as refused:
        check_study(study)
    message = str(refused.value)
    length = float(re.search(r"loop_length_mm ([\d.]+)", message)[1])
    diameter = float(re.search(r"diameter_mm ([\d.]+)", message[message.index("computed") :])[1])
    assert length > 0.6 and diameter < 1e3 * study.yarns["y1"]["diameter"]
    yarn = ks.Yarn(count_Ne=30, compression_stiffness_N_per_m=10000)
    fabric = ks.Fabric(yarn, loop_length_mm=0.6, density_checked=True)
    for changed in (
        fabric.with_value("loop_length_mm", length), fabric.with_value("yarn.diameter_mm", diameter)
    ):  # fmt: skip
        assert ks.relax(changed, points=48).state.crossings_intact
    with pytest.raises(InputError, match="computed to work"):
        ks.relax(fabric)

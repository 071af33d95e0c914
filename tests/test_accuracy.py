"""The key accuracy: what it is refused for, what it chooses, and that the results keep it."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml

from knitsim.equilibrium import accuracy
from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import LEAST_POINTS, Fabric, Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError
from knitsim.stages import equilibrium_bending, equilibrium_rest, equilibrium_tension
from knitsim.stages.equilibrium import followed_at, settings_of, solver_fabric
from knitsim.stages.laws import stated_law
from knitsim.stages.page import _with_error
from knitsim.stages.summary import _agreement, _worst
from knitsim.store.tensile import counted_error
from knitsim.study.study import load_study
from knitsim.yarn.law import TensionLaw, paper_k3

SMOOTH = {"smooth": {}}
RUBBING = {"rubs": {"friction": True}}


def study_of(folder, variants=SMOOTH, **rest):
    """A study with the cotton fabric of config/, its yarn by constants, nothing assumed of it."""
    cotton = {
        "count_tex": 56, "fibres": 19, "density_g_per_cm3": 1.52, "diameter_mm": 0.2793,
        "bending_rigidity_N_mm2": 0.005, "compression_stiffness_N_per_m": 1000, "friction": 0.2,
        "breaking_strain": 0.07, "twist_per_m": 400, "twist_direction": "Z",
        "section_stiffness_MPa": 100, "fibre_modulus_GPa": 8,
        "tension_law": {"kind": "secant", "low_N": 43.805, "high_N": 94.005, "offset_N": 0.48942,
                        "switch_strain": 0.01},
    }  # fmt: skip
    fabric = {
        "yarn": "cotton", "wales_per_cm": 6.67, "courses_per_cm": 8.33, "loop_length_mm": 5.56,
    }  # fmt: skip
    tension = {"states": 15, "max_strain_course": 0.6, "max_strain_wale": 0.4}
    bending = {"states": 4}
    scene = {
        "equilibrium_rest": {"set_compared": [0.0], **rest},
        "equilibrium_tension": tension | {"variants": variants},
        "equilibrium_bending": bending | {"variants": variants},
    }
    for name, data in (
        ("yarns", {"cotton": cotton}), ("fabrics", {"cotton": fabric}),
        ("scenes", {"paper_yarn": {"tensile_test": {}}, "paper_fabric": scene}),
    ):  # fmt: skip
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(data))
    return load_study(folder)


@pytest.mark.parametrize(
    ("rest", "right"),
    [
        ({"accuracy": 0.01, "points": 48}, "keep one of them"),
        ({"accuracy": 0}, "at least 0.0001 and at most 0.5"),
        ({"accuracy": 1e-9}, "at least 0.0001"),
        ({"accuracy": float("nan")}, "finite"),
        ({"accuracy": "1 %"}, "must be a number"),
        ({"accuracy": [0.1, 0.01]}, "must be one value"),
    ],
)
def test_bad_accuracies_are_refused_by_name(tmp_path, rest, right):
    with pytest.raises(InputError, match=re.escape(right)) as refusal:
        study_of(tmp_path, **rest)
    assert "scenes.yaml: paper_fabric.equilibrium_rest.accuracy" in refusal.value.where


def test_a_test_without_the_rest_that_it_starts_from_is_refused(tmp_path):
    study_of(tmp_path)
    scenes = yaml.safe_load((tmp_path / "scenes.yaml").read_text())
    del scenes["paper_fabric"]["equilibrium_rest"]
    (tmp_path / "scenes.yaml").write_text(yaml.safe_dump(scenes))
    with pytest.raises(InputError, match="equilibrium_rest: is missing; equilibrium_bending"):
        load_study(tmp_path)


def test_points_do_not_come_beside_an_accuracy_later(tmp_path):
    fabric = study_of(tmp_path, accuracy=0.1).fabrics["cotton"]
    with pytest.raises(InputError, match="keep one of them"):
        fabric.with_value("scene.equilibrium_rest.points", 32)


@pytest.mark.slow
def test_an_accuracy_that_is_not_reached_is_told(tmp_path, monkeypatch):
    """With a ladder that ends early: the last rung stands, with the error that it still has."""
    monkeypatch.setattr(accuracy, "LADDER", ((24, 1.0), (32, 1.0)))
    fabric = study_of(tmp_path, accuracy=1e-4).fabrics["cotton"]
    pulled, _ = equilibrium_tension.run(fabric, {"continuous": stated_law(fabric.yarn)}, "course")
    told = json.loads(pulled.attrs["settings"])
    assert (told["accuracy"], told["smooth"]["points"]) == (1e-4, 32)
    assert 1e-4 < float(pulled.numerical_error.max()) < 0.5


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_an_error_that_nothing_tells_is_unknown(friction, monkeypatch):
    """One that took as many points says nothing: a finer one is asked; without any other none is told."""
    law = TensionLaw((0.0, 0.01, 0.07), (0.0, 0.44, 5.84), 0.07)
    cotton = Fabric(1.5e-3, 1.2e-3, 5.56e-3, 0.28e-3, 5e-9, law, friction=friction)
    rest = relax(cotton, Resolution(28))

    def errors():
        return tensile(rest, "course", [0.01, 0.02], estimate_error=True).numerical_error

    told = errors()
    assert (told > 0.0).all()
    at = accuracy.at_resolution
    fine = at(rest, Resolution(112))
    true = tensile(fine, "course", [0.01, 0.02]).force_per_loop
    off = np.abs(tensile(rest, "course", [0.01, 0.02]).force_per_loop / true - 1.0)
    monkeypatch.setattr(accuracy, "other_than", lambda resolution, _: resolution)
    assert (off < errors()).all()
    assert (errors() < 1.0).all()
    coarse = Resolution(4 * LEAST_POINTS)
    monkeypatch.setattr(accuracy, "other_than", lambda resolution, _: coarse)

    def not_found(relaxed, resolution):
        if resolution == coarse:
            raise ComputationError("none")
        return at(relaxed, resolution)

    monkeypatch.setattr(accuracy, "at_resolution", not_found)
    assert np.isnan(errors()).all()


def test_points_are_what_they_were_without_an_accuracy(tmp_path):
    fabric = study_of(tmp_path, points=32).fabrics["cotton"]
    settings = settings_of(fabric)
    assert (settings.resolution, settings.accuracy) == (Resolution(32), None)
    assert settings.errors == {"estimate_error": True}


def test_an_accuracy_is_asked_for_where_nothing_is_stated(tmp_path):
    settings = settings_of(study_of(tmp_path).fabrics["cotton"])
    assert settings.errors == {"accuracy": 0.01}
    full = settings_of(study_of(tmp_path, cell="full", accuracy=0.1).fabrics["cotton"])
    assert full.resolution.cell == "full" and full.errors == {"accuracy": 0.1}


def test_effects_of_assumptions_are_followed_at_points_that_are_fine_enough_and_not_too_many():
    def curve(points):
        return SimpleNamespace(model=SimpleNamespace(resolution=Resolution(points)))

    assert followed_at([curve(48), curve(112), curve(72)]) == Resolution(112)
    # A moment that passes zero is driven to the last rung; its effects need not be.
    assert followed_at([curve(72), curve(248)]) == Resolution(72)
    # Nor need those of which every curve is driven there.
    assert followed_at([curve(248), curve(168)]) == Resolution(112)


def test_an_accuracy_of_one_scene_changes_the_results_of_its_fabrics_only(tmp_path):
    """The parameters of the rules, that Snakemake compares, are made of FabricInput.config."""
    study_of(tmp_path)
    fabrics = yaml.safe_load((tmp_path / "fabrics.yaml").read_text())
    fabrics["other"] = fabrics["cotton"] | {"scene": "fine"}
    (tmp_path / "fabrics.yaml").write_text(yaml.safe_dump(fabrics))
    scenes = yaml.safe_load((tmp_path / "scenes.yaml").read_text())

    def configs(**rest):
        scenes["fine"] = {**scenes["paper_fabric"], "equilibrium_rest": rest}
        (tmp_path / "scenes.yaml").write_text(yaml.safe_dump(scenes))
        return {
            (name, stage): fabric.config(stage)
            for name, fabric in load_study(tmp_path).fabrics.items()
            for stage in ("loop", "equilibrium_rest", "equilibrium_tension", "equilibrium_bending")
        }

    before, after = configs(accuracy=0.1), configs(accuracy=0.01)
    changed = {key for key in before if before[key] != after[key]}
    assert changed == {
        ("other", stage)
        for stage in ("equilibrium_rest", "equilibrium_tension", "equilibrium_bending")
    }


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    """Forces and moments of the same tests on a fine grid, without the code that chooses one."""
    fabric = study_of(tmp_path_factory.mktemp("exact")).fabrics["cotton"]
    relaxed = relax(solver_fabric(fabric, stated_law(fabric.yarn)), Resolution(256, 2560))
    found = {"rest": relaxed}
    for direction, top in (("course", 0.6), ("wale", 0.4)):
        curve = tensile(relaxed, direction, top * np.arange(1, 16) / 15)
        found[direction] = np.concatenate([[0.0], curve.force_per_width])
        bent = equilibrium_bending.curvatures_of({"max_curvature": 250.0, "states": 4, "cycles": 1})
        found[f"{direction} moment"] = bend(relaxed, direction, bent).moment_per_width
    return found


@pytest.mark.slow
@pytest.mark.parametrize("asked", [0.1, 0.01, 0.001])
def test_results_keep_the_accuracy_asked_for(tmp_path, asked, exact):
    fabric = study_of(tmp_path, accuracy=asked).fabrics["cotton"]
    laws = {"continuous": stated_law(fabric.yarn)}
    rest = equilibrium_rest.run(fabric, laws)[0]
    assert 0.0 < float(rest.spacing_error) <= asked
    for spacing in ("wale_spacing", "course_spacing"):
        assert abs(float(rest[spacing]) / getattr(exact["rest"], spacing) - 1.0) <= asked
    for direction in ("course", "wale"):
        pulled, _ = equilibrium_tension.run(fabric, laws, direction)
        force, right = pulled.force_per_width.values[0], exact[direction]
        scale = np.maximum(np.abs(right), 0.01 * np.abs(right).max())
        assert (np.abs(force - right) / scale).max() <= asked
        assert 0.0 < float(pulled.numerical_error.max()) <= asked
        if direction == "course":
            # The ledger follows the curve itself, at its points; 20 and 60 % are among the states.
            assert pulled.headline.values == pytest.approx(force[[5, 15]], rel=1e-4)
        bent, _ = equilibrium_bending.run(fabric, laws, direction)
        moment, right = bent.moment_per_width.values[0], exact[f"{direction} moment"]
        assert np.abs(moment - right).max() <= asked * np.abs(right).max()
        changed = np.abs((moment - moment[0]) - (right - right[0])).max()
        assert changed <= asked * np.abs(right - right[0]).max()
        for dataset in (pulled, bent):
            told = json.loads(dataset.attrs["settings"])
            assert told["accuracy"] == asked
            points = told["smooth"]["points"]
            assert points in [rung[0] for rung in accuracy.LADDER]
            assert dataset.centreline.sizes["point"] == 2 * points + 1


@pytest.mark.slow
@pytest.mark.parametrize("asked", [0.1, 0.01])
def test_results_with_friction_keep_the_accuracy_asked_for(tmp_path, asked):
    fabric = study_of(tmp_path, RUBBING, accuracy=asked).fabrics["cotton"]
    law = stated_law(fabric.yarn)
    fine = relax(solver_fabric(fabric, law, friction=True), Resolution(96, 960))
    for direction, top in (("course", 0.6), ("wale", 0.4)):
        right = tensile(fine, direction, top * np.arange(1, 16) / 15, increment=0.02 / 32.0)
        pulled, _ = equilibrium_tension.run(fabric, {"continuous": law}, direction)
        force, right = pulled.force_per_width.values[0, 1:], right.force_per_width
        scale = np.maximum(np.abs(right), 0.01 * np.abs(right).max())
        assert (np.abs(force - right) / scale).max() <= asked
        assert 0.0 < float(pulled.numerical_error.max()) <= asked
        told = json.loads(pulled.attrs["settings"])["rubs"]
        assert told["increment"] < 0.02 or asked > 0.01


@pytest.mark.parametrize("slope", [0.5, 10.0, 1000.0])
def test_on_a_steep_way_back_what_counts_is_how_far_the_curve_is_off(slope):
    """Out along a line, back along a steeper one that is moved by a part of the whole way in strain."""
    out, back = np.linspace(0.05, 1.0, 20), 1.0 - np.linspace(0.01, 0.9 / max(slope, 1.0), 20)
    strain = np.concatenate([out, back])
    force = np.concatenate([out, 1.0 + slope * (back - 1.0)])
    segment = np.repeat([0, 1], 20)
    shift = 1e-3
    off = np.where(segment == 0, 1e-4, slope * shift)
    error = counted_error(force, strain, segment, off / np.fmax(np.abs(force), 0.01))
    assert error[:20] == pytest.approx(1e-4 / np.fmax(out, 0.01))
    assert (error[20:] <= 1.01 * off[20:] / np.fmax(np.abs(force[20:]), 0.1)).all()
    if slope >= 10.0:
        # Moved by this part of the way, whatever the slope.
        assert error[20:] == pytest.approx(shift / np.ptp(strain), rel=0.01)


@pytest.mark.parametrize(
    ("error", "said"),
    [([0.001, 0.002], ""), ([0.001, 0.3], "up to 30 %"), ([0.001, np.nan], "is not known")],
)
def test_an_error_that_nothing_can_be_built_on_is_said_aloud(error, said):
    steps = ("variant", "step")
    dataset = xr.Dataset(
        {
            "force_per_width": (steps, [[1.0, 2.0]]), "segment": (steps, [[0, 0]]),
            "numerical_error": (steps, [error]),
        },
        {"strain": (steps, [[0.1, 0.2]]), "variant": ["kes"]}, {"kind": "tensile", "direction": "wale"},
    )  # fmt: skip
    row = {"stopped": [], "largest_numerical_error_percent": ""}
    _worst(row, dataset)
    assert said in " ".join(row["stopped"])
    assert bool(row["stopped"]) == bool(said)


def test_what_was_measured_and_how_well_a_parameter_is_read_is_said():
    found = xr.Dataset(
        {"misfit_rms": ("curve", [0.0712, np.nan]), "misfit_mean": ("curve", [0.01, np.nan])},
        {"curve": ["wale", "course"], "curve_role": ("curve", ["fitted", "predicted"])},
        {"calibration": "core"},
    )
    assert _agreement(found) == "core: wale fitted, 7.12 % rms, course not reached"
    # A fit that is none is said so.
    found["misfit_rms"][:] = [0.69, 0.69]
    text = "core: wale does NOT FIT, agrees not at all: 69 % rms, "
    text += "course predicted, agrees not at all: 69 % rms"
    assert _agreement(found) == text
    # 0.2 of 4 in SI is 5 %, of 40 in the instrument's unit 2.
    parameter = {"value": "4", "error": "0.2", "kes_value": "40"}
    assert _with_error(parameter) == "40 ± 2"
    assert _with_error(parameter | {"error": "0.002"}) == "40"
    assert _with_error(parameter | {"value": "", "error": "", "kes_value": ""}) == ""


@pytest.mark.parametrize("points", [24, 32, 48])
def test_errors_of_few_control_points_are_not_below_the_true_ones(points):
    """Where no resolution lies below, one above tells the error."""
    strains = [0.1, 0.3, 0.6]
    cotton = Fabric(None, None, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))
    fine = tensile(relax(cotton, Resolution(96, 464)), "course", strains)
    few = tensile(relax(cotton, Resolution(points)), "course", strains, estimate_error=True)
    true = np.abs(few.force_per_loop / fine.force_per_loop - 1.0)
    assert (few.numerical_error >= true).all() and true[-1] > 1e-4

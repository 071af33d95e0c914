"""Measured curves and calibrations in a study: what is read, what is refused by file and key."""

import shutil
from pathlib import Path

import pytest
import yaml

from knitsim.errors import InputError
from knitsim.measured.read import measured_test
from knitsim.stages.check import check_study
from knitsim.study.measured_checks import free_of, inferred_of, meaningless, names_of, value_of
from knitsim.study.measured_keys import GIVEN, PARAMETERS
from knitsim.study.study import load_study

CONFIG = Path(__file__).parents[1] / "config"
CURVE = "strain,force_per_width_N_per_m\n0.01,5\n0.05,20\n0.1,60\n0.2,200\n"


@pytest.fixture
def study_of(tmp_path):
    """A study like config/small with a measured fabric; changes: {dotted path: value or None}."""

    def load(changes=(), curve=CURVE, **yarn):
        shutil.copytree(CONFIG / "small", tmp_path, dirs_exist_ok=True)
        (tmp_path / "curve.csv").write_text(curve)
        with (tmp_path / "scenes.yaml").open("a") as scenes:
            scenes.write("\nbending_only:\n  kinematic_bending: {}\n")
        fabrics = yaml.safe_load((tmp_path / "fabrics.yaml").read_text())
        fabrics["small"] |= {
            "measured": {
                "wale": {"direction": "wale", "file": "curve.csv"},
                "course": {"direction": "course", "file": "curve.csv"},
            },
            "calibrations": {"one": {"fit": ["wale"], "free": ["bending_rigidity"]}},
        }
        for path, value in dict(changes).items():
            *parts, last = path.split(".")
            entry = fabrics["small"]
            for part in parts:
                entry = entry.setdefault(part, {})
            entry[last] = value
            if value is None:
                del entry[last]
        (tmp_path / "fabrics.yaml").write_text(yaml.safe_dump(fabrics))
        yarns = yaml.safe_load((tmp_path / "yarns.yaml").read_text())
        yarns["small"] |= yarn
        (tmp_path / "yarns.yaml").write_text(yaml.safe_dump(yarns))
        return load_study(tmp_path)

    return load


def test_a_study_without_measured_curves_has_none():
    small = load_study(CONFIG / "small").fabrics["small"]
    assert small["measured"] == {} and small["calibrations"] == {}
    assert small["prediction"] is None


def test_start_and_bounds_come_from_the_ledger(study_of):
    changes = {"calibrations.one.free": ["friction", "set", "loop_length"]}
    fabric = study_of(changes).fabrics["small"]
    friction, fixed, length = free_of(fabric, "one")
    # Ranges of the table of keys; a length that is given may be half or twice as long.
    assert (friction.start, friction.low, friction.high) == (0.2, 0.1, 0.3)
    assert (fixed.start, fixed.low, fixed.high) == (0.0, 0.0, 0.9)
    assert (length.start, length.low, length.high) == pytest.approx((3.3e-3, 1.65e-3, 6.6e-3))


def test_bounds_that_are_stated_come_first(study_of):
    changes = {"calibrations.one.bounds": {"bending_rigidity_N_mm2": [0.0001, 10]}}
    (free,) = free_of(study_of(changes).fabrics["small"], "one")
    assert (free.low, free.high) == pytest.approx((1e-10, 1e-5))


def test_a_core_stays_within_its_yarn(study_of):
    core = {"core_diameter_mm": 0.1, "stiffness_N_per_mm3": 0.01}
    changes = {"calibrations.one.free": ["core_diameter", "core_exponent"]}
    fabric = study_of(changes, core_law=core, diameter_mm=0.15).fabrics["small"]
    free, exponent = free_of(fabric, "one")
    assert free.high == pytest.approx(0.98 * 0.15e-3)
    assert (exponent.low, exponent.start) == (1.5, 2.4)


def test_every_parameter_has_a_value(study_of):
    core = {"core_diameter_mm": 0.1, "stiffness_N_per_mm3": 0.01, "exponent": 3}
    fabric = study_of(core_law=core).fabrics["small"]
    for name in PARAMETERS:
        assert value_of(fabric, name) >= 0.0
    assert value_of(fabric, "core_stiffness") == pytest.approx(1e7)
    assert value_of(fabric, "core_exponent") == 3.0
    assert value_of(fabric, "loop_length") == pytest.approx(3.3e-3)


def test_keys_of_a_curve_reach_its_reader(study_of):
    curve = "extension_mm,force_N\n1,0.2\n2,0.5\n4,1\n8,4\n"
    changes = {
        "measured.wale": {
            "direction": "wale", "file": "curve.csv", "gauge_length_mm": 80, "width_mm": 40,
            "pretension_N_per_mm": 0.005, "machine_compliance_mm_per_N": 0.5,
        },
        "measured.course": None,
    }  # fmt: skip
    measured = measured_test(study_of(changes, curve).fabrics["small"], "wale")
    assert measured.pretension == pytest.approx(5.0)
    assert measured["force_per_width"][-1] == pytest.approx(100.0)
    # (8 - 0.5 x 4) mm over 80 mm from 0.9/80, where the force is 5 N/m.
    assert measured["strain"][-1] == pytest.approx((1 + 6 / 80) / (1 + 0.9 / 80) - 1)
    assert len(measured.corrections) == 2


FAULTS = {
    "no such curve": ({"calibrations.one.fit": ["welt"]}, "calibrations.one.fit"),
    "no curve at all": ({"measured": None}, "none is measured"),
    "four free": (
        {"calibrations.one.free": ["friction", "set", "loop_length", "diameter"]}, "at most 3",
    ),
    "no such parameter": ({"calibrations.one.free": ["stiffness"]}, "calibrations.one.free[0]"),
    "core without a core law": ({"calibrations.one.free": ["core_diameter"]}, "needs core_law"),
    "bounds of another": (
        {"calibrations.one.bounds": {"friction": [0, 0.5]}}, "friction is not free",
    ),
    "bounds reversed": (
        {"calibrations.one.bounds": {"bending_rigidity_N_mm2": [2, 1]}}, "[lowest, highest]",
    ),
    "bounds of one number": (
        {"calibrations.one.bounds": {"bending_rigidity_N_mm2": [1]}}, "[lowest, highest]",
    ),
    "start outside": (
        {"calibrations.one.bounds": {"bending_rigidity_N_mm2": [1, 2]}}, "must hold the value",
    ),
    "bounds without unit": (
        {"calibrations.one.bounds": {"bending_rigidity": [1, 2]}}, "bending_rigidity_N_mm2",
    ),
    "reserved name": (
        {f"calibrations.{GIVEN}": {"fit": ["wale"], "free": ["set"]}}, "take another one",
    ),
    "file missing": ({"measured.wale.file": "nowhere.csv"}, "no such file"),
    "no direction": ({"measured.wale.direction": None}, "direction"),
    "scene without equilibrium": ({"scene": "bending_only"}, "equilibrium_rest"),
    "width of a bending test": (
        {"measured.wale": {"direction": "wale", "file": "curve.csv", "test": "bending",
                           "width_mm": 20}},
        "measured.wale.width",
    ),
    "file and files": ({"measured.wale.files": ["curve.csv"]}, "stands beside file"),
    "no file": ({"measured.wale.file": None}, "give file or files"),
    "one of the files missing": (
        {"measured.wale": {"direction": "wale", "files": ["curve.csv", "nowhere.csv"]}},
        "measured.wale.files = 'nowhere.csv': no such file",
    ),
    "columns that are no names": ({"measured.wale.columns": "Force"}, "names and values, in braces"),
    "a unit that is no text": ({"measured.wale.unit": {"force": 0.5}}, "measured.wale.unit.force"),
    "lines from 0": ({"measured.wale.skip": [0, 3]}, "a whole number from 1"),
    "another zero": ({"measured.wale.zero": "off"}, "must be keep or start or tail"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_what_contradicts_itself_is_refused_in_one_line(study_of, fault):
    changes, right = FAULTS[fault]
    with pytest.raises(InputError) as refused:
        study_of(changes)
    assert right in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_stiffness_that_a_core_law_replaces_is_not_free(study_of):
    core = {"core_diameter_mm": 0.1, "stiffness_N_per_mm3": 0.01}
    with pytest.raises(InputError, match="has no effect"):
        study_of({"calibrations.one.free": ["compression_stiffness"]}, core_law=core)


def test_one_rule_says_which_parameters_a_yarn_has(study_of, tmp_path):
    core = {"core_diameter_mm": 0.1, "stiffness_N_per_mm3": 0.01}
    pressed = {"file": "pressed.csv"}
    (tmp_path / "pressed.csv").write_text("thickness_mm,pressure_MPa\n")
    of_core = {"core_diameter", "core_stiffness", "core_exponent"}
    everywhere = set(PARAMETERS) - of_core - {"compression_stiffness"}
    for laws, own in (
        ({}, everywhere | {"compression_stiffness"}), ({"core_law": core}, everywhere | of_core),
        ({"compression_curve": pressed}, everywhere),
    ):  # fmt: skip
        yarn = study_of({}, **laws).yarns["small"]
        assert {name for name in PARAMETERS if not meaningless(yarn, name)} == own
    with pytest.raises(InputError, match="has no effect: the yarn has a compression_curve"):
        study_of({"calibrations.one.free": ["compression_stiffness"]}, compression_curve=pressed)


def test_the_cycle_of_a_bending_test_reaches_its_reader(study_of):
    curve = "curvature_per_cm,moment_per_width_gf_cm_per_cm\n0,0\n1,0.1\n2,0.2\n1,0.08\n0,-0.02\n"
    changes = {
        "measured": {
            "b": {"direction": "wale", "file": "curve.csv", "test": "bending", "cycle": 2}
        },
        "calibrations.one.fit": ["b"],
    }
    assert measured_test(study_of(changes, curve).fabrics["small"], "b").cycle == 2


def test_curves_are_read_before_anything_is_computed(study_of):
    study = study_of(curve=CURVE.replace("0.05,20", "0.05,nan"))
    with pytest.raises(InputError, match=r"curve\.csv:3"):
        check_study(study)


def test_the_files_of_a_study_hold_its_curves_once(study_of):
    names = [path.name for path in study_of().files]
    assert names.count("curve.csv") == 1


def test_the_default_study_is_never_calibrated_on_all_that_was_measured():
    """Something is left that a calibration did not see: all of the course, or all of the wale."""
    fabric = load_study(CONFIG).fabrics["acrylic_jersey"]
    ways = {name: entry["direction"] for name, entry in fabric["measured"].items()}
    for fit in fabric["calibrations"].values():
        assert len({ways[name] for name in fit["fit"]}) == 1
    pins, clamps = (measured_test(fabric, name) for name in ("wale", "wale_clamps"))
    assert pins["force_per_width"] == pytest.approx(clamps["force_per_width"])
    assert (pins["strain"] < clamps["strain"]).all()
    low, high = pins.band
    assert (low < pins["strain"]).all() and (pins["strain"] < high).all()
    assert "10.1038/s41467-024-46498-z" in " ".join(pins.comments)


def test_another_pattern_takes_the_fits_of_its_jersey_alone():
    """A calibration without free parameters learns of every input of its own fabric: no other takes it."""
    fabrics = load_study(CONFIG / "patterns", CONFIG).fabrics
    garter, plain = fabrics["acrylic_garter"], fabrics["acrylic_plain"]
    assert names_of(garter) == [GIVEN, "both"] and inferred_of(garter) == []
    plain.values["calibrations"]["learned"] = plain["calibrations"]["both"] | {"free": []}
    assert names_of(garter) == [GIVEN, "both"] and inferred_of(garter) == []
    assert names_of(plain) == [GIVEN, "both", "learned"] and inferred_of(plain) == ["learned"]

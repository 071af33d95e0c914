"""Configuration: what is accepted, what it becomes in SI, what is refused and in which words."""

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import knitsim as ks
from knitsim.errors import InputError
from knitsim.study import reference
from knitsim.study.keys import REQUIRED
from knitsim.study.schema import FABRIC, SCENE, STAGES, YARN, closure
from knitsim.study.study import load_study

CONFIG = Path(__file__).resolve().parents[1] / "config"

YARNS = {
    "grey": {
        "count_tex": 20,
        "fibres": 40,
        "twist_per_m": 500,
        "tension_law": {"kind": "bilinear", "k1_N": 30, "k2_N": 10},
        "scene": "pull",
    }
}
FABRICS = {
    "jersey": {
        "yarn": "grey",
        "wale_spacing_mm": 0.9,
        "courses_per_cm": 14,
        "loop_length_mm": 3.3,
        "scene": "all",
    }
}
SCENES = {"pull": {"tensile_test": {}}, "all": {"kinematic_tension": {}, "kinematic_bending": {}}}


@pytest.fixture
def study_of(tmp_path):
    """A function that writes the three files, with changes or given as text, and loads them."""

    def load(changes=None, **text):
        files = json.loads(json.dumps({"yarns": YARNS, "fabrics": FABRICS, "scenes": SCENES}))
        for path, value in (changes or {}).items():
            *parts, last = path.split(" ")
            place = files
            for part in parts:
                place = place.setdefault(part, {})
            if value is None:
                del place[last]
            else:
                place[last] = value
        for name, content in files.items():
            written = text.get(name, yaml.safe_dump(content, sort_keys=False))
            (tmp_path / f"{name}.yaml").write_bytes(
                written if isinstance(written, bytes) else written.encode()
            )
        return load_study(tmp_path, fallback=CONFIG)

    return load


@pytest.fixture(scope="module")
def paper():
    return load_study(CONFIG)


# What the files become


def test_the_papers_numbers(paper):
    cotton, polyester = paper.fabrics["cotton"], paper.yarns["polyester"]
    assert cotton["wale_spacing"] == pytest.approx(1.4993e-3, abs=5e-8)
    assert cotton["course_spacing"] == pytest.approx(1.2005e-3, abs=5e-8)
    assert cotton["loop_length"] == pytest.approx(5.56e-3, rel=1e-14)
    assert cotton.yarn["linear_density"] == pytest.approx(559.86e-7, rel=1e-14)
    assert cotton.yarn["diameter"] == pytest.approx(0.2793e-3, rel=1e-14)
    assert cotton.yarn["bending_rigidity"] == pytest.approx(5e-9, rel=1e-14)
    assert cotton.yarn["compression_stiffness"] == 1000.0
    assert cotton.yarn["friction"] == 0.2
    assert cotton.yarn["breaking_strain"] == 0.07
    assert {"low": 43.805, "high": 94.005, "offset": 0.48942, "switch_strain": 0.01}.items() <= (
        cotton.yarn["tension_law"].items()
    )
    assert polyester["linear_density"] == pytest.approx(333.33e-7, rel=1e-14)
    assert polyester["fibres"] == 72
    law = polyester["tension_law"]
    assert (law["k1"], law["k2"], law["per"]) == (6.34, 2.41, "filament")
    assert cotton.scene["kinematic_bending.max_curvature"] == 250.0
    assert next(iter(cotton.scene["kinematic_tension.variants"])) == "isometric"


def test_every_input_that_the_paper_lacks_is_in_the_ledger(paper):
    rows = {(row.subject, row.key): row for row in paper.assumptions()}
    named = [
        ("polyester", "tension_law.yield_strain"), ("polyester", "breaking_strain"),
        ("cotton", "breaking_strain"), ("cotton", "diameter_mm"), ("cotton", "twist_per_m"),
        ("polyester", "twist_per_m"), ("cotton", "loop_length_mm"), ("cotton", "fibres"),
        ("cotton", "bending_rigidity_N_mm2"), ("cotton", "compression_stiffness_N_per_m"),
        ("cotton", "friction"), ("paper_yarn", "tensile_test.viscous_coefficient_N_s_per_m"),
        ("paper_fabric", "kinematic_tension.viscous_coefficient_N_s_per_m"),
        ("paper_yarn", "tensile_test.max_strain"),
        ("paper_fabric", "kinematic_tension.max_strain_course"),
        ("paper_fabric", "kinematic_tension.max_strain_wale"),
        ("paper_fabric", "kinematic_tension.contraction"),
        ("paper_fabric", "kinematic_tension.limit"),
        ("paper_fabric", "kinematic_bending.loops"), ("model", "torsion_energy"),
    ]  # fmt: skip
    assert [name for name in named if name not in rows] == []
    assert len(rows) == len(paper.assumptions())
    for row in rows.values():
        assert row.because and "\n" not in row.because
        if row.low is not None:
            assert row.low <= row.value <= row.high and row.low < row.high
        elif row.kind != "model":
            assert row.value in row.choices and len(row.choices) > 1


def test_what_the_paper_gives_is_no_assumption(paper):
    keys = {(row.subject, row.key) for row in paper.assumptions()}
    for key in ("count_dtex", "tension_law.low_N", "tension_law.k1_N", "wales_per_cm"):
        assert not {("cotton", key), ("polyester", key)} & keys
    assert ("polyester", "fibres") not in keys


def test_every_assumption_can_be_moved_to_both_ends_of_its_range(paper):
    moved = 0
    for resolved in (*paper.fabrics.values(), *paper.yarns.values()):
        for row in resolved.assumptions():
            for value in (row.low, row.high) if row.low is not None else row.choices:
                changed = resolved.with_value(row.path, value)
                moved += changed.as_json() != resolved.as_json()
                again = {r.path: r.value for r in changed.assumptions()}
                assert row.path not in again  # stated now
    assert moved > 60


def test_with_value_changes_a_copy_and_what_follows(study_of):
    study = study_of({"yarns grey twist_per_m": None})
    yarn = study.yarns["grey"]
    before = yarn.as_json()
    thick = yarn.with_value("count_dtex", 800)  # another unit of the same quantity gives way
    assert thick["linear_density"] == pytest.approx(800e-7, rel=1e-14)
    assert thick["diameter"] == pytest.approx(2 * yarn["diameter"], rel=1e-12)
    assert thick["twist"] == pytest.approx(yarn["twist"] / 2, rel=1e-12)
    assert yarn.as_json() == before and thick.name == yarn.name
    fabric = study.fabrics["jersey"]
    assert fabric.with_value("yarn.friction", 0.3).yarn["friction"] == 0.3
    assert fabric.with_value("wales_per_cm", 10)["wale_spacing"] == pytest.approx(1e-3)
    longer = fabric.with_value("scene.kinematic_bending.loops", 3)
    assert longer.scene["kinematic_bending.loops"] == 3.0
    assert fabric.scene["kinematic_bending.loops"] == 1.0
    linear = fabric.with_value("scene.kinematic_tension.contraction", "linear")
    assert linear.scene["kinematic_tension.variants.isometric.contraction"] == "linear"
    one = fabric.with_value("scene.kinematic_tension.variants.printed.strain", "fabric")
    assert one.scene["kinematic_tension.variants.printed.strain"] == "fabric"
    assert len(one.scene["kinematic_tension.variants"]) == 7


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("friction", 1.5, "jersey.friction: is no key"),
        ("yarn.friction", 1.5, "grey.friction = 1.5: must be at least 0 and at most 1"),
        ("yarn.twist_per_m", 1e5, "surface angle"),
        ("yarn", "other", "is no key whose value can be changed"),
        ("wale_spacing_mm", [0.9, 1.0], "must be one value"),
        ("scene.tensile_test.steps", 5, "is not given"),
        ("yarn.diameter_mm", 0.95, "yarn too thick"),
    ],
)
def test_with_value_refuses(study_of, path, value, words):
    with pytest.raises(InputError, match=words):
        study_of().fabrics["jersey"].with_value(path, value)


@pytest.mark.parametrize(
    ("key", "number"),
    [("count_dtex", 200), ("count_tex", 20), ("count_den", 180), ("count_Nm", 50),
     ("count_Ne", 29.5270)],
)  # fmt: skip
def test_yarn_count_in_any_unit(study_of, key, number):
    changes = {"yarns grey count_tex": None, f"yarns grey {key}": number}
    yarn = study_of(changes).yarns["grey"]
    assert yarn["linear_density"] == pytest.approx(20e-6, rel=1e-5)


def test_defaults_that_follow_from_other_keys(study_of):
    yarn = study_of({"yarns grey twist_per_m": 1000.0, "yarns grey count_tex": 30}).yarns["grey"]
    # Peirce: 1/(28 sqrt(Ne)) inch, Ne = 590.54 / tex.
    ne = 0.45359237 / (840 * 0.9144) / 30e-6
    assert yarn["diameter"] == pytest.approx(0.0254 / (28 * math.sqrt(ne)), rel=1e-12)
    assert 360 * 1000 * yarn["section_spacing"] == pytest.approx(15.0)
    # 40 round fibres: EI = E pi d^4 / 64 each.
    fibre_diameter = math.sqrt(4 * 30e-6 / 40 / 1520 / math.pi)
    rigidity = 40 * 8e9 * math.pi * fibre_diameter**4 / 64
    assert yarn["bending_rigidity"] == pytest.approx(rigidity, rel=1e-12)
    assert yarn["breaking_strain"] == 0.07
    law = {"kind": "points", "strain": [0, 0.1, 0.3], "tension_N": [0, 1, 2]}
    yarn = study_of({"yarns grey tension_law": law}).yarns["grey"]
    assert yarn["breaking_strain"] == 0.3 and yarn["tension_law.plastic"] is False


def test_adding_a_yarn_and_a_fabric_takes_one_entry_each(tmp_path):
    shutil.copytree(CONFIG, tmp_path / "config")
    for name, entry in (
        ("yarns", "wool: {count_Nm: 28, fibres: 60, "
         "tension_law: {kind: points, strain: [0, 0.1], tension_N: [0, 3]}}"),
        ("fabrics", "wool_jersey: {yarn: wool, wales_per_inch: 14, courses_per_inch: 18, "
         "loop_length_mm: 6.6}"),
    ):  # fmt: skip
        with (tmp_path / "config" / f"{name}.yaml").open("a") as file:
            file.write(f"\n{entry}\n")
    study = load_study(tmp_path / "config")
    assert list(study.fabrics) == ["cotton", "cotton_rib", "acrylic_jersey", "wool_jersey"]
    assert study.fabrics["wool_jersey"].scene["kinematic_tension"] is not None
    assert study.yarns["wool"].scene["tensile_test.readings"] == ["corrected", "printed"]


def test_sections_left_out_are_not_run(study_of):
    study = study_of({"scenes all kinematic_bending": None})
    assert study.fabrics["jersey"].scene["kinematic_bending"] is None
    assert list(study.fabrics["jersey"].as_dict()["scene"]["tests"]) == ["kinematic_tension"]


def test_variants_take_from_the_section_what_they_do_not_state(study_of):
    changes = {
        "scenes all kinematic_tension": {
            "contraction": "linear",
            "variants": {"mine": {}, "other": {"contraction": "none", "viscous": True}},
        }
    }
    variants = study_of(changes).fabrics["jersey"].scene["kinematic_tension.variants"]
    assert list(variants) == ["mine", "other"]
    assert (variants["mine"]["contraction"], variants["mine"]["viscous"]) == ("linear", False)
    assert (variants["other"]["contraction"], variants["other"]["viscous"]) == ("none", True)
    assert variants["other"]["law"] == "continuous"


# Sweeps


def test_sweeps_of_a_fabric(study_of):
    study = study_of({"fabrics jersey loop_length_mm": [3.3, 3.35], "fabrics jersey set": [0, 0.5]})
    assert list(study.fabrics) == [
        "jersey_loop_length_mm=3.3,set=0", "jersey_loop_length_mm=3.3,set=0.5",
        "jersey_loop_length_mm=3.35,set=0", "jersey_loop_length_mm=3.35,set=0.5",
    ]  # fmt: skip
    fabric = study.fabrics["jersey_loop_length_mm=3.35,set=0.5"]
    assert fabric["loop_length"] == pytest.approx(3.35e-3) and fabric["set"] == 0.5
    assert fabric.base == "jersey" and fabric.point == {"loop_length_mm": 3.35, "set": 0.5}


def test_a_sweep_of_a_yarn_makes_fabrics(study_of):
    study = study_of(
        {
            "yarns grey tension_law k1_N": [20, 3e1],
            "fabrics jersey loop_length_mm": [3.3, 3.35],
            "fabrics fixed": FABRICS["jersey"] | {"yarn": "grey_tension_law.k1_N=20"},
        }
    )
    assert list(study.yarns) == ["grey_tension_law.k1_N=20", "grey_tension_law.k1_N=30"]
    assert len(study.fabrics) == 5
    fabric = study.fabrics["jersey_loop_length_mm=3.35,tension_law.k1_N=30"]
    assert fabric.yarn["tension_law.k1"] == 30.0 and fabric["loop_length"] == pytest.approx(3.35e-3)
    assert study.fabrics["fixed"].yarn["tension_law.k1"] == 20.0


def test_a_sweep_over_lists_words_and_assumptions(study_of):
    law = {"kind": "points", "strain": [0, 0.1], "tension_N": [[0, 1], [0, 2]]}
    study = study_of(
        {
            "yarns grey tension_law": law,
            "yarns grey friction": {"assumed": [0.1, 0.2], "range": [0, 0.5], "because": "guess"},
            "yarns grey twist_direction": ["Z", "S"],
        }
    )
    assert len(study.yarns) == 8
    name = "grey_tension_law.tension_N=no2,friction=0.1,twist_direction=S"
    yarn = study.yarns[name]
    assert yarn["tension_law.tension"] == [0.0, 2.0] and yarn["twist_direction"] == "S"
    rows = {row.key: row for row in yarn.assumptions()}
    assert (rows["friction"].value, rows["friction"].high) == (0.1, 0.5)
    assert rows["friction"].subject == name and "twist_direction" not in rows


def test_names_are_safe_as_file_names(study_of):
    study = study_of(
        {"fabrics jersey scene": ["all", "other"], "scenes other": SCENES["all"],
         "yarns grey twist_per_m": [1e-5, 500]}
    )  # fmt: skip
    allowed = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.+-=,")
    assert len(study.fabrics) == 4
    for name in (*study.fabrics, *study.yarns):
        assert set(name) <= allowed


# What each stage depends on


def changed_stages(one, other):
    stages = [stage for stage in STAGES if stage != "yarn"]
    return {stage for stage in stages if one.config(stage) != other.config(stage)}


def test_params_are_narrow(study_of):
    fabric = study_of().fabrics["jersey"]
    equilibrium = {stage for stage in STAGES if "equilibrium" in closure(stage)}
    kinematic = {"kinematic_tension", "kinematic_bending"}
    everything = {"centre_line", "loop"} | kinematic | equilibrium
    for path, value, stages in (
        ("loop_length_mm", 3.35, everything),
        ("yarn.diameter_mm", 0.17, everything),
        ("set", 0.5, equilibrium),
        ("yarn.friction", 0.3, equilibrium),
        ("yarn.section_stiffness_MPa", 500, set()),
        ("yarn.twist_per_m", 400, {"loop"} | kinematic),
        ("sections_per_loop", 50, {"loop"} | kinematic),
        ("yarn.tension_law.k1_N", 31, {"law"} | kinematic | equilibrium),
        ("scene.kinematic_bending.steps", 20, {"kinematic_bending"}),
        ("scene.kinematic_tension.variants.printed.law", "continuous", {"kinematic_tension"}),
    ):
        assert changed_stages(fabric, fabric.with_value(path, value)) == stages, path
    yarn = study_of().yarns["grey"]
    assert yarn.config("yarn") != yarn.with_value("section_stiffness_MPa", 500).config("yarn")
    assert yarn.config("yarn") == yarn.with_value("friction", 0.3).config("yarn")


def test_config_carries_its_assumptions(paper):
    config = paper.fabrics["cotton"].config("kinematic_bending")
    keys = {row["key"] for row in config["assumed"]}
    assert {"loop_length_mm", "diameter_mm", "kinematic_bending.loops", "loop_anchors"} <= keys
    assert not {"friction", "bending_rigidity_N_mm2", "kinematic_tension.contraction"} & keys
    assert list(config["tests"]) == ["kinematic_bending"]
    assert json.loads(json.dumps(config, allow_nan=False)) == config


def test_every_stage_and_key_is_known(paper):
    for section in (YARN, FABRIC):
        for keys in section.quantities().values():
            assert set(keys[0].stages) <= set(STAGES)
            # Only what names a thing has no stage of its own.
            assert keys[0].stages or keys[0].quantity in ("scene", "yarn")
    for section in SCENE.sections:
        assert section.stage in STAGES and section.of in ("yarn", "fabric")
    assert closure("kinematic_tension") == {"kinematic_tension", "loop", "centre_line", "law"}
    with pytest.raises(KeyError):
        paper.fabrics["cotton"].config("knitting")


def test_json_is_the_same_each_time(paper):
    again = load_study(CONFIG)
    for name, fabric in paper.fabrics.items():
        assert fabric.as_json() == again.fabrics[name].as_json()
        assert json.loads(fabric.as_json()) == fabric.as_dict()


def test_loading_needs_no_numpy():
    code = (
        "import sys; from knitsim.study.study import load_study; "
        f"load_study({str(CONFIG)!r}); heavy = {{'numpy', 'scipy', 'numba', 'xarray', 'pandas'}}; "
        "sys.exit(len(heavy & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_files_of_a_study(paper):
    names = [path.relative_to(CONFIG).as_posix() for path in paper.files]
    assert names == [
        "yarns.yaml", "fabrics.yaml", "scenes.yaml", "curves/polyester_rebuilt.csv",
        "curves/cotton_rebuilt.csv", "curves/acrylic_wale_pins.csv",
        "curves/acrylic_wale_clamps.csv", "curves/acrylic_jersey_wale.csv",
        "curves/acrylic_jersey_course.csv",
    ]  # fmt: skip


def test_the_small_study():
    study = load_study(CONFIG / "small")
    assert [yarn["fibres"] for yarn in study.yarns.values()] == [7]
    (fabric,) = study.fabrics.values()
    assert fabric.scene["kinematic_tension.steps"] <= 10


def test_a_curve_is_found_beside_the_study_above_it_or_in_the_fallback(study_of, tmp_path):
    curve = {"file": "curves/cotton_rebuilt.csv", "kind": "two_slope"}
    yarn = study_of({"yarns grey tension_curve": curve, "yarns grey tension_law": None})
    assert yarn.yarns["grey"].curve_paths == [CONFIG / "curves/cotton_rebuilt.csv"]
    (tmp_path / "curves").mkdir()
    (tmp_path / "curves/cotton_rebuilt.csv").write_text("")
    assert yarn.yarns["grey"].curve_paths == [tmp_path / "curves/cotton_rebuilt.csv"]
    assert yarn.yarns["grey"]["tension_law"] is None


# The key reference and the table itself


def test_the_key_reference_is_up_to_date():
    text = (CONFIG / "README.md").read_text("utf-8")
    assert reference.updated(text) == text
    assert reference.updated(text.replace("`loop_length_mm`", "`gone`")) == text


def sections_within(section):
    yield section
    for inner in section.sections:
        yield from sections_within(inner)


def test_the_table_is_consistent():
    count = 0
    for top in (YARN, FABRIC, SCENE):
        for section in sections_within(top):
            names = [key.name for key in section.keys] + [part.name for part in section.sections]
            assert len(names) == len(set(names))
            for key in section.keys:
                count += 1
                assert key.about.endswith(".")
                for number in (key.default, *key.plausible) if not callable(key.default) else ():
                    if isinstance(number, (int, float)) and not isinstance(number, bool):
                        assert number in key.interval, key.name
                if key.kind == "choice" and key.default is not REQUIRED:
                    assert key.default is None or key.default in key.choices
                assumed = key.because and key.default is not None
                if assumed and key.kind in ("number", "integer"):
                    assert len(key.plausible) == 2
    assert count > 60


# Refusals

BAD = [
    # (key as "file name key", value, what the message must hold)
    ("fabrics jersey courses_per_cm", -3,
     "fabrics.yaml: jersey.courses_per_cm = -3: must be above 0"),
    ("fabrics jersey courses_per_cm", 0, "= 0: must be above 0"),
    ("fabrics jersey courses_per_cm", True, "jersey.courses_per_cm = True: must be a number"),
    ("fabrics jersey courses_per_cm", "8,33",
     "must be a number in loops/cm (with a decimal point)"),
    ("fabrics jersey courses_per_cm", "8.33", "(without quotes)"),
    ("fabrics jersey courses_per_cm", "many", "= 'many': must be a number"),
    ("fabrics jersey courses_per_cm", math.nan, "= nan: must be a finite number"),
    ("fabrics jersey courses_per_cm", math.inf, "= inf: must be a finite number"),
    ("fabrics jersey courses_per_cm", [8, -1], "= -1: must be above 0"),
    ("fabrics jersey courses_per_cm", [], "a sweep needs at least one value"),
    ("fabrics jersey courses_per_cm", [14, 14.0], "two points of the sweep are named"),
    ("fabrics jersey courses_per_cm", [[14]], "must be a number"),
    ("fabrics jersey loop_length_mm", None,
     "jersey.loop_length_mm: is missing; give loop_length_mm, or tightness_factor, or"),
    ("fabrics jersey course_spacing_mm", 0.7, "gives the same quantity as courses_per_cm"),
    ("fabrics jersey loop_lenght_mm", 3.3,
     "jersey.loop_lenght_mm: is no key; the nearest is loop_length_mm"),
    ("fabrics jersey loop_length_cm", 0.33,
     "the unit must be one that is known here: loop_length_mm"),
    ("fabrics jersey loop_length_inch", 3.3, "known here: loop_length_mm"),
    ("fabrics jersey wales_per_mm", 1, "wales_per_cm or wales_per_inch or wale_spacing_mm"),
    ("fabrics jersey dye", 5, "is no key; known here: source, yarn,"),
    ("fabrics jersey weight", 5, "is no key; here it is called mass_per_area_g_per_m2"),
    ("fabrics jersey yarn", "gray", "no such yarn; yarns.yaml has: grey"),
    ("fabrics jersey scene", "nothing", "no such scene; scenes of a fabric are: all"),
    ("fabrics jersey scene", "pull", "is a scene of a yarn"),
    ("fabrics jersey wale_spacing_mm", 0.15, "yarn too thick"),
    ("fabrics jersey set", 1.2, "must be at least 0 and at most 1"),
    ("fabrics jersey centre_line", "circle", "must be spline or curve"),
    ("fabrics jersey sections_per_loop", 20.5, "must be a whole number"),
    ("fabrics Jersey", FABRICS["jersey"], "differs from jersey by upper and lower case only"),
    ("fabrics a/b", FABRICS["jersey"], "a/b: is part of file names"),
    ("fabrics jersey=2", FABRICS["jersey"], "is part of file names"),
    ("fabrics trailing.", FABRICS["jersey"], "is part of file names"),
    ("fabrics empty", {}, "empty.yarn: is missing"),
    ("fabrics jersey", 7, "jersey = 7: must hold keys"),
    ("yarns grey fibres", 0, "must be at least 1 and at most 100000"),
    ("yarns grey count_Ne", 30, "gives the same quantity as count_tex"),
    ("yarns grey count_lea", 30, "count_dtex or count_tex or count_den or count_Ne or count_Nm"),
    ("yarns grey tension_law kind", "cubic", "must be bilinear or secant or points"),
    ("yarns grey tension_law k2_N", None, "grey.tension_law.k2_N: is missing"),
    ("yarns grey tension_law low_N", 3, "is a key of kind secant, not of bilinear"),
    ("yarns grey tension_law yield_strain", 0.08,
     "must be above the yield strain of the law, 0.08"),
    ("yarns grey twist_per_m", 5000, "must be at most 3303 turns per m"),
    ("yarns grey section_spacing_mm", 0.3,
     "grey.section_spacing_mm = 0.3: must be at most 0.25 mm"),
    ("yarns grey diameter_mm", 0.1, "the fibres alone fill that much"),
    ("yarns grey source", 5, "must be text"),
    ("yarns grey scene", "all", "is a scene of a fabric"),
    ("yarns grey friction", {"assumed": 0.2, "range": [0.3, 0.4], "because": "x"},
     "within its range"),
    ("yarns grey friction", {"assumed": 0.2, "range": [0.4, 0.1], "because": "x"}, "low first"),
    ("yarns grey friction", {"assumed": 0.2, "range": [0, 1.4], "because": "x"},
     "range = 1.4: must be"),
    ("yarns grey friction", {"assumed": 0.2, "range": 0.4, "because": "x"}, "must be [low, high]"),
    ("yarns grey friction", {"assumed": 0.2, "range": [0, 1]}, "friction.because: is missing"),
    ("yarns grey friction", {"assumed": 0.2, "because": "x"}, "friction.range: is missing"),
    ("yarns grey friction", {"assumed": 0.2, "range": [0, 1], "because": ""}, "must be a reason"),
    ("yarns grey friction", {"assume": 0.2}, "friction.assume: is no key; an assumption has"),
    ("yarns grey tension_curve", {"file": "curves/none.csv", "kind": "bilinear"},
     "no such file in"),
    ("scenes all kinematic_tension steps", [3, 4], "must be one value; lists make sweeps of yarns"),
    ("scenes all kinematic_tension directions", "course", "must be a list, in brackets"),
    ("scenes all kinematic_tension directions", [], "must not be empty"),
    ("scenes all kinematic_tension directions", ["bias"],
     "directions[0] = 'bias': must be course or wale"),
    ("scenes all kinematic_tension directions", ["wale", "wale"], "stands twice in the list"),
    ("scenes all kinematic_tension variants", {}, "must name at least one"),
    ("scenes all kinematic_tension variants", {"a": {"steps": 3}}, "variants.a.steps: is no key"),
    ("scenes all kinematic_tension variants", {"a b": {}}, "variants: a b: is part of file names"),
    ("scenes all kinematic_shear", {}, "is no key; the nearest is kinematic_"),
    ("scenes pull tensile_test recovery", "yes", "must be true or false"),
    ("scenes pull kinematic_tension", {}, "must hold tests of either a yarn or a fabric"),
    ("scenes nothing", {}, "must hold tests of either a yarn or a fabric"),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value", "words"), BAD, ids=[f"{b[0]}={b[1]}"[:60] for b in BAD])
def test_refused(study_of, key, value, words):
    with pytest.raises(InputError) as refusal:
        study_of({key: value})
    message = str(refusal.value)
    assert words in message
    assert "\n" not in message and f"{key.split()[0]}.yaml: " in message


def test_the_files_that_the_refusals_start_from_are_accepted(study_of):
    assert list(study_of().fabrics) == ["jersey"]


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ({"kind": "points", "strain": [0, 0.1], "tension_N": [0]}, "as many as the strains (2)"),
        ({"kind": "points", "strain": [0.01, 0.1], "tension_N": [0, 1]}, "[0] = 0.01: must be 0"),
        ({"kind": "points", "strain": [0, 0.1, 0.05], "tension_N": [0, 1, 2]}, "strain[2] = 0.05"),
        ({"kind": "points", "strain": [0, 0.1], "tension_N": [0, "1 N"]}, "tension_N[1] = '1 N'"),
        ({"kind": "points", "strain": 0.1, "tension_N": [0, 1]}, "must be a list"),
        ({"kind": "secant", "low_N": 9, "high_N": 5, "offset_N": 1, "switch_strain": 0.01},
         "must be above low_N = 9"),
        ({"kind": "secant", "low_N": 4, "high_N": 5, "offset_N": 1, "switch_strain": 0.01},
         "must be above the switch strain of the law, 1"),
    ],
)  # fmt: skip
def test_laws_refused(study_of, law, words):
    with pytest.raises(InputError) as refusal:
        study_of({"yarns grey tension_law": law})
    assert words in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "fabrics.yaml: is empty"),
        ("# nothing\n", "is empty"),
        ("- a\n- b\n", "must hold a mapping"),
        ("a: {yarn: grey\nb: 1\n", "fabrics.yaml:2: is not YAML: "),
        ("a:\n\tyarn: grey\n", "fabrics.yaml:2: is not YAML: "),
        ("a:\n  yarn: grey\n  set: 0\n  set: 1\n", "fabrics.yaml:4: set: stands twice"),
        ("a: {}\na: {}\n", "fabrics.yaml:2: a: stands twice"),
        ("a: &x\n  yarn: *x\n", "nested too deeply"),
        ("a: !!python/object:os.system {}\n", "YAML tags are not used"),
        ("? [a]\n: 1\n", "a key must be one word"),
        ("a: 1\n---\nb: 1\n", "is not YAML"),
        ("a:\n", "fabrics.yaml: a: is empty"),
        (b"\xff\xfea: 1", "is not UTF-8"),
    ],
)
def test_files_refused(study_of, text, words):
    with pytest.raises(InputError) as refusal:
        study_of(fabrics=text)
    assert words in str(refusal.value) and "\n" not in str(refusal.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"scenes\.yaml: no such file"):
        load_study(tmp_path)


@pytest.mark.parametrize(
    ("written", "value"),
    [("5e-1", 0.5), ("1e-1", 0.1), ("0.5", 0.5), (".5", 0.5), ("+0.25", 0.25), ("1", 1.0),
     ("0", 0.0), ("01", 1.0), ("1.", 1.0)],
)  # fmt: skip
def test_numbers_are_read_as_people_write_them(study_of, written, value):
    # PyYAML reads 5e-1 as text and 01 as octal.
    text = yaml.safe_dump(FABRICS) + f"  set: {written}\n"
    assert study_of(fabrics=text).fabrics["jersey"]["set"] == value


def test_words_are_not_taken_for_truth(study_of):
    # PyYAML reads no as false and 12:30:45 as a number.
    entry = yaml.safe_dump(FABRICS["jersey"], default_flow_style=True).strip()
    study = study_of(fabrics=f"\ufeffno: {entry}\n12: {entry}\r\n")
    assert list(study.fabrics) == ["no", "12"]
    with pytest.raises(InputError, match="'0:30': must be a number"):
        study_of(fabrics=yaml.safe_dump(FABRICS) + "  set: 0:30\n")


@pytest.mark.parametrize(
    ("yarn", "fabric"),
    [
        ({"count": "30/1"}, {"loop_length_mm": 2.9}),
        ({"count": "150/48 den"}, {"tightness_factor": 14}),
        ({"count": "30/1", "bending_rigidity_N_mm2": 1e-3}, {"loop_length_mm": 2.9}),
    ],
)
def test_an_assumption_matters_to_every_stage_whose_values_follow_from_it(yarn, fabric):
    """A fibre modulus gives the bending rigidity of the yarn, so it matters to every test of the fabric."""
    fabric = ks.Fabric(ks.Yarn(**yarn), **fabric)
    results = [stage for stage in STAGES if stage not in ("law", "centre_line", "loop")]
    changed = 0
    for row in fabric.assumptions():
        for value in (row.low, row.high) if row.path and row.low is not None else ():
            other = fabric.with_value(row.path, value)
            for stage in results:
                matters = other.values_of(closure(stage)) != fabric.values_of(closure(stage))
                changed += matters
                assert not matters or closure(stage) & set(row.stages), (row.path, stage)
    assert changed > 50

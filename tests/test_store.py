"""The result store: what is written, what is refused, and how it is found again."""

import csv
import json
import os
import tracemalloc
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import knitsim
from knitsim.errors import InputError
from knitsim.files import replacing
from knitsim.store import tensile as tensile_datasets
from knitsim.store.reader import open_store, scalar_table
from knitsim.store.results import LABELS, labels_of, path_of
from knitsim.store.schema import COORDINATES, REFERENCES, VARIABLES
from knitsim.store.timing import Timings, write_csv
from knitsim.store.writer import describe, to_json, write

REQUIRED = (
    "title", "summary", "source", "references", "Conventions", "schema_version",
    "knitsim_version", "source_hash", "configuration", "assumptions", "keywords", "license",
    "creator_name", "id", "naming_authority",
)  # fmt: skip


def described(dataset, stage="loop", fabric="f", yarn="y", labels=None, **changes):
    given = {
        "title": "A test", "summary": "Made by a test.", "references": ("paper", "wang"),
        "configuration": {"name": "f", "b": [1.5, 2], "a": "µ"}, "assumptions": [{"key": "k"}],
    }  # fmt: skip
    about = labels_of(stage, fabric, yarn, pattern="jersey" if fabric else "", **(labels or {}))
    return describe(dataset, stage, about, **(given | changes))


def tensile(steps=70, points=25, scale=1.0, seed=3):
    """A tensile test with random values: every bit of a force matters."""
    random = np.random.default_rng(seed)
    strain = np.linspace(0.0, 0.3, steps)
    variables = {
        "force_per_loop": scale * random.random(steps),
        "status": np.zeros(steps, dtype=np.int8),
        "centreline": 1e-3 * random.standard_normal((steps, points, 3)),
    }
    recovery = np.arange(steps) > steps // 2
    return tensile_datasets.test_dataset(
        "strain", strain, recovery, variables, stretch_energy=random.random(steps)
    )


# Writing


def test_a_file_says_what_it_holds(tmp_path):
    dataset = described(tensile_datasets.stack_variants({"one": tensile(), "two": tensile(seed=4)}))
    dataset["diameter"] = 2.5e-4
    write(dataset, tmp_path / "new/folder/test.nc")
    with netCDF4.Dataset(tmp_path / "new/folder/test.nc") as file:
        for name in REQUIRED:
            assert file.getncattr(name)
        assert file.Conventions == "CF-1.11, ACDD-1.3"
        assert file.source == file.creator_name == f"knitsim {knitsim.__version__}"
        said = {name: file.getncattr(name) for name in LABELS}
        assert said == {
            "kind": "loop", "yarn": "y", "fabric": "f", "pattern": "jersey", "model": "kinematic",
            "direction": "", "calibration": "",
        }  # fmt: skip
        assert "jersey" in file.keywords.split(", ")
        assert file.id.startswith("loop/f-")
        assert json.loads(file.configuration) == {"a": "µ", "b": [1.5, 2], "name": "f"}
        assert json.loads(file.assumptions) == [{"key": "k"}]
        assert file.references == "; ".join(REFERENCES[key] for key in ("paper", "wang"))
        force = file["force_per_loop"]
        assert (force.dimensions, force.units) == (("variant", "step"), "N")
        assert force.long_name and "_FillValue" not in force.ncattrs()
        assert force.dtype == np.float64
        assert list(file["axis"][:]) == ["course", "wale", "thickness"]
        assert list(file["term"][:]) == ["stretch", "bend", "contact", "friction"]
        assert set(file["phase"][:]) == {"loading", "recovery"}
        assert list(file["variant"][:]) == ["one", "two"]
        assert file["diameter"][...] == 2.5e-4
        assert not any("date" in name or name == "history" for name in file.ncattrs())


def test_flags_are_numbers_with_their_meaning(tmp_path):
    dataset = described(tensile())
    dataset["status"][3] = 1
    dataset["crossings_intact"] = np.int8(1)
    write(dataset, tmp_path / "test.nc")
    with netCDF4.Dataset(tmp_path / "test.nc") as file:
        for name, meaning, value in (
            ("status", "beyond_breaking_strain", file["status"][3]),
            ("crossings_intact", "intact", file["crossings_intact"][...]),
        ):
            flag = file[name]
            assert flag.dtype == flag.flag_values.dtype == np.int8
            assert "units" not in flag.ncattrs()
            meanings = flag.flag_meanings.split(" ")
            assert list(flag.flag_values) == list(range(len(meanings)))
            assert meanings[int(value)] == meaning
    for table in (VARIABLES, COORDINATES):
        for entry in table.values():
            assert all(flag == "_".join(flag.split()) for flag in entry.flags)
            assert len(set(entry.flags)) == len(entry.flags)


def test_forces_are_exact_and_shapes_within_a_millionth(tmp_path):
    dataset = described(tensile(scale=1e-9))
    write(dataset, tmp_path / "test.nc")
    with xr.open_dataset(tmp_path / "test.nc") as read:
        for name in ("force_per_loop", "energy", "strain"):
            np.testing.assert_array_equal(read[name], dataset[name])
        lines, kept = dataset["centreline"].values, read["centreline"].values
        error = np.abs(kept - lines) / np.abs(lines)
        # Not exact: otherwise this would not test the rounding.
        assert 0 < error.max() < 1e-6


def test_writing_leaves_the_callers_dataset_alone(tmp_path):
    dataset = described(tensile())
    before = dataset.copy(deep=True)
    write(dataset, tmp_path / "test.nc")
    xr.testing.assert_identical(dataset, before)


def test_an_id_is_that_of_its_input_and_stage():
    one = described(tensile()).attrs["id"]
    assert one == described(tensile(seed=4)).attrs["id"]
    others = [
        described(tensile(), configuration={"name": "f"}),
        described(tensile(), "equilibrium_rest"),
        described(tensile(), fabric="g"),
    ]
    assert len({one, *(other.attrs["id"] for other in others)}) == 4


def test_equal_datasets_give_equal_bytes(tmp_path):
    for name in ("one", "two"):
        write(described(tensile()), tmp_path / f"{name}.nc")
    write(described(tensile(seed=4)), tmp_path / "other.nc")
    one = (tmp_path / "one.nc").read_bytes()
    assert one == (tmp_path / "two.nc").read_bytes()
    assert one != (tmp_path / "other.nc").read_bytes()
    assert to_json({"b": 1, "a": [0.1]}) == to_json({"a": [0.1], "b": 1})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.assign(force=d["force_per_loop"]), "'force' is not in the result schema"),
        (lambda d: d.assign_coords(where=("step", d["strain"].values)), "'where' is not in"),
        # A coordinate by name only, and the other way about.
        (lambda d: d.reset_coords("strain"), "'strain' is not in the result schema"),
        (lambda d: d.set_coords("energy"), "'energy' is not in the result schema"),
        *(
            (
                lambda d, name=name: d.drop_attrs(deep=False).assign_attrs(
                    {key: value for key, value in d.attrs.items() if key != name}
                ),
                f"attribute {name} is missing",
            )
            for name in ("kind", "fabric", "title", "source_hash", "configuration", "assumptions")
        ),
    ],
)
def test_what_the_schema_does_not_know_is_refused(tmp_path, change, words):
    with pytest.raises(ValueError, match=words):
        write(change(described(tensile())), tmp_path / "test.nc")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_nothing_and_keeps_the_old_file(tmp_path):
    write(described(tensile()), tmp_path / "test.nc")
    before = (tmp_path / "test.nc").read_bytes()
    broken = described(tensile())
    broken.attrs["extra"] = {"netCDF": "has no such attribute"}
    with pytest.raises(TypeError):
        write(broken, tmp_path / "test.nc")
    with pytest.raises(TypeError):
        write(broken, tmp_path / "new.nc")
    assert [path.name for path in tmp_path.iterdir()] == ["test.nc"]
    assert (tmp_path / "test.nc").read_bytes() == before


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_replacing_is_whole_or_not_at_all(tmp_path, error):
    path = tmp_path / "a/b/file.txt"
    with pytest.raises(error), replacing(path) as partial:
        partial.write_text("half")
        assert not path.exists() and partial.parent == path.parent
        raise error
    assert list(path.parent.iterdir()) == []
    with replacing(path) as partial:
        partial.write_text("whole")
    with pytest.raises(error), replacing(path) as partial:
        partial.write_text("half")
        raise error
    assert path.read_text() == "whole" and list(path.parent.iterdir()) == [path]


def test_csv_is_whole_or_not_at_all(tmp_path):
    write_csv(tmp_path / "t.csv", ("name", "value"), [("a,b", 1), {"value": 2, "name": 'c"'}])
    assert (tmp_path / "t.csv").read_text() == 'name,value\n"a,b",1\n"c""",2\n'
    with pytest.raises(KeyError):
        write_csv(tmp_path / "t.csv", ("name", "value"), [{"name": "no value"}])
    with pytest.raises(KeyError):
        write_csv(tmp_path / "u.csv", ("name", "value"), [("a", 1), {"name": "no value"}])
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]
    assert len((tmp_path / "t.csv").read_text().splitlines()) == 3


def test_run_times_are_medians_of_what_was_called(tmp_path):
    timings, calls = Timings("stage", "subject", "wale"), []
    with timings.measure("a block", note="cold", whole=True):
        pass
    assert timings.repeat("a call", lambda: calls.append(1) or 7, budget=0.0) == 7
    assert len(calls) == 2  # one not counted
    timings.write(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="", encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    for row, name, repeats, note, whole in (
        (first, "a block", "1", "cold", "yes"), (second, "a call", "1", "median, compiled", "")
    ):  # fmt: skip
        assert float(row.pop("value")) >= 0 and row.pop("machine")
        assert row == {
            "stage": "stage", "subject": "subject", "direction": "wale", "name": name, "units": "s",
            "repeats": repeats, "note": note, "whole_test": whole,
        }  # fmt: skip


# Reading

SWEPT = "plain_loop_length_mm=5.5"
# What is in a file is said by its attributes: path, stage, about what, and a value.
SHELF = {
    "yarn/thin.nc": ("yarn", "", {}, {"linear_density": 2e-5}),
    "loop/plain.nc": ("loop", "plain", {}, {"loop_length": 5e-3, "centreline": None}),
    f"loop/{SWEPT}.nc": ("loop", SWEPT, {}, {"loop_length": 5.5e-3}),
    "relaxed/plain.nc": ("equilibrium_rest", "plain", {}, {"loop_length": 5e-3}),
    **{
        f"tensile/{fabric}/{model}_{direction}.nc": (
            f"{model}_tension", fabric, {"direction": direction}, {"diameter": diameter}
        )
        for fabric, model, direction, diameter in (
            ("plain", "kinematic", "course", 1e-4), ("plain", "kinematic", "wale", 2e-4),
            ("plain", "equilibrium", "course", 3e-4), (SWEPT, "kinematic", "course", 4e-4),
        )
    },
    "bending/plain/kinematic_course.nc": (
        "kinematic_bending", "plain", {"direction": "course"}, {"diameter": 5e-4}
    ),
    "verification/cases.nc": ("verification", "", {}, {"diameter": 6e-4}),
}  # fmt: skip


@pytest.fixture
def store(tmp_path):
    for path, (stage, fabric, labels, values) in SHELF.items():
        values = dict(values)
        if "centreline" in values:
            values["centreline"] = (("loop", "point", "axis"), np.ones((1, 4, 3)))
        yarn = "" if stage == "verification" else "thin"
        assert path_of(stage, fabric=fabric, yarn=yarn, **labels) == path
        write(described(xr.Dataset(values), stage, fabric, yarn, labels), tmp_path / path)
    tables = tmp_path / "tables"
    tables.mkdir()
    (tables / "timing.csv").write_text("stage,name,value,units\nloop,all,1.5,s\n")
    (tables / "corrections.csv").write_text("where,size\neq (1),large\n")
    # What a killed writer may leave is no result.
    (tmp_path / "loop/.plain.nc.123.part").write_bytes(b"half")
    return tmp_path


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        ({}, set(SHELF)),
        ({"kind": "loop"}, {"loop/plain.nc", "loop/plain_loop_length_mm=5.5.nc"}),
        ({"yarn": "thin"}, set(SHELF) - {"verification/cases.nc"}),
        ({"yarn": "thin", "pattern": "jersey"}, {path for path in SHELF if "plain" in path}),
        ({"fabric": "plain"}, {path for path in SHELF if "/plain/" in path or "/plain.nc" in path}),
        ({"model": "equilibrium", "kind": "tensile"}, {"tensile/plain/equilibrium_course.nc"}),
        (
            {"fabric": "plain", "model": "kinematic", "direction": "course"},
            {"tensile/plain/kinematic_course.nc", "bending/plain/kinematic_course.nc"},
        ),
        (
            {"fabric": "plain_loop_length_mm=5.5", "kind": "tensile"},
            {"tensile/plain_loop_length_mm=5.5/kinematic_course.nc"},
        ),
        ({"kind": "verification"}, {"verification/cases.nc"}),
    ],
)
def test_open_store_selects_by_label(store, labels, expected):
    with open_store(store, **labels) as tree:
        found = {node.path.lstrip("/") for node in tree.subtree if node.has_data}
        assert found == {path.removesuffix(".nc") for path in expected}
        for path in expected:
            dataset = tree[path.removesuffix(".nc")].dataset
            for name, value in SHELF[path][-1].items():
                if value is not None:
                    assert dataset[name].item() == value
            assert dataset.attrs["title"] == "A test"


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        ({"fabric": "jersey"}, ["fabric = jersey", "fabric: plain, plain_loop_length_mm=5.5"]),
        ({"kind": "tensile", "direction": "bias"}, ["direction = bias", "direction: course, wale"]),
        ({"model": "kinetic"}, ["model = kinetic", "model: equilibrium, kinematic"]),
    ],
)
def test_open_store_says_what_there_is(store, labels, words):
    with pytest.raises(InputError) as caught:
        open_store(store, **labels)
    message = str(caught.value)
    assert "\n" not in message and str(store) in message
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("folder", "says"), [("", "it is empty"), ("nowhere", "no such directory")]
)
def test_open_store_of_nothing_says_so(tmp_path, folder, says):
    with pytest.raises(InputError, match=says):
        open_store(tmp_path / folder)


def test_open_store_reads_when_asked_and_not_before(tmp_path):
    size = 2_000_000
    values = np.zeros(size)
    big = described(xr.Dataset({"curve_tension": ("sample", values)}), "yarn", "", "big")
    write(big, tmp_path / "yarn/big.nc")
    with open_store(tmp_path) as warm:  # imports and caches of the first call are not counted
        assert warm["yarn/big"].dataset.sizes == {"sample": size}
    tracemalloc.start()
    try:
        with open_store(tmp_path) as tree:
            variable = tree["yarn/big"].dataset["curve_tension"]
            _ = variable.shape, variable.attrs, repr(tree)
            unread = tracemalloc.get_traced_memory()[1]
            assert variable.values.sum() == 0.0
            read = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert unread < values.nbytes / 8
    assert read >= values.nbytes


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="lists the open files of Linux")
def test_open_store_holds_no_file_open(store):
    def held():
        links = []
        for link in Path("/proc/self/fd").iterdir():
            try:
                links.append(os.readlink(link))
            except FileNotFoundError:
                continue  # that of the listing itself
        return [link for link in links if link.startswith(str(store))]

    # One file twice open, once closed and opened again once ended Python: no file stays open.
    first, second = open_store(store), open_store(store, kind="loop")
    assert held() == []
    second.close()
    with open_store(store) as third:
        np.testing.assert_array_equal(
            third["loop/plain"].dataset["centreline"], first["loop/plain"].dataset["centreline"]
        )
    first.close()


def test_scalar_table_is_tidy(store):
    table = scalar_table(store)
    assert list(table.columns)[:11] == [
        "kind", "yarn", "fabric", "pattern", "model", "direction", "calibration", "variant", "name",
        "value", "units",
    ]  # fmt: skip
    # A variable along points is no scalar, and a table without name and value has none.
    assert len(table) == len(SHELF) + 1
    row = table[
        (table.kind == "tensile") & (table.fabric == "plain") & (table.model == "kinematic")
    ]
    assert dict(zip(row.direction, row.value, strict=True)) == {"course": 1e-4, "wale": 2e-4}
    assert set(row.units) == {"m"} and set(row.name) == {"diameter"}
    timing = table[table.kind == "table/timing"].iloc[0]
    assert (timing["name"], timing["value"], timing["units"]) == ("all", 1.5, "s")
    assert table[table.kind == "yarn"].iloc[0][["yarn", "value"]].tolist() == ["thin", 2e-5]


def test_scalar_table_names_variants_and_quantities_with_their_units(tmp_path):
    dataset = xr.Dataset(
        {
            "frame_closure_angle": ("variant", [0.25, 0.5]),
            "headline": ("quantity", [3.0, 40.0]),
            "yarn_tension": ("step", [1.0, 2.0]),
        },
        {
            "variant": ["corrected", "printed"],
            "quantity": ["largest force", "areal mass"],
            "quantity_units": ("quantity", ["N", "kg m-2"]),
            "step": [0, 1],
        },
    )
    labels = {"direction": "wale"}
    write(described(dataset, "kinematic_tension", labels=labels), tmp_path / "some/where.nc")
    table = scalar_table(tmp_path).set_index("name")
    assert len(table) == 4
    angle = table.loc["frame_closure_angle"].set_index("variant")
    assert angle.value.to_dict() == {"corrected": 0.25, "printed": 0.5}
    assert set(angle.units) == {"rad"}
    assert table.loc["largest force", ["value", "units"]].tolist() == [3.0, "N"]
    assert table.loc["areal mass", ["value", "units"]].tolist() == [40.0, "kg m-2"]
    assert set(table.direction) == {"wale"} and set(table.fabric) == {"f"}


def test_scalar_table_of_nothing_has_its_columns(tmp_path):
    table = scalar_table(tmp_path)
    assert len(table) == 0 and {"kind", "name", "value", "units"} <= set(table.columns)


def test_what_a_killed_writer_left_is_cleared(tmp_path):
    from knitsim.files import replacing

    left = tmp_path / ".a=1,b.nc.12345.part"
    other = tmp_path / ".a=2,b.nc.12345.part"
    left.write_text("half")
    other.write_text("half of another")
    with replacing(tmp_path / "a=1,b.nc") as partial:
        partial.write_text("whole")
    assert (tmp_path / "a=1,b.nc").read_text() == "whole"
    assert not left.exists() and other.exists()

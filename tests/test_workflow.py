"""The workflow's results, and what a change makes run again."""

import json
import os
import re
import shutil

import numpy as np
import pytest
import xarray as xr
from workflow_tools import BENT, ROOT, STUDY, below, fresh

from knitsim.store.results import LABELS, RESULTS, path_of

# They run the models themselves, to time them, and on a fabric of the study.
TIMED = ("benchmark_quick", "skipping")


# The finished run


def test_all_that_is_declared_is_made_and_nothing_else(finished, every_job):
    rules = {job.rule for job in every_job}
    assert {"yarn", "kinematic", "equilibrium", "readings", "tables", "page"} <= rules
    declared = {finished.folder / output for job in every_job for output in job.outputs}
    assert all(path.exists() for path in declared)
    # Logs, and the study as it was checked.
    beside = {finished.results / "benchmark/logs", finished.results / "study"}
    for path in finished.results.rglob("*"):
        if path.is_file() and path.name != ".snakemake_timestamp":
            inside = {path, *path.parents} & declared or beside & set(path.parents)
            assert inside, f"{path} is made by no rule"
            assert not path.name.startswith("."), f"{path} is left over"
            assert not path.name.endswith((".part", ".tmp"))


def test_the_run_is_quiet(finished):
    log = (finished.folder / "log.txt").read_text()
    assert not re.findall(r".*(?:Warning|Traceback|Error).*", log)
    assert all(not path.read_text() for path in finished.results.glob("benchmark/logs/*.log"))


def test_nothing_to_do(finished):
    assert finished.planned() == set()


def test_a_sweep_has_results_for_each_point(finished):
    for name, length in zip(BENT, (3.3e-3, 3.35e-3), strict=True):
        with xr.open_dataset(finished.results / f"loop/{name}.nc") as loop:
            assert float(loop["loop_length"]) == pytest.approx(length, rel=1e-9)
        assert (finished.results / f"bending/{name}/kinematic_course.nc").exists()
        assert not (finished.results / f"bending/{name}/kinematic_wale.nc").exists()
        assert not (finished.results / f"tensile/{name}").exists()


def test_results_elsewhere(tmp_path):
    text = fresh(tmp_path).run("--dry-run", config=["results=some/where"])
    paths = re.findall(r"^    (?:output|log): (.*)$", text, flags=re.MULTILINE)
    assert len(paths) > 10
    assert all(path.startswith("some/where/") for line in paths for path in line.split(", "))


def test_lint(finished):
    """Nothing but the wish for conda: versions are pinned for pip, in workflow/envs."""
    text = finished.run("--lint", succeeds=False)
    titles = set(re.findall(r"^    \* (.*):$", text, flags=re.MULTILINE))
    assert titles == {"Specify a conda environment or container for each rule."}


# The contract with the readers of the files: names, dimensions and units, written down here again.

ATTRIBUTES = {
    "title", "summary", "source", "references", "Conventions", "schema_version", "knitsim_version",
    "source_hash", "configuration", "assumptions", "kind", "yarn", "fabric", "pattern", "model",
    "direction", "keywords", "license", "creator_name", "id",
}  # fmt: skip
STATES = ("variant", "step")
LINE = (*STATES, "loop", "point", "axis")
TENSILE = {
    "force_per_loop": (STATES, "N"), "force_per_width": (STATES, "N m-1"),
    "yarn_tension": (STATES, "N"), "yarn_strain": (STATES, "1"),
    "transverse_strain": (STATES, "1"), "wale_spacing": (STATES, "m"),
    "course_spacing": (STATES, "m"), "energy": ((*STATES, "term"), "J"), "work": (STATES, "J"),
    "dissipated": (STATES, "J"), "centreline": (LINE, "m"), "min_distance": (STATES, "1"),
    "status": (STATES, None),
}  # fmt: skip
BENDING = {
    "moment_per_width": (STATES, "N"), "wale_spacing": (STATES, "m"),
    "course_spacing": (STATES, "m"), "energy": ((*STATES, "term"), "J"),
    "centreline": (LINE, "m"), "status": (STATES, None),
}  # fmt: skip
SOLVED_BENDING = BENDING | {
    "work": (STATES, "J"), "dissipated": (STATES, "J"), "min_distance": (STATES, "1"),
    "yarn_tension": (STATES, "N"), "yarn_strain": (STATES, "1"), "residual": (STATES, "N"),
    "numerical_error": (STATES, "1"), "change_error": (STATES, "1"),
}  # fmt: skip
CONTRACT = {
    "tensile/small/kinematic_course.nc": TENSILE,
    "tensile/small/kinematic_wale.nc": TENSILE,
    "bending/small/kinematic_course.nc": BENDING,
    "bending/small/kinematic_wale.nc": BENDING,
    f"bending/{BENT[0]}/kinematic_course.nc": BENDING,
    "bending/small/equilibrium_course.nc": SOLVED_BENDING,
    "bending/small/equilibrium_wale.nc": SOLVED_BENDING,
    "yarn_to_fabric/small.nc": {
        "fabric_rigidity": (("row", "direction"), "N m"), "curl_moment": (("row", "direction"), "N"),
        "yarn_rigidity": ((), "N m2"), "swept_loop_length": (("row",), "m"),
    },
    "loop/small.nc": {
        "centreline": (("loop", "point", "axis"), "m"),
        "fibre_point": (("section", "fibre", "axis"), "m"),
        "tangent": (("section", "axis"), "1"), "wale_spacing": ((), "m"), "loop_length": ((), "m"),
        "over": (("crossing",), None), "tightness_factor": ((), "tex0.5 cm-1"),
    },
    "yarn/small.nc": {
        "law_strain": (("form", "vertex"), "1"), "law_tension": (("form", "vertex"), "N"),
        "fibre_position": (("fibre", "section_axis"), "m"), "yarn_tension": (STATES, "N"),
        "linear_density": ((), "kg m-1"),
    },
}  # fmt: skip
VALUES = {
    "axis": ["course", "wale", "thickness"], "term": ["stretch", "bend", "contact", "friction"]
}  # fmt: skip


@pytest.mark.parametrize("path", CONTRACT)
def test_files_keep_the_contract(finished, path):
    with xr.open_dataset(finished.results / path) as dataset:
        for name, (dims, units) in CONTRACT[path].items():
            variable = dataset[name]
            assert variable.dims == dims, name
            assert variable.attrs.get("units") == units, name
            if units is not None:
                assert variable.dtype == np.float64, name
                assert np.isfinite(variable.sel(variant=dataset["variant"][0]) if "variant" in dims
                                   else variable).all(), name  # fmt: skip
        if path.startswith(("tensile", "bending")):
            along, units = ("strain", "1") if path.startswith("tensile") else ("curvature", "m-1")
            assert {along, "phase", "cycle", "variant", "step"} <= set(dataset.coords)
            assert dataset[along].attrs["units"] == units
            assert set(dataset["phase"].values) <= {"loading", "recovery"}
            assert set(dataset["cycle"].values) == {1}


def test_every_file_describes_itself(finished):
    paths = sorted(finished.results.rglob("*.nc"))
    assert len(paths) >= 10
    for path in paths:
        with xr.open_dataset(path) as dataset:
            assert set(dataset.attrs) >= ATTRIBUTES, path
            assert not any("date" in name or name == "history" for name in dataset.attrs), path
            configuration = json.loads(dataset.attrs["configuration"])
            # The one table says where a file lies, and the file what it is.
            place, said = path.relative_to(finished.results).as_posix(), dataset.attrs
            [stage] = [
                one.stage for one in RESULTS.values()
                if (one.kind, one.model) == (said["kind"], said["model"])
            ]  # fmt: skip
            assert place == path_of(stage, **{name: said[name] for name in LABELS})
            assert configuration["name"] in (said["fabric"], said["yarn"], said["kind"])
            assert bool(said["fabric"]) == (said["pattern"] == "jersey")
            assumed = {row["key"]: row for row in json.loads(dataset.attrs["assumptions"])}
            assert all(row["because"] for row in assumed.values())
            if path.parts[-2] == "loop":
                # Left to Peirce's rule by the study; stated by it.
                assert "diameter_mm" in assumed and "loop_length_mm" not in assumed
                assert "diameter" in configuration["yarn"]["values"]
            for name, variable in dataset.variables.items():
                assert variable.attrs.get("long_name"), f"{path}: {name}"
                if "flag_meanings" in variable.attrs:
                    known = set(variable.attrs["flag_values"])
                    assert set(np.unique(variable.values)) <= known, f"{path}: {name}"
            for name in set(VALUES) & set(dataset.coords):
                assert dataset[name].values.tolist() == VALUES[name]


# What a change makes run again


def test_a_changed_density_reruns_that_fabric_and_what_shows_it(project, every_job):
    # The sweep has the same spacings: change the first entry only.
    text = (project.folder / STUDY / "fabrics.yaml").read_text()
    changed = text.replace("course_spacing_mm: 0.7", "course_spacing_mm: 0.71", 1)
    assert changed != text
    (project.folder / STUDY / "fabrics.yaml").write_text(changed)
    planned = project.planned()
    own = {
        job for job in every_job if job.wildcards.get("fabric") == "small" or job.rule == "skipping"
    }
    assert {"kinematic", "equilibrium"} <= {job.rule for job in own}
    assert planned == below(every_job, own)
    assert not any(job.rule == "yarn" or job.rule.startswith("compile") for job in planned)
    assert {job.wildcards.get("fabric", "small") for job in planned} == {"small"}
    assert "tables" in {job.rule for job in planned}


def test_a_new_point_of_a_sweep_runs_that_point_and_the_tables(project):
    project.edit(f"{STUDY}/fabrics.yaml", "[3.3, 3.35]", "[3.3, 3.35, 3.4]")
    planned = project.planned()
    new = {job for job in planned if any("bent_loop_length_mm=3.4" in path for path in job.outputs)}
    assert {"kinematic_2", "readings"} <= {job.rule for job in new}
    assert {job.rule for job in planned - new} == {"tables", "page", "skipping"}


def test_a_changed_test_reruns_that_test_and_what_shows_it(project, every_job):
    project.edit(f"{STUDY}/scenes.yaml", "kinematic_bending: {steps: 4}", "kinematic_bending: {}")
    own = {job for job in every_job if job.rule == "kinematic"}
    assert len(own) == 1
    assert project.planned() == below(every_job, own)


@pytest.fixture(scope="module")
def moved(finished, tmp_path_factory):
    """The finished project with a copy of the sources, and its jobs; sources to be put back."""
    folder = tmp_path_factory.mktemp("moved")
    sources = folder / "sources"
    for name in ("knitsim", "workflow", "config"):
        shutil.copytree(ROOT / name, sources / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy2(ROOT / "Snakefile", sources)
    project = finished.copy(folder / "work", sources)
    # The sources lie elsewhere now: take the results as theirs.
    project.run("--touch", "-c1")
    assert project.planned() == set()
    return project


@pytest.fixture
def edited(moved):
    """Add a comment to a module of the moved sources, for one test."""
    before = []

    def edit(path):
        file = moved.sources / path
        before.append((file, file.read_text(), file.stat()))
        file.write_text(before[-1][1] + "# Edited.\n")
        return moved.planned()

    yield edit
    for file, text, status in before:
        file.write_text(text)
        os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))


def test_an_edited_bending_kernel_reruns_bending_and_what_depends_on_it(edited, every_job):
    planned = edited("knitsim/kinematic/bending_kernels.py")
    # Kernels are compiled anew, and only the table of run times shows that.
    own = {job for job in every_job if job.rule.startswith(("kinematic", "compile", "benchmark"))}
    assert planned == below(every_job, own)
    assert {"kinematic", "kinematic_2", "tables"} <= {job.rule for job in planned}
    assert not {"equilibrium", "yarn", "yarn_to_fabric"} & {job.rule for job in planned}


def test_an_edited_tension_model_reruns_tension_and_what_depends_on_it(edited, every_job):
    # The fabrics of the sweep are bent only: theirs is another rule.
    own = {job for job in every_job if job.rule in ("kinematic", *TIMED)}
    assert edited("knitsim/kinematic/tension.py") == below(every_job, own)


def test_an_edited_figure_module_reruns_figures_only(edited, every_job):
    figures = {job for job in every_job if any(path.endswith(".png") for path in job.outputs)}
    assert edited("knitsim/figures/style.py") == below(every_job, figures)


def test_an_edited_script_reruns_its_rule(edited, every_job):
    own = {job for job in every_job if job.rule == "readings"}
    assert edited("workflow/scripts/readings.py") == below(every_job, own)

"""The workflow as a user runs it: from the command line, in a directory of its own.

One run of the small study, with a sweep added to it, is shared by all tests (and all processes of
pytest-xdist); tests that change anything work on a copy.
"""

import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from knitsim.store.results import LABELS, RESULTS, path_of

ROOT = Path(__file__).resolve().parents[1]
STUDY = "config/small"
# A sweep of two fabrics with one test in one direction, beside the fabric of the small study.
SWEEP = """
bent:
  yarn: small
  wale_spacing_mm: 0.9
  course_spacing_mm: 0.7
  loop_length_mm: [3.3, 3.35]
  sections_per_loop: 16
  scene: bending_only
"""
SCENE = """
bending_only:
  kinematic_bending: {steps: 2, directions: [course], loops: 1.0}
"""
BENT = ("bent_loop_length_mm=3.3", "bent_loop_length_mm=3.35")


@dataclass(frozen=True)
class Job:
    """One job of a dry run."""

    rule: str
    inputs: frozenset
    outputs: frozenset
    wildcards: dict

    def __hash__(self):
        return hash((self.rule, self.outputs))


class Project:
    """A working directory with its own configuration and results, and sources that it runs."""

    def __init__(self, folder, sources=ROOT):
        self.folder, self.sources = Path(folder), Path(sources)
        self.results = self.folder / "results"

    def command(self, *arguments, study=STUDY, config=()):
        # --config takes all words that follow, so it comes last.
        return [
            sys.executable, "-m", "snakemake", "--snakefile", str(self.sources / "Snakefile"),
            *arguments, "--config", f"study={study}", *config,
        ]  # fmt: skip

    def environment(self):
        # The sources of this project come first, wherever knitsim is installed from.
        return os.environ | {"PYTHONPATH": str(self.sources)}

    def run(self, *arguments, succeeds=True, **options):
        """What a run says, on both channels."""
        done = subprocess.run(
            self.command(*arguments, **options), cwd=self.folder, env=self.environment(),
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=500,
        )  # fmt: skip
        assert (done.returncode == 0) is succeeds, done.stdout
        return done.stdout

    def start(self, *arguments):
        """A run in a process group of its own."""
        return subprocess.Popen(
            self.command(*arguments), cwd=self.folder, env=self.environment(),
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip

    def planned(self, *arguments):
        """The jobs that a run would do now."""
        found = set()
        text = self.run("--dry-run", *arguments)
        blocks = re.split(r"^(?:local)?rule (\w+):$", text, flags=re.MULTILINE)
        for rule, block in zip(blocks[1::2], blocks[2::2], strict=True):
            lists = {
                name: line.split(", ")
                for name, line in re.findall(r"^    (\w+): (.*)$", block, flags=re.MULTILINE)
            }
            wildcards = dict(word.split("=", 1) for word in lists.get("wildcards", []))
            outputs = frozenset(lists.get("output", []))
            found.add(Job(rule, frozenset(lists.get("input", [])), outputs, wildcards))
        assert found or "Nothing to be done" in text
        return {job for job in found if job.rule != "all"}

    def edit(self, file, old, new):
        path = self.folder / file
        text = path.read_text()
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {file}"
        path.write_text(text.replace(old, new))

    def files(self, pattern="**/*"):
        """Content of the result files by path; run times and logs left out."""
        return {
            path.relative_to(self.results).as_posix(): path.read_bytes()
            for path in sorted(self.results.glob(pattern))
            if path.is_file() and not path.name.startswith(".snakemake")
            and "benchmark" not in path.parts and path.name != "timing.csv"
        }  # fmt: skip

    def copy(self, folder, sources=None):
        """This project in ``folder``, as Snakemake sees it: times of files are kept."""
        shutil.copytree(self.folder, folder, dirs_exist_ok=True)
        return Project(folder, sources or self.sources)


# They run the models themselves, to time them, and on a fabric of the study.
TIMED = ("benchmark_quick", "skipping")


def below(jobs, first):
    """``first`` and every one of ``jobs`` that needs them, directly or not."""
    found, grew = set(first), True
    while grew:
        made = frozenset().union(*(job.outputs for job in found))
        more = {job for job in jobs if job.inputs & made} - found
        found, grew = found | more, bool(more)
    return found


def once(factory, name, build):
    """``build(folder)`` in a folder that all processes of this test run share; its folder."""
    root = factory.getbasetemp()
    root = root.parent if "PYTEST_XDIST_WORKER" in os.environ else root
    folder, done, failed = root / name, root / f"{name}.done", root / f"{name}.failed"
    try:
        folder.mkdir()
    except FileExistsError:
        deadline = time.monotonic() + 600
        while not done.exists():
            assert not failed.exists(), f"{name} failed in another process of this test run"
            assert time.monotonic() < deadline, f"{name} takes too long"
            time.sleep(0.1)
        return folder
    try:
        build(folder)
    except BaseException:
        failed.touch()
        raise
    done.touch()
    return folder


def fresh(folder):
    """A project with the small study and the sweep, nothing run yet."""
    shutil.copytree(ROOT / "config", folder / "config")
    for name, text in (("fabrics", SWEEP), ("scenes", SCENE)):
        with (folder / STUDY / f"{name}.yaml").open("a") as file:
            file.write(text)
    return Project(folder)


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The project after its run, not to be changed; its log is in log.txt."""

    def build(folder):
        (folder / "log.txt").write_text(fresh(folder).run("-c2"))

    return Project(once(tmp_path_factory, "finished", build))


@pytest.fixture(scope="session")
def every_job(finished):
    return finished.planned("--forceall")


@pytest.fixture
def project(finished, tmp_path):
    """A copy of the finished project."""
    return finished.copy(tmp_path)


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
    assert {job.rule for job in planned - new} == {"tables", "page"}


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


# Interruptions


def wait_for(condition, process, seconds=300):
    deadline = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, "the run ended before it could be interrupted"
        assert time.monotonic() < deadline
        time.sleep(0.01)


def kill_and_resume(project, finished, moment, *targets):
    """Kill the run and all its jobs as soon as a file fits ``moment``; resume as the README says."""
    with project.start("-c2", *targets) as process:
        try:
            wait_for(lambda: any(project.results.glob(moment)), process)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    # Killed in the middle: otherwise this proves nothing.  A half-written file may be there.
    whole = {name for name in project.files() if not name.endswith(".part")}
    assert whole < set(finished.files())
    project.run("--unlock")
    project.run("-c2", *targets, "--rerun-incomplete")
    assert project.files() == finished.files()
    assert not [path for path in project.results.rglob("*.part")]


def remove_results(project, kinds):
    """Remove the netCDF files below the folders ``kinds``; their paths."""
    found = [path for kind in kinds for path in sorted(project.results.glob(f"{kind}/**/*.nc"))]
    for path in found:
        path.unlink()
    return [path.relative_to(project.folder).as_posix() for path in found]


@pytest.mark.slow
def test_kill_in_the_middle_then_resume(project, finished):
    targets = remove_results(project, ["bending"])
    assert len(targets) == 6
    kill_and_resume(project, finished, "bending/*/*.nc", *targets)


@pytest.mark.slow
@pytest.mark.parametrize(
    "moment",
    [
        "benchmark/logs/compile_*.log",
        "benchmark/stages/compile_yarn.csv",
        "benchmark/logs/yarn_small.log",
        "yarn/small.nc",
        "loop/small.nc",
        "tensile/small/*.nc",
        "figures/*.svg",
    ],
)
def test_kill_at_any_moment_then_resume(tmp_path, finished, moment):
    kill_and_resume(fresh(tmp_path), finished, moment)


@pytest.mark.slow
def test_terminate_then_plain_rerun_gives_the_same_bytes(project, finished):
    """All netCDF files anew, so that this is the second run that gives the same bytes."""
    targets = remove_results(project, ["*"])
    yarns = project.results / "yarn"
    with project.start("-c2", *targets) as process:
        wait_for(lambda: any(yarns.glob("*.nc")), process)
        process.terminate()
        assert process.wait(timeout=300) != 0
    kept = {path: path.stat().st_mtime_ns for path in yarns.glob("*.nc")}
    assert kept and set(project.files()) < set(finished.files())
    project.run("-c2", *targets)
    assert project.files() == finished.files()
    # What was finished is not made again.
    assert all(path.stat().st_mtime_ns == time for path, time in kept.items())


@pytest.mark.slow
def test_two_runs_give_the_same_bytes(project, finished):
    shutil.rmtree(project.results)
    project.run("-c2")
    assert project.files() == finished.files()


# Refusals and failures


def write_curve(project):
    rows = "".join(f"{0.002 * k:.3f},{0.1 * k:.2f}\n" for k in range(30))
    rows = rows.replace("0.020,1.00", "0.020,nan")
    (project.folder / STUDY / "curve.csv").write_text(f"# measured\nstrain,force_N\n{rows}")
    project.edit(
        f"{STUDY}/yarns.yaml",
        "tension_law: {kind: points, strain: [0, 0.02, 0.08], tension_N: [0, 0.6, 3.0]}",
        "tension_curve: {file: curve.csv, kind: two_slope}",
    )


def change(file, old, new):
    return lambda project: project.edit(f"{STUDY}/{file}.yaml", old, new)


LENGTH = "loop_length_mm: 3.3\n"
REFUSED = {
    "misspelt key": (
        change("fabrics", LENGTH, "loop_lenght_mm: 3.3\n"),
        ["config/small/fabrics.yaml: small.loop_lenght_mm", "loop_length_mm"],
    ),
    "negative density": (
        change("fabrics", LENGTH, f"{LENGTH}  wales_per_cm: -3\n"),
        ["config/small/fabrics.yaml: small.wales_per_cm = -3", "above 0"],
    ),
    "short loop": (
        change("fabrics", LENGTH, "loop_length_mm: 2.5\n"),
        ["config/small/fabrics.yaml: small.loop_length_mm = 2.5", "must be at least"],
    ),
    "missing file": (
        lambda project: (project.folder / STUDY / "scenes.yaml").unlink(),
        ["config/small/scenes.yaml: no such file"],
    ),
    "missing curve": (
        change("yarns", "count_tex: 20", "count_tex: 20\n  tension_curve: {file: no.csv, kind: bilinear}"),
        ["config/small/yarns.yaml: small.tension_curve.file = 'no.csv': no such file"],
    ),
    "curve with NaN": (write_curve, ["config/small/curve.csv:13", "nan"]),
}  # fmt: skip


def refusal(project, **options):
    """The one line with which a run refuses its input."""
    lines = project.run("-c2", succeeds=False, **options).strip().splitlines()
    assert len(lines) == 1, lines
    assert not project.results.exists()
    return lines[0]


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_refused_in_one_line(tmp_path, case):
    project = fresh(tmp_path)
    break_it, words = REFUSED[case]
    break_it(project)
    line = refusal(project)
    assert line.startswith("knitsim: ")
    for word in words:
        assert word in line
    if case == "short loop":
        # What the message says would be right is right.
        least = re.search(r"must be at least ([\d.]+) mm", line)[1]
        project.edit(f"{STUDY}/fabrics.yaml", "loop_length_mm: 2.5", f"loop_length_mm: {least}")
        assert project.planned()


def test_bad_arguments_are_refused_in_one_line(tmp_path):
    project = fresh(tmp_path)
    assert refusal(project, study="nowhere") == (
        "knitsim: nowhere/scenes.yaml: no such file; a study has yarns, fabrics, scenes"
    )
    assert refusal(project, config=["fabric=small"]) == (
        "knitsim: --config fabric = small: must be study=DIR, results=DIR, seed=NUMBER or cases=NUMBER"
    )
    for sample in ("cases=0", "seed=new"):
        key, _, value = sample.partition("=")
        assert refusal(project, config=[sample]) == (
            f"knitsim: --config {key} = {value}: must be a whole number above 0"
        )
    assert "shear_campaign_part" in project.run(
        "--dry-run", "shear_campaign", config=["seed=7", "cases=3"]
    )


def test_a_directory_named_by_a_number(tmp_path):
    text = fresh(tmp_path).run("--dry-run", config=["results=2024"])
    assert "    output: 2024/yarn/small.nc" in text


# Friction far above the tension of the yarn: valid input of a test that cannot recover.
STICKY = """
sticky_yarn:
  tensile_test: {steps: 5, max_strain: 0.03, viscous_coefficient_N_s_per_m: 1.0e+8}
"""


def test_a_yarn_that_fails_costs_no_other_anything(project, finished):
    yarn = (project.folder / STUDY / "yarns.yaml").read_text().replace("small:", "sticky:")
    fabric = (
        SWEEP.replace("bent", "stuck", 1).replace("small", "sticky").replace("[3.3, 3.35]", "3.3")
    )
    for name, text in (
        ("scenes", STICKY),
        ("yarns", yarn.replace("quick_yarn", "sticky_yarn")),
        ("fabrics", fabric),
    ):
        with (project.folder / STUDY / f"{name}.yaml").open("a") as file:
            file.write(text)
    output = project.run("-c2")
    said = [line for line in output.splitlines() if line.startswith("knitsim: ")]
    assert said[0].startswith("knitsim: config/small/yarns.yaml: sticky, yarn: stopped: ")
    assert "friction" in said[0]
    assert said[1].startswith(
        "knitsim: config/small/fabrics.yaml: stuck, kinematic_bending course: stopped"
    )
    assert "Traceback" not in output
    log = (project.results / "benchmark/logs/yarn_sticky.log").read_text()
    assert "ComputationError" in log
    before, after = finished.files("**/*.nc"), project.files("**/*.nc")
    assert {path: after[path] for path in before} == before
    with xr.open_dataset(project.results / "yarn/sticky.nc") as yarn:
        assert "friction" in yarn.attrs["stopped"]
    table = (project.results / "tables/summary.csv").read_text()
    assert "friction" in next(line for line in table.splitlines() if line.startswith("stuck"))
    assert "Stopped: " in (project.results / "index.html").read_text()
    assert project.planned() == set()


def test_a_result_that_is_cut_short_is_made_again(project, finished, every_job):
    path = project.results / "tensile/small/kinematic_course.nc"
    path.write_bytes(path.read_bytes()[:2000])
    own = {
        job for job in every_job if job.rule == "kinematic" and "small" in job.wildcards.values()
    }
    assert project.planned() == below(every_job, own)
    assert not path.exists()


def test_the_study_that_was_checked_is_kept(finished):
    (kept,) = (finished.results / "study").iterdir()
    for name in ("yarns", "fabrics", "scenes"):
        file = f"{STUDY}/{name}.yaml"
        assert (kept / file).read_bytes() == (finished.folder / file).read_bytes()


# The table at the end, and the page


def test_a_run_ends_with_a_table(finished):
    text = (finished.folder / "log.txt").read_text()
    lines = text[text.index("fabric  ") :].splitlines()
    assert "strain at 50" in lines[0]
    assert any(line.startswith("small") for line in lines)
    assert any(line.startswith(BENT[0]) for line in lines)
    assert "page: results/index.html" in lines


class Links(HTMLParser):
    """What a page links to, what can be linked to in it, and what it loads."""

    def __init__(self, text):
        super().__init__()
        self.links, self.names, self.loaded = [], set(), []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.names.add(given.get("id"))
        if tag == "a":
            self.links.append(given["href"])
        self.loaded += [given[name] for name in ("src", "srcset") if name in given]
        assert tag not in ("link", "script", "iframe")


def test_the_page_is_whole_by_itself_and_its_links_lead_somewhere(finished):
    page = Links((finished.results / "index.html").read_text(encoding="utf-8"))
    assert len(page.links) > 50 and len(page.loaded) > 10
    assert all(source.startswith("data:image/webp;base64,") for source in page.loaded)
    for link in page.links:
        if link.startswith("#"):
            assert link[1:] in page.names, link
        else:
            assert (finished.results / link).is_file(), link
    # What is behind each picture is one click away.
    for kind in ("png", "svg", "nc", "csv"):
        assert any(link.endswith(f".{kind}") for link in page.links)


def test_the_page_tells_the_hash_of_each_file(finished):
    text = (finished.results / "index.html").read_text(encoding="utf-8")
    files = [*finished.results.glob("*/**/*.nc"), finished.results / "tables/kes.csv"]
    assert len(files) > 10
    for path in files:
        assert hashlib.sha256(path.read_bytes()).hexdigest()[:16] in text, path


def test_every_rule_says_what_it_needs_and_none_counts_the_cores():
    for path in (ROOT / "workflow/rules").glob("*.smk"):
        text = path.read_text()
        assert "workflow.cores" not in text
        assert text.count("script:") == text.count("mem_mb=") == text.count("runtime="), path

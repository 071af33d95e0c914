"""The workflow stopped, refused, and with parts that fail."""

import os
import re
import shutil
import signal
import time

import pytest
import xarray as xr
from workflow_tools import STUDY, SWEEP, below, fresh

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
        # Of a fabric with tests of the kinematic model alone: no model is left.
        change("fabrics", "[3.3, 3.35]", "2.5"),
        ["config/small/fabrics.yaml: bent.loop_length_mm = 2.5", "must be at least"],
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


@pytest.mark.slow
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

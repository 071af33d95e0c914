"""What a benchmark measures by running other processes: start-up, files, fabrics in one run."""

import csv
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from knitsim.benchmark.fabric import COTTON
from knitsim.benchmark.front import cpu_time, exponent
from knitsim.equilibrium.dataset import pull_dataset
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError
from knitsim.stages.equilibrium_tension import STAGE
from knitsim.store.results import labels_of
from knitsim.store.timing import machine
from knitsim.store.writer import describe, write

FABRICS, CORES = (1, 3, 10, 30, 100), (1, 2)
TASK = "relaxing many fabrics in one run of the workflow"
_STUDY = {
    "yarns.yaml": """
yarn:
  count_tex: 56
  density_g_per_cm3: 1.52
  fibres: 19
  diameter_mm: 0.2793
  scene: pull
  tension_law: {kind: secant, low_N: 43.805, high_N: 94.005, offset_N: 0.48942, switch_strain: 0.01}
  breaking_strain: 0.07
""",
    "scenes.yaml": """
pull:
  tensile_test: {steps: 4}
rest:
  equilibrium_rest: {set_compared: [0.0]}
""",
}


def _children(call):
    """(wall seconds, CPU seconds of the child processes) of ``call()``."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    call()
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _process(command, **options):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    if done.returncode:
        tail = " ".join((done.stdout + done.stderr).split()[-40:])
        raise ComputationError(f"{' '.join(map(str, command[:4]))} failed: {tail}")


def start_up(repeats=3):
    """CPU seconds until a job of the equilibrium tension test has imported what it needs."""
    command = [sys.executable, "-c", "import knitsim.stages.equilibrium_tension"]
    return statistics.median(_children(lambda: _process(command))[1] for _ in range(repeats))


def files(repeats=5):
    """CPU seconds to write one curve of 30 states with its centre lines as netCDF."""
    curve = tensile(relax(COTTON), "course", 0.05 * np.arange(1, 31))

    with tempfile.TemporaryDirectory() as directory:

        def save():
            dataset = pull_dataset(curve)
            describe(
                dataset, STAGE, labels_of(STAGE, "cotton", "cotton", direction="course"),
                title="A curve", summary="Written to time it.", references=("munden",),
                configuration={"name": "cotton"}, assumptions=[],
            )  # fmt: skip
            write(dataset, f"{directory}/curve.nc")

        save()
        return cpu_time(save, repeats)[1]


def outside_phases(compile_files):
    """(phase, seconds, note) of what a test costs besides its solver.

    compile_files: run times of the workflow's compilation, as its rule ``compile`` writes them.
    """
    compiled = 0.0
    for path in compile_files:
        with Path(path).open(newline="", encoding="utf-8") as lines:
            compiled += sum(float(row["value"]) for row in csv.DictReader(lines))
    return [
        ("files", files(), "writing the result"),
        ("start-up", start_up(), "imports of one job"),
        ("compilation", compiled, "all kernels, once after a change of them"),
    ]


def _study(directory, fabrics):
    """A study with one yarn and a sweep of fabrics, each brought to rest and no more."""
    directory.mkdir(parents=True)
    for name, text in _STUDY.items():
        (directory / name).write_text(text)
    lengths = ", ".join(f"{x:.5f}" for x in np.linspace(5.5, 6.0, fabrics))
    (directory / "fabrics.yaml").write_text(
        "fabric:\n  yarn: yarn\n  wales_per_cm: 6.67\n  courses_per_cm: 8.33\n  scene: rest\n"
        f"  loop_length_mm: [{lengths}]\n"
    )


def many_fabrics(snakefile, sizes=FABRICS, cores=CORES):
    """Rows (by SCALING_COLUMNS) of runs of the workflow itself with more and more fabrics.

    snakefile: path of the workflow.  Times are wall times, since they are what cores bring down;
    the CPU time of all processes stands in the note.  Kernels must have been compiled.
    """
    rows = []
    for core in cores:
        walls = []
        for size in sizes:
            with tempfile.TemporaryDirectory() as name:
                directory = Path(name)
                _study(directory / "study", size)
                (directory / "run").mkdir()
                command = [
                    sys.executable, "-m", "snakemake", "-s", Path(snakefile).resolve(),
                    "--directory", directory / "run", f"-c{core}", "--quiet", "--config",
                    f"study={directory / 'study'}", "--until", "equilibrium_rest",
                ]  # fmt: skip
                wall, cpu = _children(
                    lambda command=command: _process(command, env=dict(os.environ))
                )
                found = len(list((directory / "run/results/relaxed").glob("*.nc")))
                if found != size:
                    raise ComputationError(
                        f"{TASK}: {found} relaxed fabrics, {size} were asked for"
                    )
            walls.append((size, wall, cpu))
        slope = exponent([s for s, _, _ in walls[-3:]], [w for _, w, _ in walls[-3:]])
        rows += [
            (
                TASK, size, "fabrics", core, f"{wall:.4g}", "", f"{slope:.3g}", "",
                f"wall time; {cpu:.3g} s CPU; {size + 1} jobs: one yarn, each fabric at rest, no figures",
                machine(),
            )
            for size, wall, cpu in walls
        ]  # fmt: skip
    return rows

"""The workflow as a user runs it, for the tests: a project of its own, its run shared by all of them.

One run of the small study, with a sweep added to it, is shared by all tests (and all processes of
pytest-xdist); tests that change anything work on a copy.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

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
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=1800,
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
        deadline = time.monotonic() + 1800
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

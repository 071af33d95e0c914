"""What goes wrong from outside: files cut short, full disks, damaged caches, edits meanwhile."""

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import xarray as xr

from knitsim.errors import ComputationError, InputError
from knitsim.files import cache_root, full_disk, is_whole
from knitsim.stages import several
from knitsim.stages.job import job, kept_study
from knitsim.store.reader import opened, stopped
from knitsim.store.results import LABELS
from knitsim.store.writer import write
from knitsim.study import kept
from knitsim.study.study import load_study
from knitsim.study.yaml_file import read_yaml

ROOT = Path(__file__).resolve().parents[1]
SMALL = ROOT / "config/small"


def python(code, **environment):
    """A process that runs ``code``; environment: variables, None to have none of that name."""
    changed = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    changed = {name: value for name, value in changed.items() if value is not None}
    return subprocess.run([sys.executable, "-c", code], env=changed, capture_output=True, text=True)


# Input


@pytest.mark.parametrize(
    "kind", ["[*a, *a, *a, *a, *a, *a, *a, *a]", "{x: *a, y: *a, z: *a, u: *a}"]
)
def test_aliases_that_stand_for_billions_of_values_are_refused(tmp_path, kind):
    lines = ["a0: &b0 [1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{k}: &b{k} " + kind.replace("*a", f"*b{k - 1}") for k in range(1, 11)]
    (tmp_path / "yarns.yaml").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="holds more than 200000 values"):
        read_yaml(tmp_path / "yarns.yaml")


def test_few_aliases_are_values_like_others(tmp_path):
    (tmp_path / "y.yaml").write_text("a: &x {b: 1}\nc: *x\n")
    assert read_yaml(tmp_path / "y.yaml") == {"a": {"b": 1}, "c": {"b": 1}}


def study_in(folder, change=lambda text: text, file="fabrics"):
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("yarns", "fabrics", "scenes"):
        text = (SMALL / f"{name}.yaml").read_text()
        (folder / f"{name}.yaml").write_text(change(text) if name == file else text)
    return folder


def test_lists_that_make_too_many_fabrics_are_refused(tmp_path):
    values = "[" + ", ".join(f"{3.3 + 1e-4 * k:.4f}" for k in range(400)) + "]"
    many = f"loop_length_mm: {values}\n  set: {values.replace('3.3', '0.1').replace('3.4', '0.2')}"
    study = study_in(tmp_path / "s", lambda text: text.replace("loop_length_mm: 3.3", many))
    with pytest.raises(InputError, match="make 160000 combinations: must be at most 100000"):
        load_study(study)


@pytest.mark.parametrize("name", ["/etc/hostname", "../secret.csv", "a/../../secret.csv"])
def test_a_curve_of_a_study_lies_in_it(tmp_path, name):
    (tmp_path / "secret.csv").write_text("the first line\n")
    curve = f"count_tex: 20\n  tension_curve: {{file: {name}, kind: bilinear}}"
    study = study_in(tmp_path / "s", lambda text: text.replace("count_tex: 20", curve), "yarns")
    with pytest.raises(InputError, match="must lie in the study") as refused:
        load_study(study)
    assert "first line" not in str(refused.value)


def test_a_name_with_a_newline_is_refused_in_one_line(tmp_path):
    study = study_in(tmp_path / "s", lambda text: text.replace("small:", '"sm\\nall":', 1))
    with pytest.raises(InputError, match="is part of file names") as refused:
        load_study(study)
    assert len(str(refused.value).splitlines()) == 1 and r"sm\nall" in str(refused.value)


# Edits while it runs


DIGEST = "00" * 8


def test_what_was_checked_is_what_is_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "curve.csv").write_text("strain,force_N\n0,0\n0.01,0.3\n0.02,0.6\n0.05,1.8\n")
    curve = "count_tex: 20\n  tension_curve: {file: curve.csv, kind: two_slope}"
    study_in(Path("deep/s"), lambda text: text.replace("count_tex: 20", curve), "yarns")
    (tmp_path / "work").mkdir()
    monkeypatch.chdir("work")
    # From beside the study, whose curve lies beside it again.
    os.rename("../curve.csv", "../deep/curve.csv")
    study = load_study("../deep/s")
    contents = {file: file.read_bytes() for file in study.files}
    folder = kept.folder_of(study, "results/study", DIGEST)
    Path("results/study/0123456789abcdef").mkdir(parents=True)  # of an earlier run
    Path("results/study/mine").mkdir()
    kept.keep(contents, folder, "results/study", DIGEST)
    assert sorted(path.name for path in Path("results/study").iterdir()) == [DIGEST, "mine"]
    assert kept.running("results/study") == folder and kept.running("nowhere") is None
    file = Path("../deep/s/fabrics.yaml")
    file.write_text(file.read_text().replace("3.3", "3.5"))
    Path("../deep/curve.csv").write_text("gone\n")
    here = Path.cwd()
    snakemake = SimpleNamespace(config={"study": "../deep/s", "kept": str(folder)})
    with kept_study(snakemake) as again:
        assert again.fabrics["small"]["loop_length"] == pytest.approx(3.3e-3)
        assert "0.01,0.3" in again.yarns["small"].curve_paths[0].read_text()
    assert Path.cwd() == here
    assert load_study("../deep/s").fabrics["small"]["loop_length"] == pytest.approx(3.5e-3)


# Tests that fail


class Fake:
    """A stage of one test, which fails as it is told."""

    def __init__(self, error):
        self.error = error

    def run(self, *given):
        raise self.error


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (ComputationError("no equilibrium\nat 3 %"), "no equilibrium at 3 %"),
        (
            InputError("loop length", 3.0, "must be at least 3.1"),
            "loop length = 3.0: must be at least 3.1",
        ),
        (KeyError("x"), "a fault of the program, KeyError: 'x'"),
    ],
)
def test_a_test_that_fails_leaves_the_reason_and_the_others(
    tmp_path, monkeypatch, capsys, error, why
):
    fabric = load_study(SMALL).fabrics["small"]
    loop, failed = tmp_path / "loop.nc", tmp_path / "failed.nc"
    real = several.import_module
    monkeypatch.setattr(
        several, "import_module",
        lambda name: Fake(error) if name.endswith("equilibrium_rest") else real(name),
    )  # fmt: skip
    several.run(
        fabric, [("equilibrium_rest", ""), ("loop", "")], [failed, loop], tmp_path / "times.csv",
        log=tmp_path / "log",
    )  # fmt: skip
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"knitsim: {SMALL / 'fabrics.yaml'}: small, equilibrium_rest: stopped: {why}"
    assert "Traceback" in (tmp_path / "log").read_text()
    ((about, said),) = stopped([failed, loop])
    assert said == why and about["kind"] == "relaxed" and about["fabric"] == "small"
    assert len(list(opened([failed, loop]))) == 1
    assert set(about) >= set(LABELS)


def test_what_is_no_fault_of_the_test_is_tried_again(tmp_path, monkeypatch):
    full = OSError(errno.ENOSPC, "No space left on device")
    monkeypatch.setattr(several, "import_module", lambda name: Fake(full))
    with pytest.raises(OSError, match="No space left"):
        fabric = load_study(SMALL).fabrics["small"]
        several.run(fabric, [("loop", "")], [tmp_path / "loop.nc"], tmp_path / "times.csv")
    assert not list(tmp_path.iterdir())


# Files


def dataset():
    attributes = {
        name: "x" for name in (*LABELS, "title", "source_hash", "configuration", "assumptions")
    }
    return xr.Dataset(
        {"centreline": (("loop", "point", "axis"), [[[0.0] * 3] * 4000])}, attrs=attributes
    )


def test_a_file_that_is_cut_short_is_known(tmp_path):
    path = tmp_path / "a.nc"
    write(dataset(), path)
    whole = path.read_bytes()
    assert is_whole(path)
    for length in (0, 1, 30, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        assert not is_whole(path), length
    assert not is_whole(tmp_path / "none.nc")
    for version in ("NETCDF4", "NETCDF4_CLASSIC"):
        dataset().to_netcdf(path, format=version)
        assert is_whole(path)


def fake_job(tmp_path):
    return SimpleNamespace(log=[str(tmp_path / "logs/job.log")], output=["results/a.nc"])


def test_a_full_disk_is_said_in_one_line(tmp_path):
    def broken():
        try:
            raise OSError(errno.ENOSPC, "No space left on device", "a.nc")
        except OSError as error:
            raise RuntimeError("NetCDF: HDF error") from error

    with pytest.raises(SystemExit) as ended, job(fake_job(tmp_path)):
        broken()
    assert (
        str(ended.value) == "knitsim: results/a.nc: no space left on the disk; what is done is kept"
    )
    assert "Traceback" in (tmp_path / "logs/job.log").read_text()


def test_a_log_that_cannot_be_written_is_said_in_one_line(tmp_path):
    (tmp_path / "logs").write_text("a file where a directory is needed")
    with pytest.raises(SystemExit) as ended, job(fake_job(tmp_path)):
        pass
    assert "logs" in str(ended.value) and len(str(ended.value).splitlines()) == 1


def test_a_result_that_finds_no_room_leaves_nothing(tmp_path):
    """The system itself ends the file at 20 kB, as a full disk does."""
    code = f"""
import resource, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_robust import dataset, write
import numpy as np
from knitsim.files import full_disk
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, resource.RLIM_INFINITY))
one = dataset()
one["centreline"] = one.centreline + np.random.default_rng(1).random(one.centreline.shape)
try:
    write(one, {str(tmp_path / "a.nc")!r})
except Exception as error:
    print("refused")
"""
    done = python(code)
    assert done.stdout == "refused\n", done.stderr
    assert not list(tmp_path.iterdir())
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY


def test_what_means_a_full_disk():
    for number in (errno.ENOSPC, errno.EDQUOT):
        assert full_disk(OSError(number, "x"))
    assert not full_disk(OSError(errno.EACCES, "x")) and not full_disk(ValueError("x"))


# The cache


CACHED = "from knitsim.files import cache_root; print(cache_root())"


@pytest.mark.parametrize("where", ["a file", "no home"])
def test_a_cache_that_cannot_be_written_is_said_once_and_gone_without(tmp_path, where):
    file = tmp_path / "file"
    file.write_text("")
    given = {"KNITSIM_CACHE_DIR": str(file / "cache")}
    if where == "no home":
        given = {"KNITSIM_CACHE_DIR": None, "XDG_CACHE_HOME": None, "HOME": str(file)}
    done = python(CACHED + "; " + CACHED, TMPDIR=str(tmp_path), KNITSIM_CACHE_TOLD=None, **given)
    assert done.returncode == 0
    assert len(set(done.stdout.split())) == 1 and done.stdout.startswith(str(tmp_path))
    (line,) = done.stderr.splitlines()
    assert line.startswith("knitsim: the cache of compiled kernels cannot be written")


def test_the_cache_of_this_process_is_where_it_is_said_to_be():
    assert cache_root().is_dir()


@pytest.mark.slow
def test_a_damaged_compiled_kernel_is_compiled_anew(tmp_path):
    (tmp_path / "kernel.py").write_text(
        "from knitsim.jit import njit\n@njit\ndef twice(x):\n    return 2.0 * x\nprint(twice(21.0))\n"
    )

    def run():
        environment = os.environ | {
            "PYTHONPATH": str(ROOT), "KNITSIM_CACHE_DIR": str(tmp_path / "cache"),
        }  # fmt: skip
        done = subprocess.run(
            [sys.executable, str(tmp_path / "kernel.py")],
            env=environment,
            capture_output=True,
            text=True,
        )
        assert done.stdout == "42.0\n", done.stderr
        return done.stderr

    assert not run()
    for pattern in ("*.nbc", "*.nbi"):
        (file,) = (tmp_path / "cache").rglob(pattern)
        file.write_bytes(file.read_bytes()[:-20])
        (line,) = run().splitlines()
        assert line.startswith("knitsim: compiled kernel") and "compiled anew" in line
        assert not run()

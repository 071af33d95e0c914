"""The command knitsim, as a user types it."""

import csv
import io
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from knitsim.command import main, parser, show
from knitsim.errors import InputError
from knitsim.study.study import load_study

ROOT = Path(__file__).resolve().parents[1]


def said(*arguments):
    """(exit status, standard output, standard error) of the command."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            status = main(arguments)
        except SystemExit as ended:  # of what argparse refuses
            status = ended.code
    return status, out.getvalue(), err.getvalue()


@pytest.mark.parametrize("template", ["jersey", "paper", "small"])
def test_every_study_that_comes_along_can_be_copied_and_is_sound(tmp_path, monkeypatch, template):
    target = tmp_path / "my study"
    status, out, _ = said("new", str(target), "--from", template)
    assert status == 0 and "knitsim run" in out
    # Curve files are found from there alone, as knitsim run does.
    monkeypatch.chdir(target)
    assert load_study(".").fabrics


def test_new_leaves_a_study_as_it_is(tmp_path):
    (tmp_path / "yarns.yaml").write_text("mine")
    status, out, err = said("new", str(tmp_path))
    assert status == 1 and not out
    assert err == f"knitsim: {tmp_path / 'yarns.yaml'}: is there already; name another directory\n"
    assert (tmp_path / "yarns.yaml").read_text() == "mine"


def test_check_names_what_is_wrong(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said("new", "s")
    file = tmp_path / "s/fabrics.yaml"
    file.write_text(file.read_text().replace("courses_per_cm: 20", "courses_per_cm: -20"))
    status, _, err = said("check", "s")
    assert status == 1
    assert err.startswith("knitsim: fabrics.yaml: jersey.courses_per_cm = -20: must be above 0")
    assert len(err.splitlines()) == 1


def test_a_run_that_is_refused_says_so_once(tmp_path, monkeypatch, capfd):
    """Nor is the table of an earlier run shown, which says nothing of this one."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "study"]) == 0
    capfd.readouterr()
    table = tmp_path / "study/results/tables/summary.csv"
    table.parent.mkdir(parents=True)
    table.write_text("fabric\n")
    assert main(["run", "study", "-c1", "--nonsense"]) == 2
    assert capfd.readouterr() == ("", "knitsim run: unrecognized arguments: --nonsense\n")
    fabrics = tmp_path / "study/fabrics.yaml"
    fabrics.write_text(fabrics.read_text().replace("courses_per_cm: 20", "courses_per_cm: -20"))
    assert main(["run", "study", "-c1"]) == 1
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1
    assert err.startswith("knitsim: fabrics.yaml: jersey.courses_per_cm = -20: must be above 0")


@pytest.mark.parametrize("command", ["check", "run"])
def test_a_directory_that_is_not_there(tmp_path, command):
    status, _, err = said(command, str(tmp_path / "none"))
    assert status == 1
    assert err.endswith("none: no such directory; knitsim new DIR makes one\n")


def test_help_names_every_command():
    text = parser().format_help()
    for name in ("new", "check", "run", "show", "fabric", "predict", "read"):
        assert f"    {name}" in text
    done = subprocess.run(
        [sys.executable, "-m", "knitsim", "read", "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "--column" in done.stdout


@pytest.mark.parametrize("arguments, words", [
    (["nothing"], "fabric = nothing: must be one of "),
    (["cotton"], "cotton.calibrations: needs one without free: {all_inputs: {fit: [your curve]}}"),
    (["acrylic_jersey", "--calibration", "core"], "calibration = core: must be one of all_inputs"),
    (["acrylic_jersey", "--results", "none"], "acrylic_jersey/all_inputs.nc: is not there; without"),
])  # fmt: skip
def test_a_prediction_that_cannot_be_made_says_why(arguments, words, monkeypatch):
    monkeypatch.chdir(ROOT)
    status, _, err = said("predict", *arguments, "--study", str(ROOT / "config"))
    assert status == 1 and words in err and len(err.splitlines()) == 1


# The table at the end of a run


def row(**given):
    directions = {
        f"{name}_{d}": "" for d in ("course", "wale")
        for name in (
            "strain_at_50_gf_per_cm_percent", "residual_strain_percent", "B_gf_cm2_per_cm",
            "2HB_gf_cm_per_cm", "curl_moment_gf_cm_per_cm", "force_at_percent",
            "force_at_largest_strain_gf_per_cm",
        )
    }  # fmt: skip
    plain = dict.fromkeys(
        ("fabric", "stated_wale_spacing_mm", "stated_course_spacing_mm", "rest_wale_spacing_mm",
         "rest_course_spacing_mm", "largest_numerical_error_percent", "left_out", "stopped"), "",
    )  # fmt: skip
    return plain | directions | given


def test_the_table_shows_what_is_known_and_why_the_rest_is_not():
    rows = [
        row(fabric="a", strain_at_50_gf_per_cm_percent_course="40.1", rest_wale_spacing_mm="0.75",
            stopped="equilibrium bending wale: no equilibrium at 1 per cm"),
        row(fabric="long_name", force_at_largest_strain_gf_per_cm_wale="12.3", force_at_percent_wale="30"),
    ]  # fmt: skip
    lines = show.lines_of(rows, Path("nowhere"))
    assert "40.1 / -" in lines[3] and lines[3].startswith("a ")
    # Nothing is known of bending: no column of it.
    assert "2HB" not in lines[0] and "strain at 50" in lines[0]
    assert "a: stopped: equilibrium bending wale: no equilibrium at 1 per cm" in lines
    assert "long_name, wale: 12.3 gf/cm at 30 %" in lines
    measured = row(fabric="b", measured="core: wale fitted, 7.1 % rms")
    assert "b: measured: core: wale fitted, 7.1 % rms" in show.lines_of([measured], Path("nowhere"))
    assert not any(line.startswith("page") for line in lines)


def test_show_reads_what_a_run_has_left(tmp_path):
    table = tmp_path / "results" / show.TABLE
    table.parent.mkdir(parents=True)
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, row())
        writer.writeheader()
        writer.writerow(row(fabric="a", rest_wale_spacing_mm="0.75", rest_course_spacing_mm="0.5"))
    for place in (tmp_path, tmp_path / "results"):
        status, out, _ = said("show", str(place))
        assert status == 0 and "0.75 / 0.5" in out and str(tmp_path / "results/tables") in out


def test_show_says_that_nothing_is_there(tmp_path):
    status, _, err = said("show", str(tmp_path))
    assert status == 1 and "knitsim run DIR" in err


# One fabric


def test_one_fabric_on_the_screen_in_a_table_and_in_a_picture(tmp_path):
    files = tmp_path / "states.csv", tmp_path / "curves.png"
    status, out, _ = said(
        "fabric", "--count-Ne", "30", "--loop-length-mm", "2.9", "--bending-rigidity-N-mm2", "0.002",
        "--courses-per-cm", "26", "--pull", "course=0.1", "--no-friction",
        "--tangential-stiffness-ratio", "0.8", "--csv", str(files[0]), "--png", str(files[1]),
    )  # fmt: skip
    assert status == 0
    assert "<Yarn: 19.68 tex" in out and "<Rest:" in out and "<Pull course" in out and "EMT" in out
    assert "note: 18" in out and "26 stated" in out and " g/m2" in out
    assert "assumed: " in out and "bending rigidity" not in out.partition("assumed: ")[2]
    assert "tangential" not in out
    with files[0].open(newline="") as file:
        states = list(csv.DictReader(file))
    assert float(states[-1]["strain (1)"]) == pytest.approx(0.1)
    assert {state["test"] for state in states} == {"pull course"}
    assert files[1].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--count", "Ne=0", "--loop-length-mm", "2.9"), ["count_Ne", "above 0"]),
        (("--count", "30/1", "--yarn", "fricton=0.2", "--loop-length-mm", "2.9"), ["fricton", "friction"]),
        (("--count", "30/1"), ["loop_length_mm"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--pull", "up"), ["direction", "course or wale"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--csv", "/no/where.csv"), ["no directory /no"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--csv", "states.xlsx"), ["--csv", "end in .csv"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--GSM", "150"), ["fabric.gsm", "keep one of them"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--wpi", "36"), ["called wales_per_inch"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--twist", "700"), ["yarn.twist:", "twist_per_m"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--friction", "25%"), ["0.25 is 25 %"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--set", "90"), ["at most 1 (", "; 0.9 is 90 %"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--fabric", "Pattern=kp"), ["nearest is pattern"]),
        (("--count", "30/1", "--tightness-factor", "1.5"), ["tightness_factor = 1.5", "at least 2"]),
        (("--count", "30/1", "--loop-length-mm"), ["expected one argument"]),
        (("--count", "30/1", "--loop-length-mm", "2.9", "--shorter"), ["--shorter", "--KEY VALUE"]),
        # No option by its beginning alone, which takes one for the other.
        (("--count", "30/1", "--loop-length", "2.9"), ["fabric.loop_length:", "loop_length_mm"]),
        (("--loop-length-mm", "2.9"), ["count_Ne", "is missing"]),
        (("--count", "20/1", "--loop-length-mm", "1.0"), ["diameters of its yarn", "density_checked"]),
        (
            ("--count", "20/1", "--loop-length-mm", "1.0", "--density-checked", "true"),
            ["squeezed", "computed to work: loop_length_mm"],
        ),
        (("--count-tex", "20", "--fabric", "friction=0.3"), ["fabric.friction", "key of the yarn"]),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_fabric_is_said_in_one_line(arguments, words):
    status, _, err = said("fabric", *arguments)
    assert status and len(err.splitlines()) == 1 and err.startswith("knitsim")
    for word in words:
        assert word in err


def test_a_message_is_one_line_whatever_is_in_a_name():
    assert str(InputError("a\nb", "c\x1b[2J", "d")) == r"a\nb = c\x1b[2J: d"


# The wheel


@pytest.mark.slow
def test_the_wheel_alone_runs_a_study(tmp_path):
    """Built, installed into an empty environment outside any clone: new, check, run, show."""
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(tmp_path), str(ROOT)],
        check=True,
    )
    (wheel,) = tmp_path.glob("knitsim-*.whl")
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "venv")], check=True)
    python = tmp_path / "venv/bin/python"
    subprocess.run([python, "-m", "pip", "install", "-q", str(wheel)], check=True)

    def command(*arguments):
        done = subprocess.run(
            [tmp_path / "venv/bin/knitsim", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    command("new", "study", "--from", "small")
    assert "small" in command("check", "study")
    out = command("run", "study", "-c2")
    assert "equilibrium small" in out and (tmp_path / "study/results/index.html").exists()
    assert command("show", "study").splitlines()[0].startswith("fabric")
    # A second run has nothing to do, and says what there is.
    assert "small" in command("run", "study")

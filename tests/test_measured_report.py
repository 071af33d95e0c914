"""What ``knitsim read`` shows of a file, and the way out: curves written, saved by Excel, read again."""

import re
import subprocess
import sys

import numpy as np
import pytest

from knitsim.measured.read import read_measured
from knitsim.measured.report import main, plot, report

TEXT = (
    "Gauge length;100,0;mm\nBreite;50;mm\n\nZeit [s];Weg [mm];Kraft [N]\n"
    + "".join(f"{i};{e},0;{f}\n" for i, (e, f) in enumerate([
        (0, "0,0"), (5, "0,1"), (10, "0,35"), (15, "0,9"), (20, "2,0"), (12, "0,4"), (8, "0,1"),
    ]))
    + "Mittelwert;10;0,5\n"
)  # fmt: skip


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "wale.csv"
    path.write_text(TEXT)
    return path


def test_the_report_names_columns_units_and_rows(path):
    text = report(read_measured(path, direction="wale"))
    assert text.startswith(
        "wale: tension along the wale, 7 points to 20 %, 0.04 N/mm, with recovery\n"
    )
    for line in (
        "UTF-8, cells between ';', decimal comma", "gauge length from line 1: Gauge length = 100,0 mm",
        "strain: column 2, 'Weg [mm]' in mm, over the gauge length",
        "force per width: column 3, 'Kraft [N]' in N, over the width", "columns not used: Zeit [s]",
        "line 12: below the data: Mittelwert",
    ):  # fmt: skip
        assert f"  - {line}" in text
    rows = [line.split() for line in text.split("\n")[-4:]]
    assert [float(v) for v in rows[2]] == [5, 20, 0.04]


def test_the_plot_shows_the_curve_its_specimens_and_its_band(path, tmp_path):
    other = tmp_path / "other.csv"
    other.write_text(TEXT.replace("0,35", "0,45").replace("2,0", "2,2"))
    fig = plot(read_measured([path, other], direction="wale"), tmp_path / "wale.png")
    ax = fig.axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        "Strain along the wale (%)",
        "Force per width (gf/cm)",
    )
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["specimens", "band", "mean", "recovery"]
    assert ax.get_lines()[0].get_xdata() == pytest.approx([0, 5, 10, 15, 20, 12, 8])
    assert (tmp_path / "wale.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_answers_what_a_file_leaves_open(path, tmp_path, capsys):
    open_ = tmp_path / "open.csv"
    open_.write_text("x;Kraft\n" + "".join(f"{e};{e * e}\n" for e in range(0, 50, 5)))
    assert main([str(open_), "--direction", "wale"]) == 1
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1 and said.err.startswith("knitsim: ")
    answers = ["--column", "strain_percent=1", "--unit", "Kraft=cN", "--state", "width_mm=50"]
    out = tmp_path / "own.csv"
    arguments = [
        str(open_),
        *answers,
        "--direction",
        "wale",
        "--csv",
        str(out),
        "--plot",
        str(tmp_path / "x.svg"),
    ]
    assert main(arguments) == 0
    assert "tension along the wale, 10 points to 45 %" in capsys.readouterr().out
    assert read_measured(out)["force_per_width"][-1] == pytest.approx(45.0**2 / 100 / 0.05)
    assert (tmp_path / "x.svg").exists()


def test_it_runs_from_a_shell(path):
    run = subprocess.run(
        [sys.executable, "-m", "knitsim.measured.report", str(path)], capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert re.match(r"wale: tension, 7 points", run.stdout)


@pytest.mark.parametrize("comma", [False, True])
def test_a_curve_that_is_written_and_saved_by_excel_is_read_again(path, tmp_path, comma):
    test = read_measured(path, direction="wale")
    out = tmp_path / "out.csv"
    test.to_csv(out, comma=comma)
    raw = out.read_bytes()
    assert raw.startswith(b"\xef\xbb\xbf# gauge_length_mm: 100\r\n") == comma
    # Excel under a comma locale: padded, in Windows-1252.
    saved = tmp_path / "saved.csv"
    lines = raw.decode("utf-8-sig").splitlines()
    if comma:
        lines = [line + ";" * (3 - line.count(";")) for line in lines] + [";;;"]
    saved.write_bytes("\r\n".join(lines).encode("cp1252"))
    for file in (out, saved):
        again = read_measured(file, direction="wale")
        for quantity in ("strain", "force_per_width"):
            np.testing.assert_allclose(again[quantity], test[quantity], rtol=1e-8)
        assert again.conditions == pytest.approx(dict(test.conditions))


@pytest.mark.parametrize("kind", ["yarn_tension", "bending"])
def test_every_kind_can_be_written(tmp_path, kind):
    headers = {
        "yarn_tension": "strain,force_cN",
        "bending": "curvature_per_cm,moment_per_width_gf_cm_per_cm",
    }
    factor = {"yarn_tension": (0.01, 30.0), "bending": (0.1, 0.03)}[kind]
    rows = "".join(f"{factor[0] * i},{factor[1] * i}\n" for i in range(10))
    (tmp_path / "in.csv").write_text(f"# linear_density_tex: 30\n{headers[kind]}\n{rows}")
    test = read_measured(tmp_path / "in.csv", kind)
    test.to_csv(tmp_path / "out.csv", comma=True)
    again = read_measured(tmp_path / "out.csv", kind)
    np.testing.assert_allclose(again.x, test.x, rtol=1e-8)
    np.testing.assert_allclose(again.y, test.y, rtol=1e-8)

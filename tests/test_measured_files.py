"""Files as machines and Excel write them: every shape is read as the plain form, or asks one thing.

The shapes are those of exports of Instron, Zwick, MTS and KES and of Excel in several settings; the
numbers are invented.
"""

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.measured.read import read_measured
from knitsim.units import G0

E = np.arange(0.0, 61.0, 5.0)  # mm, of 100
N = 0.025 * E + 19.44 * (E / 60.0) ** 4  # N, of 50 mm
META = "# gauge_length_mm: 100\n# width_mm: 50\n"


def table(header, *columns, sep=",", comma=False, digits=4, end="\n"):
    """Text of a header line and rows of the columns."""
    cells = [[f"{value:.{digits}f}" for value in column] for column in columns]
    if comma:
        cells = [[cell.replace(".", ",") for cell in column] for column in cells]
    rows = [sep.join(row) for row in zip(*cells, strict=True)]
    return end.join([*([header] if header else []), *rows]) + end


@pytest.fixture
def write(tmp_path):
    def write(text, name="wale.csv", encoding="utf-8"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return path

    return write


def quoted(text, sep=","):
    return "\n".join(
        sep.join(f'"{c}"' for c in line.split(sep)) if line else "" for line in text.split("\n")
    )


def grouped(value, thousands, decimal):
    """A number with a sign between thousands."""
    whole, rest = f"{value:.2f}".split(".")
    return f"{int(whole):,}".replace(",", thousands) + decimal + rest


def millinewtons(header, thousands, decimal, sep):
    rows = [f"{e:.1f}".replace(".", decimal) + sep + grouped(1e3 * f, thousands, decimal)
            for e, f in zip(E, N, strict=True)]  # fmt: skip
    return "\n".join([header, *rows]) + "\n"


PLAIN = META + table("extension_mm,force_N", E, N)
TIME = np.arange(len(E)) * 0.5
INSTRON = (
    '"Specimen label","WALE-01"\r\n"Gauge length","100.00","mm"\r\n"Width","50.00","mm"\r\n\r\n'
    '"Time","Extension","Load"\r\n"(s)","(mm)","(N)"\r\n'
    + quoted(table("", TIME, E, N)).replace("\n", "\r\n")
)
ZWICK = (
    '"Prüfling";"3"\r\n"Einspannlänge";100,00;"mm"\r\n"Breite b0";50,0;"mm"\r\n'
    '"Prüfzeit";"Standardweg";"Standardkraft"\r\n"s";"mm";"N"\r\n'
    + table("", TIME, E, N, sep=";", comma=True, end="\r\n")
)
MTS = (
    "MTS TestSuite export\nTest Run Name:\tjersey wale 3\nGage Length\t100\tmm\nWidth\t50\tmm\n\n"
    "Crosshead \tLoad \tTime \nmm\tN\tsec\n" + table("", E, N, TIME, sep="\t")
)
EXCEL = (
    "﻿# wale 3;;;\n# gauge_length_mm: 100;;;\n# width_mm: 50;;;\nextension_mm;force_N;;\n"
    + table("", E, N, sep=";", comma=True).replace("\n", ";;\n") + ";;;\n;;;\n"
)  # fmt: skip
FRENCH = "Longueur initiale;100;mm\nLargeur de l'éprouvette;50;mm\n\n" + millinewtons(
    "Allongement (mm);Charge (mN)", "\u202f", ",", ";"
)
# Each the plain curve: what it shows: (text or bytes, encoding, keywords).
READ = {
    "its own form": (PLAIN, "utf-8", {}),
    "Instron Bluehill, units in a third cell": (INSTRON, "utf-8", {}),
    "Instron, comments and a row of units": (
        META + quoted("Time,Extension,Load\n(s),(mm),(N)\n" + table("", TIME, E, N)), "utf-8", {},
    ),
    "Instron with decimal commas, quoted cells between commas": (
        META + "\n".join(
            ",".join(f'"{c.replace(".", ",")}"' for c in line.split(","))
            for line in table("Time (s),Extension (mm),Load (N)", TIME, E, N).strip().split("\n")
        ), "utf-8", {},
    ),
    "Zwick testXpert, Latin-1": (ZWICK, "latin-1", {}),
    "Zwick, a comment and per cent beside millimetres": (
        "# Prüfling 3, Länge in mm\n" + META
        + table("time_s;extension_mm;force_N;strain (Dehnung)", TIME, E, N, E, sep=";", comma=True),
        "cp1252", {},
    ),
    "Zwick in UTF-16": (ZWICK, "utf-16", {}),
    "Unicode text of Excel without its mark": (
        META + table("Extension (mm)\tForce (N)", E, N, sep="\t"), "utf-16-le", {},
    ),
    "MTS TestSuite, tabs": (MTS, "utf-8", {}),
    "saved by Excel under a comma locale": (EXCEL, "utf-8", {}),
    "Excel's line for the delimiter": (
        "sep=;\n" + META + table("extension_mm;force_N", E, N, sep=";", comma=True), "utf-8", {},
    ),
    "French, narrow blanks between thousands": (FRENCH, "utf-8", {}),
    "points between thousands": (
        META + millinewtons("extension_mm;force_mN", ".", ",", ";"), "utf-8", {},
    ),
    "commas between thousands": (
        META + millinewtons("extension_mm\tforce_mN", ",", ".", "\t"),
        "utf-8", {},
    ),
    "Swiss thousands": (META + millinewtons("extension_mm;force_mN", "'", ".", ";"), "utf-8", {}),
    "blanks between columns": (
        META + "Extension (mm)     Force (N)\n"
        + "".join(f"{e:10.3f}   {f:12.5f}\n" for e, f in zip(E, N, strict=True)), "utf-8", {},
    ),
    "header cells of two lines": (
        META + '"Extension\n(mm)","Load\n(N)"\n' + table("", E, N),
        "utf-8", {},
    ),
    "per cent in every cell": (
        "# width_mm: 50\nDehnung;Kraft (N)\n"
        + "".join(f"{e:.2f}%;{f:.4f}\n" for e, f in zip(E, N, strict=True)), "utf-8", {},
    ),
    "comments behind other signs": (
        "% gauge_length_mm: 100\n// width_mm: 50 (cut by hand)\n" + table("Disp. (mm),Load (N)", E, N),
        "utf-8", {},
    ),
    "a table of results before the data": (
        "Results Table 1\n,Specimen label,Maximum Load (N),Strain at Maximum Load (%)\n1,W-1,20.94,60.0\n"
        "2,W-2,21.10,61.0\n3,W-3,21.10,61.0\nMean,,21.05,60.7\n\nGauge length,100,mm\nWidth,50,mm\nRaw Data\n"
        "Time,Extension,Load\n(s),(mm),(N)\n" + table("", TIME, E, N), "utf-8", {},
    ),
    "a pull that counts as negative": (
        META + table("extension_mm,force_N", E, -N), "utf-8", {"unit": {"force": "-N"}},
    ),
    "units behind in": (META + table("Weg in mm;Kraft in N", E, N, sep=";"), "utf-8", {}),
    "units behind a slash": (META + table("Weg / mm;Kraft F / N", E, N, sep=";"), "utf-8", {}),
    "units behind a comma": (META + table("Extension, mm;Load, N", E, N, sep=";"), "utf-8", {}),
    "capitals": (META + table("EXTENSION [MM],LOAD [KN]", E, 1e-3 * N, digits=7), "utf-8", {}),
    "columns that begin like known ones": (
        META + table("Time (s),Extension (mm),Force (N),Strain rate (1/s),Force rate (N/s)", TIME, E, N,
                     TIME, TIME), "utf-8", {},
    ),
    "other order, words between": (
        META + "Load (N),state,Extension (mm)\n"
        + "".join(f"{f:.4f},ok,{e:.2f}\n" for e, f in zip(E, N, strict=True)), "utf-8", {},
    ),
    "mean and deviation below": (PLAIN + "\nMean,12.3\nS.D.,0.4\n", "utf-8", {}),
    "mean named in a column that is not used": (
        META + table("Time (s);Weg (mm);Kraft (N)", TIME, E, N, sep=";") + "Mittelwert;30;5.5\n", "utf-8", {},
    ),
    "a last row that was cut off": (PLAIN + "61.0000,\n", "utf-8", {}),
    "gauge length below the data": (
        "# width_mm: 50\n" + table("extension_mm,force_N", E, N) + "# gauge_length_mm: 100\n", "utf-8", {},
    ),
    "gauge length in one cell": (
        "Gauge length: 100 mm;;\nSpecimen width = 5,0 cm;;\n" + table("Weg (mm);Kraft (N);", E, N, sep=";"),
        "utf-8", {},
    ),
    "lengths in inches": (
        "# gauge_length_in: 3.93700787\n# width_in: 1.96850394\n"
        + table("Extension (in),Force (lbf)", E / 25.4, N / 4.4482216152605, digits=7), "utf-8", {},
    ),
    "header in a comment": (META + "# extension_mm,force_N\n" + table("", E, N), "utf-8", {}),
    "a strip test in N/5cm": (table("Dehnung [%];Kraft [N/5cm]", E, N, sep=";"), "utf-8", {}),
    "strain as a fraction": ("# width_mm: 50\n" + table("strain,force_N", E / 100, N), "utf-8", {}),
    "a typographic minus": (PLAIN.replace("0.0000,0.0000", "−0.0100,0.0000"), "utf-8", {}),
    "rows twice": (
        META + table("extension_mm,force_N", np.repeat(E, 2), np.repeat(N, 2)),
        "utf-8", {},
    ),
    "no header, columns by number": (table("", E, N), "utf-8", {
        "columns": {"extension_mm": 1, "force_N": 2}, "gauge_length_mm": 100, "width_mm": 50,
    }),
    "columns by heading": (table("Kanal A,Kanal B", N, E), "utf-8", {
        "columns": {"extension_mm": "Kanal B", "force_N": "Kanal A"}, "gauge_length": 0.1, "width": 0.05,
    }),
    "columns whose headings have the unit": (
        META + table("Kanal A (N),Kanal B (cm)", N, 0.1 * E), "utf-8",
        {"columns": {"extension": "Kanal B (cm)", "force": 1}},
    ),
    "units stated": (
        META + table("Weg,Kraft", E, 100 * N), "utf-8", {"unit": {"extension": "mm",
        "Kraft": "cN"}},
    ),
    "lines passed over": ("1,2\n3,4\n5,6\n" + PLAIN, "utf-8", {"skip": 3}),
    "one line passed over": (
        PLAIN.replace("30.0000,", "oops,30.0000,\n30.0000,"),
        "utf-8", {"skip": [10]},
    ),
    "a force in two units": (
        META + table("Extension (mm),Load (N),Load (kN)", E, N, 1e-3 * N, digits=7), "utf-8", {},
    ),
    "an extension that is not zeroed": (
        META + table("Position (mm),Load (N)", E + 152.3, N), "utf-8", {"slack": "start"},
    ),
    "strain and extension that agree": (
        META + table("Extension (mm),Strain (%),Load (N)", E, E + 0.001, N), "utf-8", {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("shape", READ)
def test_every_shape_is_read_as_the_plain_form(write, shape):
    text, encoding, keywords = READ[shape]
    test = read_measured(write(text, encoding=encoding), direction="wale", **keywords)
    strain, force = E / 100.0, N / 0.05
    if shape == "rows twice":
        strain, force = np.repeat(strain, 2), np.repeat(force, 2)
    assert (test.kind, test.direction, test.name) == ("tension", "wale", "wale")
    np.testing.assert_allclose(test["strain"], strain, atol=1.01e-4)
    np.testing.assert_allclose(test["force_per_width"], force, atol=2e-3)
    assert len(test.corrections) == ("slack" in keywords) and test.specimens == ()
    assert test.recognised and all("\n" not in line for line in test.recognised)


def test_what_is_left_out_and_not_used_is_said(write):
    summary = read_measured(write(PLAIN + "\nMean,12.3\nS.D.,0.4\n"), direction="wale")
    assert summary.left_out == ((18, 18, "below the data: Mean"), (19, 19, "below the data: S.D."))
    cut = read_measured(write(PLAIN + "61.0000,\n"), direction="wale")
    assert cut.left_out == ((17, 17, "incomplete"),)
    more = read_measured(write(READ["columns that begin like known ones"][0]), direction="wale")
    assert "columns not used: Time (s), Strain rate (1/s), Force rate (N/s)" in more.recognised
    text, encoding, _ = READ["Zwick, a comment and per cent beside millimetres"]
    both = read_measured(write(text, encoding=encoding), direction="wale")
    assert "'strain (Dehnung)' is the same in per cent and is not used" in both.recognised
    assert any("Windows-1252, cells between ';', decimal comma" in line for line in both.recognised)
    assert both.comments == ("Prüfling 3, Länge in mm",)


def test_a_lateral_strain_may_have_blank_cells(write):
    cells = [f"{-0.3 * e:.2f}" if i % 2 == 0 else "" for i, e in enumerate(E)]
    rows = "".join(f"{e:.3f},{f:.4f},{c}\n" for e, f, c in zip(E, N, cells, strict=True))
    test = read_measured(
        write(META + "extension_mm,force_N,lateral_strain_percent\n" + rows), direction="wale"
    )
    np.testing.assert_allclose(test["lateral_strain"][::2], -0.003 * E[::2], atol=1e-4)
    assert np.isnan(test["lateral_strain"][1::2]).all()


@pytest.mark.parametrize("text", [False, True])
def test_a_workbook_is_read_as_text_is(tmp_path, text):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.title = "Parameter"
    book.active.append(["Prüfer", "A. B."])
    sheet = book.create_sheet("Werte")
    for row in (
        ["Einspannlänge", 100, "mm"],
        ["Breite", 50.0, "mm"],
        [],
        ["Weg", "Kraft", "Bemerkung"],
        ["mm", "N"],
    ):
        sheet.append(row)
    for e, f in zip(E, N, strict=True):
        sheet.append(
            [f"{e:.1f}".replace(".", ","), f"{f:.5f}".replace(".", ",")]
            if text
            else [float(e), float(f)]
        )
    path = tmp_path / "export.xlsx"
    book.save(path)
    test = read_measured(path, direction="course")
    np.testing.assert_allclose(test["force_per_width"], N / 0.05, atol=1e-3)
    assert "sheet 'Werte' of a workbook" in test.recognised[0]
    with pytest.raises(InputError, match="sheet = 'Data': is no sheet"):
        read_measured(path, direction="course", sheet="Data")


def test_per_cent_of_a_workbook_are_what_is_shown(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["Breite", 50, "mm"], ["Dehnung", "Kraft (N)"], *zip(E / 100.0, N, strict=True)):
        book.active.append([float(v) if not isinstance(v, str) else v for v in row])
    for row in range(3, 3 + len(E)):
        book.active.cell(row, 1).number_format = "0.0%"
    book.save(tmp_path / "wale.xlsx")
    test = read_measured(tmp_path / "wale.xlsx", direction="wale")
    np.testing.assert_allclose(test["strain"], E / 100.0, rtol=1e-12)


# ---- yarns ----

STRAIN = np.linspace(0.0, 0.07, 15)
PULL = np.interp(STRAIN, [0.0, 0.02, 0.07], [0.0, 0.9, 5.5])  # N
YARN_READ = {
    "lbf and inch": (
        "# gauge_length_in: 20\n",
        "Extension (in),Force (lbf)", 20.0, 1 / 4.4482216152605,
    ),
    "kN": ("# gauge_length_mm: 500\n", "Extension (mm),Force (kN)", 500.0, 1e-3),
    "gram": ("# gauge_length_mm: 500\n", "Elongation (%),Force (g)", 100.0, 1e3 / G0),
    "gauge length with a decimal comma": (
        "# gauge_length_mm: 500,0\n",
        "extension_mm,force_N", 500.0, 1.0,
    ),
    "cN/tex": ("# linear_density_tex: 33.333\n", "strain,tenacity_cN_per_tex", 1.0, 100 / 33.333),
    "cN/dtex": ("Feinheit,333.33,dtex\n", "Dehnung (%),Kraft (cN/dtex)", 100.0, 100 / 333.33),
    "gf/den": ("# count_den: 299.997\n", "strain,tenacity_gf/den", 1.0, 1e3 / G0 / 299.997),
    "N/tex and a count in Ne": (
        "Yarn count,Ne 17.7163,\n",
        "Strain [%],Tenacity [N/tex]", 100.0, 1 / 33.33,
    ),
    "Nm": ("Yarn count (Nm),30.0\n", "Strain [%],Tenacity [mN/tex]", 100.0, 1e3 / 33.333),
}  # fmt: skip


@pytest.mark.parametrize("unit", YARN_READ)
def test_every_unit_of_the_trade_gives_the_same_yarn(write, unit):
    meta, header, x, y = YARN_READ[unit]
    test = read_measured(
        write(meta + table(header, x * STRAIN, y * PULL, digits=8)), "yarn_tension"
    )
    np.testing.assert_allclose(test["strain"], STRAIN, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(test["force"], PULL, rtol=1e-4)
    assert (test.kind, test.direction, test.broke_below) == ("yarn_tension", "", np.inf)


def test_what_is_stated_comes_before_the_file(write):
    text = "# gauge_length_mm: 500\n# count_Ne: 10\n" + table(
        "extension_mm,tenacity_cN_per_tex", STRAIN * 250, PULL, digits=8
    )
    stated = read_measured(write(text), "yarn_tension", gauge_length=0.25, linear_density=50e-6)
    np.testing.assert_allclose(stated["strain"], STRAIN, atol=1e-9)
    np.testing.assert_allclose(stated["force"], PULL * 0.5, atol=1e-7)
    own = read_measured(write(text), "yarn_tension")
    # Ne 10 is 590.54 / 10 tex.
    np.testing.assert_allclose(own["force"], PULL * 0.590541, rtol=1e-5)
    with pytest.raises(InputError, match="gauge_length_furlong = 1: is not known"):
        read_measured(write(text), "yarn_tension", gauge_length_furlong=1)


# ---- bending ----

UP = np.arange(0.0, 2.51, 0.25)
LOOP = np.concatenate([UP, UP[-2::-1], -UP[1:], -UP[-2::-1]])
WAY = np.concatenate([np.ones(11), -np.ones(20), np.ones(10)])
MOMENT = 0.03 * LOOP + 0.01 * WAY  # gf cm/cm
BENT = {
    "brackets": ("K [cm-1],M [gf*cm/cm]", 1.0, 1.0),
    "words": ("curvature (1/cm),moment per width (gf.cm/cm)", 1.0, 1.0),
    "mixed": ("curvature (cm-1),moment_per_width_gf_cm_per_cm", 1.0, 1.0),
    "superscript": ("Krümmung [cm⁻¹],Biegemoment [gf·cm/cm]", 1.0, 1.0),
    "SI": ("curvature_per_m,moment_per_width_N_m_per_m", 100.0, 1e-3 * G0),
    "micro": ("Courbure (1/mm),Moment (µN m/m)", 0.1, 1e3 * G0),
    "centinewton": ("curvature (1/cm),Bending moment (cN cm/cm)", 1.0, 0.1 * G0),
    "of the whole specimen": ("curvature (1/cm),Moment (gf cm)", 1.0, 20.0),
}


@pytest.mark.parametrize("unit", BENT)
def test_every_heading_of_bending_gives_the_same_loop(write, unit):
    header, x, y = BENT[unit]
    meta = "Sample width,20,cm\n" if "whole" in unit else ""
    text = meta + table(header, x * LOOP, y * MOMENT, digits=8)
    test = read_measured(write(text), direction="course")
    assert (test.kind, test.cycle, test.cycles) == ("bending", 1, ())
    np.testing.assert_allclose(test["curvature"], 100.0 * LOOP, atol=1e-4)
    np.testing.assert_allclose(test["moment_per_width"], 1e-3 * G0 * MOMENT, rtol=1e-6, atol=6e-9)


def test_crossed_yarns_are_recognised_by_their_thickness(write):
    text = table(
        "Dicke (mm);Kraft (cN)", [0.5, 0.45, 0.4, 0.35], [0.0, 1.0, 4.0, 11.0], sep=";", comma=True
    )
    test = read_measured(write(text))
    assert test.kind == "yarn_compression"
    np.testing.assert_allclose(test["thickness"], [5e-4, 4.5e-4, 4e-4, 3.5e-4])
    np.testing.assert_allclose(test["force"], [0.0, 0.01, 0.04, 0.11])


# ---- several specimens ----

SIDE = {
    "the same names": "extension_mm,force_N,extension_mm,force_N",
    "numbered": "Extension 1 (mm),Load 1 (N),Extension 2 (mm),Load 2 (N)",
    "as pandas numbers them": "extension_mm,force_N,extension_mm.1,force_N.1",
}


@pytest.mark.parametrize("names", SIDE)
def test_specimens_side_by_side_make_a_mean_with_its_spread(write, names):
    cells = [[f"{v:.5f}" for v in column] for column in (E, N, E[:-2], 1.1 * N[:-2])]
    cells[2] += ["", ""]
    cells[3] += ["", ""]
    text = META + SIDE[names] + "\n" + "\n".join(map(",".join, zip(*cells, strict=True)))
    test = read_measured(write(text), direction="wale")
    check_specimens(test, [(E, N), (E[:-2], 1.1 * N[:-2])])


def check_specimens(test, curves):
    """The specimens are kept; at the forces of the mean each is read, and they are its mean and spread."""
    assert [len(one) for one in test.specimens] == [len(e) for e, _ in curves]
    for one, (e, f) in zip(test.specimens, curves, strict=True):
        np.testing.assert_allclose(one["strain"], e / 100.0, atol=1e-6)
        np.testing.assert_allclose(one["force_per_width"], f / 0.05, atol=1e-3)
    top = min(f.max() for _, f in curves) / 0.05
    assert test["force_per_width"].max() == pytest.approx(top, rel=1e-6)
    strains = np.array([np.interp(test["force_per_width"], f / 0.05, e / 100.0) for e, f in curves])
    # Between points 5 mm apart a chord is read here, a smooth curve there.
    np.testing.assert_allclose(test["strain"], strains.mean(axis=0), atol=0.012)
    low, high = test["strain_low"], test["strain_high"]
    np.testing.assert_allclose(0.5 * (high - low), strains.std(axis=0, ddof=1), atol=0.012)


def test_specimens_one_below_the_other(write):
    part = "extension_mm,force_N\n"
    text = (
        META
        + "Specimen 1\n"
        + part
        + table("", E, N)
        + "\nSpecimen 2\n"
        + part
        + table("", E, 1.2 * N)
    )
    test = read_measured(write(text), direction="wale")
    check_specimens(test, [(E, N), (E, 1.2 * N)])
    text = text.replace("Specimen 2", "Specimen,2")
    check_specimens(read_measured(write(text), direction="wale"), [(E, N), (E, 1.2 * N)])
    column = np.repeat([1.0, 2.0], len(E))
    text = META + table(
        "Specimen,extension_mm,force_N", column, np.tile(E, 2), np.append(N, 1.2 * N)
    )
    check_specimens(read_measured(write(text), direction="wale"), [(E, N), (E, 1.2 * N)])


def test_several_files_are_several_specimens(write):
    first = write(PLAIN, "a.csv")
    second = write(META + table("Weg (mm);Kraft (N)", E, 0.8 * N, sep=";"), "b.csv")
    test = read_measured([first, second], direction="wale", name="jersey")
    check_specimens(test, [(E, N), (E, 0.8 * N)])
    assert (test.name, test.source) == ("jersey", "a.csv, b.csv")
    assert [one.source for one in test.specimens] == ["a.csv", "b.csv"]


def test_sheets_of_a_workbook_are_specimens_if_they_hold_the_same(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for number, part in ((1, 1.0), (2, 0.9)):
        sheet = book.create_sheet(f"Probe {number}")
        sheet.append(["Dehnung (%)", "Kraft (N/5cm)"])
        for e, f in zip(E, part * N, strict=True):
            sheet.append([float(e), float(f)])
    path = tmp_path / "proben.xlsx"
    book.save(path)
    check_specimens(read_measured(path, direction="wale"), [(E, N), (E, 0.9 * N)])
    book["Probe 2"]["B1"] = "Standardkraft (N/5cm)"
    book.save(path)
    with pytest.raises(
        InputError, match="sheets Probe 1, Probe 2: hold different curves: state sheet"
    ):
        read_measured(path, direction="wale")
    assert len(read_measured(path, direction="wale", sheet="Probe 2").specimens) == 0


def test_the_mean_of_yarns_and_of_bent_fabrics(write):
    yarns = [
        write(table("strain,force_N", STRAIN, part * PULL, digits=8), f"{part}.csv")
        for part in (1.0, 1.2)
    ]
    test = read_measured(yarns, "yarn_tension")
    np.testing.assert_allclose(
        test["force"], 1.1 * np.interp(test["strain"], STRAIN, PULL), rtol=0.01
    )
    bent = [
        write(
            table("curvature (1/cm),moment (gf cm/cm)", LOOP, part * MOMENT, digits=8),
            f"b{part}.csv",
        )
        for part in (1.0, 1.5)
    ]
    test = read_measured(bent, direction="wale")
    np.testing.assert_allclose(
        test["moment_per_width"], 1.25e-3 * G0 * MOMENT, rtol=1e-6, atol=1e-12
    )
    with pytest.raises(InputError, match=r"kind = .*must be the same of all specimens"):
        read_measured([bent[0], write(PLAIN)], direction="wale")


# ---- questions ----

ASKED = {
    "no unit": (
        table("Weg;Kraft", E, N, sep=";"), {},
        r"csv:1 = 'Weg': lacks its unit: state unit: \{extension: mm\}",
    ),
    "a unit that is not known": (
        META + table("extension_mm,force (furlong)", E, N), {},
        r"furlong is no unit that is known: state unit",
    ),
    "MN": (META + table("extension_mm,force_MN", E, N), {}, r"csv:3 = .*no column for the force"),
    "stress instead of force": (
        META + table("extension_mm,force (N/mm2)", E, N), {},
        r"'N/mm2' is no unit of",
    ),
    "no gauge length": (
        table("extension_mm,force_N", E, N), {"width": 0.05},
        r"needs a line '# gauge_length_mm: ...'",
    ),
    "no width": (
        table("strain_percent,force_N", E, N), {},
        r"'force_N': needs a line '# width_mm: ...'",
    ),
    "gauge length without unit": ("Gauge length,100\n" + META[22:] + table("extension_mm,force_N", E, N), {},
                                  r"csv:1: gauge_length = '100': lacks its unit"),
    "gauge length of two readings": (
        "# gauge_length_mm: 1,500\n# width_mm: 50\n" + table("extension_mm,force_N", E, N), {},
        r"csv:1: gauge_length = '1,500': may have a decimal sign or one between thousands",
    ),
    "a decimal sign that may be thousands": (
        META + "extension_mm;force_mN\n" + "".join(f"{i};{i},500\n" for i in range(1, 9)), {},
        r"csv:4 = '1,500': may have a decimal sign or one between thousands: state decimal_sign",
    ),
    "decimal commas between commas": (
        META + table("extension_mm,force_N", E, N, comma=True), {},
        r"csv:4 = .*must have the 2 of the header; a decimal comma needs semicolon or tab",
    ),
    "two decimal signs": (
        META + table("extension_mm;force_N", E, N, sep=";").replace("5.0000;", "5,5000;", 1), {},
        r"csv:5 = '5,5000': line 4 has '0.0000': must keep to one decimal sign",
    ),
    "no header": (
        table("", E, N), {},
        r"csv:1 = '0.0000, 0.0000': has no header above it: state columns",
    ),
    "misspelt": (
        META + table("extenion_mm,force_N", E, N), {},
        r"no column for the strain \('extenion_mm' is not known\): .*state columns",
    ),
    "a column that is none": (
        PLAIN, {"columns": {"force_N": "Kraft"}},
        r"columns = 'Kraft': is no column; the headings are",
    ),
    "a column without a unit": (
        table("Kanal A,Kanal B", N, E), {"columns": {"extension": 2, "force_N": 1}},
        r"columns = 'extension': lacks its unit: write it behind the name, such as extension_mm",
    ),
    "a quantity that is none": (
        PLAIN, {"columns": {"kraft": "force_N"}},
        r"columns = 'kraft': must be a quantity with its unit",
    ),
    "a unit that is none": (PLAIN, {"unit": {"force": "gff"}}, r"unit.force = 'gff': is no unit"),
    "two extensions": (
        META + table("Extension (mm),Crosshead (mm),Load (N)", E, 1.3 * E, N), {},
        r"'Extension \(mm\)' and 'Crosshead \(mm\)': only one .* strain, and these differ: state columns",
    ),
    "strain and extension that do not agree": (
        META + table("Extension (mm),Strain (%),Load (N)", E, 0.5 * E, N), {},
        r"only one column may give the strain",
    ),
    "a number that is a word": (
        PLAIN.replace("30.0000,", "abc,"), {},
        r"csv:10: extension_mm = 'abc': must be a number",
    ),
    "no number": (
        PLAIN.replace("30.0000,", "NaN,"), {},
        r"csv:10: extension_mm = 'NaN': must be a finite number",
    ),
    "a date that Excel made of a number": (
        PLAIN.replace("30.0000,", "01. Mai,"), {},
        r"csv:10: extension_mm = '01. Mai': must be a number; Excel has made a date of it",
    ),
    "a blank": (PLAIN.replace("30.0000,", ","), {}, r"csv:10: extension_mm = '': must be a number"),
    "words between the rows": (
        PLAIN.replace("30.0000,", "pause\n30.0000,"), {},
        r"csv:10 = 'pause': stands above 7 more rows of numbers: .*state skip: \[10\]",
    ),
    "a mean without a name": (
        PLAIN + "30.1,5.4\n", {}, r"csv:17: extension_mm = 30.1: stands apart .*skip: \[17\]",
    ),
    "a pull that counts as negative": (
        META + table("extension_mm,force_N", E, -N), {}, r"must rise above 0: .* state unit: \{force: -N\}",
    ),
    "broken quotes": (PLAIN.replace("30.0000,", '"30.0000,'), {}, r"csv:10 .*broken quotes"),
    "nothing": ("", {}, r"wale.csv = no data"),
    "comments only": ("# nothing\n", {}, r"wale.csv = no data"),
    "no numbers": (
        "extension_mm,force_N\n", {"gauge_length": 0.1, "width": 0.05},
        r"csv:1: the curve has 0 points, at least 4",
    ),
    "words only": (
        "the curve\nis lost\n", {},
        r"csv:1 = 'the curve': no lines of two or more numbers",
    ),
    "three points": (
        "strain,force_per_width_N_per_m\n0,0\n0.1,9\n0.2,30\n", {},
        r"csv:4: the curve has 3 points",
    ),
    "an old workbook": (b"\xd0\xcf\x11\xe0rest", {}, r"an old Excel file: must be saved as .xlsx"),
    "a zero byte": (PLAIN.replace("30.0000", "30.0\x00000"), {}, r"csv:10 = a zero byte"),
    "a fabric or a yarn": (
        table("strain,force_N", E / 100, N), {"direction": ""},
        r"may be of a fabric or of a yarn",
    ),
    "a decimal sign that is none": (
        "# decimal_sign: dot\n" + PLAIN, {},
        r"csv:1: decimal_sign = dot",
    ),
    "gauge length twice": (
        "# gauge_length_mm: 5\n" + PLAIN, {},
        r"csv:2 .*gives the gauge_length again",
    ),
    "gauge length of no length": (
        PLAIN.replace(": 100", ": 0"), {},
        r"csv:1: gauge_length = 0: must be above 0",
    ),
    "gauge length in words": (
        PLAIN.replace(": 100", ": long"), {},
        r"csv:1: gauge_length = 'long': must be a number",
    ),
    "half a band": (PLAIN.replace("force_N", "strain_low"), {}, r"no column for the force"),
    "another kind": (PLAIN, {"kind": "torsion"}, r"kind = torsion: must be tension or bending"),
    "another zero": (PLAIN, {"zero": "off"}, r"zero = off: must be keep or start or tail"),
}  # fmt: skip


@pytest.mark.parametrize("question", ASKED)
def test_what_a_file_leaves_open_is_asked_in_one_line(write, question):
    text, keywords, message = ASKED[question]
    with pytest.raises(InputError, match=message) as refused:
        read_measured(write(text), **({"direction": "wale"} | keywords))
    assert "\n" not in str(refused.value)


def test_a_file_that_begins_like_a_workbook_and_is_none_is_refused(write):
    pytest.importorskip("openpyxl")
    with pytest.raises(InputError, match=r"a workbook: cannot be read as .xlsx") as refused:
        read_measured(write(b"PK\x03\x04rest"), direction="wale")
    assert "\n" not in str(refused.value)


def test_answers_that_are_named_settle_the_question(write):
    either = META + "extension_mm;force_mN\n" + "".join(f"{i};{i},500\n" for i in range(1, 9))
    comma = read_measured(
        write(either), direction="wale", decimal_sign="comma", zero="keep", unit={"force": "N"}
    )
    assert comma["force_per_width"][0] == pytest.approx(1.5 / 0.05)
    point = read_measured(write(either), direction="wale", decimal_sign="point", zero="keep")
    assert point["force_per_width"][0] == pytest.approx(1.5 / 0.05)
    twice = META + table("Extension (mm),Crosshead (mm),Load (N)", E, 1.3 * E, N)
    one = read_measured(write(twice), direction="wale", columns={"extension_mm": "Crosshead (mm)"})
    np.testing.assert_allclose(one["strain"], 0.013 * E, atol=1e-6)


def test_a_missing_file_and_wrong_arguments(write, tmp_path):
    with pytest.raises(InputError, match=r"nowhere.csv: cannot be read"):
        read_measured(tmp_path / "nowhere.csv")
    for wrong in (0.0, -0.5, np.nan, np.inf):
        with pytest.raises(InputError, match=r"gauge_length = .*finite and above 0"):
            read_measured(write(PLAIN), direction="wale", gauge_length=wrong)
    with pytest.raises(InputError, match="one or more"):
        read_measured([])

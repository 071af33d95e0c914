"""Curves from CSV: every accepted spelling gives the same SI numbers, every fault its line."""

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.measured.yarn_curve import COLUMNS, read_curve, read_yarn_curve
from knitsim.units import G0

STRAIN = np.array([0.0, 0.004, 0.008, 0.012, 0.016, 0.02, 0.024, 0.028])
FORCE = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.25, 2.5, 2.75])  # N


@pytest.fixture
def write(tmp_path):
    def write_file(text, encoding="utf-8"):
        path = tmp_path / "curve.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return path

    return write_file


def table(header, x, y, delimiter=",", decimal=".", end="\n"):
    rows = [f"{a:.9g}{delimiter}{b:.9g}" for a, b in zip(x, y, strict=True)]
    if decimal == ",":
        rows = [row.replace(".", ",") for row in rows]
    return end.join([header, *rows]) + end


STRAIN_FORCE = {
    "strain,force_N": (1, 1),
    "strain_percent,force_cN": (100, 100),
    "Strain [%],Force [gf]": (100, 1000 / G0),
    "Strain (%),force_mN": (100, 1000),
    '"strain_percent" , "force_N"': (100, 1),
    "extension_mm,force_N": (500, 1),
    "extension_um,force_N": (5e5, 1),
    "Extension (m),force_N": (0.5, 1),
    # 333.33 dtex are 33.333 tex and 299.997 den.
    "strain,tenacity_cN_per_dtex": (1, 100 / 333.33),
    "strain,tenacity_cN/dtex": (1, 100 / 333.33),
    "strain,Tenacity [cN/tex]": (1, 100 / 33.333),
    "strain,tenacity_gf_per_den": (1, 1000 / G0 / 299.997),
}


@pytest.mark.parametrize("header", STRAIN_FORCE)
def test_every_unit_of_strain_and_force_gives_the_same_curve(write, header):
    x, y = STRAIN_FORCE[header]
    meta = "# gauge_length_mm: 500\n# linear_density_dtex: 333.33\n"
    curve = read_yarn_curve(write(meta + table(header, STRAIN * x, FORCE * y)))
    np.testing.assert_allclose(curve["strain"], STRAIN, rtol=1e-8)
    np.testing.assert_allclose(curve["force"], FORCE, rtol=1e-8)
    assert curve.metadata["gauge_length"] == pytest.approx(0.5)
    assert curve.metadata["linear_density"] == pytest.approx(333.33e-7)
    assert curve.lines.tolist() == list(range(4, 12))
    assert (curve.source, len(curve)) == ("curve.csv", 8)


@pytest.mark.parametrize("delimiter", [";", "\t", ","])
@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_delimiter_decimal_sign_line_end_and_byte_order_mark(write, delimiter, decimal, end, mark):
    header = f"strain_percent{delimiter}force_N"
    text = table(header, 100 * STRAIN, FORCE, delimiter, decimal, end)
    path = write(mark + text.encode())
    if delimiter == decimal:
        with pytest.raises(InputError, match=r"curve.csv:[34].*semicolon or tab"):
            read_yarn_curve(path)
        return
    curve = read_yarn_curve(path)
    np.testing.assert_allclose(curve["strain"], STRAIN, rtol=1e-12)
    np.testing.assert_array_equal(curve["force"], FORCE)


def test_comments_blank_lines_and_other_columns_are_passed_over(write):
    rows = table("time_s;Strain;force_N;", STRAIN, FORCE, ";").splitlines()
    rows[1:] = [f"{i},5;{row};ok" for i, row in enumerate(rows[1:])]
    rows[0] += "remark;;"
    text = "# bobbin 3: the blue one\n\n" + "\n ;;\n".join(rows) + "\n#end\n\n"
    curve = read_yarn_curve(write(text.replace(".", ",")))
    np.testing.assert_array_equal(curve["force"], FORCE)
    assert curve.ignored == ("time_s", "remark")
    assert curve.comments == ("bobbin 3: the blue one", "end")
    assert not curve["force"].flags.writeable


def test_arguments_override_the_comments_of_the_file(write):
    text = "# gauge_length_mm: 500\n# count_Ne: 10\n" + table(
        "extension_mm,tenacity_cN_per_tex", STRAIN * 250, FORCE
    )
    curve = read_yarn_curve(write(text), gauge_length=0.25, linear_density=50e-6)
    np.testing.assert_allclose(curve["strain"], STRAIN, rtol=1e-8)
    np.testing.assert_allclose(curve["force"], FORCE * 0.5, rtol=1e-8)
    from_file = read_yarn_curve(write(text))
    np.testing.assert_allclose(from_file["strain"], STRAIN / 2, rtol=1e-8)
    # Ne 10 is 590.54 / 10 tex.
    np.testing.assert_allclose(from_file["force"], FORCE * 0.590541, rtol=1e-5)


def test_metadata_may_have_the_decimal_comma_of_the_file(write):
    text = "# gauge_length_mm: 250,5\n" + table("extension_mm;force_N", STRAIN, FORCE, ";", ",")
    assert read_yarn_curve(write(text)).metadata["gauge_length"] == pytest.approx(0.2505)


def test_fabric_curves_in_units_of_kes(write):
    text = "curvature [1/cm],moment_per_width_gf_cm_per_cm\n" + "-0.5,-0.02\n0,0.003\n0.5,0.02\n"
    text += "0,-0.003\n"
    curve = read_curve(write(text), ("curvature", "moment_per_width"), least_points=4)
    np.testing.assert_allclose(curve["curvature"], [-50, 0, 50, 0], rtol=1e-15)
    np.testing.assert_allclose(
        curve["moment_per_width"], np.array([-0.02, 0.003, 0.02, -0.003]) * 1e-3 * G0, rtol=1e-14
    )
    text = "strain_percent,lateral_strain_percent,force_per_width_gf/cm\n0,0,0\n5,-2,50\n2,-1,5\n"
    curve = read_curve(write(text), ("strain", "force_per_width", "lateral_strain"))
    np.testing.assert_allclose(curve["force_per_width"], np.array([0, 50, 5]) * G0 / 10)
    np.testing.assert_allclose(curve["lateral_strain"], [0, -0.02, -0.01])


def test_every_header_of_the_table_has_a_unit_that_is_known(write):
    for quantity, ends in COLUMNS.items():
        other = "curvature_per_m" if quantity != "curvature" else "force_N"
        for end in ends:
            header = f"{quantity}_{end}" if end else quantity
            asked = {"extension": "strain", "tenacity": "force"}.get(quantity, quantity)
            text = f"{header},{other}\n1,1\n2,2\n"
            curve = read_curve(write(text), (asked,), gauge_length=0.1, linear_density=1e-5)
            assert curve[asked][1] == pytest.approx(2 * curve[asked][0])
            assert curve[asked][0] > 0


def test_thousands_separators_are_not_taken_for_decimal_commas(write):
    rows = "".join(f"{i};{i},500\n" for i in range(1, 9))
    with pytest.raises(InputError, match=r"csv:2 = '1,500': may have a decimal comma or"):
        read_yarn_curve(write("strain;force_cN\n" + rows))
    stated = "# decimal_sign: comma\nstrain;force_cN\n" + rows
    assert read_yarn_curve(write(stated))["force"][0] == pytest.approx(0.015)
    # One number that can only have a decimal comma settles it.
    settled = read_yarn_curve(write("strain;force_cN\n0;0,125\n" + rows))
    assert settled["force"][1] == pytest.approx(0.015)
    with pytest.raises(InputError, match=r"csv:9 = '8.000,5': thousands separators are not read"):
        read_yarn_curve(write("strain;force_cN\n" + rows.replace("8,500", "8.000,5")))


GOOD = table("strain,force_N", STRAIN, FORCE)
FAULTS = {
    "empty file": ("", "no data"),
    "only comments": ("# nothing\n", "no data"),
    "no rows": ("strain,force_N\n", "csv:1: the curve has 0 points, at least 8"),
    "three points": (
        "strain,force_N\n0,0\n0.1,1\n0.2,2\n",
        "csv:4: the curve has 3 points, at least 8",
    ),
    "no header": (GOOD.split("\n", 1)[1], "csv:1 = .*no column for the strain"),
    "one column": ("strain\n1\n2\n", "csv:1 = 'strain'.*two or more column"),
    "two delimiters": ("strain,x;force_N\n", "';' and ',' in the header"),
    "unit missing": (
        GOOD.replace("force_N", "force"),
        "csv:1 = 'force': lacks its unit: .*force_cN",
    ),
    "unit unknown": (GOOD.replace("force_N", "force_lbf"), "'force_lbf': has an unknown unit"),
    "unit in wrong case": (GOOD.replace("force_N", "force_MN"), "'force_MN': has an unknown unit"),
    "extension without unit": (GOOD.replace("strain", "extension"), "'extension': lacks its unit"),
    "misspelt": (GOOD.replace("strain", "strian"), "'strian' is not known.*must be strain"),
    "strain twice": (
        "strain,strain_percent,force_N\n0,0,0\n",
        "'strain' and 'strain_percent': only one column may give the strain",
    ),
    "force and tenacity": (
        "strain,force_N,tenacity_cN/dtex\n0,0,0\n",
        "only one column may give the force",
    ),
    "no gauge length": (
        GOOD.replace("strain", "extension_mm"),
        "csv:1 = 'extension_mm'.*# gauge_length_mm",
    ),
    "no count": (
        GOOD.replace("force_N", "tenacity_cN/dtex"),
        "csv:1 = 'tenacity_cN/dtex'.*linear_density",
    ),
    "word": (GOOD.replace("0.012", "abc"), "csv:5: strain = 'abc': must be a number"),
    "empty field": (GOOD.replace("0.012", ""), "csv:5: strain = '': must be a number"),
    "underscore": (GOOD.replace("0.012", "0.0_12"), "csv:5: strain = '0.0_12': must be a number"),
    "nan": (GOOD.replace("0.012", "NaN"), "csv:5: strain = 'NaN': must be a finite"),
    "inf": (GOOD.replace("2.25", "-inf"), "csv:7: force_N = '-inf': must be a finite"),
    "overflow": (GOOD.replace("2.25", "1e999"), "csv:7: force_N = '1e999': must be a finite"),
    "falling strain": (GOOD.replace("0.012", "0.007"), "csv:5: strain = 0.007: must not fall"),
    "negative strain": (GOOD.replace("0,0\n", "-0.001,0\n"), "csv:2: strain = -0.001"),
    "negative force": (GOOD.replace("0.004,0.5", "0.004,-0.5"), "csv:3: force_N = -0.5"),
    "no force": (table("strain,force_N", STRAIN, 0 * FORCE), "force = 0 N at most: must rise"),
    "field too many": (GOOD.replace("0.012,", "0.012,1,"), "csv:5.*has 3 fields, must have the 2"),
    "field missing": (GOOD.replace("0.012,", ""), "csv:5 = '1.5': has 1 fields"),
    "mixed decimal signs": (
        table("strain;force_N", STRAIN, FORCE, ";").replace("2.25", "2,25"),
        "csv:7 = '2,25': line 3 has '0.004': must keep to one decimal sign",
    ),
    "broken quotes": (GOOD.replace("0.012", '"0.012'), "csv:5 .*broken quotes"),
    "gauge length in unknown unit": ("# gauge_length_cm: 50\n" + GOOD, "csv:1 = 'gauge_length_cm'"),
    "negative gauge length": ("# gauge_length_mm: -5\n" + GOOD, "csv:1: gauge_length = -5"),
    "gauge length no number": ("# gauge_length_mm: long\n" + GOOD, "csv:1: gauge_length = 'long'"),
    "gauge length twice": (
        "# gauge_length_mm: 5\n# gauge_length_m: 5\n" + GOOD,
        "csv:2 .*gives the gauge_length again",
    ),
    "decimal sign unknown": ("# decimal_sign: dot\n" + GOOD, "csv:1: decimal_sign = dot"),
    "not UTF-8": (GOOD.encode() + b"# 20 \xb0C\n", "csv:10 = byte 0xb0: must be UTF-8"),
    "not UTF-8 behind a mark": (
        b"\xef\xbb\xbf" + GOOD.encode() + b"# \xb0C\n",
        "csv:10 = byte 0xb0: must be UTF-8",
    ),
    "UTF-16": (GOOD.encode("utf-16"), "csv:1 = UTF-16"),
    "zero byte": (GOOD.replace("0.012", "0.0\x0012"), "csv:5 = a zero byte"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_refused_with_its_line(write, fault):
    text, message = FAULTS[fault]
    with pytest.raises(InputError, match=message) as refusal:
        read_yarn_curve(write(text))
    assert "\n" not in str(refusal.value)
    assert "curve.csv" in str(refusal.value)


def test_a_missing_file_and_wrong_arguments(write, tmp_path):
    with pytest.raises(InputError, match=r"nowhere.csv: cannot be read"):
        read_yarn_curve(tmp_path / "nowhere.csv")
    for wrong in (0.0, -0.5, np.nan, np.inf):
        with pytest.raises(InputError, match=r"gauge_length = .*finite and above 0"):
            read_yarn_curve(write(GOOD), gauge_length=wrong)


def test_small_negative_forces_are_noise(write):
    curve = read_yarn_curve(write(GOOD.replace("0,0\n", "0,-0.02\n")))
    assert curve["force"][0] == -0.02

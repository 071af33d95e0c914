"""Tables in Excel where the comma is the decimal sign: written for it, saved by it, read again."""

import pandas as pd
import pytest

from knitsim.store.table import read_table, write_for_excel
from knitsim.store.timing import write_csv

COLUMNS = ("fabric", "name", "value", "units", "says")
ROWS = [
    ("jersey", "B", "1.25e-05", "N m", "agrees well: 7 % rms, too soft; see Fig. 3"),
    ("jersey", "version 0.1.0", 1500, "1", 'called "slack"'),
    ("jersey, slack", "2HB", "", "", "not reached"),
    ("jersey", "EMT", -12.5, "%", "Länge in mm"),
]


@pytest.fixture
def plain(tmp_path):
    write_csv(tmp_path / "kes.csv", COLUMNS, ROWS)
    return tmp_path / "kes.csv"


def test_a_table_is_read_as_it_was_written(plain):
    pd.testing.assert_frame_equal(read_table(plain), pd.read_csv(plain))


def test_the_second_file_opens_with_decimal_commas(plain, tmp_path):
    write_for_excel(plain, tmp_path / "excel/kes.csv")
    raw = (tmp_path / "excel/kes.csv").read_bytes()
    assert raw.startswith(b"\xef\xbb\xbffabric;name;value;units;says\r\n")
    lines = raw.decode("utf-8-sig").split("\r\n")
    assert lines[1] == 'jersey;B;1,25e-05;N m;"agrees well: 7 % rms, too soft; see Fig. 3"'
    assert lines[2].startswith("jersey;version 0.1.0;1500;")
    assert lines[4].startswith("jersey;EMT;-12,5;")
    pd.testing.assert_frame_equal(read_table(tmp_path / "excel/kes.csv"), pd.read_csv(plain))


def test_what_excel_saves_again_is_read_again(plain, tmp_path):
    write_for_excel(plain, tmp_path / "excel.csv")
    text = (tmp_path / "excel.csv").read_text("utf-8-sig")
    # Windows-1252, its own form of the exponent, an empty column and empty rows.
    rows = [line + ";" for line in text.replace("1,25e-05", "1,25E-05").split("\n") if line]
    (tmp_path / "saved.csv").write_bytes("\r\n".join([*rows, ";;;;;", ""]).encode("cp1252"))
    pd.testing.assert_frame_equal(read_table(tmp_path / "saved.csv"), pd.read_csv(plain))

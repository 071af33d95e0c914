"""The tables of the result store as people open and save them: CSV for programs, and for Excel where
the comma is the decimal sign.
"""

import csv
import io
from pathlib import Path

import pandas as pd

from knitsim.files import replacing
from knitsim.store.sheet import NUMERIC, decimal_sign, number_in, read_sheets


def read_table(path):
    """A table as a pandas.DataFrame, as it was written or as Excel has saved it again.

    Encoding, delimiter and decimal sign are found; empty rows and columns that Excel adds are dropped.
    """
    (sheet,) = read_sheets(path, str(path))
    rows = [row for row in sheet.rows if any(row)]
    width = max((i + 1 for i, name in enumerate(rows[0]) if name), default=0) if rows else 0
    cells = [cell for row in rows[1:] for cell in row[:width] if NUMERIC.fullmatch(cell)]
    sign = decimal_sign(cells, lambda i: str(path), sheet.delimiter)
    if sign == ",":
        rows[1:] = [[_with_point(cell) for cell in row] for row in rows[1:]]
    file = io.StringIO()
    csv.writer(file).writerows(row[:width] for row in rows)
    file.seek(0)
    return pd.read_csv(file)


def _with_point(cell):
    number = "," in cell and NUMERIC.fullmatch(cell) and number_in(cell, ",") is not None
    return cell.replace(".", "").replace(",", ".") if number else cell


def write_for_excel(path, out):
    """Write the table at ``path`` once more to ``out``, as Excel opens it where the comma is the decimal
    sign: semicolons, decimal commas and the mark of UTF-8."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    with replacing(out) as partial, partial.open("w", newline="", encoding="utf-8-sig") as file:
        writer = csv.writer(file, delimiter=";", lineterminator="\r\n")
        for row in rows:
            plain = (NUMERIC.fullmatch(cell) and number_in(cell, ".") is not None for cell in row)
            writer.writerow([
                cell.replace(".", ",") if number else cell for cell, number in zip(row, plain, strict=True)
            ])  # fmt: skip

"""Cells of a table as a machine or Excel wrote it, and numbers in them.

Encoding, delimiter and quotes of text are found, workbooks are read; a cell is text without the blanks
around it, or a number where a workbook holds one.  A file has one decimal sign: that which its numbers
allow.  What the cells mean is not decided here.
"""

import csv
import io
import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from knitsim.errors import InputError

DELIMITERS = {"\t": "tab", ";": "';'", ",": "','", "|": "'|'", " ": "blanks"}
SAMPLE = 400  # lines from which the delimiter is judged
LONGEST_CELL = 300  # characters; a quote that is never closed makes longer ones
# A number in any notation: points, commas, blanks or apostrophes between thousands, an exponent.
NUMERIC = re.compile(
    r"[+\-−–]?([1-9]\d{0,2}([ \xa0\u202f'’]\d{3})+([.,]\d*)?|[\d.,]*\d[\d.,]*)([eE][+\-−]?\d+)?"
)
_WORKBOOK, _OLD_WORKBOOK = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"


@dataclass(frozen=True, eq=False)
class Sheet:
    """Rows of cells.  lines: number of each row in the file, from 1; name: of the sheet of a workbook,
    "" for text; how: what was recognised, in words; delimiter: "" for a workbook."""

    name: str
    rows: list
    lines: list
    how: str
    delimiter: str


def read_sheets(path, where):
    """The sheets (list of :class:`Sheet`) of a text file, which is one, or of an .xlsx workbook.

    Raises InputError for a file that cannot be read as either.
    """
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise InputError(where, None, f"cannot be read: {error.strerror}") from None
    if raw.startswith(_OLD_WORKBOOK):
        raise InputError(where, "an old Excel file", "must be saved as .xlsx or CSV")
    if raw.startswith(_WORKBOOK):
        return _workbook(raw, where)
    return [_text_sheet(raw, where)]


def _workbook(raw, where):
    try:
        import openpyxl
    except ImportError:
        raise InputError(
            where, "a workbook", "needs openpyxl: pip install 'knitsim[excel]', or save it as CSV"
        ) from None
    with warnings.catch_warnings():
        # Workbooks of machines lack styles and say so.
        warnings.simplefilter("ignore")
        try:
            book = openpyxl.load_workbook(io.BytesIO(raw), read_only=True, data_only=True)
            sheets = [
                Sheet(
                    sheet.title, [[_cell(cell) for cell in row] for row in sheet.iter_rows()], [],
                    f"sheet {sheet.title!r} of a workbook", "",
                )
                for sheet in book.worksheets
            ]  # fmt: skip
        except Exception as error:  # openpyxl lets through whatever zip and XML raise
            raise InputError(where, "a workbook", f"cannot be read as .xlsx: {error}") from None
    for sheet in sheets:
        sheet.lines.extend(range(1, len(sheet.rows) + 1))
    return sheets


def _cell(cell):
    value = cell.value
    if value is None:
        return ""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        # Shown in per cent it is kept as a fraction.
        return f"{100.0 * value!r}%" if "%" in cell.number_format else float(value)
    return str(value).strip()


def decoded(raw, where):
    """(text, name of the encoding) of bytes: by byte order mark, by the zero bytes of UTF-16, UTF-8,
    or else Windows-1252."""
    marks = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
    name = next((marks[mark] for mark in marks if raw.startswith(mark)), "utf-8")
    if name == "utf-8":
        # Of text in Latin letters every second byte of UTF-16 is zero.
        head = raw[:2000]
        for start, known in ((0, "utf-16-be"), (1, "utf-16-le")):
            half = head[start::2]
            if len(half) > 1 and half.count(0) > 0.7 * len(half):
                name = known
    try:
        text = raw.decode(name)
    except UnicodeDecodeError:
        if name != "utf-8":
            raise InputError(
                where, name, "is marked so at its beginning, but cannot be read so"
            ) from None
        name = "Windows-1252"
        try:
            text = raw.decode("cp1252")
        except UnicodeDecodeError:
            text, name = raw.decode("latin-1"), "Latin-1"
    if "\0" in text:
        line = len(re.split(r"\r\n|\r|\n", text[: text.index("\0")]))
        raise InputError(f"{where}:{line}", "a zero byte", "must be text")
    shown = {"utf-8-sig": "UTF-8 with byte order mark", "utf-8": "UTF-8"}
    return text, shown.get(name, name.upper() if name.startswith("utf") else name)


def _text_sheet(raw, where):
    text, encoding = decoded(raw, where)
    first, _, rest = text.partition("\n")
    stated = re.fullmatch(r'"?sep=(.)"?[;,\t]*\r?', first, re.IGNORECASE)
    skipped = 0
    if stated:
        delimiter, text, skipped = stated[1], rest, 1
    else:
        delimiter = delimiter_of(text)
    rows, lines = _rows(text, delimiter, where, skipped)
    named = DELIMITERS.get(delimiter, repr(delimiter))
    return Sheet("", rows, lines, f"{encoding}, cells between {named}", delimiter)


def _rows(text, delimiter, where, skipped):
    if delimiter == " ":
        lines = re.split(r"\r\n|\r|\n", text)
        return [_blanks(line) for line in lines], list(range(1, len(lines) + 1))
    rows, lines, last = [], [], skipped
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    try:
        for row in reader:
            lines.append(last + 1)
            last = reader.line_num + skipped
            if last > lines[-1] and any(len(cell) > LONGEST_CELL for cell in row):
                raise InputError(f"{where}:{lines[-1]}", _short(row), "broken quotes: never closed")
            rows.append([cell.strip() for cell in row])
    except csv.Error as error:
        raise InputError(f"{where}:{last + 1}", None, f"cannot be read ({error})") from None
    if rows and last > lines[-1] and text.count('"') % 2:
        raise InputError(f"{where}:{lines[-1]}", _short(rows[-1]), "broken quotes: never closed")
    return rows, lines


def _short(row):
    text = " ".join(map(str, row))
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _blanks(line):
    """Cells of a line of columns that blanks set apart; names may have single blanks in them."""
    cells = line.split()
    if line.lstrip().startswith("#") or not all(NUMERIC.fullmatch(cell) for cell in cells):
        wide = re.split(r"\t|\s{2,}", line.strip())
        return wide if len(wide) > 1 or line.lstrip().startswith("#") else cells
    return cells


def delimiter_of(text):
    """The delimiter of a text: that by which most lines become numbers and least cells do not."""
    lines = [
        line for line in re.split(r"\r\n|\r|\n", text, maxsplit=SAMPLE)[:SAMPLE] if line.strip()
    ]
    best, most = ",", 0
    for delimiter in DELIMITERS:
        score = 0
        for line in lines:
            if line.lstrip(' "').startswith("#"):
                continue
            if delimiter == " ":
                cells = _blanks(line)
            else:
                try:
                    cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
                except (csv.Error, StopIteration):
                    continue
            cells = [cell.strip() for cell in cells if cell.strip()]
            # Blanks between thousands go with a decimal comma, which needs another delimiter.
            numbers = sum(
                NUMERIC.fullmatch(cell) is not None and not (delimiter == "," and " " in cell)
                for cell in cells
            )
            # One cell alone says nothing; text between numbers speaks against the delimiter.
            score += max(2 * numbers - len(cells), 0) if numbers > 1 else 0
        if score > most:
            best, most = delimiter, score
    if most:
        return best
    # No numbers: the sign that most lines have.
    counts = {sign: sum(sign in line for line in lines) for sign in "\t;,|"}
    return max(counts, key=lambda sign: (counts[sign], -"\t;,|".index(sign)))


# ---- numbers ----

_SIGNS = str.maketrans({"−": "-", "–": "-", "’": "'", "\xa0": " ", "\u202f": " "})
_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_GROUPS = {
    sign: re.compile(
        rf"[+-]?[1-9]\d{{0,2}}(?:([ '{other}])\d{{3}})(?:\1\d{{3}})*({re.escape(sign)}\d*)?"
    )
    for sign, other in ((".", ","), (",", "."))
}
# 1.5 where the comma is the decimal sign.
_DATE = re.compile(
    r"\d{1,2}[.\-/ ]+(\d{1,2}[.\-/ ]+\d{2,4}|[A-Za-zäéû]{3,9}\.?([.\-/ ]*\d{2,4})?)|[A-Za-z]{3}[.\- ]+\d{2}"
)
_MISSING = re.compile(r"[+-]?(nan|inf|infinity|#?n/?a|null|#[A-Z0-9/]+[!?])", re.IGNORECASE)


def number_in(text, sign):
    """The number that ``text`` is with the decimal sign ``sign`` ("." or ","), or None.

    Thousands may be set apart by the other sign, blanks or apostrophes, in full groups of three.
    """
    plain = text.translate(_SIGNS)
    if sign == ",":
        simple = None if "." in plain else plain.replace(",", ".")
    else:
        simple = plain
    if simple is not None and _PLAIN.fullmatch(simple):
        return float(simple)
    if _GROUPS[sign].fullmatch(plain):
        return float(
            re.sub(r"[ '.,]", "", plain.partition(sign)[0]) + "." + plain.partition(sign)[2]
        )
    return None


def decimal_sign(cells, places, delimiter=""):
    """The decimal sign of a file from the cells (n) of its numbers: ".", ",", or "" for any.

    places: what a message says of where each cell stands, places(number of the cell); delimiter: of
    the file, with a comma as which a point is no sign between thousands.  Raises InputError if the
    cells contradict each other, or each could be read in either way.
    """
    signs = [sign for sign in ".," if any(sign in c for c in cells if isinstance(c, str))]
    first = {}  # the first cell that speaks for either sign, and one that may be thousands only
    for i, cell in enumerate(cells if signs else ()):
        if not isinstance(cell, str) or not ("," in cell or "." in cell):
            continue
        possible = [sign for sign in ".," if number_in(cell, sign) is not None]
        if possible:
            first.setdefault(possible[0] if len(possible) == 1 else "either", i)
        if len(signs) == 1 and signs[0] in first:
            break
    if "." in first and "," in first:
        late, early = max(first["."], first[","]), min(first["."], first[","])
        raise InputError(
            places(late), repr(cells[late]),
            f"line {places(early).rpartition(':')[2]} has {cells[early]!r}: must keep to one decimal sign",
        )  # fmt: skip
    for sign in ".,":
        if sign in first:
            return sign
    if "either" in first:
        if signs == ["."] and delimiter == ",":
            return "."
        raise InputError(
            places(first["either"]), repr(cells[first["either"]]),
            "may have a decimal sign or one between thousands: state decimal_sign, comma or point",
        )  # fmt: skip
    return ""


def numbers_of(cells, sign):
    """Cells (n) as an array of floats; NaN for what is no finite number.  sign: as decimal_sign's."""
    try:
        if sign == ",":
            found = np.array(
                [c.replace(",", ".") if "." not in c else "x" for c in cells], dtype=float
            )
        else:
            found = np.array(cells, dtype=float)
        # Python's own numbers with underscores are no numbers of a machine.
        if np.isfinite(found).all() and not any("_" in str(c) for c in cells):
            return found
    except (AttributeError, TypeError, ValueError):
        pass
    return np.array([number_of(cell, sign) for cell in cells])


def number_of(cell, sign):
    """The number in one cell; NaN for none or one that is not finite."""
    if isinstance(cell, float):
        return cell
    found = number_in(cell, sign or ".")
    return math.nan if found is None or not math.isfinite(found) else found


def is_missing(cell):
    """Whether a cell is a word for no number, such as NaN or #DIV/0!."""
    return isinstance(cell, str) and _MISSING.fullmatch(cell) is not None


def what_is_right(cell):
    """What a message says that must stand in place of a cell that is no number."""
    if is_missing(cell) or number_in(str(cell), ".") is not None:
        return "must be a finite number"
    made = (
        "; Excel has made a date of it, so export the file again"
        if _DATE.fullmatch(str(cell))
        else ""
    )
    return f"must be a number{made}"

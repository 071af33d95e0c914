"""Where in a sheet a measured curve stands: preamble, header, units, rows, and what is left out.

A file has a header above its rows of numbers, with the units in it or in a row below; what stands
before is the preamble (``Gauge length; 100.00; mm`` or ``# gauge_length_mm: 100``).  Rows below the
numbers that begin with a word are a summary; the header again begins another cycle or specimen.
"""

import re
from dataclasses import dataclass, field

import numpy as np

from knitsim.errors import InputError
from knitsim.measured.names import heading
from knitsim.store.sheet import NUMERIC, decimal_sign, is_missing, numbers_of, what_is_right
from knitsim.units import parsed

STRAYS = 3  # rows of numbers below a line of text that may be left out as no part of the curve
_COMMENT = re.compile(r"#|//|!|%\s*\w[\w ]*[:=]")
_VALUE = re.compile(r"^(.*?\w.*?)\s*[:=]\s*(.+)$", re.DOTALL)
NUMBER_UNIT = re.compile(r"^([+\-−]?[\d.,' \xa0]*\d)\s*(.*)$")
_CYCLE = re.compile(r"\b(cycle|zyklus|loop|ramp)\b", re.IGNORECASE)
_SPECIMEN = re.compile(
    r"\b(specimen|sample|probe|pr.fling|.prouvette|versuch|test|run)\b", re.IGNORECASE
)


@dataclass(eq=False)
class Table:
    """The rows of a curve as they stand in a file.

    headings: of the columns.  rows: lists of cells, lines: their numbers in the file.  breaks: (number
    of the first row, "cycle" or "specimen") of each part after the first.  conditions: {name: (line,
    Heading, text)} of the preamble.  left_out: (first line, last line, why).  sign: decimal sign.
    """

    where: str
    headings: list
    header_line: int
    rows: list
    lines: np.ndarray
    conditions: dict
    comments: list
    delimiter: str
    breaks: list = field(default_factory=list)
    left_out: list = field(default_factory=list)
    notes: list = field(default_factory=list)
    sign: str = ""

    def place(self, row):
        return f"{self.where}:{self.lines[row]}"

    def cells(self, column):
        return [row[column] if column < len(row) else "" for row in self.rows]

    def numbers(self, column):
        """The numbers of a column, (n,); NaN for blank cells and what is no number."""
        return numbers_of(self.cells(column), self.sign)

    def refuse_cells(self, column, numbers, rows, blank=False):
        """InputError for the first of ``rows`` whose cell in a column is no number; blank: or nothing."""
        cells = self.cells(column)
        for row in rows[~np.isfinite(numbers[rows])]:
            if not (blank and cells[row] == ""):
                raise InputError(
                    f"{self.place(row)}: {self.headings[column].text}", repr(cells[row]),
                    what_is_right(cells[row]),
                )  # fmt: skip


def header_of(sheet, where, skip, wanted):
    """A :class:`Table` of ``sheet`` whose rows are all that stand below the header.

    skip: lines to pass over, a number of first lines or a list of line numbers.  wanted: whether a list
    of headings can be that of the curve.  Raises InputError if there are no rows of numbers; without a
    header that is wanted, the best one is returned, for a message about its columns.
    """
    rows, lines = _without(sheet, skip)
    n, at, rejected = len(rows), 0, []
    while at < n:
        if _kind(rows[at]) != "numbers":
            at += 1
            continue
        after = [kind for row in rows[at + 1 : at + 12] if (kind := _kind(row)) not in ("", "#")][
            :2
        ]
        head = _header_above(rows, at)
        if head and wanted(head[0]):
            return _begin(sheet, where, rows, lines, at, head)
        if all(kind == "numbers" for kind in after):
            rejected.append((at, head))
        while at < n and _kind(rows[at]) in ("numbers", ""):
            at += 1
    for i in range(n):
        # A header without any numbers below it.
        if _kind(rows[i]) == "text" and wanted(found := [heading(cell) for cell in rows[i]]):
            return _begin(sheet, where, rows, lines, n, (found, i))
    if not any(_kind(row) not in ("", "#") for row in rows):
        raise InputError(where, "no data", "must have a header line and lines of numbers")
    if not rejected:
        i = next(i for i in range(n) if _kind(rows[i]) not in ("", "#"))
        raise InputError(
            f"{where}:{lines[i]}", shown(rows[i]),
            "no lines of two or more numbers were found: must have a header and columns of numbers",
        )  # fmt: skip
    at, head = max(rejected, key=lambda one: one[1] is not None)
    if head is None:
        head = [heading("") for _ in rows[at]], None
    return _begin(sheet, where, rows, lines, at, head)


def _without(sheet, skip):
    if skip is None:
        return sheet.rows, sheet.lines
    passed = set(range(1, skip + 1)) if isinstance(skip, int) else set(map(int, skip))
    kept = [i for i, line in enumerate(sheet.lines) if line not in passed]
    return [sheet.rows[i] for i in kept], [sheet.lines[i] for i in kept]


def _filled(row):
    return [cell for cell in row if cell != ""]


def _is_number(cell):
    return isinstance(cell, float) or NUMERIC.fullmatch(cell.removesuffix("%").rstrip()) is not None


def _per_cent(table):
    """Take the sign off columns in whose cells it stands, as Excel writes them."""
    for column, cell in enumerate(table.rows[0][: len(table.headings)] if table.rows else ()):
        if isinstance(cell, str) and cell.endswith("%"):
            for row in table.rows:
                if column < len(row) and isinstance(row[column], str):
                    row[column] = row[column].removesuffix("%").rstrip()
            if table.headings[column].unit is None:
                table.headings[column] = table.headings[column].with_unit(parsed("%"))


def _kind(row):
    """Of a row: "" for blank, "#" for a comment, "numbers" or "text"."""
    filled = _filled(row)
    if not filled:
        return ""
    if isinstance(filled[0], str) and _COMMENT.match(filled[0]):
        return "#"
    numbers = sum(map(_is_number, filled))
    return "numbers" if numbers > 1 and 2 * numbers >= len(filled) else "text"


def _header_above(rows, at):
    """(headings, number of their row) above the row ``at``, with the units of a row between; None."""
    texts, comment, i = [], None, at - 1
    while i >= 0 and len(texts) < 3:
        kind = _kind(rows[i])
        if kind == "numbers" or (texts and kind != "text"):
            break
        if kind == "text":
            texts.append(i)
        elif kind == "#" and comment is None:
            comment = i
        i -= 1
    if not texts:
        # Written by numpy.savetxt and the like.
        if comment is None or len(_filled(rows[comment])) < 2:
            return None
        cells = [str(cell).lstrip("# ") for cell in rows[comment]]
        return [heading(cell) for cell in cells], comment
    names = heads = [heading(cell) for cell in rows[texts[0]]]
    if len(texts) > 1:
        names = [heading(cell) for cell in rows[texts[1]]]
        units = [parsed(str(cell)) if cell != "" else None for cell in rows[texts[0]]]
        filled, spelt = len(_filled(rows[texts[0]])), sum(unit is not None for unit in units)
        known = sum(one.family is not None or one.name in _SINGLE for one in names)
        if known > 1 and (
            2 * spelt >= filled or known > sum(one.family is not None for one in heads)
        ):
            return _with_units(names, units), texts[1]
    return heads, texts[0]


_SINGLE = ("f", "k", "m", "e", "t")


def _with_units(names, units):
    units += [None] * (len(names) - len(units))
    return [
        one.with_unit(unit) if unit is not None and (one.unit is None or one.unit.text == unit.text) else one
        for one, unit in zip(names, units, strict=False)
    ]  # fmt: skip


def _begin(sheet, where, rows, lines, at, head):
    headings, names = head
    headings = list(headings)
    while names is not None and headings and not headings[-1].text:
        headings.pop()
    conditions, comments = {}, []
    for i in range(at):
        if i == names:
            continue
        _preamble(conditions, comments, rows[i], lines[i], where, sheet.delimiter)
    table = Table(
        where, headings, lines[names] if names is not None else 0, rows[at:], np.array(lines[at:], dtype=int),
        conditions, comments, sheet.delimiter,
    )  # fmt: skip
    for i, row in enumerate(table.rows):
        if row and isinstance(row[0], str) and _COMMENT.match(row[0]):
            _preamble(conditions, comments, row, table.lines[i], where, sheet.delimiter)
    _per_cent(table)
    return table


def _preamble(conditions, comments, row, line, where, delimiter):
    """Take up what a row states of the whole file."""
    filled = _filled(row)
    if not filled:
        return
    if _COMMENT.match(str(filled[0])):
        between = delimiter if delimiter in ",;|" else " "
        comment = between.join(map(str, row)).strip(f"{between} ").lstrip("#/!% ")
        found = _VALUE.match(comment)
        if found is None or not _take(conditions, heading(found[1]), found[2], line, where):
            comments.append(comment)
        return
    cells = [str(cell) for cell in row]
    for i, cell in enumerate(cells):
        if not cell or _is_number(cell):
            continue
        stated = _VALUE.match(cell)
        if stated and heading(stated[1]).condition:
            _take(conditions, heading(stated[1]), stated[2], line, where)
        elif (one := heading(cell)).condition:
            behind = [other for other in cells[i + 1 :] if other][:2]
            if behind:
                unit = (
                    behind[1]
                    if len(behind) > 1 and parsed(behind[1]) and not _is_number(behind[1])
                    else ""
                )
                _take(conditions, one, f"{behind[0]} {unit}".strip(), line, where)


def _take(conditions, one, text, line, where):
    """Whether ``one`` is a condition; it is taken up, unless its value is words."""
    name = one.condition
    words = not any(c.isdigit() for c in text)
    if name is None or (words and name != "decimal_sign" and "_" not in one.text):
        return False
    if name in conditions and (conditions[name][1].unit, conditions[name][2]) != (one.unit, text):
        raise InputError(f"{where}:{line}", repr(f"{one.text}: {text}"), f"gives the {name} again")
    conditions[name] = (line, one, text)
    return True


def take_rows(table, pairs, used, sign):
    """Keep the rows of numbers of a :class:`Table`, note the others, settle its decimal sign.

    pairs: (column of x, column of y) of each specimen; used: all columns that are read; sign: the decimal
    sign if it is stated.  Raises InputError for rows that make no sense.
    """
    if not _all_numbers(table, used):
        _sort_rows(table, pairs)
    if sign is None:
        cells = [cell for column in used for cell in table.cells(column) if cell != ""]
        owners = [
            (column, i)
            for column in used
            for i, cell in enumerate(table.cells(column))
            if cell != ""
        ]
        sign = decimal_sign(cells, lambda k: table.place(owners[k][1]), table.delimiter)
    table.sign = sign
    for kind in ("specimen", "cycle"):
        if not table.breaks:
            _parts_by_column(table, kind)


def _all_numbers(table, used):
    """Whether every row is one of numbers, as wide as the header, which is quickly seen."""
    while table.rows and not _filled(table.rows[-1]):
        table.rows.pop()
    table.lines = table.lines[: len(table.rows)]
    width = len(table.headings)
    if not table.rows or not all(len(row) == width for row in table.rows):
        return False
    # The first column too, as a summary has its name there.
    for column in {*used, 0} if _is_number(table.rows[0][0]) else used:
        cells = [row[column] for row in table.rows]
        try:
            if any("," in cell for cell in cells):
                cells = [
                    cell.replace(",", ".")
                    for cell in cells
                    if cell.count(",") < 2 and "." not in cell
                ]
            if len(cells) < len(table.rows) or not np.isfinite(np.array(cells, dtype=float)).all():
                return False
        except (AttributeError, TypeError, ValueError):
            return False
    return True


def _sort_rows(table, pairs):
    headings, width = [one.text.casefold() for one in table.headings], len(table.headings)
    kept, odd, closed, strays, label, fresh = [], [], None, [], "", False
    numeric = (
        {i for i, cell in enumerate(table.rows[0]) if _is_number(cell)} if table.rows else set()
    )
    for i, row in enumerate(table.rows):
        kind = _kind(row)
        if kind in ("", "#"):
            continue
        texts = [" ".join(str(cell).split()).casefold() for cell in row]
        if sum(a == b and a != "" for a, b in zip(texts, headings, strict=False)) > 1:
            table.left_out.append((*_span(table, i), "the header again"))
            fresh, closed = bool(kept), None
            continue
        if fresh and not kind == "numbers" and all(parsed(text) or not text for text in texts):
            continue  # its row of units
        extra = [cell for cell in row[width:] if cell != "" and _is_number(cell)]
        cells = [(_cell(row, x), _cell(row, y)) for x, y in pairs]
        states = [tuple(map(_state, pair)) for pair in cells]
        whole = [state == ("number", "number") for state in states]
        # A word where the first row has a number is the name of a mean or the like.
        named = _is_named(row, numeric)
        if not (named and kept) and any(whole) and all(
            w or state == ("", "") for w, state in zip(whole, states, strict=True)
        ):  # fmt: skip
            if extra:
                raise InputError(
                    table.place(i), shown(row),
                    f"has {len(_filled(row))} fields, must have the {width} of the header"
                    + "; a decimal comma needs semicolon or tab as the delimiter" * (table.delimiter == ","),
                )  # fmt: skip
            if closed is not None:
                strays.append(i)
            else:
                if fresh and kept:
                    table.breaks.append((len(kept), label or "cycle"))
                kept.append(i)
                fresh, label = False, ""
            continue
        first = str(_filled(row)[0])
        if _CYCLE.search(first):
            label = "cycle"
        elif _SPECIMEN.search(first):
            label = "specimen"
        if not any("number" in state for state in states):
            _preamble(
                table.conditions, table.comments, row, table.lines[i], table.where, table.delimiter
            )
        odd.append(i)
        if kept:
            closed = i if closed is None else closed
    if strays:
        _refuse_strays(table, pairs, closed, strays, _is_named(table.rows[closed], numeric))
    _note_odd(table, pairs, odd, strays, kept)
    table.rows, table.lines = [table.rows[i] for i in kept], table.lines[kept]


def _is_named(row, numeric):
    """Whether a row begins with a word in one of the columns ``numeric``, and is no word alone."""
    first = next(i for i, cell in enumerate(row) if cell != "")
    return first in numeric and _state(row[first]) == "text" and not is_missing(row[first])


def _refuse_strays(table, pairs, closed, strays, named):
    """InputError if rows below the line ``closed`` look like a part of the curve; named: whether that
    begins with a word, as that of a mean does."""
    for x, y in () if named and len(strays) <= STRAYS else pairs:
        states = _state(_cell(table.rows[closed], x)), _state(_cell(table.rows[closed], y))
        if "number" in states:
            column = x if states[0] != "number" else y
            bad = _cell(table.rows[closed], column)
            raise InputError(
                f"{table.place(closed)}: {table.headings[column].text}",
                repr(bad),
                what_is_right(bad),
            )
    if len(strays) > STRAYS:
        raise InputError(
            table.place(closed), shown(table.rows[closed]),
            f"stands above {len(strays)} more rows of numbers: if they go on with the curve, state skip: "
            f"[{table.lines[closed]}]; if not, leave them out of the file",
        )  # fmt: skip


def _note_odd(table, pairs, odd, strays, kept):
    if not odd and not strays:
        return
    last = kept[-1] if kept else -1
    for i in sorted([*odd, *strays]):
        cell = str(_filled(table.rows[i])[0])
        if i in strays:
            why = "numbers below a line of text"
        elif _is_number(cell):
            why = "incomplete"
        else:
            why = "text" if i < last else f"below the data: {cell[:30]}"
        table.left_out.append((*_span(table, i), why))


def _span(table, i):
    return int(table.lines[i]), int(table.lines[i])


def _cell(row, column):
    return row[column] if column < len(row) else ""


def _state(cell):
    if cell == "":
        return ""
    return "number" if _is_number(cell) and not is_missing(cell) else "text"


def _parts_by_column(table, kind):
    """Breaks where a column of cycle or specimen numbers changes."""
    columns = [i for i, one in enumerate(table.headings) if one.family == kind]
    if len(columns) != 1 or not table.rows:
        return
    cells = table.cells(columns[0])
    changes = [i for i in range(1, len(cells)) if cells[i] != cells[i - 1]]
    seen = len(set(cells))
    if changes and len(changes) == seen - 1:
        table.breaks = [(i, kind) for i in changes]
        table.notes.append(f"{seen} {kind}s by the column {table.headings[columns[0]].text!r}")


def shown(row):
    """Cells of a row in quotes on one line, for a message."""
    text = ", ".join(str(cell) for cell in row if cell != "")
    return repr(text if len(text) <= 60 else text[:57] + "...")

"""Delimited text line by line: encoding, delimiter, fields, decimal sign, numbers.

Every function takes where it reads (the file) for the InputError it raises.
"""

import csv
import math
import re
from pathlib import Path

from knitsim.errors import InputError

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity|#?n/?a|null)", re.IGNORECASE)


def read_lines(path, where):
    """The lines of the file as text, without byte order mark and line ends."""
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise InputError(where, None, f"cannot be read: {error.strerror}") from None
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"{where}:1", "UTF-16", "must be UTF-8 text")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # The codec counts from behind the byte order mark.
        start = error.start + (3 if raw.startswith(b"\xef\xbb\xbf") else 0)
        line = len(re.split(rb"\r\n|\r|\n", raw[:start]))
        raise InputError(
            f"{where}:{line}", f"byte 0x{raw[start]:02x}", "must be UTF-8 text"
        ) from None
    if "\0" in text:
        line = len(re.split(r"\r\n|\r|\n", text[: text.index("\0")]))
        raise InputError(f"{where}:{line}", "a zero byte", "must be UTF-8 text")
    return re.split(r"\r\n|\r|\n", text)


def delimiter_of(where, line, header):
    """The one of tab, semicolon and comma that stands in the header outside quotes."""
    outside = re.sub(r'"[^"]*"', "", header)
    found = [sign for sign in "\t;," if sign in outside]
    if len(found) > 1:
        signs = " and ".join({"\t": "tab"}.get(sign, f"'{sign}'") for sign in found)
        raise InputError(
            f"{where}:{line}", f"{signs} in the header", "must have one delimiter only"
        )
    if not found:
        raise InputError(
            f"{where}:{line}",
            short(header),
            "must be the header: two or more column names with comma, semicolon or tab between",
        )
    return found[0]


def fields_of(where, line, text, delimiter):
    """The fields of one line, without quotes and blanks around them."""
    # The csv module takes blanks before a quote, but not behind it.
    closed = re.sub(rf'" +(?={delimiter}|$)', '"', text)
    try:
        reader = csv.reader([closed], delimiter=delimiter, strict=True, skipinitialspace=True)
        row = next(reader)
    except csv.Error as error:
        raise InputError(f"{where}:{line}", short(text), f"broken quotes ({error})") from None
    return [field.strip() for field in row]


def table_of(where, rows, delimiter, width):
    """[(line, fields)] of ``rows`` [(line, text)], each as wide as the header."""
    table = []
    for line, text in rows:
        row = fields_of(where, line, text, delimiter)
        while len(row) > width and not row[-1]:
            row.pop()
        if len(row) != width:
            hint = ""
            if delimiter == "," and len(row) > width:
                hint = "; a decimal comma needs semicolon or tab as the delimiter"
            raise InputError(
                f"{where}:{line}",
                short(text),
                f"has {len(row)} fields, must have the {width} of the header{hint}",
            )
        table.append((line, row))
    return table


def has_decimal_comma(where, delimiter, table, used, stated):
    """Whether the numbers have a decimal comma; refuses a file that could be read in two ways.

    stated: (line, unit, text) of a comment ``# decimal_sign: comma`` or ``point``, or None.
    """
    if stated is not None and stated[2] not in ("comma", "point"):
        raise InputError(f"{where}:{stated[0]}: decimal_sign", stated[2], "must be comma or point")
    first, certain = {}, False
    for line, row in table:
        for field in (row[index] for index in used):
            if "," in field and delimiter == ",":
                raise InputError(
                    f"{where}:{line}",
                    repr(field),
                    "a decimal comma needs semicolon or tab as the delimiter",
                )
            if "," in field and "." in field:
                raise InputError(
                    f"{where}:{line}", repr(field), "thousands separators are not read"
                )
            for sign in ",.":
                if sign in field:
                    first.setdefault(sign, (line, field))
            certain = certain or ("," in field and not _THOUSANDS.fullmatch(field))
    if len(first) == 2:
        line, field = max(first.values())
        other = min(first.values())
        raise InputError(
            f"{where}:{line}",
            repr(field),
            f"line {other[0]} has {other[1]!r}: must keep to one decimal sign",
        )
    if stated is not None:
        return stated[2] == "comma"
    if "," in first and not certain:
        line, field = first[","]
        raise InputError(
            f"{where}:{line}",
            repr(field),
            "may have a decimal comma or a thousands separator: add '# decimal_sign: comma' "
            "or write decimal points",
        )
    return "," in first


def number(where, name, text, comma):
    """The finite number in ``text``; comma: the decimal sign is a comma."""
    plain = text.replace(",", ".") if comma else text
    if _NOT_FINITE.fullmatch(text):
        raise InputError(f"{where}: {name}", short(text), "must be a finite number")
    if not _NUMBER.fullmatch(plain):
        raise InputError(f"{where}: {name}", short(text), "must be a number")
    value = float(plain)
    if not math.isfinite(value):
        raise InputError(f"{where}: {name}", short(text), "must be a finite number")
    return value


def short(text):
    """``text`` in quotes on one line, for a message."""
    return repr(text if len(text) <= 40 else text[:37] + "...")

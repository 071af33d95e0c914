"""Measured curves from CSV files: units from the header, everything else checked line by line.

A file looks like this (comments, metadata, delimiter and decimal sign are free)::

    # polyester, bobbin 3
    # gauge_length_mm: 500
    extension_mm;force_cN
    0,00;0,0
    2,50;115,2

The delimiter is a comma, a semicolon or a tab.  Numbers have a decimal point, or a decimal comma if
the delimiter is another sign; a file that can be read in two ways is refused.
"""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from knitsim.errors import InputError
from knitsim.measured import delimited
from knitsim.units import to_si

# What a column may hold, under which ends of its name, and the units that turn it into SI: one unit
# of knitsim.units, or two of them for a quotient.  "" is a plain number.
COLUMNS = {
    "strain": {"": (), "percent": ("percent",)},
    "thickness": {"mm": ("mm",), "um": ("um",), "m": ("m",)},
    "extension": {"mm": ("mm",), "um": ("um",), "m": ("m",)},
    "force": {"N": ("N",), "cN": ("cN",), "mN": ("mN",), "gf": ("gf",)},
    "tenacity": {
        "cN_per_dtex": ("cN", "dtex"),
        "cN_per_tex": ("cN", "tex"),
        "N_per_tex": ("N", "tex"),
        "mN_per_tex": ("mN", "tex"),
        "gf_per_den": ("gf", "den"),
    },
    # Ends of the band around the strain: spread of the specimens, or error.
    "strain_low": {"": (), "percent": ("percent",)},
    "strain_high": {"": (), "percent": ("percent",)},
    "lateral_strain": {"": (), "percent": ("percent",)},
    "force_per_width": {
        "gf_per_cm": ("gf_per_cm",),
        "N_per_m": ("N_per_m",),
        "N_per_mm": ("N_per_mm",),
    },
    "curvature": {"per_cm": ("per_cm",), "per_m": ("per_m",), "per_mm": ("m", "mm")},
    # Moment per width: gf cm/cm and N m/m are forces.
    "moment_per_width": {"gf_cm_per_cm": ("gf",), "N_m_per_m": ("N",), "mN_m_per_m": ("mN",)},
}

# What a comment "# name_unit: number" may give, once for the whole file; all above 0.
METADATA = {
    "gauge_length": {"mm": "mm", "um": "um", "m": "m"},
    "width": {"mm": "mm", "m": "m"},
    "pretension": {"N_per_mm": "N_per_mm", "N_per_m": "N_per_m", "gf_per_cm": "gf_per_cm"},
    "machine_compliance": {"mm_per_N": "mm_per_N", "um_per_N": "um_per_N"},
    "linear_density": {"dtex": "dtex", "tex": "tex", "den": "den"},
    "count": {"dtex": "dtex", "tex": "tex", "den": "den", "Ne": "Ne", "Nm": "Nm"},
    "decimal_sign": {},
}

# A quantity that another column gives with the help of one value for the whole file, and how.
_DERIVED = {
    "strain": ("extension", "gauge_length", lambda column, length: column / length),
    "force": ("tenacity", "linear_density", lambda column, density: column * density),
    "force_per_width": ("force", "width", lambda column, width: column / width),
}
_EXAMPLES = {
    "gauge_length": "gauge_length_mm",
    "linear_density": "linear_density_dtex",
    "width": "width_mm",
}


@dataclass(frozen=True, eq=False)
class Curve:
    """A measured curve in SI, in the order of its file.

    values: quantity -> array (n,), read-only.  lines: line of each point in the file, (n,).
    metadata: what the comments or the caller gave (``gauge_length`` m, ``linear_density`` kg/m).
    comments: the other comment lines.  ignored: header names that are no known quantity.  written:
    quantity -> (header name, numbers as they stand in the file), for messages.
    """

    source: str
    values: Mapping[str, np.ndarray]
    lines: np.ndarray
    metadata: Mapping[str, float]
    comments: tuple[str, ...]
    ignored: tuple[str, ...]
    written: Mapping[str, tuple]

    def __getitem__(self, quantity):
        return self.values[quantity]

    def __len__(self):
        return self.lines.size

    def refused(self, where, quantity, point, right):
        """The InputError for a point: its line, and its number and header as the file has them."""
        return _refused(where, self.written, self.lines, quantity, point, right)


def read_curve(
    path,
    quantities,
    *,
    rising=None,
    not_negative=(),
    least_points=2,
    gauge_length=None,
    linear_density=None,
    width=None,
    optional=(),
):
    """The columns for ``quantities`` (keys of COLUMNS) of the CSV file at ``path``, as a Curve.

    Strain may stand in the file as extension if the gauge length (m) is known, and force as
    tenacity if the linear density (kg/m) is, and force per width as force if the width (m) is; all
    three come from the comments unless given here.  optional: quantities that are read as well where
    the header has them.
    rising: a quantity that may stay equal but never fall from line to line.  not_negative:
    quantities that must be 0 or above.  least_points: fewest points accepted.

    Raises InputError with file, line, value and what is right.
    """
    where = str(path)
    given = {"gauge_length": gauge_length, "linear_density": linear_density, "width": width}
    for name, value in given.items():
        if value is not None and not 0 < value < np.inf:
            raise InputError(f"{where}: {name}", value, "must be finite and above 0")
    comments, metadata, header, rows = _split(where, delimited.read_lines(path, where))
    delimiter = delimited.delimiter_of(where, *header)
    names = delimited.fields_of(where, *header, delimiter)
    while not names[-1]:
        names.pop()
    columns, ignored = _columns(where, header[0], names)
    there = {name for name, _ in columns.values()}
    quantities = (*quantities, *(name for name in optional if name in there))
    chosen = _choose(where, header[0], names, columns, quantities)
    table = delimited.table_of(where, rows, delimiter, len(names))
    used = sorted({index for index, _ in chosen.values()})
    comma = delimited.has_decimal_comma(
        where, delimiter, table, used, metadata.pop("decimal_sign", None)
    )
    metadata = _metadata(where, metadata, given, comma)
    if len(table) < least_points:
        raise InputError(
            f"{where}:{table[-1][0] if table else header[0]}",
            None,
            f"the curve has {len(table)} points, at least {least_points} are needed",
        )
    lines = np.array([line for line, _ in table])
    numbers = {
        index: np.array(
            [
                delimited.number(f"{where}:{line}", names[index], row[index], comma)
                for line, row in table
            ]
        )
        for index in used
    }
    values = {}
    for quantity, (index, unit) in chosen.items():
        column = _column_to_si(numbers[index], unit)
        if columns[index][0] != quantity:
            _, needed, combine = _DERIVED[quantity]
            if needed not in metadata:
                raise InputError(
                    f"{where}:{header[0]}",
                    repr(names[index]),
                    f"needs a line '# {_EXAMPLES[needed]}: ...' or the key {_EXAMPLES[needed]}",
                )
            column = combine(column, metadata[needed])
        column.setflags(write=False)
        values[quantity] = column
    lines.setflags(write=False)
    written = {name: (names[index], numbers[index]) for name, (index, _) in chosen.items()}
    for quantity in not_negative:
        _refuse_first(where, values[quantity] < 0, quantity, written, lines, "must not be negative")
    if rising is not None:
        falls = np.concatenate([[False], np.diff(values[rising]) < 0])
        _refuse_first(
            where, falls, rising, written, lines, "must not fall below the line before it"
        )
    return Curve(
        Path(path).name,
        MappingProxyType(values),
        lines,
        MappingProxyType(metadata),
        comments,
        ignored,
        MappingProxyType(written),
    )


def read_yarn_curve(path, *, gauge_length=None, linear_density=None, least_points=8):
    """Tensile curve of a yarn: strain (rising, not negative) and force (N), as a Curve.

    The force may be slightly negative, as noise around zero is; below -5 % of the largest force it
    is refused.  Eight points are the fewest that a calibration can use.  Arguments and errors as
    in :func:`read_curve`.
    """
    curve = read_curve(
        path,
        ("strain", "force"),
        rising="strain",
        not_negative=("strain",),
        least_points=least_points,
        gauge_length=gauge_length,
        linear_density=linear_density,
    )
    force, where = curve["force"], str(path)
    if not force.max() > 0:
        raise InputError(f"{where}: force", f"{force.max():g} N at most", "must rise above 0")
    _refuse_first(
        where,
        force < -0.05 * force.max(),
        "force",
        curve.written,
        curve.lines,
        "must not be negative (below -5 % of the largest force)",
    )
    return curve


def _refuse_first(where, bad, quantity, written, lines, right):
    if bad.any():
        raise _refused(where, written, lines, quantity, int(np.argmax(bad)), right)


def _refused(where, written, lines, quantity, point, right):
    header, numbers = written[quantity]
    return InputError(f"{where}:{lines[point]}: {header}", f"{numbers[point]:.9g}", right)


def _split(where, lines):
    """Comments, metadata {name: (line, unit, text)}, the header (line, text) and the other rows."""
    comments, metadata, rows = [], {}, []
    for line, text in enumerate(lines, start=1):
        if text.lstrip().startswith("#"):
            comment = text.lstrip().lstrip("#").strip()
            found = _metadata_of(where, line, comment)
            if found is None:
                comments.append(comment)
            elif found[0] in metadata:
                raise InputError(f"{where}:{line}", repr(comment), f"gives the {found[0]} again")
            else:
                metadata[found[0]] = (line, *found[1:])
        elif text.strip(' \t,;"'):
            rows.append((line, text))
    if not rows:
        raise InputError(where, "no data", "must have a header line and lines of numbers")
    return tuple(comments), metadata, rows[0], rows[1:]


def _metadata_of(where, line, comment):
    """(quantity, unit, text) of a comment that gives metadata, or None for any other comment."""
    name, colon, value = (part.strip() for part in comment.partition(":"))
    name = _plain(name)
    for quantity, units in METADATA.items():
        if not colon or not (name == quantity or name.startswith(quantity + "_")):
            continue
        unit = name[len(quantity) + 1 :]
        if units and unit not in units:
            if "_" in unit:  # a sentence, such as "count of specimens: 5"
                continue
            right = "must be " + " or ".join(f"{quantity}_{known}" for known in units)
            raise InputError(f"{where}:{line}", repr(name), right)
        if not units and unit:
            continue
        return "linear_density" if quantity == "count" else quantity, unit, value
    return None


def _metadata(where, metadata, given, comma):
    """SI values of the metadata, with the arguments in ``given`` before those of the file."""
    values = {}
    for quantity, (line, unit, text) in metadata.items():
        value = delimited.number(f"{where}:{line}", quantity, text, comma)
        if value <= 0:
            raise InputError(f"{where}:{line}: {quantity}", text, "must be above 0")
        values[quantity] = to_si(value, unit)
    return values | {name: value for name, value in given.items() if value is not None}


def _plain(name):
    """A header name in the spelling of COLUMNS: ``Force [cN]`` -> ``force_cN``, % -> percent."""
    name = name.replace("%", " percent").replace("/", "_per_")
    name = re.sub(r"[\s()\[\]_]+", "_", name).strip("_").replace("_1_per_", "_per_")
    # Case counts in the unit (mN, MN) and nowhere else.
    for quantity in sorted((*COLUMNS, *METADATA), key=len, reverse=True):
        if name.lower() == quantity or name.lower().startswith(quantity + "_"):
            return quantity + name[len(quantity) :]
    return name


def _columns(where, line, names):
    """{column index: (quantity, unit)} of the known columns, and the names of all others."""
    known = {
        f"{quantity}_{end}" if end else quantity: (quantity, units)
        for quantity, ends in COLUMNS.items()
        for end, units in ends.items()
    }
    columns, ignored = {}, []
    for index, name in enumerate(names):
        plain = _plain(name)
        if plain in known:
            columns[index] = known[plain]
            continue
        # The longest first, or force_per_width_kN would be a force.
        for quantity in sorted(COLUMNS, key=len, reverse=True):
            if plain == quantity or plain.startswith(quantity + "_"):
                fault = "lacks its unit" if plain == quantity else "has an unknown unit"
                raise InputError(
                    f"{where}:{line}", repr(name), f"{fault}: must be {_headers(quantity)}"
                )
        if name:
            ignored.append(name)
    return columns, tuple(ignored)


def _headers(quantity):
    return " or ".join(f"{quantity}_{end}" if end else quantity for end in COLUMNS[quantity])


def _choose(where, line, names, columns, quantities):
    """{quantity: (column index, unit)}; refuses a quantity of no column or of more than one."""
    chosen = {}
    for quantity in quantities:
        accepted = [quantity, *_DERIVED.get(quantity, ())[:1]]
        found = [index for index, (name, _) in columns.items() if name in accepted]
        if len(found) > 1:
            both = " and ".join(repr(names[index]) for index in found)
            raise InputError(f"{where}:{line}", both, f"only one column may give the {quantity}")
        if not found:
            headers = " or ".join(_headers(name) for name in accepted)
            near = difflib.get_close_matches(
                quantity, [name.lower().split("_")[0] for name in names], 1, 0.7
            )
            hint = f" ('{near[0]}' is not known)" if near and near[0] != quantity else ""
            raise InputError(
                f"{where}:{line}",
                delimited.short(", ".join(names)),
                f"the header has no column for the {quantity}{hint}: must be {headers}",
            )
        chosen[quantity] = (found[0], columns[found[0]][1])
    return chosen


def _column_to_si(column, unit):
    if not unit:
        return column.copy()
    column = to_si(column, unit[0])
    return column / to_si(1.0, unit[1]) if len(unit) == 2 else column

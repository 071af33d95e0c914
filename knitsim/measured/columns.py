"""Which columns of a table are the curve, in SI: recognised by heading and unit, or as the user says.

Where columns give one quantity twice, their numbers decide whether it matters which is taken; where a
unit or a column is missing, one line says which key to state.
"""

import difflib
import itertools
from dataclasses import dataclass, field, replace

import numpy as np

from knitsim.errors import InputError
from knitsim.measured.answers import condition_value, example, listed
from knitsim.measured.names import CONDITIONS, FAMILIES, QUANTITIES, heading
from knitsim.measured.table import header_of, shown, take_rows
from knitsim.measured.test import KINDS
from knitsim.units import NONE

BESIDE = {"tension": ("lateral_strain", "strain_low", "strain_high")}
# A quantity that another column gives with the help of one value for the whole file, and how.
DERIVED = {
    "strain": ("extension", "gauge_length", np.divide),
    "force": ("tenacity", "linear_density", np.multiply),
    "force_per_width": ("force", "width", np.divide),
    "moment_per_width": ("moment", "width", np.divide),
}
SAME, ALIKE = 0.02, 0.1  # of the range, up to which two columns are the same, or alike


@dataclass(eq=False)
class Columns:
    """The curve of one specimen as a file has it, in SI.

    values: {quantity: (n,)}; lines: (n,); written: {quantity: (heading, numbers)}; breaks: (row,
    "cycle" or "specimen"); conditions: {name: SI value}; recognised: sentences; left_out: (first line,
    last line, why); units: {quantity: Unit of its column, or None}.
    """

    where: str
    kind: str
    values: dict
    lines: np.ndarray
    written: dict
    breaks: list
    conditions: dict
    comments: tuple
    recognised: list
    left_out: list = field(default_factory=list)
    units: dict = field(default_factory=dict)
    header_line: int = 0

    def refused(self, quantity, point, right):
        """The InputError for a point: its line, and its number and heading as the file has them."""
        name, numbers = self.written[quantity]
        return InputError(
            f"{self.where}:{self.lines[point]}: {name}", f"{numbers[point]:.9g}", right
        )

    def part(self, first, end):
        """The rows from first to before end, as Columns of their own."""
        own = slice(first, end)
        return Columns(
            self.where, self.kind, {name: v[own] for name, v in self.values.items()}, self.lines[own],
            {name: (text, v[own]) for name, (text, v) in self.written.items()},
            [(row - first, kind) for row, kind in self.breaks if first < row < end],
            self.conditions, self.comments, self.recognised, self.left_out, self.units, self.header_line,
        )  # fmt: skip


def columns_of(sheet, where, kind, answers, tension_is_fabric):
    """The :class:`Columns` of each specimen of a sheet, a list.

    kind: of KINDS, or None to see it from the columns.  Raises InputError with what is missing.
    """

    def wanted(headings):
        headings = answers.applied(headings)
        if answers.columns:
            try:
                return all(answers.numbers_of(quantity, headings) for quantity in answers.columns)
            except InputError:
                return False
        families = {one.family for one in headings}
        pairs = (("lengthening", "force"), ("curvature", "moment"), ("thickness", "force"))
        return any(families.issuperset(pair) for pair in pairs)

    table = header_of(sheet, where, answers.skip, wanted)
    table.headings = answers.applied(table.headings)
    stated = table.conditions.pop("decimal_sign", None)
    sign = answers.sign
    if stated is not None and sign is None:
        if stated[2] not in ("comma", "point"):
            raise InputError(
                f"{where}:{stated[0]}: decimal_sign", stated[2], "must be comma or point"
            )
        sign = {"comma": ",", "point": "."}[stated[2]]
    kind = kind or _kind_of(table, answers, tension_is_fabric)
    chosen = _choose(table, kind, answers)
    x, y = KINDS[kind]
    take_rows(table, [(one[x][0], one[y][0]) for one in chosen], sorted({
        column for one in chosen for columns in one.values() for column in columns
    }), sign)  # fmt: skip
    conditions = _conditions(table, answers, where)
    found = [_to_si(table, kind, one, conditions, answers) for one in chosen]
    for number, one in enumerate(found if len(found) > 1 else (), start=1):
        one.recognised.append(f"specimen {number} of {len(found)}, side by side")
    first = found[0].recognised
    head = [sheet.how + {",": ", decimal comma", ".": "", "": ""}[table.sign]]
    head += [_condition_text(table, name) for name in table.conditions if name in conditions]
    unused = [one.text for i, one in enumerate(table.headings) if one.text and not any(
        i in columns for one in chosen for columns in one.values()
    )]  # fmt: skip
    first[:0] = head
    if unused:
        first.append(f"columns not used: {', '.join(unused)}")
    first += table.notes
    return [part for one in found for part in _parts(one)]


def _parts(columns):
    """Columns split where another specimen begins."""
    edges = [0, *(row for row, what in columns.breaks if what == "specimen"), len(columns.lines)]
    if len(edges) == 2:
        return [columns]
    parts = [columns.part(first, end) for first, end in itertools.pairwise(edges)]
    for number, part in enumerate(parts, start=1):
        part.recognised = [*columns.recognised, f"specimen {number} of {len(parts)}"]
    return parts


def _condition_text(table, name):
    line, one, text = table.conditions[name]
    return f"{name.replace('_', ' ')} from line {line}: {one.text.lstrip('# ')} = {text}"


def _conditions(table, answers, where):
    """{name: SI value}: what the caller states, before what the file states."""
    found = {}
    for name, entry in table.conditions.items():
        if name in answers.conditions:
            continue
        try:
            value, powers = condition_value(entry, where, table.sign)
        except InputError:
            # What nobody asks for may stand in any form, but not under knitsim's own name.
            if "_" in entry[1].text:
                raise
            found[name] = entry
            continue
        found[name] = (value, powers) if powers != CONDITIONS[name][0][0] else value
    return found | answers.conditions


def _kind_of(table, answers, fabric):
    """The kind of test that the headings show."""
    families = {one.family for one in table.headings}
    quantities = {one.quantity for one in table.headings} | set(answers.columns)
    conditions = {*table.conditions, *answers.conditions}
    if "curvature" in families | quantities:
        return "bending"
    if "thickness" in families | quantities:
        return "yarn_compression"
    if fabric or quantities & {"force_per_width", "lateral_strain"} or "width" in conditions:
        return "tension"
    if "tenacity" in quantities or "linear_density" in conditions:
        return "yarn_tension"
    if not quantities & {"strain", "extension", "force"}:
        return "tension"
    raise InputError(
        f"{table.where}:{table.header_line}", listed(table.headings),
        "may be of a fabric or of a yarn: state direction and width of a fabric, or kind yarn_tension",
    )  # fmt: skip


def _choose(table, kind, answers):
    """[{quantity: [column that is taken, others that say the same]}] of each specimen."""
    headings = table.headings
    groups = _specimens(headings)
    chosen = []
    for number, group in enumerate(groups):
        one = {}
        for quantity in (*KINDS[kind], *BESIDE.get(kind, ())):
            found = _candidates(table, quantity, group, answers, number)
            if found:
                one[quantity] = found
            elif quantity in KINDS[kind]:
                raise _missing(table, quantity)
        for end, other in (("strain_low", "strain_high"), ("strain_high", "strain_low")):
            if end in one and other not in one:
                raise InputError(
                    f"{table.where}: {other}", None, "is missing; a band has both ends"
                )
        chosen.append(one)
    return chosen


def _specimens(headings):
    """Numbers of the columns of each specimen: those that stand side by side under the same names."""
    names = [one.name if one.family else "" for one in headings]
    counts = {name: names.count(name) for name in names if name}
    most = max(counts.values(), default=1)
    repeated = {name for name, count in counts.items() if count == most}
    forces = {one.name for one in headings if one.family in ("force", "moment")}
    if (
        most == 1
        or not forces & repeated
        or any(counts[name] > 1 for name in counts if name not in repeated)
    ):
        return [range(len(headings))]
    # One quantity in two units is no two specimens.
    if len({(one.name, one.unit) for one in headings if one.name in repeated}) > len(repeated):
        return [range(len(headings))]
    groups = [[] for _ in range(most)]
    seen = dict.fromkeys(counts, 0)
    for i, name in enumerate(names):
        if name in repeated:
            groups[seen[name]].append(i)
            seen[name] += 1
        elif name:
            for group in groups:
                group.append(i)
    return groups


def _candidates(table, quantity, group, answers, number):
    """The columns of a group that give a quantity, that which is taken first; [] for none."""
    headings = table.headings
    other, condition, _ = DERIVED.get(quantity, (None, None, None))
    known = condition in answers.conditions or condition in table.conditions
    for stated in (quantity, other):
        columns = answers.numbers_of(stated, headings) if stated else None
        if columns is not None:
            column = columns[min(number, len(columns) - 1)]
            unit = answers.columns[stated][0].unit or headings[column].unit
            powers, sample = QUANTITIES[stated]
            if (unit.powers if unit is not None else NONE) != powers:
                raise InputError(
                    f"{answers.where}: columns", repr(stated),
                    f"lacks its unit: write it behind the name, such as {example(stated)}, or state unit: "
                    f"{{{stated}: {sample}}}",
                )  # fmt: skip
            text = headings[column].text or f"column {column + 1}"
            headings[column] = replace(heading(stated).with_unit(unit), text=text)
            return [column]
    direct = [i for i in group if headings[i].quantity == quantity]
    derived = [i for i in group if headings[i].quantity == other] if other else []
    if quantity == "strain":
        # The extension counts, as its unit is stated; a strain may be of another length.
        found = derived + direct if known or not direct else direct
    else:
        found = direct + derived if known else direct or derived
    if found and headings[found[0]].quantity == other and not known:
        key = CONDITIONS[condition][1]
        raise InputError(
            f"{table.where}:{table.header_line}", repr(headings[found[0]].text),
            f"needs a line '# {key}: ...' or the key {key}",
        )  # fmt: skip
    return found


def _missing(table, quantity):
    """The InputError for a quantity that no column gives: what to state."""
    where, headings = f"{table.where}:{table.header_line}", table.headings
    accepted = [quantity, *DERIVED.get(quantity, ())[:1]]
    family = next(name for name, own in FAMILIES.items() if quantity in own)
    for one in headings:
        if one.family == family and one.unit is None:
            unit = QUANTITIES[accepted[-1]][1]
            what = f"; {one.remark} is no unit that is known" if one.remark else ""
            return InputError(
                where, repr(one.text),
                f"lacks its unit{what}: state unit: {{{accepted[-1]}: {unit}}}, or another unit of "
                f"{' or '.join(accepted)}",
            )  # fmt: skip
        if one.family == family:
            return InputError(
                where, repr(one.text),
                f"{one.unit.text!r} is no unit of {' or '.join(accepted)}: if the heading is wrong, state "
                f"unit: {{{accepted[-1]}: {QUANTITIES[accepted[-1]][1]}}}",
            )  # fmt: skip
    if not any(one.text for one in headings):
        return InputError(
            f"{table.where}:{table.lines[0] if len(table.lines) else 1}", shown(table.rows[0]),
            f"has no header above it: state columns: {{{example(accepted[-1])}: 1, ...}}, quantity with "
            "unit and the number of its column",
        )  # fmt: skip
    hints = [
        one.text for one in headings
        if one.name and difflib.get_close_matches(one.name.split()[0], [*accepted, "load"], 1, 0.75)
    ]  # fmt: skip
    hint = f" ({hints[0]!r} is not known)" if hints else ""
    return InputError(
        where, listed(headings),
        f"the header has no column for the {quantity.replace('_', ' ')}{hint}: name it, such as "
        f"{' or '.join(map(example, accepted))}, or state columns: {{{example(accepted[-1])}: HEADING}}",
    )  # fmt: skip


def _to_si(table, kind, chosen, conditions, answers):
    """The :class:`Columns` of the columns of one specimen."""
    x, y = KINDS[kind]
    rows = np.arange(len(table.rows))
    if any(len(row) < len(table.headings) or "" in row for row in table.rows):
        pairs = zip(table.cells(chosen[x][0]), table.cells(chosen[y][0]), strict=True)
        rows = rows[[pair != ("", "") for pair in pairs]]
    values, written, recognised = {}, {}, []
    for quantity, columns in chosen.items():
        column = columns[0]
        numbers = table.numbers(column)
        needed = quantity in (x, y) or quantity.startswith("strain_")
        table.refuse_cells(column, numbers, rows, blank=not needed)
        values[quantity] = _derived(table, column, quantity, numbers, conditions)[rows]
        written[quantity] = (table.headings[column].text, numbers[rows])
        recognised.append(_said(table, column, quantity))
        for rival in columns[1:]:
            recognised.append(
                _compare(table, quantity, columns[0], rival, values[quantity], rows, conditions)
            )
    left = list(table.left_out)
    place = {int(row): k for k, row in enumerate(rows)}
    breaks = [(place[row], what) for row, what in table.breaks if row in place]
    simple = {name: value for name, value in conditions.items() if not isinstance(value, tuple)}
    for name, value in conditions.items():
        if isinstance(value, tuple) and len(value) == 2 and name == "pretension":
            simple[name] = _pretension(value, kind, simple)
    return Columns(
        table.where, kind, values, table.lines[rows], written, breaks, simple, tuple(table.comments),
        recognised, left, {q: table.headings[columns[0]].unit for q, columns in chosen.items()},
        table.header_line,
    )  # fmt: skip


def _pretension(value, kind, conditions):
    """A pretension in the unit of the kind's y: stated as a force, or per linear density."""
    value, powers = value
    if kind == "tension" and powers == QUANTITIES["force"][0] and "width" in conditions:
        return value / conditions["width"]
    if (
        kind == "yarn_tension"
        and powers == QUANTITIES["tenacity"][0]
        and "linear_density" in conditions
    ):
        return value * conditions["linear_density"]
    return value


def _derived(table, column, quantity, numbers, conditions):
    """A column in SI as the quantity."""
    one = table.headings[column]
    own = numbers * one.unit.factor if one.unit is not None else numbers.copy()
    if one.quantity == quantity:
        return own
    _, condition, combine = DERIVED[quantity]
    value = conditions[condition]
    if isinstance(value, tuple):
        value, _ = condition_value(table.conditions[condition], table.where, table.sign)
    return combine(own, value)


def _said(table, column, quantity):
    one = table.headings[column]
    unit = (
        one.unit.text.strip("()[] ") if one.unit is not None else "a fraction, as no unit is stated"
    )
    by = "" if one.quantity == quantity else f", over the {DERIVED[quantity][1].replace('_', ' ')}"
    if quantity == "force" and by:
        by = ", times the linear density"
    return f"{quantity.replace('_', ' ')}: column {column + 1}, {one.text!r} in {unit}{by}"


def _compare(table, quantity, taken, rival, values, rows, conditions):
    """What is said of a second column of a quantity; InputError where it matters which is taken."""
    one, other = table.headings[taken], table.headings[rival]
    numbers = table.numbers(rival)[rows]
    if not np.isfinite(numbers).all():
        return f"{other.text!r} is not used beside {one.text!r}: it has blank cells"
    second = _derived(table, rival, quantity, table.numbers(rival), conditions)[rows]
    scale = float(np.ptp(values)) or 1.0
    apart = float(np.abs(second - values).max()) / scale
    if other.unit is None:
        for factor, words in ((1.0, "as a fraction"), (0.01, "in per cent")):
            if float(np.abs(factor * numbers - values).max()) <= SAME * scale:
                return f"{other.text!r} is the same {words} and is not used"
    if apart <= SAME:
        return f"{other.text!r} is the same and is not used"
    derived = one.quantity != other.quantity
    if derived and (other.unit is None or apart <= ALIKE):
        return f"{other.text!r} is not used; it differs by up to {100 * apart:.2g} % of the range"
    if "yarn" in other.text.lower() and "yarn" not in one.text.lower():
        return f"{other.text!r} is not used beside {one.text!r}"
    both = f"{one.text!r} and {other.text!r}"
    # The unit of the heading counts, where it has one.
    key = one.quantity.replace(" ", "_") if one.unit else example(one.quantity)
    raise InputError(
        f"{table.where}:{table.header_line}", both,
        f"only one column may give the {quantity.replace('_', ' ')}, and these differ: state columns: "
        f"{{{key}: {one.text!r}}} or the other",
    )  # fmt: skip

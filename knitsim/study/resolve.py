"""From what a file states to SI values: sweeps, defaults, alternatives of unit."""

import itertools
import math
from dataclasses import replace

from knitsim import units
from knitsim.errors import InputError
from knitsim.study.check import Points, Stated, shown
from knitsim.study.keys import REQUIRED, Follows, Missing
from knitsim.study.ledger import Assumption

MOST_POINTS = 100_000  # of the sweep of one entry


def expand(tree, where):
    """The points of the sweeps in a checked ``tree``: a list of (point, label, tree).

    point: {dotted key: value} of the swept keys, label: ``key=value`` of each joined by commas
    (empty if nothing is swept), tree: with one value for each key.  Raises InputError if two points
    get the same label.
    """
    swept = list(_swept(tree, ""))
    number = math.prod(len(points.stated) for _, points in swept)
    if number > MOST_POINTS:
        raise InputError(
            where, None, f"its lists make {number} combinations: must be at most {MOST_POINTS}"
        )
    points, labels = [], {}
    for chosen in itertools.product(*(range(len(points.stated)) for _, points in swept)):
        point, parts, one = {}, [], tree
        for (path, points_of), index in zip(swept, chosen, strict=True):
            stated = points_of.stated[index]
            point[path] = stated.value
            parts.append(f"{path}={value_label(stated.value, index)}")
            one = replaced(one, path.split("."), Points(points_of.key, (stated,)))
        label = ",".join(parts)
        if label.lower() in labels:
            raise InputError(f"{where}", None, f"two points of the sweep are named {label}")
        labels[label.lower()] = None
        points.append((point, label, one))
    return points


def _swept(tree, prefix):
    for name, item in tree.items():
        if isinstance(item, dict):
            yield from _swept(item, f"{prefix}{name}.")
        elif item.swept:
            yield f"{prefix}{name}", item


def value_label(value, index):
    """A swept value as part of a file name; lists are numbered from 1."""
    if isinstance(value, list):
        return f"no{index + 1}"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        stem = value.rsplit("/", 1)[-1].removesuffix(".csv")
        return "".join(c if c.isascii() and (c.isalnum() or c in "_.+-") else "-" for c in stem)
    return f"{value:.12g}"


def replaced(tree, path, item):
    """A copy of ``tree`` with ``item`` at ``path`` (a list of names); nothing else is copied."""
    if len(path) == 1:
        return tree | {path[0]: item}
    return tree | {path[0]: replaced(tree.get(path[0], {}), path[1:], item)}


class Resolver:
    """SI values and ledger rows of one entry.

    beside: values of what the entry refers to, for the rules of its keys.  values: quantity to SI value
    (None if optional and not given), section to such a dict (None if not given).  rows: the assumptions.
    derived: {quantity: how it follows from what is stated, in words}.
    """

    def __init__(self, section, tree, where, subject, beside=None):
        self.where, self.subject, self.kind = where, subject, section.name
        self.beside = beside or {}
        self.rows, self.derived = [], {}
        self.values = self._section(section, tree, "", {})

    def _section(self, section, tree, prefix, outer):
        values = {}
        # Sections first: a rule of a key may need them.
        for inner in section.sections:
            if inner.named:
                continue
            given = tree.get(inner.name)
            values[inner.name] = (
                None if given is None else self._section(inner, given, f"{prefix}{inner.name}.", {})
            )
        # What is stated first, for rules; values and ledger keep the order of the table.
        quantities, first = section.quantities(), self.rows
        found, rows = dict(values), {}
        for stated in (True, False):
            for quantity, keys in quantities.items():
                if (quantity == "kind" or any(key.name in tree for key in keys)) != stated:
                    continue
                if stated or _applies(keys[0], found):
                    self.rows = rows[quantity] = []
                    found[quantity] = self._quantity(section, keys, tree, prefix, found, outer)
        self.rows = first + [row for quantity in quantities for row in rows.get(quantity, ())]
        values |= {quantity: found[quantity] for quantity in quantities if quantity in found}
        for inner in section.sections:
            if inner.named:
                values[inner.name] = {
                    name: self._section(inner, entry, f"{prefix}{inner.name}.{name}.", values)
                    for name, entry in tree[inner.name].items()
                }
        return values

    def _quantity(self, section, keys, tree, prefix, values, outer):
        main = keys[0]
        given = [key for key in keys if key.name in tree]
        here = f"{self.where}.{prefix}"
        if given and not _applies(main, values):
            raise InputError(
                here + main.name,
                shown(tree[main.name].stated[0].value),
                f"is a key of kind {' or '.join(main.when)}, not of {values['kind']}",
            )
        if len(given) > 1:
            raise InputError(
                f"{here}{given[1].name}",
                shown(tree[given[1].name].stated[0].value),
                f"gives the same quantity as {given[0].name}; keep one of them",
            )
        if given:
            stated = tree[given[0].name].stated[0]
            if getattr(stated.value, "how", ""):
                self.derived[f"{prefix}{main.quantity}"] = stated.value.how
                if stated.value.filaments is not None:
                    values["filaments"] = stated.value.filaments
            return self._given(section, main, given[0], stated, prefix)
        if main.quantity in outer:
            return outer[main.quantity]
        found = REQUIRED
        if main.default is not REQUIRED:
            found = self._default(section, main, prefix, values)
        if found is REQUIRED:
            names = " or ".join(key.name for key in keys)
            missing = f"is missing; give {names}" if len(keys) > 1 else "is missing"
            raise InputError(here + main.name, None, f"{missing} ({main.about.rstrip('.')})")
        return found

    def _given(self, section, main, key, stated, prefix):
        if main.default is None and main.because and not stated.because:
            stated = replace(stated, because=main.because)
        if stated.because:
            stages = main.stages or (section.stage,)
            self._row(key, stated, prefix, stages)
        return _si(stated.value, key.unit)

    def _default(self, section, key, prefix, values):
        default = key.default
        if callable(default):
            try:
                si = default({**self.beside, **values})
            except Missing as missing:
                where = f"{self.where}.{prefix}{key.name}"
                raise InputError(where, None, f"is missing; {missing}") from None
            if isinstance(si, Follows):
                self.derived[f"{prefix}{key.quantity}"] = si.how
                return si.value
            if si is None or si is REQUIRED:
                return si
            value = units.from_si(si, key.unit) if key.unit else si
            low, high = (
                sorted(factor * value for factor in key.plausible)
                if key.plausible
                else (value, value)
            )
            if key.kind == "integer":
                low, high = math.floor(low), math.ceil(high)
        else:
            value = list(default) if isinstance(default, tuple) else default
            si = _si(value, key.unit)
            low, high = key.plausible or (None, None)
        if key.because and value is not None:
            stated = Stated(value, key.because, low, high, key.choices)
            self._row(key, stated, prefix, key.stages or (section.stage,))
        return si

    def _row(self, key, stated, prefix, stages):
        name = f"{prefix}{key.name}"
        self.rows.append(
            Assumption(
                self.subject,
                self.kind,
                name,
                stated.value,
                units.label(key.unit),
                stated.because,
                stated.low,
                stated.high,
                tuple(stated.choices),
                tuple(stages),
                name,
            )
        )


def _applies(key, values):
    """Whether ``key`` is known for the kind that its section has."""
    return not key.when or values["kind"] in key.when


def _si(value, unit):
    if value is None or unit is None:
        return list(value) if isinstance(value, list) else value
    if isinstance(value, list):
        return [units.to_si(number, unit) for number in value]
    return units.to_si(value, unit)

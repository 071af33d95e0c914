"""What a file states of itself once, and what the caller states in answer to what it leaves open."""

import re
from dataclasses import replace

import numpy as np

from knitsim.errors import InputError
from knitsim.measured.names import CONDITIONS, FAMILIES, QUANTITIES, heading, plain
from knitsim.measured.table import NUMBER_UNIT, shown
from knitsim.store.sheet import number_in
from knitsim.units import COUNT_UNITS, parsed


class Answers:
    """What the caller states of a file: columns {quantity_unit: heading or number}, unit {quantity or
    heading: unit}, skip, decimal_sign ("comma" or "point"), and conditions {name: SI value}."""

    def __init__(self, where, columns, unit, skip, decimal_sign, conditions):
        self.where, self.skip = where, skip
        self.conditions = {name: value for name, value in conditions.items() if value is not None}
        self.columns, self.units = {}, {}
        for key, column in (columns or {}).items():
            one = heading(key)
            quantity = one.quantity or one.name.replace(" ", "_")
            if quantity not in QUANTITIES:
                raise InputError(
                    f"{where}: columns", repr(key),
                    f"must be a quantity with its unit, such as {example('extension')} or {example('force')}",
                )  # fmt: skip
            self.columns[quantity] = (one, column)
        for key, text in (unit or {}).items():
            # A minus turns the sign of what a machine counts the other way round.
            one = parsed(str(text).strip().removeprefix("-") or "1")
            if one is None:
                raise InputError(f"{where}: unit.{key}", repr(text), "is no unit that is known")
            sign = -1.0 if str(text).strip().startswith("-") else 1.0
            self.units[plain(str(key))] = replace(one, factor=sign * one.factor, text=str(text))
        if decimal_sign not in (None, "comma", "point"):
            raise InputError(f"{where}: decimal_sign", decimal_sign, "must be comma or point")
        self.sign = {None: None, "comma": ",", "point": "."}[decimal_sign]
        for name, value in self.conditions.items():
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"{where}: {name}", value, "must be finite and above 0")

    def states(self, quantity):
        """Whether the caller states the unit of a quantity, or of what it is derived from."""
        family = next(name for name, own in FAMILIES.items() if quantity in own)
        names = {plain(name) for name in (family, *FAMILIES[family])}
        return bool(names & {*self.units, *map(plain, self.columns)}) or bool(
            {one for one in self.units if heading(one).family == family}
        )

    def applied(self, headings):
        """The headings with the units that are stated."""
        found = []
        for one in headings:
            # Stated by the heading as it stands, its name, its family or a quantity it may be.
            names = [plain(one.text), one.name, one.family or ""]
            names += [plain(name) for name in FAMILIES.get(one.family, ())]
            unit = next((self.units[name] for name in names if name in self.units), None)
            found.append(one if unit is None else one.with_unit(unit))
        return found

    def numbers_of(self, quantity, headings):
        """Numbers of the columns that are stated for a quantity; None if none is."""
        if quantity not in self.columns:
            return None
        _, stated = self.columns[quantity]
        text = str(stated).strip()
        found = [
            i for i, one in enumerate(headings) if text and one.text.casefold() == text.casefold()
        ]
        found = found or [
            i for i, one in enumerate(headings) if plain(one.text) == plain(text) != ""
        ]
        if not found and text.isdigit() and 1 <= int(text) <= len(headings):
            found = [int(text) - 1]
        if not found:
            raise InputError(
                f"{self.where}: columns",
                repr(text),
                f"is no column; the headings are {listed(headings)}",
            )
        return found


def example(quantity):
    unit = QUANTITIES[quantity][1].replace("1/", "per_").replace("/", "_per_").replace(" ", "_")
    return f"{quantity}_{unit.replace('%', 'percent')}"


def listed(headings):
    return shown([one.text for one in headings])


def condition_value(entry, where, sign):
    """(SI value, powers of its unit) of a condition of the preamble: (line, Heading, text).

    sign: decimal sign of the file.  Raises InputError for what is no value, or could be two.
    """
    line, one, text = entry
    here, unit = f"{where}:{line}: {one.condition}", one.unit
    spelt = text
    for count in COUNT_UNITS:
        if re.match(rf"{count}\s*\d", text):
            spelt = f"{text[len(count) :].strip()} {count}"
    match = NUMBER_UNIT.match(spelt)
    if not match:
        raise InputError(here, repr(text), "must be a number")
    number, tail = match.groups()
    if tail:
        own = heading(f"count ({tail})").unit
        if own is None and unit is None:
            raise InputError(here, repr(text), "must be a number and a unit that is known")
        unit = own or unit
    powers, example, _ = CONDITIONS[one.condition]
    if unit is None:
        raise InputError(here, repr(text), f"lacks its unit: state {example}")
    if unit.powers not in powers:
        raise InputError(here, repr(unit.text), f"is no unit of it: state {example}")
    possible = {value for s in ".," if (value := number_in(number.strip(), s)) is not None}
    if len(possible) > 1 and sign and sign in number:
        possible = {number_in(number.strip(), sign)}
    if len(possible) > 1:
        raise InputError(
            here, repr(number), f"may have a decimal sign or one between thousands: state {example}"
        )
    if not possible:
        raise InputError(here, repr(number), "must be a number")
    value = possible.pop()
    if not value > 0:
        raise InputError(here, number, "must be above 0")
    return unit.to_si(value), unit.powers

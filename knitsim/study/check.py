"""Checking what a file states against the table of keys, one value at a time."""

import math
import re
from dataclasses import dataclass

from knitsim import units
from knitsim.equilibrium.pattern import Pattern
from knitsim.errors import InputError
from knitsim.study.count import count_of
from knitsim.study.schema import FABRIC, YARN
from knitsim.study.trade import MEANT
from knitsim.study.turns import check_history, check_turns

_NAME = re.compile(r"[A-Za-z0-9]([A-Za-z0-9_.+-]{0,58}[A-Za-z0-9])?")


@dataclass(frozen=True)
class Stated:
    """A value as a file states it, in the unit of its key.

    because is empty unless the value is an assumption; low and high are the plausible range of an
    assumed number, choices the alternatives of an assumed word.
    """

    value: object
    because: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple = ()


@dataclass(frozen=True)
class Points:
    """The values that a file states for one key: one, or the points of a sweep."""

    key: object
    stated: tuple
    swept: bool = False


def shown(value):
    """A value in an error message: short and on one line."""
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def check_section(section, raw, where, sweeps):
    """``raw`` (from a file) as a dict of key names to Points and of section names to such dicts.

    where: file and name of the entry, for messages.  sweeps: whether a list is a sweep.
    Raises InputError for a key that is not known and for a value that its key does not allow.
    """
    if not isinstance(raw, dict):
        right = "is empty; write {} to take every default" if raw is None else "must hold keys"
        raise InputError(where, None if raw is None else shown(raw), f"{right} ({section.about})")
    if section.named:
        for name in raw:
            check_name(name, where)
        if not raw:
            raise InputError(where, "{}", "must name at least one")
        return {
            name: _check_keys(section, entry, f"{where}.{name}", sweeps)
            for name, entry in raw.items()
        }
    return _check_keys(section, raw, where, sweeps)


def _check_keys(section, raw, where, sweeps):
    if not isinstance(raw, dict):
        raise InputError(where, None if raw is None else shown(raw), "must be keys and values")
    tree = {}
    for name, value in raw.items():
        here = f"{where}.{name}"
        if (key := section.key(name)) is not None:
            tree[name] = check_points(key, value, here, sweeps)
        elif (inner := section.section(name)) is not None:
            tree[name] = check_section(inner, value, here, sweeps)
        else:
            raise InputError(here, None, f"is no key; {_what_is_known(section, name)}")
    for inner in section.sections:
        if inner.named and inner.name not in tree:
            default = inner.default_entries
            tree[inner.name] = check_section(inner, default, where, sweeps) if default else {}
    return tree


def _what_is_known(section, name):
    """Says what an unknown key may have been meant to be."""
    names = {one.name.lower(): one.name for one in (*section.keys, *section.sections)}
    if (same := names.get(name.lower())) is not None:
        return f"the nearest is {same}"
    if (meant := MEANT.get(name.lower())) and any(section.key(one) for one in meant):
        return f"here it is called {' or '.join(one for one in meant if section.key(one))}"
    for keys in section.quantities().values():
        for key in keys:
            if key.unit and (name == key.stem or name.startswith(f"{key.stem}_")):
                known = " or ".join(other.name for other in keys)
                return f"the unit must be one that is known here: {known}"
    from difflib import get_close_matches

    if section in (YARN, FABRIC):
        for whose, other in (("yarn", YARN), ("fabric", FABRIC)):
            if other.key(name) is not None:
                return f"it is a key of the {whose}"
    near = get_close_matches(name.lower(), names, 1, 0.5)
    return (
        f"the nearest is {names[near[0]]}" if near else f"known here: {', '.join(names.values())}"
    )


def check_name(name, where):
    """Raises InputError unless ``name`` can be part of a file name on every system."""
    if not _NAME.fullmatch(name):
        raise InputError(
            f"{where}: {name}",
            None,
            "is part of file names: must be up to 60 letters, digits and _ . + -, with a letter or "
            "digit first and last",
        )


def check_points(key, raw, where, sweeps):
    """Points of ``key`` from a plain value, a list (a sweep) or a mapping with ``assumed``."""
    assumption = {}
    if isinstance(raw, dict) and key.kind not in ("mapping", "turns", "history"):
        assumption = _assumption(key, raw, where)
        raw, where = raw["assumed"], f"{where}.assumed"
    is_sweep = isinstance(raw, list) and _sweeps(key, raw)
    if is_sweep and not sweeps:
        raise InputError(
            where, shown(raw), "must be one value; lists make sweeps of yarns and fabrics only"
        )
    if is_sweep and not raw:
        raise InputError(where, "[]", "a sweep needs at least one value")
    stated = []
    for value in raw if is_sweep else [raw]:
        checked = check_value(key, value, where)
        low, high = assumption.get("low"), assumption.get("high")
        if low is not None and not low <= checked <= high:
            raise InputError(where, shown(value), f"must lie within its range, {low:g} to {high:g}")
        stated.append(Stated(checked, **assumption))
    return Points(key, tuple(stated), is_sweep)


def _sweeps(key, raw):
    """Whether a list is a sweep of the key, not one value of it."""
    if key.kind == "pattern":
        # The rows of one pattern are letters; names, and lists of rows, are patterns each.
        return any(isinstance(v, list) or set(str(v)) - {"k", "p"} for v in raw)
    if key.kind == "history":
        return any(isinstance(v, (list, str)) for v in raw)
    return not key.is_list or any(isinstance(v, list) for v in raw)


def _assumption(key, raw, where):
    """The keywords of Stated from a mapping {assumed, range, because}."""
    numeric = key.kind in ("number", "integer", "count")
    known = {"assumed", "because", "range" if numeric else "choices"}
    for name in raw:
        if name not in known:
            raise InputError(
                f"{where}.{name}", None, f"is no key; an assumption has {', '.join(sorted(known))}"
            )
    needed = ("assumed", "because", "range") if numeric else ("assumed", "because")
    for name in needed:
        if name not in raw:
            raise InputError(f"{where}.{name}", None, "is missing; every assumption states it")
    because = raw["because"]
    if not (isinstance(because, str) and because.strip()):
        raise InputError(f"{where}.because", shown(because), "must be a reason, in words")
    found = {"because": " ".join(because.split())}
    if numeric:
        limits = raw["range"]
        if not (isinstance(limits, list) and len(limits) == 2):
            raise InputError(f"{where}.range", shown(limits), "must be [low, high]")
        found["low"], found["high"] = (check_value(key, v, f"{where}.range") for v in limits)
        if not found["low"] <= found["high"]:
            raise InputError(f"{where}.range", shown(limits), "must have low first, then high")
    elif key.kind == "choice":
        choices = raw.get("choices", list(key.choices))
        if not isinstance(choices, list):
            raise InputError(f"{where}.choices", shown(choices), "must be a list")
        found["choices"] = tuple(check_value(key, v, f"{where}.choices") for v in choices)
    elif "choices" in raw:
        raise InputError(f"{where}.choices", None, f"is no key of an assumed {key.kind}")
    return found


def check_value(key, value, where):
    """``value`` as the kind of ``key``: float, int, bool, str or a list.  Raises InputError."""
    if key.kind in ("number", "integer"):
        return _check_number(key, value, where)
    if key.kind == "count":
        stated = key.unit if key.name.endswith(f"_{key.unit}") else None
        if stated and not isinstance(value, str):
            return _check_number(key, value, where)
        count = count_of(value, key.unit, where, stated)
        _check_number(key, float(count), where)
        return count
    if key.kind == "flag":
        if not isinstance(value, bool):
            raise InputError(where, shown(value), "must be true or false")
        return value
    if key.kind == "choice":
        if not isinstance(value, str) or value not in key.choices:
            raise InputError(where, shown(value), f"must be {' or '.join(key.choices)}")
        return value
    if key.kind == "text":
        if not (isinstance(value, str) and value.strip()):
            raise InputError(where, shown(value), "must be text")
        return value
    if key.kind == "mapping":
        if not isinstance(value, dict) or not value:
            raise InputError(where, shown(value), "must be names and values, in braces")
        for name, one in value.items():
            if isinstance(one, bool) or not isinstance(one, (str, int)) or not str(one).strip():
                raise InputError(f"{where}.{name}", shown(one), "must be text or a whole number")
        return {str(name): one for name, one in value.items()}
    if key.kind == "lines":
        for line in value if isinstance(value, list) else [value]:
            if isinstance(line, bool) or not isinstance(line, int) or line < 1:
                raise InputError(
                    where, shown(value), "must be a whole number from 1, or a list of them"
                )
        return value
    if key.kind in _OWN:
        return _OWN[key.kind](value, where)
    if not isinstance(value, list):
        raise InputError(where, shown(value), "must be a list, in brackets")
    if not value and not key.may_be_empty:
        raise InputError(where, "[]", "must not be empty")
    if key.kind == "numbers":
        return [_check_number(key, v, f"{where}[{i}]") for i, v in enumerate(value)]
    for i, choice in enumerate(value):
        if key.kind == "words" and not (isinstance(choice, str) and choice.strip()):
            raise InputError(f"{where}[{i}]", shown(choice), "must be a name")
        if key.kind == "choices" and choice not in key.choices:
            raise InputError(f"{where}[{i}]", shown(choice), f"must be {' or '.join(key.choices)}")
        if choice in value[:i]:
            raise InputError(f"{where}[{i}]", shown(choice), "stands twice in the list")
    return value


_OWN = {
    "pattern": lambda value, where: str(Pattern.of(value, where)),
    "turns": check_turns,
    "history": check_history,
}


def _check_number(key, value, where):
    what = key.about.rstrip(".")
    unit = f" in {units.label(key.unit)}" if key.unit else ""
    integer = key.kind == "integer"
    kind = "a whole number" if integer else "a number"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        hint = ""
        if isinstance(value, str):
            plain = value.strip().removesuffix("%")
            try:
                meant = float(plain.replace(",", "."))
                if plain != value.strip():
                    hint = ", without %" if key.unit else f"; {meant / 100.0:g} is {meant:g} %"
                else:
                    hint = " (with a decimal point)" if "," in value else " (without quotes)"
            except ValueError:
                pass
        raise InputError(where, shown(value), f"must be {kind}{unit}{hint} ({what})")
    if not math.isfinite(value):
        raise InputError(where, value, f"must be a finite number{unit} ({what})")
    if integer and value != int(value):
        raise InputError(where, shown(value), f"must be {kind} ({what})")
    if key.interval is not None and value not in key.interval:
        hundredth = key.unit is None and value >= 5.0 and value / 100.0 in key.interval
        hint = (
            f"; {value / 100.0:g} is {value:g} %" if hundredth and key.interval.high <= 5.0 else ""
        )
        raise InputError(where, shown(value), f"must be {key.interval}{unit} ({what}){hint}")
    return int(value) if integer else float(value)

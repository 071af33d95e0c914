"""Yarn counts as the trade writes them: ``30/1``, ``2/28 Nm``, ``30/2 Ne``, ``150/48 den``, ``Ne=30``.

>>> two = count_of("2/28 Nm", "tex", "yarn.count")
>>> round(float(two), 2), two.how
(71.43, '2 plies of 28 Nm')
>>> count_of("150/48 den", "den", "yarn.count").filaments
48
"""

import math
import re

from knitsim import units
from knitsim.errors import InputError

MOST_PLIES = 12
_NAMES = {
    "ne": "Ne", "nec": "Ne", "cc": "Ne", "s": "Ne", "nm": "Nm", "mc": "Nm", "tex": "tex",
    "dtex": "dtex", "decitex": "dtex", "den": "den", "denier": "den", "d": "den", "td": "den",
}  # fmt: skip
_UNIT = "|".join(sorted(_NAMES, key=len, reverse=True))
_NUMBER = r"\d+(?:\.\d+)?"
_WRITTEN = re.compile(
    rf"(?P<before>{_UNIT})?[\s.=:]*(?P<numbers>{_NUMBER}(?:\s*[/xf*]\s*f?{_NUMBER})*)\s*(?P<after>{_UNIT})?",
    re.IGNORECASE,
)
_ENDS = re.compile(r"(\d+)\s*(d|den|dtex)\s*/\s*(\d+)\s*f?", re.IGNORECASE)  # 150D/48F
_HOW = "such as 30/1, 30/2 Ne, 2/28 Nm, 150/48 den, 167f48 dtex or 20 tex"


class Count(float):
    """A yarn count in the unit of its key, of all plies together.

    filaments: of the whole yarn, None where they are not told; how: what was read, in words, empty for a
    plain number.
    """

    filaments: int | None = None
    how: str = ""


def count_of(value, unit, where, stated=None):
    """The :class:`Count` in ``unit`` that ``value``, a number or a text, states.

    stated: the unit that the key's name says; the text may repeat it.  In Ne and Nm the smaller number
    around the slash counts plies, in den and dtex what follows counts filaments.  A bare ``30/1`` is an
    English cotton count.  Raises InputError for what can be read in two ways.
    """
    if not isinstance(value, str):
        if stated is None:
            raise InputError(where, value, f"must say its unit, {_HOW}")
        return Count(value)
    text = value.strip().replace("\u00d7", "x")
    text = _ENDS.sub(r"\1f\3 \2", text)
    found = _WRITTEN.fullmatch(text)
    if found is None or (found["before"] and found["after"]):
        raise InputError(where, repr(value), f"is no yarn count; write it {_HOW}")
    named = found["before"] or found["after"]
    named = _NAMES[named.lower()] if named else stated
    if stated and named != stated:
        raise InputError(where, repr(value), f"states {named}, but the key says {stated}; keep one")
    marks = re.findall(r"[/xf*]", found["numbers"].lower().replace("/f", "f").replace(" f", "f"))
    numbers = [float(one) for one in re.findall(_NUMBER, found["numbers"])]
    if named is None:
        named = _unit_of(numbers, marks, value, where)
    if any(not one > 0.0 for one in numbers):
        raise InputError(where, repr(value), f"must be above 0, {_HOW}")
    plies, filaments, size = _parts(numbers, marks, named, value, where)
    si = plies * units.to_si(size, named)
    count = Count(units.from_si(si, unit))
    if filaments is not None:
        count.filaments = round(plies * filaments)
    told = [f"{plies:g} plies of " if plies > 1 else "", f"{size:g} {named}"]
    told += [f" with {filaments:g} filaments" if filaments is not None else ""]
    count.how = "".join(told)
    return count


def _unit_of(numbers, marks, value, where):
    """The unit of a text that names none."""
    if marks == ["/"] and numbers[1] < numbers[0] and numbers[1] <= 4 and numbers[1] % 1 == 0:
        return "Ne"
    if len(numbers) == 1:
        raise InputError(where, repr(value), f"must say its unit, {_HOW}")
    raise InputError(
        where, repr(value), "does not say its unit: Ne, Nm, den or dtex? Write it, " + _HOW
    )


def _parts(numbers, marks, unit, value, where):
    """(plies, filaments of a ply or None, count of a ply)."""
    if len(numbers) == 1:
        return 1.0, None, numbers[0]
    if unit in ("Ne", "Nm"):
        if len(numbers) == 2 and marks[0] in "/x*":
            plies, size = sorted(numbers)
            if plies <= MOST_PLIES and plies % 1 == 0:
                return plies, None, size
        raise InputError(
            where,
            repr(value),
            f"must be count and plies, at most {MOST_PLIES}, such as 30/2 {unit}",
        )
    if unit == "tex" and marks == ["/"]:
        raise InputError(
            where, repr(value),
            f"is read in two ways: write {numbers[0]:g}x{numbers[1]:g} tex for {numbers[1]:g} plies of "
            f"{numbers[0]:g} tex, or {numbers[0]:g} tex for the whole",
        )  # fmt: skip
    plies, filaments, size = 1.0, None, numbers[0]
    for number, mark in zip(numbers[1:], marks, strict=True):
        if mark in "x*" or filaments is not None:
            plies *= number
        elif number > MOST_PLIES or mark == "f":
            filaments = number
        else:
            # 78/2: two ends of 78; few yarns have as few filaments.
            raise InputError(
                where, repr(value),
                f"is read in two ways: write {size:g}f{number:g} {unit} for {number:g} filaments, or "
                f"{size:g}x{number:g} {unit} for {number:g} plies",
            )  # fmt: skip
    if plies % 1 or plies > MOST_PLIES or (filaments or 1) % 1 or not math.isfinite(size):
        raise InputError(where, repr(value), f"must be whole plies and filaments, {_HOW}")
    return plies, filaments, size

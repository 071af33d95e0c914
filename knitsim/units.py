"""Textile units to SI and back: the only place in knitsim where a unit is converted.

Inside the package everything is SI (m, N, kg, s, rad).  A configuration key carries its unit as the
last part of its name (``loop_length_mm``); :data:`TO_SI` maps that part to a factor.  :func:`parsed`
reads a unit as machines and people write it: ``[gf.cm/cm]``, ``cm-1``, ``N/5cm``.
"""

import math
import re
from dataclasses import dataclass

G0 = 9.80665  # standard gravity, m s-2: 1 gf = 9.80665e-3 N
INCH = 0.0254
POUND = 0.45359237
YARD = 0.9144

# Factor that turns a number in the unit into SI.
TO_SI = {
    "mm": 1e-3,
    "um": 1e-6,
    "m": 1.0,
    "mm_per_N": 1e-3,
    "um_per_N": 1e-6,
    "mm_per_s": 1e-3,
    "mm_per_min": 1e-3 / 60.0,
    "N": 1.0,
    "cN": 1e-2,
    "mN": 1e-3,
    "gf": 1e-3 * G0,
    "N_per_m": 1.0,
    "N_per_mm": 1e3,
    "gf_per_cm": 1e-3 * G0 / 1e-2,
    "N_per_mm3": 1e9,
    "N_per_mm2": 1e6,
    "MPa": 1e6,
    "GPa": 1e9,
    "N_m2": 1.0,
    "N_mm2": 1e-6,
    "per_cm": 1e2,
    "per_mm": 1e3,
    "mN_mm": 1e-6,
    "gf_cm2_per_cm": 1e-3 * G0 * 1e-2,
    "per_m": 1.0,
    "per_inch": 1.0 / INCH,
    "g_per_cm3": 1e3,
    "g_per_m2": 1e-3,
    "N_per_tex": 1e6,
    "N_s_per_m": 1.0,
    "percent": 1e-2,
    "deg": math.pi / 180.0,
    # Direct yarn counts, to kg m-1.
    "dtex": 1e-7,
    "tex": 1e-6,
    "den": 1e-3 / 9000.0,
}

# Indirect units: the SI value is factor / number.
INDIRECT = {
    "Ne": POUND / (840.0 * YARD),  # English cotton count, hanks of 840 yd per lb, to kg m-1
    "Nm": 1e-3,  # metric count, m per g, to kg m-1
    "loops_per_cm": 1e-2,  # wales or courses per cm, to the spacing in m
    "loops_per_inch": INCH,
}

COUNT_UNITS = ("dtex", "tex", "den", "Ne", "Nm")


def to_si(value, unit):
    """``value`` (a number or array) in ``unit`` (a key of TO_SI or of INDIRECT), in SI.

    Raises KeyError for an unknown unit.
    """
    if unit in INDIRECT:
        return INDIRECT[unit] / value
    return value * TO_SI[unit]


def from_si(value, unit):
    """The inverse of :func:`to_si`."""
    if unit in INDIRECT:
        return INDIRECT[unit] / value
    return value / TO_SI[unit]


# Powers of force, length, linear density and time.
FORCE, LENGTH, COUNT, TIME = (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)
NONE = (0, 0, 0, 0)
# Symbols that a written unit is made of.  A mass stands for its weight.
_SYMBOLS = {
    FORCE: {
        "N": 1.0, "mN": 1e-3, "cN": 1e-2, "daN": 10.0, "kN": 1e3, "uN": 1e-6, "dyn": 1e-5,
        "g": 1e-3 * G0, "gf": 1e-3 * G0, "p": 1e-3 * G0, "kg": G0, "kgf": G0, "kp": G0,
        "mg": 1e-6 * G0, "mgf": 1e-6 * G0, "lb": POUND * G0, "lbf": POUND * G0, "lbs": POUND * G0,
        "oz": POUND * G0 / 16.0, "ozf": POUND * G0 / 16.0,
    },
    LENGTH: {
        "m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": INCH, "ft": 12.0 * INCH,
        "yd": YARD,
    },
    COUNT: {"tex": 1e-6, "dtex": 1e-7, "ktex": 1e-3, "mtex": 1e-9, "den": 1e-3 / 9000.0},
    TIME: {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
    NONE: {"%": 1e-2, "percent": 1e-2, "\u2030": 1e-3},
}  # fmt: skip
_WORDS = {
    "newton": "N", "newtons": "N", "gram": "gf", "grams": "gf", "gramm": "gf", "gms": "gf",
    "grm": "gf", "pound": "lbf", "pounds": "lbf", "inch": "in", "inches": "in", "zoll": "in",
    "pouce": "in", "pouces": "in", '"': "in", "millimeter": "mm", "millimetre": "mm",
    "centimeter": "cm", "centimetre": "cm", "meter": "m", "metre": "m", "denier": "den",
    "sec": "s", "sek": "s", "second": "s", "seconds": "s", "sekunden": "s", "minute": "min",
    "hr": "h", "pct": "percent", "prozent": "percent",
}  # fmt: skip
_KNOWN = {
    symbol: (factor, powers)
    for powers, symbols in _SYMBOLS.items()
    for symbol, factor in symbols.items()
}
# Written all in capitals or small letters; MN may be a meganewton and stays unknown.
_FOLDED = {symbol.lower(): symbol for symbol in _KNOWN} | _WORDS
_SPELT = {
    "\xb5": "u", "\u03bc": "u", "\u207b\xb9": "-1", "\xb2": "2", "\xb3": "3", "**": "^", "*": ".",
    "\xb7": ".", "\u22c5": ".", "\u2022": ".", "\xd7": ".", "\u2212": "-", "\u2013": "-",
    "gram-force": "gf", "gramforce": "gf", "pound-force": "lbf", "per cent": "percent",
    "pour cent": "percent",
}  # fmt: skip
_TOKEN = re.compile(r"(\d+(?:[.,]\d+)?)|([A-Za-z%\u2030\"]+)(?:\^?(-?[1-9])(?!\d))?|([/.()])|\s+")


@dataclass(frozen=True)
class Unit:
    """A unit as read: factor to SI (nan of an indirect one), powers of force, length, linear density and
    time, its text."""

    factor: float
    powers: tuple
    text: str

    def to_si(self, value):
        return to_si(value, self.text) if self.text in INDIRECT else value * self.factor


def parsed(text):
    """The :class:`Unit` that ``text`` spells, with or without brackets around it; None for no unit.

    ``-`` and ``1`` are the unit of a plain number; a mass (g, kg, lb) stands for its weight.
    """
    plain = text.strip()
    while len(plain) > 1 and plain[0] + plain[-1] in ("()", "[]", "<>", "{}"):
        plain = plain[1:-1].strip()
    if plain in ("-", "1", "--"):
        return Unit(1.0, NONE, text.strip())
    for spelt, sign in _SPELT.items():
        plain = plain.replace(spelt, sign)
    # gf-cm/cm, but cm-1.
    plain = re.sub(r"(?<=[A-Za-z])-(?=[A-Za-z])", ".", plain)
    plain = re.sub(r"(^|\s)per\s+", " / ", plain).strip().rstrip(".")
    found = _product(plain)
    return None if found is None else Unit(*found, text.strip())


def _product(text):
    """(factor, powers) of a text of symbols, numbers, points and slashes; None if it is none."""
    factor, powers, sign, at, symbols, group = 1.0, [0, 0, 0, 0], 1, 0, 0, 0
    if text.startswith("/"):
        text = "1" + text
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            return None
        begun, at = at, match.end()
        number, symbol, exponent, mark = match.groups()
        if mark == "/":
            sign = -1
        elif mark == "(":
            group = sign
        elif mark == ")":
            group = 0
            sign = 1
        elif number:
            # 1/cm and N/5cm are units, 5 N is a value.
            before = text[:begun].rstrip()
            if before[-1:] not in ("/", "(") and (before or number != "1"):
                return None
            factor *= float(number.replace(",", ".")) ** sign
        elif symbol:
            one = _symbol(symbol)
            if one is None:
                return None
            power = sign * int(exponent or 1)
            factor *= one[0] ** power
            powers = [p + power * q for p, q in zip(powers, one[1], strict=True)]
            symbols += 1
            # N/5cm: the number and the symbol behind the slash; what follows is above it again.
            sign = group or 1
    return (factor, tuple(powers)) if symbols else None


def _symbol(text):
    """(factor, powers) of one symbol, or of two without a sign between them, such as gfcm."""
    if text in _KNOWN:
        return _KNOWN[text]
    folded = _FOLDED.get(text.lower())
    if folded is not None and text != "MN":
        return _KNOWN[folded]
    for cut in range(1, len(text)):
        force, length = text[:cut], text[cut:]
        if force in ("N", "mN", "cN", "uN", "gf", "kgf") and length in ("m", "cm", "mm"):
            return _KNOWN[force][0] * _KNOWN[length][0], (1, 1, 0, 0)
    return None


def label(unit):
    """How a unit is written in tables and on axes: ``N_per_m`` as N/m; None, no unit, as 1."""
    if unit is None:
        return "1"
    over = unit.removeprefix("per_")
    text = over.replace("_per_", "/").replace("_", " ")
    return text if over == unit else f"1/{text}"


# SI units of a calibrated parameter, and those in which its key states it.
READ_IN = {"m": "mm", "N m2": "N_mm2", "N m-3": "N_per_mm3", "N m-1": "N_per_m"}


def value_text(value, units):
    """A parameter's value (SI) in the unit of its key, and that unit as it is written, both as text."""
    unit = READ_IN.get(units)
    number = f"{from_si(value, unit) if unit else value:.3g}"
    return number, label(unit) if unit else ""


def peirce_diameter(linear_density):
    """Yarn diameter (m) after Peirce, 1/(28 sqrt(Ne)) inch, from the linear density (kg m-1).

    F. T. Peirce, J. Text. Inst. 28 (1937) T45: a cotton yarn of specific volume 1.1 cm3/g.
    """
    return INCH / (28.0 * math.sqrt(from_si(linear_density, "Ne")))


def twist_from_multiplier(linear_density, multiplier):
    """Twist (turns m-1) from the linear density (kg m-1) and the English twist multiplier.

    The multiplier is turns per inch over sqrt(Ne).
    """
    return multiplier * math.sqrt(from_si(linear_density, "Ne")) / INCH

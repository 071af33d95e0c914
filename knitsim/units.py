"""Textile units to SI and back: the only place in knitsim where a unit is converted.

Inside the package everything is SI (m, N, kg, s, rad).  A configuration key carries its unit as the
last part of its name (``loop_length_mm``); :data:`TO_SI` maps that part to a factor.
"""

import math

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


def label(unit):
    """How a unit is written in tables and on axes: ``N_per_m`` as N/m; None, no unit, as 1."""
    if unit is None:
        return "1"
    over = unit.removeprefix("per_")
    text = over.replace("_per_", "/").replace("_", " ")
    return text if over == unit else f"1/{text}"


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

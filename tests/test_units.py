"""Conversions against definitions of the units, written out independently."""

import math
from fractions import Fraction

import numpy as np
import pytest

from knitsim import units
from knitsim.units import COUNT, FORCE, LENGTH, NONE, TO_SI, label, parsed

# kg per m of a yarn of which 1 unit of length weighs 1 unit of mass, from the definitions:
# Ne: hanks of 840 yards (1 yd = 0.9144 m) to the pound (0.45359237 kg).
NE = Fraction("0.45359237") / (840 * Fraction("0.9144"))


@pytest.mark.parametrize(
    ("number", "unit", "kg_per_m"),
    [
        (333.33, "dtex", Fraction("333.33") / 10_000 / 1000),
        (20, "tex", Fraction(20, 1000) / 1000),
        (150, "den", Fraction(150, 9000) / 1000),
        (30, "Ne", NE / 30),
        (50, "Nm", Fraction(1, 50) / 1000),
    ],
)
def test_yarn_counts(number, unit, kg_per_m):
    assert units.to_si(number, unit) == pytest.approx(float(kg_per_m), rel=1e-15)
    assert unit in units.COUNT_UNITS


def test_one_yarn_has_one_count_in_all_systems():
    # The textbook relations tex x Ne = 590.54, tex x Nm = 1000, den = 9 tex, dtex = 10 tex.
    tex = 25.0
    linear_density = units.to_si(tex, "tex")
    assert units.from_si(linear_density, "Ne") * tex == pytest.approx(590.54, abs=5e-3)
    assert units.from_si(linear_density, "Nm") * tex == pytest.approx(1000.0, rel=1e-14)
    assert units.from_si(linear_density, "den") == pytest.approx(9 * tex, rel=1e-14)
    assert units.from_si(linear_density, "dtex") == pytest.approx(10 * tex, rel=1e-14)


@pytest.mark.parametrize(
    ("number", "unit", "si"),
    [
        (1, "gf", 9.80665e-3),
        (500, "gf_per_cm", 490.3325),
        (1, "cN", 0.01),
        (500, "mm_per_min", 0.5 / 60),
        (2.5, "per_cm", 250.0),
        (10, "per_inch", 10 / 0.0254),
        (1, "N_per_mm3", 1e9),
        (5e-3, "N_mm2", 5e-9),
        (1.38, "g_per_cm3", 1380.0),
        (180, "deg", math.pi),
        (6.67, "loops_per_cm", 1.0 / 667),
        (25.4, "loops_per_inch", 1e-3),
    ],
)
def test_other_units(number, unit, si):
    assert units.to_si(number, unit) == pytest.approx(si, rel=1e-14)


@pytest.mark.parametrize("unit", [*units.TO_SI, *units.INDIRECT])
def test_back_and_forth(unit):
    values = np.array([1e-3, 0.7, 1.0, 812.5])
    there = units.to_si(values, unit)
    assert (
        not np.array_equal(there, values)
        or unit in ("m", "N", "N_per_m", "N_m2", "per_m")
        or (unit == "N_s_per_m")
    )
    np.testing.assert_allclose(units.from_si(there, unit), values, rtol=1e-14)


def test_unknown_unit():
    with pytest.raises(KeyError):
        units.to_si(1.0, "furlong")


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        (None, "1"), ("mm", "mm"), ("N_per_m", "N/m"), ("N_mm2", "N mm2"), ("per_cm", "1/cm"),
        ("N_s_per_m", "N s/m"), ("mm_per_s", "mm/s"),
    ],
)  # fmt: skip
def test_label(unit, text):
    assert units.label(unit) == text


def test_peirce_diameter():
    # 1/28 inch at Ne 1, and the paper's cotton, 559.86 dtex: 0.2793 mm.
    assert units.peirce_diameter(units.to_si(1, "Ne")) == pytest.approx(0.0254 / 28, rel=1e-14)
    assert units.peirce_diameter(559.86e-7) == pytest.approx(0.2793e-3, abs=5e-8)


def test_twist_multiplier():
    # Ne 25 at multiplier 4: 20 turns per inch.
    linear_density = units.to_si(25, "Ne")
    assert units.twist_from_multiplier(linear_density, 4.0) * 0.0254 == pytest.approx(20.0)


READ = {
    # Force (N), length (m), their quotients and products.
    "N": (1.0, FORCE), "cN": (1e-2, FORCE), "mN": (1e-3, FORCE), "kN": (1e3, FORCE), "KN": (1e3, FORCE),
    "gf": (9.80665e-3, FORCE), "g": (9.80665e-3, FORCE), "kgf": (9.80665, FORCE),
    "lbf": (4.4482216152605, FORCE), "(mm)": (1e-3, LENGTH), "[in]": (0.0254, LENGTH),
    '"': (0.0254, LENGTH), "µm": (1e-6, LENGTH), "cm-1": (100.0, (0, -1, 0, 0)),
    "1/cm": (100.0, (0, -1, 0, 0)), "cm⁻¹": (100.0, (0, -1, 0, 0)), "cm^-1": (100.0, (0, -1, 0, 0)),
    "per cm": (100.0, (0, -1, 0, 0)), "N/5cm": (20.0, (1, -1, 0, 0)), "N/50 mm": (20.0, (1, -1, 0, 0)),
    "N per mm": (1e3, (1, -1, 0, 0)), "gf/cm": (0.980665, (1, -1, 0, 0)),
    "gf.cm/cm": (9.80665e-3, FORCE), "gf*cm/cm": (9.80665e-3, FORCE), "gf cm/cm": (9.80665e-3, FORCE),
    "gf·cm/cm": (9.80665e-3, FORCE), "gf-cm/cm": (9.80665e-3, FORCE), "gfcm/cm": (9.80665e-3, FORCE),
    "cN cm/cm": (1e-2, FORCE), "uN m/m": (1e-6, FORCE), "gf cm": (9.80665e-5, (1, 1, 0, 0)),
    "N/(5 cm)": (20.0, (1, -1, 0, 0)),
    # Linear density (kg/m), and force over it.
    "tex": (1e-6, COUNT), "cN/tex": (1e4, (1, 0, -1, 0)), "cN/dtex": (1e5, (1, 0, -1, 0)),
    "g/den": (9.80665e-3 * 9e6, (1, 0, -1, 0)), "N/tex": (1e6, (1, 0, -1, 0)),
    "%": (1e-2, NONE), "mm/mm": (1.0, NONE), "-": (1.0, NONE), "1": (1.0, NONE), "1/s": (1.0, (0, 0, 0, -1)),
}  # fmt: skip


@pytest.mark.parametrize("text", READ)
def test_units_are_read_as_they_are_written(text):
    factor, powers = READ[text]
    found = parsed(text)
    assert found.powers == powers and found.factor == pytest.approx(factor, rel=1e-12)
    assert found.to_si(2.0) == pytest.approx(2.0 * factor)


@pytest.mark.parametrize(
    "text", ["", "MN", "furlong", "Kraft", "5 N", "12.3", "N2O", "°C", "()", "N mm 3"]
)
def test_what_is_no_unit_is_none(text):
    assert parsed(text) is None


def test_every_unit_of_the_keys_is_read_as_it_is_labelled():
    for name, factor in TO_SI.items():
        found = parsed(label(name))
        # A mass over a volume or an area, a stress and an angle are no units of a measured curve.
        if name not in ("g_per_cm3", "g_per_m2", "MPa", "GPa", "deg"):
            assert found.factor == pytest.approx(factor, rel=1e-12), name

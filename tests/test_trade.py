"""What textile people state: counts, tightness, mass per area, density; each against its formula by hand."""

import math

import pytest

import knitsim as ks
from knitsim.errors import InputError
from knitsim.stages.yarn import layout_of
from knitsim.study.count import count_of

# tex of 1 Ne = 590.5412 (840 yd of 0.9144 m, lb of 453.59237 g), of 1 Nm = 1000, of 1 den = 1/9.
NE = 453.59237 / (840 * 0.9144) * 1000

COUNTS = (
    ("30/1", NE / 30, None), ("30/2 Ne", 2 * NE / 30, None), ("2/28 Nm", 2 * 1000 / 28, None),
    ("28/2 Nm", 2 * 1000 / 28, None), ("Nm 2/28", 2 * 1000 / 28, None), ("150/48 den", 150 / 9, 48),
    ("150D/48F", 150 / 9, 48), ("150/48/2 den", 300 / 9, 96), ("Ne=30", NE / 30, None),
    ("Ne 30", NE / 30, None), ("30s", NE / 30, None), ("167f48 dtex", 16.7, 48), ("20 tex", 20, None),
    ("20x2 tex", 40, None), ("30.5 Nm", 1000 / 30.5, None), ("NeC 24/1", NE / 24, None),
)  # fmt: skip


@pytest.mark.parametrize(("text", "tex", "filaments"), COUNTS, ids=[one[0] for one in COUNTS])
def test_counts(text, tex, filaments):
    found = count_of(text, "tex", "yarn.count")
    assert float(found) == pytest.approx(tex, rel=1e-6)
    assert found.filaments == filaments and found.how
    yarn = ks.Yarn(count=text)
    assert yarn["linear_density"] == pytest.approx(1e-6 * tex, rel=1e-6)
    if filaments:
        assert yarn["fibres"] == filaments and "fibres" not in [
            row.key for row in yarn.assumptions()
        ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("150/48", "does not say its unit"), ("2/28", "does not say its unit"), ("40", "must say its unit"),
        ("20/2 tex", "is read in two ways"), ("78/2 dtex", "is read in two ways"),
        ("thick", "is no yarn count"), ("40/20 Ne", "must be count and plies"), ("0 Ne", "must be above 0"),
    ],
)  # fmt: skip
def test_counts_that_are_asked_about(text, words):
    with pytest.raises(InputError, match=words):
        ks.Yarn(count=text)


def test_a_count_key_takes_plies_of_its_own_unit_only():
    assert ks.Yarn(count_Ne="30/2")["linear_density"] == pytest.approx(1e-6 * 2 * NE / 30, rel=1e-6)
    assert ks.Yarn(count_den="150/48")["fibres"] == 48
    with pytest.raises(InputError, match="states Nm, but the key says Ne"):
        ks.Yarn(count_Ne="2/28 Nm")
    with pytest.raises(InputError, match="must say its unit"):
        ks.Yarn(count=30)


def test_loop_length_from_what_is_stated():
    yarn = ks.Yarn(count_tex=19.7)
    tight = ks.Fabric(yarn, tightness_factor=14.5)
    assert tight["loop_length"] == pytest.approx(1e-2 * math.sqrt(19.7) / 14.5)
    assert "tightness factor 14.5" in tight.derived["loop_length"]
    # 140 g/m2 = 14 x 20 loops/cm2 x length x 19.7 g/km.
    for key in ("mass_per_area_g_per_m2", "gsm"):
        heavy = ks.Fabric(yarn, wales_per_cm=14, courses_per_cm=20, **{key: 140})
        assert 14e2 * 20e2 * heavy["loop_length"] * 19.7e-6 == pytest.approx(0.140)
    # It follows the count, and gives way to a length that is stated.
    doubled = tight.with_value("yarn.count_tex", 4 * 19.7)
    assert doubled["loop_length"] == pytest.approx(2 * tight["loop_length"])
    assert tight.with_value("loop_length_mm", 3)["loop_length"] == 3e-3
    for keys, words in (
        ({"tightness_factor": 14, "loop_length_mm": 3}, "same quantity as loop_length_mm"),
        ({"tightness_factor": 14, "gsm": 140}, "same quantity as tightness_factor"),
        ({"gsm": 140, "wales_per_cm": 14}, "with both wales_per_cm and courses_per_cm"),
        (
            {"wales_per_cm": 14, "courses_per_cm": 20},
            "give loop_length_mm, or tightness_factor, or mass",
        ),
    ):
        with pytest.raises(InputError, match=words):
            ks.Fabric(yarn, **keys)


def test_density_from_either_alone_is_assumed_and_rest_does_not_depend_on_it():
    yarn = ks.Yarn(count_tex=20, bending_rigidity_N_mm2=2e-3)
    alone = ks.Fabric(yarn, loop_length_mm=2.9)
    assert alone["loop_length"] / alone["course_spacing"] == pytest.approx(5.3)
    assert {"wales_per_cm", "courses_per_cm"} <= {row.key for row in alone.assumptions()}
    half = ks.Fabric(yarn, wales_per_cm=13, loop_length_mm=2.9)
    assert "wales_per_cm" not in {row.key for row in half.assumptions()}
    whole = ks.Fabric(yarn, wales_per_cm=13, courses_per_cm=19, loop_length_mm=2.9)
    spacings = {ks.relax(one, points=48).wale_spacing for one in (alone, half, whole)}
    assert len(spacings) == 1


def test_exchanged_wales_and_courses_are_asked_about():
    yarn = ks.Yarn(count_Ne=30)
    stated = {"wales_per_inch": 52, "courses_per_inch": 36, "loop_length_mm": 2.75}
    with pytest.raises(InputError, match="are they exchanged"):
        ks.Fabric(yarn, **stated)
    assert ks.Fabric(yarn, **stated, density_checked=True)["wale_spacing"] == pytest.approx(
        0.0254 / 52
    )


@pytest.mark.parametrize(
    ("stated", "meant"),
    [
        ({"loop_length_mm": 0.29}, "loop_length_mm: 2.9"),
        ({"loop_length_mm": 29.0}, "loop_length_mm: 2.9"),
        ({"loop_length_mm": 0.114}, "loop_length_mm: 2.896"),
        (
            {"loop_length_mm": 2.9, "wales_per_cm": 36, "courses_per_cm": 50},
            "wales_per_inch: 36, courses_per_inch: 50",
        ),
        (
            {"tightness_factor": 15, "wales_per_cm": 36, "courses_per_cm": 50},
            "wales_per_inch: 36, courses_per_inch: 50",
        ),
        (
            {"gsm": 150, "wales_per_cm": 36, "courses_per_cm": 50},
            "wales_per_inch: 36, courses_per_inch: 50",
        ),
    ],
)
def test_a_loop_in_another_unit_than_its_density_is_asked_about(stated, meant):
    stated = {"wales_per_cm": 14, "courses_per_cm": 20} | stated
    with pytest.raises(InputError, match=f"is {meant}.* meant"):
        ks.Fabric(ks.Yarn(count_Ne=30), **stated)
    assert ks.Fabric(ks.Yarn(count_Ne=30), **stated, density_checked=True)


@pytest.mark.parametrize(
    ("density", "fibre"),
    [(0.91, "polypropylene"), (1.14, "nylon"), (1.17, "acrylic"), (1.31, "wool"), (1.38, "polyester"),
     (1.52, "cotton"), (7.9, "steel")],
)  # fmt: skip
def test_the_default_diameter_holds_the_fibres(density, fibre):
    yarn = ks.Yarn(count_tex=20, fibres=100, density_g_per_cm3=density)
    share = 4 * 20e-6 / (math.pi * yarn["diameter"] ** 2 * 1e3 * density)
    assert share == pytest.approx(0.6, abs=2e-3)
    assert layout_of(yarn).fibres == 100
    peirce = 25.4e-3 / 28 / math.sqrt(NE / 20)
    assert yarn["diameter"] == pytest.approx(peirce * math.sqrt(1.52 / density), rel=1e-6)


def test_a_monofilament_has_its_true_diameter():
    yarn = ks.Yarn(count_tex=35, fibres=1, density_g_per_cm3=1.12)
    true = math.sqrt(4 * 35e-6 / (math.pi * 1120))
    assert yarn["diameter"] == pytest.approx(true) and "diameter_mm" not in [
        r.key for r in yarn.assumptions()
    ]
    # Solid: E pi d^4/64.
    assert yarn["bending_rigidity"] == pytest.approx(8e9 * math.pi * true**4 / 64)
    assert (
        ks.Yarn(count_tex=140, fibres=1, density_g_per_cm3=7.9, diameter_mm=0.15)["diameter"]
        == 0.15e-3
    )
    with pytest.raises(InputError, match=r"diameter_mm = 0.1: must be at least 0.1995 mm"):
        ks.Yarn(count_tex=35, fibres=1, density_g_per_cm3=1.12, diameter_mm=0.1)
    assert (
        layout_of(ks.Yarn(count_tex=140, fibres=1, density_g_per_cm3=7.9, diameter_mm=0.15)).fibres
        == 1
    )


def test_fibres_have_no_ceiling_where_none_is_drawn():
    fabric = ks.Fabric(ks.Yarn(count_tex=350, fibres=3000), loop_length_mm=11)
    assert ks.relax(fabric, points=48).kc > 4
    with pytest.raises(InputError, match="whole number from 1 to 1000"):
        layout_of(fabric.yarn)
    # What nobody stated is never refused.
    assert layout_of(ks.Yarn(count_tex=2000)).fibres == 1000


@pytest.mark.parametrize(
    ("stated", "right"),
    [
        ("linear_density_tex", "count_tex"), ("denier", "count_den"), ("titre_dtex", "count_dtex"),
        ("Ne", "count_Ne"), ("filaments", "fibres"), ("mu", "friction"), ("tpi", "twist_per_inch"),
        ("yarn_count", "count"), ("material", "density_g_per_cm3 or fibre_modulus_GPa"),
    ],
)  # fmt: skip
def test_names_of_the_trade_of_a_yarn(stated, right):
    with pytest.raises(InputError, match=f"is no key; here it is called {right}$"):
        ks.Yarn(count_tex=20, **{stated: 1})


@pytest.mark.parametrize(
    ("stated", "right"),
    [
        ("stitch_length_mm", "loop_length_mm"), ("grammage", "mass_per_area_g_per_m2"),
        ("cover_factor", "tightness_factor"), ("wpi", "wales_per_inch"), ("cpc", "courses_per_cm"),
        ("loop_length_cm", "loop_length_mm"),
    ],
)  # fmt: skip
def test_names_of_the_trade_of_a_fabric(stated, right):
    with pytest.raises(InputError, match=rf"is no key; .*{right}$"):
        ks.Fabric(ks.Yarn(count_tex=20), **{stated: 3})


def test_a_yarn_without_a_law_has_an_assumed_one():
    from knitsim.stages.laws import stated_law

    yarn = ks.Yarn(count_tex=20)
    law = stated_law(yarn)
    assert law.strain.tolist() == [0.0, 0.07]
    assert law.tension[-1] == pytest.approx(2.0 * 20 * 0.07)  # N/tex x tex x strain
    assert "modulus_N_per_tex" in {row.key for row in yarn.assumptions()}
    own = {"kind": "points", "strain": [0, 0.1], "tension_N": [0, 3]}
    assert ks.Yarn(count_tex=20, tension_law=own)["modulus"] is None
    with pytest.raises(InputError, match="gives the same law as tension_law"):
        ks.Yarn(count_tex=20, tension_law=own, modulus_N_per_tex=3)

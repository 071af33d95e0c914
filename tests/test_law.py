"""Tension laws against a slow twin, closed forms and the paper's numbers."""

import itertools

import numpy as np
import pytest
from scipy import integrate

from knitsim.errors import InputError
from knitsim.yarn.law import PAPER_K3, TensionLaw, bilinear, paper_k3, secant

LAWS = {
    "printed": paper_k3(continuous=False),
    "continuous": paper_k3(continuous=True),
    "polyester": bilinear(6.34, 2.41, 0.02, 0.08),
    "four segments": TensionLaw([0, 0.01, 0.02, 0.05, 0.06], [0, 1.0, 1.0, 4.0, 4.5]),
    "two jumps": TensionLaw([0, 0.01, 0.01, 0.03, 0.03, 0.05], [0, 1.0, 1.5, 2.0, 2.5, 6.0]),
}
# Strains below zero, inside, at vertices and beyond the ends; both sides of every vertex.
STRAINS = np.unique(
    np.concatenate(
        [np.linspace(-0.02, 0.12, 57)]
        + [law.strain + shift for law in LAWS.values() for shift in (-1e-9, 0.0, 1e-9)]
    )
)


def slow_tension(law, e):
    """The law read off its list of points, one segment after the other."""
    points = list(zip(law.strain.tolist(), law.tension.tolist(), strict=True))
    segments = [pair for pair in itertools.pairwise(points) if pair[0][0] < pair[1][0]]
    chosen = segments[-1]
    for segment in reversed(segments):
        if e <= segment[1][0]:
            chosen = segment
    (e0, n0), (e1, n1) = chosen
    return n0 + (n1 - n0) / (e1 - e0) * (e - e0), (n1 - n0) / (e1 - e0)


@pytest.mark.parametrize("name", LAWS)
def test_tension_and_stiffness_match_the_slow_twin(name):
    law = LAWS[name]
    slow = np.array([slow_tension(law, e) for e in STRAINS])
    np.testing.assert_allclose(law.tension_at(STRAINS), slow[:, 0], rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(law.stiffness_at(STRAINS), slow[:, 1], rtol=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_energy_is_the_integral_of_the_tension(name):
    law = LAWS[name]
    for e in (-0.013, 0.004, 0.01, 0.0174, 0.03, 0.055, 0.11):
        corners = [c for c in np.unique(law.strain) if min(0, e) < c < max(0, e)]
        ends = [0.0, *corners, e]
        parts = [
            integrate.quad(lambda x: slow_tension(law, x)[0], a, b, epsabs=1e-15)[0]
            for a, b in itertools.pairwise(ends)
        ]
        np.testing.assert_allclose(law.energy_at(e), sum(parts), rtol=1e-10)


def test_energies_that_the_paper_s_constants_give():
    strain = np.array([0.005, 0.01, 0.05, 0.1])
    printed = [0.0005475625, 0.00219025, 0.09541945, 0.4234672]
    np.testing.assert_allclose(LAWS["printed"].energy_at(strain), printed, rtol=1e-12)
    extra = LAWS["continuous"].energy_at(strain) - printed
    # The triangle between the two lines, from their crossing to the switch.
    triangle = 0.5 * (94.005 - 43.805) * (0.01 - PAPER_K3["offset"] / (94.005 - 43.805)) ** 2
    np.testing.assert_allclose(extra, [0.0, triangle, triangle, triangle], rtol=1e-9, atol=1e-15)
    assert triangle == pytest.approx(1.576e-6, rel=1e-3)


def test_k3_jumps_as_printed_and_not_when_continuous():
    below, above = 0.01, np.nextafter(0.01, 1)
    printed, continuous = LAWS["printed"], LAWS["continuous"]
    assert printed.tension_at(below) == pytest.approx(43.805 * 0.01, rel=1e-14)
    assert printed.tension_at(above) - printed.tension_at(below) == pytest.approx(0.01258, rel=1e-9)
    assert continuous.strain[1] == pytest.approx(0.0097494024, abs=1e-10)
    assert continuous.tension[1] == pytest.approx(0.4270725717, abs=1e-10)
    crossing = continuous.strain[1]
    step = continuous.tension_at(np.nextafter(crossing, 1)) - continuous.tension_at(crossing)
    assert 0 <= step < 1e-14
    # Above the switch both are the paper's secant times the strain.
    for e in (0.02, 0.05, 0.09):
        secant_stiffness = 94.005 - 0.48942 / e
        for law in (printed, continuous):
            assert law.tension_at(e) == pytest.approx(secant_stiffness * e, rel=1e-12)


def test_stiffness_against_finite_differences():
    h = 1e-6
    for law in LAWS.values():
        away = STRAINS[np.abs(STRAINS[:, None] - law.strain).min(axis=1) > 2 * h]
        difference = (law.tension_at(away + h) - law.tension_at(away - h)) / (2 * h)
        assert np.abs(law.stiffness_at(away)).max() > 1
        np.testing.assert_allclose(law.stiffness_at(away), difference, rtol=1e-7, atol=1e-7)


def test_scaled_law_is_that_many_side_by_side():
    one, many = LAWS["polyester"], LAWS["polyester"].scaled(72)
    np.testing.assert_allclose(many.tension_at(STRAINS), 72 * one.tension_at(STRAINS), rtol=1e-14)
    np.testing.assert_allclose(many.energy_at(STRAINS), 72 * one.energy_at(STRAINS), rtol=1e-13)
    assert (many.breaking_strain, many.plastic) == (0.08, True)
    assert many.initial_stiffness == pytest.approx(72 * 6.34, rel=1e-14)


def test_shape_in_is_shape_out():
    law = LAWS["continuous"]
    assert law.tension_at(0.01).shape == ()
    assert law.energy_at(np.zeros((2, 0, 3))).shape == (2, 0, 3)
    grid = np.linspace(0, 0.05, 6).reshape(2, 3)
    np.testing.assert_array_equal(law.tension_at(grid).ravel(), law.tension_at(grid.ravel()))
    assert np.isnan(law.tension_at([np.nan, 0.01])).tolist() == [True, False]


def test_a_law_cannot_be_changed_and_does_not_follow_its_source():
    source = np.array([0.0, 0.1])
    law = TensionLaw(source, [0.0, 1.0])
    source[1] = 0.2
    assert law.strain[1] == 0.1
    with pytest.raises(ValueError, match="read-only"):
        law.tension[1] = 5.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TensionLaw([0.0], [0.0]), "two or more"),
        (lambda: TensionLaw([0, 0.1, 0.2], [0, 1]), "two or more"),
        (lambda: TensionLaw([0, np.nan], [0, 1]), "finite"),
        (lambda: TensionLaw([0.01, 0.1], [0, 1]), "start at strain 0"),
        (lambda: TensionLaw([0, 0.1], [0.5, 1]), "start at strain 0"),
        (lambda: TensionLaw([0, 0.2, 0.1], [0, 1, 2]), "must rise"),
        (lambda: TensionLaw([0, 0, 0.1], [0, 1, 2]), "must rise"),
        (lambda: TensionLaw([0, 0.1, 0.1], [0, 1, 2]), "must rise"),
        (lambda: TensionLaw([0, 0.1, 0.1, 0.1, 0.2], [0, 1, 2, 3, 4]), "once only"),
        (lambda: TensionLaw([0, 0.1, 0.2], [0, 0, 1]), "never fall"),
        (lambda: TensionLaw([0, 0.1, 0.2], [0, 2, 1]), "never fall"),
        (lambda: TensionLaw([0, 0.1], [0, 1], breaking_strain=-0.1), "above 0"),
        (lambda: TensionLaw([0, 0.1], [0, 1], breaking_strain=np.nan), "above 0"),
        (lambda: bilinear(6.34, 2.41, 0.08, 0.02), "yield strain = 0.08"),
        (lambda: secant(94.0, 43.8, 0.49, 0.01, 0.07), "high above low"),
        (lambda: secant(43.805, 94.005, 0.48942, 0.01, 0.005), "breaking strain = 0.005"),
    ],
)
def test_what_is_no_law_is_refused_in_one_line(make, message):
    with pytest.raises(InputError, match=message) as refusal:
        make()
    assert "\n" not in str(refusal.value)

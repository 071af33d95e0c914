"""The loops of Choi and Lo and of Peirce against their own definitions and the printed numbers."""

import dataclasses
import math
import re

import numpy as np
import pytest
from scipy.optimize import brentq

from knitsim.errors import InputError
from knitsim.loop.build import build_loop
from knitsim.loop.choi_lo import choi_lo
from knitsim.loop.length import centre_line_of, chi_for_length, shortest_loop
from knitsim.loop.measures import fabric_measures
from knitsim.loop.peirce import peirce

W, C, D = 1e-2 / 6.67, 1e-2 / 8.33, 0.2793e-3  # the paper's cotton fabric, m
COTTON = (W, C, D)
SIZES = [COTTON, (4 * D, 3.4 * D, D), (2.2e-3, 1.0e-3, 0.3e-3), (0.9e-3, 1.8e-3, 0.2e-3)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("chi", [0.3, 1.0, 1.4])
def test_choi_lo_solves_its_own_equations(size, chi):
    w, c, d = size
    k = choi_lo(w, c, d, chi)
    b2 = 1 - k.b1
    # Where the leg turns back: both turns, their distance along both axes.
    np.testing.assert_allclose(k.derivative([k.b1, b2])[:, 0], 0, atol=1e-12 * w)
    turns = k.points([k.b1, b2])
    assert turns[0, 0] - turns[1, 0] == pytest.approx(chi * d, rel=1e-11)
    assert turns[1, 1] - turns[0, 1] == pytest.approx(c, rel=1e-11)
    # Where it meets the next course: above one another, one diameter apart.
    assert 0 < k.t3 < k.b1 < k.t4
    meet = k.points([k.t3, k.t4])
    assert meet[0, 0] == pytest.approx(meet[1, 0], rel=1e-10)
    assert meet[1, 1] - meet[0, 1] == pytest.approx(c, rel=1e-10)
    assert meet[1, 2] - meet[0, 2] == pytest.approx(d, rel=1e-10)
    assert k.h > d


def test_choi_lo_formulas_and_mirror():
    k = choi_lo(*COTTON, 1.0)
    for t in np.linspace(0, 1, 11):
        written = (
            k.a * t**3 - 1.5 * k.a * t**2 + 0.5 * (k.a + W) * t,
            0.5 * (C + 2 * k.e) * (1 - math.cos(math.pi * t)),
            0.5 * (k.h - D) * (1 - math.cos(2 * math.pi * t)),
        )
        np.testing.assert_allclose(k.points(t), written, atol=1e-17)
        mirrored = (W - written[0], written[1], written[2])
        np.testing.assert_allclose(k.points(2 - t), mirrored, atol=1e-17)
    t = np.linspace(0.011, 1.989, 50)
    difference = (k.points(t + 1e-6) - k.points(t - 1e-6)) / 2e-6
    assert np.linalg.norm(difference, axis=1).min() > 1e-4
    np.testing.assert_allclose(k.derivative(t), difference, atol=1e-11)


def test_numbers_of_the_cotton_loop():
    k = choi_lo(*COTTON, 1.0)
    expected = {
        "a": (6.865922e-3, 5e-10), "e": (0.353590e-3, 5e-10), "h": (0.611302e-3, 5e-10),
        "b1": (0.283344, 5e-7), "t3": (0.0862643, 5e-8), "t4": (0.5953486, 5e-8),
    }  # fmt: skip
    for name, (value, half_digit) in expected.items():
        assert abs(getattr(k, name) - value) < half_digit * 1.05, name
    assert centre_line_of(k, "curve").length == pytest.approx(5.56665e-3, abs=0.5e-8)
    assert centre_line_of(k, "spline").length == pytest.approx(5.528e-3, abs=0.5e-6)
    wide = choi_lo(*COTTON, 1.4)
    assert centre_line_of(wide, "curve").length == pytest.approx(5.698e-3, abs=0.5e-6)
    chi, length = shortest_loop(*COTTON, "curve")
    assert chi == pytest.approx(0.86, abs=0.01)
    assert length == pytest.approx(5.555e-3, abs=0.6e-6)


def test_strain_of_the_yarn_at_ten_percent_course_wise():
    curve = centre_line_of(choi_lo(*COTTON, 1.0), "curve")
    assert curve.stretched((1.1, 1, 1)).length / curve.length - 1 == pytest.approx(
        0.0343, abs=0.5e-4
    )
    scale = brentq(lambda s: curve.stretched((1.1, s, 1)).length - curve.length, 0.5, 1)
    assert scale == pytest.approx(0.94006, abs=0.5e-5)


def test_spline_goes_through_six_anchors_of_each_half_loop():
    loop = build_loop(*COTTON, 5.56e-3)
    k = choi_lo(*COTTON, loop.parameters["chi"])
    t = [0, k.t3, k.b1, 1 - k.b1, 1 - k.t3, 1]
    assert loop.anchors.shape == (11, 3)
    np.testing.assert_allclose(loop.anchors[:6], k.points(t), atol=1e-17)
    mirrored = k.points(t[::-1]) * (-1, 1, 1) + (W, 0, 0)
    np.testing.assert_allclose(loop.anchors[5:], mirrored, atol=1e-15)
    np.testing.assert_allclose(loop.points(loop.spline.knots), loop.anchors, atol=1e-16)
    # Mirror symmetry of the modelled centre line itself.
    u = np.linspace(0, 1, 101)
    mirrored = loop.points(1 - u) * (-1, 1, 1) + (W, 0, 0)
    np.testing.assert_allclose(loop.points(u), mirrored, atol=1e-15)


@pytest.mark.parametrize("centre_line", ["spline", "curve"])
@pytest.mark.parametrize("length", [5.56e-3, 5.7e-3, 5.9e-3])
def test_modelled_centre_line_has_the_stated_length(centre_line, length):
    loop = build_loop(*COTTON, length, centre_line=centre_line)
    assert loop.loop_length == pytest.approx(length, rel=1e-12)
    # Measured again as a fine polygon, whose error falls with the square of its sides.
    coarse, fine = (
        np.linalg.norm(np.diff(loop.polyline(n), axis=0), axis=1).sum() for n in (4000, 8000)
    )
    assert (4 * fine - coarse) / 3 == pytest.approx(length, rel=1e-9)
    # On the branch above the shortest loop.
    chi = loop.parameters["chi"]
    assert chi > shortest_loop(*COTTON, centre_line)[0]
    more = centre_line_of(choi_lo(*COTTON, 1.001 * chi), centre_line).length
    assert more > length


@pytest.mark.parametrize("centre_line", ["spline", "curve"])
def test_shortest_loop_is_the_shortest(centre_line):
    chi, length = shortest_loop(*COTTON, centre_line)
    others = [
        centre_line_of(choi_lo(*COTTON, other), centre_line).length
        for other in np.linspace(0.3, 2.5, 45)
    ]
    assert length <= min(others)
    assert length == pytest.approx(min(others), rel=1e-3)
    assert chi_for_length(*COTTON, length * (1 + 1e-9), centre_line) == pytest.approx(chi, rel=1e-3)


def test_too_short_a_loop_names_the_shortest_and_what_would_work():
    with pytest.raises(InputError) as caught:
        build_loop(*COTTON, 5.5e-3, where="config/fabrics.yaml: cotton")
    message = str(caught.value)
    assert message.startswith("config/fabrics.yaml: cotton.loop_length_mm = 5.5: must be at least ")
    assert "\n" not in message
    shortest = float(re.search(r"at least ([\d.]+) mm", message)[1])
    closer = float(re.search(r"both spacings ([\d.]+) % closer", message)[1])
    # Both ways out hold.
    assert build_loop(*COTTON, shortest * 1e-3).loop_length == pytest.approx(shortest * 1e-3)
    factor = 1 - closer / 100
    assert build_loop(factor * W, factor * C, D, 5.5e-3).loop_length == pytest.approx(5.5e-3)


@pytest.mark.parametrize(
    ("arguments", "start", "says"),
    [
        ((*COTTON, 3e-3), "f.loop_length_mm = 3: must be at least 5.528 mm", "shortest loop"),
        ((*COTTON, 9e-3), "f.loop_length_mm = 9: must be at most", "longest loop"),
        ((*COTTON, 7e-3), "f.diameter_mm = 0.2793", "centre lines"),
        ((W, C, 0.6e-3, 6.4e-3), "f.", "mm"),
        ((-W, C, D, 5.56e-3), "f.wale_spacing_mm = -1.4993", "above 0"),
        ((W, 0.0, D, 5.56e-3), "f.course_spacing_mm = 0", "above 0"),
        ((W, C, math.nan, 5.56e-3), "f.diameter_mm = nan", "finite"),
        ((W, C, D, math.inf), "f.loop_length_mm = inf", "finite"),
        ((*COTTON, None), "f.loop_length_mm = nothing", "above 0"),
        ((*COTTON, 5.56e-3, "bezier"), "f.geometry = bezier", "choi_lo, peirce"),
        ((*COTTON, 5.56e-3, "choi_lo", "polygon"), "f.centre_line = polygon", "spline, curve"),
        ((*COTTON, 5.56e-3, "peirce"), "f.loop_length_mm = 5.56", "left out"),
        ((3.9 * D, C, D, None, "peirce"), "f.wale_spacing_mm = 1.0893", "4 yarn diameters"),
        ((W, 3.3 * D, D, None, "peirce"), "f.course_spacing_mm = 0.92169", "3.364 yarn diameters"),
    ],
)
def test_refusals_are_one_line_that_names_the_key(arguments, start, says):
    with pytest.raises(InputError) as caught:
        build_loop(*arguments, where="f")
    assert str(caught.value).startswith(start)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_loop_beside_the_next_course_is_refused():
    with pytest.raises(InputError, match=r"f\.chi = 4.*no t3.*below 2\.684") as caught:
        choi_lo(*COTTON, 4.0, where="f")
    assert "\n" not in str(caught.value)
    assert choi_lo(*COTTON, 2.683).t3 > 0
    with pytest.raises(InputError, match="above 0"):
        choi_lo(*COTTON, 0.0)


def test_peirce_of_the_tight_loop_is_arcs_and_legs_on_a_cylinder():
    # Built anew, with d = 1: two arcs of radius 1.5 and their inner tangent, unrolled.
    centres = np.array([[0.0, -math.sqrt(3)], [2.0, math.sqrt(3)]])
    lean = math.radians(60) + math.asin(3 / 4)
    leg = math.sqrt(16 - 9)
    angle = np.linspace(0, lean, 50)
    low = centres[0] + 1.5 * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
    straight = low[-1] + np.linspace(0, leg, 20)[:, None] * (math.cos(lean), math.sin(lean))
    high = (2.0, 0.0) - low[::-1]
    np.testing.assert_allclose(straight[-1], high[0], atol=1e-14)  # it is a tangent of both
    arc = np.concatenate(
        [1.5 * angle, 1.5 * lean + np.linspace(0, leg, 20), 1.5 * lean + leg + 1.5 * angle]
    )
    loop = peirce(4.0, 3.364, 1.0)
    radius = loop.radius
    assert 2 * radius * math.sin(math.sqrt(3) / radius) == pytest.approx(3.364, rel=1e-12)
    flat = np.concatenate([low, straight, high])
    turn = flat[:, 1] / radius
    bent = np.stack([flat[:, 0], radius * np.sin(turn), radius * np.cos(turn)], axis=-1)
    np.testing.assert_allclose(loop.points(arc), bent - bent[0] + (0, 0, 0), atol=1e-13)
    assert loop.loop_length == pytest.approx(4 * 1.5 * lean + 2 * leg, rel=1e-14)
    assert loop.loop_length == pytest.approx(16.66, abs=0.005)


@pytest.mark.parametrize("size", [(4 * D, 3.364 * D, D), COTTON, (9 * D, 7 * D, D)])
def test_length_of_peirces_loop(size):
    w, c, d = size
    loop = peirce(*size)
    assert loop.loop_length == pytest.approx(2 * c + w + 5.94 * d, abs=0.006 * d)
    # Arc length is the parameter everywhere, and the tangent never jumps.
    s = np.linspace(0, 1, 2001)[1:-1] * loop.loop_length
    h = 1e-5 * d
    velocity = (loop.points(s + h) - loop.points(s - h)) / (2 * h)
    np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), 1.0, atol=1e-6)
    turn = np.linalg.norm(np.diff(velocity, axis=0), axis=1)
    assert turn.max() < 1.2 * (s[1] - s[0]) / d
    np.testing.assert_allclose(loop.points(loop.loop_length), (w, 0, 0), atol=1e-15)
    modelled = build_loop(*size, geometry="peirce")
    assert modelled.loop_length == pytest.approx(loop.loop_length, rel=1e-5)
    assert modelled.centre_line == "curve"


def test_measures_of_the_cotton_fabric():
    loop = build_loop(*COTTON, 5.56e-3)
    measures = fabric_measures(loop, 559.86e-7)
    assert measures.stitch_density == pytest.approx(667 * 833, rel=1e-12)
    assert measures.tightness_factor == pytest.approx(math.sqrt(55.986) / 0.556, rel=1e-9)
    assert measures.areal_mass == pytest.approx(55.986e-6 * 5.56e-3 * 667 * 833, rel=1e-9)
    assert measures.kc == pytest.approx(5.56 / 1.2004802, rel=1e-6)
    assert measures.kw == pytest.approx(5.56 / 1.4992504, rel=1e-6)
    assert measures.ks == pytest.approx(measures.kc * measures.kw, rel=1e-12)
    assert measures.loop_shape == pytest.approx(8.33 / 6.67, rel=1e-12)
    assert measures.cover == pytest.approx(5.56 * 0.2793 * 6.67 * 8.33 / 100, rel=1e-9)
    assert measures.thickness == pytest.approx(np.ptp(loop.polyline(4000)[:, 2]) + D, rel=1e-6)
    volume = 5.56e-3 * math.pi * D**2 / 4
    free = 1 - volume / (W * C * measures.thickness)
    assert measures.porosity == pytest.approx(free, rel=1e-9)
    assert all(math.isfinite(x) for x in dataclasses.astuple(measures))
    with pytest.raises(InputError, match="above 0"):
        fabric_measures(loop, 0.0)


def test_the_same_input_gives_the_same_bytes():
    one, two = (build_loop(*COTTON, 5.56e-3) for _ in range(2))
    assert one.spline.coefficients.tobytes() == two.spline.coefficients.tobytes()
    assert one.nearest == two.nearest

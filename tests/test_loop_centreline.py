"""The periodic spline against adaptive quadrature, elliptic integrals and finite differences."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipe

from knitsim.errors import InputError
from knitsim.loop.centreline import periodic_spline

PERIOD = np.array([1.0, 0.2, 0.0])


def lopsided(count):
    """Anchors (count + 1, 3) of a smooth curve without any symmetry, of period (1, 0.2, 0)."""
    s = np.arange(count + 1) / count
    a = 2 * np.pi * s
    course = s - 0.12 * np.sin(2 * a + 0.3) + 0.02 * np.cos(3 * a)
    wale = 0.2 * s + 0.5 * np.cos(a) - 0.1 * np.sin(2 * a + 1.0)
    thickness = 0.2 * np.sin(2 * a) + 0.1 * np.cos(a + 0.5)
    points = np.stack([course, wale, thickness], axis=-1)
    points[-1] = points[0] + PERIOD
    return points


@pytest.fixture(scope="module")
def spline():
    return periodic_spline(lopsided(12))


def test_goes_through_its_anchors_and_repeats(spline):
    anchors = lopsided(12)
    np.testing.assert_allclose(spline.points(spline.knots), anchors, atol=1e-14)
    u = np.linspace(-1.3, 2.2, 57)
    np.testing.assert_allclose(spline.points(u + 1), spline.points(u) + PERIOD, atol=1e-14)
    chords = np.linalg.norm(np.diff(anchors, axis=0), axis=1)
    np.testing.assert_allclose(np.diff(spline.knots), chords / chords.sum(), rtol=1e-12)


def test_is_twice_continuously_differentiable_also_where_it_closes(spline):
    step = 1e-9
    for order in (0, 1, 2):
        before = spline.derivative(spline.knots - step, order)
        after = spline.derivative(spline.knots + step, order)
        size = np.abs(spline.derivative(spline.nodes, min(order + 1, 3))).max()
        assert np.abs(after - before).max() < 4 * step * size
    third = spline.derivative(spline.knots + step, 3) - spline.derivative(spline.knots - step, 3)
    assert np.abs(third).max() > 1.0  # it is a spline, not one cubic


def test_derivatives_are_those_of_the_points(spline):
    u = np.linspace(0.013, 0.987, 40)
    for order in (1, 2):
        h = 1e-5
        difference = spline.derivative(u + h, order - 1) - spline.derivative(u - h, order - 1)
        value = spline.derivative(u, order)
        assert np.linalg.norm(value, axis=1).min() > 1e-2
        np.testing.assert_allclose(difference / (2 * h), value, atol=1e-5 * np.abs(value).max())


@pytest.mark.parametrize("stretch", [(1, 1, 1), (1.6, 0.5, 1), (0.6, 1.5, 1), (1.1, 0.94, 1)])
def test_arc_length_by_its_gauss_points_is_right_to_1e_10(spline, stretch):
    deformed = spline.stretched(stretch)

    def speed(u):
        return float(np.linalg.norm(spline.derivative(u) * stretch))

    exact = sum(
        quad(speed, a, b, epsabs=0, epsrel=1e-12)[0] for a, b in itertools.pairwise(spline.knots)
    )
    by_nodes = spline.weights @ np.linalg.norm(spline.derivative(spline.nodes) * stretch, axis=1)
    assert by_nodes == pytest.approx(exact, rel=1e-10)
    assert deformed.length == pytest.approx(exact, rel=1e-10)


def test_length_tends_to_the_elliptic_integral_at_fourth_order():
    # y = A sin 2 pi x: length 2 E(m) sqrt(1 + k2) / pi, k = 2 pi A, m = k2 / (1 + k2).
    k2 = (2 * np.pi * 0.4) ** 2
    exact = 2 / np.pi * np.sqrt(1 + k2) * ellipe(k2 / (1 + k2))
    errors = []
    for count in (64, 128, 256):
        x = np.arange(count + 1) / count
        wave = np.stack([x, 0.4 * np.sin(2 * np.pi * x), 0 * x], axis=-1)
        wave[-1, 1] = 0.0
        errors.append(abs(periodic_spline(wave).length - exact))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] > 1e-14
    np.testing.assert_allclose(orders, 4.0, atol=0.3)


def test_sections_lie_at_equal_arc_length(spline):
    u, arc = spline.sections(37)
    assert arc[-1] == spline.length
    np.testing.assert_allclose(np.diff(arc), spline.length / 37, rtol=1e-12)
    for i in (1, 5, 20, 36):
        inner = spline.knots[(spline.knots > 0) & (spline.knots < u[i])]
        edges = np.concatenate([[0.0], inner, [u[i]]])
        measured = sum(
            quad(lambda x: float(np.linalg.norm(spline.derivative(x))), a, b, epsrel=1e-12)[0]
            for a, b in itertools.pairwise(edges)
        )
        assert measured == pytest.approx(arc[i], rel=1e-11)
    np.testing.assert_allclose(spline.arc_length(u), arc[:-1], atol=1e-14 * spline.length)


def test_curvature_of_a_helix():
    # Helix of radius 0.3 and period 1: curvature r / (r2 + b2), b = 1 / 2 pi.
    s = np.arange(201) / 200
    helix = np.stack([s, 0.3 * np.cos(2 * np.pi * s), 0.3 * np.sin(2 * np.pi * s)], axis=-1)
    helix[-1, 1:] = helix[0, 1:]
    exact = 0.3 / (0.3**2 + 0.25 / np.pi**2)
    np.testing.assert_allclose(
        periodic_spline(helix).curvature(np.linspace(0, 1, 33)), exact, rtol=1e-3
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda p: p[:3], "four or more"),
        (lambda p: p[:, :2], "four or more"),
        (lambda p: np.where(np.arange(len(p))[:, None] == 4, np.nan, p), "finite"),
        (lambda p: np.insert(p, 4, p[4], axis=0), "anchors 4 and 5"),
    ],
)
def test_refuses_anchors_that_make_no_curve(change, says):
    with pytest.raises(InputError, match=says) as caught:
        periodic_spline(change(lopsided(12)))
    assert "\n" not in str(caught.value)


def test_refuses_an_arc_length_outside_the_loop(spline):
    with pytest.raises(ValueError, match="outside"):
        spline.at_arc_length(1.1 * spline.length)

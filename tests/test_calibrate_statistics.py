"""What a fit knows about its parameters, against textbook answers."""

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.inference.statistics import (
    neighbour_correlation,
    robust_scale,
    soft,
    soft_loss,
    spread,
    warnings_of,
)


def line(seed=1, n=40, sigma=0.3):
    """Points on 2 + 3 x with noise: x, least-squares (a, b), residuals, Jacobian."""
    x = np.linspace(0.0, 1.0, n)
    y = 2.0 + 3.0 * x + sigma * np.random.default_rng(seed).standard_normal(n)
    jacobian = np.stack([np.ones(n), x], axis=1)
    values = np.linalg.lstsq(jacobian, y, rcond=None)[0]
    return x, values, jacobian @ values - y, jacobian


def test_a_straight_line_has_the_textbook_errors():
    x, values, residual, jacobian = line()
    found = spread(values, residual, jacobian, np.inf, np.zeros(len(x)))
    # As if there were fewer points, by the correlation of neighbours.
    one, other = residual[1:], residual[:-1]
    c = one @ other / np.sqrt((one @ one) * (other @ other))
    assert 0.0 < c < 0.3
    s2 = residual @ residual / (len(x) - 2) * (1.0 + c) / (1.0 - c)
    sxx = ((x - x.mean()) ** 2).sum()
    assert found.standard_error[1] == pytest.approx(np.sqrt(s2 / sxx))
    assert found.standard_error[0] == pytest.approx(
        np.sqrt(s2 * (1 / len(x) + x.mean() ** 2 / sxx))
    )
    assert found.correlation[0, 1] == pytest.approx(
        -x.mean() / np.sqrt(sxx / len(x) + x.mean() ** 2)
    )
    assert found.factor == pytest.approx(2.02439, abs=1e-4)  # Student's t, 38 degrees of freedom
    np.testing.assert_allclose(found.information @ found.covariance, np.eye(2), atol=1e-9)


def test_points_that_weigh_more_are_no_more_certain():
    x, _, _, jacobian = line()
    y = 2.0 + 3.0 * x + 0.3 * np.random.default_rng(1).standard_normal(len(x))
    weight = 0.2 + 3.0 * x**2
    weight /= weight.mean()
    # The estimate is linear in the numbers measured, which all have one variance.
    linear = np.linalg.solve(jacobian.T @ (weight[:, None] * jacobian), jacobian.T * weight)
    values, root = linear @ y, np.sqrt(weight)
    found = spread(values, root * (jacobian @ values - y), root[:, None] * jacobian, np.inf,
                   np.arange(len(x)), weight)  # fmt: skip
    variance = np.sum(weight * (jacobian @ values - y) ** 2) / (len(x) - 2)
    np.testing.assert_allclose(found.covariance, variance * linear @ linear.T, rtol=1e-9)
    np.testing.assert_allclose(found.information @ found.covariance, np.eye(2), atol=1e-9)


def test_the_robust_loss_is_that_of_scipy():
    r, s = np.linspace(-2.0, 2.0, 9), np.full(9, 0.7)
    own = soft_loss(s)(r**2)
    # scipy's soft_l1 of (r/s)^2, times s^2.
    over = 1.0 + (r / s) ** 2
    np.testing.assert_allclose(own[0], 2.0 * s**2 * (over**0.5 - 1.0))
    h = 1e-6
    for k in (0, 1):
        slope = (soft_loss(s)(r**2 + h)[k] - soft_loss(s)(r**2 - h)[k]) / (2.0 * h)
        np.testing.assert_allclose(own[k + 1], slope, rtol=1e-6)
    np.testing.assert_allclose(own[1], soft(r, s))


def test_a_pattern_widens_the_intervals():
    x, values, residual, jacobian = line()
    wave = np.std(residual) * np.sqrt(2.0) * np.sin(4.0 * np.pi * x)
    plain = spread(values, residual, jacobian, np.inf, np.zeros(len(x)))
    waving = spread(values, wave, jacobian, np.inf, np.zeros(len(x)))
    assert waving.pattern > 0.8
    assert abs(plain.pattern) < 0.35
    assert waving.standard_error[1] > 2.5 * plain.standard_error[1]


def test_neighbours_of_different_curves_do_not_count():
    r = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    assert neighbour_correlation(r, np.repeat([0, 1], 3)) == pytest.approx(1.0)
    assert neighbour_correlation(r, np.zeros(6)) == pytest.approx(3.0 / 5.0)
    # Of a wave that begins and ends near zero, too, it is a correlation.
    assert 0.9 < neighbour_correlation(np.array([0.5, 1, 1, 1, 1, 0.5]), np.zeros(6)) <= 1.0


def test_a_direction_without_effect_is_unknown():
    x, values, residual, jacobian = line()
    jacobian[:, 1] = 0.0
    found = spread(values, residual, jacobian, np.inf, np.zeros(len(x)))
    assert np.isfinite(found.standard_error[0])
    assert found.standard_error[1] == np.inf
    said = warnings_of(("a", "b"), values, np.array([[0.0, 5.0], [0.0, 5.0]]), found)
    assert any("do not determine b" in text for text in said)
    assert not any("do not determine a" in text for text in said)


def test_too_few_points_are_refused():
    with pytest.raises(InputError, match="more than the 2 free parameters"):
        spread(np.zeros(2), np.zeros(2), np.eye(2), np.inf, np.zeros(2))


def test_only_points_far_out_make_the_fit_robust():
    normal = np.random.default_rng(0).standard_normal(200)
    assert robust_scale(normal, 2) == np.inf
    normal[5] = 30.0
    assert robust_scale(normal, 2) == pytest.approx(4.0, rel=0.15)


def test_robust_errors_are_nearly_those_without_the_outlier():
    x, values, residual, jacobian = line(n=200)
    plain = spread(values, residual, jacobian, np.inf, np.zeros(len(x)))
    wild = residual.copy()
    wild[77] += 50.0
    found = spread(values, wild, jacobian, robust_scale(wild, 2), np.zeros(len(x)))
    assert found.standard_error[1] == pytest.approx(plain.standard_error[1], rel=0.15)

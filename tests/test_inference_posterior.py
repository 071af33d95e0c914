"""Distributions of inputs, the emulator, the posterior and scores, against closed forms and brute force."""

import numpy as np
import pytest
from scipy import stats

from knitsim.equilibrium.contact import CoreContact
from knitsim.equilibrium.fabric import Fabric
from knitsim.errors import ComputationError, InputError
from knitsim.inference.emulator import Emulator, Smooth
from knitsim.inference.forward import Place
from knitsim.inference.infer import next_tests
from knitsim.inference.inputs import Input, draws, fabric_at, inputs_of
from knitsim.inference.posterior import (
    Block,
    Posterior,
    block,
    predicted,
    reading,
    smoothed,
    together,
)
from knitsim.inference.scores import crps, score
from knitsim.yarn.law import TensionLaw

FABRIC = Fabric(
    2.86e-3, 2.07e-3, 11.28e-3, 1.48e-3, 0.045e-6, TensionLaw([0.0, 0.02], [0.0, 200.0]),
    contact=CoreContact(0.65e-3, 0.0012e9, 2.4),
)  # fmt: skip
FORCES = np.geomspace(10.0, 300.0, 8)


def test_a_tolerance_is_two_standard_deviations_and_a_range_even():
    values = Input("loop_length", "tolerance", 10.0, 0.02).at(
        np.random.default_rng(0).normal(size=40000)
    )
    assert np.mean((values < 10.2) & (values > 10.0 / 1.02)) == pytest.approx(0.9545, abs=0.004)
    even = Input("friction", "range", 0.1, 0.5).at(np.random.default_rng(0).normal(size=40000))
    assert stats.kstest((even - 0.1) / 0.4, "uniform").pvalue > 0.01
    log = Input("stretch", "log_range", 0.01, 1.0)
    assert log.at(0.0) == pytest.approx(0.1)


@pytest.mark.parametrize("kind, first, second", [
    ("tolerance", 3.0, 0.4), ("range", -1.0, 3.0), ("log_range", 0.1, 50.0),
])  # fmt: skip
def test_numbers_and_values_are_told_into_each_other(kind, first, second):
    one = Input("x", kind, first, second)
    z = np.linspace(-3.0, 3.0, 13)
    np.testing.assert_allclose(one.z_of(one.at(z)), z, atol=1e-9)
    sample = one.feature(np.random.default_rng(1).normal(size=100000))
    assert sample.mean() == pytest.approx(0.0, abs=0.02) and sample.std() == pytest.approx(
        1.0, abs=0.02
    )


@pytest.mark.parametrize("kind, first, second", [
    ("tolerance", 0.0, 0.1), ("tolerance", 1.0, 0.0), ("range", 2.0, 1.0), ("log_range", 0.0, 1.0),
    ("normal", 0.0, 1.0), ("range", 0.0, np.inf),
])  # fmt: skip
def test_what_is_no_distribution_is_refused(kind, first, second):
    with pytest.raises(InputError):
        Input("x", kind, first, second)


def test_inputs_of_a_fabric_are_those_that_it_has():
    names = [i.name for i in inputs_of(FABRIC, {"friction": (0.0, 0.5)})]
    assert {"core_diameter", "core_stiffness", "core_exponent", "tangential_ratio"} <= set(names)
    assert "compression_stiffness" not in names and "set" not in names
    # Without friction there is nothing that slides.
    assert "tangential_ratio" not in [i.name for i in inputs_of(FABRIC)]
    certain = inputs_of(FABRIC, tolerances={"loop_length": 0.0})
    assert "loop_length" not in [i.name for i in certain]
    with pytest.raises(InputError, match="uncertain input"):
        inputs_of(FABRIC, {"colour": (0.0, 1.0)})


def test_a_fabric_has_the_values_of_its_numbers():
    inputs = inputs_of(FABRIC, {"friction": (0.0, 0.5)})
    z = draws(inputs, 8, 3)[2]
    moved = fabric_at(FABRIC, inputs, z)
    asked = {i.name: i.at(number) for i, number in zip(inputs, z, strict=True)}
    assert moved.loop_length == asked["loop_length"] and moved.friction == asked["friction"]
    assert moved.contact.exponent == asked["core_exponent"]
    assert moved.law.tension_at(0.02) == pytest.approx(200.0 * asked["stretch"])


def linear(slopes, inputs=3, noise=0.0, count=60):
    """An emulator of ln strain = slopes z at FORCES, from ``count`` rows."""
    own = tuple(Input(f"x{k}", "tolerance", 1.0, 0.1) for k in range(inputs))
    places = tuple(Place("wale", "strain", float(f)) for f in FORCES)
    places += tuple(Place("course", "strain", float(f)) for f in FORCES)
    z = draws(own, count, 1)
    off = noise * np.random.default_rng(0).normal(size=(count, len(places)))
    return Emulator(own, places, z, 0.3 * np.exp(z @ slopes.T + off))


@pytest.mark.slow
def test_an_emulator_knows_a_smooth_function_and_its_own_error_elsewhere():
    rng = np.random.default_rng(2)
    slopes = 0.1 * rng.normal(size=(16, 3))
    exact = linear(slopes)
    z = rng.normal(size=(5, 3))
    np.testing.assert_allclose(exact.rows(z), np.log(0.3) + z @ slopes.T, atol=1e-3)
    np.testing.assert_allclose(exact.slopes(z[0]), slopes, atol=1e-3)
    noisy = linear(slopes, noise=0.05, count=400)
    assert np.sqrt((noisy.error**2).mean()) == pytest.approx(0.05, rel=0.1)


def test_leave_one_out_is_what_leaving_one_out_gives():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(24, 4)), rng.normal(size=(24, 1))
    x = np.concatenate([x, [[0.1, 0.2, 0.3, 0.4]]])
    y = np.concatenate([y, [[0.5]]]) - y.mean()
    found = Smooth(x, y, scale=np.ones(25))
    for k in (0, 7, 24):
        rest = np.arange(25) != k
        inner = found._covariance(x, np.ones(25), found.length)
        weights = np.linalg.solve(inner[np.ix_(rest, rest)] + found.nugget * np.eye(24), y[rest, 0])
        assert found.left_out[k, 0] == pytest.approx(y[k, 0] - inner[k, rest] @ weights, rel=1e-6)


def test_what_friction_changes_vanishes_without_it():
    rng = np.random.default_rng(3)
    x, scale = rng.normal(size=(40, 2)), rng.uniform(size=40)
    found = Smooth(x, (scale * (1.0 + x[:, 0]))[:, None], scale)
    assert (found.at(x, np.zeros(40)) == 0.0).all()
    np.testing.assert_allclose(
        found.at(x[:3], np.full(3, 0.5))[:, 0], 0.5 * (1.0 + x[:3, 0]), atol=1e-3
    )


def test_too_few_rows_are_refused_and_lost_numbers_passed_over():
    with pytest.raises(ComputationError, match="too few"):
        linear(np.ones((16, 3)), count=8)
    x = np.random.default_rng(0).normal(size=(40, 2))
    y = x @ [[1.0, 2.0], [3.0, 4.0]]
    y[::4, 1] = np.nan
    found = Smooth(x, y)
    np.testing.assert_allclose(found.at(x)[:, 1], x @ [2.0, 4.0], atol=1e-2)


def test_errors_near_a_fit_are_those_of_the_rows_that_fit():
    rng = np.random.default_rng(4)
    own = tuple(Input(f"x{k}", "tolerance", 1.0, 0.1) for k in range(2))
    places = (Place("wale", "strain", 10.0),)
    z = draws(own, 400, 1)
    # Only where the first input is large does the model scatter.
    off = np.where(z[:, :1] > 0.0, 0.1, 0.001) * rng.normal(size=(400, 1))
    found = Emulator(own, places, z, np.exp(off))
    assert found.near(-50.0 * (z[:, 0] + 1.0) ** 2).error[0] < 0.3 * found.error[0]
    np.testing.assert_allclose(found.near(np.zeros(400)).error, found.error)


def without_discrepancy(values, error):
    H = reading(linear(np.zeros((16, 3))).places, "wale", "strain", FORCES)
    return Block("wale", "strain", FORCES, values, H, error**2 * np.eye(8), np.zeros(8))


def test_a_linear_model_has_the_posterior_of_the_textbook():
    rng = np.random.default_rng(3)
    slopes = 0.1 * rng.normal(size=(16, 3))
    model = linear(slopes)
    model.covariance = np.zeros((16, 16))
    values = np.log(0.3) + slopes[:8] @ [0.5, -1.0, 0.2] + 0.03 * rng.normal(size=8)
    found = Posterior(model, [without_discrepancy(values, 0.03)])
    covariance = np.linalg.inv(np.eye(3) + slopes[:8].T @ slopes[:8] / 0.03**2)
    mean = covariance @ slopes[:8].T @ (values - np.log(0.3)) / 0.03**2
    np.testing.assert_allclose(found.z, mean, atol=5e-3)
    np.testing.assert_allclose(found.covariance, covariance, rtol=0.01, atol=1e-4)
    z, _, k = found.draws(6000)
    assert k < 0.7
    np.testing.assert_allclose(z.mean(axis=0), mean, atol=0.05)
    np.testing.assert_allclose(np.cov(z.T), covariance, atol=0.05)
    assert (found.draws(50, seed=4)[0] == found.draws(50, seed=4)[0]).all()


@pytest.mark.slow
def test_bands_hold_what_they_say_when_truths_come_from_the_distribution():
    rng = np.random.default_rng(5)
    slopes = 0.1 * rng.normal(size=(16, 3))
    model = linear(slopes)
    model.covariance = np.zeros((16, 16))
    inside = []
    for _ in range(60):
        z, s = rng.normal(size=3), rng.normal() * np.log(2.0) / 2.0
        size = 0.05 * np.exp(s)
        off = np.linalg.cholesky(together(FORCES))
        truth = (
            np.log(0.3)
            + slopes @ z
            + size * np.concatenate([off @ rng.normal(size=8) for _ in range(2)])
        )
        mixed = np.linalg.cholesky(together(FORCES)) @ rng.normal(size=8) + rng.normal(size=8)
        given = np.exp(truth[:8]) * (1.0 + 0.03 * np.sqrt(0.5) * mixed)
        # The errors that a measured curve is taken to have: half of their variance goes together.
        seen = block(model.places, "wale", "strain", FORCES, given, 0.03 * given)
        samples = predicted(Posterior(model, [seen]), "course", "strain", FORCES, count=800)
        one = score(samples, np.exp(truth[8:]))
        inside.append((one.inside_50, one.inside_95))
    half, most = np.mean(inside, axis=0)
    # Errors of one curve go together: 60 curves are worth some 100 points.
    assert 0.38 < half < 0.62 and 0.89 < most <= 0.995


def test_the_score_of_a_normal_prediction_is_that_of_the_closed_form():
    samples = np.random.default_rng(0).normal(2.0, 0.5, size=(40000, 2))
    measured = np.array([2.3, 0.9])
    z = (measured - 2.0) / 0.5
    exact = 0.5 * (z * (2 * stats.norm.cdf(z) - 1) + 2 * stats.norm.pdf(z) - 1 / np.sqrt(np.pi))
    np.testing.assert_allclose(crps(samples, measured), exact, rtol=0.02)


def test_the_next_test_is_the_one_that_sees_what_the_prediction_hangs_on():
    slopes = np.zeros((16, 3))
    slopes[:8, 0], slopes[8:, 1] = 0.1, 0.1
    model = linear(slopes)
    model.covariance = np.zeros((16, 16))

    class Found:
        posterior, emulator, inputs = Posterior(model), model, model.inputs
        forces = {"course": FORCES, "wale": FORCES}  # noqa: RUF012

    ranked = dict(next_tests(Found, "course", [("wale", "strain"), ("course", "strain")]))
    assert ranked["x1, ten times better"] < 0.2 and ranked["x0, ten times better"] == pytest.approx(
        1.0
    )
    assert ranked["course pull, strain"] < 0.7 < 0.99 < ranked["wale pull, strain"]


def test_weights_without_tail_are_trusted_and_heavy_ones_not():
    rng = np.random.default_rng(0)
    assert smoothed(0.1 * rng.normal(size=4000))[1] < 0.3
    assert smoothed(np.log(rng.pareto(1.05, size=4000) + 1.0))[1] > 0.7

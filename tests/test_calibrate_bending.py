"""Measured bending tests: what is compared of a loop, and that a fit finds the yarn that made it."""

import numpy as np
import pytest
from measured_tools import bending

from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError
from knitsim.inference.bending_points import PASS_POINTS, BendingPoints, bending_points
from knitsim.inference.calibrate import Parameter, Problem, fit
from knitsim.inference.predict import Predictor
from knitsim.yarn.law import paper_k3

COARSE = Resolution(32)
RIGIDITY = 5e-9
COTTON = Fabric(
    1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, RIGIDITY, paper_k3(continuous=True), friction=0.2
)
UP = np.linspace(0.0, 200.0, 21)
TO_ONE_SIDE = np.concatenate([UP, UP[-2::-1]])
LOOP = np.concatenate([TO_ONE_SIDE, -TO_ONE_SIDE[1:]])
# Curvatures that the fabric goes through, the first point that was measured, and of which cycle.
TESTS = {
    "first cycle": (LOOP, 0, 1),
    "second cycle": (np.concatenate([LOOP, LOOP[1:]]), len(LOOP) - 1, 2),
    "one side": (TO_ONE_SIDE, 0, 1),
    "other side": (-TO_ONE_SIDE, 0, 1),
    "one way": (UP, 0, 1),
    "from the far end": (LOOP, 20, 1),
    "second cycle to one side": (np.concatenate([TO_ONE_SIDE, TO_ONE_SIDE[1:]]), 40, 2),
}


@pytest.fixture(scope="module")
def relaxed():
    return relax(COTTON, COARSE)


def measured(relaxed, name, direction):
    curvatures, first, cycle = TESTS[name]
    curve = bend(relaxed, direction, curvatures)
    own = slice(first, None)
    return bending(
        name, direction, curve.curvature[own], curve.moment_per_width[own], cycle=cycle
    )  # fmt: skip


def fitted(test):
    free = [Parameter("bending_rigidity", 2e-9, 1e-8, 0.9 * RIGIDITY)]
    return fit(Problem(COTTON, free, [test], resolution=COARSE), profile=False).values[0]


def check_finds_itself(relaxed, name, direction):
    """The model meets its own loop, and a fit the rigidity, within the error of its increments.

    The model goes through these points in the steps of the thinned test, the measurement was made in
    smaller ones: the estimate of what steps do to the change of the moment is the limit.
    """
    test = measured(relaxed, name, direction)
    points = BendingPoints(test)
    curve, own = points.follow(relaxed, estimate_error=True)
    limit = float(curve.change_error[own].max())
    # Read without its history, the same loop is 8 to 22 % off.
    assert limit < 0.04
    change = bending_points(points, relaxed)
    assert np.abs(change - points.change).max() <= limit * np.abs(points.change).max()
    # Moments are nearly proportional to the rigidity.
    assert fitted(test) == pytest.approx(RIGIDITY, rel=limit)


@pytest.mark.slow
def test_a_fit_finds_the_rigidity_that_made_a_loop(relaxed):
    check_finds_itself(relaxed, "one side", "wale")


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["course", "wale"])
@pytest.mark.parametrize("name", TESTS)
def test_a_fit_finds_the_rigidity_whatever_the_shape_of_the_loop(relaxed, name, direction):
    check_finds_itself(relaxed, name, direction)


@pytest.mark.parametrize("curl", [0.0, 0.3])
def test_of_a_loop_the_mean_of_both_ways_from_flat_is_compared(curl):
    rising = np.concatenate([np.ones(20), -np.ones(40), np.ones(20)])
    # A constant friction moment; where the fabric turns, and before it is bent, there is none.
    friction = np.append(0.0, rising)
    friction[[20, 60]] = 0.0
    test = BendingPoints(bending("b", "course", LOOP, 2e-5 * LOOP + 1e-3 * friction + curl))
    inner = np.abs(test.at) < 160.0
    # At flat the mean holds half of the first pass, which begins without friction.
    flat = 0.5 * (0.5 * (0.0 + 1e-3) - 1e-3)
    assert test.change[inner] == pytest.approx(2e-5 * test.at[inner] - flat, abs=1e-12)
    assert (test.at.min(), test.at.max(), len(test.at)) == (-200.0, 200.0, 16)


def test_a_test_to_one_side_counts_from_flat():
    test = BendingPoints(bending("b", "wale", TO_ONE_SIDE, 1e-5 * TO_ONE_SIDE - 0.02))
    assert (test.at > 0.0).all()
    assert test.change == pytest.approx(1e-5 * test.at, abs=1e-12)


def test_many_noisy_points_are_thinned_to_passes_of_one_way():
    fine = np.interp(np.linspace(0.0, 80.0, 2001), np.arange(81.0), LOOP)
    noisy = fine + np.random.default_rng(1).uniform(-0.5, 0.5, len(fine))
    test = BendingPoints(bending("b", "course", noisy, 1e-5 * fine))
    steps = np.diff(test.curvature)
    # To +200, to -200 and back: three ways to go, each without a step back.
    assert (np.diff(np.sign(steps)) != 0).sum() == 2
    assert len(steps) == 3 * (PASS_POINTS - 1)
    # Numbers are off by the noise of the curvature and of the point at flat, the mean by half.
    assert test.change == pytest.approx(1e-5 * test.at, abs=1e-5)


def test_the_band_of_a_measured_test_holds_the_numerical_error(relaxed):
    test = BendingPoints(measured(relaxed, "one side", "course"))
    predictor = Predictor(COTTON, resolution=COARSE)
    found = predictor.measured_bending(test)
    one = found.quantities["moment_change"]
    np.testing.assert_allclose(one.value, bending_points(test, predictor.rest), rtol=1e-6)
    np.testing.assert_allclose(one.high - one.value, one.numerical_error)
    assert (found.at == test.at).all() and (one.numerical_error > 0.0).all()


def test_a_test_beyond_what_the_model_bends_is_said_to_be(relaxed):
    with pytest.raises((ComputationError, InputError)):
        bending_points(
            BendingPoints(bending("b", "wale", [0.0, 5e3, 1e4], [0.0, 1.0, 2.0])), relaxed
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"direction": "bias"}, "course or wale"),
        ({"curvature": [50.0, 50.0, 50.0]}, "must change"),
        ({"moment": [0.0, 0.0, 0.0]}, "zero throughout"),
        ({"moment": [0.0, 1.0]}, "3 numbers"),
        ({"cycle": 0}, "1 or more"),
    ],
)
def test_a_curve_that_makes_no_sense_is_refused(change, message):
    good = {
        "direction": "wale",
        "curvature": [0.0, 50.0, 100.0],
        "moment": [0.0, 1.0, 2.0],
    }
    with pytest.raises(InputError, match=message):
        BendingPoints(bending("b", **(good | change)))

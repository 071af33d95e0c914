"""Compression of crossed yarns: the law of the force, and its calibration."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from knitsim.errors import InputError
from knitsim.measured.read import read_measured
from knitsim.yarn.compression import crossed_force, fit_barrier, fit_barrier_test

D, K = 0.28e-3, 900.0


def naive_energy(distance):
    """Double integral of the barrier energy over two straight crossed yarns (J)."""

    def energy(s, t):
        x2 = (distance**2 + s * s + t * t) / D**2
        return K * (1 - x2) ** 2 / x2 if x2 < 1 else 0.0

    # One quarter, inside the circle where the yarns touch, so that the integrand is smooth.
    reach = np.sqrt(D**2 - distance**2)
    value, _ = dblquad(
        energy, 0, reach, 0, lambda t: np.sqrt(max(reach**2 - t * t, 0.0)), epsabs=0, epsrel=1e-11
    )
    return 4 * value


@pytest.mark.parametrize("part", [0.5, 0.8, 0.95])
def test_force_is_the_slope_of_the_energy(part):
    distance, h = part * D, 1e-4 * D
    slope = (naive_energy(distance - h) - naive_energy(distance + h)) / (2 * h)
    assert slope > 0
    assert crossed_force(distance, D, K) == pytest.approx(slope, rel=1e-5)


def test_no_force_beyond_one_diameter():
    assert crossed_force([D, 1.2 * D], D, K) == pytest.approx([0, 0], abs=0)


def test_round_trip_and_interval():
    distance = np.linspace(0.6, 1.1, 40) * D
    force = crossed_force(distance, D, K)
    fit = fit_barrier(distance, force, D)
    assert fit.stiffness == pytest.approx(K, rel=1e-12)
    inside = 0
    for seed in range(100):
        noise = np.random.default_rng(seed).normal(0, 0.01 * force.max(), force.size)
        fit = fit_barrier(distance, force + noise, D)
        inside += fit.low <= K <= fit.high
    assert inside >= 90


def test_file_in_textile_units(tmp_path):
    distance = np.linspace(0.65, 1.0, 12) * D
    lines = ["# synthetic", "thickness_mm;force_cN"]
    lines += [
        f"{1e3 * (x + D):.9f};{1e2 * f:.9f}".replace(".", ",")
        for x, f in zip(distance, crossed_force(distance, D, K), strict=True)
    ]
    path = tmp_path / "pressed.csv"
    path.write_text("\n".join(lines))
    test = read_measured(path)
    assert (test.kind, len(test)) == ("yarn_compression", 12)
    assert fit_barrier_test(test, D).stiffness == pytest.approx(K, rel=1e-6)


@pytest.mark.parametrize(
    ("distance", "force", "message"),
    [
        ([-1e-5, 1e-4, 2e-4, 2.1e-4], [1, 1, 1, 1], "must stay above the yarn's diameter"),
        ([1e-4, 3e-4, 4e-4, 5e-4], [1, 1, 1, 1], "1 points in contact"),
        ([1e-4, 1.5e-4, 2e-4, 2.2e-4], [-1, -1, -1, -1], "must rise as it thins"),
    ],
)
def test_bad_curves_are_refused(distance, force, message):
    with pytest.raises(InputError, match=message):
        fit_barrier(distance, force, D)

"""The clamped specimen against strips that are free or held all over, and differences of its energy."""

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from knitsim.errors import ComputationError, InputError
from knitsim.inference.specimen import Clamped, Membrane

ALONG, ACROSS, RATIO = 100.0, 60.0, 18.0  # moduli (N/m)


def membrane(direction="course"):
    x = np.linspace(-0.5, 1.0, 31)
    a, b = np.meshgrid(x, x, indexing="ij")
    p, q = (a, b) if direction == "course" else (b, a)
    energy = 0.5 * (ALONG * p**2 + 2 * RATIO * p * q + ACROSS * q**2) + 200.0 * p**4
    return Membrane(
        RectBivariateSpline(x, x, energy), 20.0, 0.0, x, x, np.ones((31, 31), dtype=bool)
    )


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_the_gradient_is_the_derivative_of_the_energy(direction):
    one = Clamped(membrane(direction), direction, 0.07, 0.05, (4, 3))
    rng = np.random.default_rng(0)
    u, way = 1e-3 * rng.standard_normal((2, 2 * len(one.x)))
    h = 1e-5
    slope = (one.energy(u + h * way)[0] - one.energy(u - h * way)[0]) / (2 * h)
    assert one.energy(u)[1] @ way == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_a_long_strip_contracts_and_a_wide_one_does_not(direction):
    strain = 0.05
    free = (ALONG - RATIO**2 / ACROSS) * strain + 800.0 * strain**3
    held = ALONG * strain + 800.0 * strain**3
    law = membrane(direction)
    force, inside, across = Clamped(law, direction, 1.0, 0.02, (30, 4)).pull([strain])
    assert force[0] == pytest.approx(free, rel=2e-3) and inside[0] == pytest.approx(
        strain, rel=2e-3
    )
    assert across[0] == pytest.approx(-RATIO / ACROSS * strain, rel=2e-3)
    force = Clamped(law, direction, 0.001, 1.0, (4, 30)).pull([strain])[0]
    assert force[0] == pytest.approx(held, rel=1e-4)


def test_more_elements_change_little_and_a_square_lies_between():
    law = membrane()
    coarse, fine = (
        Clamped(law, "course", 0.07, 0.07, n).pull([0.3])[0] for n in ((10, 10), (20, 20))
    )
    assert coarse == pytest.approx(fine, rel=5e-4)
    free, held = 0.3 * (ALONG - RATIO**2 / ACROSS), 0.3 * ALONG
    assert free < fine[0] - 800 * 0.3**3 < held


def test_a_specimen_beyond_its_table_and_one_without_size_are_refused():
    with pytest.raises(ComputationError, match="beyond its table at 120 %"):
        Clamped(membrane(), "course", 0.07, 0.07, (4, 4)).pull([1.2])
    with pytest.raises(InputError, match="specimen"):
        Clamped(membrane(), "course", 0.0, 0.07)

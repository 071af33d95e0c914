"""A contact law of one's own is one class; all that a study, a fit and the solver need follows from it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import quad
from test_equilibrium_fabric import COTTON

from knitsim.equilibrium.contact import (
    LAWS,
    TABLE,
    BarrierContact,
    ContactLaw,
    CoreContact,
    quantity,
)
from knitsim.equilibrium.fabric import Fabric
from knitsim.equilibrium.kernels.mean import core_integrals
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.errors import InputError
from knitsim.study.contact_keys import stated_contact
from knitsim.study.measured_keys import PARAMETERS
from knitsim.study.study import load_study

D = 0.2793e-3


@pytest.fixture
def power_law():
    """A law of a textile engineer: pressure grows with a power of the approach (van Wyk has 3)."""

    @dataclass(frozen=True)
    class PowerContact(ContactLaw):
        """Pressure of a mass of fibres."""

        section = "power_law"
        strength: float = quantity(
            "strength_N_per_m", "Strength.", unit="N_per_m", si="N m-1", allowed="(0, 1e6]"
        )
        power: float = quantity("power", "Power of the approach.", allowed="(1, 9]", default=2.5)

        def energy(self, distance, diameter):
            return self.strength * (diameter / distance - 1.0) ** self.power

    yield PowerContact
    del LAWS["power_law"]


def study_with(tmp_path, keys):
    (tmp_path / "yarns.yaml").write_text(
        "one:\n  count_tex: 56\n  fibres: 300\n  tension_law: {kind: points, strain: [0, 0.1], "
        f"tension_N: [0, 9]}}\n  {keys}\n"
    )
    (tmp_path / "fabrics.yaml").write_text(
        "plain:\n  yarn: one\n  wales_per_cm: 6.67\n  courses_per_cm: 8.33\n  loop_length_mm: 5.56\n"
    )
    (tmp_path / "scenes.yaml").write_text(
        "paper_yarn: {tensile_test: {}}\npaper_fabric: {equilibrium_rest: {}}\n"
    )
    return load_study(tmp_path)


def test_its_fields_are_keys_and_parameters(power_law, tmp_path):
    yarn = study_with(tmp_path, "power_law: {strength_N_per_m: 800}").yarns["one"]
    assert stated_contact(yarn) == power_law(800.0, 2.5)
    assert PARAMETERS["power_strength"].key == "yarn.power_law.strength_N_per_m"
    assert PARAMETERS["power_power"].meaningless([]) == "needs power_law, and the yarn has none"


@pytest.mark.parametrize(
    ("keys", "right"),
    [
        ("power_law: {strength_N_per_m: -1}", "must be above 0"),
        ("power_law: {power: 2}", "strength_N_per_m"),
        (
            "power_law: {strength_N_per_m: 1}\n  core_law: {core_diameter_mm: 0.1, "
            "stiffness_N_per_mm3: 1}",
            "keep one of them",
        ),
    ],
)
def test_its_keys_are_checked(power_law, tmp_path, keys, right):
    with pytest.raises(InputError, match=right):
        study_with(tmp_path, keys)


def test_the_table_is_the_law_it_was_made_from():
    # The laws compiled in closed form, tabulated instead.
    @dataclass(frozen=True)
    class Barrier(BarrierContact):
        branch = TABLE

    @dataclass(frozen=True)
    class Core(CoreContact):
        section = ""
        branch = TABLE

    for own, tabulated in (
        (BarrierContact(1e3), Barrier(1e3)),
        (CoreContact(0.1e-3, 2e9, 2.4), Core(0.1e-3, 2e9, 2.4)),
    ):
        core = own.core(D)
        distance = core + (D - core) * np.geomspace(2e-3, 0.999, 200)
        exact, table = own.at(distance, D), tabulated.at(distance, D)
        # Interpolated by a quintic over gaps that grow by 3 %: (0.03)^6/6! or so, less two orders
        # for the second derivative.
        for a, b, bound in zip(exact, table, (3e-7, 3e-6, 1e-5), strict=True):
            np.testing.assert_allclose(b, a, rtol=bound, atol=bound * np.abs(a[-1]))
        assert own.energy(distance, D) == pytest.approx(exact[0], rel=1e-9)


def test_slopes_of_the_table_are_those_of_its_energy(power_law):
    law, distance = power_law(800.0), np.linspace(0.3, 0.97, 23) * D
    step = 1e-6 * D
    v, first, second = law.at(distance, D)
    above, below = law.at(distance + step, D), law.at(distance - step, D)
    np.testing.assert_allclose((above[0] - below[0]) / (2 * step), first, rtol=1e-6)
    np.testing.assert_allclose((above[1] - below[1]) / (2 * step), second, rtol=1e-5)
    np.testing.assert_allclose(v, law.energy(distance, D), rtol=2e-6)


def test_an_energy_that_jumps_is_refused():
    @dataclass(frozen=True)
    class Jumping(ContactLaw):
        def energy(self, distance, diameter):
            return 1.0 + 0.0 * distance

    with pytest.raises(InputError, match="smooth function"):
        Jumping().soft(D)


def test_a_fabric_is_solved_with_it(power_law):
    fabric = Fabric(**COTTON)
    barrier = relax(fabric)
    own = relax(replace(fabric, contact=power_law(800.0, 2.0)))
    # The same energy as the barrier to leading order, 4 K (1 - x)^2, at K = 200 N/m.
    soft = relax(replace(fabric, contact=BarrierContact(200.0)))
    assert own.wale_spacing == pytest.approx(soft.wale_spacing, rel=2e-3)
    assert abs(own.wale_spacing - barrier.wale_spacing) > 3e-3 * barrier.wale_spacing
    curve = tensile(own, "course", [0.2, 0.4])
    # Force against the slope of the energy.
    there = tensile(own, "course", [0.399, 0.401])
    slope = np.diff(there.energy.sum(1)) / (0.002 * own.wale_spacing)
    assert curve.force_per_loop[1] == pytest.approx(slope[0], rel=1e-4)


@pytest.mark.parametrize("exponent", [1.05, 1.9, 2.0, 2.4, 3.0, 3.1, 8.0])
@pytest.mark.parametrize("w", [1e-3, 0.0999, 0.1001, 0.5, 0.9])
def test_integrals_of_a_core_law(exponent, w):
    law, q = CoreContact(core_diameter=0.15e-3, stiffness=1e9, exponent=exponent), exponent - 1.0
    found = core_integrals.py_func(w, law.soft(D))

    def value(x):
        return (1.0 - x) ** -q - 1.0 - q * x

    # At q = 1, where the second integral has another form, q is taken 1e-5 away.
    near = 5e-5 if exponent == 2.0 else 1e-8
    once = quad(value, 0.0, w)[0]
    twice = quad(lambda x: (w - x) * value(x), 0.0, w)[0]
    assert found == pytest.approx((value(w), once, twice), rel=near)

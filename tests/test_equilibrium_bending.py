"""Bending of the fabric: exact limits, derivatives, symmetry, curl."""

import numpy as np
import pytest

from knitsim.equilibrium.bending import bend
from knitsim.equilibrium.curved_kernels import add_curved_yarn, chord_square
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.friction_kernels import no_slip
from knitsim.equilibrium.newton_kernels import energy_of, new_work, pairs_at
from knitsim.equilibrium.relax import relax
from knitsim.equilibrium.scene import Bend
from knitsim.errors import InputError
from knitsim.yarn.law import paper_k3

COTTON = dict(
    wale_spacing=1.4993e-3,
    course_spacing=1.2005e-3,
    loop_length=5.56e-3,
    diameter=0.2793e-3,
    bending_rigidity=5e-9,
    law=paper_k3(continuous=True),
)


@pytest.fixture(scope="module")
def cotton():
    return relax(Fabric(**COTTON))


def disturbed(state):
    y = state.y.copy()
    rng = np.random.default_rng(0)
    y[: state.model.lattice] += 3e-6 * rng.standard_normal(state.model.lattice)
    return y


@pytest.mark.parametrize("direction", [0, 1])
@pytest.mark.parametrize("kappa", [0.0, 180.0, -90.0])
def test_derivatives_match_differences(cotton, direction, kappa):
    model, y = cotton.model, disturbed(cotton)
    work = new_work(model.scene)
    scene = model.scene._replace(bend=Bend(kappa, direction, True))
    pairs = pairs_at(scene, y, 1e-4, work)

    def at(kappa, y, order):
        bent = model.scene._replace(bend=Bend(kappa, direction, True))
        return energy_of(bent, y, pairs, no_slip(), order, work)

    at(kappa, y, 2)
    gradient, hessian = work.gradient.copy(), work.hessian.copy()
    by_kappa = work.by_kappa[0]
    assert work.terms.min() > 0.0
    step = 1e-2
    difference = (at(kappa + step, y, 0) - at(kappa - step, y, 0)) / (2 * step)
    assert abs(by_kappa) > 1e-9
    assert difference == pytest.approx(by_kappa, rel=1e-6)
    v = np.random.default_rng(2).standard_normal(len(y))
    step = 1e-10
    up = at(kappa, y + step * v, 1)
    gradient_up = work.gradient.copy()
    down = at(kappa, y - step * v, 1)
    assert (up - down) / (2 * step) == pytest.approx(gradient @ v, rel=1e-6)
    second = (gradient_up - work.gradient) / (2 * step)
    assert np.abs(second - hessian @ v).max() <= 1e-6 * np.abs(hessian @ v).max() > 0.0


def test_flat_fabric_is_the_limit(cotton):
    model, y = cotton.model, disturbed(cotton)
    work = new_work(model.scene)
    pairs = pairs_at(model.scene, y, 1e-4, work)
    flat = energy_of(model.scene, y, pairs, no_slip(), 2, work)
    gradient, hessian = work.gradient.copy(), work.hessian.copy()
    scene = model.scene._replace(bend=Bend(0.0, 0, True))
    assert energy_of(scene, y, pairs, no_slip(), 2, work) == pytest.approx(flat, rel=1e-13)
    np.testing.assert_allclose(work.gradient, gradient, atol=1e-12 * np.abs(gradient).max())
    np.testing.assert_allclose(work.hessian, hessian, atol=1e-12 * np.abs(hessian).max())


def test_straight_yarn_round_a_cylinder_keeps_its_own_rigidity(cotton):
    """Laid out along the course at z = 0 the yarn has the energy B kappa^2/2 per length."""
    scene = cotton.model.scene
    rod = scene.rod
    chain = int(rod.first.max()) + 4
    x = np.zeros((chain, 3))
    x[:, 0] = rod.span[0] * np.arange(chain)
    kappa = 137.0
    terms = np.zeros(3)
    size = 3 * chain + 4
    moment = add_curved_yarn(
        scene._replace(bend=Bend(kappa, 0, True)),
        x,
        1,
        np.zeros(size),
        np.zeros((size, size)),
        terms,
    )
    length = rod.weight.sum()
    assert terms[1] == pytest.approx(0.5 * 5e-9 * kappa**2 * length, rel=1e-12)
    assert moment == pytest.approx(5e-9 * kappa * length, rel=1e-12)
    assert terms[0] == pytest.approx(0.0, abs=1e-18)
    # Off the middle plane it is stretched by kappa z.
    x[:, 2] = 1e-5
    terms[:] = 0.0
    add_curved_yarn(
        scene._replace(bend=Bend(kappa, 0, True)),
        x,
        1,
        np.zeros(size),
        np.zeros((size, size)),
        terms,
    )
    assert terms[0] == pytest.approx(
        float(COTTON["law"].energy_at(kappa * 1e-5)) * length, rel=1e-3
    )


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.0099, 0.0101, 0.3])
def test_chord_between_points_of_a_cylinder(angle):
    kappa, delta = 200.0, angle / 200.0
    q, first, second, by_kappa = chord_square(delta, kappa)
    assert q == pytest.approx((2 * np.sin(angle / 2) / kappa) ** 2, rel=1e-12, abs=1e-30)
    step = 1e-7
    up, down = chord_square(delta + step, kappa), chord_square(delta - step, kappa)
    assert (up[0] - down[0]) / (2 * step) == pytest.approx(first, rel=1e-6, abs=1e-15)
    assert (up[1] - down[1]) / (2 * step) == pytest.approx(second, rel=1e-6)
    up, down = chord_square(delta, kappa + 0.01), chord_square(delta, kappa - 0.01)
    assert (up[0] - down[0]) / 0.02 == pytest.approx(by_kappa, rel=1e-4, abs=1e-4 * delta**2)


def test_plain_jersey_curls(cotton):
    # The feasibility study: holding moments -4.4 mN (course) and +5.1 mN (wale), rigidity 0.12 of
    # B/c and 0.88 of 2 B/w.
    moments = {}
    for direction in ("course", "wale"):
        curve = bend(cotton, direction, [0.0, 50.0, 150.0])
        assert curve.stop_reason == ""
        assert curve.crossings_intact.all()
        moments[direction] = curve.moment_per_width
    assert 1e3 * moments["course"][0] == pytest.approx(-4.4, abs=0.06)
    assert 1e3 * moments["wale"][0] == pytest.approx(5.1, abs=0.06)
    slope = {k: (m[2] - m[1]) / 100.0 for k, m in moments.items()}
    assert slope["course"] / (5e-9 / cotton.course_spacing) == pytest.approx(0.12, abs=0.01)
    assert slope["wale"] / (2 * 5e-9 / cotton.wale_spacing) == pytest.approx(0.85, abs=0.05)


def test_moment_is_the_derivative_of_the_relaxed_energy(cotton):
    step = 5.0
    curve = bend(cotton, "wale", [100.0 - step, 100.0, 100.0 + step])
    energy = curve.energy.sum(1)
    slope = (energy[2] - energy[0]) / (2 * step)
    area = curve.wale_spacing[1] * curve.course_spacing[1]
    assert curve.moment_per_width[1] == pytest.approx(slope / area, rel=1e-4)


def test_quarter_and_full_cell_agree(cotton):
    full = relax(Fabric(**COTTON), Resolution(48, 160, "full"))
    for direction in ("course", "wale"):
        one, other = (bend(r, direction, [0.0, 150.0]) for r in (cotton, full))
        np.testing.assert_allclose(one.moment_per_width, other.moment_per_width, rtol=5e-3)


def test_held_spacings_are_stiffer(cotton):
    free, held = (bend(cotton, "wale", [50.0, 150.0], spacings=s) for s in ("free", "held"))
    assert np.diff(held.moment_per_width)[0] > np.diff(free.moment_per_width)[0] > 0.0
    assert held.wale_spacing == pytest.approx(cotton.wale_spacing)


def test_impossible_bending_is_refused(cotton):
    for call, name in (
        (lambda: bend(cotton, "bias", [1.0]), "direction"),
        (lambda: bend(cotton, "wale", [1.0], spacings="loose"), "spacings"),
        (lambda: bend(cotton, "wale", [5000.0]), "curvature"),
        (lambda: bend(cotton, "wale", [np.nan]), "curvature"),
    ):
        with pytest.raises(InputError, match=name):
            call()

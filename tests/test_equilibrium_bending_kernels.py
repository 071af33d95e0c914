"""The kernels of bending against differences and against slow, obvious twins."""

import numpy as np
import pytest
from knitsim.equilibrium.kernels.follow_bent import angle_tangent

from knitsim.equilibrium.fabric import Fabric
from knitsim.equilibrium.kernels.contact import place_points
from knitsim.equilibrium.kernels.curved import Bent, add_curved_yarn, chord_square
from knitsim.equilibrium.kernels.curved_friction import (
    add_curved_friction,
    arm_at,
    begin_curved_slip,
    curved_loss,
    vector_at,
)
from knitsim.equilibrium.kernels.friction import no_slip
from knitsim.equilibrium.kernels.newton import energy_of, expand, new_work, pairs_at
from knitsim.equilibrium.kernels.records import Bend
from knitsim.equilibrium.relax import relax
from knitsim.yarn.law import paper_k3

COTTON = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))


@pytest.fixture(scope="module")
def cotton():
    return relax(COTTON)


def disturbed(state, size=3e-6, seed=0):
    y = state.y.copy()
    rng = np.random.default_rng(seed)
    y[: state.model.lattice] += size * rng.standard_normal(state.model.lattice)
    return y


def bent_scene(model, angle, direction):
    return model.scene._replace(bend=Bend(angle, direction, True))


def slip_from(model, y, angle, direction, rub, work):
    """Friction of a step that starts at y and this angle."""
    scene = bent_scene(model, angle, direction)
    pairs = pairs_at(scene, y, 1e-4, work)
    lattice = expand(scene.map, y, work.x)
    place_points(scene.touch, work.x, work.points)
    kappa = angle / lattice[3 * direction]
    return begin_curved_slip(scene, kappa, work.x, work.points, lattice, pairs, rub), pairs


@pytest.mark.parametrize("direction", [0, 1])
@pytest.mark.parametrize("kappa", [0.0, 180.0, -90.0])
@pytest.mark.parametrize(
    "rub", [(0.0, 1.0, 0.0, 1.0), (0.3, 3e-6, 0.0, 1.0), (0.0, 1.0, 1e-6, 300.0)]
)
def test_derivatives_match_differences(cotton, direction, kappa, rub):
    model, start = cotton.model, disturbed(cotton)
    work, at = new_work(model.scene), model.lattice + 3 * direction
    angle = kappa * start[at]
    slip, pairs = slip_from(model, start, angle - 2e-3, direction, rub, work)
    y = start + 1e-7 * np.random.default_rng(1).standard_normal(len(start))

    def at_angle(angle, y, order):
        return energy_of(bent_scene(model, angle, direction), y, pairs, slip, order, work)

    energy = at_angle(angle, y, 2)
    gradient, hessian, w = work.gradient.copy(), work.hessian.copy(), y[at]
    first, second = work.by_kappa[0] / w, work.by_kappa[1] / w**2
    lost = rub[0] + rub[2] > 0.0
    assert (energy > work.terms.sum()) == lost
    assert work.terms.min() > 0.0
    # By the angle: the energy, its slope, the gradient (by way of the answer of all unknowns).
    step = 1e-6
    up = at_angle(angle + step, y, 1)
    ends = [(up, work.by_kappa[0] / w, work.gradient.copy())]
    down = at_angle(angle - step, y, 1)
    ends.append((down, work.by_kappa[0] / w, work.gradient.copy()))
    slopes = [(a - b) / (2 * step) for a, b in zip(*ends, strict=True)]
    assert abs(first) > 1e-7
    assert slopes[0] == pytest.approx(first, rel=1e-5)
    assert slopes[1] == pytest.approx(second, rel=1e-6)
    at_angle(angle, y, 2)
    everything = np.arange(len(y))
    work.factor[:] = 0.0
    np.fill_diagonal(work.factor, 1.0)
    change = np.empty(len(y))
    angle_tangent(bent_scene(model, angle, direction), y, everything, work, change)
    assert np.abs(slopes[2] + change).max() <= 1e-6 * np.abs(change).max() > 0.0
    # By the unknowns.
    v = np.random.default_rng(2).standard_normal(len(y))
    step = 1e-10
    up = at_angle(angle, y + step * v, 1)
    gradient_up = work.gradient.copy()
    down = at_angle(angle, y - step * v, 1)
    assert (up - down) / (2 * step) == pytest.approx(gradient @ v, rel=1e-6)
    second = (gradient_up - work.gradient) / (2 * step)
    assert np.abs(second - hessian @ v).max() <= 3e-6 * np.abs(hessian @ v).max() > 0.0


def test_flat_fabric_is_the_limit(cotton):
    model, y = cotton.model, disturbed(cotton)
    work = new_work(model.scene)
    pairs = pairs_at(model.scene, y, 1e-4, work)
    flat = energy_of(model.scene, y, pairs, no_slip(), 2, work)
    gradient, hessian = work.gradient.copy(), work.hessian.copy()
    scene = bent_scene(model, 0.0, 0)
    assert energy_of(scene, y, pairs, no_slip(), 2, work) == pytest.approx(flat, rel=1e-13)
    np.testing.assert_allclose(work.gradient, gradient, atol=1e-12 * np.abs(gradient).max())
    np.testing.assert_allclose(work.hessian, hessian, atol=1e-12 * np.abs(hessian).max())


def yarn_energy(scene, kappa, x):
    """Energies by term and the derivative by kappa of control points x."""
    size = 3 * len(x) + 4
    out = Bent(np.zeros(size), np.zeros((size, size)), np.zeros(size), np.zeros(2))
    terms = np.zeros(3)
    add_curved_yarn(scene._replace(bend=Bend(0.0, 0, True)), kappa, x, 1, out, terms)
    return terms, out.by_kappa[0]


def test_straight_yarn_round_a_cylinder_keeps_its_own_rigidity(cotton):
    """Laid out along the course at z = 0 the yarn has the energy B kappa^2/2 per length."""
    scene = cotton.model.scene
    rod = scene.rod
    chain = int(rod.first.max()) + 4
    x = np.zeros((chain, 3))
    x[:, 0] = rod.span[0] * np.arange(chain)
    kappa = 137.0
    terms, moment = yarn_energy(scene, kappa, x)
    length = rod.weight.sum()
    assert terms[1] == pytest.approx(0.5 * 5e-9 * kappa**2 * length, rel=1e-12)
    assert moment == pytest.approx(5e-9 * kappa * length, rel=1e-12)
    assert terms[0] == pytest.approx(0.0, abs=1e-18)
    # Off the middle plane it is stretched by kappa z.
    x[:, 2] = 1e-5
    terms, _ = yarn_energy(scene, kappa, x)
    assert terms[0] == pytest.approx(float(COTTON.law.energy_at(kappa * 1e-5)) * length, rel=1e-3)


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.0099, 0.0101, 0.3])
def test_chord_and_arm_of_points_on_a_cylinder(angle):
    kappa, delta = 200.0, angle / 200.0
    q, first, second, by_kappa, mixed, by_kappas = chord_square(delta, kappa)
    s, s1, s2 = arm_at(delta, kappa)
    assert q == pytest.approx((2 * np.sin(angle / 2) / kappa) ** 2, rel=1e-12, abs=1e-30)
    assert s == pytest.approx(np.sin(angle / 2) / kappa, rel=1e-12, abs=1e-30)
    step = 1e-7
    up, down = chord_square(delta + step, kappa), chord_square(delta - step, kappa)
    assert (up[0] - down[0]) / (2 * step) == pytest.approx(first, rel=1e-6, abs=1e-15)
    assert (up[1] - down[1]) / (2 * step) == pytest.approx(second, rel=1e-6)
    # By kappa, where differences drown in round-off only below a tiny angle.
    up, down = (chord_square(delta, kappa + k) + arm_at(delta, kappa + k) for k in (1.0, -1.0))
    for got, place, size in (
        (by_kappa, 0, delta**3),
        (mixed, 1, delta**2),
        (by_kappas, 3, delta**4),
        (s1, 6, delta**2),
        (s2, 7, delta**3),
    ):
        assert (up[place] - down[place]) / 2.0 == pytest.approx(got, rel=1e-4, abs=1e-4 * size)


def in_space(point, kappa):
    """A point of the fabric in space, the axis of the cylinder at the origin."""
    x, y, z = point
    radius = 1.0 / kappa + z
    return np.array([radius * np.sin(kappa * x), y, radius * np.cos(kappa * x)])


def in_turning_frame(a, b, kappa):
    """Vector from b to a in space, seen from half way between them."""
    d = in_space(a, kappa) - in_space(b, kappa)
    turn = kappa * 0.5 * (a[0] + b[0])
    s, c = np.sin(turn), np.cos(turn)
    return np.array([c * d[0] - s * d[2], d[1], s * d[0] + c * d[2]])


def test_slip_is_that_in_the_frame_that_turns_with_the_fabric():
    rng = np.random.default_rng(3)
    for kappa in (150.0, -220.0):
        a, b = 3e-4 * rng.standard_normal((2, 3))
        expected = in_turning_frame(a, b, kappa)
        got = vector_at((a[0] - b[0], a[1] - b[1], a[2], b[2]), kappa)
        np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-17)
        # A rotation of the whole about the axis is no slip.
        along = np.array([1e-3, 0.0, 0.0])
        moved = in_turning_frame(a + along, b + along, kappa)
        np.testing.assert_allclose(moved, got, atol=1e-17)


def test_friction_potential_is_the_sum_over_the_pairs(cotton):
    """Written out in plain arrays: mu N f0(|u|), and the loss mu N u f1."""
    model, direction = cotton.model, 1
    work, rounding, friction = new_work(model.scene), 2e-7, 0.3
    slip, pairs = slip_from(model, cotton.y, 0.0, direction, (friction, rounding, 0.0, 1.0), work)
    y, angle = disturbed(cotton, 1e-7, 4), 0.03

    def pair_at(y, i, k, g):
        """The two points in the fabric's coordinates, bent axis first."""
        image, points = model.scene.touch.images[g], work.points
        expand(model.scene.map, y, work.x)
        place_points(model.scene.touch, work.x, points)
        other = image.sign * points[k]
        other[:2] += image.steps @ y[model.lattice :].reshape(2, 2)
        return points[i][[1, 0, 2]], other[[1, 0, 2]]

    kappa = angle / y[model.lattice + 3]
    potential = lost = 0.0
    for (i, k, g), weight, rub in zip(*pairs, slip.pairs, strict=True):
        a, b = pair_at(cotton.y, i, k, g)
        before = a - b
        after = in_turning_frame(*pair_at(y, i, k, g), kappa)
        x = np.linalg.norm(before) / COTTON.diameter
        force = 2e3 * (1 / x - x) * (1 / x**2 + 1) / COTTON.diameter * weight if x < 1.0 else 0.0
        normal = before / np.linalg.norm(before)
        u = after - before
        size = np.linalg.norm(u - normal * (u @ normal))
        s = min(size / rounding, 1.0)
        inside = rounding * (s**2 - s**3 / 3.0)
        potential += friction * force * (inside + max(size - rounding, 0.0))
        lost += friction * force * size * (2 * s - s**2)
        assert rub["limit"] == pytest.approx(friction * force, rel=1e-9, abs=1e-15)
    lattice = expand(model.scene.map, y, work.x)
    place_points(model.scene.touch, work.x, work.points)
    scene = bent_scene(model, angle, direction)
    size = len(work.expanded)
    out = Bent(np.zeros(size), np.zeros((size, size)), np.zeros(size), np.zeros(2))
    got = add_curved_friction(scene, kappa, work.points, lattice, slip, 0, out)
    assert got == pytest.approx(potential, rel=1e-9)
    assert potential > 0.0
    loss = curved_loss(scene, kappa, work.x, work.points, lattice, slip)
    assert loss == pytest.approx(lost, rel=1e-9)

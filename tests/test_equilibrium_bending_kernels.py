"""The kernels of bending against differences and against slow, obvious twins."""

import itertools

import numpy as np
import pytest
from friction_tools import (
    LAGGING,
    elongations,
    potential_of,
    rub_of,
    slip_through,
    sticking_and_sliding,
    stretched,
    turned,
    virgin,
)

from knitsim.equilibrium.fabric import Fabric
from knitsim.equilibrium.kernels.curved import chord_square
from knitsim.equilibrium.kernels.curved_friction import arm_at, vector_at
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.pairs import Listed, expand, pairs_at, place_frames, place_points
from knitsim.equilibrium.kernels.records import (
    ANGLE,
    LATTICE,
    MAP_ROW,
    Bend,
    Map,
    no_pairs,
    records,
)
from knitsim.equilibrium.kernels.slip import add_pairs, begin_slip, end_slip, lag_slip, press_of
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


def bent(model, y, kappa, direction):
    """The scene bent along ``direction``, and y with the angle that belongs to the curvature."""
    at = model.lattice
    y = y.copy()
    y[at + ANGLE] = kappa * y[at + 3 * direction]
    return model.scene._replace(bend=Bend(direction)), y


def with_history(model, y, kappa, direction, rub):
    """Friction of a step that ends near y and kappa; some places stick and some slide."""
    rng, ways = np.random.default_rng(5), []
    for turn in (-8.0, -3.0, 0.0):
        moved = y.copy()
        moved[: model.lattice] += 1e-6 * rng.standard_normal(model.lattice)
        ways.append(bent(model, moved, kappa + turn, direction)[1])
    scene, work = bent(model, y, kappa, direction)[0], new_work(model.scene)
    slip, memory = slip_through(scene, ways, rub, 1e-4, work)
    assert np.abs(memory.lags["held"] if rub.couple else memory.pairs["held"]).max() > 0.0
    return slip


@pytest.mark.parametrize("direction", [0, 1])
@pytest.mark.parametrize("kappa", [0.0, 180.0, -90.0])
@pytest.mark.parametrize("friction", ["yarn alone", "contact", "pairs", "yarn"])
def test_derivatives_match_differences(cotton, direction, kappa, friction):
    """By all unknowns, the angle among them; of the contacts or of friction the own part alone."""
    model = cotton.model
    scene, y = bent(model, disturbed(cotton), kappa, direction)
    work, slip = new_work(scene), ()
    if friction in ("pairs", "yarn"):
        rub = rub_of(COTTON) if friction == "pairs" else rub_of(COTTON, 0.0, LAGGING)
        slip = with_history(model, y, kappa, direction, rub)
        springs = elongations(scene, y, slip)
        which = (slip.pairs, springs[0]) if friction == "pairs" else (slip.lags, springs[1])
        assert min(sticking_and_sliding(*which)) > 5
    listed = pairs_at(scene, y, 1e-4, work)
    # Of an angle the derivatives are couples: over the spacing they are forces as the others.
    unit = np.ones(len(y))
    unit[-1] = 1.0 / COTTON.wale_spacing

    none = Listed(*no_pairs(), y, np.zeros(1))

    def parts(y, listed, slip):
        energy = energy_of(scene, y, listed, slip, 2, work)
        return energy, unit * work.gradient, np.outer(unit, unit) * work.hessian

    def at(y):
        if friction == "yarn alone":
            return parts(y, none, ())
        whole, less = parts(y, listed, slip), parts(y, listed if slip else none, ())
        return tuple(a - b for a, b in zip(whole, less, strict=True))

    energy, gradient, hessian = at(y)
    assert energy > 0.0
    assert np.abs(hessian - hessian.T).max() <= 1e-12 * np.abs(hessian).max()
    # Random ways soon meet the limit of a spring; the angle is known to fewer digits.
    ways = [(np.eye(len(y))[-1], 1e-9)]
    ways += [(v, 1e-10) for v in np.random.default_rng(2).standard_normal((3, len(y)))]
    assert abs(gradient[-1]) > 1e-4 * np.abs(gradient).max()
    for v, step in ways:
        (up, gradient_up, _), (down, gradient_down, _) = (
            at(y + s * unit * v) for s in (step, -step)
        )
        assert (up - down) / (2 * step) == pytest.approx(gradient @ v, rel=2e-5)
        difference = (gradient_up - gradient_down) / (2 * step)
        # The contacts' Hessian leaves out how their cells change.
        exact = 0.08 if friction == "contact" else 3e-6
        assert np.abs(difference - hessian @ v).max() <= exact * np.abs(hessian @ v).max() > 0.0


def test_flat_fabric_is_the_limit(cotton):
    model, y = cotton.model, disturbed(cotton)
    work = new_work(model.scene)
    pairs = pairs_at(model.scene, y, 1e-4, work)
    for rub in (None, rub_of(COTTON), rub_of(COTTON, 0.0, LAGGING)):
        slip = with_history(model, y, 0.0, 0, rub) if rub else ()
        flat = energy_of(model.scene, y, pairs, slip, 2, work)
        gradient, hessian = work.gradient.copy(), work.hessian.copy()
        scene, _ = bent(model, y, 0.0, 0)
        assert energy_of(scene, y, pairs, slip, 2, work) == pytest.approx(flat, rel=1e-13)
        inner = slice(0, model.lattice + 4)  # the flat fabric knows no angle
        for found, right in (
            (work.gradient[inner], gradient[inner]),
            (work.hessian[inner, inner], hessian[inner, inner]),
        ):
            np.testing.assert_allclose(found, right, atol=1e-12 * np.abs(right).max())


def yarn_energy(scene, kappa, x):
    """Energies by term and the derivative by kappa of control points x, whatever the map."""
    spacing = 1e-3
    rows = records(
        MAP_ROW, x.size + LATTICE, offset=[*x.ravel(), spacing, 0, 0, spacing, kappa * spacing]
    )
    scene = scene._replace(map=Map(rows, scene.map.entries), bend=Bend(0))
    work = new_work(scene)
    energy_of(scene, np.zeros(len(scene.load)), Listed(*no_pairs(), (), ()), (), 1, work)
    return work.terms, work.bent.by_kappa[0]


@pytest.mark.slow
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


@pytest.mark.parametrize("direction", [None, 0, 1])
def test_friction_is_the_sum_over_the_pairs(cotton, direction):
    """Two steps, written out in plain arrays pair by pair: elongations, potential, losses, memory."""
    model = cotton.model
    rub, work = rub_of(COTTON), new_work(model.scene)
    ways = [
        bent(model, disturbed(cotton, 1e-6, seed), kappa, direction or 0)[1]
        for seed, kappa in ((1, 40.0), (2, 45.0), (3, 35.0))
    ]
    scene, memory = model.scene, virgin(rub)
    if direction is not None:
        scene = scene._replace(bend=Bend(direction))

    def vector(y, pair):
        """From the image of the one point to the other, in the frame half way between them."""
        i, k, g = pair
        image = scene.touch.images[g]
        expand(scene.map, y, work.x)
        place_points(scene.touch, work.x, work.points)
        own, other = work.points[i, :3].copy(), image.sign * work.points[k, :3]
        other[:2] += image.steps @ y[model.lattice : -1].reshape(2, 2)
        if direction is None:
            return own - other
        kappa = y[-1] / y[model.lattice + 3 * direction]
        order = [0, 1, 2] if direction == 0 else [1, 0, 2]
        return in_turning_frame(own[order], other[order], kappa)

    def limit_at(y, pair, weight):
        lattice = expand(scene.map, y, work.x)
        place_frames(scene.touch, work.x, work.points)
        return rub.friction * press_of(scene, lattice, pair, work) * weight

    remembered = {}
    for start, end in itertools.pairwise(ways):
        listed = pairs_at(scene, start, 1e-4, work)
        slip = begin_slip(scene, start, listed, rub, memory, work)
        lag_slip(scene, end, slip, rub, work)
        potential = lost = held = 0.0
        after = {}
        for pair, weight in zip(listed.pairs.tolist(), listed.weight, strict=True):
            here, there = vector(start, pair), vector(end, pair)
            normal, k = there / np.linalg.norm(there), rub.shell * weight
            e0, facing = remembered.get(tuple(pair), (np.zeros(3), np.zeros(3)))
            e = stretched(here, there, normal, e0, facing)
            before, limit = (limit_at(one, tuple(pair), weight) for one in (start, end))
            size = np.linalg.norm(e)
            if limit == before == 0.0:
                continue
            potential += potential_of(size, k, limit) if limit > 0.0 else 0.0
            kept = min(1.0, limit / (k * size))
            if kept < 1.0:
                # Straight from e0 to e: where it last rises above a limit that changes evenly.
                e0, t = turned(e0, facing, normal), np.linspace(0.0, 1.0, 2001)
                allowed = before + t * (limit - before)
                below = np.linalg.norm(e0 + np.outer(t, e - e0), axis=1) * k < (1 - 1e-9) * allowed
                onset = allowed[np.flatnonzero(below)[-1] + 1] if below.any() else before
                lost += 0.5 * (onset + limit) * (1.0 - kept) * size
            held += 0.5 * k * (kept * size) ** 2
            if kept > 0.0:
                after[tuple(pair)] = (kept * e, normal)
        lattice = expand(scene.map, end, work.x)
        place_points(scene.touch, work.x, work.points)
        found = add_pairs(scene, lattice, slip, 0, work)
        assert found == pytest.approx(potential, rel=1e-9) and found > 0.0
        memory, found_lost, found_held = end_slip(scene, end, slip, work)
        assert found_lost == pytest.approx(lost, rel=1e-3) and lost > 0.01 * held
        assert found_held == pytest.approx(held, rel=1e-9) and held > 0.0
        assert {tuple(row["pair"].tolist()) for row in memory.pairs} == set(after)
        for row in memory.pairs:
            e, normal = after[tuple(row["pair"].tolist())]
            np.testing.assert_allclose(row["held"], e, atol=1e-9 * np.linalg.norm(e))
            np.testing.assert_allclose(row["facing"], normal, atol=1e-12)
        remembered = after
    assert len(remembered) > 30

"""Energies of the equilibrium model against slow twins, and their derivatives against differences."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from contact_tools import barrier, cell_means, expanded
from friction_tools import (
    LAGGING,
    elongations,
    potential_of,
    rub_of,
    slip_through,
    sticking_and_sliding,
)

from knitsim.equilibrium import cell as cells
from knitsim.equilibrium import spline
from knitsim.equilibrium.contact import BarrierContact, CoreContact
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.contact import law_at
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.fixtures import add_couples
from knitsim.equilibrium.kernels.friction import spring_at
from knitsim.equilibrium.kernels.pairs import SPREAD, Listed, pairs_at
from knitsim.equilibrium.kernels.records import (
    COUPLE,
    CYLINDER,
    LATTICE,
    Fixtures,
    no_pairs,
    records,
)
from knitsim.equilibrium.kernels.yarn import bend_at, stretch_at
from knitsim.equilibrium.model import build_model, centreline, resampled, rounded_law, with_set
from knitsim.equilibrium.relax import start_from
from knitsim.verification.judge.given import law_energy
from knitsim.yarn.law import TensionLaw, bilinear, paper_k3

COTTON = dict(
    wale_spacing=1.4993e-3, course_spacing=1.2005e-3, loop_length=5.56e-3, diameter=0.2793e-3,
    bending_rigidity=5e-9, law=paper_k3(continuous=True),
)  # fmt: skip
SOFT = CoreContact(core_diameter=0.15e-3, stiffness=2e9, exponent=2.4)


def model_and_state(cell="symmetric", contact=None, set_fraction=0.0, spin="held", seed=0):
    contact = contact or BarrierContact(1000.0)
    fabric = Fabric(**COTTON, contact=contact, set_fraction=set_fraction, spin=spin)
    model = build_model(fabric, Resolution(24, cell=cell))
    y = start_from(model, fabric.diameter, 1.19 * fabric.diameter)
    if set_fraction:
        model = with_set(model, y)
    rng = np.random.default_rng(seed)
    y[: model.lattice] += 0.02 * fabric.diameter * rng.standard_normal(model.lattice)
    y[model.lattice : -1] += 0.02 * fabric.diameter * rng.standard_normal(4)
    if cell == "symmetric":
        y[model.lattice + 1 : model.lattice + 3] = 0.0
    return model, y


def with_history(model, y, rub):
    """Friction of a step that ends near y, after another one; some places stick and some slide."""
    work, rng = new_work(model.scene), np.random.default_rng(5)
    size = np.full(len(y), 8e-3 * model.fabric.diameter)
    size[-1] = 0.0
    ways = [y + size * rng.standard_normal(len(y)) for _ in range(3)]
    slip, memory = slip_through(model.scene, ways, rub, model.control.skin, work)
    if rub.friction > 0.0:
        assert np.abs(memory.pairs["held"]).max() > 0.0
    if rub.couple:
        assert np.abs(memory.lags["held"]).max() > 0.0
    return slip


@pytest.mark.parametrize("friction", ["yarn alone", "contact", "pairs", "yarn"])
@pytest.mark.parametrize(
    "case",
    [
        ("symmetric", None, 0.0),
        ("full", None, 0.0),
        ("symmetric", SOFT, 0.0),
        ("full", None, 0.6),
        ("full", None, 0.6, "free"),
    ],
    ids=["symmetric", "full", "core", "set", "set-free"],
)
def test_gradient_and_hessian_match_differences(case, friction):
    model, y = model_and_state(*case)
    scene, work = model.scene, new_work(model.scene)
    pairs = pairs_at(scene, y, 0.5 * model.fabric.diameter, work)
    slip = ()
    if friction == "pairs":
        slip = with_history(model, y, rub_of(model.fabric))
        springs = elongations(scene, y, slip)[0]
        assert min(sticking_and_sliding(slip.pairs, springs)) > 10
    elif friction == "yarn":
        slip = with_history(model, y, rub_of(model.fabric, 0.0, LAGGING))
        springs = elongations(scene, y, slip)[1]
        assert min(sticking_and_sliding(slip.lags, springs)) > 5

    none = Listed(*no_pairs(), y, np.zeros(1))

    def at(y):
        """Energy, gradient and Hessian: of the contacts alone or, of friction, its own part."""
        whole = energy_of(scene, y, pairs, slip, 2, work)
        parts = whole, work.gradient.copy(), work.hessian.copy()
        assert work.terms.min() > 0.0  # stretch, bending and contact are all at work
        if friction == "yarn alone":
            less = 0.0, 0.0, 0.0
            whole = energy_of(scene, y, none, (), 2, work)
            parts = whole, work.gradient.copy(), work.hessian.copy()
        else:
            smooth = energy_of(scene, y, pairs if slip else none, (), 2, work)
            less = smooth, work.gradient, work.hessian
        return tuple(a - b for a, b in zip(parts, less, strict=True))

    energy, gradient, hessian = at(y)
    assert energy > 0.0
    assert np.abs(hessian - hessian.T).max() <= 1e-12 * np.abs(hessian).max()
    assert not gradient[-1] and not hessian[-1].any()  # a flat fabric has no angle
    # The contacts' Hessian leaves out how their cells change.
    exact = 0.08 if friction == "contact" else 2e-6
    rng = np.random.default_rng(1)
    step = 1e-6 * model.fabric.diameter
    for _ in range(5):
        v = rng.standard_normal(len(y))
        (up, gradient_up, _), (down, gradient_down, _) = at(y + step * v), at(y - step * v)
        assert abs(gradient @ v) > 1e-3 * np.linalg.norm(gradient)
        assert (up - down) / (2 * step) == pytest.approx(gradient @ v, rel=1e-5)
        difference = (gradient_up - gradient_down) / (2 * step)
        assert np.abs(hessian @ v).max() > 0.0
        assert np.abs(difference - hessian @ v).max() <= exact * np.abs(hessian @ v).max()


def brute_energy(model, y):
    """Energies per loop of a full cell of one loop, from the formulas, without pair lists."""
    fabric, n = model.fabric, model.cell.points
    loop = cells.loops_of(model.cell, y)[0]
    lattice = y[model.lattice :]
    a1, a2 = np.array([*lattice[:2], 0.0]), np.array([*lattice[2:4], 0.0])
    chain = np.concatenate([loop[-1:] - a1, loop, loop[:2] + a1])
    h = fabric.loop_length / n
    law = SimpleNamespace(law_strain=fabric.law.strain, law_tension=fabric.law.tension)
    stretch = bend = 0.0
    for i in range(n):
        for t, weight in zip(spline.GAUSS_POINTS, spline.GAUSS_WEIGHTS, strict=True):
            v = spline.basis_first([t])[0] @ chain[i : i + 4]
            a = spline.basis_second([t])[0] @ chain[i : i + 4]
            speed = np.linalg.norm(v)
            stretch += weight * h * float(law_energy(speed / h - 1.0, law, 4e-4))
            curvature = np.linalg.norm(np.cross(v, a)) / speed**3 * (speed / h)
            bend += weight * h * 0.5 * fabric.bending_rigidity * curvature**2
    m = model.cell.contacts
    u = (np.arange(m) + 0.5) * n / m
    at, place = spline.split(u, n)
    points, step, turn = (
        np.einsum("ma,mak->mk", basis(place) * (n / m) ** order, chain[at[:, None] + np.arange(4)])
        for order, basis in enumerate((spline.basis, spline.basis_first, spline.basis_second))
    )
    arc = u * h
    contact = 0.0
    for i2 in range(-2, 3):
        for i1 in range(-2, 3):
            d = points[:, None] - points[None] - i1 * a1 - i2 * a2
            near = np.abs(arc[:, None] - arc[None] - i1 * fabric.loop_length)
            counts = (np.linalg.norm(d, axis=2) < 2.0 * fabric.diameter) & (
                (i2 != 0) | (near >= 1.6 * fabric.diameter)
            )
            i, k = np.nonzero(counts)
            cells_of = expanded(d[i, k], step[i], step[k], turn[i] - turn[k])
            contact += (
                0.5 * cell_means(*cells_of, lambda q: barrier(q, 1000.0, fabric.diameter)).sum()
            )
    return np.array([stretch, bend, contact * (fabric.loop_length / m) ** 2])


def test_energy_of_the_full_cell_matches_brute_force():
    model, y = model_and_state("full")
    work = new_work(model.scene)
    pairs = pairs_at(model.scene, y, 0.1 * model.fabric.diameter, work)
    energy_of(model.scene, y, pairs, (), 0, work)
    expected = brute_energy(model, y)
    assert expected.min() > 0.0
    np.testing.assert_allclose(work.terms[:2], expected[:2], rtol=1e-12)
    np.testing.assert_allclose(work.terms[2], expected[2], rtol=1e-4)


def test_quarter_and_full_cell_have_the_same_energy():
    fabric = Fabric(**COTTON)
    terms = []
    for cell in ("symmetric", "full"):
        model = build_model(fabric, Resolution(24, cell=cell))
        y = start_from(model, fabric.diameter, 1.19 * fabric.diameter)
        work = new_work(model.scene)
        pairs = pairs_at(model.scene, y, 0.1 * fabric.diameter, work)
        energy_of(model.scene, y, pairs, (), 0, work)
        terms.append(work.terms.copy())
    assert min(terms[0]) > 0.0
    np.testing.assert_allclose(terms[0], terms[1], rtol=1e-12)


def test_translation_and_period_change_nothing():
    model, y = model_and_state("full")
    loop = cells.loops_of(model.cell, y)[0]
    lattice = y[model.lattice :]

    def energy(points):
        # Straight through the kernels with an own map: every control point by itself.
        work = new_work(model.scene)
        pairs = pairs_at(model.scene, y, 0.3 * model.fabric.diameter, work)
        step = np.array([*lattice[:2], 0.0])
        chain = np.concatenate([points[-1:] - step, points, points[:2] + step])
        rows = chain.shape[0] * 3
        free = cells.to_map([{i: 1.0} for i in range(rows)], rows)
        scene = model.scene._replace(map=free, load=np.zeros(rows + LATTICE))
        full = np.concatenate([chain.ravel(), lattice])
        work = new_work(scene)
        pairs = pairs_at(scene, full, 0.1 * model.fabric.diameter, work)
        return energy_of(scene, full, pairs, (), 0, work)

    reference = energy(loop)
    assert reference > 0.0
    moved = loop + np.array([0.4e-3, -0.7e-3, 0.2e-3])
    assert energy(moved) == pytest.approx(reference, rel=1e-11)
    shifted = loop + np.array([*lattice[:2], 0.0])
    assert energy(shifted) == pytest.approx(reference, rel=1e-11)


@pytest.mark.parametrize(
    "law",
    [paper_k3(continuous=True), paper_k3(continuous=False), bilinear(6.34, 2.41, 0.02, 0.1)],
    ids=["k3", "k3-printed", "bilinear"],
)
def test_rounded_tension_law(law):
    smooth = rounded_law(law)
    kink = law.strain[1]
    half = smooth.kinks.half_width[0]
    assert 0.0 < half <= 4e-4
    strains = np.concatenate([np.linspace(-0.01, 0.06, 701), kink + half * np.linspace(-1, 1, 41)])
    largest = 0.0
    for e in strains:
        energy, tension, stiffness = stretch_at(e, smooth)
        if abs(e - kink) > half:
            assert tension == pytest.approx(float(law.tension_at(e)), rel=1e-12, abs=1e-15)
        else:
            largest = max(largest, abs(tension - float(law.tension_at(e))))
        step = 1e-8
        up, down = stretch_at(e + step, smooth), stretch_at(e - step, smooth)
        assert (up[0] - down[0]) / (2 * step) == pytest.approx(tension, rel=1e-5, abs=1e-6)
        if abs(abs(e - kink) - half) > 2 * step:
            assert (up[1] - down[1]) / (2 * step) == pytest.approx(stiffness, rel=1e-5)
        assert energy >= 0.0
    slopes = (
        np.diff(law.tension)[np.diff(law.strain) > 0] / np.diff(law.strain)[np.diff(law.strain) > 0]
    )
    jump = abs(smooth.kinks.jump).max()
    assert largest <= abs(np.diff(slopes)[0]) * half / 4 + jump + 1e-12


def test_rounding_never_reaches_a_neighbouring_kink():
    law = TensionLaw([0.0, 1e-4, 3e-4, 0.1], [0.0, 1e-3, 6e-3, 9.0])
    smooth = rounded_law(law)
    assert smooth.kinks.half_width == pytest.approx([0.5e-4, 1e-4])
    assert stretch_at(0.0, smooth) == pytest.approx((0.0, 0.0, 10.0))


def test_bending_energy_with_rest_curvature():
    bending, rest, rounding = 2e-9, 700.0, 3.0
    for curvature in (0.0, 1.0, 350.0, 700.0, 1500.0):
        square = curvature**2
        energy, first, second = bend_at(square, bending, rest, rounding)
        m = math.sqrt(square + rounding**2)
        assert energy == pytest.approx(0.5 * bending * (m - rest) ** 2, rel=1e-13, abs=1e-30)
        step = 1e-4 * rounding**2
        up = bend_at(square + step, bending, rest, rounding)
        down = bend_at(square - step, bending, rest, rounding)
        assert (up[0] - down[0]) / (2 * step) == pytest.approx(first, rel=1e-5, abs=1e-18)
        assert (up[1] - down[1]) / (2 * step) == pytest.approx(second, rel=1e-5)


def test_contact_laws_follow_their_formulas():
    d = 0.3e-3
    barrier, core = (
        BarrierContact(800.0).for_kernels(d),
        CoreContact(0.1e-3, 3e9, 2.4).for_kernels(d),
    )
    for x in (0.4, 0.7, 0.99):
        assert law_at((x * d) ** 2, barrier)[0] == pytest.approx(800.0 * (1 - x**2) ** 2 / x**2)
        delta, p = 0.2e-3, 2.4
        z = (x * d - 0.1e-3) / delta
        expected = 3e9 * delta**2 / (p * (p - 1)) * (z ** (1 - p) - 1 - (p - 1) * (1 - z))
        assert law_at((x * d) ** 2, core)[0] == pytest.approx(expected, rel=1e-10)
        for law in (barrier, core):
            square, step = (x * d) ** 2, 1e-5 * d**2
            up, down = law_at(square + step, law), law_at(square - step, law)
            _, first, second = law_at(square, law)
            assert (up[0] - down[0]) / (2 * step) == pytest.approx(first, rel=1e-3, abs=1e-3)
            assert (up[1] - down[1]) / (2 * step) == pytest.approx(second, rel=1e-3)
            assert second > 0.0
    assert law_at(d * d, barrier) == law_at(d * d, core) == (0.0, 0.0, 0.0)
    assert law_at((0.1e-3) ** 2, core)[0] == math.inf


def test_friction_is_elastic_up_to_coulomb():
    stiffness, limit = 130.0, 3e-4
    yields = limit / stiffness
    for size in (1e-3 * yields, 0.5 * yields, 0.999 * yields, 1.001 * yields, 5.0 * yields):
        energy, over, more = spring_at(size, stiffness, limit)
        assert energy == pytest.approx(potential_of(size, stiffness, limit), rel=1e-13)
        step = 1e-4 * size
        up, down = (spring_at(s, stiffness, limit) for s in (size + step, size - step))
        assert (up[0] - down[0]) / (2 * step) == pytest.approx(over * size, rel=1e-5)
        difference = (up[1] * (size + step) - down[1] * (size - step)) / (2 * step)
        slope = stiffness if size < yields else 0.0
        assert over + more == pytest.approx(slope, abs=1e-9 * stiffness)
        assert difference == pytest.approx(slope, rel=1e-6, abs=1e-6 * stiffness)
        assert over * size == pytest.approx(min(stiffness * size, limit), rel=1e-13)


def test_pairs_match_a_double_loop():
    model, y = model_and_state("full")
    work = new_work(model.scene)
    spacing = model.fabric.loop_length / model.cell.contacts
    reach = 1.3 * model.fabric.diameter + SPREAD * spacing
    pairs, weight, center, reached = pairs_at(model.scene, y, 0.3 * model.fabric.diameter, work)
    assert reached == pytest.approx(reach) and center.tobytes() == y.tobytes()
    touch, points, lattice = model.scene.touch, work.points[:, :3], y[model.lattice :]
    a1, a2 = np.array([*lattice[:2], 0]), np.array([*lattice[2:4], 0])
    expected = set()
    for g in range(len(touch.images)):
        shift = touch.images.steps[g, 0] * a1 + touch.images.steps[g, 1] * a2
        near = np.linalg.norm(points[:, None] - points[None] - shift, axis=2) < reach
        for i, k in zip(*np.nonzero(near), strict=True):
            gap = abs(touch.points.arc[i] - touch.points.arc[k] - touch.images.arc_shift[g])
            if touch.images.up[g] == 0 and gap < touch.exclude:
                continue
            # Each unordered pair once: (i, k, g) and (k, i, inverse of g) are the same.
            expected.add(min((i, k, g), (k, i, touch.images.inverse[g])))
    found = {min((i, k, g), (k, i, touch.images.inverse[g])) for i, k, g in pairs.tolist()}
    assert len(found) == len(pairs) > 100
    assert found == expected
    assert weight == pytest.approx(np.full(len(pairs), touch.points.length[0] ** 2))


def test_couple_is_the_angle_of_the_tangent():
    rng = np.random.default_rng(3)
    x = rng.standard_normal((4, 3))
    couples = records(
        COUPLE,
        1,
        d1=spline.basis_first([1.0]),
        moment=0.7,
        normal=[0.0, 0.0, 1.0],
        reference=[1.0, 0.0, 0.0],
    )
    fixtures = Fixtures(records(CYLINDER, 0), couples)

    def at(x):
        """Energy, gradient by control points, its matrix."""
        scene = model_and_state()[0].scene._replace(fixtures=fixtures)
        work = new_work(scene)._replace(
            x=x.reshape(4, 3), expanded=np.zeros(12), half=np.zeros((12, 12))
        )
        return add_couples(scene, np.int64(2), work), work.expanded, work.half

    v = spline.basis_first([1.0])[0] @ x
    energy, gradient, half = at(x)
    assert energy == pytest.approx(-0.7 * math.atan2(v[1], v[0]))
    hessian = half + half.T
    step = 1e-6
    for i in range(12):
        moved = x.copy().ravel()
        moved[i] += step
        up, up_gradient, _ = at(moved)
        assert (up - energy) / step == pytest.approx(gradient[i], rel=1e-4, abs=1e-5)
        np.testing.assert_allclose(
            (up_gradient - gradient) / step, hessian[i], rtol=1e-3, atol=1e-5
        )
    assert np.abs(gradient).max() > 0.1


def test_subdivision_keeps_the_curve():
    model, y = model_and_state("symmetric")
    fine = build_model(model.fabric, model.resolution.refined(model.fabric))
    doubled = resampled(model, y, fine)
    np.testing.assert_allclose(
        centreline(fine, doubled, per_span=1),
        centreline(model, y, per_span=2),
        rtol=0.0,
        atol=1e-12 * model.fabric.diameter,
    )
    assert np.ptp(centreline(model, y), axis=0).min() > 0.5 * model.fabric.diameter


def test_spline_interpolates_and_closes():
    t = 2 * np.pi * np.arange(32) / 32
    points = np.stack([0.2 * t + np.sin(t), np.cos(t), np.sin(2 * t)], axis=1)
    step = np.array([0.4 * np.pi, 0.0, 0.0])
    control = spline.interpolate_periodic(points, step)
    chain = np.concatenate([control[-1:] - step, control, control[:2] + step])
    np.testing.assert_allclose(spline.evaluate(chain, np.arange(32)), points, atol=1e-13)
    errors = []
    for n in (16, 32, 64):
        t = 2 * np.pi * np.arange(n) / n
        control = spline.interpolate_periodic(np.stack([np.cos(t), np.sin(t)], 1), [0.0, 0.0])
        chain = np.concatenate([control[-1:], control, control[:2]])
        u = np.linspace(0, n, 999)
        exact = np.stack([np.cos(2 * np.pi * u / n), np.sin(2 * np.pi * u / n)], 1)
        errors.append(np.abs(spline.evaluate(chain, u) - exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (np.abs(orders - 4.0) < 0.2).all()

"""The assembly of pair energies, the pair search and Newton's method against slow, obvious twins."""

import numpy as np
import pytest

from knitsim.equilibrium import cell as cells
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.contact import add_pushes
from knitsim.equilibrium.kernels.crossings import crossings_of
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.follow import answer
from knitsim.equilibrium.kernels.newton import CONVERGED, minimise
from knitsim.equilibrium.kernels.pairs import CHUNK, expand, find_pairs, pairs_at, place_points
from knitsim.equilibrium.kernels.records import LATTICE
from knitsim.equilibrium.model import build_model
from knitsim.equilibrium.relax import relax, start_from
from knitsim.yarn.law import paper_k3

COTTON = Fabric(
    wale_spacing=1.4993e-3, course_spacing=1.2005e-3, loop_length=5.56e-3, diameter=0.2793e-3,
    bending_rigidity=5e-9, law=paper_k3(continuous=True),
)  # fmt: skip
UPPER = np.triu_indices(3)


def placed(kind):
    """A model, and of its start the lattice L and the buffers with the contact points."""
    model = build_model(COTTON, Resolution(24, cell=kind))
    y = start_from(model, COTTON.diameter, 1.19 * COTTON.diameter)
    work = new_work(model.scene)
    lattice = expand(model.scene.map, y, work.x)
    place_points(model.scene.touch, work.x, work.points)
    return model, lattice, work


@pytest.fixture(scope="module")
def rest():
    return relax(COTTON, Resolution(24))


def by_control_points(touch, pair, columns):
    """d of a pair as a matrix (3, columns) on the control points and L."""
    i, k, g = pair
    image, matrix = touch.images[g], np.zeros((3, columns))
    for point, sign in ((touch.points[i], np.ones(3)), (touch.points[k], -image.sign)):
        for a in range(4):
            for axis in range(3):
                matrix[axis, 3 * (point.first + a) + axis] += sign[axis] * point.basis[a]
    for axis in range(2):
        matrix[axis, columns - LATTICE + axis] -= image.steps[0]
        matrix[axis, columns - LATTICE + 2 + axis] -= image.steps[1]
    return matrix


@pytest.mark.parametrize("kind", ["symmetric", "full"])
def test_pair_energies_are_assembled_as_by_matrices(kind):
    model, lattice, work = placed(kind)
    touch, columns = model.scene.touch, work.expanded.size
    listed, _ = find_pairs(touch, work.points, lattice, 1.3 * COTTON.diameter)
    rng = np.random.default_rng(2)
    # Pairs in the order of the search, and a few that follow each other without order.
    chosen = np.sort(rng.choice(len(listed), min(150, len(listed)), replace=False))
    near = np.concatenate([listed[chosen], rng.permutation(listed)[:50]])
    near = np.concatenate([near, near[near[:, 0] != near[:, 1]][:1], near[-1:, [0, 0, 2]]])
    push = rng.standard_normal((len(near), 9))
    gradient, hessian = np.zeros(columns), np.zeros((columns, columns))
    for pair, row in zip(near, push, strict=True):
        to_d = by_control_points(touch, pair, columns)
        h = np.zeros((3, 3))
        h[UPPER] = row[3:]
        h = h + h.T - np.diag(h.diagonal())
        gradient += row[:3] @ to_d
        hessian += to_d.T @ h @ to_d
    found, half = np.zeros(columns), np.zeros((columns, columns))
    add_pushes(touch, near, push, np.int64(2), found, half)
    assert np.abs(hessian[-LATTICE:, :-LATTICE]).max() > 0.1 * np.abs(hessian).max()
    np.testing.assert_allclose(found, gradient, atol=1e-12 * np.abs(gradient).max())
    np.testing.assert_allclose(half + half.T, hessian, atol=1e-12 * np.abs(hessian).max())
    alone = np.zeros(columns)
    add_pushes(touch, near, push, np.int64(1), alone, half)
    np.testing.assert_array_equal(alone, found)


@pytest.mark.parametrize("reach", [0.9, 1.15, 2.0])
def test_pairs_of_a_symmetric_cell_match_a_full_table(reach):
    model, lattice, work = placed("symmetric")
    touch, points, reach = model.scene.touch, work.points[:, :3], reach * COTTON.diameter
    assert len(points) > 2 * CHUNK
    arc = touch.points.arc
    # Each ordered pair stands for half an unordered one.
    half = 0.5 * touch.copies * touch.points.length[0] ** 2
    expected = {}
    for g, image in enumerate(touch.images):
        shift = np.array([*(image.steps[0] * lattice[:2] + image.steps[1] * lattice[2:4]), 0.0])
        far = np.linalg.norm(points[:, None] - image.sign * points - shift, axis=2) >= reach
        along = np.abs(arc[:, None] - image.arc_sign * arc - image.arc_shift)
        far |= bool(image.up == 0) & (along < touch.exclude)
        back = int(image.inverse)
        assert touch.images[back].sign.tolist() == image.sign.tolist()
        assert (touch.images[back].steps == -image.sign[:2] * image.steps).all()
        for i, k in np.argwhere(~far).tolist():
            key = min((i, k, g), (k, i, back))
            expected[key] = expected.get(key, 0.0) + half
    pairs, weight = find_pairs(touch, points, lattice, reach)
    found = {}
    for (i, k, g), value in zip(pairs.tolist(), weight, strict=True):
        key = min((i, k, g), (k, i, int(touch.images[g].inverse)))
        assert key not in found
        found[key] = value
    assert len(found) > 5
    assert found == pytest.approx(expected)


def turn(v, w):
    """Area of the parallelogram of two vectors in the plane of the fabric."""
    return v[..., 0] * w[..., 1] - v[..., 1] * w[..., 0]


def polyline_crossings(model, points, lattice):
    """Crossing codes along the first yarn by straight geometry, every segment with every other."""
    found = []
    for image in model.trace.images:
        up = int(image.steps[1])
        if up == 0:
            continue
        shift = np.array([*(image.steps[0] * lattice[:2] + image.steps[1] * lattice[2:4]), 0.0])
        other = points * image.sign + shift
        a, b = points[:-1, None], np.diff(points, axis=0)[:, None]
        c, e = other[None, :-1], np.diff(other, axis=0)[None]
        # a + p b and c + q e meet in the plane of the fabric.
        area = turn(b, e)
        area[area == 0.0] = np.nan
        p = turn(c - a, e) / area
        q = turn(c - a, b) / area
        above = a[..., 2] + p * b[..., 2] > c[..., 2] + q * e[..., 2]
        meet = (p >= 0.0) & (p < 1.0) & (q >= 0.0) & (q < 1.0)
        for i, k in np.argwhere(meet).tolist():
            found.append((i + p[i, k], 2 * up + int(above[i, k])))
    return [code for _, code in sorted(found)]


@pytest.mark.parametrize("kind", ["symmetric", "full"])
def test_crossings_match_straight_geometry(kind):
    model, lattice, work = placed(kind)
    points = np.empty((len(model.trace.points), 3))
    place_points(model.trace, work.x, points)
    expected = polyline_crossings(model, points, lattice)
    assert expected == list(cells.expected_crossings(model.cell))
    assert list(crossings_of(model.trace, points, lattice, 50)) == expected
    # Upside down, and where nothing crosses.
    mirrored = points * [1.0, 1.0, -1.0]
    assert list(crossings_of(model.trace, mirrored, lattice, 50)) == polyline_crossings(
        model, mirrored, lattice
    )
    apart = lattice * [1.0, 1.0, 1.0, 4.0, 1.0]
    assert list(crossings_of(model.trace, points, apart, 50)) == []


def disturbed(rest, size):
    """The relaxed state moved off its equilibrium, spacings held."""
    model, y = rest.model, rest.y.copy()
    rng = np.random.default_rng(4)
    y[: model.lattice] += size * COTTON.diameter * rng.standard_normal(model.lattice)
    return y


@pytest.mark.parametrize("size", [0.0, 1e-6, 1e-3, 0.05])
def test_minimum_is_that_of_plain_newton(rest, size):
    model, scene, control = rest.model, rest.model.scene, rest.model.control
    free, work = model.free(), new_work(rest.model.scene)
    y = disturbed(rest, size)
    listed = pairs_at(scene, y, control.skin, work)
    status, _, residual, listed = minimise(scene, y, free, listed, (), control, False, work)
    assert status == CONVERGED and residual <= control.tolerance
    pairs = pairs_at(scene, y, control.skin, work)
    energy_of(scene, y, pairs, (), np.int64(1), work)
    assert np.abs(work.gradient * scene.scale)[free].max() <= 1.001 * control.tolerance
    # Newton's method with nothing saved: full steps, a new Hessian each, far below the tolerance.
    exact, again = y.copy(), new_work(scene)
    for _ in range(5):
        energy_of(scene, exact, pairs, (), np.int64(2), again)
        step = np.linalg.solve(again.hessian[np.ix_(free, free)], again.gradient[free])
        exact[free] -= step
    assert np.abs(again.gradient * scene.scale)[free].max() < 1e-3 * control.tolerance
    np.testing.assert_allclose(y, exact, rtol=0.0, atol=1e-6 * COTTON.diameter)
    np.testing.assert_allclose(exact[free], rest.y[free], rtol=0.0, atol=1e-6 * COTTON.diameter)


@pytest.mark.parametrize("size", [0.0, 1e-3, 0.05])
def test_factor_and_hessian_belong_together_and_to_the_end(rest, size):
    model, scene, control = rest.model, rest.model.scene, rest.model.control
    free, work = model.free(3), new_work(rest.model.scene)
    y = disturbed(rest, size)
    listed = pairs_at(scene, y, control.skin, work)
    status, *_ = minimise(scene, y, free, listed, (), control, False, work)
    assert status == CONVERGED
    own = work.hessian[np.ix_(free, free)]
    n = len(free)
    factor = np.triu(work.factor[:n, :n])
    np.testing.assert_allclose(factor.T @ factor, own, atol=1e-10 * np.abs(own).max())
    fresh = new_work(scene)
    pairs = pairs_at(scene, y, control.skin, fresh)
    energy_of(scene, y, pairs, (), np.int64(2), fresh)
    # A factor may be that of a point a step or two before the end: good to some per cent.
    assert np.abs(fresh.hessian - work.hessian).max() < 0.1 * np.abs(fresh.hessian).max()
    change = np.zeros(len(y))
    change[model.lattice] = 1e-3 * y[model.lattice]
    moved = y.copy()
    answer(moved, change, free, work)
    exact = -np.linalg.solve(own, work.hessian[free] @ change)
    np.testing.assert_allclose(moved[free] - y[free], exact, atol=1e-9 * np.abs(exact).max())
    assert moved[model.lattice] == y[model.lattice] + change[model.lattice]

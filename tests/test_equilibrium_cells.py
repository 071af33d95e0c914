"""Cells of several loops: the condition on sliding, the sparse solver, stability of the symmetric loop."""

from dataclasses import replace

import numpy as np
import pytest
from friction_tools import LAGGING, elongations, rub_of, slip_through, sticking_and_sliding

from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.crossings import crossings_of
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.pairs import expand, pairs_at, place_points
from knitsim.equilibrium.kernels.records import LATTICE
from knitsim.equilibrium.large.assembly import crossings_in_grid
from knitsim.equilibrium.large.linear import Linear, factor_of, new_sparse_work, sparse_pairs
from knitsim.equilibrium.model import build_model, carried
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import is_intact, relax
from knitsim.equilibrium.stability import lowest_stiffness
from knitsim.errors import InputError
from knitsim.yarn.law import paper_k3

COTTON = dict(
    wale_spacing=1.4993e-3, course_spacing=1.2005e-3, loop_length=5.56e-3, diameter=0.2793e-3,
    bending_rigidity=5e-9, law=paper_k3(continuous=True),
)  # fmt: skip
COARSE = (24, 160)
NO_FREE = np.arange(0)


@pytest.fixture(scope="module")
def coarse():
    return relax(Fabric(**COTTON), Resolution(*COARSE))


def block(one, wales, courses, noise=0.0, sparse=True):
    """A model of several loops like ``one`` and its unknowns, moved at random by ``noise`` (m)."""
    size = Resolution(*COARSE, "full", wales, courses)
    model = build_model(one.model.fabric, size, sparse=sparse)
    y = carried(model, one.model, one.y)
    return model, y + noise * np.random.default_rng(3).standard_normal(len(y))


def dense_at(model, y, slip):
    """Pairs and the dense Hessian and gradient at y; mind that the buffers are shared."""
    work = new_work(model.scene)
    pairs = pairs_at(model.scene, y, model.control.skin, work)
    energy_of(model.scene, y, pairs, slip, np.int64(2), work)
    return pairs, work


@pytest.mark.parametrize(("wales", "courses"), [(1, 1), (2, 1), (1, 2), (3, 2)])
def test_grid_finds_the_pairs_and_crossings_of_the_full_search(coarse, wales, courses):
    model, y = block(coarse, wales, courses, noise=5e-6)
    pairs, work = dense_at(model, y, ())
    found = sparse_pairs(
        model.scene, y, model.control.skin, new_sparse_work(model.cell, model.scene)
    )
    # In the same order: that in which friction remembers.
    for name in ("pairs", "weight", "center", "reach"):
        np.testing.assert_array_equal(getattr(found, name), getattr(pairs, name), err_msg=name)

    lattice = expand(model.scene.map, y, work.x)
    points = np.empty((model.trace.points.size, 3))
    place_points(model.trace, work.x, points)
    where, code = crossings_in_grid(model.trace, points, lattice)
    plain = crossings_of(model.trace, points, lattice, 4 * model.expected.size)
    np.testing.assert_array_equal(code[np.argsort(where)], plain)
    assert is_intact(model, y)
    purl = y.copy()
    purl[: model.cell.count][model.cell.where[:, 2] == 2] *= -1.0
    assert not is_intact(model, purl)


@pytest.mark.parametrize("friction", ["none", "pairs", "yarn"])
@pytest.mark.parametrize(("wales", "courses"), [(1, 1), (2, 1), (1, 3)])
def test_sparse_hessian_is_the_dense_one(coarse, wales, courses, friction):
    model, y = block(coarse, wales, courses, noise=5e-7)
    sparse = new_sparse_work(model.cell, model.scene)
    pairs = sparse_pairs(model.scene, y, model.control.skin, sparse)
    slip = ()
    if friction != "none":
        rub = rub_of(model.fabric, *((0.3,) if friction == "pairs" else (0.0, LAGGING)))
        rng = np.random.default_rng(4)
        size = 5e-7 if friction == "pairs" else 2e-6
        ways = [y + size * rng.standard_normal(len(y)) for _ in range(3)]
        slip = slip_through(model.scene, ways, rub, model.control.skin, new_work(model.scene))[0]
        springs = elongations(model.scene, y, slip)
        which = (slip.pairs, springs[0]) if friction == "pairs" else (slip.lags, springs[1])
        assert min(sticking_and_sliding(*which)) > 10
    _, work = dense_at(model, y, slip)
    linear = Linear(model.scene, y, pairs, slip, np.array([0, 3]), sparse)
    # The products with unit vectors, against the columns of the dense matrix.  The sparse matrix
    # holds one control point's thickness, the dense one the mean of all.
    count = model.cell.count
    to_y = np.eye(count)
    to_y[np.ix_(sparse.thick, sparse.thick)] -= 1.0 / len(sparse.unknown)
    full = np.zeros((count + 2, count + 2))
    full[:count, :count] = to_y[:, sparse.order]
    full[count:, count:] = np.eye(2)
    chosen = np.concatenate([np.arange(count), count + linear.free])
    dense = full.T @ work.hessian[np.ix_(chosen, chosen)] @ full
    product = np.stack([linear.times(e) for e in np.eye(count + 2)], axis=1)
    assert np.abs(product - dense).max() < 1e-12 * np.abs(dense).max()


def test_sparse_step_solves_the_dense_problem(coarse):
    model, y = block(coarse, 2, 2)
    y[model.lattice] *= 1.01
    free = model.free(0)
    sparse = new_sparse_work(model.cell, model.scene)
    pairs = sparse_pairs(model.scene, y, model.control.skin, sparse)
    linear = Linear(model.scene, y, pairs, (), np.array([0]), sparse)
    assert linear.ready()
    _, work = dense_at(model, y, ())
    step = linear.answer(-work.gradient)
    left = (work.hessian @ step + work.gradient)[free]
    assert np.abs(left).max() < 1e-5 * np.abs(work.gradient[free]).max()
    assert not step[model.lattice + 1 :].any()
    # The change of the gradient with the spacing that is prescribed.
    by_course = linear.by_lattice(np.array([0.0, 0.0, 0.0, 1.0, 0.0]))
    column = work.hessian[:, model.lattice + 3]
    assert np.abs(by_course - column).max() < 1e-9 * np.abs(column).max()


def test_full_cell_gives_the_quarters_forces():
    """The whole course and wale tests of the default resolution, no symmetry imposed."""
    fabric = Fabric(**COTTON)
    one, whole = relax(fabric), relax(fabric, Resolution(cell="full"))
    assert whole.stable
    assert one.stable is None
    assert whole.wale_spacing == pytest.approx(one.wale_spacing, rel=1e-6)
    for direction, strains in (
        ("course", np.linspace(0.1, 1.5, 15)),
        ("wale", np.linspace(0.1, 0.9, 9)),
    ):
        alone, free = (tensile(r, direction, strains) for r in (one, whole))
        assert free.steps == len(strains)
        np.testing.assert_allclose(free.force_per_loop, alone.force_per_loop, rtol=5e-3)
        # The condition that stops the yarn from sliding along itself holds next to nothing.
        for state in range(0, free.steps, 4):
            held = sliding_force(whole.model, free.y[state])
            assert held < 5e-3 * free.force_per_loop[state]


def sliding_force(model, y):
    """Force (N) of the condition that the middles of two legs lie at the same height."""
    work = new_work(model.scene)
    pairs = pairs_at(model.scene, y, 0.0, work)
    energy_of(model.scene, y, pairs, (), np.int64(1), work)
    right = model.cell.chain + 1 + 3 * model.cell.points // 4
    return np.abs(work.expanded[3 * right + 1]).max()


def test_sliding_is_held_and_translation_too(coarse):
    """Rigid translation and sliding each change what the cell holds; nothing soft is left over."""
    model, y = block(coarse, 1, 2, sparse=False)
    _, work = dense_at(model, y, ())
    free = model.free(0, 3)
    soft = np.linalg.eigvalsh(work.hessian[np.ix_(free, free)])[0]
    # A free slide would show as 0 up to the cutting into points (0.03 N/m before it was held).
    assert soft > 0.3


def test_two_by_two_loops_are_the_loop(coarse):
    fabric = Fabric(**COTTON, friction=0.2)
    one = relax(fabric, Resolution(*COARSE))
    four = relax(fabric, Resolution(*COARSE, "full", 2, 2))
    assert four.model.sparse
    assert four.stable
    assert four.energy == pytest.approx(one.energy, rel=1e-9)
    alone, many = (tensile(r, "course", [0.04]) for r in (one, four))
    assert many.stop_reason == ""
    for name in ("force_per_loop", "dissipated", "work", "min_distance"):
        assert getattr(many, name) == pytest.approx(getattr(alone, name), rel=1e-4), name


def test_sparse_and_dense_follow_the_same_path(coarse):
    curves = []
    for sparse in (True, False):
        model, y = block(coarse, 2, 1, sparse=sparse)
        start = replace(coarse, model=model, y=y)
        curves.append(tensile(start, "course", [0.05, 0.15], lateral="held"))
    for name in ("force_per_loop", "work", "forces", "energy"):
        a, b = (getattr(c, name) for c in curves)
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-6 * np.abs(b).max(), err_msg=name)


def test_lowest_stiffness_is_the_lowest_eigenvalue(coarse):
    curve = tensile(coarse, "course", [0.2, 0.8])
    found = lowest_stiffness(curve, 1, 2)
    model = build_model(coarse.model.fabric, Resolution(*COARSE, "full", 1, 2))
    sparse = new_sparse_work(model.cell, model.scene)
    # In the matrix that holds one control point instead of the mean thickness.
    turn = np.eye(model.cell.count + LATTICE)
    turn[np.ix_(sparse.thick, sparse.thick)] -= 1.0 / len(sparse.unknown)
    free = model.free(3)
    for i in range(2):
        y = carried(model, coarse.model, curve.y[i])
        _, work = dense_at(model, y, ())
        hessian = (turn.T @ work.hessian @ turn)[np.ix_(free, free)]
        assert found[i] == pytest.approx(np.linalg.eigvalsh(hessian)[0], rel=1e-5)


def test_pulled_loops_without_friction_would_exchange_yarn():
    """The quarter at 100 % is a saddle among two by two loops, whatever the contact points."""
    for contacts in (320, 640):
        curve = tensile(
            relax(Fabric(**COTTON), Resolution(48, contacts)), "course", [0.2, 0.6, 1.0]
        )
        lowest = lowest_stiffness(curve, 2, 2)
        assert lowest[0] > 0.0
        assert lowest[2] < -1.0


def test_a_saddle_has_no_factor(coarse):
    curve = tensile(coarse, "course", [1.0])
    model, _ = block(coarse, 2, 2)
    y = carried(model, coarse.model, curve.y[0])
    sparse = new_sparse_work(model.cell, model.scene)
    pairs = sparse_pairs(model.scene, y, 0.0, sparse)
    linear = Linear(model.scene, y, pairs, (), NO_FREE, sparse)
    assert factor_of(linear) is None
    assert linear.factorise()
    assert sparse.factor.shift > 0.0
    # From a saddle the step still goes down.
    push = np.random.default_rng(5).standard_normal(len(y))
    push[model.lattice :] = 0.0
    assert linear.answer(push) @ push > 0.0


def test_stability_is_asked_of_the_symmetric_cell(coarse):
    full = relax(Fabric(**COTTON), Resolution(*COARSE, cell="full"))
    with pytest.raises(InputError, match="symmetric"):
        lowest_stiffness(tensile(full, "course", [0.1]), 2, 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("direction", "strains"),
    [("course", np.linspace(0.1, 1.5, 15)), ("wale", np.linspace(0.1, 0.9, 9))],
)
def test_two_by_two_loops_with_friction_are_the_loop_to_the_end(direction, strains):
    fabric = Fabric(**COTTON, friction=0.2)
    block_of = Resolution(cell="full", wales=2, courses=2)
    alone, four = (tensile(relax(fabric, r), direction, strains) for r in (None, block_of))
    assert four.stop_reason == ""
    np.testing.assert_allclose(four.force_per_loop, alone.force_per_loop, rtol=5e-3)
    np.testing.assert_allclose(four.dissipated, alone.dissipated, rtol=5e-3)

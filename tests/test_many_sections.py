"""The yarn of many sections, perturbed and solved in full, against the one section."""

import itertools
import math

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.yarn.law import bilinear, paper_k3
from knitsim.yarn.many_sections import _ManySections, solve_many_sections
from knitsim.yarn.packing import pack
from knitsim.yarn.section import SimulatedYarn, solve_section

POLYESTER = bilinear(6.34, 2.41, 0.02, 0.08)


def make_yarn(fibres=7, form="corrected", law=POLYESTER, twist=300.0, **changes):
    options = {"bending_rigidity": 1.6e-10, "section_stiffness": 1e8} | changes
    return SimulatedYarn(pack(fibres, 0.25e-3), law, 0.2e-3, twist, form, **options)


def total_energy(state):
    return state.stretch_energy + state.bending_energy + state.section_energy + state.plastic_energy


def assert_same(yarn, strain, sections, **options):
    many = solve_many_sections(yarn, strain, sections, **options)
    one = solve_section(yarn, strain)
    assert many.perturbed_by > 0.01 * 0.5 * yarn.layout.diameter
    assert many.iterations >= 3
    assert many.tension == pytest.approx(one.tension, rel=1e-8)
    assert many.energy == pytest.approx(total_energy(one), rel=1e-8)
    # Each section is the image of the one before: the same distances, all points in one plane.
    heights = many.points[:, :, 2]
    step = yarn.spacing * (1 + strain)
    np.testing.assert_allclose(np.ptp(heights, axis=1), 0.0, atol=1e-9 * step)
    np.testing.assert_allclose(np.diff(heights[:, 0]), step, rtol=1e-9)
    # Up to a motion of the whole yarn, each is where the one section puts it.
    here, there = one.positions, one.positions @ yarn.turn.T
    close = 1e-9 * yarn.layout.diameter
    for section, following in itertools.pairwise(many.points[:, :, :2]):
        np.testing.assert_allclose(distances(section, section), distances(here, here), atol=close)
        np.testing.assert_allclose(
            distances(section, following), distances(here, there), atol=close
        )


def distances(one, other):
    return np.linalg.norm(one[:, None] - other, axis=2)


@pytest.mark.parametrize("form", ["corrected", "printed"])
@pytest.mark.parametrize("strain", [0.01, 0.03])
def test_one_section_is_enough(form, strain):
    assert_same(make_yarn(form=form), strain, sections=6)


@pytest.mark.parametrize(
    "yarn, sections",
    [
        (make_yarn(2), 5),
        (make_yarn(3, twist=-300.0), 7),
        (make_yarn(19, bending_rigidity=0.0), 4),
        (make_yarn(19, law=paper_k3(continuous=True).scaled(1 / 19)), 5),
    ],
    ids=["two fibres", "S twist", "limp fibres", "cotton"],
)
def test_one_section_is_enough_for_other_yarns(yarn, sections):
    assert_same(yarn, 0.02, sections, perturbation=0.05, seed=3)


@pytest.mark.slow
def test_one_section_is_enough_for_the_polyester():
    assert_same(make_yarn(72, twist=100.0), 0.04, sections=8)


def test_bending_springs_as_stiff_as_tension_springs_let_sections_differ():
    # k2 as the bending spring on a true helix: pulled straighter than built, a fibre regains its
    # angle by a zigzag, which pays where EI/h^2 is near EA.  The uniform state is no minimum.
    yarn = make_yarn(12, bending_constant=2.41, bending_rigidity=0.0)
    uniform = total_energy(solve_section(yarn, 0.02))
    lower = solve_many_sections(yarn, 0.02, sections=6).energy
    assert 0.999 * uniform < lower < (1 - 1e-5) * uniform
    small = 1e-3
    many = solve_many_sections(yarn, small, sections=6)
    assert many.energy == pytest.approx(total_energy(solve_section(yarn, small)), rel=1e-8)


@pytest.mark.parametrize("form", ["corrected", "printed"])
def test_gradient_and_hessian_are_derivatives(form):
    problem = _ManySections(make_yarn(4, form, bending_constant=0.1), 3, 0.03)
    rng = np.random.default_rng(5)
    y = problem.built + 2e-6 * rng.uniform(-1, 1, problem.shape)
    gradient, hessian, _ = problem.gradient_and_hessian(y)
    for _ in range(4):
        direction = rng.normal(size=y.shape)
        ahead, back = y + 1e-9 * direction, y - 1e-9 * direction
        slope = (problem.energy(ahead) - problem.energy(back)) / 2e-9
        assert abs(slope) > 0.01 * np.linalg.norm(gradient)
        assert gradient @ direction.ravel() == pytest.approx(slope, rel=1e-5)
        change = problem.gradient_and_hessian(ahead)[0] - problem.gradient_and_hessian(back)[0]
        change /= 2e-9
        expected = hessian @ direction.ravel()
        assert np.linalg.norm(expected) > 0
        np.testing.assert_allclose(change, expected, atol=1e-5 * np.abs(expected).max())


def test_tension_is_the_derivative_of_the_energy_by_the_length():
    yarn = make_yarn(5, bending_constant=0.1)
    y = _ManySections(yarn, 3, 0.01).built
    energies = [_ManySections(yarn, 3, e).energy(y) for e in (0.01 + 1e-6, 0.01 - 1e-6)]
    slope = (energies[0] - energies[1]) / (2e-6 * 3 * yarn.spacing)
    tension = _ManySections(yarn, 3, 0.01).energy_and_tension(y)[1]
    assert tension == pytest.approx(slope, rel=1e-7)


def test_slipping_and_turning_as_a_whole_cost_nothing():
    problem = _ManySections(make_yarn(7), 4, 0.02)
    rng = np.random.default_rng(2)
    y = problem.built + 1e-6 * rng.uniform(-1, 1, problem.shape)
    energy = problem.energy(y)
    turn = np.array([[math.cos(1.0), -math.sin(1.0)], [math.sin(1.0), math.cos(1.0)]])
    turned = y.copy()
    turned[:, :, :2] = y[:, :, :2] @ turn.T
    turned[:, :, 2] += 1e-4
    assert problem.energy(turned) == pytest.approx(energy, rel=1e-10)
    slipped = y.copy()
    slipped[:, 0, 2] += 1e-6
    assert problem.energy(slipped) > energy


def test_what_cannot_be_solved_is_refused():
    with pytest.raises(InputError, match="rigid"):
        solve_many_sections(make_yarn(section_stiffness=math.inf), 0.01)
    with pytest.raises(InputError, match="sections"):
        solve_many_sections(make_yarn(), 0.01, sections=1)
    with pytest.raises(InputError, match="strain"):
        solve_many_sections(make_yarn(), math.nan)

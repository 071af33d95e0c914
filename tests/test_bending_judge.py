"""The judge of tests with few states: what it measures on a cylinder, and that it finds planted errors."""

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.stages import stress as stress_stage
from knitsim.stages.judged import bending_states, given_of, relaxed_of, tension_states
from knitsim.verification import bending_judge, bending_judge_energy, stress, stress_bending
from knitsim.verification.bending_judge import Test, judge_test
from knitsim.verification.bending_judge_energy import BentEnergy, in_space
from knitsim.verification.campaign import Case
from knitsim.verification.judge_energy import Energy, Given, control_of, design

LAW = ((0.0, 0.01, 0.07), (0.0, 0.44, 5.84))
GIVEN = Given(5.56e-3, 0.2793e-3, 5e-9, *LAW, 1000.0, 0.3, 12, 40)
COTTON = Case(0, 1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, *LAW, 1000.0, 0.0, 0.0, 0.0)


def test_shares_nothing_with_the_solver():
    for module in (bending_judge, bending_judge_energy, stress, stress_bending):
        names = set()
        for node in ast.walk(ast.parse(Path(module.__file__).read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module)
        assert names <= {
            "numpy", "scipy.spatial", "dataclasses", "math", "knitsim.verification",
            "knitsim.verification.judge", "knitsim.verification.judge_energy",
            "knitsim.verification.bending_judge_energy", "knitsim.verification.stress",
        }  # fmt: skip


# ---------------------------------------------------------------- energy


def test_points_lie_on_cylinders():
    x, y, z = np.random.default_rng(1).uniform(-1e-3, 1e-3, (3, 50))
    for curvature in (300.0, -300.0, 1e-9):
        points = in_space(x, y, z, curvature)
        axis = -1.0 / curvature
        radius = np.hypot(points[:, 0], points[:, 2] - axis)
        assert radius == pytest.approx(np.abs(1.0 / curvature + z), rel=1e-12)
        assert np.array_equal(points[:, 1], y)
        # The arc along z = 0 is x.
        flat = in_space(x, y, 0 * z, curvature)
        angle = np.arctan2(flat[:, 0] * np.sign(curvature), np.abs(flat[:, 2] - axis))
        assert angle / curvature == pytest.approx(x, rel=1e-6, abs=1e-12)
    assert np.array_equal(in_space(x, y, z, 0.0), np.stack([x, y, z], axis=-1))
    near = in_space(x, y, z, 1e-6)
    assert near == pytest.approx(np.stack([x, y, z], axis=-1), abs=1e-11)


@pytest.mark.parametrize("bent", [0, 1])
def test_without_curvature_it_is_the_flat_fabric(rough, bent):
    flat, other = Energy(GIVEN, 3, 40, 4e-4), BentEnergy(GIVEN, 3, 40, 4e-4, bent)
    one, two = flat.shape(*rough), other.shape(*rough)
    assert len(one.i) == len(two.i) > 10
    assert other.terms(two) == pytest.approx(flat.terms(one), rel=1e-12)
    for a, b in zip(other.gradient(two), flat.gradient(one), strict=True):
        assert a == pytest.approx(b, abs=1e-10 * np.abs(b).max())
    for a, b in zip(other.coulomb(two)[:2], flat.coulomb(one), strict=True):
        assert a == pytest.approx(b, abs=1e-10 * np.abs(b).max())
    control, width, height = rough
    move = 1e-6 * np.random.default_rng(5).standard_normal((12, 3))
    moved = control + move, 1.01 * width, 0.99 * height
    rubbed = flat.rubbed(one, flat.shape(*moved))
    assert rubbed > 0.0
    assert other.rubbed(two, other.shape(*moved)) == pytest.approx(rubbed, rel=1e-10)


def brute_terms(given, rough, curvature, bent):
    """Energies of the loop in space: fine polylines for the yarn, every pair for the contact."""
    control, width, height = rough
    axes = [bent, 1 - bent, 2]
    fine = 4000
    u = (np.arange(given.points * fine) + 0.5) / fine

    def placed(u, wales=0, courses=0):
        matrix, turns = design(given.points, u)
        p = matrix @ control + np.outer(turns + wales, [width, 0, 0]) + [0, courses * height, 0]
        return in_space(*p[:, axes].T, curvature)

    step = 1e-3
    before, at, after = placed(u - step), placed(u), placed(u + step)
    v, a = (after - before) / (2 * step), (after - 2 * at + before) / step**2
    span = given.loop_length / given.points
    size = np.linalg.norm(v, axis=1)
    strain = size / span - 1.0
    law = np.interp(strain, *[np.array(x) for x in LAW])
    law = np.where(strain < 0, strain * LAW[1][1] / LAW[0][1], law)
    bend = (np.cross(v, a) ** 2).sum(1) / size**6  # squared curvature in space
    bending = 0.5 * given.bending_rigidity * (bend * (size / span) ** 2).mean() * given.loop_length
    at = (np.arange(given.contacts) + 0.5) * given.points / given.contacts
    contact, length = 0.0, given.loop_length / given.contacts
    arc = at * span
    own = placed(at)
    for wales in range(-2, 3):
        for courses in range(-2, 3):
            distance = np.linalg.norm(own[:, None] - placed(at, wales, courses)[None], axis=2)
            near = distance < given.diameter
            if courses == 0:
                apart = np.abs(arc[:, None] - arc[None] - wales * given.loop_length)
                near &= apart >= 1.6 * given.diameter
            x = distance[near] / given.diameter
            contact += 0.5 * given.contact_stiffness * (((1 - x**2) / x) ** 2).sum() * length**2
    return strain, law, bending, contact


@pytest.mark.parametrize("bent", [0, 1])
@pytest.mark.parametrize("curvature", [400.0, -250.0])
def test_energy_in_space(rough, bent, curvature):
    fine = BentEnergy(GIVEN, 12, 40, 0.0, bent)
    stretch, bend, contact = fine.terms(fine.shape(*rough, curvature))
    strain, _, bending, touching = brute_terms(GIVEN, rough, curvature, bent)
    assert contact == pytest.approx(touching, rel=1e-9)
    assert bend == pytest.approx(bending, rel=1e-4)
    slopes = np.diff(LAW[1]) / np.diff(LAW[0])
    beyond = np.maximum(strain - LAW[0][1], 0.0)
    law = 0.5 * slopes[0] * strain**2 + 0.5 * (slopes[1] - slopes[0]) * beyond**2
    assert stretch == pytest.approx(law.mean() * GIVEN.loop_length, rel=1e-4)


@pytest.mark.parametrize("bent", [0, 1])
def test_gradient_and_moment_are_slopes_of_the_energy(rough, bent):
    energy = BentEnergy(GIVEN, 3, 40, 4e-4, bent)
    control, width, height = rough
    on_points, on_lattice = energy.gradient(energy.shape(control, width, height, 350.0))

    def total(control, width, height, curvature=350.0):
        return energy.terms(energy.shape(control, width, height, curvature)).sum()

    step = 1e-9
    for index in ((0, 0), (3, 1), (7, 2), (11, 0), (5, 2)):
        move = np.zeros((12, 3))
        move[index] = step
        slope = total(control + move, width, height) - total(control - move, width, height)
        assert abs(slope) > 0.0
        assert on_points[index] == pytest.approx(slope / (2 * step), rel=1e-5)
    slope = total(control, width + step, height) - total(control, width - step, height)
    assert on_lattice[0] == pytest.approx(slope / (2 * step), rel=1e-5)
    slope = total(control, width, height + step) - total(control, width, height - step)
    assert abs(slope) > 0.0
    assert on_lattice[1] == pytest.approx(slope / (2 * step), rel=1e-5)
    slope = total(control, width, height, 350.01) - total(control, width, height, 349.99)
    assert energy.moment(energy.shape(control, width, height, 350.0)) == pytest.approx(
        slope / 0.02, rel=1e-5
    )
    slope = total(control, width, height, 0.1) - total(control, width, height, -0.1)
    assert abs(slope) > 0.0
    assert energy.moment(energy.shape(control, width, height)) == pytest.approx(
        slope / 0.2, rel=1e-5
    )


def test_a_fabric_that_only_rolls_up_does_not_rub(rough):
    """Moved along the cylinder, all pairs see each other as before."""
    energy = BentEnergy(GIVEN, 3, 40, 4e-4, 0)
    control, width, height = rough
    shapes = [
        energy.shape(control + [shift, 0, 0], width, height, 300.0) for shift in (0.0, 0.3e-3)
    ]
    assert energy.rubbed(*shapes) < 1e-12 * energy.terms(shapes[0])[2]
    bent = energy.shape(control, width, height, 301.0)
    assert energy.rubbed(shapes[0], bent) > 1e-6 * energy.terms(shapes[0])[2]


def test_closest(rough):
    energy = BentEnergy(GIVEN, 1, 40, 0.0, 0)
    shape = energy.shape(*rough, 200.0)
    least = shape.distance.min()
    assert energy.closest(*rough, 200.0, 1.1 * least) == pytest.approx(least, rel=1e-9)
    assert energy.closest(*rough, 200.0, 0.9 * least) == np.inf


# ---------------------------------------------------------------- the judge and planted errors


def solved(kind, friction):
    case = dataclasses.replace(COTTON, friction=friction)
    relaxed = relaxed_of(case, None)
    if kind == "tension":
        asked = [0.098, 0.1, 0.198, 0.2]
        curve = tensile(relaxed, "course", asked)
        states = tension_states(relaxed, curve)
        return given_of(case, relaxed), states, Test(kind, "course", asked=(0.0, *asked))
    asked = (0.0, 98.0, 100.0, -98.0, -100.0)
    states = bending_states(bend(relaxed, "wale", asked))
    return given_of(case, relaxed), states, Test(kind, "wale", asked=asked)


_SLOW = pytest.mark.slow


@pytest.fixture(
    scope="module",
    params=[
        ("tension", 0.3),
        ("bending", 0.0),
        pytest.param(("tension", 0.0), marks=_SLOW),
        pytest.param(("bending", 0.3), marks=_SLOW),
    ],
)
def result(request):
    return solved(*request.param)


def found(given, states, test, **changes):
    return " | ".join(
        f.check for f in judge_test(given, dataclasses.replace(states, **changes), test)
    )


def test_right_results_are_called_right(result):
    assert judge_test(*result) == []


def test_numbers_that_are_none(result):
    given, states, test = result
    for name in ("load", "centreline", "energy", "work"):
        values = getattr(states, name).copy()
        values.reshape(len(values), -1)[2, -1] = np.nan
        assert found(given, states, test, **{name: values}) == f"{name} is not finite"


def test_lost_crossings(result):
    given, states, test = result
    line = states.centreline.copy()
    line[-1, :, 2] *= -1.0  # seen from the back
    assert "crossings" in found(given, states, test, centreline=line)


@pytest.mark.parametrize("share", [0.05, -0.05])
def test_a_load_that_is_wrong(result, share):
    """By 5 per cent, with friction by 10."""
    factor = 1.0 + share * (2.0 if result[0].friction else 1.0)
    found_in = found(*result, load=factor * result[1].load)
    assert "load is not the slope of the energy" in found_in or "is wrong" in found_in
    if result[0].friction == 0.0:
        assert "moment is not the slope" in found_in or "spacing is wrong" in found_in


def test_energy_out_of_balance(result):
    given, states, test = result
    more = states.energy.copy()
    more[3, 1] *= 1.00001
    assert "energy is not that of the shape" in found(given, states, test, energy=more)
    assert "work is not stored or lost" in found(
        given, states, test, work=(1.15 if given.friction else 1.05) * states.work
    )
    if given.friction == 0.0:
        lost = 1e-3 * np.abs(states.work)
        assert "energy lost without friction" in found(given, states, test, dissipated=lost)
    else:
        back = states.dissipated.copy()
        back[3] = 0.9 * back[2]
        assert "friction gives energy" in found(given, states, test, dissipated=back)
        twice = 2.0 * states.dissipated
        assert "Coulomb" in found(given, states, test, dissipated=twice)


def test_a_state_that_is_no_equilibrium(result):
    """A spot of the yarn pushed by a hundredth of a diameter, in the first state, where nothing rubs."""
    given, states, test = result
    n = given.points
    matrix, turns = design(n, np.arange(2 * n + 1) / 2)
    width = states.wale_spacing[0]
    control = control_of(states.centreline[0][:-1:2], width)
    control[5] += 0.01 * given.diameter
    control[:, 2] -= control[:, 2].mean()
    line = states.centreline.copy()
    line[0] = matrix @ control + turns[:, None] * [width, 0, 0]
    assert "a control point is not in equilibrium" in found(given, states, test, centreline=line)


def test_other_lies(result):
    given, states, test = result
    further = dataclasses.replace(test, asked=(*test.asked[:-1], 1.1 * test.asked[-1]))
    assert "asked state not reached" in found(given, states, further)
    longer = dataclasses.replace(test, asked=(*test.asked, 1.0))
    assert "missing" in found(given, states, longer)
    assert found(given, states, dataclasses.replace(test, asked=None)) == ""
    near = states.min_distance.copy()
    near[2] *= 1.01
    assert "smallest distance" in found(given, states, test, min_distance=near)
    line = states.centreline.copy()
    line[2, 31, 0] += 0.01 * given.diameter
    assert "no periodic cubic spline" in found(given, states, test, centreline=line)
    line = states.centreline.copy()
    line[2, :, 2] += 0.01 * given.diameter
    assert "mean plane" in found(given, states, test, centreline=line)
    held = dataclasses.replace(test, free=False)
    assert "a held spacing has changed" in found(given, states, held)
    stiffer = dataclasses.replace(given, bending_rigidity=1.01 * given.bending_rigidity)
    assert "energy is not that of the shape" in found(stiffer, states, test)
    ends = dataclasses.replace(test, unloads=True)
    assert "does not end at zero force" in found(given, states, ends)


def test_friction_beyond_coulomb(result):
    given, states, test = result
    if given.friction > 0.0:
        weak = dataclasses.replace(given, friction=0.1)
        in_weak = found(weak, states, test)
        assert "a control point is not in equilibrium" in in_weak
        assert "friction takes more" in in_weak


def test_a_load_that_finer_integrals_do_not_bear_out(result):
    given, states, test = result
    said = np.full(len(states.load), 1e-3)
    more = 1.12 * states.load
    assert "finer integrals" in found(given, states, test, load=more, numerical_error=said)
    known = np.full(len(states.load), 0.5)
    assert "finer integrals" not in found(given, states, test, load=more, numerical_error=known)


# ---------------------------------------------------------------- what the judge itself cannot read better


@pytest.mark.parametrize("number", [45, 3537])
def test_what_is_left_of_equilibrium_is_no_wrong_moment(number):
    """A moment 1/200 of that at rest, which what is left of the forces shifts by 1 %; a yarn so stiff
    that round-off of its energy must not pass for a force on a spacing.  5 % off is found in both."""
    case = stress.draw(number, 20251)
    relaxed = relaxed_of(case.fabric, Resolution(case.points, case.contacts))
    curve = stress_stage.tested(case, relaxed)
    states, test = stress_stage.states_of(case, relaxed, curve), stress_stage.test_of(case, curve)
    given = given_of(case.fabric, relaxed)
    assert judge_test(given, states, test) == []
    for share in (0.95, 1.05):
        load = states.load.copy()
        load[-1] *= share
        assert "moment is not the slope" in found(given, states, test, load=load)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("steep_first", [True, False])
def test_bend_of_a_load_between_close_states(sign, steep_first):
    """The chord of an exponential misses no more than is read from the interval before."""
    judge = object.__new__(bending_judge._Judge)
    judge.along = sign * np.array([0.0, 0.3, 1.0])
    rate = (-6.0 if steep_first else 6.0) * sign
    judge.load = np.exp(rate * judge.along)
    ends = np.exp(rate * judge.along[1:]) / rate
    off = 0.5 * judge.load[1:].sum() * sign * 0.7 - (ends[1] - ends[0])
    change = judge._change(2)
    size, bent = judge._astray(off, 2, [1, 2])
    assert bending_judge.BEND * change < size < bent < 0.5 * change
    # On the other side of the chord, and where the state before is far, the bend explains no more.
    for other in (judge._astray(-off, 2, [1, 2]), judge._astray(off, 2, [2])):
        assert other == (size, bending_judge.BEND * change)

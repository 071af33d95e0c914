"""What the judge measures with, against brute force and closed forms."""

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from judge_tools import BARRIER, CELLS, CORE, LAW, D, cell_of, placed, sized, turning
from scipy.integrate import dblquad, quad
from scipy.spatial.transform import Rotation

from knitsim.verification import judge
from knitsim.verification.judge.given import (
    Core,
    control_of,
    controls_of,
    design,
    law_energy,
)
from knitsim.verification.judge.measure import Energy, size_of
from knitsim.verification.judge.shape import as_patterned, closest, crossings, expected_crossings
from knitsim.verification.judge.taut import Lines, lines_of, not_interlooped, straight, taut
from knitsim.yarn.law import TensionLaw


def set_in(given, rough):
    """The same yarn with set: 0.6 of the curvature of the rough loops."""
    control, lattice = rough
    wale, course = (np.append(step, 0.0) for step in lattice.reshape(2, 2))
    n = 12 * given.wales
    matrix, turns = design(n, np.arange(2 * n + 1) / 2)
    wide = np.concatenate([control + i * wale for i in range(given.wales)])
    line = matrix @ wide + turns[:, None] * given.wales * wale
    held = np.array([line + j * course for j in range(given.courses)]), lattice
    return dataclasses.replace(given, set_fraction=0.6, held=held)


def test_shares_nothing_with_the_solver():
    for path in Path(judge.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                assert {alias.name for alias in node.names} <= {"numpy", "math"}
            elif isinstance(node, ast.ImportFrom):
                assert node.module in (
                    "dataclasses",
                    "functools",
                    "itertools",
                    "scipy.spatial",
                ) or node.module.startswith("knitsim.verification.judge.")


# ---------------------------------------------------------------- splines and laws


def test_spline_goes_through_its_knots_and_repeats(rough):
    control, lattice = rough
    step = [lattice[0], 2e-4, 0.0]
    u = np.linspace(0.0, 12.0, 49)
    matrix, turns = design(12, u)
    points = matrix @ control + turns[:, None] * step
    assert control_of(points[:-1:4], step) == pytest.approx(control, abs=1e-12 * lattice[0])
    assert points[-1] - points[0] == pytest.approx(step, abs=1e-12)
    for order in (1, 2):
        h = 1e-4

        def at(u, order=order):
            matrix, turns = design(12, u, order - 1)
            return matrix @ control + turns[:, None] * step

        inner = u[:-1] + 0.1
        slope = (at(inner + h) - at(inner - h)) / (2 * h)
        matrix, turns = design(12, inner, order)
        exact = matrix @ control + turns[:, None] * step
        assert np.abs(slope - exact).max() < 1e-6 * np.abs(exact).max()


def test_law_energy_is_the_integral_of_the_tension():
    strains = np.array([-0.01, 0.003, 0.0097, 0.01, 0.0102, 0.02, 0.06, 0.09])
    law = TensionLaw(*LAW)
    assert law_energy(strains, BARRIER, 0.0) == pytest.approx(law.energy_at(strains), rel=1e-12)
    # Rounded, the tension differs near the kink alone, where it is smooth.
    step = 1e-7
    inner = np.linspace(0.009, 0.011, 41)
    ends = [law_energy(inner + s, BARRIER, 4e-4) for s in (-step, step)]
    off = np.abs((ends[1] - ends[0]) / (2 * step) - law.tension_at(inner))
    assert off[np.abs(inner - 0.01) > 4.1e-4].max() < 1e-6
    # A ramp max(x, 0) of the slope's jump, rounded over +-b, is off by b/4 in the middle.
    jump = np.diff(np.diff(LAW[1]) / np.diff(LAW[0]))[0]
    assert off.max() == pytest.approx(jump * 1e-4, rel=1e-4)


@pytest.mark.parametrize("law", [BARRIER.contact, CORE.contact])
def test_contact_law(law):
    z = np.linspace(0.31, 0.999, 30) * D
    force = law.at(z, D)[1]
    step = 1e-5 * D
    slope = (law.at(z + step, D)[0] - law.at(z - step, D)[0]) / (2 * step)
    assert force == pytest.approx(-slope, rel=2e-4, abs=1e-6 * force.max())
    assert law.at(np.array([D]), D)[0] == pytest.approx([0.0], abs=1e-12)
    # Two straight yarns that cross at a right angle repel with 2 pi D v(D).
    height = 0.6 * D

    def of_pair(a, b, height):
        far = np.sqrt(a * a + b * b + height * height)
        return float(law.at(far, D)[0]) if far < D else 0.0

    ends = [
        dblquad(of_pair, -D, D, -D, D, args=(height + s,), epsabs=0.0, epsrel=1e-6)[0]
        for s in (-0.01 * D, 0.01 * D)
    ]
    exact = 2 * np.pi * height * float(law.at(np.array(height), D)[0])
    assert (ends[0] - ends[1]) / (0.02 * D) == pytest.approx(exact, rel=1e-3)


def test_inside_the_core_there_is_no_energy():
    energy, _ = CORE.contact.at(np.array([0.04 * D, 0.05 * D]), D)
    assert np.isinf(energy).all()


# ---------------------------------------------------------------- energy


def brute_terms(given, control, lattice, curvature, bent):
    """Energies of a loop in space: fine differences for the yarn, every pair for the contact."""
    fine, loops = 3000, given.wales * given.courses
    span = given.loop_length / given.points
    u = (np.arange(given.points * given.wales * fine) + 0.5) / fine
    law, stretch, bending = TensionLaw(*LAW), 0.0, 0.0
    if given.set_fraction:
        lines, own = given.held
        knots = controls_of(lines, own, given.wales)
    for yarn in range(given.courses):
        along, speed, kappa = turning(given, control, lattice, curvature, bent, u, yarn)
        if given.set_fraction:
            was, _, rest = turning(given, knots, own, 0.0, bent, u, yarn)
            rest = given.set_fraction * rest
            # The rest curvature goes along with the least rotation from the tangent there to that here.
            axis = np.cross(was, along)
            turn = np.arctan2(np.linalg.norm(axis, axis=1), (was * along).sum(1))
            axis *= (turn / np.linalg.norm(axis, axis=1))[:, None]
            kappa = kappa - Rotation.from_rotvec(axis).apply(rest)
        length = given.loop_length * given.wales
        stretch += law.energy_at(speed / span - 1.0).mean() * length
        bending += 0.5 * given.bending_rigidity * (kappa**2).sum(1).mean() * length
    at = (np.arange(given.contacts * given.wales) + 0.5) * given.points / given.contacts
    contact, length = 0.0, given.loop_length / given.contacts
    for i in range(given.courses):
        own = placed(given, control, lattice, curvature, bent, at, i, (0, 0))
        for k in range(given.courses):
            for p in range(-2, 3):
                for q in range(-2, 3):
                    other = placed(given, control, lattice, curvature, bent, at, k, (p, q))
                    far = np.linalg.norm(own[:, None] - other[None], axis=2)
                    near = far < given.diameter
                    if q == 0 and i == k:
                        arc = at[:, None] - at[None] - p * given.points * given.wales
                        near &= np.abs(arc) * span >= 1.6 * given.diameter
                    v, _ = given.contact.at(far[near], given.diameter)
                    contact += 0.5 * v.sum() * length**2
    return np.array([stretch, bending, contact]) / loops


@pytest.mark.parametrize(("curvature", "bent"), [(0.0, 0), (400.0, 0), (-250.0, 1)])
@pytest.mark.parametrize("given", [BARRIER, CORE])
def test_energy_in_space(rough, given, curvature, bent):
    given = set_in(given, rough) if curvature < 0.0 else given
    control, lattice = cell_of(given, rough)
    energy = Energy(given, 12, given.contacts, False, bent)
    terms = energy.terms(energy.shape(control, lattice, curvature))
    expected = brute_terms(given, control, lattice, curvature, bent)
    assert terms[2] == pytest.approx(expected[2], rel=1e-9)
    assert terms[:2] == pytest.approx(expected[:2], rel=2e-4)


@pytest.mark.parametrize(("wales", "courses"), CELLS[1:])
def test_a_cell_of_several_loops_against_brute_force(rough, wales, courses):
    given = sized(BARRIER, wales, courses)
    control, lattice = cell_of(given, rough)
    energy = Energy(given, 12, given.contacts, False)
    terms = energy.terms(energy.shape(control, lattice))
    assert terms[2] == pytest.approx(brute_terms(given, control, lattice, 0.0, 0)[2], rel=1e-9)
    # Filled with the same loop it has the energy of that loop.
    alike, lattice = cell_of(given, rough, seed=7)[0] * 0.0, rough[1]
    for j in range(courses):
        for i in range(wales):
            loop = rough[0] + [i * lattice[0], j * lattice[3], 0.0]
            alike[j, i * 12 : (i + 1) * 12] = loop
    one = Energy(BARRIER, 12, 40, False)
    single = one.terms(one.shape(*rough))
    assert energy.terms(energy.shape(alike, lattice)) == pytest.approx(single, rel=1e-12)
    slopes, exact = energy.gradient(energy.shape(alike, lattice)), one.gradient(one.shape(*rough))
    assert slopes[1] == pytest.approx(exact[1], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("given", "curvature", "bent"), [(BARRIER, 0.0, 0), (CORE, 350.0, 1), (CORE, 350.0, 0)]
)
@pytest.mark.parametrize("cell", [(1, 1), (2, 2)])
def test_gradient_is_the_slope_of_the_energy(rough, given, curvature, bent, cell):
    given = set_in(sized(given, *cell), rough)
    control, lattice = cell_of(given, rough)
    energy, loops = Energy(given, 3, 160, True, bent), cell[0] * cell[1]
    on_control, on_lattice, by_curvature = energy.gradient(
        energy.shape(control, lattice, curvature)
    )

    def total(control, lattice, curvature=curvature):
        return energy.terms(energy.shape(control, lattice, curvature)).sum()

    step = 1e-9
    for index in ((0, 0, 0), (0, 3, 1), (0, 7, 2), (-1, 11, 0), (-1, 5, 2)):
        move = np.zeros(control.shape)
        move[index] = step
        slope = total(control + move, lattice) - total(control - move, lattice)
        assert abs(slope) > 0.0
        assert on_control[index] == pytest.approx(loops * slope / (2 * step), rel=2e-5)
    for entry in range(4):
        move = step * (np.arange(4) == entry)
        slope = total(control, lattice + move) - total(control, lattice - move)
        assert abs(slope) > 0.0
        assert on_lattice[entry] == pytest.approx(slope / (2 * step), rel=2e-5)
    slope = total(control, lattice, curvature + 0.01) - total(control, lattice, curvature - 0.01)
    assert abs(slope) > 0.0
    assert by_curvature == pytest.approx(slope / 0.02, rel=2e-5)


def test_energy_of_straight_yarns():
    """Stretch and contact of straight parallel yarns have closed forms, and there is no bending."""
    given = dataclasses.replace(BARRIER, points=24, contacts=600)
    lattice = np.array([1.03 * given.loop_length, 0.0, 0.0, 0.7 * D])
    knots = np.arange(24)[:, None] / 24 * np.array([lattice[0], 0.0, 0.0])
    energy = Energy(given, 3, 600, False)
    control = control_of(knots, [lattice[0], 0.0, 0.0])
    stretch, bend, contact = energy.terms(energy.shape(control, lattice))
    law = TensionLaw(*LAW)
    assert stretch == pytest.approx(given.loop_length * float(law.energy_at(0.03)), rel=1e-12)
    assert bend == pytest.approx(0.0, abs=1e-20)

    def phi(s):
        x = np.hypot(0.7 * D, 1.03 * s)
        return float(given.contact.at(x, D)[0]) if x < D else 0.0

    edge = np.sqrt(D**2 - (0.7 * D) ** 2) / 1.03
    assert contact == pytest.approx(given.loop_length * quad(phi, -edge, edge)[0], rel=1e-3)


# ---------------------------------------------------------------- crossings and distances


def test_closest_approach_between_contact_points(rough):
    """Of the rough loop, against a fine grid of both yarns; more than the contact points see."""
    given = dataclasses.replace(BARRIER, contacts=24)
    for curvature in (0.0, 250.0):
        energy, fine = Energy(given, 1, 24, False), Energy(given, 1, 1200, False)
        shape = energy.shape(*rough, curvature)
        found = closest(energy, shape)
        near = fine.shape(*rough, curvature).distance.min()
        # The grid misses the nearest place by up to half its spacing along both yarns.
        assert near * (1 - 1e-2) < found <= near
        assert found < 0.99 * shape.distance.min()
    far = np.array([*rough[1][:3], 9e-3])
    wide = control_of(np.arange(12)[:, None] / 12 * [5e-3, 0, 0], [5e-3, 0, 0])
    assert closest(energy, energy.shape(wide, [5e-3, 0, 0, far[3]])) == np.inf


def test_finer_integrals_follow_a_core_law_that_is_pressed():
    """Two straight yarns that cross 1.01 cores apart: the width of their contact is a seventh of it."""
    law = Core(0.5 * D, 1e9, 2.4)
    height = 0.505 * D
    width = np.sqrt(2 * height * (height - law.core))
    spacing = width / 1.5
    x = (np.arange(-400, 400) + 0.37) * spacing
    far = np.sqrt(height**2 + x[:, None] ** 2 + (x[None] + 0.2 * spacing) ** 2)
    found = law.at(far[far < D], D)[0].sum() * spacing**2
    exact = quad(lambda r: 2 * np.pi * r * float(law.at(np.array(r), D)[0]), height, D)[0]
    assert found == pytest.approx(exact, rel=2e-3)


def knots_of(sign):
    """A plain loop seen from the face (sign 1) or the back."""
    u = np.arange(48) / 48
    knots = np.stack(
        [1.5e-3 * u + 0.45e-3 * np.sin(4 * np.pi * u), -8e-4 * np.cos(2 * np.pi * u),
         -sign * 1.7e-4 * np.cos(4 * np.pi * u)], axis=1,
    )  # fmt: skip
    return knots


def interlooped(given, control, lattice):
    """Whether the yarns are knitted as the pattern says, as they stand."""
    return not_interlooped(given, [control], [lattice]) is None


@pytest.mark.parametrize(
    ("stitch", "sign"), [("k", 1.0), pytest.param("p", -1.0, marks=pytest.mark.slow)]
)
def test_crossings_of_plain_loops(stitch, sign):
    lattice = np.array([1.5e-3, 0.0, 0.0, 1.0e-3])
    given = dataclasses.replace(BARRIER, points=48, pattern=(stitch,))
    control = control_of(knots_of(sign), [1.5e-3, 0, 0])[None]
    assert interlooped(given, control, lattice)
    assert not interlooped(given, control * [1, 1, -1], lattice)
    assert not interlooped(given, control * [1, 1, 0], lattice)  # nothing lies over anything
    assert not interlooped(given, control, lattice * [1, 1, 1, 3])  # courses pulled apart
    assert interlooped(given, control, lattice + [0, 0, 2e-4, 0])  # sheared
    wide = np.concatenate([control[0], control[0] + [1.5e-3, 0, 0]])
    two = np.array([wide, wide + [0, 1e-3, 0]])
    given = dataclasses.replace(given, wales=2, courses=2)
    assert interlooped(given, two, lattice)
    assert not interlooped(dataclasses.replace(given, pattern=("kp",)), two, lattice)


def test_crossings_of_patterns():
    # Read along a knit stitch from its sinker arc: under, over the course below, over, under the next.
    plain = [(-1, False), (-1, True), (1, True), (1, False)]
    assert expected_crossings(("k",), 1, 1) == [tuple(plain + plain[::-1])]
    # Below a purl stitch it is drawn the other way; so is a purl stitch with the course below.
    mixed = [(-1, False), (-1, True), (1, False), (1, True)]
    knit, purl = expected_crossings(("k", "p"), 1, 2)
    assert knit == tuple(mixed + mixed[::-1])
    assert purl == tuple((course, not over) for course, over in knit)
    rib = expected_crossings(("kp",), 2, 1)[0]
    assert rib[:8] == tuple(plain + plain[::-1])
    assert rib[8:] == tuple((course, not over) for course, over in rib[:8])
    # A repeat of the pattern is the pattern.
    assert (
        expected_crossings(("kp", "pk"), 4, 4)[2] == 2 * expected_crossings(("kp", "pk"), 2, 2)[0]
    )


def rib_of(fold):
    """Control points (1, 96, 3) of a 1x1 rib whose purl wale lies behind the knit one by a part ``fold`` of
    a wale spacing; its lattice."""
    u, w = np.arange(96) / 96, 1.5e-3
    knit = np.cos(
        2 * np.pi * (u - 0.25)
    )  # 1 in the middle of the knit stitch, -1 in that of the purl
    side = np.tanh(4.0 * knit)
    knots = np.stack(
        [2 * w * u + 0.45e-3 * np.sin(8 * np.pi * u) - 0.5 * fold * w * side, -8e-4 * np.cos(4 * np.pi * u),
         -1.7e-4 * side * np.cos(8 * np.pi * u) + 4e-4 * fold * side], axis=1,
    )  # fmt: skip
    return control_of(knots, [2 * w, 0, 0])[None], np.array([w, 0.0, 0.0, 1.0e-3])


@pytest.mark.slow
def test_a_folded_rib_is_a_rib():
    given = dataclasses.replace(BARRIER, points=48, wales=2, pattern=("kp",))
    flat, folded = (lines_of(given, *rib_of(fold)) for fold in (0.0, 0.9))
    assert as_patterned(given, flat.corners, flat.cell) and straight(given, flat, flat)
    assert not as_patterned(given, folded.corners, folded.cell)
    assert taut(given, folded)
    assert not taut(dataclasses.replace(given, pattern=("kk",)), folded)


def test_a_straight_way_on_which_yarns_meet():
    """Two courses without a loop, one of which rises through the other."""
    given = dataclasses.replace(BARRIER, points=12, wales=1, courses=2)
    cell, x = np.array([[1.5e-3, 0.0], [0.0, 2e-3]]), np.arange(24) / 24
    wave = np.stack([1.5e-3 * x, 0.6e-3 * np.cos(2 * np.pi * x), 0.0 * x], axis=1)
    other = np.stack([1.5e-3 * x, 0.0 * x, 0.0 * x], axis=1)

    def at(height):
        return Lines(np.array([wave, other + [0.0, 0.0, height]]), cell)

    assert straight(given, at(1e-3), at(0.1e-3))
    assert not straight(given, at(1e-3), at(-1e-3))
    turned = Lines(at(1e-3).corners, cell + [[1e-5, 0.0], [0.0, 1e-5]])
    assert straight(given, at(1e-3), turned)


def test_all_purl_is_all_knit_from_the_back():
    for wales, courses in CELLS:
        knit, purl = (expected_crossings((stitch,), wales, courses) for stitch in "kp")
        assert knit == [tuple((c, not over) for c, over in codes) for codes in purl]
    given = dataclasses.replace(BARRIER, points=48)
    control = control_of(knots_of(1.0), [1.5e-3, 0, 0])[None]
    lines = lines_of(given, control, np.array([1.5e-3, 0.0, 0.0, 1.0e-3]))
    assert len(crossings(given, lines.corners, lines.cell)[0]) == 8
    assert size_of(control).shape == (1, 48)

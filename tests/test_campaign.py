"""The campaign of random fabrics: how they are drawn, the rule for possible, and the judge.

The judge must find every planted error, and nothing in a result that is right.
"""

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import dblquad, quad

import knitsim.stages.campaign as stage
import knitsim.stages.judged as judged
from knitsim.equilibrium.pull import tensile
from knitsim.errors import ComputationError, InputError
from knitsim.verification import campaign, judge_energy
from knitsim.verification import judge as judging
from knitsim.verification.campaign import RANGES, Case, draw, impossible, squeeze_at_break
from knitsim.verification.judge import States, crossings, integral, judge
from knitsim.verification.judge_energy import Energy, Given, control_of, design, law_energy, near
from knitsim.yarn.law import TensionLaw

TRIAL = 4711  # seed of the tests; the campaign has another
LAW = ((0.0, 0.01, 0.07), (0.0, 0.44, 5.84))
COTTON = {
    "wale_spacing": 1.4993e-3, "course_spacing": 1.2005e-3, "loop_length": 5.56e-3,
    "diameter": 0.2793e-3, "bending_rigidity": 5e-9,
}  # fmt: skip


# ---------------------------------------------------------------- cases


def test_a_case_is_made_from_its_number_alone():
    assert draw(17, TRIAL) == draw(17, TRIAL)
    assert draw(17, TRIAL) != draw(18, TRIAL)
    assert draw(17, TRIAL) != draw(17, TRIAL + 1)


def test_cases_fill_the_stated_ranges():
    cases = [draw(number, TRIAL) for number in range(400)]
    drawn = {
        "loop_over_diameter": [c.loop_length / c.diameter for c in cases],
        "kw": [c.loop_length / c.wale_spacing for c in cases],
        "kc": [c.loop_length / c.course_spacing for c in cases],
        "diameter": [c.diameter for c in cases],
        "course_strain": [c.course_strain for c in cases],
        "wale_strain": [c.wale_strain for c in cases],
        "friction": [c.friction for c in cases],
        "breaking_strain": [c.breaking_strain for c in cases],
        "bending": [
            c.bending_rigidity * 16 * c.law_strain[1] / (c.law_tension[1] * c.diameter**2)
            for c in cases
        ],
        "compression": [
            c.contact_stiffness * c.diameter * c.law_strain[1] / c.law_tension[1] for c in cases
        ],
    }  # fmt: skip
    for name, values in drawn.items():
        low, high, scale = RANGES[name]
        values = np.log(values) if scale == "log" else np.array(values)
        low, high = (np.log(low), np.log(high)) if scale == "log" else (low, high)
        assert low * (1 - 1e-12 * np.sign(low)) <= values.min()
        assert values.max() <= high * (1 + 1e-12 * np.sign(high))
        # 400 uniform numbers leave a tenth of the range empty at an end once in 10^18.
        assert values.min() < low + 0.1 * (high - low)
        assert values.max() > high - 0.1 * (high - low)
    # The ranges: l/d 13 to 40, three decades of bending, friction to 0.6, strains.
    assert RANGES["loop_over_diameter"][:2] == (13.0, 40.0)
    assert RANGES["bending"][1] / RANGES["bending"][0] == pytest.approx(1000.0)
    assert [RANGES[n][1] for n in ("friction", "course_strain", "wale_strain")] == [0.6, 1.0, 0.6]


def cotton_case(**changes):
    values = COTTON | {
        "number": 0, "law_strain": LAW[0], "law_tension": LAW[1], "contact_stiffness": 1000.0,
        "friction": 0.2, "course_strain": 0.6, "wale_strain": 0.3,
    }  # fmt: skip
    return Case(**(values | changes))


def test_the_paper_s_cotton_is_possible():
    assert impossible(cotton_case()) == ()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"wale_spacing": 0.8e-3}, "four yarns"),
        ({"course_spacing": 0.4e-3}, "two yarns"),
        ({"loop_length": 4.5e-3}, "too short to interlace"),
        ({"course_strain": 3.0}, "course strain"),
        ({"wale_strain": 2.0}, "wale strain"),
    ],
)
def test_what_cannot_exist_is_called_impossible(changes, reason):
    reasons = impossible(cotton_case(**changes))
    assert any(reason in r for r in reasons)


def test_squeeze_at_break_is_a_crossing_in_balance():
    case = cotton_case(contact_stiffness=5e4)
    d = case.diameter
    x = squeeze_at_break(case)

    def energy(height):
        def one(a, b):
            square = (a * a + b * b + height * height) / d**2
            return 5e4 * (1 - square) ** 2 / square if square < 1 else 0.0

        return dblquad(one, -d, d, -d, d, epsabs=0.0, epsrel=1e-6)[0]

    step = 0.02 * d
    force = (energy(x * d - step) - energy(x * d + step)) / (2 * step)
    assert force == pytest.approx(2 * case.law_tension[-1], rel=5e-3)


# ---------------------------------------------------------------- what the judge measures with


GIVEN = Given(5.56e-3, 0.2793e-3, 5e-9, *LAW, 1000.0, 0.3, 12, 40)


def test_spline_goes_through_its_knots_and_repeats(rough):
    control, width, _ = rough
    u = np.linspace(0.0, 12.0, 49)
    matrix, turns = design(12, u)
    points = matrix @ control + turns[:, None] * [width, 0, 0]
    assert control_of(points[:-1:4], width) == pytest.approx(control, abs=1e-12 * width)
    assert points[-1] - points[0] == pytest.approx([width, 0, 0], abs=1e-12)
    for order in (1, 2):
        step = 1e-4

        def at(u, order=order):
            matrix, turns = design(12, u, order - 1)
            return matrix @ control + turns[:, None] * [width, 0, 0]

        inner = u[:-1] + 0.1
        slope = (at(inner + step) - at(inner - step)) / (2 * step)
        matrix, turns = design(12, inner, order)
        exact = matrix @ control + turns[:, None] * [width, 0, 0]
        assert np.abs(slope - exact).max() < 1e-6 * np.abs(exact).max()


def test_law_energy_is_the_integral_of_the_tension():
    strains = np.array([-0.01, 0.003, 0.0097, 0.01, 0.0102, 0.02, 0.06, 0.09])
    law = TensionLaw(*LAW)
    energy, tension = law_energy(strains, GIVEN, 0.0)
    assert energy == pytest.approx(law.energy_at(strains), rel=1e-12)
    assert tension == pytest.approx(law.tension_at(strains), rel=1e-12)
    for e in strains:
        area = quad(lambda x: float(law_energy(np.array(x), GIVEN, 4e-4)[1]), 0.0, e,
                    points=[p for p in (0.0096, 0.0104) if p < e])[0]  # fmt: skip
        assert float(law_energy(np.array(e), GIVEN, 4e-4)[0]) == pytest.approx(area, rel=1e-9)
    outside = np.abs(strains - 0.01) > 4e-4
    rounded = law_energy(strains, GIVEN, 4e-4)[1]
    assert rounded[outside] == pytest.approx(tension[outside], rel=1e-12)
    assert np.abs(rounded - tension)[~outside].max() > 0.0


def all_pairs(energy, shape):
    """Every pair of contact points closer than a diameter, one after another."""
    given, found = energy.given, {}
    for courses in range(-2, 3):
        for wales in range(-2, 3):
            for i in range(given.contacts):
                for k in range(given.contacts):
                    shift = np.array([wales * shape.lattice[0], courses * shape.lattice[1], 0.0])
                    gap = shape.points[i] - shape.points[k] - shift
                    if np.linalg.norm(gap) >= given.diameter:
                        continue
                    if courses == 0:
                        arc = (i - k - wales * given.contacts) * given.loop_length / given.contacts
                        if abs(arc) < 1.6 * given.diameter:
                            continue
                    # (i, k, image) and (k, i, the opposite image) are the same pair.
                    if (k, i, -wales, -courses) not in found:
                        found[i, k, wales, courses] = gap
    return found


def test_pairs_and_barrier_against_brute_force(rough):
    energy = Energy(GIVEN, 3, 40, 0.0)
    shape = energy.shape(*rough)
    slow = all_pairs(energy, shape)
    assert len(shape.i) == len(slow) > 10
    x = np.array([np.linalg.norm(g) for g in slow.values()]) / GIVEN.diameter
    step = GIVEN.loop_length / 40
    expected = (GIVEN.contact_stiffness * (1 - x**2) ** 2 / x**2).sum() * step**2
    assert energy.terms(shape)[2] == pytest.approx(expected, rel=1e-12)
    i, k = near(shape.points, shape.points + [2e-4, 0, 0], 4e-4)
    far = np.linalg.norm(shape.points[:, None] - shape.points[None] - [2e-4, 0, 0], axis=2) < 4e-4
    assert set(zip(i, k, strict=True)) == set(zip(*np.nonzero(far), strict=True))


def test_gradient_is_the_slope_of_the_energy(rough):
    energy = Energy(GIVEN, 3, 40, 4e-4)
    control, width, height = rough
    on_points, on_lattice = energy.gradient(energy.shape(control, width, height))

    def total(control, width, height):
        return energy.terms(energy.shape(control, width, height)).sum()

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
    assert on_lattice[1] == pytest.approx(slope / (2 * step), rel=1e-5)
    assert abs(slope) > 0.0


def test_energy_of_straight_yarns():
    """Stretch and contact of straight parallel yarns have closed forms, and there is no bending."""
    given = dataclasses.replace(GIVEN, points=24, contacts=600)
    width, height = 1.03 * given.loop_length, 0.7 * given.diameter
    knots = np.arange(24)[:, None] / 24 * np.array([width, 0.0, 0.0])
    energy = Energy(given, 3, 600, 0.0)
    stretch, bend, contact = energy.terms(energy.shape(control_of(knots, width), width, height))
    law = TensionLaw(*LAW)
    assert stretch == pytest.approx(given.loop_length * float(law.energy_at(0.03)), rel=1e-12)
    assert bend == pytest.approx(0.0, abs=1e-20)

    def phi(s):
        x = np.hypot(height, 1.03 * s) / given.diameter
        return 1000.0 * (1 - x * x) ** 2 / (x * x) if x < 1 else 0.0

    edge = np.sqrt(given.diameter**2 - height**2) / 1.03
    line = quad(phi, -edge, edge)[0]
    assert contact == pytest.approx(given.loop_length * line, rel=1e-3)


def test_bending_energy_of_a_shallow_wave():
    given = dataclasses.replace(GIVEN, loop_length=5e-3, points=48, contacts=8)
    u, high = np.arange(48) / 48, 1e-6
    knots = np.stack([5e-3 * u, high * np.cos(2 * np.pi * u), 0 * u], axis=1)
    energy = Energy(given, 3, 8, 0.0)
    bend = energy.terms(energy.shape(control_of(knots, 5e-3), 5e-3, 1e-2))[1]
    # B/2 times the mean of (y'')^2 times the length.
    exact = 0.5 * 5e-9 * 0.5 * (high * (2 * np.pi / 5e-3) ** 2) ** 2 * 5e-3
    assert bend == pytest.approx(exact, rel=1e-4)


def test_rubbing_against_brute_force(rough):
    energy = Energy(GIVEN, 3, 40, 0.0)
    control, width, height = rough
    move = 1e-6 * np.random.default_rng(5).standard_normal((12, 3))
    shapes = [
        energy.shape(control, width, height),
        energy.shape(control + move, 1.01 * width, 0.99 * height),
    ]
    pairs = all_pairs(energy, shapes[0])
    for i, k, wales, courses in all_pairs(energy, shapes[1]):
        if (k, i, -wales, -courses) not in pairs:
            pairs[i, k, wales, courses] = None
    lost = 0.0
    for i, k, wales, courses in pairs:
        gaps = [
            s.points[i] - s.points[k] - [wales * s.lattice[0], courses * s.lattice[1], 0.0]
            for s in shapes
        ]
        x = [min(np.linalg.norm(g) / GIVEN.diameter, 1.0) for g in gaps]
        # -dv/dD of K (1 - x^2)^2/x^2, in points of the length that each stands for.
        force = [
            2 * 1000.0 * (1 / y - y) * (1 / y**2 + 1) / GIVEN.diameter * (GIVEN.loop_length / 40) ** 2
            for y in x
        ]  # fmt: skip
        normal = (gaps[0] + gaps[1]) / np.linalg.norm(gaps[0] + gaps[1])
        slip = (gaps[1] - gaps[0]) - ((gaps[1] - gaps[0]) @ normal) * normal
        lost += 0.3 * 0.5 * (force[0] + force[1]) * np.linalg.norm(slip)
    assert energy.rubbed(*shapes) == pytest.approx(lost, rel=1e-12)
    assert lost > 0.0
    assert energy.rubbed(shapes[0], shapes[0]) == 0.0


def test_integral():
    x = np.array([0.0, 0.1, 0.25, 0.3, 0.6, 1.0])
    parabola = 3 * x**2 - x + 2
    assert integral(x, parabola) == pytest.approx(x**3 - 0.5 * x**2 + 2 * x, abs=1e-14)
    assert integral(x, 2 * x + 1, order=1) == pytest.approx(x**2 + x, abs=1e-14)
    assert integral(x[:2], x[:2]) == pytest.approx([0.0, 0.005])


def test_judge_shares_nothing_with_the_solver():
    for module in (judging, judge_energy, campaign):
        names = set()
        for node in ast.walk(ast.parse(Path(module.__file__).read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module)
        allowed = {"numpy", "dataclasses", "math", "knitsim.verification.judge_energy"}
        assert names <= allowed


# ---------------------------------------------------------------- the judge and planted errors


def solved(friction):
    case = cotton_case(friction=friction)
    relaxed = stage.relaxed_of(case, None)
    rest = stage._rest(relaxed)
    strains = [0.0025, 0.005, *np.linspace(0.02, 0.2, 10)]
    curve = tensile(relaxed, "course", strains)
    return stage.given_of(case, relaxed), rest, stage._states(rest, curve, np.full(12, np.nan))


@pytest.fixture(scope="module")
def smooth():
    return solved(0.0)


@pytest.fixture(scope="module")
def rubbing():
    return solved(0.3)


def changed(states, **changes):
    return dataclasses.replace(states, **changes)


def checks(given, states, direction="course", asked=0.2):
    return " | ".join(finding.check for finding in judge(given, states, direction, asked))


def test_right_results_are_called_right(smooth, rubbing):
    for given, rest, states in (smooth, rubbing):
        assert judge(given, rest) == []
        assert judge(given, states, "course", 0.2) == []


def test_numbers_that_are_none(smooth):
    given, _, states = smooth
    for name in ("force", "centreline", "energy", "work"):
        values = getattr(states, name).copy()
        values.reshape(len(values), -1)[4, -1] = np.nan
        found = judge(given, changed(states, **{name: values}), "course", 0.2)
        assert [(f.check, f.state) for f in found] == [(f"{name} is not finite", 4)]


def test_lost_crossings(smooth):
    given, rest, states = smooth
    line = states.centreline.copy()
    line[7, :, 2] *= -1.0  # seen from the back
    assert "crossings" in checks(given, changed(states, centreline=line))
    wide = changed(rest, course_spacing=3.0 * rest.course_spacing)  # courses pulled apart
    assert "crossings" in " ".join(f.check for f in judge(given, wide))
    flat = rest.centreline * [1.0, 1.0, 0.0]  # nothing lies over anything
    assert "crossings" in " ".join(f.check for f in judge(given, changed(rest, centreline=flat)))


def on_its_spline(line):
    """The line with its middle points on the spline through its knots."""
    n = (len(line) - 1) // 2
    matrix, turns = design(n, np.arange(2 * n + 1) / 2)
    width = line[-1, 0] - line[0, 0]
    return matrix @ control_of(line[:-1:2], width) + turns[:, None] * [width, 0, 0]


def test_crossings_are_read_from_the_head(smooth):
    _, rest, _ = smooth
    line = rest.centreline[0]
    lattice = rest.wale_spacing[0], rest.course_spacing[0]
    assert tuple(crossings(line, *lattice)) == judging.PLAIN_KNIT
    # From the back, over and under exchange.
    back = crossings(line * [1, 1, -1], *lattice)
    assert [over for _, over in back] == [not over for _, over in judging.PLAIN_KNIT]


@pytest.mark.parametrize("factor", [1.05, 0.95])
def test_a_force_that_is_wrong_by_five_per_cent(smooth, rubbing, factor):
    given, _, states = smooth
    for i in (5, 12):  # states whose forces are measured
        one = states.force.copy()
        one[i] *= factor
        assert "force on the wale spacing is wrong" in checks(given, changed(states, force=one))
    # With friction the force shows in the work only.
    given, _, states = rubbing
    found = checks(given, changed(states, force=factor * states.force))
    assert "work is not stored or lost" in found


def test_a_force_that_is_not_the_slope_of_a_finer_energy(rubbing):
    given, _, states = rubbing
    found = checks(given, changed(states, force=1.12 * states.force))
    assert "slope of the energy, finer integrals" in found
    # Unless the solver says that it does not know better.
    known = changed(
        states, force=1.12 * states.force, numerical_error=np.full(len(states.force), 0.5)
    )
    assert "finer integrals" not in checks(given, known)


def test_energy_out_of_balance(smooth, rubbing):
    given, _, states = rubbing
    found = checks(given, changed(states, dissipated=0.8 * states.dissipated))
    assert "work is not stored or lost" in found
    assert "friction takes more" in checks(
        given, changed(states, dissipated=1.2 * states.dissipated)
    )
    back = states.dissipated.copy()
    back[8] = back[7] - 1e-3 * states.work[8]
    assert "friction gives energy" in checks(given, changed(states, dissipated=back))
    given, _, states = smooth
    assert "reported work" in checks(given, changed(states, work=1.05 * states.work))
    more = states.energy.copy()
    more[9, 1] *= 1.00001
    assert checks(given, changed(states, energy=more)) == "energy is not that of the shape"
    less = states.energy * np.linspace(1.0, 0.9, len(states.energy))[:, None]
    assert "energy is below that at rest" in checks(given, changed(states, energy=less))


def test_a_state_that_is_no_equilibrium(smooth):
    """A spot of the yarn pushed by a hundredth of a diameter, everything reported accordingly."""
    given, rest, _ = smooth
    line = rest.centreline[0].copy()
    line[10:-1:96, 2] += 0.01 * given.diameter
    moved = on_its_spline(line)
    energy = Energy(given, 3, given.contacts, judge_energy.ROUNDED_STRAIN)
    shape = energy.shape(
        control_of(moved[:-1:2], rest.wale_spacing[0]), rest.wale_spacing[0], rest.course_spacing[0]
    )
    pushed = changed(
        rest, centreline=moved[None], energy=energy.terms(shape)[None],
        min_distance=np.array([shape.distance.min() / given.diameter]),
    )  # fmt: skip
    found = [f.check for f in judge(given, pushed)]
    assert "a control point is not in equilibrium" in found
    # A fabric that still wants to contract is no fabric at rest.
    given, _, states = smooth
    pulled = States(*(getattr(states, f.name)[-1:] for f in dataclasses.fields(States)))
    assert any("force on the wale spacing" in f.check for f in judge(given, pulled))


def test_other_lies(smooth):
    given, rest, states = smooth
    assert "asked strain not reached" in checks(given, states, asked=0.25)
    assert judge(given, states, "course", None) == []
    strain = states.strain.copy()
    strain[3] += 1e-3
    assert "strain is not that of the spacing" in checks(given, changed(states, strain=strain))
    near_by = states.min_distance.copy()
    near_by[2] *= 1.01
    assert "smallest distance" in checks(given, changed(states, min_distance=near_by))
    line = states.centreline.copy()
    line[2, 31, 0] += 0.01 * given.diameter
    assert "no periodic cubic spline" in checks(given, changed(states, centreline=line))
    stiffer = dataclasses.replace(given, bending_rigidity=1.01 * given.bending_rigidity)
    assert "energy is not that of the shape" in " ".join(f.check for f in judge(stiffer, rest))


def test_friction_beyond_coulomb(rubbing):
    given, _, states = rubbing
    weak = dataclasses.replace(given, friction=0.1)
    found = checks(weak, states)
    assert "a control point is not in equilibrium" in found
    assert "friction takes more" in found


# ---------------------------------------------------------------- the stage


def test_run_tells_possible_from_impossible_and_judges(monkeypatch):
    cases = [
        cotton_case(number=0, friction=0.0, course_strain=0.1, wale_strain=0.05),
        cotton_case(number=1, diameter=0.6e-3),
    ]
    monkeypatch.setattr(stage, "draw", lambda number, seed: cases[number])
    rows, times = stage.run([0, 1])
    assert [row["number"] for row in rows] == [row["number"] for row in times] == [0, 1]
    assert all(set(row) == set(stage.COLUMNS) for row in rows)
    good, bad = rows
    assert (good["possible"], good["outcome"]) == ("yes", "reached")
    assert good["course_reached_strain"] == pytest.approx(0.1, abs=1e-9)
    assert good["wale_reached_strain"] == pytest.approx(0.05, abs=1e-9)
    assert (bad["possible"], bad["outcome"]) == ("no", "refused")
    assert bad["rest_reason"].startswith("InputError: diameter")
    assert stage.run([0, 1])[0] == rows
    values = {row[0]: row[1] for row in stage.summary(rows)}
    assert values["cases"] == 2
    assert values["possible cases that reached both asked strains, per cent"] == "100"
    assert values["wrong results in all cases"] == 0


def test_stops_failures_and_wrong_results_are_told_apart(monkeypatch):
    case = cotton_case(friction=0.0, course_strain=0.1, wale_strain=0.05)
    monkeypatch.setattr(stage, "draw", lambda number, seed: case)

    def outcome(name, replacement):
        with monkeypatch.context() as patch:
            patch.setattr(stage if hasattr(stage, name) else judged, name, replacement)
            return stage.run([0])[0][0]

    def fails(error):
        def call(*args, **kwargs):
            raise error

        return call

    def stops(relaxed, direction, strains, **more):
        curve = tensile(relaxed, direction, strains[:5])
        return curve.replaced(stop_reason="stopped here")

    def lies(relaxed, direction, strains, **more):
        curve = tensile(relaxed, direction, strains)
        return curve.replaced(force_per_loop=1.05 * curve.force_per_loop)

    refused = outcome("relaxed_of", fails(ComputationError("nothing found")))
    assert (refused["outcome"], refused["rest_reason"]) == (
        "refused", "ComputationError: nothing found",
    )  # fmt: skip
    assert outcome("relaxed_of", fails(ZeroDivisionError("division")))["outcome"] == "wrong"
    assert outcome("tensile", fails(InputError("strain", 1, "no")))["outcome"] == "refused"
    stopped = outcome("tensile", stops)
    assert (stopped["outcome"], stopped["course_reason"]) == ("stopped", "stopped here")
    wrong = outcome("tensile", lies)
    assert wrong["outcome"] == "wrong"
    assert "force" in wrong["course_reason"]
    values = {row[0]: row[1] for row in stage.summary([stopped, wrong, refused])}
    assert values["possible cases that reached both asked strains, per cent"] == "0"
    assert values["possible cases that stopped before with a reason"] == 1
    assert values["possible cases that were refused with a reason"] == 1
    assert values["wrong results in all cases"] == 1

"""The stress campaign: cases, the rule for possible, outcomes, summary and map."""

import dataclasses
import math

import numpy as np
import pytest

import knitsim.stages.bending_campaign as bent
import knitsim.stages.judged as judged
import knitsim.stages.stress as stage
from knitsim.equilibrium.pull import tensile
from knitsim.errors import ComputationError, InputError
from knitsim.figures.stress import stress_map
from knitsim.verification import stress, stress_bending
from knitsim.verification.campaign import Case
from knitsim.verification.stress import FAMILIES, RANGES, StressCase, draw, impossible

TRIAL = 4711  # seed of the tests; the campaign has another
COTTON = Case(
    0, 1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, (0.0, 0.01, 0.07), (0.0, 0.44, 5.84), 1000.0,
    0.0, 0.1, 0.0,
)  # fmt: skip
PULLED = StressCase(0, "any", "course", COTTON, 100.0, False, False, 1, None, 48, None, False)
BENT = dataclasses.replace(PULLED, test="course bending")


# ---------------------------------------------------------------- cases


def test_a_case_is_made_from_its_number_alone():
    assert draw(17, TRIAL) == draw(17, TRIAL)
    assert draw(17, TRIAL) != draw(18, TRIAL)
    assert draw(17, TRIAL) != draw(17, TRIAL + 1)


def test_cases_reach_what_the_campaign_is_for():
    cases = [draw(number, TRIAL) for number in range(2000)]
    sound = [case for case in cases if case.family not in ("no input", "limp", "rigid")]
    rigidity = np.array([
        16 * c.fabric.bending_rigidity * c.fabric.law_strain[1]
        / (c.fabric.law_tension[1] * c.fabric.diameter**2)
        for c in sound
    ])  # fmt: skip
    stiffness = [
        c.fabric.law_tension[1] / c.fabric.law_strain[1] / c.fabric.diameter**2 for c in sound
    ]
    # Six decades of rigidity, four of stiffness, friction to 1.
    assert np.log10(rigidity.max() / rigidity.min()) == pytest.approx(6.0, abs=0.3)
    assert np.log10(max(stiffness) / min(stiffness)) == pytest.approx(4.0, abs=0.3)
    assert max(c.fabric.friction for c in sound) > 0.95
    assert min(c.fabric.friction for c in sound) == 0.0
    assert any(c.fabric.bending_rigidity == 0.0 for c in cases)
    jumps = [c for c in cases if c.family == "jump"]
    assert all(c.levels == 1 and c.kind == "tension" for c in jumps)
    assert max(c.largest for c in jumps) > 0.5
    assert {c.increment for c in jumps} == {None, 0.1, 0.5}
    assert {c.family for c in cases} == set(FAMILIES)
    assert {c.test for c in cases} == set(stress.TESTS)
    assert min(c.points for c in cases) < 24
    assert all(name in RANGES for changed in FAMILIES.values() for name in changed)


def test_coordinates_are_pairs_to_the_largest():
    case = dataclasses.replace(PULLED, levels=2)
    assert case.largest == 0.1
    assert case.coordinates == pytest.approx([0.001, 0.049, 0.05, 0.099, 0.1])
    jump = dataclasses.replace(case, family="jump")
    assert jump.coordinates == pytest.approx([0.049, 0.05, 0.099, 0.1])
    case = dataclasses.replace(BENT, curvature=-200.0)
    assert case.coordinates == pytest.approx([-2.0, -198.0, -200.0])
    case = dataclasses.replace(case, recovers=True)
    assert case.path == pytest.approx([0.0, -2.0, -198.0, -200.0, -198.0, 0.0, 200.0])


def test_the_paper_s_cotton_is_possible():
    assert impossible(PULLED) == () == impossible(BENT)
    assert stress_bending.impossible(COTTON) == ()


@pytest.mark.parametrize(
    ("changes", "of_case", "reason"),
    [
        ({"bending_rigidity": 0.0}, {}, "no bending rigidity"),
        ({"loop_length": math.nan}, {}, "no positive number"),
        ({"friction": 1.2}, {}, "friction out of range"),
        ({"diameter": 0.5e-3}, {}, "too thick"),
        ({"loop_length": 20e-3}, {}, "too long"),
        ({"wale_spacing": 0.8e-3}, {}, "four yarns"),
        ({"course_strain": 3.0}, {}, "course strain"),
        ({"bending_rigidity": 1e-13}, {}, "contact narrower"),
        ({"contact_stiffness": 10.0}, {}, "so soft"),
        ({}, {"points": 20}, "control points"),
        ({}, {"points": 50}, "control points"),
        ({}, {"contacts": 100}, "contact points too far apart"),
        ({}, {"test": "wale bending", "curvature": -1000.0}, "curvature too tight"),
    ],
)
def test_what_cannot_be_solved_is_called_impossible(changes, of_case, reason):
    fabric = dataclasses.replace(COTTON, **changes)
    case = dataclasses.replace(PULLED, fabric=fabric, **of_case)
    assert any(reason in r for r in impossible(case))


def test_strain_counts_only_where_it_is_asked():
    fabric = dataclasses.replace(COTTON, course_strain=3.0)
    assert impossible(dataclasses.replace(PULLED, test="wale", fabric=fabric)) == ()
    assert impossible(dataclasses.replace(BENT, fabric=fabric)) == ()
    assert stress_bending.impossible(fabric) == ()
    thick = dataclasses.replace(COTTON, diameter=0.9e-3, loop_length=20e-3)
    assert any("curvature" in r for r in stress_bending.impossible(thick))


def test_path_of_the_bending_campaign():
    path = stress_bending.path()
    assert path[0] == path[-1] == 0.0
    assert (path.max(), path.min()) == (250.0, -250.0)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(path))))
    assert path[turns + 1] == pytest.approx([250.0, -250.0])
    # Each level is reached from 1 % of the largest before, and so is what follows a turn.
    for level in (62.5, 125.0, 187.5, 250.0):
        for sign in (1.0, -1.0):
            assert np.abs(path - sign * (level - 2.5)).min() < 1e-9
    assert path[[1, 10, 11, -1]] == pytest.approx([2.5, 247.5, 190.0, 0.0])


# ---------------------------------------------------------------- outcomes


def outcome_of(monkeypatch, case, **replacements):
    with monkeypatch.context() as patch:
        patch.setattr(stage.stress, "draw", lambda number, seed: case)
        for name, replacement in replacements.items():
            patch.setattr(stage if hasattr(stage, name) else judged, name, replacement)
        rows, times = stage.run([0])
    assert set(rows[0]) == set(stage.COLUMNS)
    assert set(times[0]) == set(stage.TIMES)
    return rows[0]


def fails(error):
    def call(*args, **kwargs):
        raise error

    return call


def test_outcomes_are_told_apart(monkeypatch):
    def stops(relaxed, direction, strains, **more):
        return tensile(relaxed, direction, strains[:2]).replaced(stop_reason="stopped here")

    def lies(relaxed, direction, strains, **more):
        curve = tensile(relaxed, direction, strains)
        return curve.replaced(force_per_loop=1.05 * curve.force_per_loop)

    right = outcome_of(monkeypatch, PULLED)
    assert (right["possible"], right["outcome"], right["states"]) == ("yes", "verified", 3)
    assert right["reached"] == pytest.approx(0.1)
    bends = outcome_of(monkeypatch, BENT)
    assert (bends["outcome"], bends["reached"]) == ("verified", 100.0)
    stopped = outcome_of(monkeypatch, PULLED, tensile=stops)
    assert (stopped["outcome"], stopped["reason"]) == ("stopped", "stopped here")
    assert outcome_of(monkeypatch, PULLED, tensile=lies)["outcome"] == "wrong"
    refused = outcome_of(monkeypatch, PULLED, relax=fails(ComputationError("nothing found")))
    assert (refused["outcome"], refused["reason"]) == ("refused", "ComputationError: nothing found")
    assert (
        outcome_of(monkeypatch, PULLED, tensile=fails(InputError("a", 1, "no")))["outcome"]
        == "refused"
    )
    failed = outcome_of(monkeypatch, PULLED, relax=fails(ZeroDivisionError("division")))
    assert failed["outcome"] == "wrong"
    # An input that no fabric has must be refused.
    nonsense = dataclasses.replace(PULLED, family="no input")
    assert outcome_of(monkeypatch, nonsense)["outcome"] == "wrong"
    nothing = dataclasses.replace(
        nonsense, fabric=dataclasses.replace(COTTON, bending_rigidity=0.0)
    )
    row = outcome_of(monkeypatch, nothing)
    assert (row["possible"], row["outcome"]) == ("no", "refused")
    assert row["reason"].startswith("InputError: bending rigidity")
    rows = [right, bends, stopped, failed, refused, row]
    values = {(r[0], r[1]): r[2] for r in stage.summary(rows)}
    assert values["cases", "all"] == 6
    assert values["possible cases", "all"] == 5
    assert values["possible cases solved and verified, per cent", "all"] == "40"
    assert values["possible cases that stopped before with a reason", "all"] == 1
    assert values["possible cases that were refused with a reason", "all"] == 1
    assert values["wrong results in all cases", "all"] == 1
    assert values["cases", "no input"] == 1


def test_a_force_that_does_not_stand_refinement(monkeypatch):
    """The same answer at every resolution is right; one that changes more than was said is wrong."""
    case = dataclasses.replace(PULLED, refined=True)
    right = outcome_of(monkeypatch, case)
    assert right["outcome"] == "verified"
    assert 0.0 < right["refined_difference"] < 0.05
    assert right["refined_difference"] <= max(0.05, right["estimated_error"])

    def drifting(given, states, test):
        return []

    def coarse(relaxed, direction, strains, **more):
        curve = tensile(relaxed, direction, strains, **more)
        factor = 1.3 if relaxed.model.cell.points == 48 else 1.0
        return curve.replaced(force_per_loop=factor * curve.force_per_loop)

    wrong = outcome_of(monkeypatch, case, tensile=coarse, judge_test=drifting)
    assert wrong["outcome"] == "wrong"
    assert "twice the resolution" in wrong["reason"]


def test_a_snap_is_told_from_steps_that_are_too_long(monkeypatch):
    """Work that goes astray by the same amount in shorter steps was set free, else it is an error."""

    def astray(power):
        def call(relaxed, direction, strains, *, increment, **more):
            curve = tensile(relaxed, direction, strains, increment=increment, **more)
            jump = 0.2 * curve.work[-1] * (increment / 0.02) ** power
            return curve.replaced(work=curve.work + np.where(np.arange(curve.steps) > 0, jump, 0.0))

        return call

    snap = outcome_of(monkeypatch, PULLED, tensile=astray(0))
    assert (snap["outcome"], snap["snaps"]) == ("verified", "yes")
    wrong = outcome_of(monkeypatch, PULLED, tensile=astray(1))
    assert (wrong["outcome"], wrong["snaps"]) == ("wrong", "")
    assert "work is not stored or lost" in wrong["reason"]


def test_bending_campaign(monkeypatch):
    path = np.array([0.0, 97.5, 100.0, -97.5, -100.0])
    monkeypatch.setattr(bent.stress_bending, "path", lambda: path)
    cases = [COTTON, dataclasses.replace(COTTON, number=1, diameter=0.6e-3)]
    monkeypatch.setattr(bent.stress_bending, "draw", lambda number, seed: cases[number])
    rows, times = bent.run([0, 1])
    assert all(set(row) == set(bent.COLUMNS) for row in rows)
    assert [set(row) for row in times] == [set(bent.TIMES)] * 2
    good, bad = rows
    assert (good["possible"], good["outcome"]) == ("yes", "verified")
    # Held flat, plain jersey of an elastic yarn wants to curl: the moment differs from zero.
    assert good["course_moment_flat"] < 0.0
    assert good["course_moment_hollow"] < good["course_moment_flat"] < good["course_moment_convex"]
    assert (bad["possible"], bad["outcome"]) == ("no", "refused")
    values = {row[0]: row[1] for row in bent.summary(rows)}
    assert (
        values["possible cases bent both ways in both directions and verified, per cent"] == "100"
    )
    assert values["wrong results in all cases"] == 0


# ---------------------------------------------------------------- tables and map


def test_rows_come_back_from_their_files(tmp_path):
    for name, numbers in (("a", (3, 1)), ("b", (2,))):
        lines = ["number,outcome", *(f"{n},verified" for n in numbers)]
        (tmp_path / name).write_text("\n".join(lines) + "\n")
    rows = judged.gathered([tmp_path / "a", tmp_path / "b"])
    assert [row["number"] for row in rows] == ["1", "2", "3"]


def test_map_shows_every_case(monkeypatch):
    outcomes = ("verified", "refused", "stopped", "wrong")
    rows = []
    for number in range(40):
        case = draw(number, TRIAL)
        row = {name: getattr(case, name) for name in ("number", "family", "test", "curvature")}
        for field in dataclasses.fields(Case):
            value = getattr(case.fabric, field.name)
            row[field.name] = " ".join(map(str, value)) if isinstance(value, tuple) else str(value)
        row |= {"possible": "no" if impossible(case) else "yes", "outcome": outcomes[number % 4]}
        rows.append(row)
    fig = stress_map(rows, stage.LIMITS)
    # All but inputs that no fabric has, which are only counted.
    shown = sum(len(c.get_offsets()) for c in fig.axes[0].collections)
    assert shown == sum(r["family"] != "no input" for r in rows) < len(rows)
    # Tension and bending maps share the cases between them.
    pulled, bends = (sum(len(c.get_offsets()) for c in fig.axes[k].collections) for k in (2, 3))
    assert pulled + bends == shown
    assert [ax.get_title(loc="left")[1] for ax in fig.axes] == list("abcdef")

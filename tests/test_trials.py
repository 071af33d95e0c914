"""The trials: how cases are drawn, which are possible, what becomes of them, in rows and on the map."""

import ast
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import dblquad

from knitsim.equilibrium.kernels.follow import SETTLED
from knitsim.errors import ComputationError
from knitsim.figures.stress import stress_map
from knitsim.stages import trials as stage
from knitsim.verification.judge.given import Barrier, Core
from knitsim.verification.judge.verdict import judge
from knitsim.verification.trials import law, rule, run, table, worst
from knitsim.verification.trials.law import RANGES, Asked, Case, cycle, dense
from knitsim.verification.trials.rule import impossible
from knitsim.verification.trials.table import CAMPAIGNS
from knitsim.verification.trials.told import given_of, relaxed_of, rest_of

TRIAL = 4711  # seed of the tests; the campaigns have others
ROOT = Path(__file__).parents[1]
LAW = ((0.0, 0.01, 0.07), (0.0, 0.44, 5.84))
PULLED = Asked("tension", "course", (0.05, 0.099, 0.1))
BENT = Asked("bending", "course", (0.0, 98.0, 100.0))
COTTON = Case(
    0, 1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, *LAW, Barrier(1000.0), tests=(PULLED,)
)
# The acrylic jersey of Singal et al. 2024: its yarn swells to 2.28 times its core.
ACRYLIC = Case(
    1, 2.86e-3, 2.07e-3, 11.28e-3, 1.48e-3, 4.5e-8, (0.0, 0.01, 0.02), (0.0, 100.0, 200.0),
    Core(0.65e-3, 1.2e6, 2.4), tests=(Asked("tension", "wale", (0.05, 0.1)),),
)  # fmt: skip


def drawn(name, count):
    return [CAMPAIGNS[name].draw(number, TRIAL) for number in range(count)]


# ---------------------------------------------------------------- law


def test_the_law_knows_nothing_of_the_solver():
    for module in (law, rule, worst, table):
        for node in ast.walk(ast.parse(Path(module.__file__).read_text())):
            if isinstance(node, ast.ImportFrom):
                assert node.module in ("dataclasses", "knitsim.verification.judge.given") or (
                    node.module.startswith("knitsim.verification.trials.")
                )


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_case_is_made_from_its_number_alone(name):
    draw = CAMPAIGNS[name].draw
    assert repr(draw(17, TRIAL)) == repr(draw(17, TRIAL))
    assert repr(draw(17, TRIAL)) != repr(draw(18, TRIAL)) != repr(draw(18, TRIAL + 1))
    assert repr(draw(3)) == repr(draw(3, CAMPAIGNS[name].seed))


def test_cases_fill_the_stated_ranges():
    cases = drawn("campaign", 600)
    slopes = [c.law_tension[1] / c.law_strain[1] for c in cases]
    ratio = {
        "diameter": [c.hard for c in cases],
        "loop_over_diameter": [c.loop_length / c.hard for c in cases],
        "kw": [c.loop_length / c.wale_spacing for c in cases],
        "kc": [c.loop_length / c.course_spacing for c in cases],
        "breaking_strain": [c.breaking_strain for c in cases],
        "bending": [
            16 * c.bending_rigidity / (k * c.hard**2) for c, k in zip(cases, slopes, strict=True)
        ],
        "compression": [
            c.contact.stiffness * c.diameter / k
            for c, k in zip(cases, slopes, strict=True) if not c.contact.core
        ],
        "swell": [c.diameter / c.hard for c in cases if c.contact.core],
        "exponent": [c.contact.exponent for c in cases if c.contact.core],
        "friction": [c.friction for c in cases],
        "set": [c.set_fraction for c in cases if c.set_fraction],
        "course_strain": [c.tests[0].path[-1] for c in cases],
        "wale_strain": [c.tests[1].path[-1] for c in cases],
    }  # fmt: skip
    for name, values in ratio.items():
        low, high, scale = RANGES[name]
        values = np.log(values) if scale == "log" else np.array(values)
        low, high = (np.log(low), np.log(high)) if scale == "log" else (low, high)
        slack = 1e-9 * (high - low)
        assert low - slack <= values.min() < low + 0.1 * (high - low), name
        assert high - 0.1 * (high - low) < values.max() <= high + slack, name
    # The ranges: l/d 13 to 40, three decades of bending, friction to 0.6, strains.
    assert RANGES["loop_over_diameter"][:2] == (13.0, 40.0)
    assert RANGES["bending"][1] / RANGES["bending"][0] == pytest.approx(1000.0)
    assert [RANGES[n][1] for n in ("friction", "course_strain", "wale_strain")] == [0.6, 1.0, 0.6]


def test_what_users_run_is_drawn():
    """Core law, set, hysteresis of the yarn, whole and several loops, cycles, loads across, biaxial."""
    for name, kinds in (
        ("campaign", {"core law", "set", "full cell", "several loops", "there and back"}),
        ("bending_campaign", {"core law", "set", "full cell", "hysteresis of the yarn"}),
        ("shear_campaign", {"core law", "set", "full cell", "several loops"}),
        ("stress", {"core law", "set", "full cell", "hysteresis of the yarn"}),
    ):
        cases = drawn(name, 300)
        for kind in (*kinds, "no friction"):
            assert sum(kind in c.kinds for c in cases) >= 3, (name, kind)
    tests = [t for c in drawn("campaign", 300) for t in c.tests]
    assert {t.name for t in tests} == {"course tension", "wale tension", "biaxial"}
    assert {t.cycles for t in tests} == {0, 1, 2, 3}
    assert {type(t.lateral) for t in tests} == {str, float}
    assert {t.lateral for t in tests} >= {"free", "held"}
    shears = [t for c in drawn("shear_campaign", 100) for t in c.tests]
    assert all(c.cell == "full" for c in drawn("shear_campaign", 50))
    assert min(t.tension for t in shears) == 0.0 < max(t.tension for t in shears)
    # What acts across is of the size of the forces that bend the loops at rest: B/(d l), N per loop.
    for case in drawn("campaign", 300):
        for test in case.tests:
            if isinstance(test.lateral, float):
                width = case.wale_spacing if test.direction == "course" else case.course_spacing
                force = test.lateral * width * case.hard * case.loop_length / case.bending_rigidity
                assert RANGES["load"][0] * 0.99 <= force <= RANGES["load"][1] * 1.01


def test_worst_cases_reach_what_they_are_for():
    cases = drawn("stress", 2000)
    assert {c.family for c in cases} == set(worst.FAMILIES)
    sound = [c for c in cases if c.family not in (law.NO_INPUT, "limp", "rigid")]
    rigidity, stiffness = (
        np.log10([value(c, c.law_tension[1] / c.law_strain[1]) for c in sound])
        for value in (
            lambda c, k: 16 * c.bending_rigidity / (k * c.hard**2), lambda c, k: k / c.hard**2
        )
    )  # fmt: skip
    # Six decades of rigidity, four of stiffness, friction to 1.
    assert np.ptp(rigidity) == pytest.approx(6.0, abs=0.3)
    assert np.ptp(stiffness) == pytest.approx(4.0, abs=0.3)
    assert min(c.friction for c in sound) == 0.0 and max(c.friction for c in sound) > 0.95
    assert any(c.bending_rigidity == 0.0 for c in cases)
    jumps = [c for c in cases if c.family == "jump"]
    assert all(len(c.tests[0].path) == 2 and c.tests[0].kind == "tension" for c in jumps)
    assert {c.tests[0].increment for c in jumps} == {None, 0.1, 0.5}
    assert {t.kind for c in cases for t in c.tests} == {"tension", "bending", "shear"}
    assert min(c.points for c in cases) < 24
    assert all(name in RANGES for changed in worst.FAMILIES.values() for name in changed)


def test_paths():
    path = dense(0.1, recovers=True)
    assert path[:3] == (0.0025, 0.005, 0.01)
    assert path[-3:] == (0.095, 0.0975, 0.1)
    assert np.diff(path).max() < 0.0101
    assert worst.pairs(0.1, 2) == pytest.approx([0.001, 0.049, 0.05, 0.099, 0.1])
    assert worst.pairs(0.1, 1, jump=True) == pytest.approx([0.099, 0.1])
    way = cycle(250.0, 10)
    assert way[0] == way[-1] == 0.0
    assert (way.max(), way.min()) == (250.0, -250.0)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(way)))) + 1
    assert way[turns].tolist() == [250.0, -250.0]
    # After the start and each turn comes a state 1 % of the largest on.
    assert way[[1, *(turns + 1)]].tolist() == [2.5, 247.5, -247.5]


def test_steps_between_states_become_states_on_ways_back_too():
    asked = Asked("tension", "course", (0.02, 0.04, 0.1), cycles=2)
    way = ([0.02, 0.04, 0.1, 0.04, 0.035], [1, 2, 1, 3, 4], [0.04, 0.1], [5, 1])
    curve = SimpleNamespace(
        strain=np.array(way[0] + way[2]), increments=np.array(way[1] + way[3]), steps=7
    )
    filled = run.every_step(asked, curve)
    # Once the way from 0.04 to 0.1 has taken three steps, and that from 0.035 to 0.04 five.
    between = [0.03, 0.036, 0.037, 0.038, 0.039, 0.06, 0.08]
    assert filled.path == pytest.approx(sorted([*asked.path, *between]))
    bent = replace(BENT, path=(0.0, 50.0, 0.0))
    curve = SimpleNamespace(increments=np.array([1, 2, 1]), steps=3)
    assert run.every_step(bent, curve).path == pytest.approx((0.0, 25.0, 50.0, 0.0))
    # Of 4000, every eighth is one.
    curve.increments *= 2 * run.MOST_STATES
    assert len(run.every_step(bent, curve).path) == run.MOST_STATES == 500


@pytest.mark.slow
def test_yarns_that_lock_are_followed_in_short_steps():
    """Friction of 0.95 that settles in short steps alone: to the end, settled as in shorter ones."""
    case = CAMPAIGNS["stress"].draw(70, 51251)
    relaxed, asked = relaxed_of(case), replace(case.tests[0], cycles=0)
    curve = run.solved(asked, relaxed)
    assert (curve.stop_reason, curve.steps) == ("", 3)
    finer = run.solved(replace(asked, increment=0.0025), relaxed)
    assert curve.force_per_loop == pytest.approx(finer.force_per_loop, rel=SETTLED)


def test_yarns_that_meet_within_a_step_rub():
    """Steps so long that yarns slide on to others: all rub that press at the end, as Coulomb's law has it."""
    rows, _ = run.run(CAMPAIGNS["stress"], [246], 91301)
    assert [(row["outcome"], row["reason"]) for row in rows] == [("verified", "")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("campaign", "seed", "number"),
    [
        ("shear_campaign", 91404, 10),  # work that goes astray in increments one by one adds up
        ("bending_campaign", 91603, 37),  # snaps, on the way out and on the way back
        ("stress", 91301, 352),  # pressed on to its core: the error of the contact points is told
        ("stress", 91702, 511),  # yarns first touch within a step that is halved
    ],
)
def test_cases_that_were_wrong_are_right(campaign, seed, number):
    rows, _ = run.run(CAMPAIGNS[campaign], [number], seed)
    assert {(row["outcome"], row["reason"]) for row in rows} == {("verified", "")}


# ---------------------------------------------------------------- rule


def test_fabrics_that_exist_are_possible():
    bent, sheared = (replace(COTTON, tests=(t,)) for t in (BENT, Asked("shear", "", (0.1,))))
    assert (
        impossible(COTTON) == impossible(bent) == impossible(sheared) == impossible(ACRYLIC) == ()
    )


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"bending_rigidity": 0.0}, "no bending rigidity"),
        ({"loop_length": math.nan}, "no positive number"),
        ({"contact": Barrier(0.0)}, "no positive number"),
        ({"contact": Core(0.3e-3, 1e9, 2.4)}, "core thicker"),
        ({"friction": 1.2}, "out of range"),
        ({"set_fraction": 1.2}, "out of range"),
        ({"bending_hysteresis": -1e-9}, "hysteresis"),
        ({"diameter": 1.4e-3}, "too thick"),
        ({"loop_length": 20e-3}, "too long"),
        ({"loop_length": 4.5e-3}, "too short to interlace"),
        ({"wale_spacing": 0.8e-3}, "four yarns"),
        ({"course_spacing": 0.4e-3}, "two yarns"),
        ({"contact": Barrier(5.0)}, "so soft"),
        ({"bending_rigidity": 1e-13}, "contact narrower"),
        ({"points": 20}, "control points"),
        ({"points": 50}, "control points"),
        ({"contacts": 100}, "contact points too far apart"),
        ({"tests": (replace(PULLED, path=(3.0,)),)}, "course tension: the yarn breaks"),
        (
            {"tests": (replace(PULLED, direction="wale", path=(2.0,)),)},
            "wale tension: the yarn breaks",
        ),
        (
            {"tests": (replace(PULLED, lateral="held", path=(1.7,)),)},
            "course tension: the yarn breaks",
        ),
        ({"tests": (Asked("biaxial", "", ((0.8, 0.8),)),)}, "biaxial: the yarn breaks"),
        ({"tests": (replace(BENT, path=(-1000.0,)),)}, "curvature too tight"),
    ],
)
def test_what_cannot_be_solved_is_called_impossible(changes, reason):
    assert any(reason in r for r in impossible(replace(COTTON, **changes)))


@pytest.mark.parametrize("contact", [Barrier(5e4), Core(0.1e-3, 1e12, 2.4)])
def test_squeeze_is_a_crossing_in_balance(contact):
    case, load = replace(COTTON, contact=contact), 3.0
    height, d = rule.squeezed(case, load), case.diameter

    def energy(height):
        def one(a, b):
            far = np.array(math.sqrt(a * a + b * b + height * height))
            return float(contact.at(far, d)[0]) if far < d else 0.0

        return dblquad(one, -d, d, -d, d, epsabs=0.0, epsrel=1e-6)[0]

    step = 0.002 * d
    force = (energy(height - step) - energy(height + step)) / (2 * step)
    assert force == pytest.approx(load, rel=5e-3)
    assert contact.core < height < d


# ---------------------------------------------------------------- outcomes


def rows_of(case, errors=False):
    rows = run.rows_of(case, errors, run.Clock(run.TIMES[1:]))
    assert all(set(row) | {"seed"} == set(run.COLUMNS) for row in rows)
    return [row | {"seed": TRIAL} for row in rows]


def outcome_of(case, **errors):
    return rows_of(case, **errors)[0]


def test_right_results_are_verified():
    row = outcome_of(COTTON)
    assert (row["possible"], row["outcome"], row["states"]) == ("yes", "verified", 3)
    assert row["reached"] == pytest.approx(0.1)
    both = rows_of(replace(COTTON, tests=(PULLED, BENT)), errors=True)
    assert [r["outcome"] for r in both] == ["verified"] * 2
    assert [r["test"] for r in both] == ["course tension", "course bending"]
    # Held flat, plain jersey of an elastic yarn wants to curl: the moment differs from zero.
    assert both[1]["first_load"] < 0.0
    assert 0.0 < both[0]["estimated_error"] < 0.05
    relaxed = relaxed_of(COTTON)
    assert (
        judge(given_of(COTTON, relaxed), rest_of(relaxed), run.wanted_of(None, relaxed, None)) == []
    )


def test_what_cannot_be_is_refused():
    thick = outcome_of(replace(COTTON, diameter=1.5e-3))
    assert (thick["possible"], thick["outcome"]) == ("no", "refused")
    assert thick["reason"].startswith("InputError: diameter")
    nothing = outcome_of(replace(COTTON, bending_rigidity=0.0, family=law.NO_INPUT))
    assert (nothing["possible"], nothing["outcome"]) == ("no", "refused")
    assert nothing["reason"].startswith("InputError: bending rigidity")
    # An input that no fabric has must not be taken.
    assert outcome_of(replace(COTTON, family=law.NO_INPUT))["outcome"] == "wrong"


def planted(monkeypatch, case, change, errors=False):
    """The row of a case solved by the solver, its result changed afterwards."""
    solve = run.solved
    with monkeypatch.context() as patch:
        patch.setattr(run, "solved", lambda *a, **more: change(solve(*a, **more), a[1], more))
        return outcome_of(case, errors=errors)


def test_faults_are_told_apart(monkeypatch):
    def fails(error):
        def raised(*args):
            raise error

        return raised

    stopped = planted(
        monkeypatch, COTTON, lambda curve, *_: curve.replaced(stop_reason="stopped here")
    )
    assert (stopped["outcome"], stopped["reason"]) == ("stopped", "stopped here")
    wrong = planted(
        monkeypatch,
        COTTON,
        lambda c, *_: c.replaced(force_per_loop=c.force_per_loop, forces=1.02 * c.forces),
    )
    assert wrong["outcome"] == "wrong" and "slope of the energy" in wrong["reason"]
    for error, outcome in ((ComputationError("none"), "refused"), (ZeroDivisionError(), "wrong")):
        assert planted(monkeypatch, COTTON, fails(error))["outcome"] == outcome
    rows = [
        row | {"number": number, "test": "course tension"}
        for number, row in enumerate((outcome_of(COTTON), stopped, wrong))
    ]
    values = {(r[0], r[1]): r[2] for r in stage.summary("campaign", rows)}
    assert values["seed", "all"] == str(TRIAL)
    assert values["cases", "all"] == values["possible cases", "all"] == 3
    assert values["possible cases solved and verified, per cent", "all"] == "33.33"
    assert values["possible cases that stopped before with a reason", "all"] == 1
    assert values["wrong results in all cases", "all"] == 1
    assert values["cases", "no friction"] == 3


def test_a_case_has_the_worst_outcome_of_its_tests():
    good = outcome_of(COTTON)
    rows = [good, good | {"outcome": "refused"}, good | {"number": 1, "outcome": "verified"}]
    values = {(r[0], r[1]): r[2] for r in stage.summary("campaign", rows)}
    assert values["cases", "all"] == 2
    assert values["possible cases that were refused with a reason", "all"] == 1
    assert values["possible cases solved and verified, per cent", "all"] == "50"


def test_a_load_that_does_not_stand_refinement(monkeypatch):
    """The same answer at every resolution is right; one that changes more than was said is wrong."""
    case = replace(COTTON, refined=True)
    right = outcome_of(case)
    assert right["outcome"] == "verified"
    assert 0.0 < right["refined_difference"] <= max(0.05, right["estimated_error"])

    def coarse(curve, relaxed, more):
        # Told of a fabric without friction whose error it does not know, the judge measures the rest.
        factor = 1.3 if relaxed.model.cell.points > 48 else 1.0
        return curve.replaced(force_per_loop=factor * curve.force_per_loop)

    wrong = planted(monkeypatch, case, coarse)
    assert wrong["outcome"] == "wrong"
    assert "twice the resolution" in wrong["reason"]


def test_a_snap_is_told_from_steps_that_are_too_long(monkeypatch):
    """Work that goes astray by the same amount in shorter steps was set free, else it is an error."""

    def astray(power):
        def change(curve, relaxed, more):
            jump = 0.2 * curve.work[-1] * more.get("finer", 1) ** -power
            later = np.where(np.arange(curve.steps) > 0, jump, 0.0)
            return curve.replaced(work=curve.work + later)

        return change

    snap = planted(monkeypatch, COTTON, astray(0))
    assert (snap["outcome"], snap["snaps"]) == ("verified", "yes")
    wrong = planted(monkeypatch, COTTON, astray(1))
    assert (wrong["outcome"], wrong["snaps"]) == ("wrong", "")
    assert "work is not stored or lost" in wrong["reason"]


# ---------------------------------------------------------------- stage, tables and map


def test_parts_are_all_the_cases(monkeypatch):
    cotton = SimpleNamespace(draw=lambda number, seed: replace(COTTON, number=number))
    monkeypatch.setitem(CAMPAIGNS, "campaign", replace(CAMPAIGNS["campaign"], law=cotton, cases=5))
    parts = [stage.part_of("campaign", part, 2) for part in (0, 1)]
    assert [[row["number"] for row in times] for _, times in parts] == [[0, 2, 4], [1, 3]]
    assert {row["seed"] for row in parts[0][0]} == {CAMPAIGNS["campaign"].seed}
    rows, times = stage.part_of("campaign", 1, 2, TRIAL, 2)
    assert [row["number"] for row in times] == [1]
    assert {row["seed"] for row in rows} == {TRIAL}
    assert rows == stage.part_of("campaign", 1, 2, TRIAL, 2)[0]
    assert set(times[0]) == set(stage.TIMES) == set(run.TIMES)
    assert set(rows[0]) == set(stage.COLUMNS)


def test_the_workflow_has_a_rule_for_every_campaign():
    text = (ROOT / "workflow/rules/campaign.smk").read_text()
    listed = re.search(r"PARTS_OF = \{(.*?)\}", text, re.DOTALL)[1]
    assert set(re.findall(r'"(\w+)":', listed)) == set(CAMPAIGNS)


def test_rows_come_back_from_their_files(tmp_path):
    for name, numbers in (("a", (3, 1)), ("b", (2,))):
        lines = ["number,outcome", *(f"{n},verified" for n in numbers)]
        (tmp_path / name).write_text("\n".join(lines) + "\n")
    rows = stage.gathered([tmp_path / "a", tmp_path / "b"])
    assert [row["number"] for row in rows] == ["1", "2", "3"]


def test_map_shows_every_case():
    outcomes, rows = ("verified", "refused", "stopped", "wrong"), []
    for number, case in enumerate(drawn("stress", 40)):
        given = run.inputs_of(case)
        row = given | {"test": case.tests[0].name, "kind": case.tests[0].kind}
        row |= {"largest": str(np.abs(case.tests[0].path).max()), "outcome": outcomes[number % 4]}
        rows.append({name: str(value) for name, value in row.items()})
    fig = stress_map(rows, stage.LIMITS)
    # All but inputs that no fabric has, which are only counted.
    barrier, shown = (sum(len(c.get_offsets()) for c in fig.axes[k].collections) for k in (0, 1))
    assert shown == sum(r["family"] != law.NO_INPUT for r in rows) < len(rows)
    assert barrier == shown - sum(r["core"] != "" for r in rows if r["family"] != law.NO_INPUT)
    # Tension and bending maps share the cases that are not sheared between them.
    pulled, bends = (sum(len(c.get_offsets()) for c in fig.axes[k].collections) for k in (2, 3))
    assert pulled + bends == sum(r["family"] != law.NO_INPUT and r["kind"] != "shear" for r in rows)
    assert [ax.get_title(loc="left")[1] for ax in fig.axes] == list("abcdef")

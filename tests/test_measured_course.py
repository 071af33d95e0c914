"""What happens in a measured test, what is done to its numbers, and what cannot be true of them."""

import numpy as np
import pytest

from knitsim import kes
from knitsim.errors import InputError
from knitsim.measured.course import slack_of, turns
from knitsim.measured.read import read_measured
from knitsim.measured.test import LOADING, RECOVERY, MeasuredTest, mean_of, shares
from knitsim.units import G0
from knitsim.yarn.calibration import calibrate_test

STRAIN = np.array([0.0, 0.01, 0.03, 0.06, 0.10, 0.15])
FORCE = np.array([0.0, 4.0, 10.0, 30.0, 70.0, 150.0])  # N/m
BACK = np.array([0.11, 0.08, 0.05]), np.array([60.0, 20.0, 0.0])
HEADER = "strain,force_per_width_N_per_m"


@pytest.fixture
def write(tmp_path):
    def write(header, *columns, comments=(), name="curve.csv"):
        rows = [f"# {comment}" for comment in comments] + [header]
        rows += [",".join(f"{v:.12g}" for v in row) for row in zip(*columns, strict=True)]
        path = tmp_path / name
        path.write_text("\n".join(rows) + "\n")
        return path

    return write


def wale(path, **stated):
    return read_measured(path, "tension", "wale", **stated)


def fine(n=121, top=0.6):
    """A smooth fabric curve of n points: strain, force per width (N/m)."""
    strain = np.linspace(0.0, top, n)
    return strain, 50.0 * strain + 389.0 * (strain / 0.6) ** 4


# ---- loading, recovery, what a caller states ----


def test_recovery_lateral_strain_and_band_are_read(write):
    strain, force = np.append(STRAIN, BACK[0]), np.append(FORCE, BACK[1])
    header = HEADER + ",lateral_strain_percent,strain_low,strain_high"
    path = write(header, strain, force, -40 * strain, strain - 0.01, strain + 0.02)
    found = read_measured(path, direction="course")
    assert list(found.phase) == [LOADING] * 6 + [RECOVERY] * 3
    assert found["lateral_strain"] == pytest.approx(-0.4 * strain)
    low, high = found.band
    assert low == pytest.approx(strain - 0.01) and high == pytest.approx(strain + 0.02)
    assert found.left_out == () and not found["strain"].flags.writeable


def test_the_machine_is_subtracted_from_the_extension(write):
    # 100 mm of a specimen 40 mm wide on a machine that gives 0.02 mm per newton.
    gauge, width, compliance = 0.1, 0.04, 2e-5
    extension = gauge * STRAIN + compliance * FORCE * width
    columns = 1e3 * extension, FORCE * width
    comments = ["gauge_length_mm: 100", "width_mm: 40", "machine_compliance_mm_per_N: 0.02"]
    found = wale(write("extension_mm,force_N", *columns, comments=comments))
    assert found["strain"] == pytest.approx(STRAIN)
    share = compliance * 150.0 * width / extension[-1]
    assert f"{100 * share:.2g} %" in found.corrections[0]
    plain = write("extension_mm,force_N", *columns)
    stated = wale(plain, gauge_length=gauge, width=width, machine_compliance=compliance)
    assert stated["strain"] == pytest.approx(STRAIN)
    by_key = wale(plain, gauge_length_mm=100, width_cm=4, machine_compliance_mm_per_N=0.02)
    assert by_key["strain"] == pytest.approx(STRAIN)


def test_strain_counts_from_the_pretension(write):
    path = write(
        HEADER + ",lateral_strain", STRAIN, FORCE, -0.5 * STRAIN, comments=["pretension_N_per_m: 7"]
    )
    found = wale(path)
    # 7 N/m lies half way between the points at 1 and 3 %.
    assert found["strain"] == pytest.approx((1.0 + STRAIN[2:]) / 1.02 - 1.0)
    assert found["lateral_strain"] == pytest.approx((1.0 - 0.5 * STRAIN[2:]) / 0.99 - 1.0)
    assert found["force_per_width"] == pytest.approx(FORCE[2:])
    assert found.pretension == 7.0
    assert "2 %" in found.corrections[0]
    assert found.left_out == ((3, 4, "below the pretension"),)
    # What the caller states comes first; a file that starts above it has its zero there.
    above = wale(write(HEADER, STRAIN, FORCE + 3.0), pretension=3.0)
    assert above["strain"] == pytest.approx(STRAIN[1:])
    assert above.corrections[0].endswith("0 % of strain in the file")


def test_a_pretension_in_newtons_is_one_over_the_width(write):
    path = write(
        "strain,force_N", STRAIN, 0.05 * FORCE, comments=["width_mm: 50", "Vorkraft: 0.35 N"]
    )
    assert wale(path).pretension == pytest.approx(7.0)


def test_the_recovery_below_the_pretension_is_left_out(write):
    strain, force = np.append(STRAIN, BACK[0]), np.append(FORCE, BACK[1])
    found = wale(write(HEADER, strain, force), pretension=15.0)
    assert list(found["force_per_width"]) == [30.0, 70.0, 150.0, 60.0, 20.0]
    assert list(found.phase) == [LOADING] * 3 + [RECOVERY] * 2


# ---- noise, holds, cycles, break ----


def test_noise_is_no_disorder(write):
    noisy = FORCE + np.array([0.0, 0.0, -2.0, 3.0, -3.0, 0.0])
    strain = STRAIN + np.array([-0.001, 0.0, 0.002, -0.002, 0.0, 0.0])
    assert wale(write(HEADER, strain, noisy))["force_per_width"] == pytest.approx(noisy)


@pytest.mark.parametrize("noise", [0.001, 0.004])
@pytest.mark.parametrize("kind", ["tension", "yarn_tension"])
def test_one_rule_takes_noise_of_yarns_and_fabrics(write, kind, noise):
    rng = np.random.default_rng(4)
    strain = np.linspace(0.0, 0.07, 351)
    moved = strain + noise * 0.07 * rng.normal(size=strain.size)
    moved[[0, 200]] = -2e-6, moved[199] - 0.02 * 0.07
    force = np.interp(strain, [0, 0.02, 0.07], [0, 0.8, 5.5])
    header = "strain,force_N" if kind == "yarn_tension" else "strain,force_per_width_N_per_mm"
    found = read_measured(write(header, moved, force), kind, "wale" if kind == "tension" else "")
    assert len(found) == 351 and found.corrections == ()
    if kind == "yarn_tension":
        # A calibration takes strains that do not fall, each with its own force.
        order = np.argsort(moved, kind="stable")
        assert found["strain"] == pytest.approx(moved[order]) and found["force"] == pytest.approx(
            force[order]
        )
        exact = read_measured(write(header, strain, force), kind)
        one, other = (
            calibrate_test(test, "two_slope").estimates["k_high"] for test in (found, exact)
        )
        assert one.value == pytest.approx(other.value, rel=5.0 * noise + 1e-6)


@pytest.mark.parametrize("rows", [4, 20, 200])
def test_a_hold_at_the_top_is_left_out(write, rows):
    strain, force = np.append(STRAIN, BACK[0]), np.append(FORCE, BACK[1])
    relaxed = 150.0 - 12.0 * (1.0 - np.exp(-np.arange(1, rows + 1) / 5.0))
    held = write(HEADER, np.insert(strain, 6, np.full(rows, 0.15)), np.insert(force, 6, relaxed))
    found = wale(held)
    assert found["strain"] == pytest.approx(strain) and found["force_per_width"] == pytest.approx(
        force
    )
    assert found.left_out == ((8, 7 + rows, "a hold, at which x stands still"),)


def test_a_hold_is_told_from_slow_steps_by_the_time_it_takes(write):
    strain, force = fine(2001)
    rng = np.random.default_rng(2)
    before = np.full(150, 0.0), rng.normal(0, 0.1, 150)
    top = np.full(600, 0.6), force[-1] - 40.0 * (1.0 - np.exp(-np.arange(600) / 100.0))
    columns = [np.concatenate(parts) for parts in zip(before, (strain, force), top, strict=True)]
    found = wale(write(HEADER, *columns))
    assert len(found) == pytest.approx(2001, abs=4)
    assert found["strain"].max() == 0.6 and not np.isin(RECOVERY, found.phase)
    # The same steps all along are no hold, however many rows there are.
    assert len(wale(write(HEADER, strain, force))) == 2001


def test_points_weigh_by_their_share_of_the_curve():
    strain, force = fine(13)
    length = strain / strain[-1] + force / force[-1]
    share = np.gradient(length)
    share[[0, -1]] *= 0.5
    assert shares(strain, force, np.zeros(13)) == pytest.approx(share * 13 / share.sum())
    # Rows that repeat, and rows of noise below what was reached, add nothing.
    twice = shares(np.repeat(strain, 2), np.repeat(force, 2), np.zeros(26))
    assert twice.reshape(13, 2).sum(axis=1) == pytest.approx(2 * share * 13 / share.sum())
    still = shares(
        np.append(strain, [0.6] * 9), np.append(force, np.linspace(430, 400, 9)), np.zeros(22)
    )
    assert (still[14:] == 0.0).all()


@pytest.mark.parametrize("n", [2000, 40000])
def test_a_long_curve_is_fitted_by_the_means_of_its_pieces(n):
    strain, force = fine(n)
    one = MeasuredTest(
        "tension", {"strain": strain, "force_per_width": force}, direction="wale"
    ).to_fit()
    # The end stands by itself.
    assert len(one) == 201 and one["strain"][-1] == strain[-1]
    assert one.weight.sum() == pytest.approx(201.0)
    # A mean lies on the chord of its piece: by less than 1e-4 of the range above a curve.
    exact = np.interp(one["strain"], strain, force)
    assert np.abs(one["force_per_width"] - exact).max() < 1e-4 * force.max()


def test_cycles_are_found_and_the_first_or_the_asked_one_is_taken(write):
    strain, force = np.append(STRAIN, BACK[0]), np.append(FORCE, BACK[1])
    # The second begins where the first has left the fabric, 5 % longer, and meets it at the top.
    again = 0.05 + (0.15 - 0.05) / 0.15 * strain
    columns = np.append(strain, again[1:]), np.append(force, force[1:])
    found = wale(write(HEADER, *columns))
    assert (found.cycle, [one.cycle for one in found.cycles]) == (1, [1, 2])
    assert found["strain"] == pytest.approx(strain)
    assert found.left_out == ((11, 18, "cycle 2"),)
    second = wale(write(HEADER, *columns), cycle=2)
    assert second["strain"] == pytest.approx((1.0 + again) / 1.05 - 1.0)
    assert "cycle 2: strain counted from where it begins, 5 % in the file" in second.corrections
    with pytest.raises(InputError, match="cycle = 3: must be at most 2, the cycles of the file"):
        wale(write(HEADER, *columns), cycle=3)


@pytest.mark.parametrize("between", [HEADER + "\n", "", "Cycle 2\n" + HEADER + "\n"])
def test_cycles_of_loading_alone(tmp_path, between):
    rows = "".join(f"{e},{f}\n" for e, f in zip(STRAIN, FORCE, strict=True))
    path = tmp_path / "cycles.csv"
    path.write_text(f"{HEADER}\n{rows}{between}{rows.replace('150.0', '140.0')}")
    found = wale(path)
    assert [one["force_per_width"][-1] for one in found.cycles] == [150.0, 140.0]
    assert found["strain"] == pytest.approx(STRAIN)


def test_a_column_of_cycles_splits_the_test(write):
    strain, force = np.append(STRAIN, BACK[0]), np.append(FORCE, BACK[1])
    columns = np.repeat([1, 2], 9), np.tile(strain, 2), np.tile(force, 2)
    found = wale(write("Cycle count," + HEADER, *columns))
    assert len(found.cycles) == 2 and "2 cycles by the column 'Cycle count'" in found.recognised


def test_a_test_to_rupture_ends_at_the_break_and_slack_is_taken_off(write):
    rng = np.random.default_rng(5)
    slack, (strain, force) = 0.09, fine(40, 0.9)
    hanging = np.linspace(0.0, slack, 12)[:-1]
    x = np.concatenate([hanging, (1.0 + slack) * (1.0 + strain) - 1.0, 1.09 + 0.01 * np.arange(9)])
    y = np.concatenate([rng.normal(0.0, 0.15, 11), force, 90.0 + rng.normal(0.0, 8.0, 9)])
    found = wale(write(HEADER, x, y))
    assert found["force_per_width"].max() == pytest.approx(force[-1])
    assert found["strain"][-1] == pytest.approx(0.9, abs=5e-3)
    assert found.broke_below == pytest.approx((1.0 + 1.09) / 1.09 - 1.0, abs=5e-3)
    assert [why for *_, why in found.left_out] == ["slack", "after the break"]
    assert found.left_out[-1] == (53, 61, "after the break")
    kept = wale(write(HEADER, x, y), slack="keep")
    assert kept["strain"] == pytest.approx(x[:51]) and kept.corrections == ()
    start = wale(write(HEADER, x[12:], y[12:]), slack="start", zero="keep")
    assert start["strain"][0] == 0.0


@pytest.mark.parametrize("power", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_a_soft_beginning_is_no_slack(power, noise):
    rng = np.random.default_rng(7)
    strain = np.linspace(0.0, 0.6, 200)
    force = 400.0 * (strain / 0.6) ** power + 400.0 * noise * rng.normal(size=200)
    assert slack_of(strain, force, np.arange(200)) == 0.0
    # Written to whole newtons per metre.
    assert slack_of(strain, np.round(force), np.arange(200)) == 0.0


@pytest.mark.parametrize("power", [1.0, 1.5])
def test_slack_is_found_where_a_fabric_hangs(power):
    rng = np.random.default_rng(8)
    strain = np.linspace(0.0, 0.6, 200)
    force = 400.0 * np.maximum(strain - 0.1, 0.0) ** power + rng.normal(0.0, 0.3, 200)
    # Two deviations of the noise are passed 0.0015 beyond, with the power 1.5 by 0.013.
    limit = 2.0 * (0.6 / 400.0) ** (1.0 / power) + 0.003
    assert slack_of(strain, force, np.arange(200)) == pytest.approx(0.1, abs=limit)


# ---- zero of the load cell ----


@pytest.mark.parametrize(
    ("offset", "right"), [(0.016, "pretension_N_per_mm: 0.016"), (-0.012, "must not be negative")]
)
def test_a_force_at_no_strain_is_asked_about_and_taken_off_on_request(write, offset, right):
    strain, force = fine(25)
    path = write(HEADER, strain, force + 1e3 * offset)
    with pytest.raises(InputError, match=f"force at no strain = {offset:g} N/mm.*{right}"):
        wale(path)
    taken = wale(path, zero="start")
    assert taken["force_per_width"] == pytest.approx(force, abs=1e-9)
    assert taken.corrections == (
        f"zero of the load cell taken off: {offset:g} N/mm, read before the test",
    )
    assert wale(path, zero="keep")["force_per_width"] == pytest.approx(force + 1e3 * offset)
    if offset < 0:
        # A pretension explains no negative force.
        with pytest.raises(InputError, match="must not be negative"):
            wale(path, pretension=16.0)
    else:
        pulled = wale(path, pretension=1e3 * offset)
        assert pulled.pretension == 16.0 and pulled["force_per_width"][0] > 16.0


@pytest.mark.parametrize("offset", [0.0, 16.0, -8.0])
def test_the_force_at_no_strain_is_extrapolated_where_a_file_begins_later(write, offset):
    # As digitised by Singal et al. (2024), doi 10.1038/s41467-024-46498-z: the acrylic along the wale.
    strain = [
        0.0352,
        0.0513,
        0.0657,
        0.0809,
        0.1035,
        0.1236,
        0.1393,
        0.1626,
        0.1865,
        0.2082,
        0.2216,
        0.2336,
    ]
    force = [20.6, 32.4, 41.0, 54.4, 75.4, 93.1, 114.4, 144.4, 183.3, 226.2, 258.3, 295.0]
    path = write(HEADER, strain, np.array(force) + offset)
    if not offset:
        assert wale(path).corrections == ()
        return
    with pytest.raises(
        InputError, match=r"read off the first points: .* zero: start .*, zero: keep"
    ):
        wale(path)
    assert wale(path, zero="start")["force_per_width"] == pytest.approx(force, abs=4.0)


@pytest.mark.parametrize("offset", [0.0, -0.2, 0.3])
def test_the_tail_after_a_break_shows_the_zero(write, offset):
    strain = np.linspace(0.0, 0.07, 100)
    force = np.interp(strain, [0, 0.02, 0.07], [0, 0.8, 5.5])
    tail = 0.07 + 0.0003 * np.arange(1, 31)
    swing = 0.1 * np.exp(-np.arange(30) / 3.0) * np.cos(np.arange(30))
    path = write("strain,force_N", np.append(strain, tail), np.append(force, swing) + offset)
    found = read_measured(path, "yarn_tension")
    assert found["force"] == pytest.approx(force, abs=1e-3)
    assert found.broke_below == pytest.approx(0.0703)
    assert found.left_out == ((102, 131, "after the break"),)
    assert len(found.corrections) == (offset != 0.0)
    law = calibrate_test(found, "two_slope")
    assert law.break_seen and law.points_cut == 30
    assert law.breaking_strain == pytest.approx(0.07, abs=2e-5)
    assert law.estimates["k_high"].value == pytest.approx(94.0, rel=1e-3)
    with pytest.raises(InputError, match="zero = tail: there is no steady force after a break"):
        read_measured(write("strain,force_N", strain, force), "yarn_tension", zero="tail")


def test_a_tail_that_still_carries_is_no_zero(write):
    strain, force = fine(40)
    x, y = np.append(strain, 0.6 + 0.01 * np.arange(1, 11)), np.append(force, np.full(10, 30.0))
    found = wale(write(HEADER, x, y))
    assert found["force_per_width"] == pytest.approx(force) and found.corrections == ()
    assert found.broke_below == pytest.approx(0.61)


def test_a_start_above_the_tail_is_a_pretension(write):
    strain, force = fine(40)
    x, y = (
        np.append(strain, 0.6 + 0.01 * np.arange(1, 11)),
        np.append(force + 9.0, np.full(10, 0.0)),
    )
    found = wale(write(HEADER, x, y))
    assert found.pretension == pytest.approx(9.0, rel=0.01)
    assert (found["force_per_width"] > found.pretension).all()


# ---- bending ----

UP = np.linspace(0.0, 2.5, 11)
LOOP = np.concatenate([UP, UP[-2::-1], -UP[1:], -UP[-2::-1]])
WAY = np.concatenate([np.ones(11), -np.ones(20), np.ones(10)])
BENT = "curvature_per_cm,moment_per_width_gf_cm_per_cm"


def bent(write, curvature, moment, **stated):
    return read_measured(write(BENT, curvature, moment), direction="course", **stated)


def test_cycles_of_a_bending_test_are_told_apart(write):
    moment = 0.05 * LOOP + 0.01 * WAY
    both = np.append(LOOP, LOOP[1:]), np.append(moment, 0.9 * moment[1:])
    first, second = bent(write, *both), bent(write, *both, cycle=2)
    assert (first.cycle, second.cycle, len(first.cycles)) == (1, 2, 2)
    assert first["curvature"] == pytest.approx(100.0 * LOOP)
    assert second["moment_per_width"][1:] == pytest.approx(0.9e-3 * G0 * moment[1:])
    # A file of one cycle holds that which is stated.
    assert bent(write, LOOP, moment, cycle=2).cycle == 2
    one_side = np.concatenate([UP, UP[-2::-1]])
    assert len(bent(write, one_side, 0.05 * one_side).cycles) == 0
    assert len(bent(write, np.tile(one_side, 2), 0.05 * np.tile(one_side, 2)).cycles) == 2


def test_an_offset_of_the_moment_is_said_and_taken_off_on_request(write):
    moment = 0.05 * LOOP + 0.01 * WAY
    plain = bent(write, LOOP, moment)
    assert not any("curl" in line for line in plain.recognised)
    shifted = bent(write, LOOP, moment + 0.04)
    assert any("moment of the flat fabric 0.3923 mN" in line and "curl, or an offset" in line
               for line in shifted.recognised)  # fmt: skip
    assert shifted["moment_per_width"] == pytest.approx(1e-3 * G0 * (moment + 0.04))
    assert bent(write, LOOP, moment + 0.04, zero="start")["moment_per_width"] == pytest.approx(
        plain["moment_per_width"]
    )
    # B and 2HB, of slopes and widths, do not depend on it.
    one, other = (kes.bending(t["curvature"], t["moment_per_width"]) for t in (plain, shifted))
    for name in ("B", "2HB"):
        assert one[name].value == pytest.approx(other[name].value, rel=1e-6)


# ---- what cannot be true ----

FABRIC = {"direction": "wale", "kind": "tension"}
YARN = {"kind": "yarn_tension", "linear_density_tex": 30}
PULL = np.linspace(0.0, 0.07, 20), np.linspace(0.0, 4.0, 20)
IMPOSSIBLE = {
    "per cent called strain": (
        HEADER, 100 * STRAIN, FORCE, FABRIC,
        "more than 500 %|more than 200 %",
    ),
    "400 per cent called strain": (
        HEADER, 27 * STRAIN, FORCE, FABRIC,
        r"is it in per cent\? then state unit: \{strain: percent\}",
    ),
    "fraction called per cent": (
        "strain_percent,force_per_width_N_per_m", STRAIN / 10, FORCE, FABRIC,
        r"is it a fraction\? then state unit",
    ),
    "a fraction of a fraction": (
        HEADER, STRAIN / 200, FORCE, FABRIC,
        "no fabric test is that small",
    ),
    "force of another unit": (
        HEADER, STRAIN, 1e5 * FORCE, FABRIC,
        "is the unit in the header right",
    ),
    "force that is none": (HEADER, STRAIN, 0 * FORCE, FABRIC, "must rise above 0"),
    "hardly a force": (HEADER, STRAIN, 1e-3 * FORCE, FABRIC, "must be from 0.5 to 30000 N/m"),
    "shorter than half": (
        HEADER, np.append(-0.6, STRAIN[1:]), FORCE, FABRIC,
        r"curve\.csv:2: strain = -0\.6: must be above -0\.5",
    ),
    "a yarn's per cent called strain": (
        "strain,force_N", 100 * PULL[0], PULL[1], YARN,
        "no yarn is strained by more than",
    ),
    "a yarn's fraction called per cent": (
        "strain_percent,force_N", PULL[0], PULL[1], YARN,
        "is it a fraction",
    ),
    "cN called N": (
        "strain,force_N", PULL[0], 100 * PULL[1], YARN,
        "400 N, 1333 cN/tex at most: must be from 0.05 to 500 cN/tex",
    ),
    "kN called N": (
        "strain,force_N", PULL[0], 1e-3 * PULL[1], YARN,
        "is the unit of the force right",
    ),
    "too stiff for any fibre": (
        "strain,force_N", PULL[0] / 40, 5 * PULL[1], YARN,
        "no fibre is stiffer",
    ),
    "moment of another unit": (
        BENT, LOOP, 5e3 * LOOP, {"direction": "wale"},
        "is the unit in the header right",
    ),
    "moments far beyond the yarns": (
        BENT, LOOP, 5.0 * LOOP, {"direction": "wale", "rigidity": 5e-6},
        "98.1 times that of its yarns side by side",
    ),
    "curvature of another unit": (
        BENT, 1e3 * LOOP, LOOP, {"direction": "wale"},
        "at most 100 per cm",
    ),
    "hardly bent": (BENT, 1e-3 * LOOP, LOOP, {"direction": "wale"}, "0.01 per cm or more"),
    "never flat": (BENT, 1.0 + UP, UP, {"direction": "wale"}, "must pass the flat fabric"),
    "a moment that falls": (
        BENT, LOOP, -LOOP, {"direction": "wale"},
        "must rise with the curvature",
    ),
    "not sorted": (
        HEADER, STRAIN[[0, 1, 4, 2, 3, 5]], FORCE[[0, 1, 4, 2, 3, 5]], FABRIC,
        "points of loading|strain falls on loading",
    ),
    "recovery first": (HEADER, STRAIN[::-1], FORCE[::-1], FABRIC, "loading comes first"),
    "force that falls": (
        HEADER, STRAIN, [0.0, 4.0, 60.0, 30.0, 70.0, 150.0], FABRIC,
        r"curve\.csv:5: force_per_width_N_per_m = 30: force falls on loading",
    ),
    "force that rises on recovery": (
        HEADER, np.append(STRAIN, BACK[0]), np.append(FORCE, [60.0, 80.0, 0.0]), FABRIC,
        "force rises on recovery",
    ),
    "a band without the strain": (
        HEADER + ",strain_low,strain_high", STRAIN, FORCE, FABRIC,
        r"curve\.csv:2: strain_low",
    ),
    "compliance without width": (
        HEADER, STRAIN, FORCE, FABRIC | {"machine_compliance": 1e-5, "gauge_length": 0.1},
        "width_mm",
    ),
    "compliance beyond the extension": (
        HEADER, STRAIN, FORCE, FABRIC | {"machine_compliance": 1e-2, "gauge_length": 0.1, "width": 0.05},
        "nothing is left",
    ),
    "pretension above all forces": (
        HEADER, STRAIN, FORCE, FABRIC | {"pretension": 200.0},
        "below the largest force",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", IMPOSSIBLE)
def test_what_cannot_be_true_is_refused_with_the_likely_slip(write, fault):
    header, x, y, stated, right = IMPOSSIBLE[fault]
    columns = (x, y) if header.count(",") == 1 else (x, y, x + 0.01, x + 0.02)
    with pytest.raises(InputError, match=right) as refused:
        read_measured(write(header, *columns), **stated)
    assert "curve.csv" in str(refused.value) and "\n" not in str(refused.value)


def test_a_unit_that_is_stated_settles_what_is_likely(write):
    per_cent = write("strain,force_N", 100 * PULL[0], PULL[1])
    assert read_measured(per_cent, unit={"strain": "percent"}, **YARN)["strain"][
        -1
    ] == pytest.approx(0.07)
    wide = write(HEADER, 27 * STRAIN, FORCE)
    assert wale(wide, unit={"strain": "1"})["strain"][-1] == pytest.approx(4.05)
    small = write("strain_percent,force_per_width_N_per_m", 10 * STRAIN, FORCE)
    assert wale(small, unit={"strain": "%"})["strain"][-1] == pytest.approx(0.015)
    strong = write("strain,force_N", PULL[0], 100 * PULL[1])
    assert read_measured(strong, unit={"force": "cN"}, **YARN)["force"][-1] == pytest.approx(4.0)
    assert read_measured(strong, unit={"force_N": "N"}, **YARN)["force"][-1] == pytest.approx(400.0)


# ---- KES, turns, the type ----


def test_kes_parameters_come_out_of_a_measured_test(write):
    part = np.arange(21) / 20
    up, down = 40 * part, 40 * part[::-1]
    force = np.append(50 * part**3, 50 * (part[::-1][1:] ** 4))
    path = write("strain_percent,force_per_width_gf_per_cm", np.append(up, down[1:]), force)
    test = read_measured(path, direction="wale")
    found = kes.tension(test["strain"], test["force_per_width"], max_force=kes.KNIT_FORCE)
    # Of x^3 up and x^4 down: LT = 2/4, RT = (1/5)/(1/4).
    assert found["EMT"].kes_value == pytest.approx(40.0)
    assert found["LT"].value == pytest.approx(0.5, rel=1e-6)
    assert found["RT"].kes_value == pytest.approx(80.0, rel=1e-3)


def test_a_pass_ends_where_a_test_goes_back_by_a_part_of_its_range():
    x = np.array([0.0, 1.0, 0.97, 2.0, 1.0, 1.01, 0.0, 0.5])
    assert turns(x) == [3, 6, 7]
    assert turns(x, 0.004) == [1, 2, 3, 4, 5, 6, 7]


def test_a_test_is_told_in_one_line(write):
    strain, force = np.append(STRAIN, BACK[0]), np.append(FORCE, BACK[1])
    one = wale(write(HEADER, strain, force), name="wale 3")
    assert (
        repr(one)
        == "<MeasuredTest wale 3: tension along the wale, 9 points to 15 %, 0.15 N/mm, with recovery>"
    )
    assert "2 specimens" in repr(mean_of([one, one], "both", ""))
    frame = one.to_dataframe()
    assert list(frame.columns) == ["strain", "force_per_width", "phase"]
    assert list(frame.phase[5:7]) == ["loading", "recovery"]


@pytest.mark.parametrize(
    ("change", "right"),
    [
        ({"kind": "shear"}, "must be tension or bending"),
        ({"kind": "bending"}, "curvature: is missing"),
        ({"direction": "bias"}, "must be course or wale"),
        ({"cycle": 0}, "must be 1 or more"),
        ({"values": {"strain": [0.1, 0.2], "force_per_width": [1.0]}}, "must be 2 numbers"),
        ({"values": {"strain": ["a"], "force_per_width": [1.0]}}, "must be numbers"),
    ],
)
def test_a_test_that_makes_no_sense_is_refused(change, right):
    good = {
        "kind": "tension",
        "values": {"strain": [0.1], "force_per_width": [1.0]},
        "direction": "wale",
    }
    with pytest.raises(InputError, match=right):
        MeasuredTest(**(good | change))

"""KES parameters of any curve: closed forms, polygons by hand, other routes to the same number."""

import math

import numpy as np
import pytest
from oracles import exact
from scipy.integrate import quad

from knitsim import kes
from knitsim.errors import ComputationError, InputError
from knitsim.kes.single_pass import Pass
from knitsim.measured.read import read_measured

GF = 9.80665e-3  # N
FORCE = 500 * GF / 1e-2  # N/m


def there_and_back(up, down):
    """One array of a test that passes its turning point once."""
    return np.concatenate([up, down[1:]])


def cycle_of(largest, steps=50):
    """0 to +largest, to -largest, to 0, and +1 or -1 with the direction."""
    up = np.linspace(0.0, largest, steps + 1)
    x = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1]])
    way = np.ones(x.size)
    way[steps + 1 : 3 * steps + 1] = -1
    return x, way


# ---- tension ----


@pytest.mark.parametrize("points", [11, 40, 301])
@pytest.mark.parametrize("residual", [0.0, 0.02])
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 3), (0.5, 0.7), (1.37, 2.9), (3, 7.5), (6.2, 8)])
def test_power_curves_give_the_closed_forms(n, m, residual, points):
    extension = 0.13
    up = extension * np.linspace(0, 1, points)
    part = np.linspace(1, 0, points)
    strain = there_and_back(up, residual + (extension - residual) * part)
    force = FORCE * there_and_back(np.linspace(0, 1, points) ** n, part**m)
    found = kes.tension(strain, force)
    work = FORCE * extension / (n + 1)
    back = FORCE * (extension - residual) / (m + 1)
    wanted = {
        "LT": 2 / (n + 1), "WT": work, "RT": back / work, "EMT": extension,
        "WT_recovered": back,
    }  # fmt: skip
    for name, value in wanted.items():
        assert found[name].value == pytest.approx(value, rel=1e-9), name
    assert found["residual_strain"].value == pytest.approx(residual, abs=1e-12)
    if residual == 0:
        assert found["RT"].kes_value == pytest.approx(100 * (n + 1) / (m + 1), rel=1e-9)
    ideal = exact.kes_power_curve(FORCE / extension**n, n, m, FORCE, residual)
    assert found["LT"].value == pytest.approx(ideal.linearity, rel=1e-9)
    assert found["RT"].value == pytest.approx(ideal.resilience, rel=1e-9)


def test_power_curve_with_uneven_points_that_pass_the_largest_force_between_two():
    rng = np.random.default_rng(3)
    strain = np.concatenate([[0.0], np.sort(rng.uniform(0.001, 0.2, 60))])
    found = kes.tension(strain, FORCE * (strain / 0.11) ** 2.3)
    assert 0.11 not in strain
    assert found["EMT"].value == pytest.approx(0.11, rel=1e-11)
    assert found["LT"].value == pytest.approx(2 / 3.3, rel=1e-9)
    assert "no recovery" in found.left_out["RT"]


@pytest.mark.parametrize(("n", "m"), [(0.37, 2.7), (1.5, 4.25)])
def test_functions_give_the_closed_forms(n, m):
    up = kes.FunctionPass(lambda e: FORCE * (e / 0.2) ** n, 0.0, 0.2)
    down = kes.FunctionPass(lambda e: FORCE * ((e - 0.03) / 0.17) ** m, 0.2, 0.03)
    found = kes.tension_of(up, down)
    assert found["LT"].value == pytest.approx(2 / (n + 1), rel=1e-11)
    assert found["WT_recovered"].value == pytest.approx(FORCE * 0.17 / (m + 1), rel=1e-11)
    assert found["RT"].error < 1e-9


def test_polygon_by_hand():
    # gf/cm: up 0, 10, 50 at 0, 0.2, 0.3; down 50, 20, 0 at 0.3, 0.25, 0.1.
    strain = np.array([0, 0.2, 0.3, 0.25, 0.1])
    force = np.array([0, 10, 50, 20, 0]) * GF / 1e-2
    found = kes.tension(strain, force, max_force=kes.KNIT_FORCE, rule="linear")
    up = 0.5 * 10 * 0.2 + 30 * 0.1
    down = 35 * 0.05 + 0.5 * 20 * 0.15
    assert found["WT"].kes_value == pytest.approx(up, rel=1e-13)
    assert found["WT"].value == pytest.approx(up * GF / 1e-2, rel=1e-13)
    assert found["LT"].value == pytest.approx(up / (0.5 * 50 * 0.3), rel=1e-13)
    assert found["RT"].kes_value == pytest.approx(100 * down / up, rel=1e-13)
    assert found["residual_strain"].value == pytest.approx(0.1, rel=1e-13)
    # At 20 gf/cm on the way up; recovery begins too far above it.
    low = kes.tension(strain, force, max_force=20 * GF / 1e-2, rule="linear")
    assert low["EMT"].kes_value == pytest.approx(22.5, rel=1e-13)
    assert low["WT"].kes_value == pytest.approx(1.0 + 15 * 0.025, rel=1e-13)
    # What is left after 50 gf/cm is not what is left after 20, nor after a load never reached.
    high = kes.tension(strain, force, max_force=60 * GF / 1e-2, rule="linear")
    for name in ("RT", "WT_recovered", "residual_strain"):
        assert name not in low and "50 gf/cm" in low.left_out[name]
        assert (
            name not in high and "comes to 50 gf/cm (49.0333 N m-1) at most" in high.left_out[name]
        )


def test_recovery_below_zero_force_ends_at_the_crossing():
    strain = np.array([0, 0.1, 0.2, 0.1, 0.0])
    force = np.array([0.0, 10, 20, 5, -5])
    found = kes.tension(strain, force, max_force=20.0, rule="linear")
    assert found["residual_strain"].value == pytest.approx(0.05, rel=1e-13)
    assert found["WT_recovered"].value == pytest.approx(1.25 + 0.125, rel=1e-13)


def test_recovery_that_begins_with_a_drop_at_the_turning_strain():
    strain = np.array([0, 0.1, 0.2, 0.2, 0.1, 0.05])
    force = np.array([0.0, 10, 20, 16, 8, 0])
    found = kes.tension(strain, force, max_force=20.0, rule="linear")
    assert found["WT"].value == pytest.approx(2.0, rel=1e-13)
    assert found["WT_recovered"].value == pytest.approx(1.2 + 0.2, rel=1e-13)


def test_recovery_from_just_above_the_largest_force_counts_from_it():
    strain = np.array([0, 0.1005, 0.05, 0.0])
    force = np.array([0.0, 20.1, 5.0, 0.0])
    found = kes.tension(strain, force, max_force=20.0, rule="linear")
    begin = 0.05 + 0.0505 * 15 / 15.1
    assert found["EMT"].value == pytest.approx(0.1, rel=1e-13)
    assert found["WT_recovered"].value == pytest.approx(
        0.5 * 25 * (begin - 0.05) + 0.5 * 5 * 0.05, rel=1e-12
    )


@pytest.mark.parametrize("words", [("loading", "recovery"), (0, 1), (False, True)])
def test_phase_says_what_the_strain_says(words):
    part = np.linspace(0, 1, 21)
    strain = 0.3 * there_and_back(part, part[::-1])
    force = 20 * there_and_back(part**2, part[::-1] ** 3)
    phase = np.array(words)[(np.arange(strain.size) > 20).astype(int)]
    plain, told = (kes.tension(strain, force, max_force=20.0, phase=p) for p in (None, phase))
    assert plain.rows() == told.rows()
    apart = kes.tension(
        strain[:21], force[:21], recovery=(strain[20:][::-1], force[20:][::-1]), max_force=20.0
    )
    assert apart.rows() == plain.rows()


def test_second_cycle_begins_at_the_residual_strain():
    # Up straight to (0.2, 20), back straight to (0.1, 0), up straight again, back to (0.12, 0).
    strain = np.array([0, 0.1, 0.2, 0.15, 0.1, 0.15, 0.2, 0.16, 0.12])
    force = np.array([0, 10, 20, 10, 0, 10, 20, 10, 0.0])
    cycle = np.array([1, 1, 1, 1, 1, 2, 2, 2, 2])
    for options in ({"number": 2}, {"number": 2, "cycle": cycle}):
        found = kes.tension(strain, force, max_force=20.0, rule="linear", **options)
        assert found["EMT"].value == pytest.approx(0.2, rel=1e-13)
        assert found["WT"].value == pytest.approx(1.0, rel=1e-13)
        assert found["LT"].value == pytest.approx(0.5, rel=1e-13)
        assert found["RT"].value == pytest.approx(0.8, rel=1e-13)
    first = kes.tension(strain, force, max_force=20.0, rule="linear", cycle=cycle)
    assert first["RT"].value == pytest.approx(0.5, rel=1e-13)
    with pytest.raises(InputError, match=r"number = 3: .*has 2"):
        kes.tension(strain, force, number=3)
    with pytest.raises(InputError, match=r"number = 3: .*1, 2"):
        kes.tension(strain, force, cycle=cycle, number=3)


def test_start_that_the_curve_does_not_hold():
    strain = 0.01 * np.arange(1, 21)
    force = 20 * (strain / 0.2) ** 2
    without = kes.tension(strain, force, max_force=20.0)
    assert "LT" not in without and without["EMT"].value == pytest.approx(0.2, rel=1e-12)
    assert "begins at strain 0.01" in without.left_out["WT"]
    found = kes.tension(strain, force, max_force=20.0, start=(0.0, 0.0))
    assert found["LT"].value == pytest.approx(2 / 3, rel=1e-9)
    with pytest.raises(InputError, match="start"):
        kes.tension(strain, force, start=(0.05, 0.0))


def test_a_recovery_of_one_state_is_not_called_none():
    found = kes.tension([0, 0.1, 0.2, 0.19], [0, 5, 10, 0], phase=[0, 0, 0, 1], max_force=10.0)
    assert "single point; it needs two" in found.left_out["residual_strain"]


@pytest.mark.parametrize(
    ("strain", "force", "name", "reason"),
    [
        (
            [0, 0.1, 0.2],
            [0, 5, 9.9],
            "LT",
            r"loading comes to 10\.0952 gf/cm \(9\.9 N m-1\) at most, not to 10",
        ),
        ([0, 0.1, 0.2], [0, 5, 10], "RT", "no recovery"),
        ([0, 0.1, 0.2, 0.1], [0, 5, 10, 3], "RT", "no recovery"),
        (
            [0, 0.1, 0.2, 0.15, 0.1],
            [0, 5, 10, 6, 3],
            "RT",
            r"recovery ends at 3\.05915 gf/cm \(3 N m-1\)",
        ),
        ([0, 0.1, 0.2, 0.05, 0.02, 0.0], [0, 5, 10, 2, 1, 0], "RT", "begins at strain 0.05"),
        ([0.0, 0.1, 0.2], [12, 13, 14], "LT", "already at strain 0"),
    ],
)
def test_parameters_that_cannot_be_had(strain, force, name, reason):
    strain, force = np.array(strain, dtype=float), np.array(force, dtype=float)
    found = kes.tension(strain, force, max_force=10.0)
    assert name not in found
    with pytest.raises(KeyError, match=reason):
        found[name]


def test_force_within_a_solvers_tolerance_counts_as_reached():
    strain = np.linspace(0, 0.1, 11)
    near = kes.tension(strain, 20 * (1 - 1e-4) * strain / 0.1, max_force=20.0)
    assert near["EMT"].value == pytest.approx(0.1, rel=1e-12)
    assert "EMT" not in kes.tension(strain, 20 * (1 - 4e-4) * strain / 0.1, max_force=20.0)


# ---- reading between points ----


def test_smooth_curve_converges_in_fourth_order_within_the_estimate():
    wanted = (math.cosh(5) - 1) / 5 + 1
    errors = []
    for points in (321, 641, 1281):
        x = np.linspace(0, 1, points)
        one = Pass(x, np.sinh(5 * x) + 1.0)
        assert one.rule == "spline"
        area, estimate = one.integral(0, 1)
        errors.append(abs(area - wanted))
        assert 0 < errors[-1] < estimate < 1e-3
    assert min(errors[0] / errors[1], errors[1] / errors[2]) > 12


def test_few_points_of_a_smooth_curve_are_read_smoothly():
    x = np.linspace(0, 3, 15)
    one = Pass(x, 2.0 + np.sin(x))
    assert one.rule == "spline"
    assert one.value(1.5)[0] == pytest.approx(2.0 + math.sin(1.5), abs=1e-4)


def test_rough_curves_are_read_without_overshoot():
    x = np.linspace(0, 1, 101)
    rng = np.random.default_rng(5)
    between = np.linspace(0, 1, 977)
    curves = {
        "kinked": np.where(x < 0.503, x, 0.503 + 30 * (x - 0.503)),
        "noise": x**2 + 1e-3 * rng.standard_normal(x.size),
        "step": np.where(x < 0.5, 0.0, 1.0),
        "counts": np.round(50 * x**2) / 50,
    }
    for name, y in curves.items():
        one = Pass(x, y)
        assert one.rule == "linear", name
        read = np.array([one.value(at)[0] for at in between])
        assert np.abs(read - np.interp(between, x, y)).max() < 1e-12
        area, _ = one.integral(0.1234, 0.9)
        fine = np.unique(np.concatenate([x, np.linspace(0.1234, 0.9, 2001)]))
        fine = fine[(fine >= 0.1234) & (fine <= 0.9)]
        assert area == pytest.approx(np.trapezoid(np.interp(fine, x, y), fine), rel=1e-12)


@pytest.mark.parametrize("rule", ["linear", "pchip", "spline", "power"])
def test_first_moment_against_adaptive_quadrature(rule):
    x = np.linspace(0, 2, 14)
    one = Pass(x, 3 * x**2.4, rule=rule)
    found, estimate = one.first_moment(0.0, 1.7)
    wanted, _ = quad(
        lambda at: (at - 0.85) * one.value(at)[0], 0, 1.7, points=x[1:-2], limit=400, epsrel=1e-11
    )
    assert found == pytest.approx(wanted, rel=1e-9)
    assert estimate > 0
    if rule == "power":
        closed = 3 * (1.7**4.4 / 4.4 - 0.85 * 1.7**3.4 / 3.4)
        assert found == pytest.approx(closed, rel=1e-11)


def test_vertical_step_is_kept():
    one = Pass([0, 1, 1, 2], [0, 1, 3, 3])
    assert one.rule == "linear"
    assert one.value(1.0)[0] == 2.0
    assert one.value(0.5)[0] == 0.5
    assert one.integral(0, 2)[0] == pytest.approx(3.5, rel=1e-14)
    assert one.reach(2.0)[0] == 1.0


def test_direction_of_a_pass_does_not_matter():
    x = np.linspace(0.0, 3.0, 31)
    y = np.exp(x)
    up, down = Pass(x, y), Pass(x[::-1], y[::-1])
    assert up.rising and not down.rising
    assert up.integral(0.4, 2.1) == down.integral(0.4, 2.1)
    assert down.start == 3.0


def test_function_that_cannot_be_integrated():
    bad = kes.FunctionPass(lambda x: 1 / abs(x - 1 / 3 - 1e-4) ** 1.5, 0.0, 1.0)
    with pytest.raises(ComputationError, match="integral from 0 to 1"):
        bad.integral(0.0, 1.0)


# ---- bending ----

B, HB, CURL = 8e-7, 3e-6, 4e-5


def closed_loop(jump):
    """-250 to 250 and back, with the turning point in one branch or in both."""
    x = np.linspace(-250, 250, 101)
    return (
        np.concatenate([x, x[::-1] if jump else x[-2::-1]]),
        np.concatenate([np.ones(101), -np.ones(101 if jump else 100)]),
    )


@pytest.mark.parametrize("branch", ["loading", "recovery", "mean"])
@pytest.mark.parametrize("slope", ["chord", "fit"])
@pytest.mark.parametrize("at", [50.0, 100.0, 150.0, (50.0, 150.0)])
@pytest.mark.parametrize("shape", ["cycle", "loop", "jump"])
def test_straight_bending_gives_the_closed_forms(branch, slope, at, shape):
    kappa, way = cycle_of(250.0) if shape == "cycle" else closed_loop(shape == "jump")
    found = kes.bending(
        kappa, CURL + B * kappa + way * HB, branch=branch, slope=slope, hysteresis_at=at
    )
    ideal = exact.kes_linear_bending(B, HB, 250.0)
    for name in ("B", "B_face", "B_back"):
        assert found[name].value == pytest.approx(ideal.rigidity, rel=1e-9)
    for name in ("2HB", "2HB_face", "2HB_back"):
        assert found[name].value == pytest.approx(ideal.hysteresis, rel=1e-9)
    assert found["K0_rising"].value == pytest.approx(-(CURL + HB) / B, rel=1e-9)
    assert found["K0_falling"].value == pytest.approx(-(CURL - HB) / B, rel=1e-9)
    assert found["K0"].value == pytest.approx(-CURL / B, rel=1e-9)
    assert found["M0_rising"].value == pytest.approx(CURL + HB, rel=1e-9)
    assert found["M0_falling"].value == pytest.approx(CURL - HB, rel=1e-9)
    if shape == "cycle":
        assert found["M0_start"].value == found["M0"].value == pytest.approx(CURL + HB, rel=1e-9)
    else:
        assert found["M0"].value == pytest.approx(CURL, rel=1e-9)
        assert "M0_start" not in found.parameters


def test_curved_bending_by_every_definition():
    # M = M0 + a k + b k2 + c k3 +- (h0 + h2 k2), cubics: a spline is exact.
    kappa, way = cycle_of(250.0)
    a, b, c, h0, h2 = 6e-7, 9e-10, 4e-12, 2e-6, 5e-11
    moment = CURL + a * kappa + b * kappa**2 + c * kappa**3 + way * (h0 + h2 * kappa**2)
    low, high = 50.0, 150.0
    chord = kes.bending(kappa, moment)
    # On either side, loading is way = side: (b + side h2) over a range at side.
    squares, cubes = low + high, low * low + low * high + high * high
    face = a + (b + h2) * squares + c * cubes
    back = a - (b - h2) * squares + c * cubes
    assert chord["B_face"].value == pytest.approx(face, rel=1e-11)
    assert chord["B_back"].value == pytest.approx(back, rel=1e-11)
    assert chord["B"].value == pytest.approx(0.5 * (face + back), rel=1e-11)
    recovery = kes.bending(kappa, moment, branch="recovery")
    assert recovery["B_face"].value == pytest.approx(a + (b - h2) * squares + c * cubes, rel=1e-11)
    mean = kes.bending(kappa, moment, branch="mean")
    assert mean["B_face"].value == pytest.approx(a + b * squares + c * cubes, rel=1e-11)
    fine = np.linspace(low, high, 20001)
    fit = kes.bending(kappa, moment, slope="fit")
    line = np.polyfit(fine - 100, a * fine + (b + h2) * fine**2 + c * fine**3, 1)
    assert fit["B_face"].value == pytest.approx(line[0], rel=1e-7)
    assert abs(line[0] / face - 1) > 1e-3
    for at in (50.0, 100.0, 150.0):
        width = kes.bending(kappa, moment, hysteresis_at=at)["2HB"]
        assert width.value == pytest.approx(2 * (h0 + h2 * at**2), rel=1e-9)
    over = kes.bending(kappa, moment, hysteresis_at=(low, high))["2HB_back"]
    assert over.value == pytest.approx(2 * (h0 + h2 * cubes / 3), rel=1e-9)


def test_mirrored_fabric_changes_sides():
    kappa, way = cycle_of(250.0)
    moment = CURL + 6e-7 * kappa + 9e-10 * kappa**2 + way * (HB + 1e-9 * kappa)
    found = kes.bending(kappa, moment)
    mirrored = kes.bending(-kappa, -moment)
    for name in ("B", "2HB"):
        for one, other in (("face", "back"), ("back", "face")):
            assert mirrored[f"{name}_{one}"].value == pytest.approx(
                found[f"{name}_{other}"].value, rel=1e-12
            )
        assert found[f"{name}_face"].value != pytest.approx(found[f"{name}_back"].value, rel=1e-3)
    assert mirrored["K0"].value == pytest.approx(-found["K0"].value, rel=1e-12)
    assert mirrored["M0"].value == pytest.approx(-found["M0"].value, rel=1e-12)


def test_rounding_noise_is_no_hysteresis():
    """A bent fabric without friction, its moments as exact as the solver leaves them."""
    kappa, way = cycle_of(250.0)
    noise = 1e-9 * np.random.default_rng(1).standard_normal(kappa.size)
    found = kes.bending(kappa, CURL + B * kappa + CURL * noise)
    for name in ("2HB", "2HB_face", "2HB_back"):
        assert found[name].value == 0.0 < found[name].error < 1e-6 * abs(CURL)
    small = 1e-6 * abs(CURL)
    found = kes.bending(kappa, CURL + B * kappa + 0.5 * small * way)
    assert found["2HB"].value == pytest.approx(small, rel=1e-6)


def test_single_pass_has_a_slope_and_no_hysteresis():
    kappa = np.linspace(-250, 250, 41)
    for order in (1, -1):
        found = kes.bending(kappa[::order], (CURL + B * kappa)[::order])
        assert found["B_face"].value == pytest.approx(B, rel=1e-11)
        assert found["B_back"].value == pytest.approx(B, rel=1e-11)
        assert "single pass" in found.left_out["2HB_face"]
        assert found["M0"].value == pytest.approx(CURL, rel=1e-11)
        assert found["K0"].value == pytest.approx(-CURL / B, rel=1e-11)


def test_recovery_is_the_one_after_loading():
    part = np.linspace(-250, 250, 51)
    kappa = np.concatenate([part, part[::-1], part])
    moment = B * kappa + np.repeat([5 * HB, -HB, 2 * HB], 51)
    found = kes.bending(kappa, moment)
    assert found["2HB_face"].value == pytest.approx(6 * HB, rel=1e-11)
    assert found["2HB_back"].value == pytest.approx(3 * HB, rel=1e-11)


def test_ranges_that_the_test_does_not_reach():
    kappa, way = cycle_of(120.0)
    found = kes.bending(kappa, CURL + B * kappa + way * HB)
    assert "B" not in found and "2HB" in found
    assert found.left_out["B_face"].startswith("no loading at 0.5 to 1.5 1/cm (50 to 150 m-1)")
    assert "0 to 120 m-1" in found.left_out["B_face"]
    assert found.left_out["B"].startswith("needs B_face")
    assert "2HB_face" not in kes.bending(kappa, B * kappa, hysteresis_at=130.0)
    # One side alone gives no mean.
    kappa = there_and_back(np.linspace(0, 250, 51), np.linspace(250, 0, 51))
    found = kes.bending(kappa, B * kappa)
    assert found["B_face"].value == pytest.approx(B, rel=1e-11)
    assert found.left_out["B"].startswith("needs B_back")


def test_curl_that_is_not_reached_gives_the_bound():
    kappa, way = cycle_of(250.0)
    above = kes.bending(kappa, 1e-3 + B * kappa + way * HB)
    assert "K0" not in above and "below -2.5 1/cm (-250 m-1)" in above.left_out["K0_falling"]
    below = kes.bending(kappa, -1e-3 + B * kappa + way * HB)
    assert "above 2.5 1/cm (250 m-1)" in below.left_out["K0_rising"]
    falling = kes.bending(kappa, CURL - B * kappa)
    assert "does not pass from below to above" in falling.left_out["K0"]
    nothing = kes.bending(kappa, 0.0 * kappa)
    assert "zero throughout" in nothing.left_out["K0"]
    assert nothing["M0"].value == 0.0


def test_of_several_rests_the_nearest_counts():
    kappa = np.linspace(-250, 250, 501)
    moment = 1e-12 * (kappa + 200.25) * (kappa - 50.25) * (kappa - 120.25)
    assert kes.bending(kappa, moment)["K0"].value == pytest.approx(120.25, rel=1e-9)


def test_flat_start_at_zero_moment_is_the_rest():
    kappa, _ = cycle_of(250.0)
    assert kes.bending(kappa, B * kappa)["K0"].value == pytest.approx(0.0, abs=1e-12)


def test_cycle_of_several_is_chosen():
    kappa, way = cycle_of(250.0)
    both = np.concatenate([kappa, kappa[1:]])
    moment = np.concatenate([B * kappa + way * HB, (2 * B * kappa + 2 * way * HB)[1:]])
    cycle = np.repeat([1, 2], [kappa.size, kappa.size - 1])
    assert kes.bending(both, moment, cycle=cycle, number=2)["2HB"].value == pytest.approx(4 * HB)
    assert kes.bending(both, moment, cycle=cycle)["B"].value == pytest.approx(B)
    assert kes.bending(both, moment)["B"].value == pytest.approx(B)


# ---- shear ----


def test_shear_parameters():
    deg = math.pi / 180
    angle, way = cycle_of(8 * deg, 160)
    stiff, soft, h0, h1 = 4.0, 30.0, 0.05, 0.4
    force = stiff * angle + soft * angle**3 + way * (h0 + h1 * np.abs(angle))
    found = kes.shear(angle, force)
    low, high = 0.5 * deg, 2.5 * deg
    slope = stiff + soft * (low**2 + low * high + high**2) + h1
    assert found["G"].value == pytest.approx(slope, rel=1e-6)
    assert found["G"].kes_value == pytest.approx(slope * deg / (GF / 1e-2), rel=1e-6)
    assert found["2HG"].value == pytest.approx(2 * (h0 + h1 * 0.5 * deg), rel=1e-9)
    assert found["2HG5"].value == pytest.approx(2 * (h0 + h1 * 5 * deg), rel=1e-9)
    assert found["2HG5"].kes_value == pytest.approx(found["2HG5"].value / (GF / 1e-2), rel=1e-12)
    small = kes.shear(0.5 * angle, force)
    assert "2HG" in small and "5 deg (0.0872665 rad)" in small.left_out["2HG5"]


# ---- units, tables ----


def test_units_by_hand():
    kappa, way = cycle_of(250.0)
    # 0.05 gf cm2/cm, 0.03 gf cm/cm.
    found = kes.bending(kappa, 0.05 * GF * 1e-2 * kappa + way * 0.015 * GF)
    assert found["B"].kes_value == pytest.approx(0.05, rel=1e-12)
    assert found["B"].value == pytest.approx(4.903325e-6, rel=1e-12)
    assert (found["B"].units, found["B"].kes_units) == ("N m", "gf cm2/cm")
    assert found["2HB"].kes_value == pytest.approx(0.03, rel=1e-9)
    assert kes.bending(kappa, B * (kappa - 40))["K0"].kes_value == pytest.approx(0.4, rel=1e-12)
    assert pytest.approx(490.3325, rel=1e-14) == kes.STANDARD_FORCE
    assert pytest.approx(49.03325, rel=1e-14) == kes.KNIT_FORCE


def test_printed_definitions_and_rows():
    kappa, way = cycle_of(120.0)
    found = kes.bending(kappa, B * kappa + way * HB, hysteresis_at=50.0)
    text = found.described()
    assert "2HB = 6e-06 N (0.00061183 gf cm/cm): width of the loop at 0.5 1/cm (50 m-1)" in text
    assert "B_face left out: no loading at 0.5 to 1.5 1/cm (50 to 150 m-1)" in text
    assert "pass 1: 51 points, rule linear" in text
    rows = {row["parameter"]: row for row in found.rows()}
    assert set(rows) == set(found.parameters) | set(found.left_out)
    assert math.isnan(rows["B"]["value"]) and rows["B"]["left_out"]
    assert rows["2HB"]["value"] == found["2HB"].value and not rows["2HB"]["left_out"]
    assert len({tuple(row) for row in found.rows()}) == 1


# ---- files ----


def test_measured_curves_from_files(tmp_path):
    path = tmp_path / "tension.csv"
    part = np.linspace(0, 1, 26)
    rows = [(30 * p, 50 * p**2) for p in part] + [(30 * p, 50 * p**3) for p in part[-2::-1]]
    lines = [f"{e!r},{f!r}" for e, f in np.array(rows).tolist()]
    path.write_text("\n".join(["strain_percent,force_per_width_gf_per_cm", *lines]))
    curve = read_measured(path)
    found = kes.tension(
        curve["strain"], curve["force_per_width"], max_force=kes.KNIT_FORCE, source=curve.source
    )
    assert found["LT"].value == pytest.approx(2 / 3, rel=1e-9)
    assert found["RT"].kes_value == pytest.approx(75, rel=1e-9)
    path = tmp_path / "bending.csv"
    kappa, way = cycle_of(2.5)
    lines = [
        f"{k!r};{0.04 * k + 0.01 * w!r}" for k, w in zip(kappa.tolist(), way.tolist(), strict=True)
    ]
    path.write_text("\n".join(["curvature_per_cm;moment_per_width_gf_cm_per_cm", *lines]))
    curve = read_measured(path)
    found = kes.bending(curve["curvature"], curve["moment_per_width"])
    assert found["B"].kes_value == pytest.approx(0.04, rel=1e-9)
    assert found["2HB"].kes_value == pytest.approx(0.02, rel=1e-9)


# ---- bad input ----

UP = [0.0, 0.1, 0.2, 0.3]


@pytest.mark.parametrize(
    ("strain", "force", "options", "message"),
    [
        (UP, [0, 1, np.nan, 3], {}, r"s\.csv: force_per_width\[2\] = nan: must be finite"),
        ([0, 0.1, np.inf, 0.3], UP, {}, r"s\.csv: strain\[2\] = inf"),
        (UP, [0, 1, 2], {}, r"force_per_width = 3 points: .* 4"),
        ([0.1], [1], {}, "2 or more"),
        ([[0.1, 0.2]], [1, 2], {}, "row"),
        (["a", "b"], [1, 2], {}, "must be numbers"),
        ([0.1, 0.1, 0.1], [1, 2, 3], {}, "must change"),
        (
            [0, 0.1, 0.2, 0.199, 0.3], [0, 1, 2, 2, 3], {},
            r"strain\[3\] = 0\.199: must not fall below the value before it, 0\.2",
        ),
        (
            [0, 0.2, 0.3, 0.1, 0.101, 0], [0, 2, 3, 1, 1, 0], {},
            r"strain\[4\] = 0\.101: must not rise above",
        ),
        ([0, 0.1, 0.05, 0.2], UP, {"phase": [0, 0, 0, 0]}, r"strain\[2\] = 0\.05: must not fall"),
        (UP, UP, {"phase": ["up"] * 4}, "loading or recovery"),
        (UP, UP, {"phase": [0, 0]}, r"phase = \(2,\): must have shape \(4,\)"),
        (UP, UP, {"cycle": [1, 1]}, r"cycle = \(2,\)"),
        (UP, UP, {"recovery": (UP, UP), "phase": [0] * 4}, "recovery"),
        (UP, UP, {"recovery": ([0.3, 0.1, 0.2], [3, 2, 1])}, r"recovery strain\[2\] = 0\.2"),
        (UP, UP, {"recovery": ([0.3, 0.1], [3, np.nan])}, r"recovery force_per_width\[1\] = nan"),
        (UP, UP, {"rule": "cubic"}, "rule = cubic: must be one of auto, linear"),
        (UP, [1, 2, 3, 4], {"rule": "power"}, "power: needs 4 points"),
        (UP, UP, {"max_force": -1}, "max_force = -1: must be above 0"),
        (UP[::-1], UP, {}, "number = 1: .*has 0"),
    ],
)  # fmt: skip
def test_bad_tension_is_refused(strain, force, options, message):
    with pytest.raises(InputError, match=message):
        kes.tension(strain, force, source="s.csv", **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"slope_range": (150.0, 50.0)}, r"slope_range\[1\]"),
        ({"slope_range": (-50.0, 50.0)}, r"slope_range\[0\]"),
        ({"slope_range": 50.0}, "slope_range = 50.0"),
        ({"branch": "both"}, "branch = both: must be one of loading, recovery, mean"),
        ({"slope": "secant"}, "slope = secant"),
        ({"hysteresis_at": 0.0}, "hysteresis_at = 0"),
        ({"hysteresis_at": (1.0, 2.0, 3.0)}, "hysteresis_at"),
        ({"hysteresis_at": (100.0, 50.0)}, r"hysteresis_at\[1\]"),
        ({"rule": "spine"}, "rule = spine"),
    ],
)
def test_bad_definitions_are_refused(options, message):
    kappa, way = cycle_of(250.0)
    with pytest.raises(InputError, match=message):
        kes.bending(kappa, B * kappa + way * HB, **options)


def test_noise_in_the_curvature_is_named():
    kappa, _ = cycle_of(250.0)
    moment = B * kappa
    kappa[70] = kappa[69] + 1.0
    with pytest.raises(InputError, match=r"curvature\[70\] = .*: must not rise above"):
        kes.bending(kappa, moment)
    with pytest.raises(InputError, match=r"moment_per_width\[3\] = nan"):
        kes.bending(kappa, np.where(np.arange(kappa.size) == 3, np.nan, moment))
    with pytest.raises(InputError, match=r"loading = from 0\.3 down"):
        kes.tension_of(Pass(UP[::-1], UP))
    with pytest.raises(InputError, match="must differ"):
        kes.FunctionPass(lambda x: x, 1.0, 1.0)
    with pytest.raises(InputError, match=r"y\[0\] = inf"):
        kes.FunctionPass(lambda x: 1 / x if x else math.inf, 0.0, 1.0)


def test_a_rule_that_fits_only_half_of_the_points_is_not_chosen():
    """A steep start that dips: every other point follows a power law, all of them together cannot."""
    strain = np.array([0.0, 1.2e-6, 1.7e-6, 3.0e-5, 2.2e-3, 3.2e-3, 1.03e-2, 2.97e-2, 0.105])
    force = 100.0 * strain**0.3
    force[2] = 0.7 * force[1]
    found = kes.tension(strain, force, max_force=25.0)
    assert found["EMT"].value == pytest.approx((25.0 / 100.0) ** (1.0 / 0.3), rel=0.02)

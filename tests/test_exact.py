"""Exact answers for rods, crimped yarns, KES curves and chains against independent routes:
multi-precision elliptic integrals and initial value problems, quadrature, eigenvalues, limits."""

import math

import mpmath
import numpy as np
import pytest
from oracles import crimp, exact
from scipy.integrate import quad, solve_ivp
from scipy.special import j0

from knitsim.errors import ComputationError, InputError
from knitsim.verification import exact_crimp, exact_rods

mp = mpmath.mp.clone()
mp.dps = 30


def initial_value_tip(root_slope, force=(0, 0), weight=(0, 0), rest=None, length=1):
    """(theta, theta' - theta_0', x, y) at s = length of the rod that leaves the clamp with theta' =
    theta_0' + root_slope, from an explicit integrator; rest: (theta_0', theta_0'')."""
    rest = rest or ((lambda s: 0), (lambda s: 0))

    def slopes(s, state):
        theta, slope = state[0], state[1]
        fx, fy = force[0] + weight[0] * (1 - s), force[1] + weight[1] * (1 - s)
        bend = fx * math.sin(theta) - fy * math.cos(theta)
        return [slope, rest[1](s) + bend, math.cos(theta), math.sin(theta)]

    start = [0.0, root_slope + rest[0](0.0), 0.0, 0.0]
    end = solve_ivp(slopes, (0.0, length), start, method="DOP853", rtol=3e-14, atol=1e-16).y[:, -1]
    return end[0], end[1] - rest[0](length), end[2], end[3]


# ---- dead tip load ----


def bisshopp_drucker(load):
    """Deflection and shortening from the elliptic integrals as published."""
    root = mp.sqrt(mp.mpf(load))

    def amplitude(m):
        return mp.asin(1 / mp.sqrt(2 * m))

    def excess(logit):
        m = (1 + 1 / (1 + mp.exp(-logit))) / 2
        return mp.ellipk(m) - mp.ellipf(amplitude(m), m) - root

    logit = mp.findroot(excess, (-40, 2 * root + 5), solver="anderson", tol=1e-50, maxsteps=500)
    m = (1 + 1 / (1 + mp.exp(-logit))) / 2
    deflection = 1 - 2 / root * (mp.ellipe(m) - mp.ellipe(amplitude(m), m))
    shortening = 1 - mp.sqrt(2 * (2 * m - 1)) / root
    return deflection, shortening, mp.asin(2 * m - 1)


@pytest.mark.parametrize("load", [1e-4, 0.03, 1.0, 4.0, 10.0, 200.0])
def test_tip_load_against_the_published_elliptic_integrals(load):
    found = exact_rods.tip_load(load)
    deflection, shortening, angle = bisshopp_drucker(load)
    assert found.deflection == pytest.approx(float(deflection), rel=1e-12)
    assert found.shortening == pytest.approx(float(shortening), rel=1e-12)
    assert found.tip_angle == pytest.approx(float(angle), rel=1e-12)
    # Moment of the load about the clamp.
    assert found.root_moment == pytest.approx(load * (1 - float(shortening)), rel=1e-12)


@pytest.mark.parametrize(
    ("load", "deflection", "shortening"),
    [(1.0, 0.3017207738, 0.0564332363), (4.0, 0.6699641813, 0.3289412422)],
)
def test_tip_load_against_published_digits(load, deflection, shortening):
    found = exact_rods.tip_load(load)
    assert found.deflection == pytest.approx(deflection, abs=5.1e-11)
    assert found.shortening == pytest.approx(shortening, abs=5.1e-11)


def test_tip_load_limits():
    # P/3 and P^2/15 with relative corrections of the order P^2.
    small = exact_rods.tip_load(1e-8)
    assert small.deflection == pytest.approx(1e-8 / 3, rel=1e-14)
    assert small.shortening == pytest.approx(1e-16 / 15, rel=1e-14)
    # A long rod hangs: 1 - (2 - sqrt 2)/sqrt P, up to exp(-2 sqrt P).
    large = exact_rods.tip_load(1e8)
    assert 1 - large.deflection == pytest.approx((2 - math.sqrt(2)) * 1e-4, rel=1e-11)
    assert 1 - large.shortening == pytest.approx(math.sqrt(2) * 1e-4, rel=1e-11)
    assert large.tip_angle == pytest.approx(math.pi / 2, rel=1e-15)
    assert exact_rods.tip_load(0) == exact_rods.TipLoad(0, 0, 0, 0)


# ---- clamped rod, own weight ----


@pytest.mark.parametrize("load", [1e-6, 1.0, 4.0, 300.0])
def test_collocation_and_elliptic_integrals_agree(load):
    rod, closed = exact_rods.clamped_rod(force=(0, -load)), exact_rods.tip_load(load)
    assert -rod.displacement[1] == pytest.approx(closed.deflection, rel=1e-11)
    assert -rod.displacement[0] == pytest.approx(closed.shortening, rel=1e-11)
    assert -rod.tip_angle == pytest.approx(closed.tip_angle, rel=1e-11)
    assert -rod.root_moment == pytest.approx(closed.root_moment, rel=1e-11)


CURVED = (
    lambda s: 0.7 * np.sin(2 * s),
    (lambda s: 1.4 * math.cos(2 * s), lambda s: -2.8 * math.sin(2 * s)),
)


@pytest.mark.parametrize(
    ("loads", "rest"),
    [
        ({"weight": (0, -10.0)}, None),
        ({"force": (3.0, -4.0), "weight": (-2.0, 1.5), "couple": 0.8}, None),
        ({"force": (5.0, 2.0), "couple": -1.0}, CURVED),
    ],
)
def test_clamped_rod_against_the_initial_value_problem(loads, rest):
    rod = exact_rods.clamped_rod(**loads, rest_angle=rest and rest[0])
    couple = loads.pop("couple", 0.0)
    angle, slope, x, y = initial_value_tip(rod.root_moment, **loads, rest=rest and rest[1])
    # An error of the root moment grows by less than 100 over these rods.
    assert slope == pytest.approx(couple, abs=1e-11)
    assert angle == pytest.approx(rod.tip_angle, abs=1e-11)
    assert rod.tip == pytest.approx([x, y], abs=1e-11)
    assert rod.error <= 1e-11


def test_the_tip_moves_as_its_energy_demands():
    # dU = F dr: Castigliano, by central differences over the force.
    def rod(scale):
        return exact_rods.clamped_rod(force=(0.3 * scale, -2.0 * scale))

    step = 1e-3
    low, high = rod(1 - step), rod(1 + step)
    work = np.array([0.3, -2.0]) @ (high.tip - low.tip)
    assert high.energy - low.energy == pytest.approx(work, rel=step**2)
    assert work > 1e-4


def test_clamped_rod_symmetries_and_limits():
    up, down = exact_rods.clamped_rod(force=(1, 2)), exact_rods.clamped_rod(force=(1, -2))
    assert up.tip == pytest.approx(down.tip * [1, -1], abs=1e-15)
    turned = exact_rods.clamped_rod(couple=1.0)
    assert turned.tip == pytest.approx(exact_rods.roll_up(1.0), abs=1e-14)
    # A couple that undoes the rest curvature straightens the rod.
    straight = exact_rods.clamped_rod(couple=-1.2, rest_angle=lambda s: 1.2 * s)
    assert straight.tip == pytest.approx([1, 0], abs=1e-14)
    assert straight.energy == pytest.approx(1.2**2 / 2, rel=1e-14)
    inner = turned.points[len(turned.arc) // 2], turned.arc[len(turned.arc) // 2]
    assert inner[0] == pytest.approx(inner[1] * exact_rods.roll_up(inner[1]), abs=1e-14)


def test_clamped_rod_follows_the_branch_that_buckles():
    # Thrust below pi^2/4 leaves the rod straight; above it no stable branch is straight.
    assert exact_rods.clamped_rod(force=(-2.46, 0)).tip == pytest.approx([1, 0], abs=1e-15)
    with pytest.raises(ComputationError, match="loses its stability"):
        exact_rods.clamped_rod(force=(-2.48, 0))
    # With a little push across, half of a clamped strut's wave: P = K^2, x = 2 E/K - 1.
    m = mp.findroot(lambda m: mp.ellipk(m) - mp.sqrt(20), (0.9, 0.99999), solver="anderson")
    x = float(2 * mp.ellipe(m) / mp.sqrt(20) - 1)
    off = []
    for push in (1e-2, 1e-3):
        rod = exact_rods.clamped_rod(force=(-20.0, push))
        assert rod.tip[1] > 0.3
        off.append(rod.tip[0] - x)
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.01)
    assert abs(off[1]) < 1e-3


@pytest.mark.parametrize(("load", "ratio"), [(10.0, 1.066802320433), (100.0, 5.888104623327)])
def test_own_weight_against_published_digits(load, ratio):
    found = exact_rods.own_weight(load)
    assert found.ratio == pytest.approx(ratio, abs=5.1e-13)
    assert found.error < 1e-10


def test_own_weight_limits():
    small = exact_rods.own_weight(1e-6)
    assert small.ratio == pytest.approx(1e-6 / 8, rel=1e-11)
    assert small.tip_angle == pytest.approx(1e-6 / 6, rel=1e-11)
    # Heavy: a string but for the clamp, where theta' = 2 sqrt(G) sin((pi/2 - theta)/2) turns it
    # from the horizontal: W = sqrt(2/G) (1 + O(G^-1/2)).
    coarse, fine = exact_rods.own_weight(1600.0), exact_rods.own_weight(6400.0)
    excess = [1 - one.width * math.sqrt(g / 2) for one, g in ((coarse, 1600), (fine, 6400))]
    assert excess[0] / excess[1] == pytest.approx(2.0, abs=0.1)
    assert abs(excess[1]) < 0.02


# ---- closed forms ----


def test_roll_up():
    assert exact_rods.roll_up(1.0) == pytest.approx([0.8414709848, 0.4596976941], abs=5.1e-11)
    assert exact_rods.roll_up(2 * math.pi) == pytest.approx([0, 0], abs=1e-16)
    assert exact_rods.roll_up([0.0, 1e-9])[:, 1] == pytest.approx([0, 5e-10], rel=1e-14)
    arc = exact_rods.roll_up(4.0)
    expected = quad(lambda s: math.cos(4 * s), 0, 1)[0], quad(lambda s: math.sin(4 * s), 0, 1)[0]
    assert arc == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(("distance", "load"), [(0.8, 10.9822909670), (0.5, 13.3185281491)])
def test_strut_against_published_digits(distance, load):
    assert exact_rods.strut(distance).load == pytest.approx(load, abs=5.1e-11)


@pytest.mark.parametrize("distance", [0.999, 0.5, 0.0, -0.6])
def test_strut_against_the_initial_value_problem(distance):
    # From the crest, where the tangent lies along the thrust, a quarter wave to the hinge.
    found = exact_rods.strut(distance)
    moment = found.load * found.mid_deflection
    angle, slope, x, y = initial_value_tip(-moment, force=(-found.load, 0), length=0.5)
    assert slope == pytest.approx(0.0, abs=1e-11 * found.load)
    assert -angle == pytest.approx(found.largest_angle, rel=1e-11)
    assert 2 * x == pytest.approx(distance, abs=1e-12)
    assert -y == pytest.approx(found.mid_deflection, rel=1e-11)
    # Clamped: from the clamp over half the length to the other crest.
    held = exact_rods.strut(distance, ends="clamped")
    moment = 0.5 * held.load * held.mid_deflection
    angle, _, x, y = initial_value_tip(moment, force=(-held.load, 0), length=0.5)
    assert angle == pytest.approx(0.0, abs=1e-11 * held.load)
    assert 2 * x == pytest.approx(distance, abs=1e-11)
    assert y == pytest.approx(held.mid_deflection, rel=1e-11)


def test_strut_at_buckling():
    # P = pi^2 (1 + closed/2), deflection = (2/pi) sqrt(closed), with corrections of its order.
    closed = 1 / 2**30
    found = exact_rods.strut(1 - closed)
    assert found.load / math.pi**2 - 1 == pytest.approx(closed / 2, rel=1e-6)
    assert found.mid_deflection == pytest.approx(2 / math.pi * math.sqrt(closed), rel=2 * closed)
    assert exact_rods.strut(1 - closed, "clamped").load == pytest.approx(4 * found.load, rel=1e-15)


# ---- crimped yarn ----


@pytest.mark.parametrize("angle", [0.3, 1.2])
@pytest.mark.parametrize("pull", [0.5, 30.0])
def test_crimp_of_arcs_against_elliptic_integrals(angle, pull):
    # theta'' = p sin(theta), theta(0) = 0, theta'(1) = A: theta'^2 = c^2 + 4 p sin^2(theta/2).
    p, curvature = mp.mpf(pull), mp.mpf(angle)

    def crest(theta):
        return mp.sqrt(curvature**2 - 4 * p * mp.sin(theta / 2) ** 2)

    def excess(theta):
        c = crest(theta)
        return 2 / c * mp.ellipf(theta / 2, -4 * p / c**2) - 1

    top = 2 * mp.asin(min(mp.mpf(1), curvature / (2 * mp.sqrt(p)))) * (1 - mp.mpf(10) ** -12)
    end = mp.findroot(excess, (mp.mpf("1e-6"), min(top, curvature)), solver="anderson", tol=1e-40)
    c = crest(end)
    chord = mp.quad(lambda t: mp.cos(t) / mp.sqrt(c**2 + 4 * p * mp.sin(t / 2) ** 2), [0, end])
    found = exact_crimp.pull_crimped(exact_crimp.crimp_arcs(angle), pull)
    assert found.chord == pytest.approx(float(chord), rel=1e-12)
    assert found.end_angle == pytest.approx(float(end), rel=1e-11)
    rest = math.sin(angle) / angle
    assert found.extension == pytest.approx(float(chord) / rest - 1, rel=1e-11)


def test_crimp_of_a_sine_against_the_initial_value_problem():
    amplitude, pull = 1.1, 7.0
    rest_angle = exact_crimp.crimp_sine(amplitude)
    found = exact_crimp.pull_crimped(rest_angle, pull)
    root = exact_rods.clamped_rod(force=(pull, 0), rest_angle=rest_angle).root_moment
    q = math.pi / 2
    rest = (
        lambda s: amplitude * q * math.cos(q * s),
        lambda s: -amplitude * q**2 * math.sin(q * s),
    )
    angle, slope, x, _ = initial_value_tip(root, force=(pull, 0), rest=rest)
    assert slope == pytest.approx(0.0, abs=1e-11)
    assert found.end_angle == pytest.approx(angle, abs=1e-11)
    assert found.chord == pytest.approx(x, abs=1e-12)
    assert found.chord / (1 + found.extension) == pytest.approx(j0(amplitude), rel=1e-13)


def test_faint_crimp_obeys_the_linear_equation():
    # theta = A sin(q s) q^2/(q^2 + p); the chord gains A^2 (1 - (q^2/(q^2 + p))^2)/4.
    amplitude, q2 = 1e-4, math.pi**2 / 4
    for pull in (0.1, 3.0, 50.0):
        found = exact_crimp.pull_crimped(exact_crimp.crimp_sine(amplitude), pull)
        left = q2 / (q2 + pull)
        assert found.end_angle == pytest.approx(amplitude * left, rel=amplitude**2)
        assert found.extension == pytest.approx(amplitude**2 * (1 - left**2) / 4, rel=amplitude**2)


@pytest.mark.parametrize("slope", [0.1, 1.0, 4.0])
def test_sinusoid_lies_on_its_sine(slope):
    rest_angle = crimp.crimp_sinusoid(slope)
    rod = exact_rods.clamped_rod(rest_angle=rest_angle)
    wave = mp.pi / 2 / mp.ellipe(-(mp.mpf(slope) ** 2))  # a quarter of the wavelength
    assert rod.tip[0] == pytest.approx(float(wave), rel=1e-12)
    k = float(mp.pi / 2 / wave)
    height = slope / k * (1 - np.cos(k * rod.points[:, 0]))
    assert rod.points[:, 1] == pytest.approx(height, abs=1e-12)
    assert rest_angle(np.array([0.0, 1.0])) == pytest.approx([0, math.atan(slope)], abs=1e-14)


@pytest.mark.parametrize(
    "rest_angle",
    [exact_crimp.crimp_sine(2.0), exact_crimp.crimp_arcs(1.5), crimp.crimp_sinusoid(1.5)],
)
@pytest.mark.parametrize("pull", [0.2, 5.0])
def test_tension_is_the_derivative_of_the_energy(rest_angle, pull):
    step = 1e-3
    low = exact_crimp.pull_crimped(rest_angle, pull * (1 - step))
    high = exact_crimp.pull_crimped(rest_angle, pull * (1 + step))
    assert high.chord - low.chord > 1e-5
    slope = (high.energy - low.energy) / (high.chord - low.chord)
    # Between the two pulls whatever the curve; in their middle to second order.
    assert slope == pytest.approx(pull, rel=5 * step**2)


def test_pull_for_an_extension():
    rest_angle = exact_crimp.crimp_sine(1.0)
    for extension in (1e-5, 0.1, 0.3):
        pull = crimp.crimped_pull(rest_angle, extension)
        again = exact_crimp.pull_crimped(rest_angle, pull).extension
        assert again == pytest.approx(extension, rel=1e-11)


# ---- KES curves, step limits ----


@pytest.mark.parametrize(
    ("n", "m", "residual"), [(1.0, 1.0, 0.0), (1.7, 3.2, 0.0), (2.5, 1.4, 0.03)]
)
def test_kes_of_power_curves(n, m, residual):
    scale, force = 2000.0, 490.33
    found = exact.kes_power_curve(scale, n, m, force, residual)
    top = found.extension
    assert scale * top**n == pytest.approx(force, rel=1e-14)
    up = quad(lambda e: scale * e**n, 0, top, epsabs=0, epsrel=1e-13)[0]
    back = quad(
        lambda e: force * ((e - residual) / (top - residual)) ** m,
        residual,
        top,
        epsabs=0,
        epsrel=1e-13,
    )[0]
    assert found.work == pytest.approx(up, rel=1e-12)
    assert found.recovered == pytest.approx(back, rel=1e-12)
    assert found.linearity == pytest.approx(up / (0.5 * force * top), rel=1e-12)
    assert found.resilience == pytest.approx(back / up, rel=1e-12)
    if not residual:
        assert found.resilience == pytest.approx((n + 1) / (m + 1), rel=1e-14)


def test_kes_of_linear_bending():
    rigidity, half, top = 4e-6, 3e-4, 250.0
    found = exact.kes_linear_bending(rigidity, half, top)
    kappa = np.array([-top, top, top, -top])
    moment = rigidity * kappa + half * np.array([1, 1, -1, -1])
    assert found.rigidity == rigidity
    assert found.hysteresis == pytest.approx(moment[1] - moment[2], rel=1e-14)
    # The loop as a polygon (shoelace).
    area = 0.5 * abs(kappa @ np.roll(moment, -1) - moment @ np.roll(kappa, -1))
    assert found.lost == pytest.approx(area, rel=1e-14)


def test_step_limits_against_eigenvalues():
    mass, n = 56e-6 * 0.05e-3, 9
    listed = exact.stretch_step_limit(94.0, 56e-6, 0.05e-3)
    assert listed == pytest.approx(3.85922492e-8, abs=5.1e-17)
    second = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    ring = 2 * np.eye(8) - np.roll(np.eye(8), 1, 0) - np.roll(np.eye(8), -1, 0)
    bending = 5e-9 / 0.05e-3**3
    for matrix, found in (
        (94.0 / 0.05e-3 * ring, listed),
        (94.0 / 0.05e-3 * second, exact.stretch_step_limit(94.0, 56e-6, 0.05e-3, n)),
        (bending * ring @ ring, exact.bending_step_limit(5e-9, 56e-6, 0.05e-3)),
        (bending * second @ second, exact.bending_step_limit(5e-9, 56e-6, 0.05e-3, n)),
    ):
        omega = math.sqrt(np.linalg.eigvalsh(matrix)[-1] / mass)
        assert found == pytest.approx(2 / omega, rel=1e-12)


@pytest.mark.parametrize(
    "call",
    [
        lambda: exact_rods.tip_load(-1.0),
        lambda: exact_rods.tip_load(math.nan),
        lambda: exact_rods.tip_load("heavy"),
        lambda: exact_rods.own_weight(2e5),
        lambda: exact_rods.clamped_rod(couple=math.inf),
        lambda: exact_rods.clamped_rod(rest_angle=lambda s: s[:3]),
        lambda: exact_rods.strut(1.0),
        lambda: exact_rods.strut(0.5, "free"),
        lambda: exact_rods.roll_up([0.0, math.nan]),
        lambda: exact_crimp.crimp_sine(2.5),
        lambda: exact_crimp.pull_crimped(lambda s: 0.1 + s, 1.0),
        lambda: exact_crimp.pull_crimped(exact_crimp.crimp_arcs(1.0), -1.0),
    ],
)
def test_bad_input_is_refused(call):
    with pytest.raises(InputError) as refusal:
        call()
    assert "\n" not in str(refusal.value)

"""Open yarns on the fabric's kernels against exact answers, computed here from the formulas."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.open_yarn import Cylinder, OpenYarn, Support, follow_open, solve_open
from knitsim.errors import InputError
from knitsim.yarn.law import TensionLaw

LENGTH, BENDING = 0.1, 1e-6
# So stiff that the strains (below 1e-6) do not show.
STIFF = TensionLaw([0.0, 0.1], [0.0, 1e3])
CLAMPED, HINGED = Support("clamped"), Support("hinged")


def yarn(elements, **changes):
    return OpenYarn(LENGTH, BENDING, STIFF, elements, **changes)


def elastica(load):
    """Deflection and shortening over L of a cantilever, P L^2/EI = load (Bisshopp and Drucker)."""

    def misfit(k):
        return (
            ellipk(k**2) - ellipkinc(math.asin(1.0 / (k * math.sqrt(2.0))), k**2) - math.sqrt(load)
        )

    k = brentq(misfit, math.sqrt(0.5) + 1e-12, 1.0 - 1e-12, xtol=1e-15)
    phi = math.asin(1.0 / (k * math.sqrt(2.0)))
    root = math.sqrt(load)
    deflection = 1.0 - 2.0 / root * (ellipe(k**2) - ellipeinc(phi, k**2))
    return deflection, 1.0 - math.sqrt(2.0 * (2.0 * k**2 - 1.0)) / root


def order(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


@pytest.mark.parametrize("load", [1.0, 4.0])
def test_cantilever(load):
    exact = elastica(load)
    if load == 1.0:
        assert exact == pytest.approx((0.3017207738, 0.0564332363), abs=1e-9)
    errors = []
    for n in (20, 40, 80):
        state = solve_open(
            [yarn(n, start=CLAMPED, tip_force=(0.0, -load * BENDING / LENGTH**2, 0.0))], coarse=True
        )
        x, y, _ = state.end(0) / LENGTH
        errors.append(max(abs(-y - exact[0]), abs(1.0 - x - exact[1])))
        reaction = state.reaction(0, "start")
        assert reaction[1] == pytest.approx(load * BENDING / LENGTH**2, rel=1e-6)
    assert errors[-1] < 1e-5
    assert (order(errors) > 3.0).all()


def test_cantilever_under_its_own_weight():
    gravity = 10.0

    def slope(s, z):
        return np.array([z[1], -gravity * (1.0 - s) * np.cos(z[0])])

    # theta downwards from the horizontal clamp: theta'' = -G (1 - s) cos theta.
    exact = solve_bvp(
        slope,
        lambda a, b: np.array([a[0], b[1]]),
        np.linspace(0, 1, 201),
        np.array([np.linspace(0, 1, 201), np.ones(201)]),
        tol=1e-10,
        max_nodes=100000,
    )
    s, weight = np.polynomial.legendre.leggauss(60)
    theta = exact.sol(0.5 * (s + 1.0))[0]
    ratio = (weight @ np.sin(theta)) / (weight @ np.cos(theta))
    assert ratio == pytest.approx(1.066802320433, abs=1e-7)
    state = solve_open(
        [yarn(80, start=CLAMPED, weight=(0.0, -gravity * BENDING / LENGTH**3, 0.0))], coarse=True
    )
    x, y, _ = state.end(0)
    assert -y / x == pytest.approx(ratio, rel=1e-4)


@pytest.mark.parametrize("turn", [1.0, 2.0 * math.pi])
def test_pure_bending_rolls_up(turn):
    errors = []
    for n in (20, 40, 80):
        state = solve_open([yarn(n, start=CLAMPED, couple=turn * BENDING / LENGTH)], coarse=True)
        end = state.end(0)[:2] / LENGTH
        exact = np.array([math.sin(turn), 1.0 - math.cos(turn)]) / turn
        errors.append(np.abs(end - exact).max())
        assert state.end_angle(0) == pytest.approx(turn, rel=0.02)
        assert np.ptp(state.curvature(0)) < 0.2 * turn / LENGTH
    assert errors[-1] < 1e-5
    assert (order(errors) > 3.0).all()


@pytest.mark.parametrize(("distance", "value"), [(0.8, 10.9822909670), (0.5, 13.3185281491)])
def test_hinged_strut(distance, value):
    # Ends at 2 E(k)/K(k) - 1 of the length; P = 4 K(k)^2 B/L^2.
    k = brentq(lambda k: 2.0 * ellipe(k * k) / ellipk(k * k) - 1.0 - distance, 0.01, 0.99)
    load = 4.0 * ellipk(k * k) ** 2
    assert load == pytest.approx(value, rel=1e-9)

    def bow(t):
        return np.stack([LENGTH * t, 0.02 * LENGTH * np.sin(np.pi * t), 0 * t], axis=-1)

    end = Support("hinged", moved_to=(distance * LENGTH, 0.0, 0.0))
    # A step of the support longer than the elements beside it turns none of them over.
    for elements, steps in ((80, 10), (160, 10), (80, 2)):
        states = follow_open(
            [yarn(elements, shape=bow, start=HINGED, end=end)], coarse=True, steps=steps
        )
        forces = [one.reaction(0, "end") * LENGTH**2 / BENDING for one in states]
        assert -forces[-1][0] == pytest.approx(load, rel=1e-4)
        assert forces[-1][1] == pytest.approx(0.0, abs=1e-4)
        assert (np.diff([-one[0] for one in forces]) > 0.0).all()


def test_crimped_yarn_pulled_straight():
    """theta'' - theta0'' = p sin theta on a quarter wave, p = P/B, by a boundary-value problem."""
    amplitude, pull = 0.5, 60.0  # theta0 = amplitude cos(pi s/L), P L^2/B

    def slope(s, z):
        return np.array([z[1], -amplitude * math.pi**2 * np.cos(np.pi * s) + pull * np.sin(z[0])])

    # Hinges at the ends: theta' = theta0' = 0 there.
    grid = np.linspace(0, 1, 201)
    guess = np.array([0.2 * np.cos(np.pi * grid), -0.2 * np.pi * np.sin(np.pi * grid)])
    exact = solve_bvp(slope, lambda a, b: np.array([a[1], b[1]]), grid, guess, tol=1e-10)
    s, weight = np.polynomial.legendre.leggauss(60)
    span = 0.5 * weight @ np.cos(exact.sol(0.5 * (s + 1.0))[0])

    fine = np.linspace(0.0, 1.0, 20001)
    theta0 = amplitude * np.cos(np.pi * fine)
    steps = 0.5 * (fine[1] - fine[0]) * np.stack([np.cos(theta0), np.sin(theta0)])
    path = np.concatenate([np.zeros((2, 1)), np.cumsum(steps[:, 1:] + steps[:, :-1], axis=1)], 1)

    def crimped(t):
        return np.stack(
            [LENGTH * np.interp(t, fine, path[0]), LENGTH * np.interp(t, fine, path[1]), 0 * t], -1
        )

    def rest(t):
        return amplitude * np.pi / LENGTH * np.sin(np.pi * t)

    pulled = yarn(
        80,
        shape=crimped,
        start=HINGED,
        tip_force=(pull * BENDING / LENGTH**2, 0.0, 0.0),
        rest_curvature=rest,
    )
    state = solve_open([pulled], coarse=True)
    chord = np.linalg.norm(state.end(0) - state.points(0)[0])
    at_rest = math.hypot(*path[:, -1])
    assert chord / LENGTH == pytest.approx(span, rel=1e-4)
    assert chord / LENGTH > at_rest + 0.01


def test_capstan():
    radius, friction, pull, leg = 10e-3, 0.3, 0.1, 10e-3
    total = 2 * leg + math.pi * radius

    def over(t):
        s = t * total
        phi = np.clip((s - leg) / radius, 0.0, np.pi)
        x, y = -radius * np.cos(phi), radius * np.sin(phi)
        y = np.where(s < leg, s - leg, np.where(phi >= np.pi, leg + np.pi * radius - s, y))
        return np.stack([x, y, 0 * s], axis=-1)

    rope = OpenYarn(
        total,
        1e-9,
        TensionLaw([0.0, 0.1], [0.0, 100.0]),
        40,
        shape=over,
        start_force=(0.0, -pull, 0.0),
        end=Support("hinged", moved_to=(radius, -leg - 2e-3, 0.0)),
    )
    rigid = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), radius, 1e3)
    state = solve_open([rope], cylinders=[rigid], friction=friction, steps=40, coarse=True)
    ratio = -state.reaction(0, "end")[1] / pull
    assert ratio == pytest.approx(math.exp(friction * math.pi), rel=5e-3)
    assert state.lost > 0.0
    # Without friction the tension is the same on both sides, and the cylinder carries both.
    smooth = solve_open([rope], cylinders=[rigid], steps=10, coarse=True)
    assert -smooth.reaction(0, "end")[1] / pull == pytest.approx(1.0, rel=2e-3)
    assert smooth.cylinder_force()[:, 1].sum() == pytest.approx(2.0 * pull, rel=1e-3)


def test_two_yarns_crossing():
    d, half = 1e-3, 10e-3
    law = TensionLaw([0.0, 0.1], [0.0, 10.0])

    def along(t):
        return np.stack([half * (2 * t - 1), 0 * t, 0 * t], axis=-1)

    def across(t):
        return np.stack([0 * t, half * (2 * t - 1), 0 * t + d], axis=-1)

    one = OpenYarn(2 * half, 1e-9, law, 40, shape=along, start=HINGED, end=HINGED, contacts=8)
    down = [Support("hinged", moved_to=(0.0, side * half, -0.5e-3)) for side in (-1, 1)]
    two = OpenYarn(2 * half, 1e-9, law, 40, shape=across, start=down[0], end=down[1], contacts=8)
    state = solve_open([one, two], contact=BarrierContact(1000.0), diameter=d, coarse=True)
    force = state.contact_force(0, 1)
    assert force[2] < 0.0  # the upper yarn presses down
    held = [sum(state.reaction(k, end)[2] for end in ("start", "end")) for k in (0, 1)]
    assert -force[2] == pytest.approx(held[0], rel=1e-6)
    assert held[0] == pytest.approx(-held[1], rel=1e-6)
    assert state.contact_force(1, 0) == pytest.approx(-force, abs=1e-9)


def test_impossible_scenes_are_refused():
    with pytest.raises(InputError, match="support"):
        Support("glued")
    with pytest.raises(InputError, match="elements"):
        yarn(3)
    with pytest.raises(InputError, match="yarns"):
        solve_open([])

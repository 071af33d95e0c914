"""Exact answers for contacts against independent routes: force balances, the tail's equation,
collocation and a polygon whose energy is minimised outside the cylinder."""

import math

import mpmath
import numpy as np
import pytest
from oracles import contacts
from scipy.optimize import minimize

from knitsim.errors import InputError
from knitsim.verification import exact_contacts, exact_rods

mp = mpmath.mp.clone()
mp.dps = 30


def test_capstan():
    assert exact_contacts.capstan(0.3, math.pi) == pytest.approx(2.5663323952, abs=5.1e-11)
    chain = contacts.capstan_chain(0.3, np.full(16, math.pi / 16))
    assert 100 * (chain / 2.5663323952 - 1) == pytest.approx(0.33, abs=0.005)
    assert contacts.capstan_chain(0.0, [0.4, 0.2]) == 1.0


def test_capstan_chain_against_equilibrium_of_its_nodes():
    turns, friction, tension = [0.3, 0.9, 0.0, 0.5], 0.4, 1.0
    heading = 0.0
    for turn in turns:
        # Unknown T2 and N of T2 e_out - T1 e_in + N n - mu N t = 0.
        enter = np.array([math.cos(heading), math.sin(heading)])
        heading += turn
        leave = np.array([math.cos(heading), math.sin(heading)])
        along = (enter + leave) / np.linalg.norm(enter + leave)
        outward = np.array([along[1], -along[0]])
        matrix = np.column_stack([leave, outward - friction * along])
        tension = np.linalg.solve(matrix, tension * enter)[0]
    assert contacts.capstan_chain(friction, turns) == pytest.approx(tension, rel=1e-14)


def test_capstan_chain_converges_at_second_order():
    friction, turn = 0.3, 4.0
    smooth = exact_contacts.capstan(friction, turn)
    error = [contacts.capstan_chain(friction, np.full(n, turn / n)) / smooth - 1 for n in (50, 100)]
    assert error[0] / error[1] == pytest.approx(4.0, abs=0.01)
    leading = friction * (1 + friction**2) * turn**3 / 12 / 100**2
    assert error[1] == pytest.approx(leading, rel=0.01)


def test_light_wrap_is_one_point_and_the_kinds_meet():
    tension, rigidity, radius = 0.02, 5e-9, 0.4e-3
    limit = exact_contacts.lift_off_turn(tension, rigidity, radius)
    below = exact_contacts.wrapped_yarn(tension, rigidity, radius, limit * (1 - 1e-9))
    above = exact_contacts.wrapped_yarn(tension, rigidity, radius, limit * (1 + 1e-9))
    assert (below.kind, above.kind) == ("point", "line")
    assert below.point_force == pytest.approx(2 * above.point_force, rel=1e-8)
    assert below.curvature == pytest.approx(above.curvature, rel=1e-8)
    assert above.contact_angle < 1e-8
    limp = exact_contacts.wrapped_yarn(tension, 0.0, radius, 2.0)
    assert limp.lift_off_turn == limp.point_force == 0.0
    assert limp.pressure == pytest.approx(tension / radius, rel=1e-15)


WRAP = {"tension": 1.0, "rigidity": 0.3, "radius": 1.0}


def contact_sum(angle, radius, normal, friction=0.0):
    """Resultant, tail to tail, of line forces normal(a) and friction times them over an arc centred
    on the y axis; a counts from the low-tension end.  Friction acts towards that end."""
    node, weight = np.polynomial.legendre.leggauss(40)
    a = 0.5 * angle * (node + 1)
    place = a - 0.5 * angle  # from the y axis, clockwise positive
    out = np.column_stack([np.sin(place), np.cos(place)])
    back = np.column_stack([-np.cos(place), np.sin(place)])
    force = normal(a)[:, None] * (out + friction * back)
    return radius * 0.5 * angle * weight @ force


def test_line_contact_is_in_equilibrium():
    turn = 2.6
    found = exact_contacts.wrapped_yarn(turn=turn, **WRAP)
    assert found.kind == "line"
    pressed = contact_sum(found.contact_angle, 1.0, lambda a: np.full_like(a, found.pressure))
    ends = 2 * found.point_force * math.cos(0.5 * found.contact_angle)
    assert pressed == pytest.approx([0, found.total - ends], abs=1e-14)
    assert found.total == pytest.approx(2 * math.sin(0.5 * turn), rel=1e-15)


def tail_points(found, count=4001, length=12.0):
    """The right tail of a wrapped yarn (T = 1, EI = 0.3, axis at the origin), by Simpson's rule."""
    s = np.linspace(0, length, count)
    theta = contacts.tail_angle(1.0, 0.3, found.tail_turn, s)
    heading = theta - found.tail_turn - 0.5 * found.contact_angle
    d = np.column_stack([np.cos(heading), np.sin(heading)])
    h = s[1] - s[0]
    steps = h / 3 * (d[:-2:2] + 4 * d[1:-1:2] + d[2::2])
    half = 0.5 * found.contact_angle
    start = np.array([math.sin(half), math.cos(half)])
    return start + np.vstack([[0, 0], np.cumsum(steps, axis=0)]), s, theta


@pytest.mark.parametrize("turn", [0.5, 1.1, 2.6])
def test_tail_leaves_the_cylinder_and_obeys_its_equation(turn):
    found = exact_contacts.wrapped_yarn(turn=turn, **WRAP)
    points, s, theta = tail_points(found)
    assert np.linalg.norm(points, axis=1).min() > 1 - 1e-12
    h = s[1] - s[0]
    bend = 0.3 * (theta[2:] - 2 * theta[1:-1] + theta[:-2]) / h**2
    assert bend == pytest.approx(np.sin(theta[1:-1]), abs=0.1 * h**2 + 1e-9)
    assert (theta[0] - theta[1]) / h == pytest.approx(found.curvature, rel=5 * h)


def test_a_point_contact_above_the_limit_would_cut_the_cylinder():
    limit = exact_contacts.lift_off_turn(**WRAP)
    for turn, sign in ((0.99 * limit, 1), (1.01 * limit, -1)):
        curve = exact_contacts.WrappedYarn("point", limit, 0, 0, 0, 0, 0, 0, 0.5 * turn)
        radius = np.linalg.norm(tail_points(curve)[0][1:], axis=1)
        assert sign * (radius.min() - 1) > 1e-8


def brute_force_wrap(turn, nodes, h, rigidity=0.3):
    """Half a polygonal yarn on a unit cylinder, its energy minimised under |r| >= 1 at every node:
    contact force at each node, 0 where it does not touch; h: the length of an edge."""
    pull = np.array([math.cos(turn / 2), -math.sin(turn / 2)])

    def points(z):
        steps = h * np.column_stack([np.cos(z[1:]), -np.sin(z[1:])])
        return np.vstack([[0, z[0]], [0, z[0]] + np.cumsum(steps, axis=0)])

    def energy(z):
        bend = rigidity / h * (z[1] ** 2 + np.sum(np.diff(z[1:]) ** 2) / 2)
        return bend - points(z)[-1] @ pull

    def gradient(z):
        moment = rigidity / h * np.diff(z[1:])
        out = np.zeros(nodes + 1)
        out[0] = -pull[1]
        out[1] = 2 * rigidity / h * z[1]
        out[2:] += moment
        out[1:-1] -= moment
        out[1:] += h * (np.sin(z[1:]) * pull[0] + np.cos(z[1:]) * pull[1])
        return out

    def room(z):
        return (np.sum(points(z) ** 2, axis=1) - 1) / 2

    def room_slopes(z):
        r = points(z)
        out = np.zeros((nodes + 1, nodes + 1))
        out[:, 0] = r[:, 1]
        turned = -h * (np.outer(r[:, 0], np.sin(z[1:])) + np.outer(r[:, 1], np.cos(z[1:])))
        out[:, 1:] = np.tril(turned, -1)
        return out

    s = (np.arange(nodes) + 0.5) * h
    guess = np.concatenate([[1.05], np.minimum(turn / 2, s / 1.1)])
    bound = {"type": "ineq", "fun": room, "jac": room_slopes}
    found = minimize(
        energy,
        guess,
        jac=gradient,
        constraints=[bound],
        method="SLSQP",
        options={"maxiter": 400, "ftol": 1e-14},
    )
    assert found.success
    touching = room(found.x) < 1e-7
    force = np.zeros(nodes + 1)
    slopes = room_slopes(found.x)[touching].T
    force[touching] = np.linalg.lstsq(slopes, gradient(found.x), rcond=None)[0]
    return force


@pytest.mark.slow
def test_line_contact_against_constrained_minimisation():
    """Pressure, point forces and lift-off of the polygon converge at second order."""
    turn, errors = 2.6, []
    found = exact_contacts.wrapped_yarn(turn=turn, **WRAP)
    # The exact lift-off lies in the middle of an edge of the polygon.
    for edge in (3, 7):
        h = 0.5 * found.contact_angle / (edge + 0.5)
        nodes = round(8.0 / h)
        force = brute_force_wrap(turn, nodes, h)
        assert np.flatnonzero(force).tolist() == list(range(edge + 2))
        assert np.all(force >= 0)
        # What the last nodes carry beyond the pressure on their piece of yarn.
        end = force[edge:].sum() - found.pressure * h
        errors.append([force[1] / h / found.pressure - 1, end / found.point_force - 1])
    order = np.log(np.divide(*errors)) / math.log(7.5 / 3.5)
    assert np.all(order > 1.9)
    assert np.all(np.abs(errors[1]) < 2e-3)


@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_stiff_capstan_is_in_equilibrium(friction):
    turn = math.pi
    high = exact_contacts.capstan_stiff(friction, turn=turn, **WRAP)
    betas = [0.5 * exact_contacts.lift_off_turn(t, 0.3, 1.0) for t in (1.0, high)]
    angle = turn - sum(betas)
    start = math.cos(betas[0]) + friction * math.sin(betas[0])
    pressed = contact_sum(angle, 1.0, lambda a: start * np.exp(friction * a), friction)
    for tension, beta, side in ((1.0, betas[0], -1), (high, betas[1], 1)):
        place = side * 0.5 * angle
        out = np.array([math.sin(place), math.cos(place)])
        back = np.array([-math.cos(place), math.sin(place)])
        pressed = pressed + tension * math.sin(beta) * (out + friction * back)
        heading = place + side * beta
        pressed = pressed + side * tension * np.array([math.cos(heading), -math.sin(heading)])
    assert pressed == pytest.approx([0, 0], abs=1e-13 * high)


def test_stiff_capstan_limits():
    limp = exact_contacts.capstan_stiff(0.3, 2.0, 0.0, 1e-3, math.pi)
    assert limp == pytest.approx(2.0 * math.exp(0.3 * math.pi), rel=1e-14)
    assert exact_contacts.capstan_stiff(0.0, turn=2.0, **WRAP) == 1.0


def test_pressed_yarns_of_small_approach_are_springs_in_series():
    rigidity, length = (5e-9, 2e-8), (4e-3, 6e-3)
    found = contacts.pressed_yarns(1e-8, rigidity, length)
    springs = [
        exact_contacts.span_stiffness(b, span) for b, span in zip(rigidity, length, strict=True)
    ]
    assert springs[0] == pytest.approx(48 * 5e-9 / 4e-3**3, rel=1e-14)
    # Corrections of the order (approach/length)^2.
    assert found.force == pytest.approx(1e-8 / (1 / springs[0] + 1 / springs[1]), rel=1e-10)
    assert sum(found.deflections) == pytest.approx(1e-8, rel=1e-13)


def pressed_curves(rigidity, length, found):
    """Right halves of the two centre lines from collocation: (along, towards the other's side)."""
    rods = []
    for b, span in zip(rigidity, length, strict=True):
        load = found.force * (span / 2) ** 2 / (2 * b)
        rods.append(exact_rods.clamped_rod(force=(0, -load)))
    return [rod.points * span / 2 for rod, span in zip(rods, length, strict=True)], rods


def test_pressed_yarns_of_large_approach():
    rigidity, length, approach = (5e-9, 2e-8), (4e-3, 6e-3), 2.2e-3
    found = contacts.pressed_yarns(approach, rigidity, length)
    _, rods = pressed_curves(rigidity, length, found)
    deflections = [-rod.displacement[1] * span / 2 for rod, span in zip(rods, length, strict=True)]
    assert found.deflections == pytest.approx(deflections, rel=1e-11)
    assert sum(deflections) == pytest.approx(approach, rel=1e-11)
    curvatures = [-rod.root_moment * 2 / span for rod, span in zip(rods, length, strict=True)]
    assert found.curvatures == pytest.approx(curvatures, rel=1e-11)


@pytest.mark.parametrize("angle", [0.5 * math.pi, 0.9])
def test_pressed_yarns_touch_in_one_point_up_to_the_stated_limit(angle):
    rigidity, length, approach = (5e-9, 8e-9), (4e-3, 4e-3), 1.2e-3
    found = contacts.pressed_yarns(approach, rigidity, length)
    (a, b), _ = pressed_curves(rigidity, length, found)
    # The distance d at which the condition on the curvatures is just met: its smaller root.
    ka, kb = found.curvatures
    limit = np.roots([ka * kb, -(ka + kb), math.sin(angle) ** 2]).min()
    for factor, one_point in ((0.98, True), (1.02, False)):
        d = factor * limit
        # Nodes near the middle, all pairs; the same and opposite sides of the crossing.
        near = a[a[:, 0] < 0.15 * d][:, None, :], b[b[:, 0] < 0.15 * d][None, :, :]
        height = d + near[0][..., 1] + near[1][..., 1]
        p, q = near[0][..., 0], near[1][..., 0]
        square = p**2 + q**2 - 2 * p * q * math.cos(angle) + height**2
        assert bool(np.all(square > d**2)) == one_point
        assert found.touch_at_a_point(d, angle) == one_point


@pytest.mark.parametrize("ends", ["hinged", "clamped"])
@pytest.mark.parametrize("tension", [1e-6, 3e-6, 1.2e-5, 3e-5, 0.02, 1.0])
def test_span_stiffness_against_the_beam_equation(ends, tension):
    # w = a + b x + c cosh(k x) + e sinh(k x) on half the span, unit force at x = 0.
    span, rigidity = mp.mpf("4e-3"), mp.mpf("5e-9")
    t = mp.mpf(tension)
    k, half = mp.sqrt(t / rigidity), span / 2
    far = [1, half, mp.cosh(k * half), mp.sinh(k * half)]
    last = (
        [0, 0, k**2 * mp.cosh(k * half), k**2 * mp.sinh(k * half)]
        if ends == "hinged"
        else [0, 1, k * mp.sinh(k * half), k * mp.cosh(k * half)]
    )
    matrix = mp.matrix([[0, 1, 0, k], far, last, [0, -t, 0, 0]])
    # Shear EI w''' - T w' at the middle carries half the force.
    solution = mp.lu_solve(matrix, mp.matrix([0, 0, 0, mp.mpf(1) / 2]))
    found = exact_contacts.span_stiffness(5e-9, 4e-3, tension, ends)
    assert found == pytest.approx(float(1 / (solution[0] + solution[2])), rel=1e-12)


@pytest.mark.parametrize(
    "call",
    [
        lambda: exact_contacts.capstan(-0.1, 1.0),
        lambda: exact_contacts.wrapped_yarn(1.0, 5.0, 1.0, 3.2),
        lambda: exact_contacts.wrapped_yarn(0.4, 1.0, 1.0, 6.0),
        lambda: exact_contacts.wrapped_yarn(1.0, 0.3, 1.0, 0.0),
        lambda: exact_contacts.capstan_stiff(0.3, 1.0, 0.3, 1.0, 1.0),
        lambda: exact_contacts.span_stiffness(5e-9, 4e-3, -1.0),
    ],
)
def test_bad_input_is_refused(call):
    with pytest.raises(InputError) as refusal:
        call()
    assert "\n" not in str(refusal.value)

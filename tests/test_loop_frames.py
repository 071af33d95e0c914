"""Frames against the helix's closed form, a naive transport and finite rotations."""

import itertools
import math

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.loop.build import build_loop
from knitsim.loop.centreline import periodic_spline
from knitsim.loop.frames import line_frames, loop_frames, rotation_minimising_frames
from knitsim.loop.frames_kernels import fibres_of_states, frames_of_states

COTTON = (1e-2 / 6.67, 1e-2 / 8.33, 0.2793e-3, 5.56e-3)


def helix(sections, radius=1.0, pitch=2.0):
    """Sections of one turn about the course axis, right-handed: points, tangents, arc, period."""
    a = 2 * np.pi * np.arange(sections) / sections
    b = pitch / (2 * np.pi)
    points = np.stack([b * a, radius * np.cos(a), radius * np.sin(a)], axis=-1)
    tangents = np.stack([b + 0 * a, -radius * np.sin(a), radius * np.cos(a)], axis=-1)
    length = 2 * np.pi * math.hypot(radius, b)
    arc = length * np.arange(sections + 1) / sections
    return points, tangents, arc, np.array([pitch, 0.0, 0.0])


def lopsided_spline():
    s = np.arange(401) / 400
    a = 2 * np.pi * s
    course = s - 0.12 * np.sin(2 * a + 0.3) + 0.02 * np.cos(3 * a)
    wale = 0.5 * np.cos(a) - 0.1 * np.sin(2 * a + 1.0)
    thickness = 0.2 * np.sin(2 * a) + 0.15 * np.cos(a + 0.5)
    points = np.stack([course, wale, thickness], axis=-1)
    points[-1] = points[0] + (1.0, 0.0, 0.0)
    return periodic_spline(points)


def naive_turn(vector, tangents):
    """Carry a vector along unit tangents by the smallest rotation from each to the next."""
    for one, two in itertools.pairwise(tangents):
        axis = np.cross(one, two)
        sine, cosine = np.linalg.norm(axis), one @ two
        if sine > 0:
            axis = axis / sine
            vector = (
                cosine * vector + sine * np.cross(axis, vector)
                + (1 - cosine) * (axis @ vector) * axis
            )  # fmt: skip
    return vector


def angle_about(tangent, one, two):
    """Right-handed angle about the tangent from one to two, both perpendicular to it."""
    return math.atan2(np.cross(one, two) @ tangent, one @ two)


def test_holonomy_of_a_helix_is_minus_its_total_torsion_at_fourth_order():
    radius, pitch = 1.0, 2.0
    b = pitch / (2 * np.pi)
    exact = -2 * np.pi * b / math.hypot(radius, b)  # the Frenet frame comes back to itself
    errors = []
    for sections in (25, 50, 100, 200):
        holonomy = rotation_minimising_frames(*helix(sections, radius, pitch)).holonomy
        errors.append(abs(math.remainder(holonomy - exact, 2 * np.pi)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] > 1e-12
    assert errors[2] < 1e-5
    np.testing.assert_allclose(orders, 4.0, atol=0.1)


def test_frames_turn_least_at_fourth_order_along_a_lopsided_curve():
    # Reference: the naive transport, second order, on 200 and 400 times as many sections, refined.
    spline = lopsided_spline()
    places = 5
    turns = []
    for sections in (4000, 8000):
        u, _ = spline.sections(sections)
        tangents = spline.tangents(np.concatenate([u, [1.0]]))
        start = np.cross(tangents[0], (0.0, 0.0, 1.0))
        start /= np.linalg.norm(start)
        step = sections // places
        carried = [start]
        for k in range(places):
            carried.append(naive_turn(carried[-1], tangents[k * step : (k + 1) * step + 1]))
        turns.append(np.array(carried))
    finest = (4 * turns[1] - turns[0]) / 3
    total = angle_about(tangents[0], finest[0], finest[-1])
    errors = []
    for sections in (50, 100, 200):
        u, arc = spline.sections(sections)
        frames = rotation_minimising_frames(
            spline.points(u), spline.derivative(u), arc, spline.period
        )
        pick = np.arange(places) * sections // places
        # Undo the closing turn, which is spread along the arc length.
        error = abs(frames.holonomy - total)
        offset = angle_about(frames.tangents[0], finest[0], frames.normals[0])
        for k, i in enumerate(pick):
            t, fine = frames.tangents[i], finest[k]
            closing = -frames.holonomy * arc[i] / arc[-1]
            turn = angle_about(t, fine, frames.normals[i]) - offset - closing
            error = max(error, abs(math.remainder(turn, 2 * np.pi)))
        errors.append(error)
    assert abs(total) > 0.1  # the closing turn is put to the test
    assert errors[1] < 1e-3
    assert math.log2(errors[0] / errors[1]) > 3.5
    assert math.log2(errors[1] / errors[2]) > 3.5


def test_frames_close_over_the_period_without_a_jump():
    spline = lopsided_spline()
    u, arc = spline.sections(200)
    frames = rotation_minimising_frames(spline.points(u), spline.derivative(u), arc, spline.period)
    # Against the least turn from section to section each frame turns the same, the last included.
    normals = np.concatenate([frames.normals, frames.normals[:1]])
    fine, _ = spline.sections(200 * 20)
    tangents = spline.tangents(np.concatenate([fine, [1.0]]))
    turns = []
    for i in range(200):
        carried = naive_turn(normals[i], tangents[20 * i : 20 * i + 21])
        turns.append(angle_about(tangents[20 * i + 20], carried, normals[i + 1]))
    assert abs(frames.holonomy) > 0.1
    np.testing.assert_allclose(turns, -frames.holonomy / 200, rtol=1e-3)


@pytest.mark.parametrize("twist", [0.0, 400.0, -650.0])
def test_sections_are_perpendicular_to_the_axis(twist):
    loop = build_loop(*COTTON)
    frames = loop_frames(loop, 100, twist)
    u, _ = loop.sections(100)
    direction = loop.derivative(u)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    assert np.abs((frames.normals * direction).sum(axis=1)).max() < 1e-10
    assert np.abs((frames.binormals * direction).sum(axis=1)).max() < 1e-10
    np.testing.assert_allclose(
        np.cross(frames.tangents, frames.normals), frames.binormals, atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.norm(frames.normals, axis=1), 1, atol=1e-14)


def test_a_mirrored_loop_needs_no_closing_turn():
    assert abs(loop_frames(build_loop(*COTTON)).holonomy) < 1e-12


@pytest.mark.parametrize("twist", [300.0, -300.0])
def test_twist_turns_z_right_handed_about_the_axis(twist):
    # A straight yarn along the course: the fibre is a helix that can be written down.
    x = np.arange(50) * 1e-4
    points = np.stack([x, 0 * x, 0 * x], axis=-1)
    tangents = np.broadcast_to([2.0, 0.0, 0.0], (50, 3))
    frames = rotation_minimising_frames(
        points, tangents, np.arange(51) * 1e-4, [50e-4, 0, 0], twist
    )
    assert frames.holonomy == 0.0
    fibre = frames.fibre_points([[1e-4, 0.0]])[:, 0]
    angle = np.arctan2(fibre[:, 2], fibre[:, 1])  # right-handed about the course axis
    steps = np.remainder(np.diff(angle) + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_allclose(steps, 2 * np.pi * twist * 1e-4, atol=1e-12)
    assert frames.turn_per_loop == pytest.approx(2 * np.pi * twist * 50e-4)


def test_twist_comes_on_top_of_the_least_turn():
    loop = build_loop(*COTTON)
    plain, twisted = loop_frames(loop, 60), loop_frames(loop, 60, 500.0)
    for i in range(60):
        turn = angle_about(plain.tangents[i], plain.normals[i], twisted.normals[i])
        assert math.remainder(turn - 2 * np.pi * 500 * plain.arc[i], 2 * np.pi) == pytest.approx(
            0, abs=1e-11
        )


def test_fibre_points_lie_in_their_sections():
    loop = build_loop(*COTTON)
    frames = loop_frames(loop, 30, 400.0)
    layout = np.random.default_rng(1).normal(scale=1e-4, size=(7, 2))
    fibres = frames.fibre_points(layout)
    assert fibres.shape == (30, 7, 3)
    for i in range(30):
        for j, (x, y) in enumerate(layout):
            written = frames.points[i] + x * frames.normals[i] + y * frames.binormals[i]
            np.testing.assert_allclose(fibres[i, j], written, atol=1e-18)
            off = fibres[i, j] - frames.points[i]
            assert abs(off @ frames.tangents[i]) < 1e-10 * np.hypot(x, y)
            assert np.linalg.norm(off) == pytest.approx(np.hypot(x, y), rel=1e-12)


def test_kernels_over_states_do_what_single_calls_do():
    loop = build_loop(*COTTON)
    u, arc = loop.sections(40)
    layout = np.random.default_rng(2).normal(scale=1e-4, size=(5, 2))
    stretches = np.array([[1, 1, 1], [1.3, 0.8, 1], [0.7, 1.2, 1.1]])
    points = loop.points(u) * stretches[:, None]
    tangents = loop.derivative(u) * stretches[:, None]
    tangents /= np.linalg.norm(tangents, axis=2)[..., None]
    periods = loop.spline.period * stretches
    normals, binormals = np.empty_like(points), np.empty_like(points)
    holonomy = np.empty(3)
    twist = 2 * np.pi * 400.0
    frames_of_states(points, tangents, arc, periods, twist, normals, binormals, holonomy)
    out = np.empty((3, 40, 5, 3))
    fibres_of_states(points, normals, binormals, layout, out)
    for k in range(3):
        single = rotation_minimising_frames(points[k], tangents[k], arc, periods[k], 400.0)
        np.testing.assert_allclose(normals[k], single.normals, atol=1e-14)
        np.testing.assert_allclose(binormals[k], single.binormals, atol=1e-14)
        np.testing.assert_allclose(out[k], single.fibre_points(layout), atol=1e-17)


def change(index, value):
    arguments = list(helix(20))
    arguments[index] = value(arguments[index])
    return arguments


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (change(0, lambda x: x[:2]), "points and tangents"),
        (change(1, lambda x: x[:, :2]), "points and tangents"),
        (change(2, lambda x: x[:-1]), "points and tangents"),
        (change(2, lambda x: x[::-1]), "rise from 0"),
        (change(0, lambda x: np.repeat(x[::2], 2, axis=0)), "coincide"),
        (change(1, lambda x: x * (np.arange(20) != 3)[:, None]), "direction"),
        (change(3, lambda x: x * np.nan), "finite"),
    ],
)
def test_refuses_sections_that_do_not_fit(arguments, says):
    with pytest.raises(InputError, match=says):
        rotation_minimising_frames(*arguments)


def test_refuses_a_layout_that_is_not_plane():
    with pytest.raises(InputError, match="fibre layout"):
        loop_frames(build_loop(*COTTON), 10).fibre_points(np.zeros((4, 3)))


def test_frames_of_an_open_line_are_carried_without_turning():
    """Against the smallest rotations over 20,000 pieces; second order, as are the chords' tangents."""
    spline = lopsided_spline()
    u = np.linspace(0.0, 1.0, 20_001)
    fine = spline.derivative(u)
    fine /= np.linalg.norm(fine, axis=1)[:, None]
    off = []
    for pieces in (100, 200, 400):
        points = spline.points(np.linspace(0.0, 1.0, pieces + 1))
        tangents, normals = line_frames(points)
        assert np.abs((tangents * normals).sum(1)).max() < 1e-14
        assert np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() < 1e-14
        start = normals[0] - normals[0] @ fine[0] * fine[0]
        carried = naive_turn(start / np.linalg.norm(start), fine)
        off.append(abs(angle_about(fine[-1], carried, normals[-1])))
    assert off[0] < 0.02 and 3.0 < off[0] / off[1] and 3.0 < off[1] / off[2]


def test_frames_survive_a_hairpin_and_a_line_along_the_thickness():
    turned = [(0, 0, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0)]
    for points in (turned, [(0, 0, 0), (0, 0, 1), (0, 1, 1)]):
        tangents, normals = line_frames(np.array(points, dtype=float))
        assert np.isfinite(normals).all() and np.isfinite(tangents).all()
        assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
        assert (tangents * normals).sum(1) == pytest.approx(0.0, abs=1e-12)

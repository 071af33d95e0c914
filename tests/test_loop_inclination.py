"""Eqs (2) and (3) as printed: how far the sections miss the tangent."""

import math

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.loop.choi_lo import choi_lo
from knitsim.loop.frames import rotation_minimising_frames
from knitsim.loop.inclination import ORDERS, angle_error, backward_share, inclined_frames

COTTON = choi_lo(1e-2 / 6.67, 1e-2 / 8.33, 0.2793e-3, 1.0)
# Directions at the middles of 2000 equal steps of the curve's own parameter.
DIRECTIONS = COTTON.derivative((np.arange(2000) + 0.5) / 1000)


@pytest.mark.parametrize("order", ORDERS)
def test_error_for_equal_steps_along_all_axes(order):
    # Both angles are 45 deg: the normal is (1/2, 1/2, 1/sqrt 2) in some order.
    exact = math.acos((0.5 + 0.5 + math.sqrt(0.5)) / math.sqrt(3))
    assert angle_error(np.array([1.0, 1.0, 1.0]), order) == pytest.approx(exact, abs=1e-12)
    assert math.degrees(exact) == pytest.approx(9.7, abs=0.05)


@pytest.mark.parametrize("order", ORDERS)
def test_no_error_in_the_planes_of_the_two_angles(order):
    angle = np.linspace(-1.4, 1.4, 9)
    nil = np.zeros_like(angle)
    for plane in ((np.cos(angle), np.sin(angle), nil), (np.cos(angle), nil, np.sin(angle))):
        assert angle_error(np.stack(plane, axis=-1), order).max() < 1e-14


@pytest.mark.parametrize(("order", "median"), [("zx_first", 47), ("zy_first", 19)])
def test_median_error_on_the_cotton_loop(order, median):
    error = np.degrees(angle_error(DIRECTIONS, order))
    assert np.median(error) == pytest.approx(median, abs=0.5)
    # Every section that runs backwards is flipped: more than a right angle off.
    assert (error[DIRECTIONS[:, 0] < 0] > 90).all()
    assert (error[DIRECTIONS[:, 0] > 0] < 90).all()


def test_share_of_the_parameter_that_runs_backwards():
    assert backward_share(DIRECTIONS) == pytest.approx(1 - 2 * COTTON.b1, abs=1e-3)
    assert backward_share(DIRECTIONS) == pytest.approx(0.43, abs=0.005)


@pytest.mark.parametrize("order", ORDERS)
def test_inclined_sections_by_turning_one_axis_after_the_other(order):
    points = COTTON.points(np.arange(80) / 40)
    arc = np.arange(81) * 5.5e-3 / 80
    period = np.array([COTTON.wale_spacing, 0.0, 0.0])
    frames = inclined_frames(points, arc, period, order=order)
    for i in range(80):
        step = points[i] - (points[i - 1] if i else points[-1] - period)
        zx, zy = math.atan(step[2] / step[0]), math.atan(step[1] / step[0])

        def about_wale(v, zx=zx):
            return np.array([
                v[0] * math.cos(zx) - v[2] * math.sin(zx), v[1],
                v[0] * math.sin(zx) + v[2] * math.cos(zx),
            ])  # fmt: skip

        def about_thickness(v, zy=zy):
            return np.array([
                v[0] * math.cos(zy) - v[1] * math.sin(zy),
                v[0] * math.sin(zy) + v[1] * math.cos(zy), v[2],
            ])  # fmt: skip

        turns = (
            (about_wale, about_thickness) if order == "zx_first" else (about_thickness, about_wale)
        )
        for start, found in (((1, 0, 0), frames.tangents), ((0, 0, 1), frames.normals)):
            v = np.array(start, dtype=float)
            for turn in turns:
                v = turn(v)
            np.testing.assert_allclose(found[i], v, atol=1e-14)
    np.testing.assert_allclose(
        np.cross(frames.tangents, frames.normals), frames.binormals, atol=1e-14
    )


@pytest.mark.parametrize("order", ORDERS)
def test_on_a_straight_yarn_nothing_is_lost_and_twist_is_the_same(order):
    # Along the course both constructions carry the same fibres.
    x = np.arange(30) * 1e-4
    points = np.stack([x, 0 * x, 0 * x], axis=-1)
    arc, period = np.arange(31) * 1e-4, np.array([30e-4, 0, 0])
    printed = inclined_frames(points, arc, period, 250.0, order)
    right = rotation_minimising_frames(
        points, np.broadcast_to([1.0, 0.0, 0.0], (30, 3)), arc, period, 250.0
    )
    layout = np.array([[1e-4, 2e-5], [-3e-5, 4e-5]])
    np.testing.assert_allclose(printed.fibre_points(layout), right.fibre_points(layout), atol=1e-17)


def test_where_the_course_coordinate_rests_the_section_still_has_a_direction():
    for order in ORDERS:
        error = angle_error(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]), order)
        assert np.isfinite(error).all()


def test_refuses_an_unknown_order():
    with pytest.raises(InputError, match="zx_first, zy_first"):
        angle_error(np.ones(3), "both")

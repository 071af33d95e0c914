"""Fabric from one loop: its images against bending, or laying out, the whole fabric at once."""

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.kinematic.bending import bending_test, bent_points
from knitsim.loop.repeat import bent_courses, fabric_courses, rolled

WIDE, HIGH = 4, 3


@pytest.fixture(scope="module")
def line(cotton_loop):
    """One loop as a polyline, its last point the first one of the next loop."""
    return cotton_loop.points(np.arange(41) / 40)


def whole_fabric(loop, line):
    """Courses (m, 3) of a flat fabric, every point from its own place along the spline."""
    return [
        np.array([
            line[i % 40] + [(i // 40) * loop.wale_spacing, row * loop.course_spacing, 0.0]
            for i in range(40 * WIDE + 1)
        ])
        for row in range(HIGH)
    ]  # fmt: skip


def test_courses_run_on_through_every_loop(cotton_loop, line):
    spacings = cotton_loop.wale_spacing, cotton_loop.course_spacing
    courses = fabric_courses(line, *spacings, WIDE, HIGH)
    for course, expected in zip(courses, whole_fabric(cotton_loop, line), strict=True):
        assert course == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("direction", ["course", "wale"])
@pytest.mark.parametrize("curvature", [-250.0, -1e-6, 0.0, 1e-6, 250.0])
def test_images_are_the_fabric_bent_as_a_whole(cotton_loop, cotton_law, line, direction, curvature):
    curve = bending_test(
        cotton_loop, cotton_law, direction, np.array([curvature]), np.array([False])
    )
    spacings = cotton_loop.wale_spacing, cotton_loop.course_spacing
    axis = ("course", "wale").index(direction)
    courses = bent_courses(bent_points(curve, line)[0], *spacings, WIDE, HIGH, curvature, axis)
    for course, flat in zip(courses, whole_fabric(cotton_loop, line), strict=True):
        assert np.abs(course - bent_points(curve, flat)[0]).max() < 1e-14


def test_rolling_without_curvature_shifts_and_a_full_turn_closes():
    points = np.array([[0.1, 0.2, 0.3], [0.4, -0.1, 0.2]])
    assert np.array_equal(rolled(points, 0.0, 2.0, 0), points + [2.0, 0.0, 0.0])
    assert np.array_equal(rolled(points, 0.0, 2.0, 1), points + [0.0, 2.0, 0.0])
    assert rolled(points, 0.5, 2.0 * np.pi / 0.5, 1) == pytest.approx(points, abs=1e-14)
    # A quarter of the circle of radius 2 about the axis at thickness -2.
    quarter = rolled(np.zeros((1, 3)), 0.5, 0.5 * np.pi / 0.5, 0)
    assert quarter == pytest.approx(np.array([[2.0, 0.0, -2.0]]), abs=1e-14)


def test_the_thickness_is_no_bent_direction():
    with pytest.raises(InputError, match="axis"):
        rolled(np.zeros((3, 3)), 1.0, 1.0, 2)

"""The paper's pure bending: exactness of the corrected form, what is wrong with the printed one."""

import numpy as np
import pytest
from conftest import COTTON

from knitsim.errors import InputError
from knitsim.kinematic.bending import (
    bending_test,
    bent_points,
    fibre_points,
    middle_height,
    sweep,
)

DIRECTIONS = pytest.mark.parametrize(("direction", "axis"), [("course", 0), ("wale", 1)])


def run(loop, law, direction, curvature, **options):
    curvature = np.asarray(curvature, dtype=float)
    return bending_test(loop, law, direction, curvature, np.zeros(curvature.size, bool), **options)


def naive_bend(point, kappa, axis):
    """Corrected eqs (6)-(9) as they are written, for kappa not 0."""
    s, x0 = point[axis], point[2]
    theta = kappa * s
    bent = point.copy()
    bent[axis] = np.sin(theta) / kappa + x0 * np.sin(theta)
    bent[2] = -(1 - np.cos(theta)) / kappa + x0 * np.cos(theta)
    return bent


@DIRECTIONS
def test_positions_against_the_written_equations(cotton_loop, cotton_law, direction, axis):
    curvature = np.array([-250.0, -30.0, 1.0, 100.0, 250.0])
    curve = run(cotton_loop, cotton_law, direction, curvature)
    points = cotton_loop.points(np.linspace(0, 3, 50))
    bent = bent_points(curve, points)
    flat = points - [0, 0, middle_height(cotton_loop)]
    for k, kappa in enumerate(curvature):
        expected = np.array([naive_bend(point, kappa, axis) for point in flat])
        assert bent[k] == pytest.approx(expected, abs=1e-15)
        assert np.abs(bent[k] - flat).max() > 1e-6


@DIRECTIONS
@pytest.mark.parametrize("kappa", [-250.0, -1e-6, 0.0, 1e-9, 1e-3, 2.0, 250.0, 1000.0])
def test_arc_length_on_the_middle_surface_is_kept(cotton_loop, cotton_law, direction, axis, kappa):
    curve = run(cotton_loop, cotton_law, direction, [kappa])
    s = np.linspace(-5e-3, 5e-3, 2001)
    points = np.zeros((s.size, 3))
    points[:, axis], points[:, 2] = s, curve.middle
    bent = bent_points(curve, points)[0]
    chord = np.linalg.norm(np.diff(bent, axis=0), axis=1)
    # The arc of a chord on the circle of this curvature, exactly.
    arc = chord if kappa == 0 else 2 / abs(kappa) * np.arcsin(0.5 * abs(kappa) * chord)
    assert arc.sum() == pytest.approx(1e-2, rel=1e-12)
    if kappa:
        from_axis = np.hypot(bent[:, axis], bent[:, 2] + 1 / kappa)
        assert from_axis * abs(kappa) == pytest.approx(np.ones(s.size), abs=1e-12)


@DIRECTIONS
def test_no_trouble_at_zero(cotton_loop, cotton_law, direction, axis):
    curvature = np.array([-1e-9, 0.0, 1e-9])
    curve = run(cotton_loop, cotton_law, direction, curvature)
    points = cotton_loop.points(np.linspace(0, 1, 101))
    bent = bent_points(curve, points)
    flat = points - [0, 0, curve.middle]
    assert np.array_equal(bent[1], flat)
    # To first order the move is linear in the curvature: the mean of the two sides is flat.
    assert 0.5 * (bent[0] + bent[2]) == pytest.approx(flat, abs=1e-18)


@DIRECTIONS
def test_positive_curvature_makes_the_technical_face_convex(
    cotton_loop, cotton_law, direction, axis
):
    curve = run(cotton_loop, cotton_law, direction, [200.0])
    face = np.zeros((3, 3))
    face[:, axis] = [-1e-3, 0, 1e-3]
    face[:, 2] = curve.middle + 1e-4
    ends_and_middle = bent_points(curve, face)[0]
    assert ends_and_middle[1, 2] > ends_and_middle[0, 2]
    assert ends_and_middle[1, 2] > ends_and_middle[2, 2]
    # The face is the longer side.
    assert np.ptp(ends_and_middle[:, axis]) / 2e-3 > np.sin(0.2) / 0.2


@DIRECTIONS
def test_length_and_moment_against_positions_and_differences(
    cotton_loop, cotton_law, direction, axis
):
    sign = 1 if direction == "wale" else -1  # the side on which the model's yarn is stretched
    h = 1e-3
    curvature = sign * np.array([200.0 - h, 200.0, 200.0 + h])
    curve = run(cotton_loop, cotton_law, direction, curvature)
    points = bent_points(curve, cotton_loop.points(np.linspace(0, 1, 8001)))
    length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    assert length == pytest.approx(curve.yarn_length, rel=1e-7)
    area = COTTON["wale_spacing"] * COTTON["course_spacing"]
    slope = (curve.energy[2] - curve.energy[0]) / (curvature[2] - curvature[0]) / area
    assert abs(slope) > 1e-3
    assert curve.moment_per_width[1] == pytest.approx(slope, rel=1e-6)


def test_sweep_is_symmetric_and_hits_zero():
    curvature, towards_zero = sweep(250.0, 100)
    assert curvature.shape == (101,)
    assert curvature[50] == 0 and curvature[-1] == 250 and curvature[0] == -250
    assert np.array_equal(curvature, -curvature[::-1])
    assert towards_zero.sum() == 51 and towards_zero[0]
    with pytest.raises(InputError, match="steps = 7: must be even"):
        sweep(250.0, 7)


@DIRECTIONS
def test_printed_form_puts_everything_at_the_edge_and_has_no_value_at_zero(
    cotton_loop, cotton_law, direction, axis
):
    curve = run(cotton_loop, cotton_law, direction, [0.0, 1e-3, 200.0], form="printed", loops=2)
    length = 2 * COTTON[("wale", "course")[axis] + "_spacing"]
    assert curve.model_length == pytest.approx(length)
    points = cotton_loop.points(np.linspace(0.1, 0.9, 30))
    bent = bent_points(curve, points)
    assert np.isnan(bent[0][:, axis]).all() and np.isnan(bent[0][:, 2]).all()
    assert bent[1][:, axis] == pytest.approx(np.full(30, length), rel=1e-6)
    # The exact K' = 200/m * s, used as a curvature by eqs (8), (9).
    angle = 200.0 * points[:, axis]
    assert bent[2][:, axis] == pytest.approx(length * np.sin(angle) / angle, rel=1e-12)
    assert np.isnan(curve.moment_per_width).all()


@DIRECTIONS
def test_fibre_points_close_over_the_loop_and_stand_upright(
    cotton_loop, cotton_law, direction, axis
):
    curve = run(cotton_loop, cotton_law, direction, [-250.0, 0.0, 120.0])
    layout = np.array([[0.0, 0.0], [1e-4, 2e-5], [-3e-5, 5e-5]])
    points = fibre_points(cotton_loop, curve, layout, twist=250.0, sections=50)
    u, _ = cotton_loop.sections(50)
    assert points[:, :, 0] == pytest.approx(bent_points(curve, cotton_loop.points(u)), abs=1e-15)
    offset = points[:, :, 1:] - points[:, :, :1]
    h = 1e-6
    tangent = bent_points(curve, cotton_loop.points(u + h)) - bent_points(
        curve, cotton_loop.points(u - h)
    )
    tangent /= np.linalg.norm(tangent, axis=2)[..., None]
    radius = np.linalg.norm(layout[1:], axis=1)
    assert np.linalg.norm(offset, axis=3) == pytest.approx(np.broadcast_to(radius, (3, 50, 2)))
    assert np.abs(np.einsum("ksfi,ksi->ksf", offset, tangent) / radius).max() < 1e-8


def test_bad_input_is_refused(cotton_loop, cotton_law):
    with pytest.raises(InputError, match="max_curvature = 10000 per m: must be below"):
        run(cotton_loop, cotton_law, "course", [1e4])
    with pytest.raises(InputError, match="direction = bias"):
        run(cotton_loop, cotton_law, "bias", [1.0])
    with pytest.raises(InputError, match="form = as printed"):
        run(cotton_loop, cotton_law, "wale", [1.0], form="as printed")

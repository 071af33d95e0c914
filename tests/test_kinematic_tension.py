"""The paper's tensile test: lengths, contraction, virtual work and positions."""

import itertools

import numpy as np
import pytest
from conftest import COTTON
from scipy.integrate import quad
from scipy.optimize import brentq

from knitsim.errors import InputError
from knitsim.kinematic.tension import (
    Reading,
    contraction_limit,
    deformed_points,
    fibre_points,
    loop_height,
    tensile_test,
)
from knitsim.loop.build import build_loop
from knitsim.yarn.law import paper_k3


def naive_length(loop, along, across):
    """Length of the scaled loop by adaptive quadrature between the knots: the slow obvious twin."""

    def speed(u):
        return np.linalg.norm(loop.derivative(u) * [along, across, 1.0])

    knots = loop.spline.knots
    return sum(
        quad(speed, a, b, epsabs=1e-15, epsrel=1e-12)[0] for a, b in itertools.pairwise(knots)
    )


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_isometric_contraction_keeps_the_yarn_length_until_the_jam(
    cotton_loop, cotton_law, direction
):
    strains = np.linspace(0, 0.8, 41)
    curve = tensile_test(cotton_loop, cotton_law, direction, strains, Reading(), recovery=False)
    free = curve.scale_across > 0.5
    assert 5 < free.sum() < 40
    for pull, across in zip(1 + strains[free], curve.scale_across[free], strict=True):
        scales = (pull, across) if direction == "course" else (across, pull)
        assert naive_length(cotton_loop, *scales) == pytest.approx(COTTON["loop_length"], rel=1e-10)
    assert (curve.force_per_loop[free] == 0).all()
    jammed = ~free
    assert (curve.scale_across[jammed] == 0.5).all()
    scales = (1.8, 0.5) if direction == "course" else (0.5, 1.8)
    expected = naive_length(cotton_loop, *scales) / COTTON["loop_length"] - 1
    assert curve.yarn_strain[-1] == pytest.approx(expected, rel=1e-9)
    assert curve.yarn_tension[-1] == pytest.approx(94.005 * expected - 0.48942, rel=1e-9)


def test_published_numbers_of_the_loop_at_ten_per_cent():
    # Choi and Lo's curve with chi = 1: length 5.56665 mm; r = 1.1 gives +3.43 % yarn strain with no
    # contraction, and needs the wale scaled by 0.94006 to keep its length.
    loop = build_loop(**(COTTON | {"loop_length": 5.5666527e-3}), centre_line="curve")
    curve = tensile_test(loop, paper_k3(True), "course", [0, 0.1], Reading(contraction="none"))
    assert curve.yarn_strain[1] == pytest.approx(0.0343, abs=5e-5)
    curve = tensile_test(loop, paper_k3(True), "course", [0, 0.1], Reading())
    assert curve.scale_across[1] == pytest.approx(0.94006, abs=5e-6)


@pytest.mark.parametrize("direction", ["course", "wale"])
@pytest.mark.parametrize(
    "reading",
    [
        Reading(),
        Reading(contraction="linear"),
        Reading(contraction="none"),
        Reading(strain="fabric"),
        Reading(law="printed"),
        Reading(positions="printed", contraction="linear", law="printed"),
    ],
    ids=lambda r: f"{r.positions}-{r.contraction}-{r.strain}-{r.law}",
)
def test_force_is_the_derivative_of_the_energy_by_the_spacing(
    cotton_loop, cotton_law, direction, reading
):
    law = paper_k3(continuous=False) if reading.law == "printed" else cotton_law
    # Wide enough to load the yarn, and clear of the law's jump and of the jam.
    strains = np.concatenate([[0.0], 0.55 + 1e-5 * np.arange(-1, 2), [0.9]])
    curve = tensile_test(cotton_loop, law, direction, strains, reading, recovery=False)
    spacing = COTTON[f"{direction}_spacing".replace("course", "WALE").replace("wale", "course")
                     .replace("WALE", "wale")]  # fmt: skip
    slope = (curve.energy[3] - curve.energy[1]) / (2e-5 * spacing)
    if reading.contraction != "isometric":
        assert abs(slope) > 1e-3
    assert curve.force_per_loop[2] == pytest.approx(slope, rel=1e-5, abs=1e-9)


def test_force_per_width_is_over_the_transverse_spacing_of_the_start(cotton_loop, cotton_law):
    for direction, across in (("course", "course_spacing"), ("wale", "wale_spacing")):
        curve = tensile_test(cotton_loop, cotton_law, direction, [0, 0.9], Reading())
        assert curve.force_per_loop[1] > 1
        assert curve.force_per_width[1] == pytest.approx(curve.force_per_loop[1] / COTTON[across])


def test_course_limit_in_its_two_readings(cotton_loop):
    assert contraction_limit(cotton_loop, "course", "half") == 0.5
    # The loop is 1.59 courses high: taking off one course leaves 0.371 of it.
    chi_one = build_loop(**(COTTON | {"loop_length": 5.5666527e-3}), centre_line="curve")
    assert loop_height(chi_one) / chi_one.course_spacing == pytest.approx(1.589, abs=5e-4)
    assert contraction_limit(chi_one, "course", "course_spacing") == pytest.approx(0.371, abs=5e-4)
    with pytest.raises(InputError, match="limit = course_spacing: must be half"):
        contraction_limit(cotton_loop, "wale", "course_spacing")


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_printed_positions_leave_the_edge_and_take_no_notice_of_the_pull(
    cotton_loop, cotton_law, direction
):
    reading = Reading(positions="printed", contraction="none", law="printed")
    curve = tensile_test(cotton_loop, cotton_law, direction, [0, 0.3, 0.6], reading, recovery=False)
    rest = cotton_loop.points(np.linspace(0, 1, 2001))
    moved = deformed_points(cotton_loop, curve, rest)
    axis = 0 if direction == "course" else 1
    assert moved[0] == pytest.approx(rest, abs=1e-18)
    assert np.array_equal(moved[1], moved[2])
    # The edges: both ends of the loop course-wise, its highest point wale-wise.
    edge = [0, 2000] if direction == "course" else [np.argmax(rest[:, 1])]
    assert moved[1][edge, axis] == pytest.approx(rest[edge, axis], abs=1e-12)
    assert np.abs(moved[1][:, axis] - rest[:, axis]).max() > 1e-4


@pytest.mark.parametrize("direction", ["course", "wale"])
@pytest.mark.parametrize(
    "reading",
    [Reading(), Reading(positions="printed", contraction="linear", law="printed")],
    ids=["corrected", "printed"],
)
def test_positions_have_the_length_and_the_spacing_that_the_curve_says(
    cotton_loop, cotton_law, direction, reading
):
    curve = tensile_test(cotton_loop, cotton_law, direction, np.linspace(0, 0.8, 5), reading)
    u = np.linspace(0, 1, 4001)
    moved = deformed_points(cotton_loop, curve, cotton_loop.points(u))
    length = np.linalg.norm(np.diff(moved, axis=1), axis=2).sum(axis=1)
    assert length == pytest.approx(curve.yarn_length, rel=1e-6)
    course = curve.scale_along if direction == "course" else curve.scale_across
    advance = moved[:, -1] - moved[:, 0]
    assert advance[:, 0] == pytest.approx(COTTON["wale_spacing"] * course, rel=1e-12)
    assert np.abs(advance[:, 1:]).max() < 1e-15


def test_recovery_retraces_the_loading_and_viscous_friction_does_not(cotton_loop, cotton_law):
    strains = np.linspace(0, 0.8, 33)
    plain = tensile_test(cotton_loop, cotton_law, "course", strains, Reading())
    assert plain.recovery.sum() == 32
    assert np.array_equal(plain.force_per_loop[:33][::-1][1:], plain.force_per_loop[33:])
    assert plain.work[-1] == 0 and plain.dissipated[-1] == 0
    c, v = 1000.0, 1e-4
    slow = tensile_test(
        cotton_loop, cotton_law, "course", strains, Reading(viscous=True),
        friction_coefficient=c, velocity=v,
    )  # fmt: skip
    assert slow.yarn_tension[:33] == pytest.approx(plain.yarn_tension[:33] + c * v)
    assert slow.yarn_tension[33:] == pytest.approx(plain.yarn_tension[33:] - c * v)
    # c v over the yarn's way, there and back.
    way = 2 * (slow.yarn_length[32] - slow.yarn_length[0])
    assert way > 1e-4
    assert slow.dissipated[-1] == pytest.approx(c * v * way, rel=1e-12)


@pytest.mark.parametrize("contraction", ["isometric", "linear"])
def test_the_force_does_the_work(cotton_loop, cotton_law, contraction):
    """The integral of the force over the spacing is the energy stored and lost, at second order."""
    errors = []
    for steps in (200, 400, 800):
        curve = tensile_test(
            cotton_loop, cotton_law, "course", np.linspace(0, 0.8, steps + 1),
            Reading(contraction=contraction, viscous=True), friction_coefficient=1e3, velocity=1e-3,
        )  # fmt: skip
        way = COTTON["wale_spacing"] * (1 + curve.strain)
        force = curve.force_per_loop
        done = np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(way))
        assert curve.dissipated[-1] > 0.01 * curve.work[steps]
        errors.append(abs(done[steps - 1] - curve.work[steps]) / curve.work[steps])
    assert errors[0] < 5e-3
    # The force jumps at the jam and has kinks, so the rule is of first order there at worst.
    assert errors[2] < 0.55 * errors[0]


def test_states_beyond_the_breaking_strain_are_marked(cotton_loop, cotton_law):
    curve = tensile_test(cotton_loop, cotton_law, "course", np.linspace(0, 0.9, 91), Reading())
    assert np.array_equal(curve.beyond_breaking_strain, curve.yarn_strain > 0.07)
    assert 0 < curve.beyond_breaking_strain.sum() < 60


def test_a_yarn_cannot_push_unless_read_as_printed(cotton_loop, cotton_law):
    strains = np.linspace(0, 0.6, 13)
    curves = {
        law: tensile_test(
            cotton_loop, cotton_law, "wale", strains,
            Reading(positions="printed", contraction="linear", law=law), recovery=False,
        )
        for law in ("continuous", "printed")
    }  # fmt: skip
    slack = curves["printed"].yarn_strain < 0
    assert slack.sum() > 5
    assert (curves["continuous"].yarn_tension[slack] == 0).all()
    assert (curves["printed"].yarn_tension[slack] < 0).all()


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_fibre_points_stand_upright_on_the_deformed_centre_line(cotton_loop, cotton_law, direction):
    curve = tensile_test(cotton_loop, cotton_law, direction, np.linspace(0, 0.6, 4), Reading())
    layout = np.array([[0.0, 0.0], [1e-4, 0.0], [0.0, -5e-5], [3e-5, 4e-5]])
    points = fibre_points(cotton_loop, curve, layout, twist=400.0, sections=60)
    assert points.shape == (7, 60, 4, 3)
    centre = points[:, :, 0]
    u, _ = cotton_loop.sections(60)
    assert centre == pytest.approx(deformed_points(cotton_loop, curve, cotton_loop.points(u)))
    offset = points - centre[:, :, None]
    radius = np.linalg.norm(layout, axis=1)
    assert np.linalg.norm(offset, axis=3) == pytest.approx(np.broadcast_to(radius, (7, 60, 4)))
    # Perpendicular to the tangent, taken by differences of the deformed centre line.
    h = 1e-6
    ahead = deformed_points(cotton_loop, curve, cotton_loop.points(u + h))
    behind = deformed_points(cotton_loop, curve, cotton_loop.points(u - h))
    tangent = ahead - behind
    tangent /= np.linalg.norm(tangent, axis=2)[..., None]
    cosine = np.einsum("ksfi,ksi->ksf", offset[:, :, 1:], tangent) / radius[1:]
    assert np.abs(cosine).max() < 1e-8


def test_only_the_steps_asked_for(cotton_loop, cotton_law):
    curve = tensile_test(cotton_loop, cotton_law, "wale", np.linspace(0, 0.3, 31), Reading())
    layout = np.array([[1e-4, 0.0]])
    every = fibre_points(cotton_loop, curve, layout, 300.0, 40)
    some = fibre_points(cotton_loop, curve, layout, 300.0, 40, [0, 7, 30])
    assert np.array_equal(some, every[[0, 7, 30]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"direction": "warp"}, "direction = warp: must be one of course, wale"),
        ({"strains": [0.1, 0.2]}, "must rise from 0"),
        ({"strains": [0.0, 0.2, 0.2]}, "must rise from 0"),
        ({"strains": [0.0, np.nan]}, "must rise from 0"),
    ],
)
def test_bad_input_is_refused(cotton_loop, cotton_law, change, message):
    arguments = {"direction": "course", "strains": [0.0, 0.1], "reading": Reading()} | change
    with pytest.raises(InputError, match=message):
        tensile_test(cotton_loop, cotton_law, **arguments)


def test_bad_readings_are_refused():
    with pytest.raises(InputError, match="contraction = sideways: must be one of"):
        Reading(contraction="sideways")
    with pytest.raises(InputError, match="printed positions"):
        Reading(positions="printed")


def test_scaled_length_against_the_naive_root():
    """The isometric scale found by bisection on the naive length."""
    loop = build_loop(**COTTON)
    curve = tensile_test(loop, paper_k3(True), "wale", [0, 0.05, 0.2], Reading(), recovery=False)
    root = brentq(
        lambda q: naive_length(loop, q, 1.2) - naive_length(loop, 1, 1), 0.5, 1, xtol=1e-13
    )
    assert curve.scale_across[2] == pytest.approx(root, abs=1e-10)

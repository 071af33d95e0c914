"""The simulated yarn: one section against closed forms, naive sums and finite differences."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from knitsim.errors import ComputationError, InputError
from knitsim.yarn import hearle, section_kernels
from knitsim.yarn.law import TensionLaw, bilinear, paper_k3
from knitsim.yarn.packing import FibreLayout, pack
from knitsim.yarn.section import (
    SectionProblem,
    SimulatedYarn,
    fibre_path,
    section_springs,
    solve_section,
    tangent_stiffness,
    tensile_test,
    turn_matrix,
)

POLYESTER = bilinear(6.34, 2.41, 0.02, 0.08)
DIAMETER = 0.25e-3
EI = 6.34 * 20e-6**2 / 16


def make_yarn(fibres=19, twist=300.0, form="corrected", law=POLYESTER, **changes):
    options = {"spacing": 0.1e-3, "bending_rigidity": EI, "section_stiffness": 1e8} | changes
    return SimulatedYarn(pack(fibres, DIAMETER), law, twist=twist, twist_form=form, **options)


def run(yarn, max_strain=0.05, steps=50, **options):
    return tensile_test(yarn, max_strain, steps, velocity=0.005, gauge_length=0.25, **options)


def stored(test):
    return test.stretch_energy + test.bending_energy + test.section_energy


# ---- the kernels against their naive twins ----


def naive_stretch(law, strain, largest):
    """Energy, tension of a fibre, unloading from ``largest`` along the first slope."""
    if not law.plastic or strain >= largest:
        return float(law.energy_at(strain)), float(law.tension_at(strain))
    back = largest - strain
    at_turn, slope = float(law.tension_at(largest)), law.initial_stiffness
    energy = float(law.energy_at(largest)) - back * at_turn + 0.5 * slope * back**2
    return energy, at_turn - slope * back


def naive_energy(yarn, x, strain, largest):
    """Energy of a section (J): its springs, one tension spring and one bending spring a fibre, with
    the sections before and after written out in space."""

    def sections(points, spacing):
        return [
            np.column_stack([points @ np.linalg.matrix_power(yarn.turn, j).T, np.full(len(x), z)])
            for j, z in enumerate((0.0, spacing, 2.0 * spacing))
        ]

    def angle(a, b):
        return math.atan2(np.linalg.norm(np.cross(a, b)), a @ b)

    built = sections(yarn.layout.positions, yarn.spacing)
    now = sections(x, yarn.spacing * (1 + strain))
    energy = 0.0
    for i in range(len(x)):
        a0, b0 = built[1][i] - built[0][i], built[2][i] - built[1][i]
        a, b = now[1][i] - now[0][i], now[2][i] - now[1][i]
        length = np.linalg.norm(a0)
        energy += length * naive_stretch(yarn.law, np.linalg.norm(a) / length - 1, largest[i])[0]
        constant = yarn.bending_rigidity / length + yarn.bending_constant * yarn.spacing
        energy += 0.5 * constant * (angle(a, b) - angle(a0, b0)) ** 2
    for i, j in section_springs(yarn.layout.positions):
        change = math.dist(x[i], x[j]) - math.dist(*yarn.layout.positions[[i, j]])
        energy += 0.5 * yarn.section_stiffness * yarn.spacing * change**2
    return energy


def kernel_energy(problem, x, strain):
    gradient = np.empty(2 * len(x))
    spacing = problem.yarn.spacing * (1 + strain)
    energy, _ = section_kernels.section_gradient(
        x, spacing, problem.turn, problem.fibres, problem.law, problem.ends, problem.springs,
        gradient,
    )  # fmt: skip
    return energy, gradient


def kernel_hessian(problem, x, strain):
    width = 2 * np.abs(problem.ends[:, 0] - problem.ends[:, 1]).max() + 2
    band = np.empty((2 * len(x), width))
    spacing = problem.yarn.spacing * (1 + strain)
    section_kernels.section_hessian(
        x, spacing, problem.turn, problem.fibres, problem.law, problem.ends, problem.springs, band
    )
    return dense(band), band


def dense(band):
    size, width = band.shape
    full = np.zeros((size, size))
    for a in range(size):
        for k in range(min(width, size - a)):
            full[a, a + k] = full[a + k, a] = band[a, k]
    return full


def disturbed(yarn, seed=4):
    """A problem whose fibres have yielded differently, and positions out of equilibrium."""
    problem = SectionProblem(yarn)
    rng = np.random.default_rng(seed)
    if yarn.law.plastic:
        problem.fibres[:, section_kernels.LARGEST] = rng.uniform(0.0, 0.05, len(problem.built))
    return problem, problem.built + 1e-6 * rng.uniform(-1, 1, problem.built.shape)


CASES = [
    make_yarn(7),
    make_yarn(12, twist=-300.0, form="printed", bending_constant=2.41),
    make_yarn(5, law=paper_k3(continuous=True)),
    make_yarn(20, bending_rigidity=0.0),
]


@pytest.mark.parametrize("yarn", CASES)
@pytest.mark.parametrize("strain", [0.0, 0.03])
def test_energy_is_the_sum_of_all_springs(yarn, strain):
    problem, x = disturbed(yarn)
    naive = naive_energy(
        yarn, x[np.argsort(problem.order)], strain,
        problem.fibres[np.argsort(problem.order), section_kernels.LARGEST],
    )  # fmt: skip
    assert naive > 0
    assert kernel_energy(problem, x, strain)[0] == pytest.approx(naive, rel=1e-9)


@pytest.mark.parametrize("yarn", CASES)
def test_gradient_and_hessian_are_derivatives(yarn):
    problem, x = disturbed(yarn)
    rng = np.random.default_rng(8)
    _, gradient = kernel_energy(problem, x, 0.03)
    hessian, _ = kernel_hessian(problem, x, 0.03)
    for _ in range(5):
        direction = rng.normal(size=x.shape)
        (up, g_up), (down, g_down) = (
            kernel_energy(problem, x + s * direction, 0.03) for s in (1e-10, -1e-10)
        )
        slope = (up - down) / 2e-10
        assert abs(slope) > 1e-3 * np.linalg.norm(gradient)
        assert gradient @ direction.ravel() == pytest.approx(slope, rel=1e-4)
        curve = hessian @ direction.ravel()
        assert np.linalg.norm(curve) > 0
        change = (g_up - g_down) / 2e-10
        np.testing.assert_allclose(curve, change, atol=1e-5 * np.abs(curve).max())


def test_tension_is_the_derivative_of_the_energy_by_the_strain():
    for yarn in CASES:
        problem, x = disturbed(yarn)
        up, down = (kernel_energy(problem, x, 0.03 + s)[0] for s in (1e-7, -1e-7))
        slope = (up - down) / 2e-7 / yarn.spacing
        assert problem.states(x, 0.03)[:, 4].sum() == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("built", [0.0, 0.03])
def test_bending_series_meets_the_closed_form(built):
    # On both sides of the switch at t = 1e-4, against derivatives of the closed form.
    for t in (1e-9, 9.99e-5, 1.001e-4, 0.02, 0.6):

        def energy(s):
            return 0.5 * 1.7 * (2 * math.asin(math.sqrt(s)) - built) ** 2

        value, first, second = section_kernels.bending(t, built, 1.7)
        h = 1e-3 * t
        assert value == pytest.approx(energy(t), rel=1e-12)
        assert first == pytest.approx((energy(t + h) - energy(t - h)) / (2 * h), rel=1e-5)
        change = [section_kernels.bending(t + s, built, 1.7)[1] for s in (h, -h)]
        assert second == pytest.approx((change[0] - change[1]) / (2 * h), rel=1e-4)


def test_fibre_unloads_along_its_first_slope():
    law = np.stack([POLYESTER.strain, POLYESTER.tension, POLYESTER.energy_at_vertices])
    for largest in (0.0, 0.01, 0.02, 0.035):
        for strain in (-0.01, 0.0, 0.005, 0.02, 0.03, 0.05):
            found = section_kernels.fibre_stretch(strain, largest, law)
            expected = naive_stretch(POLYESTER, strain, largest)
            assert found[:2] == pytest.approx(expected, rel=1e-12, abs=1e-16)
            loading = strain >= largest and strain > 0.02
            assert found[2] == pytest.approx(2.41 if loading else 6.34)


def test_banded_solution_is_that_of_the_full_matrix():
    rng = np.random.default_rng(3)
    band = rng.normal(size=(30, 7))
    band[:, 0] = 20.0
    full, right = dense(band), rng.normal(size=30)
    factor, found = band.copy(), right.copy()
    assert section_kernels.cholesky(factor, 0.0)
    section_kernels.cholesky_solve(factor, found)
    np.testing.assert_allclose(full @ found, right, atol=1e-13)
    band[11, 0] = -1.0
    assert not section_kernels.cholesky(band.copy(), 0.0)
    # Where the Hessian is indefinite the step still leads down, and the held unknown stays.
    step = np.empty(30)
    section_kernels.newton_step(band, right, 4, step)
    assert step[4] == 0.0
    right[4] = 0.0
    assert right @ step < 0


# ---- ideal limits ----


@pytest.mark.parametrize("degrees", [10.0, 15.0, 20.0, 25.0, 30.0])
def test_tangent_stiffness_is_the_exact_sum_over_the_fibres(degrees):
    twist = hearle.twist_of(math.radians(degrees), DIAMETER)
    yarn = make_yarn(72, twist, bending_rigidity=0.0, section_stiffness=math.inf)
    angle = hearle.chord_angle(yarn.layout.radii, twist, yarn.spacing)
    exact = sum(6.34 * math.cos(a) ** 3 for a in angle)
    assert exact < 72 * 6.34 * 0.99
    assert tangent_stiffness(yarn) == pytest.approx(exact, rel=1e-8)
    assert hearle.stiffness_of_fibres(6.34, angle) == pytest.approx(exact, rel=1e-14)


def test_a_stiff_section_approaches_the_rigid_one():
    rigid = tangent_stiffness(make_yarn(19, section_stiffness=math.inf))
    gaps = [rigid - tangent_stiffness(make_yarn(19, section_stiffness=k)) for k in (1e10, 1e11)]
    assert gaps[0] > gaps[1] > 0
    assert gaps[0] / gaps[1] == pytest.approx(10, rel=0.05)


def test_chords_converge_to_the_helix_at_second_order():
    twist = hearle.twist_of(math.radians(20.0), DIAMETER)
    layout = pack(72, DIAMETER)
    helix = hearle.stiffness_of_fibres(6.34, hearle.helix_angle(layout.radii, twist))
    errors = []
    for spacing in (0.2e-3, 0.1e-3, 0.05e-3):
        yarn = SimulatedYarn(layout, POLYESTER, spacing, twist)
        errors.append(tangent_stiffness(yarn) - helix)
    orders = np.log2(np.abs(errors[:-1]) / np.abs(errors[1:]))
    assert min(errors) > 0
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_hearle_is_approached_as_fibres_are_added():
    angle = math.radians(20.0)
    twist = hearle.twist_of(angle, DIAMETER)
    limit = hearle.mean_cos3_limit(angle)
    errors = []
    for fibres in (20, 72, 500):
        # Extrapolated to spacing 0 from two spacings, the error being of second order.
        layout = pack(fibres, DIAMETER)
        coarse, fine = (
            tangent_stiffness(SimulatedYarn(layout, POLYESTER, spacing, twist)) / (fibres * 6.34)
            for spacing in (0.04e-3, 0.02e-3)
        )
        errors.append(abs((4 * fine - coarse) / 3 - limit))
    assert errors[0] < 1e-4
    # Midpoints of equal shares: second order in the number of fibres, down to the noise of 1e-8.
    assert math.log(errors[0] / errors[1]) / math.log(72 / 20) == pytest.approx(2.0, abs=0.1)
    assert errors[2] < 5e-8


def test_hearle_closed_forms():
    angle = math.radians(20.0)
    twist = hearle.twist_of(angle, DIAMETER)
    assert hearle.surface_angle(-twist, DIAMETER) == pytest.approx(angle, rel=1e-14)
    # The values of the verification table, to the digits it gives.
    angles = hearle.helix_angle(hearle.equal_area_radii(72, 0.5 * DIAMETER), twist)
    assert hearle.mean_cos4(angles) == pytest.approx(0.8830215582, abs=5e-11)
    assert hearle.mean_cos3(angles) == pytest.approx(0.9104760188, abs=5e-11)
    # The limits against the integral over the section, by the midpoint rule with many fibres.
    many = hearle.helix_angle(hearle.equal_area_radii(20000, 0.5 * DIAMETER), twist)
    assert hearle.mean_cos4_limit(angle) == pytest.approx(hearle.mean_cos4(many), rel=1e-10)
    assert hearle.mean_cos3_limit(angle) == pytest.approx(hearle.mean_cos3(many), rel=1e-10)
    assert hearle.mean_cos3_limit(0.0) == 1.0
    assert hearle.mean_cos3_limit(1e-6) == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize("fibres", [1, 3, 72])
def test_without_twist_the_yarn_is_the_sum_of_its_filaments(fibres):
    test = run(make_yarn(fibres, twist=0.0), friction_coefficient=0.0)
    loading = test.loading
    expected = fibres * POLYESTER.tension_at(test.strain[loading])
    np.testing.assert_allclose(test.tension[loading], expected, rtol=1e-9, atol=1e-12)
    residual = 0.05 - float(POLYESTER.tension_at(0.05)) / 6.34
    assert test.residual_strain == pytest.approx(residual, rel=1e-9)
    assert (test.iterations == 0).all() and (test.radius_ratio == 1).all()
    assert (test.bending_energy == 0).all() and (test.section_energy == 0).all()


def test_loop_area_of_the_bilinear_filament():
    test = run(make_yarn(1))
    k1, k2, y, top = 6.34, 2.41, 0.02, 0.05
    force = k1 * y + k2 * (top - y)
    area = 0.5 * k1 * y**2 + 0.5 * (k1 * y + force) * (top - y) - force**2 / (2 * k1)
    assert area == pytest.approx(0.00303025315, rel=1e-8)
    # The yield strain is one of the 50 steps, so that the trapezoidal rule is exact.
    assert test.work[-1] == pytest.approx(area, rel=1e-9)
    assert test.plastic_energy[-1] == pytest.approx(area, rel=1e-9)


# ---- the tensile test ----


@pytest.mark.parametrize("form", ["corrected", "printed"])
def test_work_is_stored_or_dissipated(form):
    gaps = []
    for steps in (25, 50, 100):
        test = run(make_yarn(19, form=form), steps=steps, friction_coefficient=3.0)
        balance = stored(test) + test.plastic_energy + test.friction_energy
        assert test.plastic_energy[-1] > 0 and test.friction_energy[-1] > 0
        gaps.append(np.abs(test.work - balance).max() / test.work.max())
    # Fibres yield between steps: second order of the trapezoidal rule, not at every step alike.
    assert gaps[0] < 1e-3
    assert gaps[2] < gaps[0] / 6


def test_an_elastic_yarn_gives_all_back():
    test = run(make_yarn(19, law=paper_k3(continuous=True).scaled(1 / 19)))
    assert test.residual_strain == 0.0
    assert (test.plastic_energy == 0).all()
    half = len(test.strain) // 2
    np.testing.assert_allclose(test.tension[half:][::-1], test.tension[:half], atol=1e-10)
    assert test.work[half - 1] > 0.01
    assert abs(test.work[-1]) < 1e-12 * test.work.max()


def test_twisted_yarn_contracts_yields_and_recovers():
    test = run(make_yarn(72))
    top = np.flatnonzero(test.loading)[-1]
    assert test.strain[top] == test.strain[top + 1] == 0.05
    assert (np.diff(test.radius_ratio[: top + 1]) < 0).all()
    assert 0.9 < test.radius_ratio[top] < 1
    assert (np.diff(test.tension[: top + 1]) > 0).all()
    assert (np.diff(test.tension[top + 1 :]) < 0).all()
    assert abs(test.tension[-1]) < 1e-10
    assert 0 < test.residual_strain < 0.05
    # Yield starts with the fibre most strained, near the axis.
    assert test.plastic_energy[20] == pytest.approx(0.0, abs=1e-15)
    assert (np.diff(test.plastic_energy[22 : top + 1]) > 0).all()
    np.testing.assert_allclose(test.plastic_energy[top:], test.plastic_energy[top], rtol=1e-9)
    assert not test.beyond_break.any()
    # A fibre on the axis has the strain of the yarn; further out, less.
    state = solve_section(make_yarn(19), 0.01)
    order = np.argsort(make_yarn(19).layout.radii)
    assert state.fibre_strain[order[0]] == pytest.approx(0.01, rel=1e-9)
    assert 0.009 < state.fibre_strain[order[-1]] < 0.0097


def test_states_beyond_the_break_are_marked():
    test = run(make_yarn(7, twist=0.0), max_strain=0.1, steps=10)
    np.testing.assert_array_equal(test.strain[test.loading][test.beyond_break[:11]], [0.09, 0.1])


def test_viscous_friction_is_c_v_and_changes_sign():
    plain, viscous = run(make_yarn(7)), run(make_yarn(7), friction_coefficient=8.0)
    loading = plain.loading
    np.testing.assert_allclose(viscous.friction[loading], 8.0 * 0.005)
    np.testing.assert_allclose(viscous.friction[~loading], -8.0 * 0.005)
    np.testing.assert_allclose(viscous.tension[loading] - plain.tension[loading], 0.04, rtol=1e-9)
    assert abs(viscous.tension[-1]) < 1e-10
    assert viscous.residual_strain > plain.residual_strain
    path = 2 * 0.05 - viscous.residual_strain
    assert viscous.friction_energy[-1] == pytest.approx(0.04 * path)
    assert viscous.time[-1] == pytest.approx(path * 0.25 / 0.005)
    # It vanishes with the velocity.
    slow = tensile_test(make_yarn(7), 0.05, 50, 5e-9, 0.25, friction_coefficient=8.0)
    np.testing.assert_allclose(slow.tension, plain.tension, atol=1e-6)


def test_friction_above_the_tension_is_named():
    with pytest.raises(ComputationError, match="friction"):
        run(make_yarn(7), max_strain=0.001, friction_coefficient=100.0)


def test_without_recovery_the_test_ends_at_the_top():
    test = run(make_yarn(7), steps=5, recovery=False)
    assert test.loading.all() and test.strain.size == 6 and test.residual_strain == 0.05


def test_s_twist_is_the_mirror_image_of_z_twist():
    mirror = np.array([1.0, -1.0])
    layout = pack(19, DIAMETER)
    reflected = FibreLayout(layout.positions * mirror, DIAMETER)
    options = {"bending_rigidity": EI, "section_stiffness": 1e8}
    z = run(SimulatedYarn(layout, POLYESTER, 0.1e-3, 300.0, **options))
    s = run(SimulatedYarn(reflected, POLYESTER, 0.1e-3, -300.0, **options))
    np.testing.assert_allclose(s.tension, z.tension, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(s.sections * mirror, z.sections, atol=1e-9 * DIAMETER)


def test_fibres_on_one_circle_are_all_joined():
    # A square has two triangulations; its mirror image must not have the other one.
    assert len(section_springs(pack(4, 2.0).positions)) == 6
    for fibres in (4, 5, 12, 15, 19):
        positions = pack(fibres, 2.0).positions
        pairs = {tuple(pair) for pair in section_springs(positions).tolist()}
        for turn in (turn_matrix(1.0, 0.1), turn_matrix(1.0, 0.3, "printed")):
            assert {tuple(p) for p in section_springs(positions @ turn.T).tolist()} == pairs


def test_turning_the_layout_changes_nothing():
    layout = pack(19, DIAMETER)
    turned = FibreLayout(layout.positions @ turn_matrix(1.0, 0.123).T, DIAMETER)
    one, other = (
        solve_section(SimulatedYarn(x, POLYESTER, 1e-4, 300.0, section_stiffness=1e8), 0.03)
        for x in (layout, turned)
    )
    assert other.tension == pytest.approx(one.tension, rel=1e-10)


def test_what_is_left_out_changes_nothing():
    # No bending: the same as bending too weak to matter.
    none, weak = (solve_section(make_yarn(bending_rigidity=b), 0.04) for b in (0.0, 1e-24))
    assert none.tension == pytest.approx(weak.tension, rel=1e-10)
    assert none.bending_energy == 0.0
    # No twist: the same as twist too weak to matter, which is solved.
    straight, nearly = make_yarn(twist=0.0), make_yarn(twist=1e-3)
    assert not straight.deformable and nearly.deformable
    assert solve_section(straight, 0.04).tension == pytest.approx(
        solve_section(nearly, 0.04).tension, rel=1e-9
    )
    # One fibre, on the axis: nothing to solve.
    assert not make_yarn(1).deformable
    # A fibre off the axis on its own is pulled straight to it.
    alone = FibreLayout([[0.05e-3, 0.0]], DIAMETER)
    yarn = SimulatedYarn(alone, POLYESTER, 0.1e-3, 300.0, section_stiffness=1e8)
    assert yarn.deformable
    assert solve_section(yarn, 0.01).tension < POLYESTER.tension_at(0.01)


@pytest.mark.parametrize("fibres", range(1, 20))
@pytest.mark.parametrize("form", ["corrected", "printed"])
def test_every_small_number_of_fibres_runs(fibres, form):
    test = run(make_yarn(fibres, form=form), steps=10)
    assert test.sections.shape == (22, fibres, 2)
    assert np.isfinite(test.tension).all()
    assert abs(test.tension[-1]) < 1e-9
    assert 0 < test.tension[10] <= fibres * POLYESTER.tension_at(0.05) * (1 + 1e-12)


def test_fibres_on_a_line_run():
    line = FibreLayout(np.linspace(-1e-4, 1e-4, 5)[:, None] * [[0.6, 0.8]], DIAMETER)
    np.testing.assert_array_equal(section_springs(line.positions), [[0, 1], [1, 2], [2, 3], [3, 4]])
    two = FibreLayout([[-1e-4, 0.0], [0.7e-4, 0.0]], DIAMETER)
    test = run(SimulatedYarn(two, POLYESTER, 0.1e-3, 300.0, section_stiffness=1e8), steps=20)
    assert abs(test.tension[-1]) < 1e-9 and test.radius_ratio[20] < 1


@pytest.mark.parametrize("fibres", [3, 7, 19, 20, 72])
def test_springs_hold_the_section_together(fibres):
    positions = pack(fibres, 2.0).positions
    pairs = section_springs(positions)
    # Their rigidity matrix has three free motions: two shifts and a turn, and no other.
    rigidity = np.zeros((len(pairs), 2 * fibres))
    for row, (i, j) in enumerate(pairs):
        span = positions[i] - positions[j]
        rigidity[row, 2 * i : 2 * i + 2], rigidity[row, 2 * j : 2 * j + 2] = span, -span
    assert np.linalg.matrix_rank(rigidity) == 2 * fibres - 3
    lengths = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
    assert lengths.max() < 2.5 * np.median(lengths)


def test_the_paper_reads_k2_as_bending_spring_of_the_spacing():
    yarn = make_yarn(7, bending_rigidity=0.0, bending_constant=2.41)
    problem = SectionProblem(yarn)
    constants = problem.fibres[:, section_kernels.BEND]
    np.testing.assert_allclose(constants, 2.41 * 0.1e-3)  # N m


# ---- twist ----


def test_corrected_twist_accumulates_and_printed_does_not():
    layout, spacing, twist = pack(7, DIAMETER), 0.1e-3, 300.0
    right = fibre_path(layout, spacing, twist, 9)
    printed = fibre_path(layout, spacing, twist, 9, "printed")
    np.testing.assert_allclose(right[:, 0, 2], spacing * np.arange(9))
    np.testing.assert_allclose(printed[2:, :, :2], printed[:-2, :, :2], atol=1e-18)
    fibre = right[:, 3, 0] + 1j * right[:, 3, 1]
    turned = np.angle(fibre[1:] / fibre[:-1])
    np.testing.assert_allclose(turned, 2 * math.pi * twist * spacing, rtol=1e-10)  # Z: right-handed
    other = fibre_path(layout, spacing, -twist, 9)[:, 3]
    np.testing.assert_allclose(np.angle((other[1, 0] + 1j * other[1, 1]) / fibre[0]), -turned[0])


def test_eq_1_as_printed_is_a_reflection():
    printed, corrected = (turn_matrix(300.0, 1e-4, form) for form in ("printed", "corrected"))
    assert np.linalg.det(printed) == pytest.approx(-1)
    assert np.linalg.det(corrected) == pytest.approx(1)
    np.testing.assert_allclose(printed @ printed, np.eye(2), atol=1e-15)


# ---- bad input ----


def refused(**changes):
    arguments = {"layout": pack(7, DIAMETER), "law": POLYESTER, "spacing": 1e-4, "twist": 300.0}
    with pytest.raises(InputError) as refusal:
        SimulatedYarn(**(arguments | {"where": "yarns.yaml: pes"} | changes))
    message = str(refusal.value)
    assert message.startswith("yarns.yaml: pes.") and "\n" not in message
    return message


def test_coarse_sections_are_refused_with_the_spacing_that_would_do():
    message = refused(spacing=1e-3)
    assert "turns 108.0 deg per section; use at most 0.416665 mm" in message
    SimulatedYarn(pack(7, DIAMETER), POLYESTER, 0.416665e-3, 300.0)


def test_twist_that_no_spacing_resolves_is_refused_with_the_largest():
    message = refused(twist=-3000.0, spacing=1e-9)
    most = float(message.split("at most ")[1].split()[0])
    assert hearle.surface_angle(most, DIAMETER) == pytest.approx(math.radians(60), rel=1e-5)
    SimulatedYarn(pack(7, DIAMETER), POLYESTER, 1e-9, most)


@pytest.mark.parametrize(
    "changes",
    [
        {"spacing": 0.0},
        {"spacing": -1e-4},
        {"spacing": math.nan},
        {"twist": math.inf},
        {"twist_form": "other"},
        {"bending_rigidity": -1e-12},
        {"bending_constant": math.nan},
        {"section_stiffness": 0.0},
        {"section_stiffness": math.nan},
        {"law": TensionLaw([0, 0.01, 0.05], [0, 0.01, 0.2], plastic=True)},
        {"law": paper_k3(continuous=False), "section_stiffness": 1e8},
    ],
)
def test_yarns_that_cannot_be_are_refused(changes):
    refused(**changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"max_strain": 0.0},
        {"max_strain": math.nan},
        {"steps": 0},
        {"steps": 2.5},
        {"velocity": 0.0},
        {"gauge_length": -1.0},
        {"friction_coefficient": -1.0},
    ],
)
def test_tests_that_cannot_be_are_refused(changes):
    arguments = {"max_strain": 0.05, "steps": 5, "velocity": 0.005, "gauge_length": 0.25}
    with pytest.raises(InputError, match=next(iter(changes))):
        tensile_test(make_yarn(7), **(arguments | changes))


def test_strains_and_section_counts_are_checked():
    with pytest.raises(InputError, match="strain"):
        solve_section(make_yarn(7), -1.0)
    with pytest.raises(InputError, match="sections"):
        fibre_path(pack(7, DIAMETER), 1e-4, 300.0, 0)


def test_a_section_that_gives_way_is_named():
    with pytest.raises(ComputationError, match="yarn: no equilibrium of the section"):
        run(make_yarn(19, twist=400.0, section_stiffness=1e3))


# ---- the same every time ----


def test_two_runs_are_the_same_to_the_last_bit():
    first, again = (run(make_yarn(20), steps=10) for _ in range(2))
    for name in ("tension", "stretch_energy", "sections", "strain"):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes()


@pytest.mark.slow
def test_compiled_and_plain_python_agree():
    script = (
        "from tests.test_yarn_section import *\n"
        "t = run(make_yarn(7), steps=4)\n"
        "print(*(float(v).hex() for v in [*t.tension, *t.sections.ravel()]))\n"
    )
    results = []
    for off in ("0", "1"):
        environment = os.environ | {"NUMBA_DISABLE_JIT": off}
        done = subprocess.run(
            [sys.executable, "-c", script], env=environment, capture_output=True, text=True,
            cwd=os.path.dirname(os.path.dirname(__file__)), check=True,
        )  # fmt: skip
        results.append([float.fromhex(v) for v in done.stdout.split()])
    np.testing.assert_allclose(results[0], results[1], rtol=1e-9, atol=1e-12)

"""Tests of a fabric by the equilibrium model: rest, tension, biaxial, shear, friction, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from knitsim.equilibrium.contact import BarrierContact, CoreContact
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.model import build_model, centreline
from knitsim.equilibrium.pull import biaxial, shear, tensile
from knitsim.equilibrium.relax import is_intact, relax, without
from knitsim.equilibrium.start import start_from
from knitsim.errors import ComputationError, InputError
from knitsim.loop.lattice import smallest_distance
from knitsim.verification.trials.table import CAMPAIGNS
from knitsim.verification.trials.told import relaxed_of
from knitsim.yarn.law import TensionLaw, paper_k3

COTTON = dict(
    wale_spacing=1.4993e-3, course_spacing=1.2005e-3, loop_length=5.56e-3, diameter=0.2793e-3,
    bending_rigidity=5e-9, law=paper_k3(continuous=True),
)  # fmt: skip
COARSE = Resolution(24)
SMALL_FORCE = 1e-6 * 5e-9 / 0.2793e-3**2  # the stated tolerance of a state


@pytest.fixture(scope="module")
def cotton():
    return relax(Fabric(**COTTON))


@pytest.fixture(scope="module")
def course(cotton):
    return tensile(cotton, "course", np.linspace(0.05, 1.5, 30))


@pytest.fixture(scope="module")
def rubbing():
    """The cotton fabric with friction."""
    return relax(Fabric(**COTTON, friction=0.2))


def test_relaxed_cotton(cotton):
    # A prototype of the model in other code, to the digits given.
    assert cotton.wale_spacing == pytest.approx(1.571e-3, abs=1e-6)
    assert cotton.course_spacing == pytest.approx(1.008e-3, abs=1e-6)
    assert cotton.residual <= SMALL_FORCE
    assert cotton.crossings_intact
    assert cotton.energy[:3].min() > 0.0 == cotton.energy[3]


def test_forces_of_the_cotton(cotton, course):
    # The same prototype, its forces at 40 control points (mN), rounded to the digits given.
    at = np.array([0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.2])
    forces = 1e3 * np.interp(at, course.strain, course.force_per_loop)
    np.testing.assert_allclose(forces, [4.3, 8.8, 13.5, 18.8, 32.7, 58, 170, 458], rtol=0.015)
    wale = tensile(cotton, "wale", [0.1, 0.2, 0.3, 0.4, 0.6, 0.8])
    np.testing.assert_allclose(
        1e3 * wale.force_per_loop, [3.9, 7.2, 10.7, 25.7, 217, 850], rtol=0.015
    )
    assert course.stop_reason == wale.stop_reason == ""


def test_every_state_is_what_it_says(cotton, course):
    assert course.residual.max() <= SMALL_FORCE
    assert course.crossings_intact.all()
    assert (course.status == 0).all()
    assert course.strain == pytest.approx(np.linspace(0.05, 1.5, 30), abs=1e-12)
    assert course.wale_spacing == pytest.approx(cotton.wale_spacing * (1 + course.strain))
    per_width = course.force_per_loop / cotton.course_spacing
    assert course.force_per_width == pytest.approx(per_width)
    step = 15
    lattice = [[course.wale_spacing[step], 0, 0], [0, course.course_spacing[step], 0]]
    nearest = smallest_distance(course.centreline[step], np.array(lattice), 0.2793e-3)
    assert nearest.distance / 0.2793e-3 == pytest.approx(course.min_distance[step], abs=1e-2)
    length = np.linalg.norm(np.diff(course.centreline[step], axis=0), axis=1).sum()
    assert length == pytest.approx(5.56e-3 * (1 + course.yarn_strain[step]), rel=3e-3)
    assert course.yarn_tension[-1] == pytest.approx(
        float(COTTON["law"].tension_at(course.yarn_strain[-1])), rel=0.02
    )


def test_force_is_the_derivative_of_the_energy(cotton):
    e = 1e-3
    curve = tensile(cotton, "course", [0.6 - e, 0.6, 0.6 + e])
    slope = (curve.energy[2].sum() - curve.energy[0].sum()) / (2 * e * cotton.wale_spacing)
    assert curve.force_per_loop[1] == pytest.approx(slope, rel=1e-5)


def test_quarter_and_full_cell_agree(cotton, course):
    full = relax(Fabric(**COTTON), Resolution(cell="full"))
    curve = tensile(full, "course", [0.2, 0.6, 1.0])
    same = np.interp(curve.strain, course.strain, course.force_per_loop)
    assert full.wale_spacing == pytest.approx(cotton.wale_spacing, rel=1e-9)
    left = cotton.model.control.tolerance
    np.testing.assert_allclose(curve.force_per_loop, same, rtol=0.0, atol=left)
    # The full cell may shear by itself.
    assert np.abs(curve.forces[:, 1:3]).max() < 0.1 * left


def test_mirrored_fabric_mirrors_its_result():
    """Upside down (half turn about the course axis) a plain knit is the same fabric."""
    full = relax(Fabric(**COTTON), Resolution(24, 160, cell="full"))
    model = full.model
    mirrored = full.centreline * [-1.0, 1.0, 1.0]
    assert is_intact(model, full.y)
    assert mirrored[::-1][:, 2] == pytest.approx(full.centreline[:, 2], abs=1e-8)
    angles = np.deg2rad([1.0, -1.0])
    curve = shear(full, angles)
    assert curve.force_per_loop[0] == pytest.approx(-curve.force_per_loop[1], abs=SMALL_FORCE)
    assert curve.force_per_loop[0] > 0.0


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.2, marks=pytest.mark.slow)])
def test_error_of_shear_is_estimated(friction):
    """To and fro; a state is visited twice with other forces.  Errors over the largest force."""
    fabric = Fabric(**COTTON, friction=friction)
    angles = np.deg2rad([4.0, 8.0, 4.0, 0.0, -4.0, -8.0, 0.0])
    options = {"tension": 10.0}
    curve = shear(relax(fabric, Resolution(cell="full")), angles, **options, estimate_error=True)
    fine = relax(fabric, Resolution(96, 1024, cell="full"))
    exact = shear(fine, angles, **options, increment=0.005)
    largest = np.abs(exact.force_per_loop).max()
    floor = 0.01 * largest
    said = curve.numerical_error * np.maximum(np.abs(curve.force_per_loop), floor)
    true = np.abs(curve.force_per_loop - exact.force_per_loop)
    assert np.isfinite(said).all()
    # The 2 % of force that the method claims with friction; without, the estimate is a bound.
    assert max(true.max(), said.max()) < 0.02 * largest
    if friction == 0.0:
        assert (true <= said).all()


@pytest.mark.parametrize("sparse", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_friction_of_yarns_that_hardly_touch(sparse):
    """A random fabric so open that all its friction is less than the residual of a loose pass.

    Loads in steps of 0.4 degrees are those in an eighth of it, to the stated tolerance.
    """
    one = relaxed_of(CAMPAIGNS["shear_campaign"].draw(120, 91253))
    one = replace(one, model=replace(one.model, sparse=sparse))
    coarse, fine = (
        shear(one, np.linspace(0.0, 0.04, 6 * parts + 1)[1:]).force_per_loop[parts - 1 :: parts]
        for parts in (1, 8)
    )
    assert coarse == pytest.approx(fine, abs=one.model.control.tolerance)
    assert fine[-1] > 100.0 * one.model.control.tolerance


def test_refinement_converges_and_the_estimate_bounds_the_error():
    strains = [0.3, 0.6, 0.9, 1.2]
    fabric = Fabric(**COTTON)
    curves = [
        tensile(relax(fabric, Resolution(n, 8 * n)), "course", strains, estimate_error=n < 96)
        for n in (36, 48, 96, 192)
    ]
    exact = curves[-1].force_per_loop
    errors = [np.abs(c.force_per_loop / exact - 1.0).max() for c in curves[:-1]]
    assert errors[0] > 3 * errors[1] > 9 * errors[2] > 0.0
    assert errors[1] < 0.01
    for curve in curves[:2]:
        true = np.abs(curve.force_per_loop - exact) / exact
        assert (true <= curve.numerical_error).all()


def test_lateral_conditions(cotton):
    held = tensile(cotton, "course", [0.1, 0.2], lateral="held")
    assert held.course_spacing == pytest.approx(cotton.course_spacing, rel=1e-12)
    free = tensile(cotton, "course", [0.1, 0.2])
    assert (held.force_per_loop > free.force_per_loop).all()
    assert free.transverse_strain[-1] < 0.0
    loaded = tensile(cotton, "course", [0.1, 0.2], lateral=5.0)
    assert loaded.forces[:, 3] == pytest.approx(5.0 * cotton.wale_spacing, abs=SMALL_FORCE)
    # Biaxial at the spacings of the free test: the forces are the same.
    both = biaxial(cotton, np.column_stack([free.strain, free.wale_strain]))
    assert both.forces[:, 0] == pytest.approx(free.force_per_loop, rel=1e-6, abs=SMALL_FORCE)
    assert both.forces[:, 3] == pytest.approx(np.zeros(2), abs=1e-6)


def test_loading_to_a_force_and_back(cotton):
    asked = 49.0
    curve = tensile(cotton, "course", np.linspace(0.1, 1.5, 15), to_force=asked, recovery=True)
    top = np.flatnonzero(curve.phase == 0)[-1]
    assert curve.force_per_width[top] == pytest.approx(asked, rel=1e-5)
    # Without friction the way back is the way there.
    back = np.flatnonzero(curve.phase == 1)
    same = np.interp(curve.strain[back[:-1]], curve.strain[:top], curve.force_per_width[:top])
    assert curve.force_per_width[back[:-1]] == pytest.approx(same, rel=1e-4)
    assert abs(curve.strain[-1]) < 1e-5
    assert abs(curve.work[-1]) < 1e-6 * curve.work.max()
    assert not curve.dissipated.any()


def test_friction_loses_energy_and_balances(rubbing):
    curve = tensile(rubbing, "course", np.linspace(0.05, 0.6, 12), recovery=True, cycles=2)
    assert curve.stop_reason == ""
    assert (np.diff(curve.dissipated) >= 0.0).all()
    stored = curve.energy.sum(1) - rubbing.energy.sum()
    work = curve.work.max()
    assert np.abs(curve.work - stored - curve.dissipated).max() < 1e-3 * work
    assert curve.energy[:, 3].min() > 0.0  # held by the contacts, not yet lost
    end = np.flatnonzero(curve.cycle == 1)[-1]
    # The prototype: 8 % residual strain to its 2 % step.
    assert curve.strain[end] == pytest.approx(0.08, abs=0.025)
    assert curve.force_per_loop[end] == pytest.approx(0.0, abs=1e-5 * curve.force_per_loop.max())
    loading = (curve.cycle == 1) & (curve.phase == 0)
    smooth = tensile(relax(Fabric(**COTTON)), "course", curve.strain[loading])
    assert (curve.force_per_loop[loading] > smooth.force_per_loop).all()


def test_contacts_that_hardly_give_way_are_coulombs(rubbing):
    """A law whose slip is rounded over a short length loses 0.5404 of the work in short steps."""
    lost = []
    for relaxed in (rubbing, relax(Fabric(**COTTON, friction=0.2, tangential_ratio=30.0))):
        curve = tensile(relaxed, "course", np.linspace(0.05, 0.6, 12), recovery=True)
        lost.append(curve.dissipated[-1] / curve.work.max())
        assert curve.strain[-1] == pytest.approx(0.0976, abs=5e-4)
    assert lost[1] == pytest.approx(0.5404, abs=4e-3)
    # What a spring holds is not lost.
    assert 0.95 * lost[1] < lost[0] < lost[1]


def test_friction_converges_with_the_increment(rubbing):
    strains = [0.2, 0.4]
    forces = [
        tensile(rubbing, "course", strains, increment=step).force_per_loop
        for step in (0.04, 0.02, 0.0025)
    ]
    coarse, default = (np.abs(f / forces[-1] - 1.0).max() for f in forces[:2])
    assert 0.0 < default < 0.02
    assert default < coarse


def test_no_friction_is_the_limit_of_little(cotton):
    little = relax(Fabric(**COTTON, friction=1e-6))
    curve, smooth = (tensile(r, "wale", [0.1, 0.3]) for r in (little, cotton))
    assert curve.force_per_loop == pytest.approx(smooth.force_per_loop, rel=1e-4)


def test_set_narrows_the_open_loop():
    open_loop = dict(COTTON, loop_length=6.2e-3)
    ratios = []
    for part in (0.0, 0.9):
        state = relax(Fabric(**open_loop, set_fraction=part))
        ratios.append(state.wale_spacing / state.course_spacing)
    # The prototype: 1.72 to 1.32.
    assert ratios[0] == pytest.approx(1.72, abs=0.01)
    assert ratios[1] == pytest.approx(1.32, abs=0.03)


def test_bulky_yarn_starts_and_relaxes():
    bulky = Fabric(
        2.86e-3,
        2.07e-3,
        11.28e-3,
        1.48e-3,
        4.5e-8,
        TensionLaw([0.0, 0.1], [0.0, 100.0]),
        CoreContact(core_diameter=0.65e-3, stiffness=1.2e6, exponent=2.4),
    )
    state = relax(bulky)
    assert state.crossings_intact
    assert 0.65 / 1.48 < state.min_distance < 0.6
    curve = tensile(state, "wale", [0.1, 0.2])
    assert curve.stop_reason == ""
    assert np.abs(curve.yarn_strain).max() < 1e-3


def test_start_is_interlooped_and_has_its_length():
    fabric = Fabric(**COTTON)
    model = build_model(fabric)
    y = start_from(model, fabric.diameter, 1.19 * fabric.diameter)
    assert is_intact(model, y)
    points = centreline(model, y, per_span=20)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert length == pytest.approx(fabric.loop_length, rel=1e-3)
    flat = y.copy()
    flat[: model.cell.count][model.cell.where[:, 2] == 2] *= -1.0
    assert not is_intact(model, flat)  # seen from the other side it is a purl


def test_same_input_same_bytes(rubbing):
    one, two = (tensile(rubbing, "course", [0.1, 0.2], recovery=True) for _ in range(2))
    for name in ("force_per_loop", "y", "dissipated", "energy"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()


def test_curve_ends_with_its_reason():
    # A yarn soft enough to be squeezed through is stopped, and nothing wrong is reported.
    soft = relax(Fabric(**dict(COTTON, contact=BarrierContact(5.0)), friction=0.0), COARSE)
    curve = tensile(soft, "course", np.linspace(0.1, 2.0, 20))
    assert 0 < curve.steps < 20
    assert "stopped before a strain of" in curve.stop_reason
    assert curve.crossings_intact.all()
    assert np.isfinite(curve.force_per_loop).all()


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"diameter": 1.5e-3}, "diameter"),
        ({"loop_length": 2.0}, "loop length"),
        ({"friction": -0.1}, "friction"),
        ({"friction": 1.5}, "friction"),
        ({"bending_rigidity": 0.0}, "bending rigidity"),
        ({"bending_rigidity": float("nan")}, "bending rigidity"),
        ({"set_fraction": 1.2}, "set fraction"),
        ({"wale_spacing": None, "set_fraction": 0.5}, "set"),
        ({"spin": "slow"}, "spin"),
        ({"tangential_ratio": 0.0}, "tangential ratio"),
        ({"stuck_ratio": float("nan")}, "stuck ratio"),
        ({"course_spacing": -1.0}, "course spacing"),
        ({"law": None}, "law"),
    ],
)
def test_impossible_fabrics_are_refused(changes, name):
    with pytest.raises(InputError) as caught:
        Fabric(**{**COTTON, **changes})
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_impossible_inputs_are_refused(cotton):
    for make, name in (
        (lambda: BarrierContact(0.0), "contact stiffness"),
        (lambda: CoreContact(1e-4, 1e6, 1.0), "exponent"),
        (lambda: Fabric(**COTTON, contact=CoreContact(0.3e-3, 1e6)), "core"),
        (lambda: Resolution(20), "points"),
        (lambda: Resolution(42), "points"),
        (lambda: Resolution(40, cell="half"), "cell"),
        (lambda: relax(Fabric(**COTTON), Resolution(40, 32)), "contacts"),
        (lambda: tensile(cotton, "thickness", [0.1]), "direction"),
        (lambda: tensile(cotton, "course", [0.2, 0.1]), "strains"),
        (lambda: tensile(cotton, "course", [0.1, np.nan]), "strains"),
        (lambda: tensile(cotton, "course", [0.1], lateral="loose"), "lateral"),
        (lambda: tensile(cotton, "course", [0.1], cycles=2), "cycles"),
        (lambda: tensile(cotton, "course", [0.1], to_force=-1.0), "to_force"),
        (lambda: biaxial(cotton, [0.1]), "strains"),
    ):
        with pytest.raises(InputError) as caught:
            make()
        assert name in str(caught.value)


def test_no_state_at_all_is_an_error(cotton):
    with pytest.raises(ComputationError):
        tensile(cotton, "wale", [5.0], lateral="held")


@pytest.mark.parametrize(("number", "held"), [(11, False), (3, True)])
def test_a_fabric_that_would_shear_by_itself_is_told_unstable(number, held):
    """Random fabrics, the first with set and a core law; the sign of the shear force decides."""
    relaxed = without(relaxed_of(CAMPAIGNS["shear_campaign"].draw(number, 4242)), "sheared")
    force = shear(relaxed, [0.002]).force_per_width[0]
    assert (force > 0.0) == held == (relaxed.stable is not False)


def test_a_loop_too_short_for_its_yarn_is_told_jammed():
    """Loops of 14 diameters have room, as knitted fabrics do; those of 9 squeeze their yarn by a third."""
    for over, jammed in ((14.0, False), (9.0, True)):
        fabric = Fabric(**COTTON | {"loop_length": over * COTTON["diameter"]})
        assert relax(fabric).jammed is jammed

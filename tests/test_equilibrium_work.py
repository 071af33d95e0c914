"""Work along a path: quadrature against integrals in closed form, and the balance of energy."""

import numpy as np
import pytest

from knitsim.equilibrium import accuracy
from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.accept import set_free, work_of_increment
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.yarn.law import TensionLaw, paper_k3

COTTON = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))

# Random fabrics that once showed what is tested: wale and course spacing, loop length, diameter,
# bending rigidity, law, contact stiffness, friction.
STAIRS = (  # soft in bending: its force goes up in stairs
    0.001870872378, 0.001126876114, 0.006383106591, 0.00020157599197, 1.0129017815e-09,
    (0.0, 0.005005862317, 0.1194535398), (0.0, 0.02513540386, 0.271177793), 1297.833962, 0.0,
)  # fmt: skip
LIMP = (  # and open
    0.00409932297188, 0.00200524188739, 0.0114551027807, 0.00042853004945, 3.282731518981e-12,
    (0.0, 0.0151425574945, 0.0485913787628), (0.0, 0.419169364132, 1.693127188087), 667.3584333809,
    0.0,
)  # fmt: skip
HELD = (  # by friction, under tension at its first length
    0.0030373782104544, 0.0022379107343834, 0.01174279984057, 0.00081971781399806,
    2.6618088679179e-09, (0.0, 0.0159392283859, 0.1198704084477),
    (0.0, 0.44573487923, 1.9978581814702), 2906.5507135093, 0.37658732477358,
)  # fmt: skip


def relaxed_of(wale, course, length, diameter, rigidity, strain, tension, stiffness, friction):
    law, contact = TensionLaw(strain, tension, strain[-1]), BarrierContact(stiffness)
    fabric = Fabric(wale, course, length, diameter, rigidity, law, contact, friction)
    return relax(fabric, Resolution(48))


def integral(x, y):
    """Integral of y from the first x to every one: the mean of the parabolas on either side."""
    h, slope = np.diff(x), np.diff(y) / np.diff(x)
    bend = np.diff(slope) / (x[2:] - x[:-2])
    both = 0.5 * (np.append(bend[:1], bend) + np.append(bend, bend[-1:]))
    return np.append(0.0, np.cumsum(0.5 * h * (y[1:] + y[:-1]) - both * h**3 / 6.0))


def summed(ways, forces):
    """Work of a path through the points ``ways`` (n, m) with the forces (n, m)."""
    past, total = np.zeros(ways.shape[1] + 1), []
    for k in range(1, len(ways)):
        total.append(work_of_increment(forces[k - 1], forces[k], ways[k] - ways[k - 1], past))
    return np.array(total)


def test_a_parabola_of_force_is_integrated_exactly_from_the_second_increment():
    x = np.array([1.0, 1.3, 1.7, 1.8, 2.6])
    force = 2.0 + 3.0 * x + 5.0 * x**2
    exact = np.diff(2.0 * x + 1.5 * x**2 + 5.0 * x**3 / 3.0)
    way = np.column_stack([x, np.full(5, 7.0)])
    got = summed(way, np.column_stack([force, np.full(5, 99.0)]))
    chord = 0.5 * (force[1:] + force[:-1]) * np.diff(x)
    assert got[1:] == pytest.approx(exact[1:], rel=1e-13)
    assert got[0] == pytest.approx(chord[0], rel=1e-13)
    assert abs(got[0] - exact[0]) > 1e-3


def test_going_back_starts_anew_with_the_chord():
    x = np.array([0.0, 1.0, 2.0, 1.5])
    force = x**2
    got = summed(x[:, None], force[:, None])
    assert got[1] == pytest.approx(7.0 / 3.0)
    assert got[2] == pytest.approx(-0.5 * 0.5 * (4.0 + 2.25))


def test_a_sharp_bend_adds_no_more_than_a_parabola_level_at_one_end():
    # A steep short increment, then a long flat one: the parabola would leave the two forces.
    x = np.array([0.0, 0.01, 1.01])
    force = np.array([0.0, 1.0, 1.2])
    got = summed(x[:, None], force[:, None])
    assert got[1] == pytest.approx(1.1 + 0.2 / 6.0)


def test_two_prescribed_entries_work_together():
    t = np.linspace(0.0, 1.0, 6)
    way = np.column_stack([t, 2.0 * t])
    force = np.column_stack([t**2, 1.0 - t])
    got = summed(way, force).sum()
    # The first increment is a chord: its error is h^3/6 of the second derivative, 2.
    assert got == pytest.approx(1.0 / 3.0 + 1.0 + 0.2**3 / 6.0, rel=1e-12)


def test_work_is_stored_where_contact_points_make_the_force_waver():
    relaxed, steps = relaxed_of(*STAIRS), 10
    curve = tensile(relaxed, "wale", 0.0983116 * np.arange(1, steps + 1) / steps)
    assert curve.steps == steps
    # The force, integrated over the way by another rule, does the work that is reported.
    spacing = np.concatenate([[relaxed.course_spacing], curve.course_spacing])
    work = integral(spacing, np.concatenate([[0.0], curve.force_per_loop]))[1:]
    assert np.abs(curve.work - work).max() < 0.01 * curve.work[-1]
    rises = np.diff(curve.force_per_loop)
    assert rises.max() > 1.1 * rises.min()


def test_a_limp_open_fabric_does_not_jump_from_contact_point_to_contact_point():
    """Frictionless, with contacts as narrow as their points are far apart: all work is stored."""
    relaxed = relaxed_of(*LIMP)
    strains = 0.12079268 * np.arange(1, 41) / 40.0
    curve, fine = (tensile(relaxed, "wale", strains, increment=step) for step in (0.1, 0.001))
    for one in (curve, fine):
        stored = one.energy.sum(1) - relaxed.energy.sum()
        assert (one.dissipated == 0.0).all()
        assert one.work == pytest.approx(stored, abs=1e-9 * relaxed.energy.sum())
        spacing = np.concatenate([[relaxed.course_spacing], one.course_spacing])
        work = integral(spacing, np.concatenate([[0.0], one.force_per_loop]))[-1]
        assert one.work[-1] == pytest.approx(work, rel=0.01)
    assert fine.force_per_loop == pytest.approx(curve.force_per_loop, rel=1e-6)


def test_a_smooth_path_sets_nothing_free():
    # Forces 1 to 3 over a unit length: a line, an exponential, a root, and a pole in a short step.
    gains = [(1.0, 3.0, 2.0), (1.0, 3.0, 2.0 / np.log(3.0)), (1.0, 3.0, 26.0 / 12.0)]
    gains.append((1.0, 1.5, np.log(1.5) / (1.0 - 1.0 / 1.5)))
    for low, high, gain in gains:
        assert set_free(low, high, gain, 10.0) == 0.0
        assert set_free(-high, -low, -gain, 10.0) == 0.0
    assert set_free(1.0, 3.0, 0.5, 10.0) == pytest.approx(1.5)
    assert set_free(-3.0, -1.0, -3.5, 10.0) == pytest.approx(1.5)


def test_a_held_fabric_with_friction_is_pushed_until_it_has_no_force():
    relaxed = relaxed_of(*HELD)
    curve = tensile(relaxed, "course", [0.1, 0.19], lateral="held", recovery=True)
    at_first = np.flatnonzero(np.abs(curve.strain) < 1e-12)[-1]
    largest = curve.force_per_loop.max()
    assert curve.force_per_loop[at_first] > 1e-4 * largest
    assert curve.stop_reason == ""
    assert curve.strain[-1] < 0.0
    assert abs(curve.force_per_loop[-1]) <= 1e-5 * largest


def test_where_the_fine_solution_failed_the_error_is_not_known():
    relaxed = relax(COTTON, Resolution(24, 160))
    whole, half = (tensile(relaxed, "course", 0.1 * np.arange(1, n + 1)) for n in (6, 3))
    off = accuracy._off(whole, half, whole)
    assert np.abs(off[:3]).max() < 1e-9 and np.isnan(off[3:]).all()
    # The largest of four states on either side stands for a state.
    values = np.array([1.0, 2.0, 1.0, 0.5, 0.1, np.nan, 3.0])
    np.testing.assert_array_equal(accuracy._neighbourhood(values), [2, 2, 3, 3, 3, np.nan, 3])

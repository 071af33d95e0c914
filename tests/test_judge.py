"""The judge finds every planted error in every kind of test, and nothing in results that are right."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from knitsim.verification.judge.given import Barrier, Core, controls_of, design
from knitsim.verification.judge.loads import BEND, GAUSS, Loads
from knitsim.verification.judge.measure import Energy
from knitsim.verification.judge.shape import closest
from knitsim.verification.judge.verdict import Test, judge
from knitsim.verification.trials import run
from knitsim.verification.trials.law import FIRST, Asked, Case, cycle
from knitsim.verification.trials.told import given_of, relaxed_of, rest_of, states_of, wanted_of

LAW = ((0.0, 0.01, 0.07), (0.0, 0.44, 5.84))
D = 0.2793e-3
COTTON = Case(0, 1.4993e-3, 1.2005e-3, 5.56e-3, D, 5e-9, *LAW, Barrier(1000.0), 0.3)
SMOOTH = replace(COTTON, friction=0.0)
# A soft shell, pressed to a tenth of its thickness where the fabric is at rest.
SHELL = replace(COTTON, diameter=1.3 * D, contact=Core(0.8 * D, 1e9, 2.4))
OUT = (*FIRST, *np.linspace(0.01, 0.2, 20))
BACK = (*OUT[:-1], 0.195, 0.1975, 0.2)
KINDS = {
    "pulled": (COTTON, Asked("tension", "course", OUT)),
    "there and back twice": (COTTON, Asked("tension", "wale", BACK, cycles=2)),
    "loaded across, shell": (replace(SHELL, friction=0.0), Asked("tension", "wale", OUT, 2.0)),
    "held across, set": (replace(SMOOTH, set_fraction=0.5), Asked("tension", "course", OUT, "held")),
    "biaxial, rough shell": (
        replace(SHELL, friction=0.6),
        Asked("biaxial", "", tuple((0.6 * x, 0.4 * x) for x in OUT)),
    ),
    "sheared, whole loop": (
        replace(COTTON, cell="full"), Asked("shear", "", tuple(cycle(0.1, 12)[1:])),
    ),
    "bent, lagging": (
        replace(COTTON, bending_hysteresis=2e-7), Asked("bending", "wale", tuple(cycle(100.0, 4))),
    ),
    "bent, held, set": (
        replace(SMOOTH, set_fraction=0.5), Asked("bending", "course", tuple(cycle(100.0, 3)), "held"),
    ),
    "two loops": (
        replace(COTTON, cell="full", wales=2, points=32), Asked("tension", "course", OUT),
    ),
}  # fmt: skip
_SLOW = ("there and back twice", "two loops", "bent, held, set")
_QUICK = [pytest.param(k, marks=pytest.mark.slow if k in _SLOW else ()) for k in KINDS]


@functools.cache
def solved(kind):
    """Given, States and Test of a kind, and its Asked, solved by the solver."""
    case, asked = KINDS[kind]
    relaxed = relaxed_of(case)
    curve = run.solved(asked, relaxed)
    assert not curve.stop_reason
    start = curve.start
    return given_of(case, start), states_of(asked, start, curve), wanted_of(asked, start, curve)


@pytest.fixture(scope="module", params=_QUICK)
def result(request):
    return solved(request.param)


def found(given, states, test, **changes):
    return " | ".join(f.check for f in judge(given, replace(states, **changes), test))


def test_right_results_are_called_right(result):
    assert judge(*result) == []


@pytest.mark.parametrize("factor", [1.02, 0.98])
def test_a_load_that_is_off_by_two_per_cent(result, factor):
    given, states, test = result
    wrong = found(given, states, test, load=factor * states.load, moment=factor * states.moment)
    assert "slope of the energy" in wrong or "work of the load" in wrong


def test_a_load_that_is_off_in_one_state(result):
    given, states, test = result
    # Without friction; with it, where slips tell all.
    i = 8
    load, moment = states.load.copy(), states.moment.copy()
    load[i] *= 1.02
    moment[i] *= 1.02
    wrong = found(given, states, test, load=load, moment=moment)
    assert "slope of the energy" in wrong or given.rubs


def test_numbers_that_are_none(result):
    given, states, test = result
    for name in ("centreline", "lattice", "coordinate", "energy", "work", "dissipated", "sprung"):
        values = np.array(getattr(states, name))
        values.reshape(len(values), -1)[2, -1] = np.nan
        assert found(given, states, test, **{name: values}) == f"{name} is not finite"


def test_lost_crossings(result):
    given, states, test = result
    line = states.centreline.copy()
    line[-2, ..., 2] *= -1.0  # seen from the back
    assert "crossings" in found(given, states, test, centreline=line)
    other = replace(given, pattern=("p",))
    assert "crossings" in found(other, states, test)


def test_energy_out_of_balance(result):
    given, states, test = result
    more, near = states.energy.copy(), states.min_distance.copy()
    more[3, len(more) % 3] += 1e-5 * more[3].sum()
    near[2] *= 1.01
    wrong = found(given, states, test, energy=more, min_distance=near, work=1.03 * states.work)
    assert "energy is not that of the shape" in wrong
    assert "smallest distance" in wrong
    assert "work is not stored or lost" in wrong
    if given.rubs:
        back = 1.1 * states.dissipated
        back[3] = 0.9 * back[2]
        wrong = found(given, states, test, dissipated=back)
        assert "friction gives energy" in wrong and "friction takes more" in wrong
        assert "takes less" in found(given, states, test, dissipated=0.8 * states.dissipated)
    else:
        lost = 1e-3 * np.abs(states.work)
        assert "energy lost without friction" in found(given, states, test, dissipated=lost)


def on_its_spline(given, control, lattice):
    """Centre lines (yarns, m, 3) of control points."""
    spans = control.shape[1]
    matrix, turns = design(spans, np.arange(2 * spans + 1) / 2)
    return matrix @ control + turns[:, None] * given.wales * np.append(lattice[:2], 0.0)


def test_a_state_that_is_no_equilibrium(result):
    """A spot of the yarn pushed by a hundredth of a diameter, everything else told accordingly."""
    given, states, test = result
    for i in (0, len(states.work) - 1):
        control = controls_of(states.centreline[i], states.lattice[i], given.wales)
        control[0, 5] += 0.01 * given.diameter * np.array([1.0, 1.0, 0.0])
        line, energy, near = (
            np.array(getattr(states, n)) for n in ("centreline", "energy", "min_distance")
        )
        line[i] = on_its_spline(given, control, states.lattice[i])
        measure = Energy(given, GAUSS, given.contacts, True, test.bent or 0)
        shape = measure.shape(control, states.lattice[i], states.curvature[i])
        energy[i], near[i] = measure.terms(shape), shape.distance.min() / given.diameter
        wrong = found(given, states, test, centreline=line, energy=energy, min_distance=near)
        # Where all has rubbed, friction may hold a spot.
        assert "a control point is not in equilibrium" in wrong or (i and given.rubs)
        assert "energy is not that of the shape" not in wrong


@pytest.mark.parametrize("kind", ["pulled", "bent, lagging"])
def test_a_test_that_stopped_at_once(kind):
    given, states, test = solved(kind)
    for count in (1, 2):
        some = type(states)(*(np.asarray(v)[:count] for v in vars(states).values()))
        assert judge(given, some, replace(test, asked=None)) == []


def test_a_fabric_pulled_is_not_at_rest():
    given, states, _ = solved("held across, set")
    alone = type(states)(*(np.asarray(v)[-1:] for v in vars(states).values()))
    assert "load on the lattice" in found(
        given, replace(alone, coordinate=np.zeros((1, 0))), Test()
    )
    # A fabric that has less energy than at rest is not at rest there.
    back = type(states)(*(np.asarray(v)[[4, 3]] for v in vars(states).values()))
    back = replace(back, coordinate=np.zeros((2, 0)))
    assert "energy is below that at rest" in found(given, back, Test())


def test_other_lies(result):
    given, states, test = result
    further = np.concatenate([test.asked[:-1], 1.1 * test.asked[-2:-1] + 0.01])
    assert "asked state not reached" in found(given, states, replace(test, asked=further))
    longer = np.concatenate([test.asked] * 4)
    assert "missing" in found(given, states, replace(test, asked=longer))
    line = states.centreline.copy()
    line[2, 0, 31, 0] += 0.01 * given.diameter
    assert "no periodic cubic spline" in found(given, states, test, centreline=line)
    said = states.coordinate * (1.0 + 1e-4)
    assert "coordinate is not that" in found(given, states, test, coordinate=said)
    stiffer = replace(given, bending_rigidity=1.01 * given.bending_rigidity)
    loaded = replace(test, asked=None, unloaded=(len(states.work) // 4,))
    wrong = found(stiffer, states, loaded)
    assert "energy is not that of the shape" in wrong
    assert "without load" in wrong
    if test.bent is not None:
        line = states.centreline.copy()
        line[2, ..., 2] += 0.01 * given.diameter
        assert "mean plane" in found(given, states, test, centreline=line)
    if test.free:
        held = replace(test, held=(*test.held, *test.free))
        assert "a held spacing has changed" in found(given, states, held)


def test_cores_inside_each_other_between_contact_points():
    given, states, test = solved("loaded across, shell")
    energy = Energy(given, GAUSS, given.contacts, True)
    shapes = [
        energy.shape(controls_of(line, lattice, given.wales), lattice)
        for line, lattice in zip(states.centreline, states.lattice, strict=True)
    ]
    at_points = min(shape.distance.min() for shape in shapes)
    between = min(closest(energy, shape) for shape in shapes)
    assert given.contact.core < between < at_points
    thicker = replace(given.contact, core=0.5 * (between + at_points))
    assert "cores are inside each other" in found(replace(given, contact=thicker), states, test)
    inside = replace(given.contact, core=1.001 * at_points)
    assert found(replace(given, contact=inside), states, test) == "cores are inside each other"


def test_set_that_is_ignored_or_skewed():
    given, states, test = solved("held across, set")
    assert "energy is not that of the shape" in found(
        replace(given, set_fraction=0.0), states, test
    )
    assert "energy is not that of the shape" in found(
        replace(given, set_fraction=0.45), states, test
    )
    lines, lattice = given.held
    control = controls_of(lines, lattice, given.wales)
    control[0, 7, 0] += 0.01 * D
    skewed = on_its_spline(given, control, lattice)
    wrong = found(replace(given, held=(skewed, lattice)), states, test)
    assert "the held cell is not in equilibrium" in wrong


@pytest.mark.parametrize("kind", ["pulled", "bent, lagging"])
def test_friction_that_is_not_the_fabric_s(kind):
    given, states, test = solved(kind)
    weak = found(
        replace(given, friction=0.2, bending_hysteresis=0.5 * given.bending_hysteresis),
        states,
        test,
    )
    assert "friction takes more" in weak
    strong = found(
        replace(given, friction=0.4, bending_hysteresis=2 * given.bending_hysteresis), states, test
    )
    assert "friction takes less" in strong


def test_couples_after_several_steps_between_two_states():
    """Without friction between yarns only bounds tell what lags; they leave other errors to be found."""
    case, asked = KINDS["bent, lagging"]
    case = replace(case, friction=0.0)
    relaxed = relaxed_of(case)
    curve = run.solved(asked, relaxed)
    given, states = given_of(case, relaxed), states_of(asked, relaxed, curve)
    kept = np.setdiff1d(np.arange(len(states.work)), [7, 8])
    some = type(states)(*(np.asarray(v)[kept] for v in vars(states).values()))
    some = replace(some, increments=np.add.reduceat(states.increments, np.append(0, kept[:-1] + 1)))
    test = replace(wanted_of(asked, relaxed, curve), asked=None)
    assert judge(given, some, test) == []
    lagging = replace(given, bending_hysteresis=1.05 * given.bending_hysteresis)
    assert "a control point is not in equilibrium" in found(lagging, some, test)
    wrong = found(given, some, test, moment=1.02 * some.moment, work=1.03 * some.work)
    assert "moment is not the slope" in wrong and "work is not stored" in wrong


@pytest.mark.parametrize("kind", ["pulled", "bent, lagging"])
def test_friction_that_gives_way_elastically(kind):
    """Springs that are stiffer than stated, and a tenth of what is lost told as held in them."""
    given, states, test = solved(kind)
    stiff = replace(given, tangential_ratio=1.3, stuck_ratio=26.0)
    assert "friction holds another energy" in found(stiff, states, test)
    more, less = states.sprung + 0.1 * states.dissipated, 0.9 * states.dissipated
    wrong = found(given, states, test, sprung=more, dissipated=less)
    assert "friction holds another energy" in wrong and "friction takes less" in wrong


def test_contact_points_that_do_not_see_the_core():
    """A core that almost touches between the contact points: finer integrals have another slope."""
    given, states, test = solved("loaded across, shell")
    energy = Energy(given, GAUSS, given.contacts, True)
    last = energy.shape(
        controls_of(states.centreline[-1], states.lattice[-1], given.wales), states.lattice[-1]
    )
    pressed = replace(
        given, contact=replace(given.contact, core=closest(energy, last) * (1.0 - 1e-4))
    )
    said = np.full(len(states.work), 1e-3)
    check = "slope of the energy by finer integrals is another"
    assert check in found(pressed, states, test, numerical_error=said)
    # Unless the solver says that it does not know; nor is anything wrong with the fabric's own core.
    assert check not in found(pressed, states, test, numerical_error=1e6 * said)
    assert found(given, states, test, numerical_error=said) == ""


def test_a_fabric_at_rest():
    relaxed = relaxed_of(COTTON)
    rest, given = rest_of(relaxed), given_of(COTTON, relaxed)
    assert judge(given, rest, Test()) == []
    assert "energy is not" in found(given, rest, Test(), energy=1.001 * rest.energy)
    assert "load on the lattice" in found(given, rest, Test(dead_load=np.array([0, 0, 0, 1e-5])))


# ---------------------------------------------------------------- work of sampled loads


def ways_of(along, load):
    """Loads whose intervals lie as those of these coordinates and loads (n,)."""
    loads = object.__new__(Loads)
    n = len(along)
    loads.test, loads.bent = Test(driven=("course",), held=(1, 2, 3)), 0
    lattice, force = np.zeros((n, 4)), np.zeros((n, 4))
    lattice[:, 0], force[:, 0] = along, load
    loads.states = type("States", (), {"lattice": lattice, "load": force, "curvature": np.zeros(n)})
    loads._ways()
    return loads


def test_a_parabola_is_integrated_exactly():
    x = np.array([0.5, 0.6, 0.75, 0.85, 1.0, 1.2])
    loads = ways_of(x, 3 * x**2 - x + 2)
    exact = np.diff(x**3 - 0.5 * x**2 + 2 * x)
    assert loads.driving == pytest.approx(exact, rel=1e-12)
    # There and back it is the same, but for a sharp bend where the way turns.
    loads = ways_of(np.append(x, x[-2::-1]), np.append(3 * x**2, 3 * x[-2::-1] ** 2))
    assert loads.driving.sum() == pytest.approx(0.0, abs=1e-12)
    assert loads.sharp.tolist() == [True, *[False] * 4, True, *[False] * 4]


def test_bend_of_a_load_between_states_far_apart():
    """Coming out of a short step the load may bend as one that grows or falls can at most."""
    for rate in (-6.0, 6.0):
        along = np.array([0.0, 0.1, 1.0, 1.01, 1.02])
        loads = ways_of(along, np.exp(rate * along))
        off = np.abs(loads.driving - np.diff(np.exp(rate * along)) / rate)
        assert loads.sharp.tolist() == [True, True, False, False]
        assert loads.close.tolist() == [False, False, True, True]
        assert BEND * loads.change[1] < off[1] < loads.doubt[1]
        assert (off[2:] < loads.doubt[2:]).all()

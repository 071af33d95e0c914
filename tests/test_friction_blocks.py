"""Rigid blocks that rub, driven by the solver's own loop: closed forms under alternating loads."""

import math

import numpy as np
import pytest
from friction_tools import virgin
from oracles import block, sliders

from knitsim.equilibrium import spline
from knitsim.equilibrium.cell import to_map
from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.kernels.accept import REACHED
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.follow import March, Standing, follow, new_trail
from knitsim.equilibrium.kernels.friction import Rub
from knitsim.equilibrium.kernels.newton import Control
from knitsim.equilibrium.kernels.pairs import pairs_at
from knitsim.equilibrium.kernels.records import LATTICE
from knitsim.equilibrium.open_scene import assemble
from knitsim.equilibrium.open_yarn import Cylinder, OpenYarn
from knitsim.yarn.law import TensionLaw

LAW = TensionLaw([0.0, 0.1], [0.0, 100.0])
RADIUS, HARD = 10e-3, 1e2
FRICTION = 0.3


class Block:
    """A yarn, straight and rigid, that can only be moved as a whole by y[:3] (m); others stand still.

    yarns: the first is the block; load (3,): dead load on it (N).
    """

    def __init__(self, yarns, load, *, friction=FRICTION, sticking=1.0, contact=None, **scene):
        diameter = scene.pop("diameter", 1e-3)
        scene, *_ = assemble(yarns, scene.pop("cylinders", ()), contact, diameter)
        rows = []
        for yarn, control in enumerate(y.control() for y in yarns):
            rows += [{axis: 1.0} if yarn == 0 else {} for axis in range(3)] * len(control)
        map_ = to_map(rows, 3)
        places = np.concatenate([y.control() for y in yarns])
        map_.rows.offset[: places.size] = places.ravel()
        self.size = (len(scene.fixtures.cylinders), len(scene.touch.points))
        self.scene = scene._replace(
            map=map_, load=np.array([*load, *np.zeros(LATTICE)]), scale=np.ones(3 + LATTICE)
        )
        self.scene.fixtures.cylinders.shell *= sticking
        shell = 1.0 if contact is None else sticking * contact.shell(diameter)
        self.rub = Rub(friction, shell, ())
        self.control = Control(1e-7 * np.abs(load).sum() + 1e-12, 0.2 * RADIUS, 2e-4, 200, 0, False)

    def at(self, place):
        """Energy (J) and force (3,) on the block (N) at a place (3,), without friction and loads."""
        y, work = np.array([*place, *np.zeros(LATTICE)]), new_work(self.scene)
        energy_of(self.scene, y, pairs_at(self.scene, y, 0.0, work), (), np.int64(1), work)
        return work.terms.sum(), work.gradient[:3] + self.scene.load[:3]

    def drive(self, driven, free, targets, largest, start=(0.0, 0.0, 0.0)):
        """Forces (n, 3) on the block and states at targets (n, driven)."""
        none, scene = np.empty(0, dtype=np.int64), self.scene
        march = March(
            np.array(free, dtype=np.int64), np.array(driven), np.full(len(driven), -1), largest, 0.0,
            2.0, scene.touch, none, self.control,
        )  # fmt: skip
        y = np.array([*start, *np.zeros(LATTICE)])
        force = np.append(self.at(start)[1], np.zeros(LATTICE))
        here = Standing(y, force, np.zeros(len(y) + 1), virgin(self.rub, self.size))
        targets = np.reshape(np.array(targets, dtype=float), (len(targets), -1))
        trail = new_trail(len(targets), len(y))
        count, status, _ = follow(scene, here, targets, march, self.rub, trail)
        assert (count, status) == (len(targets), REACHED)
        return trail.force[:, :3], trail.states, trail.y[:, :3]


def along_the_course(length, height=0.0):
    """Shape of a straight yarn along the course, at heights along the thickness."""
    return lambda t: np.stack([length * (t - 0.5), 0.0 * t, height + 0.0 * t], axis=-1)


@pytest.mark.slow
def test_block_on_a_cylinder_under_an_alternating_push():
    """The normal turns and the normal force changes; the error falls with the increment."""
    length, weight = 5e-3, 1.0
    yarn = OpenYarn(length, 1e-6, LAW, 4, shape=along_the_course(length, RADIUS), contacts=1)
    round_ = Cylinder((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), RADIUS, HARD)
    spring = BarrierContact(HARD).shell(RADIUS) * length
    depth = weight / length / (8.0 * HARD / RADIUS**2)
    grip = FRICTION * weight / spring  # how far it gives way before it slides
    places = RADIUS * np.array([0.2, 0.5, 0.48, 0.3, -0.2, -0.5, -0.45, 0.0, 0.5])
    places = np.append(places, places[-1] - 0.5 * grip)
    exact = block.Block(weight, FRICTION, spring, RADIUS, weight / depth)
    pushes, losses = np.transpose([(exact.push(x), exact.lost) for x in places])
    # As deep in the barrier of the cylinder as the weight presses it.
    start = (0.0, 0.0, -depth)
    for largest in (4e-4, 1e-4):
        force, states, _ = Block([yarn], (0.0, 0.0, -weight), cylinders=[round_]).drive(
            [1], [2], places, largest, start
        )
        # Normal forces are settled to 0.2 % of the friction force.
        np.testing.assert_allclose(force[:, 1], pushes, rtol=0, atol=2e-3 * FRICTION * weight)
        np.testing.assert_allclose(states.lost, losses, rtol=0, atol=1e-3 * losses[-1])
        assert (np.diff(states.lost) >= 0.0).all() and losses[-1] > 0.0


def test_block_on_an_incline_is_a_slider():
    """Weight along the slope and across it; pushed up and down along the slope at random."""
    length, weight, slope = 5e-3, 1.0, 0.25
    yarn = OpenYarn(length, 1e-6, LAW, 4, shape=along_the_course(length, RADIUS), contacts=1)
    ground = Cylinder((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), RADIUS, HARD)
    pressed, along = weight * math.cos(slope), weight * math.sin(slope)
    depth = pressed / length / (8.0 * HARD / RADIUS**2)
    spring = BarrierContact(HARD).shell(RADIUS) * length
    places = 3.0 * FRICTION * weight / spring * np.random.default_rng(1).standard_normal(60)
    force, states, _ = Block([yarn], (-along, 0.0, -pressed), cylinders=[ground]).drive(
        [0], [2], places, 1.0, (0.0, 0.0, -depth)
    )
    exact = sliders.forces(places, [spring], [FRICTION * pressed])
    assert np.ptp(exact) == pytest.approx(2.0 * FRICTION * pressed)
    np.testing.assert_allclose(force[:, 0], exact, rtol=0, atol=1e-6 * weight)
    # Up the slope costs the weight as well, downwards it helps: what it takes from outside.
    takes = force[:, 0] + along
    assert takes.max() == pytest.approx(weight * (FRICTION * math.cos(slope) + math.sin(slope)))
    assert takes.min() == pytest.approx(weight * (math.sin(slope) - FRICTION * math.cos(slope)))
    assert (np.diff(states.lost) >= 0.0).all()


def test_places_pressed_unlike_are_sliders_in_parallel():
    """A bowed block on a plane: each contact point has its own limit; random histories, nested loops."""
    length, deepest = 20e-3, 1e-4

    def bowed(t):
        return along_the_course(length, RADIUS)(t) - np.stack(
            [0 * t, 0 * t, deepest * 4.0 * t * (1.0 - t)], axis=-1
        )

    yarn = OpenYarn(length, 1e-6, LAW, 8, shape=bowed, contacts=2)
    ground = Cylinder((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), RADIUS, HARD)
    one = Block([yarn], (0.0, 0.0, 0.0), cylinders=[ground])
    points = yarn.control()
    heights = spline.evaluate(points, (np.arange(16) + 0.5) / 2.0)[:, 2]
    x, part = heights / RADIUS, length / 16
    pressure = np.where(x < 1.0, 2.0 * HARD / RADIUS * (x**-3 - x), 0.0)
    limits = FRICTION * pressure * part
    stiffness = np.full(16, BarrierContact(HARD).shell(RADIUS) * part)
    assert (limits > 0.0).sum() == 16 and limits.max() > 3.0 * limits.min()
    reach = limits.max() / stiffness[0]
    rng = np.random.default_rng(2)
    nested = reach * np.array([1.5, -0.2, 1.5, 0.4, 0.6, 0.4, 1.5])
    places = np.concatenate([nested, reach * rng.standard_normal(200)])
    force, states, _ = one.drive([0], [], places, 1.0)
    exact = sliders.forces(places, stiffness, limits)
    np.testing.assert_allclose(force[:, 0], exact, rtol=0, atol=1e-9 * exact.max())
    for first, again in ((0, 2), (3, 5), (0, 6)):
        assert force[again, 0] == pytest.approx(force[first, 0], rel=1e-10)
    assert (np.diff(states.lost) >= 0.0).all()
    held = states.terms[0, 3]
    amplitude = nested[0]
    assert held == pytest.approx(sliders.spring_energy(amplitude, stiffness, limits), rel=1e-9)


@pytest.mark.parametrize("cycles", [1000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_energy_is_gained_by_a_block_in_thousands_of_cycles(cycles):
    """Thrown about on a cylinder, pressed and lifted, back to the same place after each turn.

    The work is that of the forces along the way, by an own quadrature of the states.
    """
    length, steps = 5e-3, 24
    yarn = OpenYarn(length, 1e-6, LAW, 4, shape=along_the_course(length, RADIUS), contacts=1)
    ground = Cylinder((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), RADIUS, HARD)
    one = Block([yarn], (0.0, 0.0, 0.0), cylinders=[ground])
    rng, home = np.random.default_rng(3), np.array([0.0, 0.0, -2e-5])
    away = home + rng.standard_normal((cycles, 3)) * [2e-5, 2e-5, 1e-5]
    parts = np.linspace(0.0, 1.0, steps + 1)[1:, None]
    turns = [np.concatenate([home + parts * (a - home), a + parts * (home - a)]) for a in away]
    places = np.concatenate(turns)
    force, states, y = one.drive([0, 1, 2], [], places, 1.0, tuple(home))
    before = np.vstack([one.at(home)[1], force[:-1]])
    moved = np.diff(y, axis=0, prepend=[home])
    work = np.cumsum((0.5 * (before + force) * moved).sum(1))
    stored = states.terms.sum(1) - one.at(home)[0]
    taken = (work - stored)[2 * steps - 1 :: 2 * steps]
    per_cycle = states.lost[-1] / cycles
    assert (np.diff(states.lost) >= 0.0).all() and per_cycle > 0.0
    # The chords of 24 steps miss the square of a step.
    assert np.diff(taken, prepend=0.0).min() > -1e-4 * per_cycle
    assert taken[-1] == pytest.approx(states.lost[-1], rel=3e-3)


def test_a_contact_that_wanders_keeps_its_friction():
    """Two crossing yarns: as one slides over the other, pairs of points leave the contact and enter it.

    They leave and enter where the normal force is nothing, so that nothing of Coulomb's force is lost,
    however soft the contact is along the yarns and however short the steps.
    """
    d, weight, stiffness, length = 1e-3, 2e-2, 1e3, 4e-3

    def across(t):
        return np.stack([0.0 * t, length * (t - 0.5), 0.0 * t], axis=-1)

    one = OpenYarn(length, 1e-6, LAW, 32, shape=along_the_course(length, d), contacts=8)
    two = OpenYarn(length, 1e-6, LAW, 32, shape=across, contacts=8)
    places = np.linspace(0.0, 2e-4, 11)[1:]
    for sticking, largest in ((0.25, 2e-5), (0.25, 2e-6), (2.0, 2e-6)):
        pair = Block(
            [one, two], (0.0, 0.0, -weight), contact=BarrierContact(stiffness), diameter=d,
            sticking=sticking,
        )  # fmt: skip
        force, states, y = pair.drive([1], [2], places, largest, (0.0, 0.0, -1e-5))
        # Normals spread over the contact: their forces are a little more than the weight, and the
        # friction of each lies across its own.
        normal = np.array([crossed_forces(here, length, d, stiffness) for here in y])
        normal = normal[5:]
        np.testing.assert_allclose(normal[:, 1], weight, rtol=1e-3)
        assert (normal[:, 0] > 1.003 * weight).all()
        np.testing.assert_allclose(force[5:, 1], FRICTION * normal[:, 0], rtol=2e-3)
        lost = states.lost[-1] - states.lost[5]
        work = FRICTION * normal[:, 0].mean() * np.ptp(places[5:])
        assert lost == pytest.approx(work, rel=3e-3)


def crossed_forces(place, length, d, stiffness, contacts=256):
    """Normal forces of two yarns that cross: sum of each times what its friction has of the way, and
    of their parts upwards (N)."""
    s = length * ((np.arange(contacts) + 0.5) / contacts - 0.5)
    dx, dy = np.meshgrid(s + place[0], place[1] - s, indexing="ij")
    distance = np.sqrt(dx**2 + dy**2 + (d + place[2]) ** 2)
    x = np.minimum(distance / d, 1.0)
    force = 2.0 * stiffness / d * (x**-3 - x) * (length / contacts) ** 2
    return (force * np.sqrt(1.0 - (dy / distance) ** 2)).sum(), (
        force * (d + place[2]) / distance
    ).sum()

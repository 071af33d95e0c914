"""A rod with a loose open trefoil knot on the kernels of the fabric: half of it, and the half turn."""

import math
from functools import cached_property

import numpy as np

from knitsim.equilibrium import spline
from knitsim.equilibrium.cell import to_map
from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.kernels.accept import REACHED
from knitsim.equilibrium.kernels.contact import law_at, separation
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.follow import March, Standing, follow, new_trail
from knitsim.equilibrium.kernels.friction import MEMORY, Memory, Rub
from knitsim.equilibrium.kernels.newton import CONVERGED, Control, minimise
from knitsim.equilibrium.kernels.pairs import expand, pairs_at, place_points
from knitsim.equilibrium.kernels.records import (
    IMAGE,
    LATTICE,
    ROD,
    TOUCH_POINT,
    Scene,
    Touch,
    records,
)
from knitsim.equilibrium.model import rounded_law
from knitsim.jit import blank
from knitsim.yarn.law import TensionLaw

RADIUS, BENDING = 0.5e-3, 1e-6  # h (m), B (N m2)
CORE = 2.6  # sqrt(h R): where the strands turn about each other in the start
TAIL = 3.0  # R
ELEMENT = 0.4  # sqrt(h R)
TURN = np.array([-1.0, 1.0, -1.0])  # half turn about the wale axis


class Knot:
    """The rod from the top of its loop (arc 0) to the end of one tail, pulled at that end along the course.

    e: sqrt(h/R) at the start; depth: how far the strands press into each other, about (diameters); spacing:
    of the contact points (h).  Unknowns: y[drive] is the place of the end (m).
    """

    def __init__(self, e, depth=3e-3, spacing=0.1, strain=1e-3):
        h = RADIUS
        self.e, self.loop = e, h / e**2
        self.half = math.pi * self.loop + TAIL * self.loop
        scale = math.sqrt(h * self.loop)
        self.elements = round(self.half / (ELEMENT * scale))
        step = self.half / self.elements
        self.rows, self.start = [], []
        self._lay(self._control(step), step)
        place = np.tile(spline.GAUSS_POINTS, self.elements)
        rod = records(
            ROD,
            3 * self.elements,
            first=np.repeat(np.arange(self.elements), 3),
            d0=spline.basis(place),
            d1=spline.basis_first(place),
            d2=spline.basis_second(place),
            span=step,
            weight=np.tile(spline.GAUSS_WEIGHTS, self.elements) * 2.0 * step,
            stiffness=BENDING,
        )
        # Strands that lie along each other press with about 0.12 B h/(h R)^2 per length.
        d, pressed = 2.0 * h, 0.12 * BENDING * h / (h * self.loop) ** 2
        self.contact = BarrierContact(pressed / (8.0 * depth * 4.0 / 3.0 * math.sqrt(2.0 * depth)))
        stretch = 0.5 * BENDING / self.loop**2 / strain
        count = len(self.start)
        self.scene = Scene(
            to_map(self.rows, count), rod, rounded_law(TensionLaw([0.0, 0.1], [0.0, 0.1 * stretch])),
            self._touch(step, h * spacing, 5.5 * scale), self.contact.for_kernels(d),
            np.zeros(count + LATTICE), np.ones(count + LATTICE), (), (),
        )  # fmt: skip
        self.free = np.array([i for i in range(count) if i != self.drive])
        force = BENDING / h**2 * e**4
        self.control = Control(1e-7 * force, 0.3 * d, 0.3 * d, 400, 6, False)
        self.work = new_work(self.scene)

    def _shape(self, arc):
        """Points of a half circle and a straight tail, that wind about their image where both lie."""
        h, end = RADIUS, math.pi * self.loop
        angle = np.pi + np.minimum(arc / self.loop, np.pi)
        x = np.where(arc > end, arc - end, self.loop * np.sin(angle))
        y = np.where(arc > end, 0.0, self.loop * (1.0 - np.cos(angle)))
        core = CORE * math.sqrt(h * self.loop)
        turned = -0.5 * np.pi + 3.0 * np.pi * np.clip((arc - end + core) / (2.0 * core), 0.0, 1.0)
        fade = np.clip(2.0 - np.abs(arc - end) / core, 0.0, 1.0)
        aside = 1.15 * h * fade**2 * (3.0 - 2.0 * fade)
        return np.stack([x, y - aside * np.sin(turned), -aside * np.cos(turned)], axis=-1)

    def _control(self, step):
        """Control points -1 .. n + 1 of the start; the first is the image of the third."""
        n = self.elements
        points, control = self._shape(np.arange(n + 1) * step), np.zeros((n + 3, 3))
        for axis in range(3):
            matrix, right = np.zeros((n + 3, n + 3)), np.zeros(n + 3)
            for i in range(n + 1):
                matrix[i, i : i + 3], right[i] = np.array([1.0, 4.0, 1.0]) / 6.0, points[i, axis]
            matrix[n + 1, [0, 2]] = 1.0, -TURN[axis]
            matrix[n + 2, n : n + 3] = 1.0, -2.0, 1.0
            if TURN[axis] < 0.0:
                matrix[0], right[0] = 0.0, 0.0
                matrix[0, 1] = 1.0
            control[:, axis] = np.linalg.solve(matrix, right)
        return control

    def _lay(self, control, step):
        """Rows of the map and starting unknowns; the end of the tail stands on the course axis."""
        n, own = self.elements, {}
        for k in [*range(n), n + 1]:
            for axis in range(3):
                own[k, axis] = {}
                if k > 0 or TURN[axis] > 0.0:
                    own[k, axis] = {len(self.start): 1.0}
                    self.start.append(control[k + 1, axis])
        self.drive = len(self.start)
        self.start.append(self._shape(np.array([self.half]))[0, 0])
        for axis in range(3):
            own[-1, axis] = {column: TURN[axis] for column in own[1, axis]}
            own[n, axis] = dict.fromkeys([*own[n - 1, axis], *own[n + 1, axis]], -0.25)
        own[n, 0][self.drive] = 1.5
        self.rows = [own[k, axis] for k in range(-1, n + 2) for axis in range(3)]

    def _touch(self, step, spacing, reach):
        """Contact points in the braid, and the half turn."""
        per = math.ceil(step / spacing)
        at = np.repeat(np.arange(self.elements), per)
        place = np.tile((np.arange(per) + 0.5) / per, self.elements)
        near = np.abs((at + place) * step - math.pi * self.loop) < reach
        at, place = at[near], place[near]
        points = records(
            TOUCH_POINT, len(at), first=at, basis=spline.basis(place), length=step / per,
            arc=(at + place) * step,
        )  # fmt: skip
        images = records(
            IMAGE, 2, sign=[[1.0, 1.0, 1.0], TURN], arc_sign=[1.0, -1.0], turn=1, inverse=[0, 1]
        )
        return Touch(points, images, 2.0, 4.0 * RADIUS, 0.0)

    @cached_property
    def rest(self):
        """Unknowns of the knot without friction, its end where it starts."""
        y = np.array([*self.start, *np.zeros(LATTICE)])
        listed = pairs_at(self.scene, y, self.control.skin, self.work)
        for _ in range(3):
            status, *_, listed = minimise(
                self.scene, y, self.free, listed, (), self.control, False, self.work
            )
            if status == CONVERGED:
                return y
        raise AssertionError("the knot is not found")

    def pulled(self, ways, friction, largest=RADIUS / 8.0):
        """Force F h^2/B of an end at ways (m) of either end from rest, and the states."""
        rub = memory = ()
        if friction:
            rub = Rub(friction, self.contact.shell(2.0 * RADIUS), ())
            memory = Memory(blank(0, MEMORY), blank((0, 0), MEMORY), ())
        none, y = np.empty(0, dtype=np.int64), self.rest
        march = March(
            self.free, np.array([self.drive]), np.array([-1]), largest, 0.0, 2.0, self.scene.touch,
            none, self.control,
        )  # fmt: skip
        energy_of(
            self.scene, y, pairs_at(self.scene, y, 0.0, self.work), (), np.int64(1), self.work
        )
        here = Standing(y.copy(), self.work.gradient.copy(), np.zeros(len(y) + 1), memory)
        targets = (y[self.drive] + np.asarray(ways, dtype=float))[:, None]
        trail = new_trail(len(targets), len(y))
        count, status, _ = follow(self.scene, here, targets, march, rub, trail)
        assert (count, status) == (len(targets), REACHED)
        # Both ends move, and the energy is that of the whole.
        return 0.5 * trail.force[:, self.drive] * RADIUS**2 / BENDING, trail.states, trail.y

    def size_at(self, ways):
        """e at ways of either end: the loop takes what rod there is beyond the ends' distance."""
        left = self.half - self.rest[self.drive] - np.asarray(ways)
        return np.sqrt(math.pi * RADIUS / left)

    def normal_forces(self, y):
        """Sum of all contact forces of the braid at y, times h^2/B."""
        lattice = expand(self.scene.map, y, self.work.x)
        listed, total = pairs_at(self.scene, y, 0.0, self.work), 0.0
        place_points(self.scene.touch, self.work.x, self.work.points)
        for pair, weight in zip(listed.pairs.tolist(), listed.weight, strict=True):
            d = np.array(separation(self.scene.touch, self.work.points, lattice, tuple(pair)))
            slope = law_at(float(d @ d), self.scene.law)[1]
            total -= 2.0 * math.sqrt(d @ d) * slope * weight
        return total * RADIUS**2 / BENDING

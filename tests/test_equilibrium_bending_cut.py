"""Bending against a slow, obvious twin in space: contact energy, and the moment in a cut."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from knitsim.equilibrium import spline
from knitsim.equilibrium.bend import DIRECTIONS, bend
from knitsim.equilibrium.cell import loops_of
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels.contact import law_at
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.pairs import pairs_at
from knitsim.equilibrium.kernels.records import Bend
from knitsim.equilibrium.kernels.yarn import stretch_at
from knitsim.equilibrium.model import NEIGHBOURS
from knitsim.equilibrium.relax import relax
from knitsim.yarn.law import paper_k3

COTTON = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))
REACH = 3  # images
FINER = 6  # contact points of the twin, which integrates by sums of points


class BentLoop:
    """One loop and its images, from unknowns y at a curvature, bent along axis ``bent``."""

    def __init__(self, model, y, kappa, bent):
        self.model, self.kappa, self.bent = model, kappa, bent
        self.fabric = model.fabric
        self.n = model.cell.points
        self.spacing = y[[model.lattice, model.lattice + 3]]
        loop = loops_of(model.cell, y)[0]
        step = np.array([self.spacing[0], 0.0, 0.0])
        self.chain = np.concatenate([loop[-1:] - step, loop, loop[:2] + step])

    def at(self, u, order=0):
        """Position or its derivatives by the parameter, (3,) or (m, 3)."""
        kind = (spline.basis, spline.basis_first, spline.basis_second)[order]
        rows = []
        for one in np.atleast_1d(u):
            k = min(int(one), self.n - 1)
            rows.append(kind(np.array([one - k]))[0] @ self.chain[k : k + 4])
        return np.array(rows) if np.ndim(u) else rows[0]

    def in_space(self, p):
        """Points in space: circumference, axis, thickness; the origin stays where it is."""
        s, a, z = p[..., self.bent], p[..., 1 - self.bent], p[..., 2]
        k = self.kappa
        if k == 0.0:
            return np.stack([s, a, z], axis=-1)
        return np.stack(
            [(1.0 / k + z) * np.sin(k * s), a, (1.0 / k + z) * np.cos(k * s) - 1.0 / k], axis=-1
        )

    def points(self):
        """Contact points of all images: flat (m, 3), wale, course, arc (m,)."""
        contacts = FINER * self.model.cell.contacts
        u = (np.arange(contacts) + 0.5) * self.n / contacts
        own, length = self.at(u), self.fabric.loop_length
        flat, wale, course, arc = [], [], [], []
        for a in range(-REACH, REACH + 1):
            for b in range(-REACH, REACH + 1):
                flat.append(own + [a * self.spacing[0], b * self.spacing[1], 0.0])
                wale.append(np.full(contacts, a))
                course.append(np.full(contacts, b))
                arc.append((u / self.n + a) * length)
        self.weight = (length / contacts) ** 2
        return tuple(np.concatenate(part) for part in (flat, wale, course, arc))

    def touching(self, left, right, course, arc, space):
        """Pairs (i, k), i of left and k of right, that touch."""
        d = self.fabric.diameter
        near = cKDTree(space[left]).query_ball_tree(cKDTree(space[right]), d)
        i = np.repeat(left, [len(found) for found in near])
        k = right[np.concatenate([np.array(found, dtype=int) for found in near])]
        keep = (course[i] != course[k]) | (np.abs(arc[i] - arc[k]) >= NEIGHBOURS * d)
        return i[keep], k[keep]

    def contact_energy(self):
        """Contact energy of a loop (J): half of all ordered pairs."""
        flat, wale, course, arc = self.points()
        own = np.flatnonzero((wale == 0) & (course == 0))
        space = self.in_space(flat)
        i, k = self.touching(own, np.arange(len(flat)), course, arc, space)
        square = ((space[i] - space[k]) ** 2).sum(1)
        return 0.5 * self.weight * sum(law_at(s, self.model.scene.law)[0] for s in square)

    def cut(self):
        """Torque (N m), force (N) and the height (m) about which the torque is, in a cut.

        Course direction bent: the cut is the plane of mirror symmetry through the sinker arcs, per
        course.  There the yarn carries its couple and its tension.  The couple is taken from the two
        Gauss points beside it, where the curvature of a spline is most exact.  Wale direction
        bent: the cut runs between two courses, per wale, and meets contacts only.
        """
        torque = force = height = 0.0
        if self.bent == 0:
            low, high = 0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0)
            torque = (high**2 * self.couple(low) - low**2 * self.couple(high)) / (high**2 - low**2)
            height = self.at(0.0)[2]
            speed = (1.0 + self.kappa * height) * self.at(0.0, 1)[0]
            strain = speed * self.n / self.fabric.loop_length - 1.0
            force = stretch_at(strain, self.model.scene.stretch)[1]
        flat, wale, course, arc = self.points()
        if self.bent == 0:
            left, right = (course == 0) & (flat[:, 0] < 0.0), flat[:, 0] > 0.0
        else:
            left, right = (wale == 0) & (course <= 0), course > 0
        space = self.in_space(flat)
        i, k = self.touching(np.flatnonzero(left), np.flatnonzero(right), course, arc, space)
        for a, b in zip(i, k, strict=True):
            d = space[a] - space[b]
            f = -2.0 * law_at(d @ d, self.model.scene.law)[1] * self.weight * d
            torque += (space[a, 2] - height) * f[0] - space[a, 0] * f[2]
            force += f[0]
        return torque, force, height

    def couple(self, u):
        """Couple of the yarn about the axis of the cylinder at the parameter u (N m)."""
        k, b = self.kappa, self.bent
        p, v, a = (self.at(u, order) for order in range(3))
        m = 1.0 + k * p[2]
        velocity = np.array([m * v[b], v[1 - b], v[2]])
        acceleration = np.array(
            [m * a[b] + 2.0 * k * v[b] * v[2], a[1 - b], a[2] - k * m * v[b] ** 2]
        )
        speed = np.linalg.norm(velocity)
        t = velocity / speed
        turn = (acceleration - t * (t @ acceleration)) / speed * self.n / self.fabric.loop_length
        return self.fabric.bending_rigidity * (t[2] * turn[0] - t[0] * turn[2])


@pytest.fixture(scope="module")
def cotton():
    return relax(COTTON)


def twin_of(curve, step):
    bent = DIRECTIONS[curve.direction]
    return BentLoop(curve.model, curve.y[step], curve.curvature[step], bent)


@pytest.fixture(scope="module")
def fine_cotton(cotton):
    return relax(COTTON, Resolution(96, 2 * cotton.model.cell.contacts))


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_contact_energy_is_that_in_space(cotton, fine_cotton, direction):
    """Integrated over the yarns by many points, each with the law itself."""
    errors = []
    for relaxed in (cotton, fine_cotton):
        curve = bend(relaxed, direction, [0.0, 250.0, -250.0])
        energy = np.array([twin_of(curve, step).contact_energy() for step in range(3)])
        assert energy.min() > 0.0
        errors.append(np.abs(curve.energy[:, 2] / energy - 1.0).max())
    assert errors[0] < 0.03
    assert errors[1] < errors[0] / 4.0


def cut_errors(relaxed, direction):
    """Largest relative difference of the moment, largest force (N)."""
    curve = bend(relaxed, direction, [0.0, 200.0, -200.0])
    moment = curve.moment_per_width * curve.width
    cuts = np.array([twin_of(curve, step).cut() for step in range(3)])
    return np.abs(cuts[:, 0] / moment - 1.0).max(), np.abs(cuts[:, 1]).max()


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_moment_is_that_in_a_cut(cotton, fine_cotton, direction):
    coarse, force = cut_errors(cotton, direction)
    fine, fine_force = cut_errors(fine_cotton, direction)
    assert coarse < 0.015
    # Of second order at least.
    assert fine < coarse / 4.0
    # With spacings free the cut carries no force, so that any plane gives the same moment.
    assert fine_force < force / 4.0 or fine_force < 1e-6


def test_held_moment_is_about_the_mean_plane(fine_cotton):
    curve = bend(fine_cotton, "course", [150.0, -150.0], spacings="held")
    model = curve.model
    work = new_work(model.scene)
    for step in range(2):
        torque, force, height = twin_of(curve, step).cut()
        moment = curve.moment_per_width[step] * curve.width
        # The force in the cut is the derivative by the spacing at a given angle.
        y, scene = curve.y[step], model.scene._replace(bend=Bend(0))
        energy_of(scene, y, pairs_at(scene, y, 0.0, work), (), 1, work)
        exact = work.gradient[model.lattice]
        assert force == pytest.approx(exact, rel=0.05)
        # The hoop force is balanced by a pressure, the force that holds the mean plane; where that is
        # not even along the course, the moment in one cut is not quite the mean over all cuts.
        assert torque + height * exact == pytest.approx(moment, rel=0.01)
        # Here there is a force: the moment about another plane is another one.
        assert abs(height * force) > 0.02 * abs(moment)

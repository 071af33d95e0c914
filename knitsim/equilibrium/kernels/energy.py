"""Total energy of a scene with gradient and Hessian by the unknowns (compiled)."""

import math

import numpy as np

from knitsim.equilibrium.kernels.contact import add_flat_contact
from knitsim.equilibrium.kernels.curved import (
    add_bent_yarn,
    begin_kappa,
    end_kappa,
    no_kappa,
)
from knitsim.equilibrium.kernels.curved_contact import add_bent_contact
from knitsim.equilibrium.kernels.fixtures import add_couples, add_cylinders
from knitsim.equilibrium.kernels.pairs import expand, place_frames
from knitsim.equilibrium.kernels.records import LATTICE, Bent, Work
from knitsim.equilibrium.kernels.slip import add_friction
from knitsim.equilibrium.kernels.yarn import add_flat_yarn
from knitsim.jit import choose, leaf, njit


@leaf
def _nothing(scene, order, work):
    return 0.0


@leaf
def _frictionless(scene, lattice, slip, order, work):
    return 0.0


add_yarn = choose("scene.bend", add_bent_yarn, add_flat_yarn)
add_contact = choose("scene.bend", add_bent_contact, add_flat_contact)
clear_kappa = choose("scene.bend", begin_kappa, no_kappa)
chain_kappa = choose("scene.bend", end_kappa, no_kappa)
rubbing = choose("slip", add_friction, _frictionless)
pressed = choose("scene.fixtures", add_cylinders, _nothing)
turned = choose("scene.fixtures", add_couples, _nothing)


def new_work(scene):
    """Buffers for a scene."""
    rows, n = scene.map.rows.size, scene.load.size
    return Work(
        np.zeros(((rows - LATTICE) // 3, 3)),
        np.zeros((scene.touch.points.size, 9)),
        np.zeros(rows),
        np.zeros((rows, rows)),
        np.zeros(n),
        np.zeros((n, n)),
        np.zeros((n, n)),
        np.zeros(3),
        np.zeros(1),
        Bent(np.zeros(2), np.zeros(rows)),
    )


begin_work = njit(new_work)  # for kernels


@leaf
def reduce_gradient(map_, expanded, gradient):
    """gradient = C^T expanded."""
    gradient[:] = 0.0
    for r in range(expanded.size):
        g = expanded[r]
        for e in range(map_.rows[r].start, map_.rows[r].stop):
            gradient[map_.entries[e].column] += map_.entries[e].value * g


@leaf
def reduce_hessian(map_, half, hessian):
    """hessian = C^T (A + A^T) C for the half matrix A."""
    hessian[:] = 0.0
    rows = half.shape[0]
    for r in range(rows):
        for c in range(rows):
            h = half[r, c]
            if h == 0.0:
                continue
            for e in range(map_.rows[r].start, map_.rows[r].stop):
                hr = h * map_.entries[e].value
                i = map_.entries[e].column
                for f in range(map_.rows[c].start, map_.rows[c].stop):
                    hessian[i, map_.entries[f].column] += hr * map_.entries[f].value
    n = hessian.shape[0]
    for i in range(n):
        hessian[i, i] *= 2.0
        for j in range(i):
            total = hessian[i, j] + hessian[j, i]
            hessian[i, j] = total
            hessian[j, i] = total


@njit
def energy_of(scene, y, listed, slip, order, work):
    """Total energy (J) at y with the listed contact pairs and the friction of a step (Slip or ()).

    listed must cover y (:func:`knitsim.equilibrium.kernels.pairs.covers`).  Fills work.terms (without
    friction) and work.closest, with order >= 1 work.gradient, with order 2 work.hessian, all by y, with
    friction and the dead loads in them.
    """
    lattice = expand(scene.map, y, work.x)
    work.terms[:] = 0.0
    work.closest[0] = math.inf
    if order >= 1:
        work.expanded[:] = 0.0
    if order == 2:
        work.half[:] = 0.0
    clear_kappa(scene, lattice, order, work)
    add_yarn(scene, lattice, order, work)
    place_frames(scene.touch, work.x, work.points)
    work.terms[2] = add_contact(scene, lattice, listed, order, work) + pressed(scene, order, work)
    energy = work.terms[0] + work.terms[1] + work.terms[2] + turned(scene, order, work)
    energy += rubbing(scene, lattice, slip, order, work)
    chain_kappa(scene, lattice, order, work)
    for i in range(y.size):
        energy -= scene.load[i] * y[i]
    if order >= 1:
        reduce_gradient(scene.map, work.expanded, work.gradient)
        for i in range(y.size):
            work.gradient[i] -= scene.load[i]
    if order == 2:
        reduce_hessian(scene.map, work.half, work.hessian)
    return energy

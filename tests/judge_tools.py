"""Cells and yarns by the definition, for the tests of the judge."""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from knitsim.verification.judge.given import Barrier, Core, Given, design

LAW = ((0.0, 0.01, 0.07), (0.0, 0.44, 5.84))
D = 0.2793e-3
BARRIER = Given(5.56e-3, D, 5e-9, *LAW, Barrier(1000.0), 0.3, 12, 40)
CORE = dataclasses.replace(BARRIER, contact=Core(0.05 * D, 3e11, 2.4), bending_hysteresis=1e-7)
CELLS = ((1, 1), (2, 1), (1, 2), (2, 2))


def cell_of(given, rough, seed=7):
    """A cell filled with rough loops, each bent a little differently; its lattice is sheared."""
    control, lattice = rough
    random = np.random.default_rng(seed)
    lattice = lattice + [0.0, 3e-5, 1e-4, 0.0]
    wale, course = (np.append(step, 0.0) for step in lattice.reshape(2, 2))
    yarns = [
        np.concatenate([control + i * wale + j * course for i in range(given.wales)])
        for j in range(given.courses)
    ]
    return np.array(yarns) + 1e-5 * random.standard_normal(np.shape(yarns)), lattice


def sized(given, wales, courses):
    return dataclasses.replace(given, wales=wales, courses=courses)


def placed(given, control, lattice, curvature, bent, u, yarn, image):
    """Places in space (m, 3), (bent axis, other, thickness), of a yarn's image, by the definition."""
    matrix, turns = design(given.points * given.wales, u)
    cell = np.reshape(lattice, (2, 2)) * [[given.wales], [given.courses]]
    p = matrix @ control[yarn]
    p[:, :2] += turns[:, None] * cell[0] + np.array(image) @ cell
    x, y, z = p[:, bent], p[:, 1 - bent], p[:, 2]
    if curvature == 0.0:
        return np.stack([x, y, z], axis=1)
    angle, radius = curvature * x, 1.0 / curvature + z
    return np.stack([radius * np.sin(angle), y, radius * np.cos(angle) - 1.0 / curvature], axis=1)


def turning(given, control, lattice, curvature, bent, u, yarn):
    """Tangent, speed by u (m), and turning of the tangent per reference length, a vector (1/m), by
    differences in space; vectors as seen from where the cylinder has turned to."""
    step, span = 1e-3, given.loop_length / given.points
    before, at, after = (
        placed(given, control, lattice, curvature, bent, u + s, yarn, (0, 0))
        for s in (-step, 0.0, step)
    )
    v, a = (after - before) / (2 * step), (after - 2 * at + before) / step**2
    speed = np.linalg.norm(v, axis=1)
    angle = np.arctan2(at[:, 0], at[:, 2] + 1.0 / curvature) if curvature > 0.0 else 0.0 * u
    angle = np.arctan2(-at[:, 0], -at[:, 2] - 1.0 / curvature) if curvature < 0.0 else angle
    back = Rotation.from_rotvec(np.outer(-angle, [0.0, 1.0, 0.0]))
    turn = np.cross(v, a) / (speed**2 * span)[:, None]
    return back.apply(v / speed[:, None]), speed, back.apply(turn)

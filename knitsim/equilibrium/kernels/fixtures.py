"""Rigid cylinders that a yarn lies on, and couples at its ends (compiled).

What only the scenes of open yarns have (:class:`.records.Fixtures`).
"""

import math

from knitsim.equilibrium.kernels.contact import barrier_at, isotropic_plus
from knitsim.equilibrium.kernels.records import Law
from knitsim.jit import leaf


@leaf
def law_of(cylinder):
    """The barrier law of a cylinder."""
    return Law(cylinder.distance, 0.0, cylinder.stiffness, ())


@leaf
def from_axis(cylinders, c, points, i):
    """Vector from the axis of cylinder c straight to point i (m)."""
    p, t = cylinders[c].point, cylinders[c].axis
    a, b, e = points[i, 0] - p[0], points[i, 1] - p[1], points[i, 2] - p[2]
    along = a * t[0] + b * t[1] + e * t[2]
    return (a - along * t[0], b - along * t[1], e - along * t[2])


@leaf
def scatter_point(touch, i, force, gradient):
    """Add an energy gradient by the place of contact point i to the gradient by control points."""
    f = 3 * touch.points[i].first
    for axis in range(3):
        for a in range(4):
            gradient[f + 3 * a + axis] += touch.points[i].basis[a] * force[axis]


@leaf
def add_point(touch, i, h, half):
    """Add a Hessian by the place of contact point i, a symmetric 3 x 3 tuple, to ``half``."""
    f = 3 * touch.points[i].first
    for r in range(3):
        for q in range(3):
            for a in range(4):
                value = 0.5 * h[r][q] * touch.points[i].basis[a]
                for b in range(4):
                    half[f + 3 * a + r, f + 3 * b + q] += value * touch.points[i].basis[b]


@leaf
def add_cylinders(scene, order, work):
    """Contact energy of the yarn on the cylinders (J); order as in ``add_flat_contact``."""
    energy = 0.0
    touch, points, cylinders = scene.touch, work.points, scene.fixtures.cylinders
    for c in range(cylinders.size):
        t = cylinders[c].axis
        for i in range(points.shape[0]):
            d = from_axis(cylinders, c, points, i)
            square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            v, v1, v2 = barrier_at(square, law_of(cylinders[c]))
            if v == 0.0:
                continue
            energy += touch.points[i].length * v
            if order == 0:
                continue
            f = 2.0 * touch.points[i].length * v1
            scatter_point(touch, i, (f * d[0], f * d[1], f * d[2]), work.expanded)
            if order == 2:
                # The distance does not change along the axis: f (I - t t^T) + ... d d^T.
                s = 4.0 * touch.points[i].length * v2
                m = isotropic_plus(f, s, d)
                k = isotropic_plus(0.0, f, t)
                h = (
                    (m[0][0] - k[0][0], m[0][1] - k[0][1], m[0][2] - k[0][2]),
                    (m[1][0] - k[1][0], m[1][1] - k[1][1], m[1][2] - k[1][2]),
                    (m[2][0] - k[2][0], m[2][1] - k[2][1], m[2][2] - k[2][2]),
                )
                add_point(touch, i, h, work.half)
    return energy


@leaf
def add_couples(scene, order, work):
    """Energy - M theta of the couples (J), theta the angle of the tangent about the couple's axis."""
    energy, couples, x = 0.0, scene.fixtures.couples, work.x
    for c in range(couples.size):
        f, moment = couples[c].first, couples[c].moment
        n, e = couples[c].normal, couples[c].reference
        g = (
            n[1] * e[2] - n[2] * e[1],
            n[2] * e[0] - n[0] * e[2],
            n[0] * e[1] - n[1] * e[0],
        )
        a = b = 0.0
        for k in range(4):
            for axis in range(3):
                v = couples[c].d1[k] * x[f + k, axis]
                a += v * e[axis]
                b += v * g[axis]
        energy -= moment * math.atan2(b, a)
        square = a * a + b * b
        aa, ab = 2.0 * a * b / square**2, (b * b - a * a) / square**2
        for r in range(3):
            turn = -moment * (a * g[r] - b * e[r]) / square
            for k in range(4):
                if order >= 1:
                    work.expanded[3 * (f + k) + r] += couples[c].d1[k] * turn
            if order < 2:
                continue
            for q in range(3):
                h = (
                    -0.5
                    * moment
                    * (aa * (e[r] * e[q] - g[r] * g[q]) + ab * (e[r] * g[q] + g[r] * e[q]))
                )
                for k in range(4):
                    for m in range(4):
                        work.half[3 * (f + k) + r, 3 * (f + m) + q] += (
                            h * couples[c].d1[k] * couples[c].d1[m]
                        )
    return energy

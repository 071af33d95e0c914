"""The paper's inclination of the sections, eqs (2) and (3), as printed.

Kept beside :mod:`knitsim.loop.frames` to show what it does.  Between section i - 1 and i, in the
paper's axes (z course, y wale, x thickness)::

    theta_zx = arctan((x_i - x_(i-1)) / (z_i - z_(i-1)))    (2)
    theta_zy = arctan((y_i - y_(i-1)) / (z_i - z_(i-1)))    (3)

The section of the straight yarn, normal to z, is turned by both, one after the other; the paper
does not say which first.  Two successive turns miss the tangent; the arctangent of a ratio cannot
tell forwards from backwards, so that sections flip wherever z falls; and it is singular where z
rests.
"""

import math

import numpy as np

from knitsim.errors import InputError
from knitsim.loop.frames import Frames

ORDERS = ("zx_first", "zy_first")


def inclined_frames(points, arc, period, twist=0.0, order="zx_first"):
    """Sections (m, 3), m, inclined by eqs (2) and (3); arguments as rotation_minimising_frames.

    The ``tangents`` of the result are the inclined section normals, the ``normals`` the turned
    thickness axis, the ``binormals`` the turned wale axis, negative (right-handed); holonomy 0.
    Section 0 follows the last one of the loop before.  A ratio 0/0 counts as angle 0.
    """
    points = np.array(points, dtype=float)
    arc = np.array(arc, dtype=float)
    period = np.array(period, dtype=float)
    axis, first, second = _turned(np.diff(points, axis=0, prepend=points[-1:] - period), order)
    angle = 2 * math.pi * twist * arc[:-1, None]
    normals = np.cos(angle) * first - np.sin(angle) * second
    binormals = -np.cos(angle) * second - np.sin(angle) * first
    return Frames(points, axis, normals, binormals, arc, period, float(twist), 0.0)


def angle_error(directions, order="zx_first"):
    """Angle (...) in rad, 0 to pi, between section normals by eqs (2), (3) and the true directions.

    directions: (..., 3), course, wale, thickness; of the yarn, of any length.
    """
    directions = np.asarray(directions, dtype=float)
    axis = _turned(directions, order)[0]
    # From sine and cosine: arccos alone loses half the digits near 0.
    sine = np.linalg.norm(np.cross(axis, directions), axis=-1)
    return np.arctan2(sine, np.einsum("...i,...i->...", axis, directions))


def backward_share(directions):
    """Share (1) of the directions (n, 3) that run backwards course-wise, where sections flip."""
    return float(np.mean(np.asarray(directions)[:, 0] < 0))


def _turned(steps, order):
    """Course, thickness and wale axis (..., 3), turned by eqs (2) and (3) for steps (..., 3)."""
    if order not in ORDERS:
        raise InputError("order of the inclinations", order, f"must be one of {', '.join(ORDERS)}")
    course, wale, thickness = np.moveaxis(steps, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        zx = np.nan_to_num(np.arctan(thickness / course))  # eq (2)
        zy = np.nan_to_num(np.arctan(wale / course))  # eq (3)
    one, nil = np.ones_like(zx), np.zeros_like(zx)

    def matrix(rows):
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

    # Axes ordered course, wale, thickness: zx turns course towards thickness, zy towards wale.
    by_zx = matrix([[np.cos(zx), nil, -np.sin(zx)], [nil, one, nil], [np.sin(zx), nil, np.cos(zx)]])
    by_zy = matrix([[np.cos(zy), -np.sin(zy), nil], [np.sin(zy), np.cos(zy), nil], [nil, nil, one]])
    turn = by_zy @ by_zx if order == "zx_first" else by_zx @ by_zy
    return turn[..., :, 0], turn[..., :, 2], turn[..., :, 1]

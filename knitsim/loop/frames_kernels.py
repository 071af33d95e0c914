"""Compiled kernels: frames carried along a line without turning about it, and the fibres they carry.

Double reflection (Wang, Juettler, Zheng and Liu, ACM Trans. Graph. 27 (2008) 2), error of the turn
O(step^4): reflect in the plane that halves the chord, then in the one that takes the reflected tangent
to the next.
"""

import math

import numpy as np

from knitsim.jit import njit


@njit
def _first_normal(tx, ty, tz):
    """The thickness axis made perpendicular to a unit tangent; the wale axis if that is too close."""
    if abs(tz) < 0.9:
        rx, ry, rz = -tz * tx, -tz * ty, 1.0 - tz * tz
    else:
        rx, ry, rz = -ty * tx, 1.0 - ty * ty, -ty * tz
    scale = 1.0 / math.sqrt(rx * rx + ry * ry + rz * rz)
    return rx * scale, ry * scale, rz * scale


@njit
def _carried(rx, ry, rz, tx, ty, tz, ux, uy, uz, vx, vy, vz):
    """The normal r at the unit tangent t, carried over the chord v to the unit tangent u."""
    f = 2.0 / (vx * vx + vy * vy + vz * vz)
    g = f * (vx * rx + vy * ry + vz * rz)
    rx, ry, rz = rx - g * vx, ry - g * vy, rz - g * vz
    g = f * (vx * tx + vy * ty + vz * tz)
    wx, wy, wz = ux - tx + g * vx, uy - ty + g * vy, uz - tz + g * vz
    # On a straight piece the reflected tangent is -t: w = 2 t.  It is 0 at a hairpin only.
    size = wx * wx + wy * wy + wz * wz
    if size > 0.0:
        g = 2.0 * (wx * rx + wy * ry + wz * rz) / size
        rx, ry, rz = rx - g * wx, ry - g * wy, rz - g * wz
    # Keep rounding from adding up: perpendicular and of unit length again.
    g = ux * rx + uy * ry + uz * rz
    rx, ry, rz = rx - g * ux, ry - g * uy, rz - g * uz
    size = rx * rx + ry * ry + rz * rz
    if size < 1e-18:
        return _first_normal(ux, uy, uz)
    scale = 1.0 / math.sqrt(size)
    return rx * scale, ry * scale, rz * scale


@njit
def open_frames(points, tangents, normals):
    """Fill unit tangents and normals (m, 3) along an open line of points (m, 3), neighbours apart.

    A tangent halves the angle between the chords beside it.  Where the line turns straight back the
    chord behind stands in.
    """
    last = points.shape[0] - 1
    chord, t = np.empty(3), np.empty(3)
    for i in range(last + 1):
        t[:] = 0.0
        for j in range(max(i - 1, 0), min(i + 1, last)):
            chord[:] = points[j + 1] - points[j]
            t += chord / math.sqrt(np.sum(chord * chord))
        size = math.sqrt(np.sum(t * t))
        if size < 1e-9:
            t[:] = points[i] - points[i - 1]
            size = math.sqrt(np.sum(t * t))
        tangents[i] = t / size
        ux, uy, uz = tangents[i]
        if i == 0:
            normals[i] = _first_normal(ux, uy, uz)
        else:
            chord[:] = points[i] - points[i - 1]
            rx, ry, rz = normals[i - 1]
            tx, ty, tz = tangents[i - 1]
            vx, vy, vz = chord
            normals[i] = _carried(rx, ry, rz, tx, ty, tz, ux, uy, uz, vx, vy, vz)


@njit
def rmf_frames(points, tangents, arc, period, twist, normals, binormals):
    """Rotation-minimising frames over one period, closed, then twisted; returns the holonomy (rad).

    points, tangents: (m, 3), sections and unit tangents; section m is section 0 moved by ``period``
    (3,), with its tangent.  arc: (m + 1,) arc length from section 0, over which the closing turn is
    spread and along which ``twist`` (rad/m, right-handed positive) acts.
    Filled: normals, binormals (m, 3), with binormal = tangent x normal.

    The holonomy is the right-handed angle from the first normal to the one carried round to the next
    period, in (-pi, pi].
    """
    m = points.shape[0]
    px, py, pz = period[0], period[1], period[2]
    tx, ty, tz = tangents[0, 0], tangents[0, 1], tangents[0, 2]
    rx, ry, rz = _first_normal(tx, ty, tz)
    fx, fy, fz = rx, ry, rz
    normals[0, 0], normals[0, 1], normals[0, 2] = rx, ry, rz
    for i in range(m):
        if i + 1 < m:
            vx = points[i + 1, 0] - points[i, 0]
            vy = points[i + 1, 1] - points[i, 1]
            vz = points[i + 1, 2] - points[i, 2]
            ux, uy, uz = tangents[i + 1, 0], tangents[i + 1, 1], tangents[i + 1, 2]
        else:
            vx = points[0, 0] + px - points[i, 0]
            vy = points[0, 1] + py - points[i, 1]
            vz = points[0, 2] + pz - points[i, 2]
            ux, uy, uz = tangents[0, 0], tangents[0, 1], tangents[0, 2]
        rx, ry, rz = _carried(rx, ry, rz, tx, ty, tz, ux, uy, uz, vx, vy, vz)
        tx, ty, tz = ux, uy, uz
        if i + 1 < m:
            normals[i + 1, 0], normals[i + 1, 1], normals[i + 1, 2] = rx, ry, rz
    cosine = fx * rx + fy * ry + fz * rz
    bx, by, bz = ty * fz - tz * fy, tz * fx - tx * fz, tx * fy - ty * fx
    holonomy = math.atan2(bx * rx + by * ry + bz * rz, cosine)
    rate = twist - holonomy / arc[m]
    for i in range(m):
        rx, ry, rz = normals[i, 0], normals[i, 1], normals[i, 2]
        tx, ty, tz = tangents[i, 0], tangents[i, 1], tangents[i, 2]
        bx, by, bz = ty * rz - tz * ry, tz * rx - tx * rz, tx * ry - ty * rx
        c = math.cos(rate * arc[i])
        s = math.sin(rate * arc[i])
        normals[i, 0] = c * rx + s * bx
        normals[i, 1] = c * ry + s * by
        normals[i, 2] = c * rz + s * bz
        binormals[i, 0] = c * bx - s * rx
        binormals[i, 1] = c * by - s * ry
        binormals[i, 2] = c * bz - s * rz
    return holonomy


@njit
def fill_fibre_points(points, normals, binormals, layout, out):
    """Fill ``out`` (m, n, 3): fibre j of section i lies at points[i] + x_j normal + y_j binormal.

    points, normals, binormals: (m, 3).  layout: (n, 2), m, the fibres in the section.
    """
    m = points.shape[0]
    n = layout.shape[0]
    for i in range(m):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        bx, by, bz = binormals[i, 0], binormals[i, 1], binormals[i, 2]
        for j in range(n):
            x = layout[j, 0]
            y = layout[j, 1]
            out[i, j, 0] = px + x * nx + y * bx
            out[i, j, 1] = py + x * ny + y * by
            out[i, j, 2] = pz + x * nz + y * bz


@njit
def frames_of_states(points, tangents, arc, periods, twist, normals, binormals, holonomy):
    """:func:`rmf_frames` of each state: points, tangents, normals, binormals (k, m, 3).

    arc: (m + 1,), common to all states (the material's).  periods: (k, 3).  Filled also: holonomy
    (k,), rad.
    """
    for k in range(points.shape[0]):
        holonomy[k] = rmf_frames(
            points[k], tangents[k], arc, periods[k], twist, normals[k], binormals[k]
        )


@njit
def fibres_of_states(points, normals, binormals, layout, out):
    """:func:`fill_fibre_points` of each state: points and frames (k, m, 3), out (k, m, n, 3)."""
    for k in range(points.shape[0]):
        fill_fibre_points(points[k], normals[k], binormals[k], layout, out[k])

"""The fabric from the loops of one cell: images by the lattice, flat or rolled about a cylinder.

Loops are (loop, n, 3) (m) where they lie in the cell, a course after the other; the last point of a
loop is the first of the next one in its course.  A plain fabric has one: then (n, 3) will do.
"""

import numpy as np

from knitsim.errors import InputError


def cell_of(loops, courses=1):
    """``loops`` as (courses, wales, n, 3)."""
    loops = np.asarray(loops, dtype=float)
    if loops.ndim == 2:
        loops = loops[None]
    return loops.reshape(courses, -1, *loops.shape[1:])


def fabric_courses(
    loops, wale_spacing, course_spacing, loops_wide, loops_high, *, courses=1, slant=0.0
):
    """One continuous line a course: list of ``loops_high`` arrays (m, 3) (m).

    courses: in the cell.  slant (m): by how much a course lies further along the course than the one
    below it, in a sheared fabric.
    """
    cell = cell_of(loops, courses)
    lines = []
    for row in range(loops_high):
        turn, own = divmod(row, courses)
        up = turn * courses * np.array([slant, course_spacing, 0.0])
        parts = list(_images(cell[own], wale_spacing, loops_wide))
        line = np.concatenate([*(part[:-1] for part in parts), parts[-1][-1:]])
        lines.append(line + up)
    return lines


def _images(loops, wale_spacing, loops_wide):
    """Loops of one course of the cell and their images along it, ``loops_wide`` in all."""
    wales = len(loops)
    for column in range(loops_wide):
        turn, own = divmod(column, wales)
        yield loops[own] + [turn * wales * wale_spacing, 0.0, 0.0]


def rolled(points, curvature, shift, axis):
    """``points`` (..., 3) (m) of a bent fabric, moved on by ``shift`` (m) along the bent direction.

    axis: 0 if the course direction is curved, 1 if the wale direction is.  A fabric of this curvature
    (1/m, positive when the technical face is convex) lies on a cylinder whose axis is at thickness
    -1/curvature over coordinate 0, so the shift is a turn by curvature shift about it; at curvature 0
    it is a translation.  Raises InputError for another axis.
    """
    if axis not in (0, 1):
        raise InputError("axis", axis, "must be 0 (course) or 1 (wale)")
    angle = curvature * shift
    sine, cosine = np.sin(angle), np.cos(angle)
    moved = np.array(points, dtype=float)
    s, x = moved[..., axis].copy(), moved[..., 2].copy()
    # 2 sin^2(angle/2)/curvature = shift sin(angle/2) sinc(angle/2): nothing is lost at 0.
    half = np.sinc(0.5 * angle / np.pi)
    moved[..., axis] = s * cosine + x * sine + shift * np.sinc(angle / np.pi)
    moved[..., 2] = x * cosine - s * sine - shift * np.sin(0.5 * angle) * half
    return moved


def bent_courses(
    loops, wale_spacing, course_spacing, loops_wide, loops_high, curvature, axis, *, courses=1
):
    """As :func:`fabric_courses` for the loops of a fabric bent along ``axis`` (0 or 1)."""
    cell = cell_of(loops, courses)
    wales = cell.shape[1]
    lines = []
    for row in range(loops_high):
        turn, own = divmod(row, courses)
        parts = []
        for column in range(loops_wide):
            wide, loop = divmod(column, wales)
            shift = np.array([wide * wales * wale_spacing, turn * courses * course_spacing, 0.0])
            across = np.where(np.arange(3) == axis, 0.0, shift)
            parts.append(rolled(cell[own, loop], curvature, shift[axis], axis) + across)
        lines.append(np.concatenate([*(part[:-1] for part in parts), parts[-1][-1:]]))
    return lines

"""The fabric from one loop: images by the lattice, flat or rolled about a cylinder."""

import numpy as np

from knitsim.errors import InputError


def fabric_courses(loop, wale_spacing, course_spacing, loops_wide, loops_high):
    """One continuous line a course: list of ``loops_high`` arrays (m, 3) (m).

    loop: (n, 3), one loop, its last point the first one moved to the next wale.
    """
    along = np.array([wale_spacing, 0.0, 0.0])
    course = np.concatenate(
        [loop[:-1] + k * along for k in range(loops_wide)] + [loop[:1] + loops_wide * along]
    )
    return [course + [0.0, k * course_spacing, 0.0] for k in range(loops_high)]


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


def bent_courses(loop, wale_spacing, course_spacing, loops_wide, loops_high, curvature, axis):
    """As :func:`fabric_courses` for a loop (n, 3) of a fabric bent along ``axis`` (0 or 1)."""
    if axis == 0:
        parts = [rolled(loop, curvature, k * wale_spacing, 0) for k in range(loops_wide)]
        course = np.concatenate([part[:-1] for part in parts] + [parts[-1][-1:]])
        return [course + [0.0, k * course_spacing, 0.0] for k in range(loops_high)]
    flat = fabric_courses(loop, wale_spacing, course_spacing, loops_wide, 1)[0]
    return [rolled(flat, curvature, k * course_spacing, 1) for k in range(loops_high)]

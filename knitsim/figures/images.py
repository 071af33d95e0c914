"""Images of a bent loop: the fabric of which one loop of a bending test is a part."""

import numpy as np

from knitsim.errors import InputError

DIRECTIONS = ("course", "wale")


def turn_along(points, curvature, direction, shift):
    """The image of bent ``points`` (..., 3) (m) that the flat fabric has ``shift`` (m) further on.

    Pure bending with the curvature (1/m) turns it by curvature times shift about the cylinder's axis,
    which lies at the coordinate 0 of the bent ``direction`` and at the thickness -1/curvature, the
    middle surface being at 0.  Without curvature the image is shifted.
    """
    if direction not in DIRECTIONS:
        raise InputError("direction", direction, f"must be one of {', '.join(DIRECTIONS)}")
    along = DIRECTIONS.index(direction)
    angle = curvature * shift
    sine, cosine = np.sin(angle), np.cos(angle)
    # sin(angle)/curvature and (1 - cos(angle))/curvature; numpy's sinc is that of pi x.
    chord = shift * np.sinc(angle / np.pi)
    rise = shift * np.sin(0.5 * angle) * np.sinc(0.5 * angle / np.pi)
    points = np.asarray(points, dtype=float)
    turned = points.copy()
    turned[..., along] = points[..., along] * cosine + points[..., 2] * sine + chord
    turned[..., 2] = points[..., 2] * cosine - points[..., along] * sine - rise
    return turned


def bent_fabric(centreline, curvature, direction, wale_spacing, course_spacing, wide, high):
    """One polyline per course (m, 3) (m) of a bent fabric of ``wide`` wales and ``high`` courses.

    centreline: (m, 3), one bent loop with the first point of the next one, the bent direction's
    coordinate measured from the edge at which the loop's thickness coordinate is that of the flat
    fabric.  Along the bent direction the images are turned, across it they are shifted.  The middle
    of the fabric lies flat, with its loops' edges at the origin.
    """
    loop = np.asarray(centreline, dtype=float)
    if loop.ndim != 2 or loop.shape[1] != 3 or len(loop) < 3 or not np.isfinite(loop).all():
        raise InputError("centreline", loop.shape, "finite points (m, 3), at least 3 of them")
    courses = []
    for row in np.arange(high) - 0.5 * high:
        loops = []
        for column in np.arange(wide) - 0.5 * wide:
            if direction == "course":
                image = turn_along(loop, curvature, direction, column * wale_spacing)
                image[:, 1] += row * course_spacing
            else:
                image = turn_along(loop, curvature, direction, row * course_spacing)
                image[:, 0] += column * wale_spacing
            # The last point of a loop is the first of the next one.
            loops.append(image[:-1] if column < 0.5 * wide - 1 else image)
        courses.append(np.concatenate(loops))
    return courses

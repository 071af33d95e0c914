"""Loops to start from: right topology for any sizes and patterns, no equation that may lack a solution.

On the half loop, t in [0, 1] from sinker arc to head:
x = w t/2 + A sin 2 pi t, y = -(H/2) cos pi t.
A makes neighbouring legs overlap sideways by a given width, H gives the loop its length.  The middle of
each leg lies in the plane of the fabric, the sinker arc behind it where the stitch is knit and before it
where it is purl, the head where the stitch above is knit or purl:
z = -(Z/2) s (1 + cos 2 pi t), s = 1 for knit, -1 for purl, of the own stitch up to the middle of the leg,
of the stitch above beyond.  Between a knit and a purl stitch the sinker arc goes through the plane.
"""

import math

import numpy as np
from scipy.optimize import brentq

from knitsim.equilibrium import spline
from knitsim.equilibrium.cell import pack
from knitsim.errors import ComputationError

THROUGH = (
    0.08  # of half a loop: within this of the middle of a sinker arc it goes through the plane
)


def _plane(t, width, side, height):
    """x, y of the half loop."""
    return np.stack(
        [0.5 * width * t + side * np.sin(2 * np.pi * t), -0.5 * height * np.cos(np.pi * t)], axis=-1
    )


def _length(width, side, height, thick):
    """Length of the whole loop (two halves)."""
    t = (np.arange(200) + 0.5) / 200
    v = np.stack(
        [
            0.5 * width + 2 * np.pi * side * np.cos(2 * np.pi * t),
            0.5 * np.pi * height * np.sin(np.pi * t),
            np.pi * thick * np.sin(2 * np.pi * t),
        ]
    )
    return 2.0 * np.sqrt((v**2).sum(0)).mean()


def _overlap(side, width):
    """How far the leg runs back over its neighbour's: x(t1) - x(1 - t1) at the turning point t1."""
    ratio = width / (4 * np.pi * side)
    if ratio >= 1.0:
        return 0.0
    t = math.acos(-ratio) / (2 * np.pi)
    return 0.5 * width * (2 * t - 1) + 2 * side * math.sin(2 * np.pi * t)


def _sizes(width, length, overlap, thick):
    """A and H of a loop.  Raises ComputationError where the loop length does not suffice."""
    side = brentq(
        lambda a: _overlap(a, width) - overlap,
        width / (4 * np.pi),
        width + overlap,
        xtol=1e-9 * width,
    )
    flat = _length(width, side, 0.0, thick)
    if flat >= length:
        raise ComputationError(
            f"no loop of length {length:g} m has wale spacing {width:g} m and legs that overlap by "
            f"{overlap:g} m: these alone take {flat:g} m"
        )
    height = brentq(
        lambda h: _length(width, side, h, thick) - length, 0.0, length, xtol=1e-9 * length
    )
    return side, height


def starting_loops(pattern, wale_spacing, course_spacing, lengths, overlap, thick, points):
    """Positions of all loops of a pattern, (courses, wales points, 3), m, at even places of the yarn.

    lengths (courses,): of a loop in each course; overlap: how far legs run back sideways; thick: how far
    sinker arcs and heads lie from the plane (all m).  Raises ComputationError where the loop length
    does not suffice.
    """
    found = []
    half = points // 2
    for course, length in enumerate(lengths):
        side, height = _sizes(wale_spacing, length, overlap, thick)
        t = np.linspace(0.0, 1.0, 2001)
        plane = _plane(t, wale_spacing, side, height)
        rise = thick * (1.0 + np.cos(2.0 * np.pi * t)) / 2.0
        fine = np.column_stack([plane, rise])
        arc = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(fine, axis=0) ** 2).sum(1)))])
        at = np.interp(np.arange(half + 1) * arc[-1] / half, arc, t)
        leg = _plane(at, wale_spacing, side, height)
        down = leg[-2:0:-1] * [-1.0, 1.0] + [wale_spacing, 0.0]
        loop = np.concatenate([leg, down])
        place = np.concatenate([at, at[-2:0:-1]])  # t along both legs
        for wale in range(pattern.wales):
            z = _thickness(pattern, wale, course, place, thick)
            shift = [wale * wale_spacing, course * course_spacing]
            found.append(np.column_stack([loop + shift, z]))
    return np.array(found).reshape(len(lengths), -1, 3)


def _thickness(pattern, wale, course, t, thick):
    """z of a loop at the places t of its two legs."""
    sign = {"k": 1.0, "p": -1.0}
    own, above = sign[pattern.stitch(wale, course)], sign[pattern.stitch(wale, course + 1)]
    n = len(t)
    beside = np.where(
        np.arange(n) <= n // 2,
        sign[pattern.stitch(wale - 1, course)],
        sign[pattern.stitch(wale + 1, course)],
    )
    # Half way between the stitches it lies in their mean.
    share = np.clip(t / THROUGH, 0.0, 1.0)
    low = 0.5 * (own + beside) + share * (own - 0.5 * (own + beside))
    profile = np.where(t <= 0.5, low, above)
    return -0.5 * thick * profile * (1.0 + np.cos(2.0 * np.pi * t))


def start_from(model, overlap, thick, wale_spacing=None, course_spacing=None):
    """Unknowns of a start at these spacings (m), the stated ones where None."""
    fabric, cell = model.fabric, model.cell
    w = fabric.wale_spacing if wale_spacing is None else wale_spacing
    c = fabric.course_spacing if course_spacing is None else course_spacing
    loops = starting_loops(
        fabric.pattern, w, c, fabric.lengths(fabric.pattern.courses), overlap, thick, cell.points
    )
    control = np.array(
        [spline.interpolate_periodic(own, [fabric.pattern.wales * w, 0.0, 0.0]) for own in loops]
    )
    control[:, :, 2] -= control[:, :, 2].mean()
    wide, high = cell.wales // fabric.pattern.wales, cell.courses // fabric.pattern.courses
    step = np.array([fabric.pattern.wales * w, 0.0, 0.0])
    rise = np.array([0.0, fabric.pattern.courses * c, 0.0])
    control = np.concatenate([control + i * step for i in range(wide)], axis=1)
    control = np.concatenate([control + j * rise for j in range(high)], axis=0)
    return pack(cell, control, [w, 0.0, 0.0, c])

"""Sections of the yarn along its centre line: where each fibre of the loop lies.

The paper inclines each section by two angles, eqs (2) and (3); those fail (see
:mod:`knitsim.loop.inclination`).  Here each section stands on the tangent, carried along without
turning about it, and the yarn's twist is put on top.
"""

import math
from dataclasses import dataclass

import numpy as np

from knitsim.errors import InputError
from knitsim.loop.frames_kernels import fill_fibre_points, open_frames, rmf_frames


@dataclass(frozen=True, eq=False)
class Frames:
    """Sections of one loop: points, tangents, normals, binormals (m, 3); binormal = t x n.

    arc: (m + 1,), m.  period: (3,), m.  twist: turns per m, Z positive.  holonomy: rad, the turn by
    which the frames carried round one loop missed the first; spread linearly along the arc length.
    The frames of the next loop are these, moved by the period and turned by :attr:`turn_per_loop`.
    """

    points: np.ndarray
    tangents: np.ndarray
    normals: np.ndarray
    binormals: np.ndarray
    arc: np.ndarray
    period: np.ndarray
    twist: float
    holonomy: float

    @property
    def turn_per_loop(self):
        """Angle (rad, right-handed) by which the twist turns the sections over one loop."""
        return 2 * math.pi * self.twist * float(self.arc[-1])

    def fibre_points(self, layout):
        """Points (m, n, 3), m, of n fibres that lie at ``layout`` (n, 2), m, in every section."""
        layout = np.array(layout, dtype=float)
        if layout.ndim != 2 or layout.shape[1] != 2 or not np.isfinite(layout).all():
            raise InputError("fibre layout", f"shape {layout.shape}", "must be finite and (n, 2)")
        out = np.empty((len(self.points), len(layout), 3))
        fill_fibre_points(self.points, self.normals, self.binormals, layout, out)
        return out


def rotation_minimising_frames(points, tangents, arc, period, twist=0.0):
    """Closed rotation-minimising frames at sections (m, 3), with twist on top.

    points: m.  tangents: any length but 0.  arc: (m + 1,), m, rising from 0; the last is where the
    image of the first section lies.  period: (3,), m.  twist: turns per m of ``arc``, right-handed
    (Z) positive; in a deformed state give the undeformed arc length, for twist stays in the yarn.

    Raises InputError for shapes that do not fit, fewer than 3 sections, repeated points.
    """
    points = np.ascontiguousarray(points, dtype=float)
    tangents = np.array(tangents, dtype=float)
    arc = np.ascontiguousarray(arc, dtype=float)
    period = np.ascontiguousarray(period, dtype=float)
    m = len(points)
    if (
        m < 3
        or points.shape != (m, 3)
        or tangents.shape != (m, 3)
        or arc.shape != (m + 1,)
        or period.shape != (3,)
    ):
        raise InputError(
            "sections", f"{points.shape}, {tangents.shape}, {arc.shape}, {period.shape}",
            "must be points and tangents (m, 3), m >= 3, arc length (m + 1,) and period (3,)",
        )  # fmt: skip
    if not all(np.isfinite(x).all() for x in (points, tangents, arc, period, np.array(twist))):
        raise InputError("sections", "nan or inf", "every number must be finite")
    if arc[0] != 0 or (np.diff(arc) <= 0).any():
        raise InputError("sections", "arc length", "must rise from 0")
    closed = np.concatenate([points, points[:1] + period])
    if (np.linalg.norm(np.diff(closed, axis=0), axis=1) == 0).any():
        raise InputError("sections", "two successive points", "must not coincide")
    norm = np.linalg.norm(tangents, axis=1)
    if (norm == 0).any():
        raise InputError("sections", "tangent 0", "must have a direction")
    tangents /= norm[:, None]
    normals, binormals = np.empty((m, 3)), np.empty((m, 3))
    holonomy = rmf_frames(
        points, tangents, arc, period, 2 * math.pi * float(twist), normals, binormals
    )
    return Frames(points, tangents, normals, binormals, arc, period, float(twist), float(holonomy))


def loop_frames(loop, sections=100, twist=0.0):
    """Frames of a :class:`~knitsim.loop.build.Loop` at sections of equal arc length.

    twist: turns per m, Z positive.
    """
    u, arc = loop.sections(sections)
    period = loop.spline.period
    return rotation_minimising_frames(loop.points(u), loop.derivative(u), arc, period, twist)


def line_frames(points):
    """Unit (tangents, normals) carried along an open line, (m, 3) each; points (m, 3), neighbours apart."""
    points = np.ascontiguousarray(points, dtype=float)
    tangents, normals = np.empty_like(points), np.empty_like(points)
    open_frames(points, tangents, normals)
    return tangents, normals

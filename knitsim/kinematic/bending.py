"""The paper's pure bending of a fabric, section 2.5, eqs (6)-(11), in course and wale direction.

The direction named is the one that becomes curved.  Curvature is positive when the technical face is
convex.  The middle surface is the mean plane of the centre line; it keeps its length.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.errors import InputError
from knitsim.kinematic import bending_kernels
from knitsim.loop.frames import loop_frames
from knitsim.loop.frames_kernels import fibres_of_states

DIRECTIONS = ("course", "wale")
FORMS = ("corrected", "printed")


@dataclass(frozen=True, eq=False)
class BendingCurve:
    """A bending test; every array has shape (steps,).

    curvature (1/m); recovery (bool): the curvature moves towards 0.  yarn_length (m), yarn_strain (1),
    yarn_tension (N), energy (J per loop, stretch), moment_per_width (N, derivative of the energy per
    area by the curvature), beyond_breaking_strain (bool).  The printed form gives positions only: its
    forces are not a number, as a position of eqs (6)-(11) does not depend on the thickness coordinate.
    """

    direction: str
    form: str
    model_length: float
    middle: float
    curvature: np.ndarray
    recovery: np.ndarray
    yarn_length: np.ndarray
    yarn_strain: np.ndarray
    yarn_tension: np.ndarray
    energy: np.ndarray
    moment_per_width: np.ndarray
    beyond_breaking_strain: np.ndarray


def sweep(largest, steps):
    """Curvatures from -largest to +largest (1/m) through zero, shape (steps + 1,), and the mask where
    they move towards zero.

    Raises InputError for an odd number of steps, which would miss zero.
    """
    if steps % 2:
        raise InputError("steps", steps, "must be even, so that zero curvature is among the states")
    # Built from whole numbers: symmetric to the last bit, and exactly zero in the middle.
    curvature = largest * np.arange(-steps // 2, steps // 2 + 1) / (steps // 2)
    return curvature, np.arange(steps + 1) <= steps // 2


def middle_height(loop):
    """Mean thickness coordinate of the centre line (m), by arc length."""
    speed = np.linalg.norm(loop.derivative(loop.nodes), axis=1) * loop.weights
    return float((loop.points(loop.nodes)[:, 2] * speed).sum() / speed.sum())


def bending_test(loop, law, direction, curvature, recovery, *, form="corrected", loops=1):
    """Bend the fabric through the curvatures (steps,) (1/m), eqs (6)-(11).

    loop: knitsim.loop.build.Loop; law: TensionLaw of the yarn; recovery: mask (steps,); form:
    ``corrected`` or ``printed``; loops: length L of the bent model in loops (K = kappa L), which only
    the printed form depends on.  A yarn cannot push: no tension at a negative strain.

    Returns a :class:`BendingCurve`.  Raises InputError for a curvature at which a part of the yarn
    would lie beyond the cylinder's axis.
    """
    if direction not in DIRECTIONS:
        raise InputError("direction", direction, f"must be one of {', '.join(DIRECTIONS)}")
    if form not in FORMS:
        raise InputError("form", form, f"must be one of {', '.join(FORMS)}")
    along = DIRECTIONS.index(direction)
    spacing = (loop.wale_spacing, loop.course_spacing)[along]
    weights = loop.weights
    middle = middle_height(loop)
    thickness = loop.points(loop.nodes)[:, 2] - middle
    largest = np.abs(curvature).max()
    reach = np.abs(thickness).max() + 0.5 * loop.diameter
    if largest * reach >= 1.0:
        raise InputError(
            "max_curvature",
            f"{largest:g} per m",
            f"must be below {1.0 / reach:.4g} per m, where the fabric's half thickness"
            f" {reach * 1e3:.3g} mm reaches the axis of the cylinder",
        )
    derivative = loop.derivative(loop.nodes)
    squares = np.ascontiguousarray(derivative[:, [along, 1 - along, 2]].T ** 2)
    out = np.empty((2, curvature.size))
    bending_kernels.bent_lengths(curvature, squares, thickness, weights, out)
    rest = np.empty((2, 1))
    bending_kernels.bent_lengths(np.zeros(1), squares, thickness, weights, rest)
    if form == "printed":
        out[:] = np.nan
    strain = out[0] / rest[0, 0] - 1.0
    slack = strain < 0.0
    tension = np.where(slack, 0.0, law.tension_at(strain))
    energy = np.where(slack, 0.0, rest[0, 0] * law.energy_at(strain))
    area = loop.wale_spacing * loop.course_spacing
    return BendingCurve(
        direction=direction,
        form=form,
        model_length=loops * spacing,
        middle=middle,
        curvature=curvature,
        recovery=recovery,
        yarn_length=out[0],
        yarn_strain=strain,
        yarn_tension=tension,
        energy=energy,
        moment_per_width=tension * out[1] / area,
        beyond_breaking_strain=strain > law.breaking_strain,
    )


def bent_points(curve, points, steps=slice(None)):
    """``points`` (n, 3) of the flat fabric (m) in the given steps of the test: (steps, n, 3) (m).

    The fixed edge is at coordinate 0 along the bent direction; the thickness coordinate of the result
    is measured from the middle surface at that edge.
    """
    curvature = np.ascontiguousarray(curve.curvature[steps])
    flat = np.array(points, dtype=float)
    flat[:, 2] -= curve.middle
    out = np.empty((curvature.size, *flat.shape))
    along = DIRECTIONS.index(curve.direction)
    if curve.form == "printed":
        bending_kernels.bend_points_printed(flat, curvature, along, curve.model_length, out)
    else:
        bending_kernels.bend_points(flat, curvature, along, out)
    return out


def fibre_points(loop, curve, layout, twist=0.0, sections=100, steps=slice(None)):
    """Every fibre point of the given steps: (steps, sections, fibres, 3) (m).

    layout: (fibres, 2), m, in the section; twist: turns per m, Z positive.  Sections stand on the bent
    centre line.  Raises InputError for the printed form, whose positions lose the thickness.
    """
    if curve.form == "printed":
        raise InputError("form", curve.form, "must be corrected: the printed one has no sections")
    frames = loop_frames(loop, sections, twist)
    points = bent_points(curve, frames.points, steps)
    normals, binormals = np.empty_like(points), np.empty_like(points)
    bending_kernels.bend_frames(
        frames.points - [0.0, 0.0, curve.middle], frames.tangents, frames.normals,
        np.ascontiguousarray(curve.curvature[steps]), DIRECTIONS.index(curve.direction),
        normals, binormals,
    )  # fmt: skip
    out = np.empty((*points.shape[:2], len(layout), 3))
    fibres_of_states(points, normals, binormals, np.ascontiguousarray(layout), out)
    return out

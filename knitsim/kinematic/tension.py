"""The paper's tensile test of a fabric, sections 2.3 and 2.4: every section moves in proportion.

Pulled along the course, eq (4), or the wale, eq (5), all sections move by the length ratio; across
the pull the loop contracts down to a limit.  A :class:`Reading` says how the paper is read: each
choice is either the corrected one or the one printed.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.errors import InputError
from knitsim.kinematic import tension_kernels
from knitsim.loop.frames_kernels import fibres_of_states, frames_of_states
from knitsim.loop.lattice import smallest_distance

DIRECTIONS = ("course", "wale")
# Index of the coordinate pulled and the one across, by direction.
_AXES = {"course": (0, 1), "wale": (1, 0)}
HALF = 0.5
# Curve parameters at which the extent of a loop is read: the head (u = 1/2) is among them.
_FINE = np.linspace(0.0, 1.0, 2001)


@dataclass(frozen=True)
class Reading:
    """How the paper's tensile test is read.

    positions: ``corrected``, z' = zO + r (z - zO), or ``printed``, B' = B OB/OC, which knows no r and
    leaves the edge where it is.
    contraction: ``isometric`` (the yarn keeps its length until the limit), ``linear`` (the limit is
    reached at the largest strain) or ``none``.
    limit: ``half`` (of the loop's height or the wale spacing) or, course-wise, ``course_spacing``
    (the loop becomes shorter by one course spacing).
    strain: of the ``yarn`` or of the ``fabric``, in tension = k3 strain.
    law: ``continuous`` or ``printed`` form of the tension law.
    viscous: with F = c v between the fibres, against the motion.
    """

    positions: str = "corrected"
    contraction: str = "isometric"
    limit: str = "half"
    strain: str = "yarn"
    law: str = "continuous"
    viscous: bool = False

    CHOICES = {  # noqa: RUF012 - a constant of the class, not a field
        "positions": ("corrected", "printed"),
        "contraction": ("isometric", "linear", "none"),
        "limit": ("half", "course_spacing"),
        "strain": ("yarn", "fabric"),
        "law": ("continuous", "printed"),
    }

    def __post_init__(self):
        for name, choices in self.CHOICES.items():
            if getattr(self, name) not in choices:
                raise InputError(name, getattr(self, name), f"must be one of {', '.join(choices)}")
        if self.positions == "printed" and self.contraction == "isometric":
            raise InputError(
                "contraction",
                "isometric",
                "must be linear or none with printed positions, which do not follow the pull",
            )


@dataclass(frozen=True, eq=False)
class TensionCurve:
    """A tensile test; every array has shape (steps,), loading first, then recovery.

    strain (1): engineering, of the fabric, along the pull.  scale_along, scale_across (1): of the
    loop's coordinates.  yarn_length (m), yarn_strain (1), yarn_tension (N, with F = c v),
    friction_force (N, positive on loading), force_per_loop (N, the force that does the work),
    force_per_width (N/m), energy (J per loop, stretch), work and dissipated (J per loop, cumulative),
    beyond_breaking_strain (bool), recovery (bool).
    """

    direction: str
    reading: Reading
    strain: np.ndarray
    recovery: np.ndarray
    scale_along: np.ndarray
    scale_across: np.ndarray
    yarn_length: np.ndarray
    yarn_strain: np.ndarray
    yarn_tension: np.ndarray
    friction_force: np.ndarray
    force_per_loop: np.ndarray
    force_per_width: np.ndarray
    energy: np.ndarray
    work: np.ndarray
    dissipated: np.ndarray
    beyond_breaking_strain: np.ndarray


def loop_height(loop):
    """Extent of one loop along the wale (m)."""
    return np.ptp(loop.points(_FINE)[:, 1])


def contraction_limit(loop, direction, limit):
    """Smallest scale across the pull: 0.5, or what is left when one course spacing is taken off."""
    if limit == "half":
        return HALF
    if direction == "wale":
        raise InputError("limit", limit, "must be half when the wale is pulled")
    height = loop_height(loop)
    if height <= loop.course_spacing:
        raise InputError(
            "limit",
            limit,
            f"must be half: this loop is only {height / loop.course_spacing:.3g}"
            " courses high and would shrink to nothing",
        )
    return 1.0 - loop.course_spacing / height


def _centre_and_edge(loop, direction):
    """Fixed centre O and distance OC to the edge along the pull, eqs (4), (5) (m).

    Course-wise O is the middle of the loop (Fig. 6), wale-wise its bottom (Fig. 8: h is measured from
    the bottom of the loop, H is its height).
    """
    if direction == "course":
        return 0.5 * loop.wale_spacing, 0.5 * loop.wale_spacing
    wale = loop.points(_FINE)[:, 1]
    return wale.min(), np.ptp(wale)


def _squares(loop, direction, positions):
    """Squared derivatives at the Gauss points, as tension_kernels wants them, and the weights."""
    nodes = loop.nodes
    along, across = _AXES[direction]
    derivative = loop.derivative(nodes)
    pulled = derivative[:, along]
    if positions == "printed":
        # z' = zO + (z - zO)|z - zO|/OC, so dz'/dz = 2 |z - zO|/OC.
        centre, edge = _centre_and_edge(loop, direction)
        pulled = pulled * 2.0 * np.abs(loop.points(nodes)[:, along] - centre) / edge
    squares = np.stack([pulled, derivative[:, across], derivative[:, 2]]) ** 2
    return np.ascontiguousarray(squares), loop.weights


def tensile_test(
    loop, law, direction, strains, reading, *, friction_coefficient=0.0, velocity=0.0, recovery=True
):
    """Load the fabric along ``direction`` (``course`` or ``wale``) to the ``strains``, and recover.

    loop: knitsim.loop.build.Loop; law: TensionLaw of the yarn (in the form that the reading names);
    strains: shape (n,), rising from 0; friction_coefficient c (N s/m) and velocity v (m/s) for
    F = c v.  Recovery goes back through the same strains.  Without F = c v it retraces the loading, as
    the paper's tension is a function of strain alone.

    A yarn cannot push: at a negative strain the corrected readings hold no tension; the readings with
    the printed law keep the paper's k3 strain, sign included.

    Returns a :class:`TensionCurve`.  Raises InputError for a bad direction or strains.
    """
    if direction not in DIRECTIONS:
        raise InputError("direction", direction, f"must be one of {', '.join(DIRECTIONS)}")
    strains = np.asarray(strains, dtype=float)
    if (
        strains.ndim != 1
        or strains.size < 2
        or strains[0] != 0.0
        or not (np.diff(strains) > 0).all()
    ):
        raise InputError("strains", strains.tolist(), "must rise from 0")
    squares, weights = _squares(loop, direction, reading.positions)
    limit = contraction_limit(loop, direction, reading.limit)
    pulls = 1.0 + strains
    path = np.empty((3, strains.size))
    if reading.contraction == "isometric":
        tension_kernels.follow_isometric(pulls, limit, squares, weights, path)
    else:
        rate = (1.0 - limit) / strains[-1] if reading.contraction == "linear" else 0.0
        follow = (
            tension_kernels.follow_printed
            if reading.positions == "printed"
            else tension_kernels.follow_linear
        )
        follow(pulls, rate, limit, squares, weights, path)
    across, length, slope = path
    spacing, width = _spacings(loop, direction)
    # The rest length is the quadrature's own, so that strain is exactly zero at rest; also for the
    # printed positions, which are not the starting state even at r = 1.
    rest = tension_kernels.scaled_length(1.0, 1.0, *_squares(loop, direction, "corrected"))[0]
    length[0] = rest
    yarn_strain = length / rest - 1.0
    felt = yarn_strain if reading.strain == "yarn" else strains
    tension, energy = law.tension_at(felt), rest * law.energy_at(felt)
    if reading.law != "printed":
        slack = felt < 0.0
        tension, energy = np.where(slack, 0.0, tension), np.where(slack, 0.0, energy)
    # dE/d(spacing pulled) along the path; with the strain of the fabric the energy follows the pull.
    elastic = tension * (slope if reading.strain == "yarn" else rest) / spacing

    phases = [(np.arange(strains.size), 1.0)]
    if recovery:
        phases.append((np.arange(strains.size - 1)[::-1], -1.0))
    index = np.concatenate([where for where, _ in phases])
    sign = np.concatenate([np.full(where.size, s) for where, s in phases])
    friction = sign * (friction_coefficient * velocity if reading.viscous else 0.0)
    # F = c v resists the change of the yarn's length; its virtual work is F |dL|.
    drag = friction * np.abs(slope[index]) / spacing
    force = elastic[index] + drag
    dissipated = np.cumsum(np.abs(friction * np.diff(length[index], prepend=length[0])))
    return TensionCurve(
        direction=direction,
        reading=reading,
        strain=strains[index],
        recovery=sign < 0,
        scale_along=np.ones(index.size) if reading.positions == "printed" else pulls[index],
        scale_across=across[index],
        yarn_length=length[index],
        yarn_strain=yarn_strain[index],
        yarn_tension=tension[index] + friction,
        friction_force=friction,
        force_per_loop=force,
        force_per_width=force / width,
        energy=energy[index],
        work=energy[index] - energy[0] + dissipated,
        dissipated=dissipated,
        beyond_breaking_strain=felt[index] > law.breaking_strain,
    )


def _spacings(loop, direction):
    """The spacing pulled and the one across (m)."""
    pair = loop.wale_spacing, loop.course_spacing
    return pair if direction == "course" else pair[::-1]


def deformed_points(loop, curve, points, steps=slice(None)):
    """``points`` (n, 3) of the undeformed loop in the given steps of the test: (steps, n, 3) (m).

    The centre stays: z' = zO + r (z - zO) along the pull, eqs (4), (5), and likewise across it.
    """
    along, across = _AXES[curve.direction]
    centre, edge = _centre_and_edge(loop, curve.direction)
    moved = np.repeat(points[None], np.arange(curve.strain.size)[steps].size, axis=0)
    offset = points[:, along] - centre
    if curve.reading.positions == "printed":
        # B' = B OB/OC; the starting state is the fabric as it stands.
        moved[..., along] = centre + offset * np.abs(offset) / edge
        at_rest = curve.strain[steps] == 0.0
        moved[at_rest, :, along] = points[:, along]
    else:
        moved[..., along] = centre + curve.scale_along[steps, None] * offset
    other = _centre_and_edge(loop, DIRECTIONS[across])[0]
    moved[..., across] = other + curve.scale_across[steps, None] * (points[:, across] - other)
    return moved


def deformed_spacings(loop, curve):
    """Wale and course spacing (m) in every step of the test, (steps,) each."""
    along, across = curve.scale_along, curve.scale_across
    wale, course = (along, across) if curve.direction == "course" else (across, along)
    return loop.wale_spacing * wale, loop.course_spacing * course


def smallest_distances(loop, curve, points):
    """Smallest distance of yarn centre lines (diameters) in every step, (steps,).

    points: as from :func:`deformed_points` for all steps, the last the first of the next loop.
    """
    found = np.empty(curve.strain.size)
    for k, (wale, course) in enumerate(zip(*deformed_spacings(loop, curve), strict=True)):
        lattice = np.array([[wale, 0.0, 0.0], [0.0, course, 0.0]])
        found[k] = smallest_distance(points[k], lattice, loop.diameter).distance / loop.diameter
    return found


def _deformed_directions(loop, curve, points, directions, steps):
    """Derivatives (n, 3) of the centre line at ``points``, in the given steps: (steps, n, 3)."""
    along, across = _AXES[curve.direction]
    moved = np.repeat(directions[None], np.arange(curve.strain.size)[steps].size, axis=0)
    if curve.reading.positions == "printed":
        centre, edge = _centre_and_edge(loop, curve.direction)
        factor = 2.0 * np.abs(points[:, along] - centre) / edge
        moved[..., along] *= np.where(curve.strain[steps, None] == 0.0, 1.0, factor)
    else:
        moved[..., along] *= curve.scale_along[steps, None]
    moved[..., across] *= curve.scale_across[steps, None]
    return moved


def fibre_points(loop, curve, layout, twist=0.0, sections=100, steps=slice(None)):
    """Every fibre point of the given steps: (steps, sections, fibres, 3) (m).

    layout: (fibres, 2), m, in the section; twist: turns per m, Z positive.  Sections stand on the
    deformed centre line, at equal arc length of the starting state.
    """
    u, arc = loop.sections(sections)
    rest, directions = loop.points(u), loop.derivative(u)
    points = deformed_points(loop, curve, rest, steps)
    tangents = _deformed_directions(loop, curve, rest, directions, steps)
    norm = np.sqrt(np.einsum("...i,...i->...", tangents, tangents))[..., None]
    if not norm.all():
        raise InputError("positions", curve.reading.positions, "leave a section without a tangent")
    tangents /= norm
    # The next loop along the course, in each state.
    period = np.zeros((len(points), 3))
    scale = curve.scale_along if curve.direction == "course" else curve.scale_across
    period[:, 0] = loop.wale_spacing * scale[steps]
    normals, binormals = np.empty_like(points), np.empty_like(points)
    frames_of_states(
        points, tangents, arc, period, 2.0 * np.pi * twist, normals, binormals,
        np.empty(len(points)),
    )  # fmt: skip
    out = np.empty((*points.shape[:2], len(layout), 3))
    fibres_of_states(points, normals, binormals, np.ascontiguousarray(layout), out)
    return out

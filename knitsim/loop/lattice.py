"""Loops repeated by the lattice of the fabric: are they interlooped, and how close do yarns come.

Both take any loop, as built, deformed or in equilibrium, and any two lattice vectors in the plane
of the fabric, sheared or not.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.errors import ComputationError, InputError
from knitsim.loop.proximity_kernels import nearest_on_images

# One loop of plain knit from its head, seen from the face: (neighbour course, side).
PLAIN_KNIT = (
    (1, "under"), (1, "over"), (-1, "over"), (-1, "under"),
    (-1, "under"), (-1, "over"), (1, "over"), (1, "under"),
)  # fmt: skip

_CAP = 64  # crossings with one neighbour course; plain knit has 4
_SKIP = 1.6  # arc length, in diameters, below which two places of one yarn are not two yarns
_REACH = 2  # neighbour loops and courses looked at


@dataclass(frozen=True)
class Crossing:
    """One crossing, read along the loop.

    place: on the loop, in parts of the polyline (0 to 1, equal for each segment); other_place: the
    same on the neighbour course, counted on through its loops.  neighbour: +1 upper, -1 lower
    course.  side: "over" or "under".
    """

    place: float
    other_place: float
    neighbour: int
    side: str


def crossings(polyline, lattice):
    """Crossings with the neighbour courses along one loop from its head, seen from the face.

    polyline: (m + 1, 3), m; the last point is the first moved by lattice[0].  lattice: (2, 3), m,
    with thickness 0.  The head is the point furthest along the wale.  Pairs of crossings that do
    not interlace (neighbours on both yarns, on one side) are left out.  Returns a tuple of
    :class:`Crossing`.

    Raises InputError for arrays that do not fit, ComputationError for more than 64 crossings.
    """
    points, lattice = _checked(polyline, lattice)
    segments = len(points) - 1
    pairs = find_crossings(points, lattice)
    if len(pairs) > _CAP:
        raise ComputationError(
            f"crossings: {len(pairs)} with one neighbour course, more than {_CAP}"
        )
    along = lattice[0] / np.linalg.norm(lattice[0])
    wale = lattice[1] - (lattice[1] @ along) * along
    head = int(np.argmax(points[:-1] @ wale))
    return tuple(
        Crossing(float(place / segments), float(other / segments), neighbour, side)
        for place, other, neighbour, side in _read(pairs, segments, head)
    )


def crossings_intact(polyline, lattice, seen_from="face"):
    """Whether the loop is interlooped with its neighbour courses as in plain knit.

    Arguments as :func:`crossings`.  seen_from: "face" if positive thickness is the technical face,
    "back" if it is the back, where over and under exchange.  The crossings are compared cyclically
    with PLAIN_KNIT; crossings of a course with itself are not looked at.  A polyline that is not
    finite is not intact.
    """
    if seen_from not in ("face", "back"):
        raise InputError("seen_from", seen_from, "must be face or back")
    points, lattice = _checked(polyline, lattice, finite=False)
    if not np.isfinite(points).all():
        return False
    pairs = find_crossings(points, lattice)
    if len(pairs) > _CAP:
        return False
    if seen_from == "back":
        pairs[:, 2] *= -1.0
    found = [(neighbour, side) for _, _, neighbour, side in _read(pairs, len(points) - 1, 0)]
    return found in [list(PLAIN_KNIT[n:] + PLAIN_KNIT[:n]) for n in range(len(PLAIN_KNIT))]


def find_crossings(points, lattice):
    """Crossings, seen along the thickness, of a loop with the next course.

    points, lattice: as of :func:`crossings`.  Returns (crossings, 3): the place on the loop, that on the
    next course (both in segments, the latter counted on through its loops), and how much higher the next
    course lies, m.
    """
    (along, across), m = lattice, len(points) - 1
    square = along[:2] @ along[:2]
    # A shift far below any size of interest decides crossings that go through a corner.
    offset = across[:2] + 1e-9 * np.sqrt(square) * np.array([0.7548776662, 0.5698402910])
    # How far the loop reaches along the course bounds the loops of the next course to look at.
    reach = points[:, :2] @ along[:2] / square
    spread, ahead = reach.max() - reach.min(), offset @ along[:2] / square
    images = np.arange(np.floor(-spread - ahead), np.ceil(spread - ahead) + 1.0)
    shifts = offset + images[:, None] * along[:2]
    # Segments whose boxes meet.
    low, high = (pick(points[:-1, :2], points[1:, :2]) for pick in (np.minimum, np.maximum))
    lower, upper = low - shifts[:, None], high - shifts[:, None]
    meets = ((lower <= high.max(axis=0)) & (upper >= low.min(axis=0))).all(axis=2)
    k, i = np.nonzero(meets)
    near = (lower[k, i, :1] <= high[:, 0]) & (upper[k, i, :1] >= low[:, 0])
    near &= (lower[k, i, 1:] <= high[:, 1]) & (upper[k, i, 1:] >= low[:, 1])
    of, j = np.nonzero(near)
    k, i = k[of], i[of]
    a, b = points[i, :2] - shifts[k], points[j, :2]
    u, v = points[i + 1, :2] - shifts[k] - a, points[j + 1, :2] - b
    det, apart = _cross(u, v), b - a
    crossing = det != 0.0
    det = np.where(crossing, det, 1.0)
    s, t = _cross(apart, v) / det, _cross(apart, u) / det
    crossing &= (s >= 0.0) & (s < 1.0) & (t >= 0.0) & (t < 1.0)
    k, i, j, s, t = images[k[crossing]], i[crossing], j[crossing], s[crossing], t[crossing]
    z = points[:, 2]
    other_z = z[j] + t * (z[j + 1] - z[j]) + across[2] + k * along[2]
    return np.column_stack([i + s, j + t + k * m, other_z - z[i] - s * (z[i + 1] - z[i])])


def _cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _read(pairs, segments, head):
    """The crossings along one loop from ``head`` (in segments): [[place, other place, neighbour, side]].

    pairs: of :func:`find_crossings`.  Two crossings that are next to each other on both yarns, on the
    same side, are no interlacing (either yarn can be slid off the other: Reidemeister's second move) and
    are left out.
    """
    reading = []
    for own, other, height in pairs:
        # Seen from the upper course the same crossing is one with its lower neighbour.
        sides = ("under", "over") if height > 0.0 else ("over", "under")
        for place, opposite, neighbour, side in (
            (own, other, 1, sides[0]),
            (other, own, -1, sides[1]),
        ):
            turn = np.floor((place - head) / segments) * segments
            reading.append([place - turn, opposite - turn, neighbour, side])
    reading.sort(key=lambda one: one[0])
    while (two := _slid_off(reading, segments)) is not None:
        reading = two
    return reading


def _slid_off(reading, segments):
    """The reading without the first two crossings that do not interlace; None where all do."""
    # A millionth of a segment: the neighbour's own entries of these two are the ends.
    close = 1e-6
    for n, one in enumerate(reading):
        p = (n + 1) % len(reading)
        two = reading[p]
        if p == n or one[2:] != two[2:]:
            continue
        low, high = sorted((one[1], two[1] + (segments if p <= n else 0.0)))
        places = np.array([other[0] for other in reading])
        between = np.floor((high - close - places) / segments)
        between -= np.floor((low + close - places) / segments)
        if between.sum() > 0 or high - low >= segments:
            continue
        # Leave out both, and the same two as the neighbour reads them.
        away = (places[:, None] - [low, high]) / segments
        same = (np.abs(away - np.round(away)) * segments < close).any(axis=1)
        return [
            other
            for q, other in enumerate(reading)
            if q not in (n, p) and not (same[q] and other[2] == -one[2])
        ]
    return None


@dataclass(frozen=True)
class Nearest:
    """Where two yarns come closest.

    distance, error: m; error: how far off the distance may be.  place, other_place: u on the loop
    and on its image; image: which one, (loops along the course, courses) away.
    """

    distance: float
    error: float
    place: float
    other_place: float
    image: tuple


def smallest_distance(polyline, lattice, diameter):
    """Smallest distance (:class:`Nearest`) between yarns of a polyline loop.

    Arguments as :func:`crossings`, and the diameter, m: places of one yarn less than 1.6 diameters
    of arc length apart are not looked at.  Images up to two loops and two courses away are.  Places
    are in parts of the polyline (0 to 1 over the loop, equal for each segment).  Exact for the
    polyline; ``error`` estimates, from the turns at its corners, how far a smooth curve through its
    corners may lie off.
    """
    points, lattice = _checked(polyline, lattice)
    chords = np.diff(points, axis=0)
    sizes = np.linalg.norm(chords, axis=1)
    nearest, least = _nearest(points, lattice, diameter, 0.0)
    image, row = np.unravel_index(np.argmin(nearest[:, :, 0]), nearest.shape[:2])
    # A curve of curvature kappa leaves its chord h by kappa h^2 / 8; kappa = turn / h at corners.
    # Two curves may do so.
    directions = chords / sizes[:, None]
    turns = np.linalg.norm(directions - np.roll(directions, 1, axis=0), axis=1)
    error = 2 * float((turns * sizes).max()) / 8
    place, other = nearest[image, row, 1:] / (len(points) - 1)
    return Nearest(float(np.sqrt(least)), error, float(place), float(other), _images()[image])


def smallest_distance_of_spline(spline, lattice, diameter, segments=200):
    """Smallest distance (:class:`Nearest`) between yarns of a PeriodicSpline of period lattice[0].

    Every place where a polyline of ``segments`` comes within its own error of the smallest distance
    is refined on the spline by Newton's method; ``error`` is then the effect of the last step.
    """
    u = np.arange(segments + 1) / segments
    points, lattice = _checked(spline.points(u), lattice)
    # Each of two curves may lie off its chord by this much.
    sag = 0.125 / segments**2 * np.linalg.norm(spline.derivative(spline.nodes, 2), axis=1).max()
    sag = max(sag, 1e-12 * diameter)
    nearest, least = _nearest(points, lattice, diameter, 4 * sag)
    best = None
    for image, (k, row) in enumerate(_images()):
        value = nearest[image, :, 0]
        lowest = (value <= np.roll(value, 1)) & (value <= np.roll(value, -1))
        close = np.sqrt(value) <= np.sqrt(least) + 4 * sag
        for i in np.flatnonzero(lowest & close):
            start = nearest[image, i, 1:] / segments
            found = _refine(spline, k * lattice[0] + row * lattice[1], start, 2.0 / segments)
            if best is None or found[0] < best.distance:
                best = Nearest(*found, (k, row))
    return best


def _refine(spline, offset, start, span):
    """Local least distance of r(u) and r(v) + offset near ``start``: distance, error, u, v.

    Newton's method on half the squared distance, with the Gauss-Newton matrix where the exact one
    is not positive definite, steps halved until the distance falls, kept within ``span``.
    """
    low, high = np.array(start) - span, np.array(start) + span

    def gap(x):
        return spline.points(x[0]) - spline.points(x[1]) - offset

    x = np.array(start)
    value = gap(x) @ gap(x)
    gain = value
    for _ in range(60):
        g = gap(x)
        first, second = spline.derivative(x), spline.derivative(x, 2)
        slope = np.array([g @ first[0], -(g @ first[1])])
        cross = -(first[0] @ first[1])
        square = np.array([[first[0] @ first[0], cross], [cross, first[1] @ first[1]]])
        exact = square + np.diag([g @ second[0], -(g @ second[1])])
        if np.linalg.eigvalsh(exact)[0] <= 1e-9 * np.trace(square):
            exact = square + 1e-6 * np.trace(square) * np.eye(2)
        step = -np.linalg.solve(exact, slope)
        for _ in range(30):
            trial = np.clip(x + step, low, high)
            new = gap(trial) @ gap(trial)
            if new < value:
                break
            step = 0.5 * step
        else:
            break
        gain, value, x = value - new, new, trial
        if gain <= 1e-15 * value:
            break
    distance = float(np.sqrt(value))
    error = float(np.sqrt(value + gain)) - distance + 1e-12 * distance
    return distance, error, float(x[0]), float(x[1])


def _nearest(points, lattice, diameter, slack):
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    nearest = np.empty((len(_images()), len(points) - 1, 3))
    least = nearest_on_images(
        points, lattice[0], lattice[1], arc, _SKIP * diameter, _REACH, slack, nearest
    )
    return nearest, least


def _images():
    """(loops, courses) of the images, in the order of nearest_on_images."""
    return [
        (k, row) for row in range(_REACH + 1) for k in range(0 if row == 0 else -_REACH, _REACH + 1)
    ]


def _checked(polyline, lattice, finite=True):
    points = np.ascontiguousarray(polyline, dtype=float)
    lattice = np.ascontiguousarray(lattice, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 5:
        raise InputError("loop polyline", f"shape {points.shape}", "must be (m + 1, 3), m >= 4")
    if lattice.shape != (2, 3) or not np.isfinite(lattice).all():
        raise InputError("lattice", f"shape {lattice.shape}", "must be two finite vectors, (2, 3)")
    size = np.abs(lattice).max()
    area = lattice[0, 0] * lattice[1, 1] - lattice[0, 1] * lattice[1, 0]
    if np.abs(lattice[:, 2]).max() > 1e-9 * size or area <= 1e-9 * size * size:
        raise InputError(
            "lattice", lattice.tolist(),
            "must lie in the plane of the fabric, the second vector to the left of the first",
        )  # fmt: skip
    if not np.isfinite(points).all():
        if finite:
            raise InputError("loop polyline", "nan or inf", "every point must be finite")
    elif np.abs(points[-1] - points[0] - lattice[0]).max() > 1e-9 * size:
        raise InputError(
            "loop polyline", (points[-1] - points[0]).tolist(),
            "must advance by the first lattice vector over the loop",
        )  # fmt: skip
    return points, lattice

"""What the judge sees of a shape without any energy: crossings, and how close yarns come."""

import numpy as np

from knitsim.verification.judge.given import design
from knitsim.verification.judge.measure import NEIGHBOURS, size_of

AROUND = 3  # loops to either side with which crossings are sought
CANDIDATES = 256  # closest pairs of points around which the closest approach is sought
_HALVINGS = 16


def expected_crossings(pattern, wales, courses):
    """Crossings with the neighbour courses along each yarn of a cell: tuples of (course, over).

    pattern: rows of k and p from the bottom up, seen from the technical face, repeated over the cell.
    Along a loop from its sinker arc, a knit stitch goes under and over the course below, where a purl
    goes over and under; the stitch drawn through it does likewise with the two exchanged.
    """
    found = []
    for row in range(courses):
        codes = []
        for column in range(wales):
            own, above = (
                pattern[r % len(pattern)][column % len(pattern[r % len(pattern)])] == "k"
                for r in (row, row + 1)
            )
            leg = [(-1, not own), (-1, own), (1, above), (1, not above)]
            codes += leg + leg[::-1]
        found.append(tuple(codes))
    return found


def crossings(given, lines, cell):
    """Crossings of each yarn with the neighbour courses: lists of (course, over), in order along it.

    lines (yarns, n + 1, 3): corners along each yarn of a cell, the last is the first of the next cell;
    cell (2, 2): its steps.  Seen along the thickness axis from the technical face.
    """
    found = []
    for own in range(len(lines)):
        pairs = [c for n in (-1, 1) for c in _with_course(given, lines, cell, own, n)]
        found.append([(course, over) for _, course, over in sorted(pairs)])
    return found


def _with_course(given, lines, cell, own, course):
    """Crossings (place, course, over) of the yarn ``own`` with all of the course above or below."""
    up, other = divmod(own + course, given.courses)
    wide = -(-AROUND // given.wales)
    for across in range(-wide, wide + 1):
        shift = np.append([across, up] @ cell, 0.0)
        line, image = lines[own], lines[other] + shift
        first, second = _within(line, image), _within(image, line)
        a, b = np.diff(line, axis=0)[first][:, None], np.diff(image, axis=0)[second][None]
        gap = image[second][None] - line[first][:, None]
        area = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            p = (gap[..., 0] * b[..., 1] - gap[..., 1] * b[..., 0]) / area
            q = (gap[..., 0] * a[..., 1] - gap[..., 1] * a[..., 0]) / area
        for i, k in np.argwhere((p >= 0.0) & (p < 1.0) & (q >= 0.0) & (q < 1.0)):
            above = p[i, k] * a[i, 0, 2] - gap[i, k, 2] - q[i, k] * b[0, k, 2]
            yield float(first[i] + p[i, k]), course, bool(above > 0.0)


def _within(line, other):
    """Numbers of the segments of a line whose boxes, seen from above, meet the box of the other."""
    low, high = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    meets = (high >= other.min(0)) & (low <= other.max(0))
    return np.flatnonzero(meets[:, :2].all(1))


def as_patterned(given, lines, cell):
    """Whether each yarn's crossings are, in cyclic order, those of the pattern; as in :func:`crossings`."""
    expected = expected_crossings(given.pattern, given.wales, given.courses)
    return all(
        any(read[n:] + read[:n] == list(codes) for n in range(len(read)))
        for read, codes in zip(crossings(given, lines, cell), expected, strict=True)
    )


def closest(energy, shape):
    """Smallest distance in space (m) of two yarns, between contact points too; inf beyond a diameter.

    From the closest pairs of contact points on, by steps along both yarns that are halved.
    """
    order = np.argsort(shape.distance, kind="stable")[:CANDIDATES]
    if not len(order):
        return np.inf
    given, spans = energy.given, shape.control.shape[1]
    yarns = energy.of_yarn[[shape.i[order], shape.k[order]]]
    arcs = energy.arc[[shape.i[order], shape.k[order]]]
    image, best = shape.image[order], shape.distance[order]
    same = (image[:, 1] == 0) & (yarns[0] == yarns[1])
    shift = np.append(image @ energy.cell(shape.lattice), np.zeros((len(order), 1)), axis=1)
    steps = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0])).reshape(2, 1, -1)
    size = energy.length
    for _ in range(_HALVINGS):
        size *= 0.5
        tried = arcs[:, :, None] + size * steps
        ends = []
        for yarn, arc in zip(yarns, tried, strict=True):
            u = arc / energy.span
            matrix, turns = design(spans, u.ravel())
            own = matrix.reshape(*u.shape, spans) @ shape.control[yarn]
            own[..., :2] += turns.reshape(*u.shape, 1) * energy.cell(shape.lattice)[0]
            ends.append(own)
        ends[1] += shift[:, None]
        far = size_of(
            energy.in_space(ends[0], shape.curvature) - energy.in_space(ends[1], shape.curvature)
        )
        period = given.wales * given.loop_length
        apart = np.abs(tried[0] - tried[1] - (image[:, 0] * period)[:, None])
        far[same[:, None] & (apart < NEIGHBOURS * given.diameter)] = np.inf
        least = far.argmin(1)
        rows = np.arange(len(order))
        better = far[rows, least] < best
        best = np.where(better, far[rows, least], best)
        arcs = np.where(better, tried[:, rows, least], arcs)
    return float(best.min())

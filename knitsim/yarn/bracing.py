"""The springs that hold a section of the yarn together."""

import itertools

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError

FLATTEST = 1.5  # circumradius, in median edges, beyond which a triangle joins no neighbours
ON_ONE_CIRCLE = 1e-7  # rad, of the angles by which a fibre on the circle of three others is known


def section_springs(positions):
    """Pairs of fibres (k, 2) joined by springs, from their positions (n, 2) in the section.

    They are the edges of the Delaunay triangles; of fibres on one circle, which can be triangulated
    in several ways, all pairs.  So a mirrored section has the mirrored springs.  Flat triangles at
    the rim, which join far fibres, are left out unless the others then no longer hold all fibres
    together.  Fibres on one line are joined one to the next.
    """
    if len(positions) < 2:
        return np.empty((0, 2), dtype=np.int64)
    centred = positions - positions.mean(axis=0)
    _, size, directions = np.linalg.svd(centred, full_matrices=False)
    triangles = None
    if len(positions) > 2 and size[1] > 1e-9 * size[0]:
        try:
            triangles = Delaunay(positions).simplices
        except QhullError:  # as good as on one line
            triangles = None
    if triangles is None:
        order = np.argsort(centred @ directions[0], kind="stable")
        return _distinct(np.stack([order[:-1], order[1:]], axis=1))
    edges = _sides(triangles)
    median = np.median(np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1))
    kept = triangles[_circumradius(positions[triangles]) <= FLATTEST * median]
    if not _hold_together(kept, len(positions)):
        kept = triangles
    return _distinct(np.concatenate([_sides(kept), _chords(kept, positions)]))


def _sides(triangles):
    """The three sides of each triangle, shape (3 k, 2): those opposite corner 0, then 1, then 2."""
    return np.concatenate([triangles[:, pair] for pair in ([1, 2], [2, 0], [0, 1])])


def _distinct(pairs):
    return np.unique(np.sort(pairs, axis=1), axis=0).astype(np.int64)


def _circumradius(corners):
    """Radius of the circle through the corners (k, 3, 2): a b c/(4 area)."""
    a, b, c = (corners[:, k] - corners[:, k - 1] for k in range(3))
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    product = np.prod([np.linalg.norm(side, axis=1) for side in (a, b, c)], axis=0)
    return product / np.maximum(4.0 * area, 1e-300)


def _neighbours(triangles):
    """Pairs of triangles with a common side: (m, 2), and the row of that side in _sides for each."""
    sides = np.sort(_sides(triangles), axis=1)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    same = (sides[order[1:]] == sides[order[:-1]]).all(axis=1)
    rows = np.stack([order[:-1][same], order[1:][same]], axis=1)
    return rows % len(triangles), rows


def _components(pairs, count):
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return connected_components(graph, directed=False)


def _hold_together(triangles, fibres):
    """Whether the triangles reach all fibres and hang together by whole sides, without a hinge."""
    if len(np.unique(triangles)) < fibres:
        return False
    return _components(_neighbours(triangles)[0], len(triangles))[0] == 1


def _chords(triangles, positions):
    """All pairs of fibres that lie on one empty circle: those of triangles with the same one."""
    pairs, rows = _neighbours(triangles)
    # Opposite angles of a quadrangle on a circle add up to pi.
    angle = np.zeros(len(pairs))
    for side in range(2):
        corner, triangle = rows[:, side] // len(triangles), triangles[pairs[:, side]]
        apex, one, other = (
            positions[np.take_along_axis(triangle, ((corner + k) % 3)[:, None], axis=1)[:, 0]]
            for k in range(3)
        )
        a, b = one - apex, other - apex
        angle += np.arctan2(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), (a * b).sum(axis=1))
    tied = pairs[np.abs(angle - np.pi) < ON_ONE_CIRCLE]
    _, circle = _components(tied, len(triangles))
    found = [np.empty((0, 2), dtype=np.int64)]
    for number in np.unique(circle[tied]):
        corners = np.unique(triangles[circle == number])
        found.append(np.array(list(itertools.combinations(corners, 2))))
    return np.concatenate(found)

"""Compiled kernels on polylines repeated by a lattice: distances.

A loop is a polyline (m + 1, 3) over one period: its last point is the first moved by the lattice
vector ``along`` (3,) of the course.  ``across`` (3,) leads to the next course.  Both lie in the
plane of the fabric (axes 0 and 1); axis 2 is the thickness, towards the technical face.
"""

import math

from knitsim.jit import njit


@njit
def point_segment(px, py, pz, segment):
    """Squared distance from a point to a segment (2, 3), and where on it (0 to 1)."""
    ux = segment[1, 0] - segment[0, 0]
    uy = segment[1, 1] - segment[0, 1]
    uz = segment[1, 2] - segment[0, 2]
    square = ux * ux + uy * uy + uz * uz
    x, y, z = px - segment[0, 0], py - segment[0, 1], pz - segment[0, 2]
    t = 0.0
    if square > 0.0:
        t = min(1.0, max(0.0, (x * ux + y * uy + z * uz) / square))
    x, y, z = x - t * ux, y - t * uy, z - t * uz
    return x * x + y * y + z * z, t


@njit
def segment_segment(one, two):
    """Squared distance of two segments (2, 3), and where on each (0 to 1).

    The smallest of the four distances from an end to the other segment and, where the common
    perpendicular of the lines meets both segments, its length: right for skew, parallel, touching
    and degenerate segments alike.
    """
    best, t = point_segment(one[0, 0], one[0, 1], one[0, 2], two)
    s = 0.0
    square, at = point_segment(one[1, 0], one[1, 1], one[1, 2], two)
    if square < best:
        best, s, t = square, 1.0, at
    square, at = point_segment(two[0, 0], two[0, 1], two[0, 2], one)
    if square < best:
        best, s, t = square, at, 0.0
    square, at = point_segment(two[1, 0], two[1, 1], two[1, 2], one)
    if square < best:
        best, s, t = square, at, 1.0
    ux, uy, uz = one[1, 0] - one[0, 0], one[1, 1] - one[0, 1], one[1, 2] - one[0, 2]
    vx, vy, vz = two[1, 0] - two[0, 0], two[1, 1] - two[0, 1], two[1, 2] - two[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    if square > 0.0:
        x, y, z = two[0, 0] - one[0, 0], two[0, 1] - one[0, 1], two[0, 2] - one[0, 2]
        a = ((y * vz - z * vy) * nx + (z * vx - x * vz) * ny + (x * vy - y * vx) * nz) / square
        b = ((y * uz - z * uy) * nx + (z * ux - x * uz) * ny + (x * uy - y * ux) * nz) / square
        if 0.0 < a < 1.0 and 0.0 < b < 1.0:
            height = x * nx + y * ny + z * nz
            if height * height < best * square:
                best, s, t = height * height / square, a, b
    return best, s, t


@njit
def nearest_on_images(points, along, across, arc, skip, reach, slack, nearest):
    """Where each segment comes closest to the yarns around; returns the least squared distance.

    arc: (m + 1,) arc length; on the loop's own course, places less than ``skip`` of it apart are
    left out.  Images up to ``reach`` loops and courses away are looked at, one of each opposite
    two.  Filled: nearest (images, m, 3) with squared distance, and the places (in segments) on the
    loop and on the image; inf where the distance is more than the least before it, plus ``slack``.
    images = (2 reach + 1) reach + reach + 1, in the order (0, 0..reach), (1, -reach..reach), ...
    """
    m = points.shape[0] - 1
    length = arc[m]
    longest = 0.0
    for i in range(m):
        longest = max(
            longest,
            math.sqrt(
                (points[i + 1, 0] - points[i, 0]) ** 2
                + (points[i + 1, 1] - points[i, 1]) ** 2
                + (points[i + 1, 2] - points[i, 2]) ** 2
            ),
        )
    least = math.inf
    bound = math.inf  # squared distance of first points beyond which a pair cannot count
    image = 0
    one = points[0:2].copy()
    for row in range(reach + 1):
        for k in range(0 if row == 0 else -reach, reach + 1):
            ox = k * along[0] + row * across[0]
            oy = k * along[1] + row * across[1]
            oz = k * along[2] + row * across[2]
            for i in range(m):
                nearest[image, i, 0] = math.inf
                one[0, 0], one[0, 1] = points[i, 0] - ox, points[i, 1] - oy
                one[1, 0], one[1, 1] = points[i + 1, 0] - ox, points[i + 1, 1] - oy
                one[0, 2], one[1, 2] = points[i, 2] - oz, points[i + 1, 2] - oz
                for j in range(m):
                    dx = points[j, 0] - one[0, 0]
                    dy = points[j, 1] - one[0, 1]
                    dz = points[j, 2] - one[0, 2]
                    if dx * dx + dy * dy + dz * dz > bound:
                        continue
                    if row == 0:
                        start = arc[j] + k * length
                        end = arc[j + 1] + k * length
                        if start - arc[i + 1] < skip and arc[i] - end < skip:
                            continue
                    square, s, t = segment_segment(one, points[j : j + 2])
                    if square < nearest[image, i, 0]:
                        nearest[image, i, 0] = square
                        nearest[image, i, 1] = i + s
                        nearest[image, i, 2] = j + t
                        if square < least:
                            least = square
                            bound = (math.sqrt(least) + slack + 2 * longest) ** 2
            image += 1
    return least

"""Compiled kernels on polylines repeated by a lattice: crossings seen from the face, and distances.

A loop is a polyline (m + 1, 3) over one period: its last point is the first moved by the lattice
vector ``along`` (3,) of the course.  ``across`` (3,) leads to the next course.  Both lie in the
plane of the fabric (axes 0 and 1); axis 2 is the thickness, towards the technical face.
"""

import math

from knitsim.jit import njit


@njit
def find_crossings(points, along, across, pairs):
    """Crossings, seen along the thickness, of the loop with the next course; returns their number.

    Filled, up to its size: pairs (cap, 3) with the place on the loop, that on the next course (both
    in segments, the latter counted on through its loops) and how much higher the next course lies.
    A number above the cap means that there are more than fit.
    """
    m = points.shape[0] - 1
    cap = pairs.shape[0]
    # A shift far below any size of interest decides crossings that go through a corner.
    shift = 1e-9 * math.sqrt(along[0] * along[0] + along[1] * along[1])
    sx = across[0] + 0.7548776662 * shift
    sy = across[1] + 0.5698402910 * shift
    # How far the loop reaches along the course, to bound the loops of the next course to look at.
    square = along[0] * along[0] + along[1] * along[1]
    low = math.inf
    high = -math.inf
    for i in range(m + 1):
        reach = (points[i, 0] * along[0] + points[i, 1] * along[1]) / square
        low = min(low, reach)
        high = max(high, reach)
    offset = (sx * along[0] + sy * along[1]) / square
    first = math.floor(low - high - offset)
    last = math.ceil(high - low - offset)
    count = 0
    for k in range(first, last + 1):
        ox = sx + k * along[0]
        oy = sy + k * along[1]
        for i in range(m):
            ax, ay = points[i, 0] - ox, points[i, 1] - oy
            ex, ey = points[i + 1, 0] - ox, points[i + 1, 1] - oy
            xlow, xhigh = min(ax, ex), max(ax, ex)
            ylow, yhigh = min(ay, ey), max(ay, ey)
            ux, uy = ex - ax, ey - ay
            for j in range(m):
                bx, by = points[j, 0], points[j, 1]
                fx, fy = points[j + 1, 0], points[j + 1, 1]
                if (
                    (by > yhigh and fy > yhigh)
                    or (by < ylow and fy < ylow)
                    or (bx > xhigh and fx > xhigh)
                    or (bx < xlow and fx < xlow)
                ):
                    continue
                vx, vy = fx - bx, fy - by
                det = ux * vy - uy * vx
                if det == 0.0:
                    continue
                s = ((bx - ax) * vy - (by - ay) * vx) / det
                t = ((bx - ax) * uy - (by - ay) * ux) / det
                if s >= 0.0 and s < 1.0 and t >= 0.0 and t < 1.0:
                    if count < cap:
                        pairs[count, 0] = i + s
                        pairs[count, 1] = j + t + k * m
                        pairs[count, 2] = (
                            points[j, 2] + t * (points[j + 1, 2] - points[j, 2])
                            + across[2] + k * along[2]
                            - points[i, 2] - s * (points[i + 1, 2] - points[i, 2])
                        )  # fmt: skip
                    count += 1
    return count


@njit
def read_crossings(pairs, count, segments, head, reading):
    """The crossings along one loop from ``head`` (in segments), in order; returns their number.

    pairs, count: of :func:`find_crossings`.  Filled: reading (2 cap, 4): place on the loop, place
    on the neighbour, neighbour (+1 upper, -1 lower), side (+1 over, -1 under).  Two crossings that
    are next to each other on both yarns, on the same side, are no interlacing (either yarn can be
    slid off the other: Reidemeister's second move) and are left out.
    """
    for n in range(count):
        own, other, height = pairs[n, 0], pairs[n, 1], pairs[n, 2]
        side = -1.0 if height > 0.0 else 1.0
        # Seen from the upper course the same crossing is one with its lower neighbour.
        turn = math.floor((own - head) / segments) * segments
        reading[2 * n, 0], reading[2 * n, 1] = own - turn, other - turn
        reading[2 * n, 2], reading[2 * n, 3] = 1.0, side
        turn = math.floor((other - head) / segments) * segments
        reading[2 * n + 1, 0], reading[2 * n + 1, 1] = other - turn, own - turn
        reading[2 * n + 1, 2], reading[2 * n + 1, 3] = -1.0, -side
    total = 2 * count
    for n in range(1, total):
        a, b, c, d = reading[n, 0], reading[n, 1], reading[n, 2], reading[n, 3]
        p = n - 1
        while p >= 0 and reading[p, 0] > a:
            for q in range(4):
                reading[p + 1, q] = reading[p, q]
            p -= 1
        reading[p + 1, 0], reading[p + 1, 1] = a, b
        reading[p + 1, 2], reading[p + 1, 3] = c, d
    removed = True
    while removed and total > 0:
        removed = False
        for n in range(total):
            p = (n + 1) % total
            wrap = segments if p <= n else 0.0
            if p == n or reading[n, 2] != reading[p, 2] or reading[n, 3] != reading[p, 3]:
                continue
            low = min(reading[n, 1], reading[p, 1] + wrap)
            high = max(reading[n, 1], reading[p, 1] + wrap)
            # Half a segment's millionth: the neighbour's own entries of these two are the ends.
            inside = 0
            for q in range(total):
                place = reading[q, 0]
                inside += int(
                    math.floor((high - 1e-6 - place) / segments)
                    - math.floor((low + 1e-6 - place) / segments)
                )
            if inside > 0 or high - low >= segments:
                continue
            # Leave out both, and the same two as the neighbour reads them.
            kept = 0
            opposite = -reading[n, 2]
            for q in range(total):
                out = q == n or q == p
                if reading[q, 2] == opposite:
                    for end in (low, high):
                        away = (reading[q, 0] - end) / segments
                        if abs(away - round(away)) * segments < 1e-6:
                            out = True
                if not out:
                    for r in range(4):
                        reading[kept, r] = reading[q, r]
                    kept += 1
            total = kept
            removed = True
            break
    return total


@njit
def is_plain_knit(points, along, across, face, pairs, reading):
    """Whether the loop interlaces with its neighbour courses as in plain knit.

    face: +1 if the technical face is towards positive thickness, -1 if the back is.  pairs (cap, 3)
    and reading (2 cap, 4) are work space; cap 16 is enough for any state close to a fabric.
    """
    m = points.shape[0] - 1
    for i in range(m + 1):
        if not math.isfinite(points[i, 0] + points[i, 1] + points[i, 2]):
            return False
    count = find_crossings(points, along, across, pairs)
    if count > pairs.shape[0]:
        return False
    if read_crossings(pairs, count, m, 0.0, reading) != 8:
        return False
    # From the head: under over over under under over over under, with + + - - - - + +.
    for start in range(8):
        same = True
        for n in range(8):
            neighbour = -1.0 if 2 <= n < 6 else 1.0
            side = 1.0 if n % 4 == 1 or n % 4 == 2 else -1.0
            q = (start + n) % 8
            if reading[q, 2] != neighbour or reading[q, 3] != face * side:
                same = False
                break
        if same:
            return True
    return False


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

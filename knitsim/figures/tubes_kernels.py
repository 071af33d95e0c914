"""Solid yarns into pixels: orthographic ray casting of tubes into a z-buffer, and their shading.

All lengths are in samples (sub-pixels) of the picture: x to the right, y up, z towards the eye.  A
yarn is a chain of cylinders, joined by spheres and cut flat at its two ends.
"""

import math

import numpy as np

from knitsim.jit import njit

# What of a segment a sample shows: `owner` holds KINDS * segment + kind, or -1 for nothing.
KINDS = 3
SIDE, START, END = 0, 1, 2

# Columns of `nodes`, one row a point of a yarn.  FRAME is a unit normal carried along the yarn
# without turning, ARC the arc length in samples.
POINT, TANGENT, COLOUR, FRAME, RADIUS, ARC, NODE_WIDTH = 0, 3, 6, 9, 12, 13, 14

# Places in `look`, the settings of one picture.
LIGHT, LIGHT_RIGHT, LIGHT_UP, MAP_ORIGIN = 0, 3, 6, 9
MAP_SCALE, HELIX, RIDGES, LOOK_WIDTH = 12, 13, 14, 15

# Lighting, as shares of white; chosen by eye on a cotton single jersey.
SKY, GROUND, KEY, GLOSS = 0.50, 0.24, 0.62, 0.10
GLOSS_POWER = 18
WRAP = 0.20  # how far the key light creeps past its terminator, as on a fuzzy yarn
EDGE = 0.55  # brightness left at the outline of a yarn
EDGE_FROM = 0.55  # cosine to the eye below which the outline begins to darken
SLACK = (
    2.5  # cells of the shadow map before something behind is in the shade, and until it is fully
)
RIDGE_SLOPE = 0.38  # largest slope of the ridges of the optional yarn texture
RIDGE_SHADE = 0.10  # their darkening, in the grooves

# Ambient occlusion: places on a disc in the picture, its radius in yarn radii.  Each pixel of a
# tile of 4 x 4 looks at TAPS places of its own; a mean over a tile has seen them all.
TILE, TAPS, REACH, OCCLUSION = 4, 8, 2.4, 1.7
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


@njit
def _span(a, b, low, high, first, last):
    """The x between first and last with low <= a x + b <= high."""
    if abs(a) < 1e-12:
        if b < low or b > high:
            return 1.0, 0.0
        return first, last
    x1, x2 = (low - b) / a, (high - b) / a
    return max(first, min(x1, x2)), min(last, max(x1, x2))


@njit
def trace(points, radii, starts, depth, owner):
    """Z-buffer of yarns: depth (rows, columns) of the nearest surface, and what it belongs to.

    points (n, 3) and radii (n,) of all yarns on end, yarn k from node starts[k] up to
    starts[k + 1]; a segment is named by its first node.  depth must come in as -inf and owner as
    -1.  Sample (row, column) lies at x = column + 1/2, y = row + 1/2.

    In the plane of the picture take g along a segment's shadow and h across it, from its first
    point.  With the unit axis (along, rise), along in the picture and rise towards the eye, the
    front of the cylinder of radius r lies at height (g rise + c)/along, c = sqrt(r2 - h2), over
    the axial place t = (g + rise c)/along.
    """
    rows, columns = depth.shape
    for yarn in range(starts.size - 1):
        for i in range(starts[yarn], starts[yarn + 1] - 1):
            is_first, is_last = i == starts[yarn], i == starts[yarn + 1] - 2
            x0, y0, z0 = points[i]
            dx, dy, dz = points[i + 1, 0] - x0, points[i + 1, 1] - y0, points[i + 1, 2] - z0
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            flat = math.sqrt(dx * dx + dy * dy)
            rise, along = dz / length, flat / length
            ex, ey = (dx / flat, dy / flat) if along > 1e-9 else (1.0, 0.0)
            r = 0.5 * (radii[i] + radii[i + 1])
            # Of the sphere at the first point the wedge shows that the chain leaves by turning.
            back, bx, by, bz = 0.0, 0.0, 0.0, 0.0
            if not is_first:
                bx, by, bz = x0 - points[i - 1, 0], y0 - points[i - 1, 1], z0 - points[i - 1, 2]
                cosine = (bx * dx + by * dy + bz * dz) / (
                    length * math.sqrt(bx * bx + by * by + bz * bz)
                )
                back = r * math.sqrt(max(0.0, 1.0 - cosine * cosine)) if cosine > 0.0 else r
            g_low, g_high = -abs(rise) * r - back, flat + abs(rise) * r
            reach_y = r + abs(ey) * (abs(rise) * r + back)
            row_low = max(0, math.floor(min(y0, y0 + dy) - reach_y))
            row_high = min(rows - 1, math.ceil(max(y0, y0 + dy) + reach_y))
            for row in range(row_low, row_high + 1):
                qy = row + 0.5 - y0
                low, high = _span(ey, -qy * ex, -r, r, 0.5 - x0, columns - 0.5 - x0)
                low, high = _span(ex, qy * ey, g_low, g_high, low, high)
                if low > high:
                    continue
                first_column = math.ceil(low + x0 - 0.5)
                last_column = min(columns - 1, math.floor(high + x0 - 0.5))
                for column in range(max(0, first_column), last_column + 1):
                    qx = column + 0.5 - x0
                    g, h = qx * ex + qy * ey, qx * ey - qy * ex
                    c2 = r * r - h * h
                    if c2 < 0.0:
                        continue
                    z, kind = -np.inf, SIDE
                    t = -1.0  # of a segment seen end on, no side
                    if along > 1e-9:
                        c = math.sqrt(c2)
                        t = (g + rise * c) / along
                        if t >= 0.0 and t <= length:
                            z = (g * rise + c) / along
                    if t < 0.0 and not is_first and g * g <= c2:
                        s = math.sqrt(c2 - g * g)
                        if qx * bx + qy * by + s * bz >= 0.0:
                            z = s
                    if is_first and rise < 0.0:
                        s = -g * along / rise
                        if g * g + s * s <= c2 and s > z:
                            z, kind = s, START
                    if is_last and rise > 0.0:
                        s = -(g - flat) * along / rise
                        if (g - flat) * (g - flat) + s * s <= c2 and s + dz > z:
                            z, kind = s + dz, END
                    z += z0
                    if z > depth[row, column]:
                        depth[row, column] = z
                        owner[row, column] = KINDS * i + kind


@njit
def _lit(x, y, z, shadow, look):
    """Share of the key light that reaches a point: a 3 x 3 box of the shadow map, bilinear."""
    rows, columns = shadow.shape
    u = look[LIGHT_RIGHT] * x + look[LIGHT_RIGHT + 1] * y + look[LIGHT_RIGHT + 2] * z
    v = look[LIGHT_UP] * x + look[LIGHT_UP + 1] * y + look[LIGHT_UP + 2] * z
    w = look[LIGHT] * x + look[LIGHT + 1] * y + look[LIGHT + 2] * z
    u = (u - look[MAP_ORIGIN]) * look[MAP_SCALE] - 1.5
    v = (v - look[MAP_ORIGIN + 1]) * look[MAP_SCALE] - 1.5
    w = (w - look[MAP_ORIGIN + 2]) * look[MAP_SCALE]
    column, row = math.floor(u), math.floor(v)
    fu, fv = u - column, v - row
    # The map has a margin of no yarn, so what lies beyond it is lit.
    if column < 0 or row < 0 or column + 3 >= columns or row + 3 >= rows:
        return 1.0
    lit = 0.0
    for j in range(4):
        weight_v = (1.0 - fv) if j == 0 else (fv if j == 3 else 1.0)
        for i in range(4):
            weight_u = (1.0 - fu) if i == 0 else (fu if i == 3 else 1.0)
            # Slack, and a ramp, keep a slanted surface from shading itself.
            blocked = min(1.0, max(0.0, (shadow[row + j, column + i] - w - SLACK) / SLACK))
            lit += weight_u * weight_v * (1.0 - blocked)
    return lit / 9.0


@njit
def _surface(row, column, nodes, depth, owner, normal):
    """Unit normal of a sample's surface, into `normal`; returns the place 0..1 on its segment.

    The planes square to the yarn at the two nodes open like a fan; the place is the share of the
    way between them, and the tangent there is interpolated.  So joints do not show, and on a
    circle the normal is right to second order in the segments' length.
    """
    i, kind = owner[row, column] // KINDS, owner[row, column] % KINDS
    if kind == START or kind == END:
        node, sign = (i, -1.0) if kind == START else (i + 1, 1.0)
        for k in range(3):
            normal[k] = sign * nodes[node, TANGENT + k]
        return 0.0 if kind == START else 1.0
    j = i + 1
    x, y, z = column + 0.5, row + 0.5, float(depth[row, column])
    ax, ay, az = nodes[i, TANGENT], nodes[i, TANGENT + 1], nodes[i, TANGENT + 2]
    bx, by, bz = nodes[j, TANGENT], nodes[j, TANGENT + 1], nodes[j, TANGENT + 2]
    x0, y0, z0, x1, y1, z1 = (
        nodes[i, 0],
        nodes[i, 1],
        nodes[i, 2],
        nodes[j, 0],
        nodes[j, 1],
        nodes[j, 2],
    )
    behind = (x - x0) * ax + (y - y0) * ay + (z - z0) * az
    ahead = (x1 - x) * bx + (y1 - y) * by + (z1 - z) * bz
    # At a sharp bend the fan can close; outside it, in the wedge of a joint, go on a little.
    t = behind / (behind + ahead) if behind + ahead > 1e-9 else 0.5
    t = min(1.5, max(-0.5, t))
    tx, ty, tz = ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az)
    nx, ny, nz = x - x0 - t * (x1 - x0), y - y0 - t * (y1 - y0), z - z0 - t * (z1 - z0)
    slide = (nx * tx + ny * ty + nz * tz) / (tx * tx + ty * ty + tz * tz + 1e-12)
    nx, ny, nz = nx - slide * tx, ny - slide * ty, max(0.0, nz - slide * tz)
    norm = math.sqrt(nx * nx + ny * ny + nz * nz) + 1e-12
    normal[0], normal[1], normal[2] = nx / norm, ny / norm, nz / norm
    return min(1.0, max(0.0, t))


@njit
def _hidden(row, column, normal, radius, depth, taps):
    """How much of a sample's sky is hidden by what rises above its tangent plane near it.

    After McGuire, Osman, Bukowski and Hennessy, "The Alchemy screen-space ambient obscurance
    algorithm" (High-Performance Graphics 2011).
    """
    rows, columns = depth.shape
    z0 = depth[row, column]
    hidden = 0.0
    for k in range(TAPS):
        dx, dy = round(taps[k, 0] * radius), round(taps[k, 1] * radius)
        r, c = row + dy, column + dx
        if r < 0 or r >= rows or c < 0 or c >= columns:
            continue
        dz = depth[r, c] - z0
        if dz < -4.0 * radius:
            continue
        above = dx * normal[0] + dy * normal[1] + dz * normal[2]
        if above > 0.04 * radius:
            distance2 = dx * dx + dy * dy + dz * dz
            hidden += radius * above / (distance2 + 0.10 * radius * radius)
    return hidden / TAPS


@njit
def look_up(nodes, depth, owner, sky):
    """Fill sky (rows, columns, 2): for each pixel its hidden share of sky, and at what depth.

    The pixel stands for the first of its samples that shows a yarn; without one its depth is -inf.
    """
    taps = np.empty((TILE * TILE, TAPS, 2))
    for k in range(TILE * TILE * TAPS):
        distance = REACH * math.sqrt((k + 0.5) / (TILE * TILE * TAPS))
        # 7 is prime to 16: neighbours in the tile look at places far apart.
        taps[(7 * k) % (TILE * TILE), k // (TILE * TILE), 0] = distance * math.cos(k * GOLDEN_ANGLE)
        taps[(7 * k) % (TILE * TILE), k // (TILE * TILE), 1] = distance * math.sin(k * GOLDEN_ANGLE)
    normal = np.empty(3)
    rows, columns, _ = sky.shape
    for y in range(rows):
        for x in range(columns):
            sky[y, x, 0], sky[y, x, 1] = 0.0, -np.inf
            for k in range(4):
                row, column = 2 * y + k // 2, 2 * x + k % 2
                if owner[row, column] >= 0:
                    _surface(row, column, nodes, depth, owner, normal)
                    radius = nodes[owner[row, column] // KINDS, RADIUS]
                    tile = TILE * (y % TILE) + x % TILE
                    sky[y, x, 0] = _hidden(row, column, normal, radius, depth, taps[tile])
                    sky[y, x, 1] = depth[row, column]
                    break


@njit
def _open_sky(row, column, z, radius, sky):
    """Share of the sky open to a sample: mean over a tile of pixels of about its depth."""
    rows, columns, _ = sky.shape
    y0, x0 = row // 2 - TILE // 2, column // 2 - TILE // 2
    hidden, count = 0.0, 0
    for y in range(max(0, y0), min(rows, y0 + TILE)):
        for x in range(max(0, x0), min(columns, x0 + TILE)):
            if abs(sky[y, x, 1] - z) < 0.5 * radius:
                hidden += sky[y, x, 0]
                count += 1
    return 1.0 / (1.0 + OCCLUSION * hidden / count) if count else 1.0


@njit
def _ridged(i, t, nodes, look, normal):
    """Tilt `normal` by ridges that run round the yarn as a helix; returns their brightness."""
    j = i + 1
    fx = nodes[i, FRAME] + t * (nodes[j, FRAME] - nodes[i, FRAME])
    fy = nodes[i, FRAME + 1] + t * (nodes[j, FRAME + 1] - nodes[i, FRAME + 1])
    fz = nodes[i, FRAME + 2] + t * (nodes[j, FRAME + 2] - nodes[i, FRAME + 2])
    ax = nodes[i, TANGENT] + t * (nodes[j, TANGENT] - nodes[i, TANGENT])
    ay = nodes[i, TANGENT + 1] + t * (nodes[j, TANGENT + 1] - nodes[i, TANGENT + 1])
    az = nodes[i, TANGENT + 2] + t * (nodes[j, TANGENT + 2] - nodes[i, TANGENT + 2])
    bx, by, bz = ay * fz - az * fy, az * fx - ax * fz, ax * fy - ay * fx
    angle = math.atan2(
        normal[0] * bx + normal[1] * by + normal[2] * bz,
        normal[0] * fx + normal[1] * fy + normal[2] * fz,
    )
    arc = nodes[i, ARC] + t * (nodes[i + 1, ARC] - nodes[i, ARC])
    phase = look[RIDGES] * (angle - look[HELIX] * arc)
    # Down the slope of the ridges: round the yarn (square to axis and normal) and along it.
    cx, cy = ay * normal[2] - az * normal[1], az * normal[0] - ax * normal[2]
    cz = ax * normal[1] - ay * normal[0]
    slope = RIDGE_SLOPE * math.sin(phase)
    rise = look[HELIX] * 0.5 * (nodes[i, RADIUS] + nodes[i + 1, RADIUS])
    nx = normal[0] + slope * (cx - rise * ax)
    ny = normal[1] + slope * (cy - rise * ay)
    nz = normal[2] + slope * (cz - rise * az)
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    normal[0], normal[1], normal[2] = nx / norm, ny / norm, nz / norm
    return 1.0 - RIDGE_SHADE * (1.0 - math.cos(phase))


@njit
def _shade(row, column, nodes, buffers, look, scratch):
    """Colour (linear light) of a sample, into scratch[3:6]; buffers: depth, owner, sky, shadow."""
    depth, owner, sky, shadow = buffers
    normal = scratch[:3]
    t = _surface(row, column, nodes, depth, owner, normal)
    i, kind = owner[row, column] // KINDS, owner[row, column] % KINDS
    radius = 0.5 * (nodes[i, RADIUS] + nodes[i + 1, RADIUS])
    open_sky = _open_sky(row, column, depth[row, column], radius, sky)
    facing = normal[2]
    bright = 1.0
    # A step off the surface keeps it out of its own shadow.
    off = 0.12 * radius
    x, y = column + 0.5 + off * normal[0], row + 0.5 + off * normal[1]
    z = depth[row, column] + off * normal[2]
    if look[RIDGES] > 0.0 and kind == SIDE:
        bright = _ridged(i, t, nodes, look, normal)
    slant = normal[0] * look[LIGHT] + normal[1] * look[LIGHT + 1] + normal[2] * look[LIGHT + 2]
    diffuse = max(0.0, (slant + WRAP) / (1.0 + WRAP))
    lit = _lit(x, y, z, shadow, look) if diffuse > 0.0 else 0.0
    ambient = GROUND + (SKY - GROUND) * 0.5 * (1.0 + normal[1])
    hx, hy, hz = look[LIGHT], look[LIGHT + 1], look[LIGHT + 2] + 1.0
    half = normal[0] * hx + normal[1] * hy + normal[2] * hz
    half = max(0.0, half / math.sqrt(hx * hx + hy * hy + hz * hz))
    gloss = GLOSS * lit * half**GLOSS_POWER if slant > 0.0 else 0.0
    edge = min(1.0, facing / EDGE_FROM)
    edge = EDGE + (1.0 - EDGE) * edge * edge * (3.0 - 2.0 * edge)
    light = bright * edge * (ambient * open_sky + KEY * lit * diffuse * (0.35 + 0.65 * open_sky))
    for k in range(3):
        c = nodes[i, COLOUR + k] + t * (nodes[i + 1, COLOUR + k] - nodes[i, COLOUR + k])
        scratch[3 + k] = c * c * light + edge * gloss


@njit
def paint(nodes, depth, owner, sky, shadow, look, picture):
    """Shade the samples and gather 2 x 2 of them into each pixel of picture (rows, columns, 4).

    Colours are squared on the way in and rooted on the way out, a gamma of 2.  A pixel within one
    surface is shaded once.  An empty pixel keeps the colour 0 and no opacity.
    """
    scratch = np.zeros(6)
    buffers = (depth, owner, sky, shadow)
    rows, columns, _ = picture.shape
    total = np.empty(3)
    for y in range(rows):
        for x in range(columns):
            covered, low, high = 0, np.inf, -np.inf
            node_low, node_high = owner.size * KINDS, -1
            for k in range(4):
                row, column = 2 * y + k // 2, 2 * x + k % 2
                if owner[row, column] >= 0:
                    covered += 1
                    low, high = min(low, depth[row, column]), max(high, depth[row, column])
                    node_low = min(node_low, owner[row, column])
                    node_high = max(node_high, owner[row, column])
            if covered == 0:
                continue
            smooth = covered == 4 and high - low < 3.0 and node_high - node_low <= 2 * KINDS
            smooth = smooth and look[RIDGES] == 0.0
            total[:] = 0.0
            for k in range(1 if smooth else 4):
                row, column = 2 * y + k // 2, 2 * x + k % 2
                if owner[row, column] >= 0:
                    _shade(row, column, nodes, buffers, look, scratch)
                    total += scratch[3:6]
            for k in range(3):
                value = math.sqrt(total[k] / (1 if smooth else covered))
                picture[y, x, k] = int(min(255.0, 255.0 * value + 0.5))
            picture[y, x, 3] = int(255.0 * covered / 4.0 + 0.5)

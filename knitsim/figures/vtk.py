"""Fabric states for ParaView: yarns as tubes in VTK's XML files, written without VTK.

A state is one PolyData file (.vtp) with the surface of every yarn, values along the yarn as point
data and whatever names the state as field data; a series of them is a collection (.pvd).  Lengths
are in metres, axes course, wale, thickness.  The same input gives the same bytes.
"""

import base64
import math
import os
import re
import zlib
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from knitsim.errors import InputError
from knitsim.files import replacing
from knitsim.loop.frames import line_frames

SIDES = 10
BLOCK = 32768  # bytes in a compressed block, VTK's own default
LEVEL = 3  # of compression: far faster than the highest, files a few percent larger
# Steps to which coordinates (of a radius) and normals are rounded: invisible, halves the file.
POINT_STEP, NORMAL_STEP = 2.0**-10, 2.0**-8

_TYPES = {"f4": "Float32", "f8": "Float64", "i4": "Int32", "u1": "UInt8"}


def tube_surface(points, radius, sides=SIDES):
    """Closed surface round one yarn: (points, normals, source, polygons).

    points: (m, 3) centre line (m), successive points apart; radius: one (m) or (m,).
    The surface points are (k, 3): for each point a ring of ``sides``, square to the yarn, then a
    second ring for each of the two flat ends.  normals (k, 3) are unit and outward, source (k,)
    is the centre line's point behind each.  polygons: (vertices, ends) as VTK has them, quads and
    two end polygons, counter-clockwise seen from outside.
    """
    count = len(points)
    tangents, aside = line_frames(points)
    across = np.cross(tangents, aside)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    normals = (
        np.cos(angle)[None, :, None] * aside[:, None]
        + np.sin(angle)[None, :, None] * across[:, None]
    )
    radius = np.broadcast_to(np.asarray(radius, dtype=float), (count,))
    rings = points[:, None] + radius[:, None, None] * normals
    ring = np.arange(sides)
    following = np.roll(ring, -1)
    first = sides * np.arange(count - 1)[:, None]
    quads = np.stack(
        [first + ring, first + following, first + sides + following, first + sides + ring], axis=2
    )
    start, end = sides * count + ring[::-1], sides * (count + 1) + ring
    vertices = np.concatenate([quads.ravel(), start, end])
    ends = np.concatenate(
        [4 * np.arange(1, sides * (count - 1) + 1), [vertices.size - sides, vertices.size]]
    )
    caps = np.repeat([-tangents[0], tangents[-1]], sides, axis=0)
    source = np.concatenate([np.repeat(np.arange(count), sides), np.zeros(sides, dtype=int)])
    return (
        np.concatenate([rings.reshape(-1, 3), rings[0], rings[-1]]),
        np.concatenate([normals.reshape(-1, 3), caps]),
        np.concatenate([source, np.full(sides, count - 1)]),
        (vertices, ends),
    )


def write_yarns(path, polylines, radius, *, point_data=None, field_data=None, sides=SIDES):
    """Write yarns as tubes into a .vtp file, whole or not at all; returns its path.

    polylines: sequence of (m, 3) centre lines (m), neighbouring points apart.
    radius: one (m), one per polyline, or per polyline one per point; coordinates are rounded to
    1/1024 of it.  point_data: name -> one value, one per polyline, or per polyline one per point;
    whole numbers stay whole (such as ``course``), others become float32 (``yarn_tension``).
    field_data: name -> text or number (``fabric``, ``step``, ``strain``).  sides: of the tubes.

    Raises InputError for what cannot be written.
    """
    lines = [np.asarray(points, dtype=float) for points in polylines]
    if not lines:
        raise InputError("polylines", "[]", "at least one is needed")
    if sides != int(sides) or sides < 3:
        raise InputError("sides", sides, "must be a whole number from 3 on")
    for k, points in enumerate(lines):
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise InputError(f"polylines[{k}]", points.shape, "must be (m, 3), at least 2 points")
        if not np.isfinite(points).all():
            raise InputError(f"polylines[{k}]", "not finite", "all points must be finite (m)")
        if not (np.linalg.norm(np.diff(points, axis=0), axis=1) > 0).all():
            raise InputError(f"polylines[{k}]", "equal points in a row", "points must be apart")
    radii = _per_point("radius", radius, lines)
    for k, r in enumerate(radii):
        if not (np.isfinite(r).all() and (r > 0).all()):
            raise InputError(f"radius of polylines[{k}]", float(r.min()), "must be above 0 (m)")
    values = {
        _name(name): _per_point(name, given, lines) for name, given in (point_data or {}).items()
    }
    surfaces = [tube_surface(p, r, sides) for p, r in zip(lines, radii, strict=True)]
    # A power of two as the step leaves the last bits of every float32 empty.
    step = POINT_STEP * 2.0 ** math.floor(math.log2(min(r.min() for r in radii)))
    points = np.concatenate([surface[0] for surface in surfaces])
    normals = np.concatenate([surface[1] for surface in surfaces])
    vertices, ends, point_offset, vertex_offset = [], [], 0, 0
    for surface in surfaces:
        vertices.append(surface[3][0] + point_offset)
        ends.append(surface[3][1] + vertex_offset)
        point_offset += len(surface[0])
        vertex_offset += surface[3][0].size
    vertices, ends = np.concatenate(vertices), np.concatenate(ends)

    arrays = [_array("Normals", (np.round(normals / NORMAL_STEP) * NORMAL_STEP).astype("<f4"))]
    for name, given in values.items():
        along = np.concatenate([v[s[2]] for v, s in zip(given, surfaces, strict=True)])
        arrays.append(_array(name, along.astype("<i4" if along.dtype.kind in "iub" else "<f4")))
    first = next((name for name, given in values.items() if given[0].dtype.kind == "f"), None)
    scalars = f" Scalars={quoteattr(first)}" if first else ""
    body = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt32"'
        ' compressor="vtkZLibDataCompressor">',
        "<PolyData>",
        "<FieldData>",
        *(_field(_name(name), value) for name, value in (field_data or {}).items()),
        "</FieldData>",
        f'<Piece NumberOfPoints="{len(points)}" NumberOfVerts="0" NumberOfLines="0"'
        f' NumberOfStrips="0" NumberOfPolys="{len(ends)}">',
        f'<PointData Normals="Normals"{scalars}>',
        *arrays,
        "</PointData>",
        "<Points>",
        _array("Points", (np.round(points / step) * step).astype("<f4")),
        "</Points>",
        "<Polys>",
        _array("connectivity", vertices.astype("<i4")),
        _array("offsets", ends.astype("<i4")),
        "</Polys>",
        "</Piece>",
        "</PolyData>",
        "</VTKFile>",
        "",
    ]
    return _write(path, "\n".join(body))


def write_series(path, states):
    """Write a .pvd collection, whole or not at all; returns its path.

    states: sequence of (number, .vtp path); the number is what ParaView shows as time, for a
    tensile test the strain or the step, and must grow.  Paths are written as seen from the .pvd.
    """
    path = Path(path)
    states = [(float(number), Path(file)) for number, file in states]
    if not states:
        raise InputError(str(path), "[]", "at least one state is needed")
    numbers = [number for number, _ in states]
    if not all(math.isfinite(n) for n in numbers) or any(b <= a for a, b in pairwise(numbers)):
        raise InputError(str(path), numbers, "the states' numbers must be finite and grow")
    rows = [
        f'<DataSet timestep="{number!r}" group="" part="0"'
        f" file={quoteattr(Path(os.path.relpath(file, path.parent)).as_posix())}/>"
        for number, file in states
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>'
    return _write(path, "\n".join([head, *rows, "</Collection>", "</VTKFile>", ""]))


def _name(name):
    """A name that ParaView's own expressions can use."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise InputError("name of VTK data", name, "use letters, digits and underscores")
    return name


def _per_point(name, given, lines):
    """One value, one per polyline, or per polyline one per point: as one array (m,) a polyline."""
    given = [given] * len(lines) if np.isscalar(given) else list(given)
    if len(given) != len(lines):
        raise InputError(name, len(given), f"one value or {len(lines)}, one a polyline")
    arrays = []
    for k, (value, points) in enumerate(zip(given, lines, strict=True)):
        value = np.asarray(value)
        if value.shape not in ((), (len(points),)) or value.dtype.kind not in "biuf":
            raise InputError(f"{name}[{k}]", value.shape, f"a number or {len(points)} of them")
        arrays.append(np.broadcast_to(value, (len(points),)))
    return arrays


def _array(name, values):
    """One DataArray element: base64 of zlib blocks, headed by their number and sizes."""
    raw = values.tobytes()
    blocks = [zlib.compress(raw[k : k + BLOCK], LEVEL) for k in range(0, len(raw), BLOCK)]
    sizes = [len(blocks), BLOCK, len(raw) % BLOCK, *map(len, blocks)]
    header = base64.b64encode(np.array(sizes, dtype="<u4").tobytes()).decode()
    content = base64.b64encode(b"".join(blocks)).decode()
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    kind = _TYPES[values.dtype.str[1:]]
    return (
        f'<DataArray type="{kind}" Name="{name}"{width} format="binary">'
        f"{header}{content}</DataArray>"
    )


def _field(name, value):
    """One piece of field data: text as the codes of its UTF-8 bytes closed by 0, or a number."""
    if isinstance(value, str):
        codes = " ".join(str(code) for code in [*value.encode(), 0])
        return (
            f'<Array type="String" Name="{name}" NumberOfTuples="1" format="ascii">{codes}</Array>'
        )
    if isinstance(value, (bool, int, np.integer, np.bool_)):
        kind, text = "Int64", str(int(value))
    elif isinstance(value, (float, np.floating)) and math.isfinite(value):
        kind, text = "Float64", repr(float(value))
    else:
        raise InputError(f"field_data[{name!r}]", value, "must be text or a finite number")
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfTuples="1" format="ascii">'
        f"{text}</DataArray>"
    )


def _write(path, text):
    """Write text under a temporary name and move it into place."""
    with replacing(path) as partial:
        partial.write_bytes(text.encode())
    return Path(path)

"""VTK files, read back by a parser of their own and measured as surfaces."""

import base64
import math
import struct
import xml.etree.ElementTree as ElementTree
import zlib

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.figures.vtk import tube_surface, write_series, write_yarns

MM = 1e-3
KINDS = {"Float32": "<f4", "Float64": "<f8", "Int32": "<i4", "UInt8": "<u1"}


def decode(element):
    """Values of a binary DataArray, after the description of VTK's compressed XML format."""
    text = element.text.strip()
    count = struct.unpack("<I", base64.b64decode(text[:8])[:4])[0]
    header_length = 4 * math.ceil(4 * (3 + count) / 3)
    header = struct.unpack(
        f"<{3 + count}I", base64.b64decode(text[:header_length])[: 4 * (3 + count)]
    )
    data, raw = base64.b64decode(text[header_length:]), b""
    for k, size in enumerate(header[3:]):
        block, data = zlib.decompress(data[:size]), data[size:]
        last_partial = k == count - 1 and header[2]
        assert len(block) == (header[2] if last_partial else header[1])
        raw += block
    assert data == b""
    values = np.frombuffer(raw, dtype=KINDS[element.get("type")])
    return values.reshape(-1, int(element.get("NumberOfComponents", 1))).squeeze()


def read(path):
    root = ElementTree.fromstring(path.read_bytes())
    assert root.tag == "VTKFile" and root.get("type") == "PolyData"
    assert root.get("byte_order") == "LittleEndian" and root.get("header_type") == "UInt32"
    assert root.get("compressor") == "vtkZLibDataCompressor"
    piece = root.find("PolyData/Piece")
    data = {e.get("Name"): decode(e) for e in piece.iter("DataArray")}
    assert len(data["Points"]) == int(piece.get("NumberOfPoints"))
    assert len(data["offsets"]) == int(piece.get("NumberOfPolys"))
    fields = {}
    for element in root.find("PolyData/FieldData"):
        words = element.text.split()
        if element.get("type") == "String":
            codes = bytes(int(word) for word in words)
            assert codes[-1] == 0
            fields[element.get("Name")] = codes[:-1].decode()
        else:
            fields[element.get("Name")] = float(words[0])
    return data, fields, piece


def faces(data):
    return np.split(data["connectivity"], data["offsets"][:-1])


def helix(count=60):
    t = np.linspace(0, 2 * np.pi, count)
    return np.stack([np.cos(t), np.sin(t), 0.4 * t], axis=1) * MM


def test_surface_is_closed_and_turns_outward(tmp_path):
    lines = [helix(), helix() + np.array([5 * MM, 0, 0])]
    data, _, _ = read(write_yarns(tmp_path / "a.vtp", lines, 0.1 * MM, sides=12))
    points, normals = data["Points"].astype(float), data["Normals"].astype(float)
    # The flat ends have points of their own: join equal ones before looking for open edges.
    _, joined = np.unique(data["Points"], axis=0, return_inverse=True)
    edges = {}
    for face in faces(data):
        ids = joined[face].ravel()
        assert len(set(ids)) == len(ids)
        for a, b in zip(ids, np.roll(ids, -1), strict=True):
            edges[a, b] = edges.get((a, b), 0) + 1
    # Each edge once in each direction: closed and oriented without contradiction.
    assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
    volume = 0.0
    for face in faces(data):
        corner = points[face]
        turns = [
            np.cross(corner[i] - corner[0], corner[i + 1] - corner[0])
            for i in range(1, len(face) - 1)
        ]
        area = sum(turns)
        assert area @ normals[face].sum(0) > 0.8 * np.linalg.norm(area) * len(face)
        volume += (
            sum(corner[0] @ np.cross(corner[i], corner[i + 1]) for i in range(1, len(face) - 1)) / 6
        )
    # Pappus: a section times the way of its centre; the section is a regular twelve-sided polygon.
    section = 0.5 * 12 * math.sin(2 * math.pi / 12) * (0.1 * MM) ** 2
    way = 2 * math.pi * math.hypot(1, 0.4) * MM
    assert volume == pytest.approx(2 * section * way, rel=5e-3)


def test_points_lie_at_the_radius_and_normals_point_away(tmp_path):
    radii = [np.linspace(0.1, 0.2, 60) * MM]
    data, _, _ = read(write_yarns(tmp_path / "a.vtp", [helix()], radii, sides=9))
    away = data["Points"][: 9 * 60].reshape(60, 9, 3) - helix()[:, None]
    # Coordinates are rounded to 1/1024 of the smallest radius or finer, 3 of them to a point.
    assert np.abs(np.linalg.norm(away, axis=2) - radii[0][:, None]).max() < 1e-4 * MM
    normals = data["Normals"][: 9 * 60].reshape(60, 9, 3)
    assert np.abs(away / radii[0][:, None, None] - normals).max() < 6e-3
    assert np.abs(np.linalg.norm(data["Normals"], axis=1) - 1).max() < 5e-3


def test_rings_are_square_to_the_yarn():
    points, normals, source, _ = tube_surface(helix(2001), 0.1 * MM, 8)
    t = np.linspace(0, 2 * np.pi, 2001)
    tangent = np.stack([-np.sin(t), np.cos(t), np.full(2001, 0.4)], axis=1) / math.hypot(1, 0.4)
    inner = (source > 0) & (source < 2000)
    assert np.abs((normals * tangent[source]).sum(1)[inner]).max() < 1e-6
    assert normals[-8:] == pytest.approx(np.tile(tangent[-1], (8, 1)), abs=2e-3)
    assert points[-8:] == pytest.approx(points[-24:-16])


def test_rings_do_not_spin_round_a_straight_or_a_hairpin_yarn():
    straight = np.stack([np.linspace(0, 1, 5), np.zeros(5), np.zeros(5)], axis=1)
    _, normals, _, _ = tube_surface(straight, 0.1, 6)
    assert np.ptp(normals[:30].reshape(5, 6, 3), axis=0).max() == 0.0
    turned = np.array([(0, 0, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0)], dtype=float)
    points, normals, _, _ = tube_surface(turned, 0.1, 6)
    assert np.isfinite(points).all()
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)


def test_values_and_names_come_back(tmp_path):
    lines = [helix(7), helix(5) + np.array([3 * MM, 0, 0])]
    tension = [np.arange(7) * 0.1, np.arange(5) * 0.2]
    path = write_yarns(
        tmp_path / "b.vtp",
        lines,
        [0.1 * MM, 0.12 * MM],
        point_data={"course": [0, 1], "yarn_tension": tension, "strain": 0.25},
        field_data={"fabric": 'Köper <"&>', "step": 12, "strain": 0.1},
        sides=4,
    )
    data, fields, piece = read(path)
    assert fields == {"fabric": 'Köper <"&>', "step": 12.0, "strain": 0.1}
    # Four to a ring, then four for the first and four for the last point.
    first = np.concatenate([np.repeat(tension[0], 4), np.zeros(4), np.full(4, 0.6)])
    second = np.concatenate([np.repeat(tension[1], 4), np.zeros(4), np.full(4, 0.8)])
    assert data["yarn_tension"] == pytest.approx(np.concatenate([first, second]))
    assert data["course"].dtype == np.int32
    assert (data["course"] == np.repeat([0, 1], [36, 28])).all()
    assert (data["strain"] == np.float32(0.25)).all()
    assert piece.find("PointData").get("Scalars") == "yarn_tension"
    assert [len(f) for f in faces(data)] == [4] * 24 + [4, 4] + [4] * 16 + [4, 4]


def test_long_arrays_take_several_blocks(tmp_path):
    # 4096 points of 8 sides: 98304 bytes = three full blocks of coordinates without the ends.
    data, _, _ = read(write_yarns(tmp_path / "c.vtp", [helix(4094)], 0.1 * MM, sides=2 + 6))
    assert data["Points"].nbytes == 3 * 4 * 8 * 4096 and data["Points"].nbytes % 32768 == 0
    assert data["offsets"][-1] == data["connectivity"].size


def test_same_state_same_bytes_and_nothing_left_over(tmp_path):
    a, b = (write_yarns(tmp_path / n / "s.vtp", [helix()], 0.1 * MM) for n in ("a", "b"))
    assert a.read_bytes() == b.read_bytes()
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["s.vtp"]


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = write_yarns(tmp_path / "s.vtp", [helix()], 0.1 * MM)
    before = path.read_bytes()
    with pytest.raises(InputError):
        write_yarns(path, [helix()], -0.1 * MM)
    assert path.read_bytes() == before and len(list(tmp_path.iterdir())) == 1


def test_one_state_of_a_fabric_is_small(tmp_path):
    # 2 x 2 loops of 100 points, as the workflow writes them.
    t = 2 * np.pi * np.arange(201) / 100
    course = (
        np.stack([0.24 * t - 0.5 * np.sin(2 * t), -np.cos(t), 0.2 * np.cos(2 * t)], axis=1) * MM
    )
    path = write_yarns(
        tmp_path / "s.vtp",
        [course, course + np.array([0, 1.2 * MM, 0])],
        0.14 * MM,
        point_data={"course": [0, 1], "yarn_tension": [np.sin(t), np.sin(t)]},
    )
    assert path.stat().st_size < 100_000


def test_series_names_its_states_as_seen_from_it(tmp_path):
    states = [(0.0, tmp_path / "states" / "a&b_0.vtp"), (0.1, tmp_path / "states" / "a&b_1.vtp")]
    path = write_series(tmp_path / "series.pvd", states)
    root = ElementTree.fromstring(path.read_bytes())
    assert root.get("type") == "Collection"
    rows = root.findall("Collection/DataSet")
    assert [float(r.get("timestep")) for r in rows] == [0.0, 0.1]
    assert [r.get("file") for r in rows] == ["states/a&b_0.vtp", "states/a&b_1.vtp"]


@pytest.mark.parametrize("numbers", [[], [0.0, 0.0], [1.0, 0.5], [0.0, math.nan]])
def test_series_needs_growing_numbers(tmp_path, numbers):
    with pytest.raises(InputError, match=r"s\.pvd"):
        write_series(tmp_path / "s.pvd", [(n, "a.vtp") for n in numbers])


LINE = helix(5)


@pytest.mark.parametrize(
    ("arguments", "options", "named"),
    [
        (([], 1e-4), {}, "polylines"),
        (([LINE[:1]], 1e-4), {}, "polylines[0]"),
        (([LINE, LINE[:, :2]], 1e-4), {}, "polylines[1]"),
        (([LINE + math.inf], 1e-4), {}, "polylines[0]"),
        (([LINE[[0, 0, 1]]], 1e-4), {}, "polylines[0]"),
        (([LINE], 0.0), {}, "radius"),
        (([LINE], [1e-4, 1e-4]), {}, "radius"),
        (([LINE], 1e-4), {"sides": 2}, "sides"),
        (([LINE], 1e-4), {"point_data": {"yarn tension": 1.0}}, "yarn tension"),
        (([LINE], 1e-4), {"point_data": {"yarn_tension": [[1.0, 2.0]]}}, "yarn_tension[0]"),
        (([LINE], 1e-4), {"field_data": {"strain": math.nan}}, "strain"),
        (([LINE], 1e-4), {"field_data": {"strain": [1.0]}}, "strain"),
    ],
)
def test_what_cannot_be_written_is_refused_by_name(tmp_path, arguments, options, named):
    with pytest.raises(InputError) as caught:
        write_yarns(tmp_path / "s.vtp", *arguments, **options)
    assert named in str(caught.value) and "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())

"""Drawn yarns: what is seen where, checked by brute force, closed forms and symmetry."""

import math
from itertools import pairwise

import matplotlib
import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.figures import style
from knitsim.figures import tubes_kernels as kernels
from knitsim.figures.tubes import (
    _carry_frames,
    draw_tubes,
    fabric_polylines,
    render_tubes,
    view_of,
)

MM = 1e-3


def z_buffer(lines, radii, rows, columns):
    points = np.concatenate(lines)
    starts = np.cumsum([0] + [len(line) for line in lines])
    radius = np.concatenate([np.full(len(line), r) for line, r in zip(lines, radii, strict=True)])
    depth = np.full((rows, columns), -np.inf, dtype=np.float32)
    owner = np.full((rows, columns), -1, dtype=np.int32)
    kernels.trace(points, radius, starts, depth, owner)
    return depth, owner


def inside(point, line, radius):
    """Whether a point lies in a yarn, by distance to its centre line and the two end planes."""
    if (point - line[0]) @ (line[1] - line[0]) < 0 or (point - line[-1]) @ (
        line[-2] - line[-1]
    ) < 0:
        # Behind the plane of an end, and no other part of the line comes near it in these tests.
        return False
    for a, b in pairwise(line):
        t = min(1.0, max(0.0, (point - a) @ (b - a) / ((b - a) @ (b - a))))
        if np.linalg.norm(point - a - t * (b - a)) <= radius:
            return True
    return False


def first_hit(x, y, lines, radii, top, bottom, step):
    """Height at which a ray from above enters a yarn: march down, then bisect."""
    z = top
    while z > bottom:
        for line, radius in zip(lines, radii, strict=True):
            if inside(np.array([x, y, z]), line, radius):
                low, high = z, z + step
                for _ in range(40):
                    middle = 0.5 * (low + high)
                    if inside(np.array([x, y, middle]), line, radius):
                        low = middle
                    else:
                        high = middle
                return low
        z -= step
    return -np.inf


LINES = {
    "bent": [[(4, 5, 0), (16, 7, 6), (24, 16, 2), (20, 28, -8)]],
    "straight to the eye": [[(15, 15, -9), (15, 15, 9)]],
    "from the eye, then aside": [[(12, 12, 12), (12, 12, -4), (26, 20, -6)]],
    "flat along a row": [[(-5, 10.5, 0), (40, 10.5, 0)]],
    "leaning to the eye": [[(10, 8, -20), (14, 20, 8)]],
    "leaning from the eye": [[(10, 8, 8), (14, 20, -20)]],
    "crossing": [[(2, 15, -3), (30, 17, 4)], [(15, 2, 3), (17, 30, -4)]],
}


@pytest.mark.parametrize("name", LINES)
def test_nearest_surface_is_that_of_marching_rays(name):
    lines = [np.array(line, dtype=float) for line in LINES[name]]
    radii = [5.0, 3.5][: len(lines)]
    depth, owner = z_buffer(lines, radii, 32, 30)
    assert ((owner >= 0) == np.isfinite(depth)).all()
    missed, hits = 0, 0
    for row in range(1, 32, 3):
        for column in range(0, 30, 3):
            expected = first_hit(column + 0.5, row + 0.5, lines, radii, 25.0, -35.0, 0.25)
            if np.isfinite(expected) != np.isfinite(depth[row, column]):
                missed += 1  # the march can step over a sliver at an outline
            elif np.isfinite(expected):
                hits += 1
                assert depth[row, column] == pytest.approx(expected, abs=1e-4)
    assert hits >= 7 and missed <= 1


def test_crossing_yarns_own_their_samples_by_depth():
    lines = [np.array(line, dtype=float) for line in LINES["crossing"]]
    both, owner = z_buffer(lines, [5.0, 3.5], 32, 30)
    alone = [z_buffer([line], [r], 32, 30)[0] for line, r in zip(lines, [5.0, 3.5], strict=True)]
    assert (both == np.maximum(*alone)).all()
    seen = owner >= 0
    assert ((owner // kernels.KINDS >= 2) == (alone[1] > alone[0]))[seen].all()


def test_no_sphere_shows_through_a_flat_end():
    # Segments much shorter than the radius: the joints' spheres reach beyond the end.
    line = np.stack([np.linspace(8, 30, 40), np.full(40, 16.0), np.linspace(0, -14, 40)], axis=1)
    depth, owner = z_buffer([line], [7.0], 32, 32)
    whole, whole_owner = z_buffer([line[[0, -1]]], [7.0], 32, 32)
    assert (np.isfinite(depth) == np.isfinite(whole)).all()
    assert depth[np.isfinite(depth)] == pytest.approx(whole[np.isfinite(whole)], abs=1e-4)
    assert (owner % 3 == kernels.START).sum() == (whole_owner % 3 == kernels.START).sum() > 20


def ring(segments, radius=40.0, tube=10.0):
    angle = np.linspace(0.3, 2.6, segments + 1)
    nodes = np.zeros((segments + 1, kernels.NODE_WIDTH))
    nodes[:, 0], nodes[:, 1] = 50 + radius * np.cos(angle), 10 + radius * np.sin(angle)
    nodes[:, kernels.RADIUS] = tube
    _carry_frames(nodes, np.array([0, segments + 1]))
    return nodes


def test_normals_on_a_ring_approach_those_of_a_torus_at_second_order():
    errors = []
    for segments in (12, 24, 48):
        nodes = ring(segments)
        depth, owner = z_buffer([nodes[:, :3]], [10.0], 64, 100)
        normal, worst = np.empty(3), 0.0
        for row in range(30, 60, 3):
            for column in range(20, 80, 3):
                # The first and last segment have one-sided tangents, of first order.
                if not 0 < owner[row, column] // kernels.KINDS < segments - 1:
                    continue
                kernels._surface(row, column, nodes, depth, owner, normal)
                x, y, z = column + 0.5 - 50, row + 0.5 - 10, depth[row, column]
                out = math.hypot(x, y)
                # Direction from the centre circle of the torus; near its outline z is too steep.
                exact = np.array([x - 40 * x / out, y - 40 * y / out, z])
                if z < 5.0:
                    continue
                worst = max(worst, np.abs(normal - exact / np.linalg.norm(exact)).max())
        errors.append(worst)
    assert errors[0] > 1e-4  # there is something to converge
    assert errors[0] / errors[1] > 3.0 and errors[1] / errors[2] > 3.0


def test_frames_are_square_to_the_yarn_and_do_not_turn_in_a_plane():
    nodes = ring(30)
    tangent, frame = nodes[:, 3:6], nodes[:, 9:12]
    assert np.abs((tangent * frame).sum(1)).max() < 1e-14
    assert np.abs(np.linalg.norm(frame, axis=1) - 1).max() < 1e-14
    out_of_plane = frame[:, 2]  # the angle to the ring's plane stays
    assert np.ptp(out_of_plane) < 1e-13
    chords = np.linalg.norm(np.diff(nodes[:, :3], axis=0), axis=1)
    assert nodes[:, kernels.ARC] == pytest.approx(np.r_[0.0, np.cumsum(chords)], rel=1e-14)


def test_edge_of_a_shadow_is_a_box_three_cells_wide():
    shadow = np.zeros((40, 40), dtype=np.float32)
    shadow[:, 20:] = 100.0
    look = np.zeros(kernels.LOOK_WIDTH)
    look[kernels.LIGHT_RIGHT], look[kernels.LIGHT_UP + 1], look[kernels.LIGHT + 2] = 1, 1, 1
    look[kernels.MAP_SCALE] = 1.0
    for x in np.linspace(15.0, 25.0, 41):
        # The share of the box x - 3/2 .. x + 3/2 that lies left of the edge.
        expected = np.clip((20.0 - (x - 1.5)) / 3.0, 0.0, 1.0)
        assert kernels._lit(x, 17.3, 0.0, shadow, look) == pytest.approx(expected, abs=1e-12)
    assert kernels._lit(30.0, 17.3, 100.0, shadow, look) == 1.0
    assert kernels._lit(-50.0, 17.3, 0.0, shadow, look) == 1.0


def test_hidden_sky_is_the_mean_over_its_places():
    rng = np.random.default_rng(3)
    depth = rng.uniform(0, 20, (60, 60)).astype(np.float32)
    depth[40:, :] = -np.inf
    taps = rng.uniform(-2, 2, (kernels.TAPS, 2))
    normal = np.array([0.6, 0.0, 0.8])
    terms = []
    for x, y in np.rint(taps * 9.0).astype(int):
        row, column = 35 + y, 3 + x
        term = 0.0
        if 0 <= row < 60 and 0 <= column < 60 and np.isfinite(depth[row, column]):
            to = np.array([x, y, float(depth[row, column]) - float(depth[35, 3])])
            if to @ normal > 0.04 * 9.0:
                term = 9.0 * (to @ normal) / (to @ to + 0.1 * 81.0)
        terms.append(term)
    assert 0 < np.count_nonzero(terms) < len(terms)
    value = kernels._hidden(35, 3, normal, 9.0, depth, taps)
    assert value == pytest.approx(np.mean(terms), rel=1e-5)


def test_flat_end_towards_the_eye_has_the_brightness_of_the_lighting_formula():
    line = np.array([(0, 0, -1), (0, 0, 0)]) * MM
    light = np.array([-0.3, 0.4, 0.8])
    image = render_tubes([line], 0.2 * MM, (0.9, 0.5, 0.2), pixel=0.01 * MM, light=light)
    middle = image.rgba[image.rgba.shape[0] // 2, image.rgba.shape[1] // 2]
    unit = light / np.linalg.norm(light)
    half = math.sqrt(0.5 * (1 + unit[2]))  # cosine of half the angle between light and eye
    bright = 0.5 * (kernels.SKY + kernels.GROUND)
    bright += kernels.KEY * (unit[2] + kernels.WRAP) / (1 + kernels.WRAP)
    gloss = kernels.GLOSS * half**kernels.GLOSS_POWER
    expected = 255 * np.sqrt(np.array([0.9, 0.5, 0.2]) ** 2 * bright + gloss)
    assert middle[:3] == pytest.approx(expected, abs=0.51)
    assert middle[3] == 255


def test_covered_area_is_that_of_the_yarn():
    line = np.array([(0, 0, 0), (3, 1.37, 0)]) * MM
    image = render_tubes([line], 0.25 * MM, "white", pixel=0.01 * MM)
    area = image.rgba[..., 3].sum() / 255 * 0.01**2
    assert area == pytest.approx(math.hypot(3, 1.37) * 0.5, rel=2e-3)
    assert (image.rgba[0, :, 3] == 0).all() and (image.rgba[:, 0, 3] == 0).all()


def test_the_picture_lies_where_its_extent_says():
    lines = [np.array([(1, 2, 0), (1, 2, 1)]) * MM, np.array([(4, 7, 0), (4, 7, 1)]) * MM]
    image = render_tubes(lines, 0.1 * MM, ["red", "blue"], pixel=0.02 * MM)
    left, right, bottom, top = image.extent
    rows, columns, _ = image.rgba.shape
    for (x, y), colour in (((1, 2), 0), ((4, 7), 2)):
        row = int((top - y * MM) / (top - bottom) * rows)
        column = int((x * MM - left) / (right - left) * columns)
        assert image.rgba[row, column].argmax() in (colour, 3)
        assert image.rgba[row, column, colour] > 2 * image.rgba[row, column, 2 - colour]
    assert (right - left) / columns == pytest.approx(0.02 * MM)
    assert (top - bottom) / rows == pytest.approx(0.02 * MM)


def cross():
    under = np.array([(-1, 0, 0), (1, 0, 0)]) * MM
    over = np.array([(0, -1, 0.4), (0, 1, 0.4)]) * MM
    return [under, over]


def at(image, x, y):
    left, right, bottom, top = image.extent
    rows, columns, _ = image.rgba.shape
    row, column = (top - y) / (top - bottom) * rows, (x - left) / (right - left) * columns
    return image.rgba[int(row), int(column)].astype(float)


def test_over_and_under_exchange_from_the_back():
    for view, seen in (("face", 2), ("back", 0)):
        image = render_tubes(cross(), 0.2 * MM, ["red", "blue"], view, pixel=0.01 * MM)
        middle = at(image, 0.0, 0.0)
        assert middle[seen] > 2 * middle[2 - seen]


def test_the_yarn_above_throws_its_shadow_away_from_the_light_and_darkens_the_crossing():
    options = {"pixel": 0.01 * MM, "light": (-1.0, 0.0, 1.0), "window": (-MM, MM, -MM, MM)}
    both = render_tubes(cross(), 0.2 * MM, "white", **options)
    under = render_tubes(cross()[:1], 0.2 * MM, "white", **options)
    # The top of the lower yarn is 0.2 mm, the upper axis 0.4 mm high: it falls 0.2 mm aside and is
    # 0.2 sqrt(2) = 0.28 mm wide to each side, so that 0.35 mm is in it and -0.8 mm is not.
    shaded, lit = at(both, 0.35 * MM, 0.0), at(under, 0.35 * MM, 0.0)
    assert shaded[0] < 0.8 * lit[0]
    assert at(both, -0.8 * MM, 0.0) == pytest.approx(at(under, -0.8 * MM, 0.0), abs=1)
    # On the side of the light nothing shades, but the sky is partly hidden.
    near, free = at(both, -0.25 * MM, 0.0), at(under, -0.25 * MM, 0.0)
    assert shaded[0] < near[0] < free[0] - 5


def test_picture_is_mirrored_with_its_light():
    line = np.array([(0, -1, 0), (0, 1, 0)]) * MM
    options = {"pixel": 0.01 * MM, "window": (-0.4 * MM, 0.4 * MM, -0.5 * MM, 0.5 * MM)}
    plain = render_tubes([line], 0.3 * MM, "white", light=(-0.4, 0.5, 0.7), **options)
    other = render_tubes([line], 0.3 * MM, "white", light=(0.4, 0.5, 0.7), **options)
    mirrored = np.abs(plain.rgba.astype(int) - other.rgba[:, ::-1].astype(int))
    unchanged = np.abs(plain.rgba.astype(int) - other.rgba.astype(int))
    # A pixel may stand for its left samples only: half a pixel, a grey level or two.  Beyond 0.2 mm
    # light just grazes, and the cells of the two shadow maps lie differently.
    assert mirrored[:, 20:60].max() <= 3 and (mirrored[..., 3] == 0).all()
    assert unchanged[:, 20:60].max() > 20


@pytest.mark.parametrize("twist", [400.0, -400.0])
def test_ridges_rise_to_the_right_in_a_z_twisted_yarn_at_the_helix_angle(twist):
    line = np.array([(0, -2, 0), (0, 2, 0)]) * MM
    pixel, radius = 0.01 * MM, 0.3 * MM
    window = (-0.4 * MM, 0.4 * MM, -0.5 * MM, 0.5 * MM)
    options = {"pixel": pixel, "window": window, "light": (0, 0, 1)}
    image = render_tubes([line], radius, "grey", twist=twist, ridges=8, **options)
    plain = render_tubes([line], radius, "grey", **options)
    grey = image.rgba[..., 0] / (plain.rgba[..., 0] + 1.0)
    middle = grey.shape[1] // 2
    low = grey[70, middle - 10 : middle + 10]
    assert np.ptp(low) > 0.1
    # 0.1 mm further up (10 rows) the ridges in the middle have moved by 2 pi twist r 0.1 mm.
    moves = range(-12, 13)
    error = [np.abs(grey[60, middle - 10 + m : middle + 10 + m] - low).mean() for m in moves]
    expected = 2 * math.pi * twist * radius * 10  # pixels
    assert abs(moves[int(np.argmin(error))] - expected) <= 1.5


def test_colour_changes_along_the_yarn_with_its_points():
    line = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0)]) * MM
    colours = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)
    image = render_tubes([line], 0.2 * MM, [colours], pixel=0.02 * MM)
    # Gloss adds the same to all channels.
    for x, channel in ((0.1, 0), (1.0, 1), (1.9, 2)):
        assert at(image, x * MM, 0.0)[:3].argmax() == channel
    half = at(image, 0.5 * MM, 0.0)
    assert half[0] == pytest.approx(half[1], abs=8) and half[0] > half[2] + 40


def test_same_input_same_picture():
    first, second = (render_tubes(cross(), 0.2 * MM, "white", "oblique") for _ in range(2))
    assert first.rgba.tobytes() == second.rgba.tobytes() and first.extent == second.extent


@pytest.mark.parametrize("view", ["face", "back", "side_course", "side_wale", "oblique", (20, 50)])
def test_views_are_right_handed_frames(view):
    frame = view_of(view)
    basis = np.array([frame.right, frame.up, frame.eye], dtype=float)
    assert basis @ basis.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(basis) == pytest.approx(1.0)


def test_angles_of_a_view_say_where_the_eye_is():
    assert view_of((90, 0)).eye == pytest.approx((1, 0, 0))
    assert view_of((0, 60)).eye == pytest.approx((0, math.sqrt(0.75), 0.5))
    assert view_of((0, 0)).right == pytest.approx(view_of("face").right)


LINE = np.array([(0, 0, 0), (1, 0, 0)]) * MM


@pytest.mark.parametrize(
    ("arguments", "options", "named"),
    [
        (([], 1e-4, "white"), {}, "polylines"),
        (([LINE[:1]], 1e-4, "white"), {}, "polylines[0]"),
        (([LINE, LINE * np.nan], 1e-4, "white"), {}, "polylines[1]"),
        (([LINE[:, :2]], 1e-4, "white"), {}, "polylines[0]"),
        (([LINE], 0.0, "white"), {}, "radius"),
        (([LINE], [1e-4, 1e-4], "white"), {}, "radius"),
        (([LINE], [[1e-4, 1e-4, 1e-4]], "white"), {}, "polylines[0]"),
        (([LINE], 1e-4, (1.0, 2.0, 0.0)), {}, "colours"),
        (([LINE], 1e-4, "no such colour"), {}, "polylines[0]"),
        (([LINE], 1e-4, "white", "above"), {}, "view"),
        (([LINE], 1e-4, "white", (0, 90)), {}, "view"),
        (([LINE], 1e-4, "white"), {"pixel": -1.0}, "pixel"),
        (([LINE], 1e-4, "white"), {"pixel": 1e-9}, "use at least"),
        (([LINE], 1e-4, "white"), {"window": (1, 0, 0, 1)}, "window"),
        (([LINE], 1e-4, "white"), {"light": (0, 0, 0)}, "light"),
        (([LINE], 1e-4, "white"), {"twist": math.inf}, "twist"),
        (([LINE], 1e-4, "white"), {"twist": 100.0, "ridges": 0}, "ridges"),
    ],
)
def test_what_cannot_be_drawn_is_refused_by_name(arguments, options, named):
    with pytest.raises(InputError) as caught:
        render_tubes(*arguments, **options)
    assert named in str(caught.value) and "\n" not in str(caught.value)


def wave(count=20):
    """A loop whose last point is the first of the next one."""
    t = 2 * np.pi * np.arange(count + 1) / count
    return np.stack([0.2 * t, np.cos(t), 0.3 * np.sin(t)], axis=1) * MM


W, C = 0.4 * np.pi * MM, 0.7 * MM


def test_fabric_is_the_loop_and_its_images():
    fabric = fabric_polylines(wave(), W, C, 3, 2, slant=0.1 * MM)
    assert [len(p) for p in fabric.polylines] == [61, 61]
    for j, course in enumerate(fabric.polylines):
        for i in range(3):
            image = wave() + np.array([i * W + j * 0.1 * MM, j * C, 0.0])
            assert course[20 * i : 20 * i + 21] == pytest.approx(image, abs=1e-15)
        assert course[-1] - course[0] == pytest.approx([3 * W, 0, 0], abs=1e-15)


def test_a_cell_of_several_loops_is_repeated_with_all_of_them():
    """Two wales by two courses, each loop unlike the others: where each of them comes to lie."""
    place = [(i, j) for j in range(2) for i in range(2)]
    heights = np.array([0.0, 0.1, 0.2, 0.3]) * MM
    loops = np.array([
        wave() + [i * W, j * C, height] for (i, j), height in zip(place, heights, strict=True)
    ])  # fmt: skip
    colours = np.broadcast_to(np.linspace(0.1, 0.9, 4)[:, None, None], loops.shape)
    fabric = fabric_polylines(loops, W, C, 5, 3, courses=2, slant=0.1 * MM, colours=colours)
    for j, (course, shades) in enumerate(zip(fabric.polylines, fabric.colours, strict=True)):
        for i in range(5):
            own, lean = place.index((i % 2, j % 2)), (j // 2) * 2 * 0.1 * MM
            image = wave() + np.array([i * W + lean, j * C, heights[own]])
            # The last point of a loop is drawn as the first of the next one.
            assert course[20 * i : 20 * i + 20] == pytest.approx(image[:-1], abs=1e-15)
            assert (shades[20 * i : 20 * i + 20] == colours[own, :-1]).all()


def test_fabric_can_be_centred():
    fabric = fabric_polylines(wave(), W, C, 3, 3, centred=True)
    points = np.concatenate(fabric.polylines)
    assert (points.min(0) + points.max(0))[:2] == pytest.approx([0, 0], abs=1e-15)
    assert points[0, 2] == wave()[0, 2]


def test_colours_of_fabric():
    by_course = fabric_polylines(wave(), W, C, 2, 3).colours
    assert (by_course[0] == by_course[2]).all() and not (by_course[0] == by_course[1]).any()
    own = np.linspace(0, 1, 63).reshape(21, 3)
    for shown in fabric_polylines(wave(), W, C, 2, 2, colours=own).colours:
        assert (shown == np.concatenate([own[:-1], own])).all()
    with pytest.raises(InputError, match="colours"):
        fabric_polylines(wave(), W, C, colours=own[:7])


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"loops": wave()[:2]}, "loops"),
        ({"wale_spacing": 0.0}, "wale_spacing"),
        ({"course_spacing": math.nan}, "course_spacing"),
        ({"loops_wide": 0}, "loops_wide"),
        ({"loops_high": 1.5}, "loops_high"),
    ],
)
def test_fabric_refuses_by_name(change, named):
    with pytest.raises(InputError, match=named):
        fabric_polylines(**({"loops": wave(), "wale_spacing": W, "course_spacing": C} | change))


def test_axes_are_in_millimetres_and_named_after_the_view():
    with style.context():
        _, axes = style.figure(120, 60, 1, 3)
        face, back, oblique = axes[0]
        for ax, view in ((face, "face"), (back, "back"), (oblique, "oblique")):
            draw_tubes(ax, [LINE], 0.1 * MM, "white", view)
    assert face.get_xlabel() == "course direction (mm)"
    assert face.get_ylabel() == "wale direction (mm)"
    assert face.get_xlim() == pytest.approx((-0.15, 1.15), abs=0.01)
    assert face.get_aspect() == 1.0
    # From the back the course axis runs to the left but keeps its values.
    assert back.get_xlim() == pytest.approx((1.15, -0.15), abs=0.01)
    assert not oblique.axison and oblique.texts[0].get_text().endswith(" mm")


def test_saved_figures_are_the_same_bytes_and_leave_nothing_else(tmp_path):
    before = dict(matplotlib.rcParams)
    written = []
    for name in ("one", "two"):
        with style.context():
            fig, axes = style.figure(60, 40)
            draw_tubes(axes[0, 0], cross(), 0.2 * MM, "white")
        written.append(style.save(fig, tmp_path / name / "fig05_loops"))
    assert [p.name for p in written[0]] == ["fig05_loops.png", "fig05_loops.svg"]
    for a, b in zip(*written, strict=True):
        assert a.read_bytes() == b.read_bytes()
    assert len(list((tmp_path / "one").iterdir())) == 2
    svg = written[0][1].read_text()
    assert "date" not in svg.lower() and "<image" in svg and "<path" in svg
    assert dict(matplotlib.rcParams) == before

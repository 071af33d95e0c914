"""Figures of the loop: they show what the result file holds, with units, and the same each time."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from figure_tools import check_layout, check_same_twice, draw, lines, named, repeated
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.image import AxesImage, imread
from matplotlib.quiver import Quiver

from knitsim.figures import loop as figures
from knitsim.figures import style
from knitsim.figures.stored import one_loop
from knitsim.figures.tubes import view_of
from knitsim.stages import loop as stage
from knitsim.stages.yarn import layout_of
from knitsim.study.study import load_study

FIGURES = named("loop")
CONFIG = Path(__file__).parents[1] / "config"
UNIT = re.compile(r"\((mm|°)\)$")
MM = 1e3  # from m


@pytest.fixture(scope="module")
def fabric():
    return load_study(CONFIG / "small").fabrics["small"]


@pytest.fixture(scope="module")
def loop(fabric):
    return stage.run(fabric)[0]


@pytest.fixture(scope="module")
def drawn(loop):
    """Every figure, drawn once."""
    return {name: draw(name, {"loop": loop}) for name in FIGURES}


def labelled(fig, label):
    """The axes whose x axis has this label."""
    return next(ax for ax in fig.axes if ax.get_xlabel() == label)


def texts(ax):
    return [text.get_text() for text in ax.texts]


@pytest.mark.parametrize("name", repeated(FIGURES, "fig03_loop_anchors"))
def test_saved_files_are_the_same_twice(name, loop, drawn, tmp_path):
    check_same_twice([drawn[name], draw(name, {"loop": loop})], tmp_path)


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_is_cut_or_lies_on_text_and_legends_have_their_marks(name, drawn):
    check_layout(drawn[name])


@pytest.mark.parametrize("name", FIGURES)
def test_each_figure_is_titled_and_has_units(name, drawn):
    fig = drawn[name]
    assert "small" in fig._suptitle.get_text()
    for ax in fig.axes:
        if ax.axison:
            assert UNIT.search(ax.get_xlabel())
            assert UNIT.search(ax.get_ylabel())
        else:
            assert any(re.fullmatch(r"0\.\d mm", text) for text in texts(ax))


def test_curves_of_the_loop_are_those_of_the_file(loop, drawn):
    fig = drawn["fig03_loop_anchors"]
    face = labelled(fig, "course direction (mm)")
    side = labelled(fig, "thickness (mm)")
    for ax, axes in ((face, [0, 1]), (side, [2, 1])):
        for name, (_, colour, _, _) in figures._CURVES.items():
            found = [xy for xy in lines(ax, color=colour, marker="None") if xy.shape[1] > 2]
            assert len(found) == 1
            assert found[0] == pytest.approx(MM * one_loop(loop)[name].values[:, axes].T, abs=1e-12)
    anchors = np.hstack(lines(face, marker="o"))
    assert anchors == pytest.approx(MM * loop["anchor_point"].values[:, :2].T)
    numbers = [text for text in texts(face) if re.fullmatch(r"\d′?", text)]
    assert numbers == ["1", "2", "3", "4", "5", "6", "5′", "4′", "3′", "2′", "1′"]
    anchors = np.hstack(lines(side, marker="o"))
    assert anchors == pytest.approx(MM * loop["anchor_point"].values[:6, [2, 1]].T)


def test_dimensions_are_those_of_the_file(loop, drawn):
    face = labelled(drawn["fig03_loop_anchors"], "course direction (mm)")
    arrows = [
        np.array([text.xy, text.xyann]) for text in face.texts if getattr(text, "arrow_patch", None)
    ]
    lengths = [np.linalg.norm(np.diff(ends, axis=0)) for ends in arrows]
    known = [
        float(loop[name]) * MM
        for name in ("wale_spacing", "course_spacing", "loop_height", "diameter")
    ]
    assert lengths == pytest.approx(known)
    written = " ".join(texts(face))
    assert "$w$ = 0.900" in written
    assert "$c$ = 0.700" in written
    assert "$d$ = 0.1669" in written
    assert "height 1.069" in written
    side = labelled(drawn["fig03_loop_anchors"], "thickness (mm)")
    assert f"{float(loop['thickness']) * MM:.3f}" in texts(side)


def test_a_fabric_without_peirces_loop_is_drawn_without_it(loop):
    without = loop.copy()
    without["peirce_point"] = xr.full_like(loop["peirce_point"], np.nan)
    legend = [
        text.get_text() for text in figures.fig03_loop_anchors(without).legends[0].get_texts()
    ]
    assert len(legend) == 2
    assert not any("Peirce" in text for text in legend)


def test_straight_yarn_holds_the_fibres_of_the_layout(fabric, loop):
    """Fibres found back from the loop's first section are those that were laid into it."""
    known = layout_of(fabric.yarn).positions
    assert figures._fibre_positions(one_loop(loop)) == pytest.approx(known, abs=1e-6 * known.max())


def test_marked_fibres_lie_round_the_surface():
    angle = np.radians(np.arange(0.0, 360.0, 15.0))
    ring = np.stack([np.cos(angle), np.sin(angle)], -1)
    positions = np.concatenate([0.5 * ring, ring])
    found = figures._outer_fibres(positions, 3)
    assert np.degrees(angle)[found - 24] == pytest.approx([0.0, 120.0, 240.0])


def test_sections_stand_as_the_file_says(loop, drawn):
    fig = drawn["fig04_yarn_into_loop"]
    panels = [ax for ax in fig.axes if not ax.axison]
    axes = [loop["tangent"].values, *loop["printed_section_axis"].values]
    view = view_of(figures._DISC_VIEW)
    places = MM * view.project(loop["centreline"].values[0, :-1])[:, :2]
    diameter = MM * float(loop["diameter"])
    for ax, known in zip(panels, axes, strict=True):
        (arrows,) = (artist for artist in ax.collections if isinstance(artist, Quiver))
        away = np.linalg.norm(places - arrows.XY[:, None], axis=-1)
        section = np.argmin(away, axis=1)
        assert away.min(1).max() < 1e-9
        assert sorted(section) == list(range(len(places)))  # few enough to draw all
        drawn_axes = np.stack([arrows.U, arrows.V], -1)
        assert drawn_axes == pytest.approx(diameter * view.project(known[section])[:, :2])
        (discs,) = (artist for artist in ax.collections if isinstance(artist, PolyCollection)
                    and not isinstance(artist, Quiver))  # fmt: skip
        for path, centre, axis in zip(
            discs.get_paths(), arrows.XY, view.project(known[section]), strict=True
        ):
            rim = path.vertices[:48] - centre
            # A tilted disc is an ellipse as long as the yarn is thick, shortened by the cosine of
            # its tilt along the axis; points even round it scatter by half the squared half axes.
            short, long = np.sqrt(2.0 * np.maximum(np.linalg.eigvalsh(rim.T @ rim / 48), 0.0))
            assert long == pytest.approx(0.5 * diameter)
            assert short == pytest.approx(0.5 * diameter * abs(axis[2]), abs=1e-6 * diameter)
            assert np.abs(rim @ axis[:2]).max() == pytest.approx(
                np.hypot(*axis[:2]) * short, abs=0.01 * diameter
            )


def test_angle_error_is_that_of_the_printed_axes(loop, drawn):
    ax = labelled(
        drawn["fig04_yarn_into_loop"], "length along the yarn, from sinker loop to sinker loop (mm)"
    )
    steps = np.diff(loop["centreline"].values[0], axis=0)
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    for dash, order in (("-", "zx_first"), ("--", "zy_first")):
        (curve,) = lines(ax, color=style.PURPLE, linestyle=dash)
        axis = loop["printed_section_axis"].sel(order=order).values
        cosine = np.clip(np.sum(np.roll(axis, -1, axis=0) * steps, axis=1), -1.0, 1.0)
        known = np.degrees(np.arccos(cosine))
        # The arccosine loses half of the file's seven digits near 0 and 180 degrees.
        assert curve[1] == pytest.approx(known, abs=0.1)
        # Eqs (2), (3) cannot tell forwards from backwards.
        assert (curve[1][steps[:, 0] < 0] > 90.0).all()
        assert (curve[1][steps[:, 0] > 0] < 90.0).all()
        median = float(np.degrees(loop["section_angle_error"].sel(order=order)))
        assert any(f"median {median:.0f}°" in t.get_text() for t in ax.get_legend().get_texts())
    (corrected,) = lines(ax, color=style.GREEN)
    assert corrected[1].max() < 1e-4  # degrees; the file keeps seven digits


def nearest_colour(picture, x, y):
    """Which of the two yarn colours a drawn picture shows at x, y."""
    left, right, bottom, top = picture.get_extent()
    rgba = np.asarray(picture.get_array()) / 255.0
    rows, columns = rgba.shape[:2]
    seen = rgba[int((top - y) / (top - bottom) * rows), int((x - left) / (right - left) * columns)]
    assert seen[3] == 1.0
    # Shading scales a colour, so only its direction counts.
    shade = seen[:3] / np.linalg.norm(seen[:3])
    known = {name: np.array(to_rgb(style.YARN_COLOURS[name])) for name in ("pale", "dark")}
    return min(
        known, key=lambda name: np.linalg.norm(shade - known[name] / np.linalg.norm(known[name]))
    )


def test_legs_lie_on_the_face_heads_and_feet_on_the_back(loop, drawn):
    fig = drawn["fig05_connected_loops"]
    pictures = {
        ax.get_xlabel(): next(a for a in ax.get_children() if isinstance(a, AxesImage))
        for ax in fig.axes
        if ax.get_ylabel() == "wale direction (mm)"
    }
    line = MM * loop["centreline"].values[0]
    w, c = MM * float(loop["wale_spacing"]), MM * float(loop["course_spacing"])
    leg = int(np.argmax(line[: len(line) // 2, 2]))
    wide, high = 7, 8  # of the piece, whose middle is at the origin
    first = np.array([-0.5 * wide * w, -0.5 * (high - 1) * c - 0.5 * np.ptp(line[:, 1])])
    checked = 0
    for course in range(2, high - 2):
        colour = ("pale", "dark")[course % 2]
        for wale in range(2, wide - 2):
            corner = first + [wale * w, course * c]
            front = corner + line[leg, :2]
            assert nearest_colour(pictures["course direction (mm)"], *front) == colour
            # From the back the sinker loop, the lowest point in thickness, lies on top.
            behind = corner + line[0, :2]
            found = nearest_colour(pictures["course direction from the back (mm)"], *behind)
            assert found == colour
            checked += 1
    assert checked == 12


def test_readme_picture_is_all_fabric(loop, tmp_path):
    png, _ = style.save(figures.readme_picture(loop), tmp_path / "fabric")
    assert png.stat().st_size < 300_000
    picture = imread(png)
    assert picture.shape[:2] == (360, 840)
    assert (picture[..., 3] == 1.0).all()
    # The share that is not white is near the cover of the fabric, which counts overlaps twice.
    share = np.mean(picture[..., :3].min(-1) < 0.99)
    assert 0.5 < share <= float(loop["cover"]) + 0.02

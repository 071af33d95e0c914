"""Figures of the bending test: what they show is what the result files hold."""

from pathlib import Path

import numpy as np
import pytest
from figure_tools import check_layout, check_same_twice, draw, named

from knitsim.figures import bending
from knitsim.figures.bending import angles_of_sections
from knitsim.stages import kinematic_bending
from knitsim.stages.laws import calibration_of, laws_of
from knitsim.study.study import load_study

FIGURES = named("bending")
SMALL = Path(__file__).parents[1] / "config" / "small"


@pytest.fixture(scope="module")
def datasets():
    fabric = load_study(SMALL).fabrics["small"]
    laws = laws_of(fabric.yarn, calibration_of(fabric.yarn))
    return {
        f"bending_{direction}": kinematic_bending.run(fabric, laws, direction)[0]
        for direction in ("course", "wale")
    }


@pytest.fixture(scope="module")
def figures(datasets):
    return {stem: draw(stem, datasets) for stem in FIGURES}


@pytest.mark.parametrize("curvature", [-300.0, 300.0])
def test_angles_of_sections_of_known_arcs(curvature):
    s, x0 = np.array([2e-4, 1e-3, 3e-3]), np.array([1e-4, -1e-4, 0.0])
    radius = 1.0 / curvature + x0
    points = np.zeros((3, 3))
    points[:, 1] = radius * np.sin(curvature * s)
    points[:, 2] = radius * np.cos(curvature * s) - 1.0 / curvature
    assert np.allclose(
        angles_of_sections(points, curvature, 1, "corrected"), curvature * s, rtol=1e-12
    )
    # Eqs (8), (9) as printed, on a model of length L.
    angle = curvature * s
    points[:, 1] = 2e-3 * np.sin(angle) / angle
    points[:, 2] = -2e-3 * (1.0 - np.cos(angle)) / angle
    assert np.allclose(angles_of_sections(points, curvature, 1, "printed"), angle, rtol=1e-10)


@pytest.mark.parametrize(("row", "direction", "spacing"), [(0, "course", 0.9), (1, "wale", 0.7)])
def test_curvature_is_constant_when_corrected_and_grows_as_printed(
    row, direction, spacing, datasets, figures
):
    dataset = datasets[f"bending_{direction}"]
    axes = np.array(figures["fig10_bending_curvature"].axes).reshape(2, 3)[row]
    curvatures = [-2.5, -1.25, 1.25, 2.5]
    assert np.allclose(dataset.curvature.values, [-250.0, -125.0, 0.0, 125.0, 250.0])
    for curvature, colour in zip(curvatures, bending.CURVATURE_COLOURS, strict=True):
        angles = [line for line in axes[0].lines if line.get_color() == colour]
        used = [line for line in axes[1].lines if line.get_color() == colour]
        assert len(angles) == len(used) == 2
        for line in angles:
            x, angle = line.get_xydata().T
            known = np.isfinite(x)
            # Degrees: per cm times mm is a tenth of a radian.
            assert np.allclose(angle[known], np.degrees(0.1 * curvature * x[known]), atol=1e-4)
        for line in used:
            x, value = line.get_xydata().T
            known = np.isfinite(x)
            assert known.sum() > 15
            grows = curvature * x / spacing if line.get_linestyle() != "-" else curvature
            assert np.allclose(value[known], np.broadcast_to(grows, x.shape)[known], atol=1e-4)


def test_positions_in_the_figure_are_those_of_the_file(datasets, figures):
    ax = figures["fig10_bending_curvature"].axes[2]
    for step, colour in zip((0, 1, 3, 4), bending.CURVATURE_COLOURS, strict=True):
        for marker, form in (("o", "corrected"), ("x", "printed")):
            (line,) = (
                li for li in ax.lines if li.get_color() == colour and li.get_marker() == marker
            )
            points = datasets["bending_course"].sel(variant=form).centreline.values[step, 0]
            assert np.allclose(
                line.get_xydata(), points[:, [0, 2]] * 1e3, rtol=1e-12, equal_nan=True
            )


def test_bent_fabrics_name_curvature_side_and_yarn_strain(datasets, figures):
    titles = [ax.get_title() for ax in figures["fig11_bending"].axes]
    assert len(titles) == 12
    for k, direction in enumerate(("course", "wale")):
        curve = datasets[f"bending_{direction}"].sel(variant="corrected")
        for title, step, curvature, side in zip(
            titles[6 * k : 6 * k + 5], range(5), ("-2.5", "-1.25", "0", "+1.25", "+2.5"),
            ("back convex", "back convex", "flat", "face convex", "face convex"), strict=True,
        ):  # fmt: skip
            assert title[4:].startswith(f"{curvature} per cm, {side}")
            strain = 100.0 * float(curve.yarn_strain[step])
            assert f"yarn {strain + 0.0:+.2f} %" in title
        assert "as printed" in titles[6 * k + 5]
    assert "0/0" in figures["fig11_bending"].get_supxlabel()


def test_states_beyond_break_are_marked(datasets):
    broken = {name: data.copy(deep=True) for name, data in datasets.items()}
    broken["bending_course"].status.loc[{"variant": "corrected", "step": 4}] = 1
    axes = draw("fig11_bending", broken).axes
    assert ["beyond break" in ax.get_title() for ax in axes] == [k == 4 for k in range(12)]
    texts = [text.get_text() for text in draw("fig10_bending_curvature", broken).legends[0].texts]
    assert [t for t in texts if "beyond break" in t] == ["+2.5 per cm (beyond break)"]


def test_axes_have_units_and_the_title_its_fabric(figures):
    for fig in figures.values():
        assert "small" in fig.get_suptitle()
    for ax in figures["fig10_bending_curvature"].axes:
        assert ax.get_xlabel().endswith("(mm)")
        assert ax.get_ylabel().endswith(("(mm)", "(1/cm)", "(degrees)"))
    for ax in figures["fig11_bending"].axes:
        assert ax.images
        assert ax.texts[0].get_text().endswith(" mm")  # its scale bar


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_is_cut_or_lies_on_text_and_legends_have_their_marks(name, figures):
    check_layout(figures[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_saved_files_are_the_same_twice(name, datasets, figures, tmp_path):
    check_same_twice([figures[name], draw(name, datasets)], tmp_path)


def test_without_the_printed_form_only_the_corrected_one_is_drawn(datasets):
    kept = {name: data.sel(variant=["corrected"]) for name, data in datasets.items()}
    axes = draw("fig11_bending", kept).axes
    assert [ax.axison or bool(ax.images) for ax in axes] == ([True] * 5 + [False]) * 2
    line_styles = {
        li.get_linestyle() for li in draw("fig10_bending_curvature", kept).axes[1].lines[:-2]
    }
    assert line_styles == {"-"}

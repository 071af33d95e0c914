"""Figures of bending in equilibrium, of the KES parameters and from yarn to fabric."""

import re
from pathlib import Path

import numpy as np
import pytest
from figure_tools import check_layout, check_same_twice, draw, lines, named, panel

from knitsim.figures import equilibrium_bending, kes_chart, style
from knitsim.figures.solved import looks
from knitsim.kes import bending_test as kes_bending
from knitsim.stages import equilibrium_bending as stage
from knitsim.stages import equilibrium_rest, kes, kinematic_bending
from knitsim.stages import yarn_to_fabric as sweep
from knitsim.stages.laws import laws_of
from knitsim.store.writer import write
from knitsim.study.study import load_study
from knitsim.units import from_si

FIGURES = named("equilibrium_bending", "kes_chart", "yarn_to_fabric")
SMALL = Path(__file__).parents[1] / "config" / "small"


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    fabric = load_study(SMALL).fabrics["small"]
    laws = laws_of(fabric.yarn, None)
    made, files = {"rigidity": sweep.run(fabric, laws)[0]}, []
    made["relaxed"] = equilibrium_rest.run(fabric, laws)[0]
    for direction in ("course", "wale"):
        made[f"bending_{direction}"] = kinematic_bending.run(fabric, laws, direction)[0]
        made[f"bent_{direction}"] = stage.run(fabric, laws, direction)[0]
        path = (
            tmp_path_factory.mktemp("bending") / "bending" / "small" / f"equilibrium_{direction}.nc"
        )
        path.parent.mkdir(parents=True)
        write(made[f"bent_{direction}"], path)
        files.append(path)
    made["kes"] = kes.run(files)
    return made


@pytest.fixture(scope="module")
def figures(datasets):
    return {name: draw(name, datasets) for name in FIGURES}


def test_axes_name_their_units_and_the_title_its_fabric(figures):
    unit = re.compile(r"\((mm|%|1|1/mm|mN|mN mm|1/cm|gf cm2/cm|gf cm/cm)\)$")
    for name, fig in figures.items():
        assert "small" in fig.get_suptitle()
        for ax in fig.axes:
            if name == "fig20_kes_chart":  # a row whose parameter was left out has no mark
                continue
            assert ax.lines or ax.images or ax.collections, "an empty panel"
            if ax.axison:
                assert unit.search(ax.get_xlabel())
                first = ax.get_subplotspec().is_first_col()
                assert unit.search(ax.get_ylabel()) or (not first and not ax.get_ylabel())


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_is_cut_or_lies_on_text_and_legends_have_their_marks(name, figures):
    check_layout(figures[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_saved_files_are_the_same_twice(name, datasets, figures, tmp_path):
    check_same_twice([figures[name], draw(name, datasets)], tmp_path)


@pytest.mark.parametrize(("direction", "letters"), [("course", "ace"), ("wale", "bdf")])
def test_moments_are_those_of_the_file(direction, letters, datasets, figures):
    fig, test = figures["fig18_equilibrium_bending"], datasets[f"bent_{direction}"]
    colours = {name: look["color"] for name, look in looks(test).items()}
    for name in ("frictionless", "friction"):
        curve = test.sel(variant=name)
        moment = 1e3 * curve.moment_per_width.values
        for key, start in ((letters[0], 0.0), (letters[1], moment[0])):
            drawn = lines(panel(fig, f"({key})"), color=colours[name])
            # Out and back on either side: two lines solid, two dashed.
            assert len(drawn) == 4
            x, y = np.concatenate(drawn, axis=1)
            kept = np.concatenate([np.arange(6), np.arange(5, 11), np.arange(10, 16),
                                   np.arange(15, 21)])  # fmt: skip
            assert x == pytest.approx(0.01 * curve.curvature.values[kept])
            assert y == pytest.approx(moment[kept] - start)
    kinematic = datasets[f"bending_{direction}"].isel(variant=0)
    ((x, y),) = lines(panel(fig, f"({letters[2]})"), color=style.COLOURS["kinematic"])
    assert sorted(y) == pytest.approx(sorted(1e3 * kinematic.moment_per_width.values))
    assert (np.diff(x) >= 0).all()


def test_straight_yarns_bend_by_their_own_rigidity(datasets, figures):
    fig = figures["fig18_equilibrium_bending"]
    for key, direction, count in (("c", "course", 1.0), ("d", "wale", 2.0)):
        test = datasets[f"bent_{direction}"]
        spacing = float(test[{"course": "course", "wale": "wale"}[direction] + "_spacing"][0, 0])
        rigidity = load_study(SMALL).fabrics["small"].yarn["bending_rigidity"]
        ((x, y),) = lines(panel(fig, f"({key})"), linestyle=":", color="k")
        assert y == pytest.approx(1e3 * count * rigidity / spacing * 100 * x)


def test_error_band_is_that_of_the_change(datasets, figures):
    ax = panel(figures["fig18_equilibrium_bending"], "(d)")
    curve = datasets["bent_wale"].sel(variant="frictionless")
    change = 1e3 * (curve.moment_per_width - curve.moment_per_width[0]).values
    high = change + curve.change_error.values * np.abs(change).max()
    outward = ax.collections[0].get_paths()[0].vertices
    assert outward[:, 1].max() == pytest.approx(high[:6].max())


def test_a_test_that_ends_early_says_why_and_shows_what_it_has(datasets):
    short = datasets["bent_wale"].copy(deep=True)
    for name in ("moment_per_width", "centreline", "numerical_error", "change_error"):
        short[name][1, 8:] = np.nan
    short.attrs["stop_reason"] = "friction: the free spacings run away"
    fig = draw("fig18_equilibrium_bending", datasets | {"bent_wale": short})
    said = fig.legends[0].get_title().get_text()
    assert "wale, ended early: friction: the free spacings run away" in said
    drawn = lines(panel(fig, "(b)"), color=looks(short)["friction"]["color"])
    assert sum(line.shape[1] for line in drawn) == 6 + 3


def test_bent_fabrics_stand_beside_the_kinematic_ones(figures):
    titles = [ax.get_title() for ax in figures["fig19_bent_shapes"].axes]
    assert len(titles) == 18
    assert titles[0] == "(a) along course\n-2.5 per cm, back convex"
    assert titles[2] == "(c) along course\n0 per cm"
    assert titles[10:12] == [
        f"({key}) {model}\n-2.5 per cm, back convex"
        for key, model in (("k", "kinematic"), ("l", "equilibrium"))
    ]
    assert titles[17] == "(r) equilibrium\n+2.5 per cm, face convex"
    assert all(ax.images for ax in figures["fig19_bent_shapes"].axes)


def test_without_the_kinematic_test_only_equilibrium_is_drawn(datasets):
    with style.context():
        fig = equilibrium_bending.fig19_bent_shapes(datasets["bent_course"], datasets["bent_wale"])
    assert len(fig.axes) == 10
    bent = {name: datasets[name] for name in ("bent_course", "bent_wale")}
    fig = draw("fig18_equilibrium_bending", bent)
    assert not any("kinematic" in ax.get_title("left") for ax in fig.axes)
    assert "kinematic model" not in [text.get_text() for text in fig.legends[0].get_texts()]


# KES chart


def test_chart_shows_the_values_of_the_file(datasets, figures):
    table = datasets["kes"]
    axes = dict(
        zip([row[2] for row in kes_chart.ROWS], figures["fig20_kes_chart"].axes, strict=True)
    )
    for name in ("B", "2HB"):
        for direction, (colour, _) in list(kes_chart.MARKS.items())[:2]:
            chosen = (
                (table.kes_parameter == name) & (table.direction == direction)
                & (table.variant == "friction")
            ).values  # fmt: skip
            (value,) = table.kes_value.values[chosen]
            points = [
                line.get_xdata()[0] for line in axes[name].lines
                if line.get_color() == style.COLOURS[colour]
            ]  # fmt: skip
            smooth = (
                (table.kes_parameter == name) & (table.direction == direction)
                & (table.variant == "frictionless")
            ).values  # fmt: skip
            # Without friction there is a rigidity, which Figs 21 and 22 show, and no hysteresis.
            others = table.kes_value.values[smooth] if name == "B" else []
            assert points == pytest.approx([value, *others])
            low, high = axes[name].get_xlim()
            assert low < value < high
            said = [text.get_text() for text in axes[name].texts]
            assert f"{direction} {value:.3g}" in said[0]
    # Only bending is in the table here.
    assert axes["G"].texts[0].get_text() == "not tested"
    assert not axes["LT"].lines


def test_scales_of_the_chart_are_round_and_hold_the_values():
    for values in ([0.3], [1.0, 2.0], [0.004, 3.0], [7e-5]):
        low, high = kes_chart.limits(values)
        assert low < min(values) and max(values) < high and high / low >= 10.0 - 1e-9
        for end in (low, high):
            digit = end / 10.0 ** np.floor(np.log10(end) + 1e-9)
            assert min(abs(digit - np.array([1, 2, 5]))) < 1e-9


# From yarn to fabric


def test_rigidity_over_loop_length_with_both_estimates(datasets, figures):
    rows = datasets["rigidity"]
    rows = rows.isel(row=np.flatnonzero(rows.swept.values == "loop_length"))
    first = rows.isel(row=np.flatnonzero(rows.swept_set.values == 0.0))
    yarn = float(rows.yarn_rigidity)
    for key, direction in (("a", "course"), ("d", "wale")):
        ax = panel(figures["fig21_yarn_to_fabric"], f"({key})")
        found = lines(ax, color=style.COLOURS["equilibrium"])
        assert len(found) == 2  # one a set
        x, y = found[0]
        own = first.fabric_rigidity.sel(direction=direction).values
        assert x == pytest.approx(1e3 * first.swept_loop_length.values)
        assert y == pytest.approx(1e-3 * own / yarn)
        ((_, straight),) = lines(ax, color="black")
        spacing = first[f"{direction}_spacing"].values
        assert straight == pytest.approx(1e-3 * {"course": 1, "wale": 2}[direction] / spacing)
        ((_, affine),) = lines(ax, color=style.GREY)
        expected = first.affine_rigidity.sel(direction=direction).values
        assert affine == pytest.approx(1e-3 * expected / yarn)


def test_set_changes_rigidity_curl_and_density(datasets, figures):
    rows = datasets["rigidity"]
    rows = rows.isel(row=np.flatnonzero(rows.swept.values == "set"))
    fig = figures["fig22_set"]
    ((x, y),) = lines(panel(fig, "(a)"), color=style.COLOURS["wale"])
    assert x == pytest.approx(100 * rows.swept_set.values)
    assert y == pytest.approx(1e6 * rows.fabric_rigidity.sel(direction="wale").values)
    ((_, y),) = lines(panel(fig, "(c)"), label="kc = l/c")
    assert y == pytest.approx((rows.swept_loop_length / rows.course_spacing).values)
    ((_, munden),) = lines(panel(fig, "(d)"), linestyle="--")
    assert munden == pytest.approx(1.3)


def test_marks_stand_where_kes_reads():
    low, high = (from_si(edge, "per_cm") for edge in kes_bending.SLOPE_RANGE)
    assert equilibrium_bending.SLOPE_RANGE == pytest.approx((low, high))
    assert equilibrium_bending.HYSTERESIS_AT == pytest.approx(
        from_si(kes_bending.HYSTERESIS_AT, "per_cm")
    )


def test_a_long_heading_stays_on_the_page(datasets):
    name = "a_fabric_with_a_long_name_loop_length_mm=3.45"
    named = datasets["bent_course"].assign_attrs(fabric=name)
    fig = draw("fig18_equilibrium_bending", datasets | {"bent_course": named})
    box = fig._suptitle.get_window_extent()
    assert 0.0 <= box.x0 and box.x1 <= fig.bbox.width
    assert name in fig.get_suptitle().replace("\n", " ")

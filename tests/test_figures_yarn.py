"""Figures of the yarn: they show what the result file holds, with units, and the same each time."""

import re
from pathlib import Path

import numpy as np
import pytest
from figure_tools import check_layout, check_same_twice, draw, lines, named, repeated

from knitsim.errors import InputError
from knitsim.figures import style, yarn_tension
from knitsim.figures import yarn as figures
from knitsim.stages import yarn as stage
from knitsim.study.study import load_study

FIGURES = named("yarn", "yarn_tension")
CONFIG = Path(__file__).parents[1] / "config"
UNIT = re.compile(r"\((mm|µm|%|°|N|cN/dtex|J/m)\)$")


@pytest.fixture(scope="module")
def small():
    return stage.run(load_study(CONFIG / "small").yarns["small"])[0]


@pytest.fixture(scope="module")
def polyester():
    return stage.run(load_study(CONFIG).yarns["polyester"])[0]


def said(fig):
    """All texts of a figure."""
    found = [text.get_text() for text in fig.texts]
    if fig._suptitle is not None:
        found.append(fig._suptitle.get_text())
    for ax in fig.axes:
        found += [ax.get_title("left"), *(text.get_text() for text in ax.texts)]
        if ax.get_legend() is not None:
            found += [text.get_text() for text in ax.get_legend().get_texts()]
    for legend in fig.legends:
        found += [text.get_text() for text in legend.get_texts()]
    return "\n".join(found)


def unlabelled(fig):
    """Axes without a unit: on both axis labels or, where there is no frame, on a scale bar."""
    missing = []
    for ax in fig.axes:
        if not ax.axison:
            if not any(re.search(r"\d (mm|µm)", text.get_text()) for text in ax.texts):
                missing.append(ax.get_title("left"))
        elif not (UNIT.search(ax.get_xlabel()) and UNIT.search(ax.get_ylabel())):
            missing.append(ax.get_title("left"))
        missing += [c for c in ax.child_axes if not UNIT.search(c.get_ylabel())]
    return missing


@pytest.fixture(scope="module")
def drawn(polyester):
    """Every figure, drawn once."""
    return {name: draw(name, {"yarn": polyester}) for name in FIGURES}


@pytest.mark.parametrize("name", repeated(FIGURES, "fig02_fibre_sections"))
def test_saved_files_are_the_same_twice(name, polyester, drawn, tmp_path):
    check_same_twice([drawn[name], draw(name, {"yarn": polyester})], tmp_path)


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_is_cut_or_lies_on_text_and_legends_have_their_marks(name, drawn):
    check_layout(drawn[name])


@pytest.mark.parametrize("name", FIGURES)
def test_each_figure_is_titled_and_has_units(name, drawn):
    fig = drawn[name]
    assert "polyester" in fig._suptitle.get_text()
    assert unlabelled(fig) == []
    assert "experiment" not in said(fig).lower()


def test_section_shows_every_fibre_at_true_size(polyester):
    fig = figures.fig01_yarn_springs(polyester)
    ax = next(ax for ax in fig.axes if ax.get_xlabel() == "x (µm)")
    (outline,) = ax.patches
    assert 2e-6 * outline.radius == pytest.approx(float(polyester["diameter"]))
    assert outline.center == (0.0, 0.0)
    (fibres,) = ax.collections
    # In units of the axes, whose scales are equal, so the fibres are round.
    assert fibres._units == "xy"
    for size in (fibres.get_widths(), fibres.get_heights()):
        assert 1e-6 * size == pytest.approx(float(polyester["fibre_diameter"]))
    assert 1e-6 * fibres.get_offsets() == pytest.approx(polyester["fibre_position"].values)
    (springs,) = lines(ax, color=style.GREEN)
    drawn = {tuple(np.round(p, 6)) for p in springs.T.reshape(-1, 3, 2)[:, :2].reshape(-1, 4)}
    ends = 1e6 * polyester["fibre_position"].values[polyester["section_edge"].values]
    assert drawn == {tuple(np.round(p, 6)) for p in ends.reshape(-1, 4)}


def test_springs_join_what_they_should(small):
    ax = next(ax for ax in figures.fig01_yarn_springs(small).axes if not ax.axison)
    points = lines(ax, color=style.BLACK, marker="o")
    assert [p.shape[1] for p in points] == [7] * 4
    points = points[::-1]  # drawn from the far section to the near one

    def fibre_at(place, section):
        away = np.linalg.norm(points[section].T - place, axis=1)
        assert away.min() < 1e-9
        return int(np.argmin(away))

    coils = lines(ax, color=style.BLUE)
    fibres = [
        (s, fibre_at(coil[:, 0], s - 1), fibre_at(coil[:, -1], s))
        for s, coil in zip(np.repeat([3, 2, 1], len(coils) // 3), coils, strict=True)
    ]
    assert len({k for _, k, _ in fibres}) == len(coils) // 3 > 1
    assert all(first == last for _, first, last in fibres)
    bends = lines(ax, color=style.PURPLE)
    assert len(bends) == 2
    for section, arc in enumerate(bends):
        assert fibre_at(arc[:, 0], section) == fibre_at(arc[:, -1], section + 2)
    assert len(lines(ax, color=style.GREEN)) == 4


def test_straight_yarn_is_that_of_the_file(small):
    path = small["fibre_path"].sel(twist_form="corrected").values
    length = float(path[-1, 0, 2])
    for sign in (1.0, -1.0):
        turned = sign * float(small["twist"])
        found = figures.straight_fibres(small["fibre_position"].values, turned, length, 8)
        along, x, y = np.moveaxis(found, -1, 0)
        if sign > 0:
            expected = path.transpose(1, 0, 2)
            assert np.stack([x, y, along], -1) == pytest.approx(expected, abs=1e-12)
        else:  # an S yarn turns the other way: its section at the end is turned back to the start
            angle = 2.0 * np.pi * float(small["twist"]) * length
            assert x[:, -1] == pytest.approx(
                x[:, 0] * np.cos(angle) + y[:, 0] * np.sin(angle), abs=1e-12
            )


def test_fibres_jump_as_printed_and_turn_as_corrected(polyester):
    fig = figures.fig02_fibre_sections(polyester)
    across = [ax for ax in fig.axes if ax.get_xlabel() == "x (µm)"]
    step = 2.0 * np.pi * float(polyester["twist"]) * float(polyester["section_spacing"])
    seen = {}
    for ax, form in zip(across, ("printed", "corrected"), strict=True):
        paths = [xy for xy in lines(ax, marker="o") if xy.shape[1] == 9]
        assert len(paths) == 4
        known = 1e6 * polyester["fibre_path"].sel(twist_form=form).values[..., :2]
        for x, y in paths:
            away = np.abs(known - np.stack([x, y], -1)[:, None]).max((0, 2))
            assert away.min() < 1e-9
            radius, angle = np.hypot(x, y), np.unwrap(np.arctan2(y, x))
            assert radius == pytest.approx(radius[0], rel=1e-9)
            if form == "corrected":
                assert np.diff(angle) == pytest.approx(step, rel=1e-6)
            else:  # a reflection: back at the start after two sections
                assert x[::2] == pytest.approx(x[0], abs=1e-9)
                assert angle[1] % (2 * np.pi) == pytest.approx((step - angle[0]) % (2 * np.pi))
        seen[form] = sorted(round(float(np.hypot(*xy[:, 0])), 6) for xy in paths)
    assert seen["printed"] == seen["corrected"]
    assert len(set(seen["printed"])) == 4
    along = [ax for ax in fig.axes if ax.get_xlabel() == "along the yarn (mm)"]
    for ax in along:
        assert lines(ax, linestyle="-")[0][0] == pytest.approx(0.1 * np.arange(9))
        assert len(lines(ax, linestyle="--")) == len(lines(ax, linestyle="-")) == 4


def test_tension_curves_are_those_of_the_file(polyester):
    fig = yarn_tension.fig12_yarn_tension(polyester)
    ax = next(a for a in fig.axes if a.get_ylabel() == "tension (N)")
    for name in ("corrected", "printed"):
        test = polyester.sel(variant=name)
        loading, recovery = lines(ax, color=style.COLOURS[name], marker="None")
        both = np.concatenate([loading, recovery[:, 1:]], axis=1)
        assert both[0] == pytest.approx(100.0 * test["strain"].values)
        assert both[1] == pytest.approx(test["yarn_tension"].values)
        assert loading.shape[1] == int((test["phase"] == "loading").sum())
    left = lines(ax, color=style.COLOURS["corrected"], marker="D")
    assert left[0].ravel() == pytest.approx([1.8748137943815923, 0.0], rel=1e-3)
    (given,) = lines(ax, marker="o")
    assert given == pytest.approx(
        np.array([100.0 * polyester["curve_strain"], polyester["curve_tension"]])
    )
    (broken,) = lines(ax, marker="X")
    assert broken.ravel() == pytest.approx([8.0, 72 * (6.34 * 0.02 + 2.41 * 0.06)])
    (other,) = ax.child_axes
    other._set_lims()
    assert other.get_ylim() == pytest.approx(100.0 / 333.33 * np.array(ax.get_ylim()))


def test_energies_are_those_of_the_file(polyester):
    fig = yarn_tension.fig12_yarn_tension(polyester)
    panels = [ax for ax in fig.axes if ax.get_ylabel() == "energy per length (J/m)"]
    assert [ax.get_title("left") for ax in panels] == [
        "(b) Energy, corrected",
        "(c) Energy, as printed",
    ]
    for ax, name in zip(panels, ("corrected", "printed"), strict=True):
        test = polyester.sel(variant=name)
        top = int((test["phase"] == "loading").sum())
        for term, (_, colour) in yarn_tension._ENERGIES.items():
            values = test[term].values
            drawn = lines(ax, color=colour)
            if not values.max() > 0:
                assert drawn == []
                continue
            both = np.concatenate([drawn[0][1], drawn[1][1][1:]])
            shown = np.isfinite(both)
            assert shown[10:top].all() or term == "plastic_dissipated"
            assert both[shown] == pytest.approx(values[shown])
    assert [len(lines(ax, color=style.BLACK)) for ax in panels] == [2, 0]  # plastic


def test_words_of_the_tension_figure(polyester):
    text = said(yarn_tension.fig12_yarn_tension(polyester))
    assert "rebuilt from the paper's constants, not measured" in text
    assert "= 72 × 6.34 N" in text
    assert "= 72 × 2.41 N" in text
    # Of a curve made of the constants no precision is claimed.
    assert "yield strain = 2 %" in text and "±" not in text and "95 %" not in text
    assert "calibrated law " not in text
    given = polyester.assign_attrs(calibration_source="lab/yarn7.csv")
    given = given.assign(curve_origin=0)
    given["fitted_interval"] = given.fitted_interval.fillna(0.0)
    text = said(yarn_tension.fig12_yarn_tension(given))
    assert "given curve, yarn7.csv" in text
    assert "rebuilt" not in text
    assert "±" in text and "Calibrated constants (95 % interval)" in text


def test_how_much_of_its_law_the_simulated_yarn_carries_is_said():
    """A thick twisted yarn with a section that hardly gives: Hearle's mean cos3 is what is left."""
    acrylic = load_study(CONFIG).yarns["acrylic"].with_value("section_stiffness_MPa", 1e5)
    found = stage.run(acrylic)[0]
    radius = np.linalg.norm(found["fibre_position"].values, axis=1)
    share = 100 * np.mean(np.cos(np.arctan(2 * np.pi * 150 * radius)) ** 3)
    text = said(yarn_tension.fig12_yarn_tension(found)).replace("\n", " ")
    assert f"with a rigid section {share:.0f} % are left" in text
    carries = float(re.search(r"carries (\d+) % of its law", text)[1])
    assert carries == pytest.approx(share, abs=2.0)


def test_misfit_is_that_of_a_known_shift(polyester):
    strain, tension = polyester["curve_strain"].values, polyester["curve_tension"].values
    shifted = polyester.copy()
    exact = np.interp(polyester["strain"].values, strain, tension)
    factor = np.array([[0.05], [0.2]])
    shifted["yarn_tension"] = (("variant", "step"), exact + factor * tension.max())
    text = said(yarn_tension.fig12_yarn_tension(shifted))
    assert "simulated, corrected 5.0 %" in text
    assert "simulated, as printed 20.0 %" in text
    at_top = exact[0].max()
    gain = (at_top + 0.2 * tension.max()) / (at_top + 0.05 * tension.max()) - 1.0
    assert f"printed +{100 * gain:.0f} %" in text


def test_states_beyond_the_break_are_marked(polyester):
    assert "beyond the breaking strain" not in said(yarn_tension.fig12_yarn_tension(polyester))
    broken = polyester.copy(deep=True)
    broken["status"][0, 95:101] = 1
    fig = yarn_tension.fig12_yarn_tension(broken)
    assert said(fig).count("beyond the breaking strain") == 2  # once in either legend
    ax = next(a for a in fig.axes if a.get_ylabel() == "tension (N)")
    (marks,) = lines(ax, marker="x")
    assert marks[0] == pytest.approx(100.0 * broken["strain"].values[0, 95:101])
    assert marks[1] == pytest.approx(broken["yarn_tension"].values[0, 95:101])


def test_yarn_without_curve_or_test(small):
    fig = yarn_tension.fig12_yarn_tension(small)
    assert "tension law" in said(fig)
    assert "Calibrated" not in said(fig)
    assert len([ax for ax in fig.axes if "energy" in ax.get_ylabel()]) == 1
    with pytest.raises(InputError, match=r"small.*tensile_test"):
        yarn_tension.fig12_yarn_tension(small.drop_vars("yarn_tension"))


def test_a_test_without_recovery_says_nothing_of_it(polyester):
    loading = polyester.isel(step=np.flatnonzero(polyester["phase"].values == "loading"))
    assert "recovery" in said(yarn_tension.fig12_yarn_tension(polyester))
    assert "recovery" not in said(yarn_tension.fig12_yarn_tension(loading))


def test_a_yarn_of_one_fibre_draws(tmp_path):
    one = stage.run(load_study(CONFIG / "small").yarns["small"].with_value("fibres", 1))[0]
    assert one.sizes["fibre"] == 1
    for name in FIGURES:
        fig = draw(name, {"yarn": one})
        fig.canvas.draw()
        assert unlabelled(fig) == []


def test_a_yarn_with_a_curve_and_no_law_draws(tmp_path):
    """As the README puts in a yarn: its law is calibrated, none is stated."""
    rows = [f"{e:.4f},{4e3 * e + 5e3 * max(e - 0.05, 0.0):.1f}" for e in np.linspace(0.0, 0.1, 41)]
    curve = "\n".join(["strain,force_cN", *rows, ""])
    (tmp_path / "yarn.csv").write_text(curve)
    (tmp_path / "yarns.yaml").write_text(
        "mine:\n  count_tex: 28\n  fibres: 19\n  scene: pull\n"
        "  tension_curve: {file: yarn.csv, kind: two_slope}\n"
    )
    (tmp_path / "scenes.yaml").write_text("pull: {tensile_test: {steps: 5, max_strain: 0.03}}\n")
    (tmp_path / "fabrics.yaml").write_text("{}\n")
    mine = stage.run(load_study(tmp_path).yarns["mine"])[0]
    for name in FIGURES:
        fig = draw(name, {"yarn": mine})
        assert "mine" in fig._suptitle.get_text()
        assert unlabelled(fig) == []
    assert "Calibrated" in said(fig)

"""Figures of the equilibrium model: what they show is what the result files hold."""

import re
from pathlib import Path

import numpy as np
import pytest
from figure_tools import check_layout, check_same_twice, draw, lines, named, panel

from knitsim.figures import equilibrium_tension, relaxed
from knitsim.figures.solved import condition, looks
from knitsim.stages import equilibrium_rest, loop
from knitsim.stages import equilibrium_tension as stage
from knitsim.stages.laws import laws_of
from knitsim.store.tensile import absolute_error
from knitsim.study.study import load_study

FIGURES = named("relaxed", "equilibrium_tension", "cycles")
SMALL = Path(__file__).parents[1] / "config" / "small"


@pytest.fixture(scope="module")
def datasets():
    fabric = load_study(SMALL).fabrics["small"]
    laws = laws_of(fabric.yarn, None)
    made = {"relaxed": equilibrium_rest.run(fabric, laws)[0], "loop": loop.run(fabric)[0]}
    for direction in ("course", "wale"):
        made[f"equilibrium_{direction}"] = stage.run(fabric, laws, direction)[0]
    return made


@pytest.fixture(scope="module")
def figures(datasets):
    return {name: draw(name, datasets) for name in FIGURES}


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_saved_files_are_the_same_twice(name, datasets, figures, tmp_path):
    check_same_twice([figures[name], draw(name, datasets)], tmp_path)


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_is_cut_or_lies_on_text_and_legends_have_their_marks(name, figures):
    check_layout(figures[name])


def test_axes_name_their_units_and_the_title_its_fabric(figures):
    unit = re.compile(r"\((mm|%|1|N/mm|gf/cm|1/cm|diameters|J)\)$")
    for fig in figures.values():
        assert "small" in fig.get_suptitle()
        for ax in fig.axes:
            assert ax.lines or ax.images or ax.collections, "an empty panel"
            if ax.get_ylabel() == "curvature (1/cm)":  # of the colours
                continue
            assert unit.search(ax.get_xlabel())
            first = ax.get_subplotspec().is_first_col()
            assert unit.search(ax.get_ylabel()) or (not first and not ax.get_ylabel())
        words = [t.get_text() for legend in fig.legends for t in legend.get_texts()]
        assert not any("experiment" in word.lower() for word in words)


def test_constants_are_munden_and_peirce():
    # A fabric by Munden's constants: 5 courses and 3.8 wales in a loop length.
    found = relaxed.constants(10.0, 10.0 / 3.8, 2.0, 0.5)
    assert found["kc"] == pytest.approx(5.0)
    assert found["kw"] == pytest.approx(3.8)
    assert found["ratio"] == pytest.approx(5.0 / 3.8)
    # A loop by Peirce's formula has the length that it gives, his tightest one to his digits.
    w, c, d = 1.4e-3, 1.1e-3, 0.3e-3
    length = 2.0 * c + w + 5.94 * d
    assert relaxed.constants(length, w, c, d)["peirce"] == pytest.approx(1.0)
    tight = relaxed.PEIRCE_TIGHT
    found = relaxed.constants(tight["length"], tight["wale"], tight["course"], 1.0)
    assert found["peirce"] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(("start", "k"), [("(e)", 0), ("(f)", 1)])
def test_density_over_loop_length_is_that_of_the_file(start, k, datasets, figures):
    rest = datasets["relaxed"]
    ax = panel(figures["fig15_relaxed_fabric"], start)
    lengths = rest.compared_loop_length.values
    spacing = rest.compared_spacing.sel(spacing=("course", "wale")[k]).values
    for i, fraction in enumerate(rest["set"].values):
        label = f"equilibrium, {100 * fraction:.0f} % of the curvature set"
        ((x, y),) = lines(ax, label=label)
        assert x == pytest.approx(lengths / float(rest.diameter))
        assert y == pytest.approx(lengths / spacing[i])
    (munden,) = lines(ax, linestyle="--")
    assert munden[1] == pytest.approx((5.0, 3.8)[k])
    ((_, own),) = lines(ax, label="this fabric at rest")
    assert own == pytest.approx(float(rest[("kc", "kw")[k]]))
    ((_, stated),) = lines(ax, label="this fabric as stated")
    assert stated == pytest.approx((3.3 / 0.7, 3.3 / 0.9)[k])


def test_loops_are_named_with_their_spacings(datasets, figures):
    fig = figures["fig15_relaxed_fabric"]
    assert "w = 0.900 mm, c = 0.700 mm" in panel(fig, "(a)").get_title("left")
    rest = datasets["relaxed"]
    said = f"w = {1e3 * float(rest.wale_spacing):.3f} mm"
    assert said in panel(fig, "(b)").get_title("left")
    assert said not in panel(fig, "(a)").get_title("left")


def test_fabrics_without_a_state_at_rest_are_counted(datasets, figures):
    def title(fig):
        return fig.legends[0].get_title().get_text()

    assert "found no state" not in title(figures["fig15_relaxed_fabric"])
    fewer = datasets["relaxed"].copy(deep=True)
    fewer.compared_spacing[1, 3:5] = np.nan
    fig = draw("fig15_relaxed_fabric", datasets | {"relaxed": fewer})
    assert title(fig).startswith("2 of 18 fabrics found no state")


@pytest.mark.parametrize("pitch", [0.0, 0.7])
def test_curvature_of_a_helix(pitch):
    radius, count = 0.4, 160
    angle = 2.0 * np.pi * np.arange(count + 1) / count
    points = np.stack([pitch * angle, radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    found = equilibrium_tension.curvature(points)
    assert found.shape == (count + 1,)
    assert found == pytest.approx(radius / (radius**2 + pitch**2), rel=1e-3)


@pytest.mark.parametrize(("direction", "letters"), [("course", "abcd"), ("wale", "efgh")])
def test_curves_are_those_of_the_file_from_the_state_at_rest(direction, letters, datasets, figures):
    fig, test = figures["fig16_equilibrium_tension"], datasets[f"equilibrium_{direction}"]
    shown = {
        letters[0]: (1e-3 * test.force_per_width, 0.0),
        letters[2]: (100.0 * test.transverse_strain, 0.0),
        letters[3]: (test.min_distance, float(datasets["relaxed"].min_distance)),
    }
    colours = {name: look["color"] for name, look in looks(test).items()}
    for key, (values, start) in shown.items():
        ax = panel(fig, f"({key})")
        for name in ("frictionless", "friction"):
            curve = test.sel(variant=name)
            up = (curve.phase.values == "loading") & np.isfinite(curve.strain.values)
            ((x, y),) = lines(ax, color=colours[name], linestyle="-")
            assert x == pytest.approx(100.0 * curve.strain.values[up])
            assert y == pytest.approx(values.sel(variant=name).values[up])
            # The state at rest alone may be solved more finely than a test.
            assert (x[0], y[0]) == pytest.approx((0.0, start), abs=2e-3)
        (back,) = lines(ax, color=colours["friction"], linestyle="--")
        assert back[0, -1] == pytest.approx(100.0 * float(curve.strain[-1]))


def test_band_is_the_estimated_error_of_the_force(datasets, figures):
    curve = datasets["equilibrium_course"].sel(variant="friction")
    force = curve.force_per_width.values
    error = absolute_error(force, curve.numerical_error.values)
    largest = int(np.argmax(force))
    expected = float(curve.numerical_error[largest]) * force[largest]
    assert error[largest] == pytest.approx(expected)
    # After recovery the force is gone; the error is relative to 1 % of the largest one.
    expected = float(curve.numerical_error[-1]) * 0.01 * force[largest]
    assert abs(force[-1]) < 1e-4 * force[largest]
    assert error[-1] == pytest.approx(expected)
    ax = panel(figures["fig16_equilibrium_tension"], "(a)")
    band = ax.collections[1].get_paths()[0].vertices
    up = np.flatnonzero(curve.phase.values == "loading")
    high = 1e-3 * (force + error)[up]
    assert band[:, 1].max() == pytest.approx(high.max())
    assert band[:, 0].max() == pytest.approx(100.0 * curve.strain.values[up].max())


def test_energies_stack_up_to_the_work_done(datasets, figures):
    fig, at_rest = figures["fig16_equilibrium_tension"], float(datasets["relaxed"].energy.sum())
    for start, name, lost in (("(i)", "frictionless", False), ("(j)", "friction", True)):
        ax = panel(fig, start)
        curve = datasets["equilibrium_course"].sel(variant=name)
        reached = np.isfinite(curve.strain.values)
        assert len(ax.collections) == 3 + 2 * lost
        total = curve.energy.sum("term").values[reached] + curve.dissipated.values[reached]
        top = ax.collections[-1].get_paths()[0].vertices[:, 1].max()
        assert top == pytest.approx(total.max())
        ((path, work),) = lines(ax, color="black", linestyle=":")
        assert work == pytest.approx(at_rest + curve.work.values[reached], rel=1e-5)
        # Out and back the axis goes on.
        turns = np.abs(np.diff([0.0, *100.0 * curve.strain.values[reached]]))
        assert path == pytest.approx(np.cumsum(turns))
    ticks = panel(fig, "(j)")
    places = ticks.get_xticks()
    said = np.array([float(text.get_text()) for text in ticks.get_xticklabels()])
    turn = 100.0 * float(np.nanmax(curve.strain.values))
    assert said == pytest.approx(np.where(places > turn, 2.0 * turn - places, places), abs=1e-6)
    (left,) = (t.get_text() for t in ticks.texts)
    # 100 - RT, by the area between both ways.
    turn = int(np.nanargmax(curve.strain.values))
    both = [
        abs(np.trapezoid(curve.force_per_width.values[part], curve.strain.values[part]))
        for part in (slice(0, turn + 1), slice(turn, None))
    ]
    share = 1.0 - both[1] / both[0]
    shown = float(re.search(r"work lost (\d+) %", left)[1])
    assert shown == pytest.approx(100.0 * share, abs=4.0)  # between so few states
    assert f"strain left {100 * float(curve.strain[-1]):.1f} %" in left


def test_of_more_cycles_the_first_one_is_told(datasets, figures):
    test = datasets["equilibrium_course"]
    once = test.sizes["step"]
    again = test.isel(step=[*range(once), *range(1, once)])
    cycle = np.repeat([1, 2], [once, once - 1])
    again = again.assign_coords(step=np.arange(cycle.size), cycle=("step", cycle))
    again["dissipated"] = again.dissipated * again.cycle
    ax, alone = (
        panel(fig, "(j)")
        for fig in (
            draw("fig16_equilibrium_tension", datasets | {"equilibrium_course": again}),
            figures["fig16_equilibrium_tension"],
        )
    )
    assert [t.get_text() for t in ax.texts] == [t.get_text() for t in alone.texts]
    for one, other in zip(lines(ax), lines(alone), strict=True):
        assert np.array_equal(one, other)


def test_conditions_are_named_in_words(figures):
    said = [t.get_text() for t in figures["fig16_equilibrium_tension"].legends[0].get_texts()]
    assert said[:2] == [
        "equilibrium, frictionless: no friction, width free",
        "equilibrium, friction: with friction, width free",
    ]
    choices = {"friction": False, "lateral": "loaded", "lateral_load": 2.5}
    words = "equilibrium, biaxial: no friction, width under 0.0025 N/mm"
    assert condition("biaxial", choices) == words
    choices = {"friction": True, "spacings": "held", "set": 0.9}
    assert condition("s", choices) == "equilibrium, s: with friction, spacings held, set 0.9"


def test_fabrics_are_named_with_strain_and_force(datasets, figures):
    titles = [ax.get_title() for ax in figures["fig16_equilibrium_tension"].axes if ax.images]
    assert len(titles) == 6
    for k, direction in enumerate(("course", "wale")):
        curve = datasets[f"equilibrium_{direction}"].sel(variant="frictionless")
        for step, title in enumerate(titles[3 * k : 3 * k + 3], start=1):
            strain, force = float(curve.strain[step]), float(curve.force_per_width[step])
            assert title[4:] == f"{direction} {100 * strain:+.0f} %\n{1e-3 * force:.2g} N/mm"


def test_a_test_that_ends_early_says_why_and_one_without_states_is_left_out(datasets):
    ended = datasets["equilibrium_wale"].assign_attrs(stop_reason="friction: no state at 0.02")
    fig = draw("fig16_equilibrium_tension", datasets | {"equilibrium_wale": ended})
    (legend,) = fig.legends
    assert "wale, ended early: friction: no state at 0.02" in legend.get_title().get_text()
    empty = ended.assign_coords(strain=ended.strain * np.nan)
    fig = draw("fig16_equilibrium_tension", datasets | {"equilibrium_wale": empty})
    assert "no state at 0.02" in fig.legends[0].get_title().get_text()
    labels = {ax.get_xlabel() for ax in fig.axes}
    assert "course strain (%)" in labels
    assert "wale strain (%)" not in labels
    both = {"equilibrium_wale": empty, "equilibrium_course": empty}
    assert draw("fig16_equilibrium_tension", datasets | both).axes == []


def test_without_recovery_the_small_loads_are_a_tenth(datasets, figures):
    alone = datasets | {
        name: datasets[name].sel(variant=["frictionless"])
        for name in ("equilibrium_course", "equilibrium_wale")
    }
    fig = draw("fig16_equilibrium_tension", alone)
    largest = 1e-3 * float(alone["equilibrium_course"].force_per_width.max())
    assert panel(fig, "(b)").get_ylim() == pytest.approx((0.0, 0.1 * largest))
    assert not any(ax.get_title("left").startswith("(k)") for ax in fig.axes)
    whole = panel(figures["fig16_equilibrium_tension"], "(b)").get_ylim()[1]
    rough = datasets["equilibrium_course"].sel(variant="friction").force_per_width.max()
    assert whole == pytest.approx(1.15e-3 * float(rough))

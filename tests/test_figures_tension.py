"""Figures of the tensile test: what they show is what the result files hold."""

import json

import numpy as np
import pytest
import yaml
from figure_tools import check_layout, check_same_twice, draw, lines, named, panel

from knitsim.errors import InputError
from knitsim.figures import style
from knitsim.figures.readings import starting_spacings
from knitsim.figures.solved import condition, looks, runs, with_states
from knitsim.figures.stored import law_source
from knitsim.stages import equilibrium_rest, equilibrium_tension, kinematic_tension
from knitsim.stages.laws import calibration_of, laws_of
from knitsim.study.study import load_study

FIGURES = named("tension", "loop_tension")
CONDITIONS = {
    "sliding": {},
    "rough": {"friction": True, "recovery": True},
    "clamped": {"lateral": "held", "max_strain_course": 0.2},
}
VARIANTS = {
    "isometric": {},
    "shrinks": {"contraction": "linear"},
    "other_limit": {"contraction": "linear", "limit": "course_spacing"},
    "fabric": {"strain": "fabric"},
    "law": {"law": "printed"},
    "drag": {"viscous": True},
    "printed": {"positions": "printed", "contraction": "linear", "law": "printed"},
}


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """A small fabric's tests in every reading and condition, by the keywords of the figures."""
    folder = tmp_path_factory.mktemp("config")
    parts = {
        "yarns": {
            "thin": {
                "count_tex": 20, "fibres": 7, "twist_per_m": 300, "breaking_strain": 0.08, "scene": "stretch",
                "tension_law": {
                    "kind": "points", "strain": [0, 0.02, 0.08], "tension_N": [0, 0.6, 3.0]
                },
            }
        },
        "fabrics": {
            "sample": {
                "yarn": "thin", "wale_spacing_mm": 0.9, "course_spacing_mm": 0.7,
                "loop_length_mm": 3.3, "sections_per_loop": 24, "scene": "pull",
            }
        },
        "scenes": {
            "stretch": {"tensile_test": {"steps": 5, "max_strain": 0.03}},
            "pull": {
                "kinematic_tension": {
                    "steps": 8, "max_strain_course": 0.8, "max_strain_wale": 0.4,
                    "variants": VARIANTS,
                },
                "equilibrium_rest": {"loop_length_low": 1, "loop_length_high": 1.02},
                "equilibrium_tension": {
                    "states": 4, "max_strain_course": 0.3, "max_strain_wale": 0.15,
                    "variants": CONDITIONS,
                },
            }
        },
    }  # fmt: skip
    for name, part in parts.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(part, sort_keys=False))
    fabric = load_study(folder).fabrics["sample"]
    laws = laws_of(fabric.yarn, calibration_of(fabric.yarn))
    made = {"relaxed": equilibrium_rest.run(fabric, laws)[0]}
    for direction in ("course", "wale"):
        made[f"tension_{direction}"] = kinematic_tension.run(fabric, laws, direction)[0]
        made[f"equilibrium_{direction}"] = equilibrium_tension.run(fabric, laws, direction)[0]
    return made


@pytest.fixture(scope="module")
def figures(datasets):
    return {stem: draw(stem, datasets) for stem in FIGURES}


def loaded(dataset, variant, name):
    """(strain in percent, values) on loading of one variable."""
    curve = dataset.sel(variant=variant)
    up = curve.phase.values == "loading"
    return 100.0 * curve.strain.values[up], curve[name].values[up], curve.status.values[up]


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_saved_files_are_the_same_twice(name, datasets, figures, tmp_path):
    check_same_twice([figures[name], draw(name, datasets)], tmp_path)


@pytest.mark.parametrize("stem", FIGURES)
def test_nothing_is_cut_or_lies_on_text_and_legends_have_their_marks(stem, figures):
    check_layout(figures[stem])


@pytest.mark.parametrize("stem", FIGURES)
def test_axes_name_their_units_and_the_title_its_fabric(stem, figures):
    fig = figures[stem]
    assert "sample" in fig.get_suptitle()
    grid = [ax for ax in fig.axes if ax.axison]
    assert grid
    for ax in grid:
        assert ax.lines or ax.images, "an empty panel"
        place = ax.get_subplotspec()
        if stem.startswith("fig13"):  # the axes are shared: only the outer ones are labelled
            assert not place.is_last_row() or ax.get_xlabel() == "course direction (mm)"
            assert not place.is_first_col() or ax.get_ylabel() == "wale direction (mm)"
            continue
        assert ax.get_xlabel().endswith(("(mm)", "(%)"))
        units = ("(mm)", "(1)", "(diameters)", "(N/mm)", "(gf/cm)", "(N)")
        assert ax.get_ylabel().endswith(units)


def test_load_and_extension_are_those_of_the_file(datasets, figures):
    """To linear scales, both directions, out and back; KES units first."""
    ax = figures["fig00_load_extension"].axes[0]
    assert ax.get_xscale() == ax.get_yscale() == "linear"
    (side,) = ax.child_axes
    assert side._functions[0](1.0) == pytest.approx(9.80665 / 10.0 * 1e-3)  # N/mm in a gf/cm
    for direction in ("course", "wale"):
        curve = datasets[f"equilibrium_{direction}"].sel(variant="rough")
        reached = np.isfinite(curve.strain.values)
        out, back = lines(ax, color=style.COLOURS[direction], marker="None")
        strain = 100.0 * curve.strain.values[reached]
        force = curve.force_per_width.values[reached] / 9.80665 * 10.0
        assert np.concatenate([out[0], back[0][1:]]) == pytest.approx(strain)
        assert np.concatenate([out[1], back[1][1:]]) == pytest.approx(force)
        said = [text.get_text() for text in ax.texts]
        (text,) = [
            text for text in said if text.startswith(f"{direction}: {strain.max():.0f} % at")
        ]
        assert text.endswith(f", {strain[-1]:.1f} % left")


@pytest.mark.parametrize(
    ("stem", "name", "axis"),
    [("fig06_course_deformation", "tension_course", 0), ("fig08_wale_deformation", "tension_wale", 1)],
)  # fmt: skip
def test_sections_move_as_eqs_4_and_5_say(stem, name, axis, datasets, figures):
    dataset = datasets[name]
    rest = dataset.centreline.sel(variant="isometric").values[0, 0, :, axis]
    centre = 0.5 * 0.9e-3 if axis == 0 else rest.min()
    edge = 0.5 * 0.9e-3 if axis == 0 else np.ptp(rest)
    ax = figures[stem].axes[3]
    drawn = [
        line.get_xydata().T for line in ax.lines if line.get_color() == style.COLOURS["corrected"]
    ]
    ratios = 1.0 + dataset.strain.values.max() * np.array([0.5, 1.0])
    assert len(drawn) == len(ratios)
    offset = np.sort(rest - centre) * 1e3
    for (x, moved), ratio in zip(drawn, ratios, strict=True):
        # The coarse loop misses its lowest point by little, so the abscissa may be shifted.
        assert np.allclose(x - x[0], offset - offset[0], atol=1e-9)
        assert np.allclose(moved, (ratio - 1.0) * offset, atol=2e-3 * edge * 1e3)
    ((x, moved),) = lines(ax, color=style.COLOURS["printed"])
    printed = offset * np.abs(offset) / (edge * 1e3)
    assert np.allclose(moved, printed - offset, atol=2e-3 * edge * 1e3)
    assert np.ptp(moved) > 0.1 * edge * 1e3


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_contraction_is_that_of_the_file_down_to_its_limit(direction, datasets, figures):
    dataset = datasets[f"tension_{direction}"]
    number = {"course": "07", "wale": "09"}[direction]
    ax = figures[f"fig{number}_{direction}_contraction"].axes[1]
    labels = {
        "isometric": "kinematic: isometric, then at the limit", "shrinks": "kinematic: linear, to half",
    }  # fmt: skip
    for variant, label in labels.items():
        strain, across, status = loaded(dataset, variant, "transverse_strain")
        ((x, y),) = lines(ax, label=label)
        valid = status == 0
        assert np.array_equal(x, strain)
        assert np.allclose(y[valid], 1.0 + across[valid], atol=0)
        assert np.isnan(y[~valid]).all()
        assert 1.0 + across.min() == pytest.approx(0.5, abs=1e-12)
    dotted = sorted({line[1][0] for line in lines(ax, color=style.GREY, linestyle=":")})
    if direction == "course":
        points = dataset.centreline.sel(variant="isometric").values[0, 0, :, 1]
        # One course spacing of the loop's height: the coarse points miss the height by little.
        assert dotted == [pytest.approx(1.0 - 0.7e-3 / np.ptp(points), abs=5e-3), 0.5]
    else:
        assert dotted == [0.5]


def test_every_reading_stands_in_the_force_figure(datasets, figures):
    fig = figures["fig14_fabric_tension"]
    yarn, fabric = {"course": "(e)", "wale": "(f)"}, {"course": "(g)", "wale": "(h)"}
    for direction in ("course", "wale"):
        dataset = datasets[f"tension_{direction}"]
        for variant in set(VARIANTS) - {"drag"}:
            if variant not in dataset.variant.values:
                assert (direction, variant) == ("wale", "other_limit")
                continue
            panels = fabric if variant == "fabric" else yarn
            strain, force, status = loaded(dataset, variant, "yarn_tension")
            expected = np.where(status == 0, force, np.nan)
            assert any(
                np.array_equal(line.get_xdata(), strain)
                and np.array_equal(line.get_ydata(), expected, equal_nan=True)
                for line in panel(fig, panels[direction]).lines
            )
    held = float(datasets["tension_course"].sel(variant="drag").friction_force.values[0])
    assert held > 0
    assert f"F = c v adds {held:.3g} N" in fig.legends[0].get_title().get_text()


def test_states_beyond_break_are_marked(datasets, figures):
    curve = datasets["tension_course"].sel(variant="isometric")
    strain, force, status = loaded(datasets["tension_course"], "isometric", "yarn_tension")
    assert 0 < status.sum() < status.size
    first = int(np.argmax(status))
    crosses = [c[:, 0] for c in lines(panel(figures["fig14_fabric_tension"], "(e)"), marker="X")]
    assert any(np.array_equal(cross, [strain[first], force[first]]) for cross in crosses)

    titles = [ax.get_title() for ax in figures["fig13_fabric_under_tension"].axes[:5]]
    shares = [int(np.argmin(np.abs(strain - k / 3 * strain[-1]))) for k in range(4)]
    for title, step in zip(titles, shares, strict=False):
        assert ("beyond break" in title) == bool(status[step])
        assert f"course {strain[step]:+.0f} %" in title
    assert "as printed" in titles[4]
    assert f"closest {float(curve.min_distance[0]):.2f} d" in titles[0]


def test_runs_are_the_states_of_the_file_in_turn(datasets):
    test = datasets["equilibrium_course"]
    for name, phases in (("sliding", ["loading"]), ("rough", ["loading", "recovery"])):
        curve = test.sel(variant=name)
        found = runs(curve)
        assert [phase for phase, _ in found] == phases
        states = np.concatenate([found[0][1], *(part[1:] for _, part in found[1:])])
        assert states.tolist() == np.flatnonzero(np.isfinite(curve.strain.values)).tolist()
        assert [part[0] for _, part in found[1:]] == [part[-1] for _, part in found[:-1]]
    lost = test.sel(variant="rough")
    lost = lost.assign_coords(strain=lost.strain * np.nan)
    assert runs(lost) == []


def test_conditions_that_differ_in_their_reach_only_are_told_apart(datasets):
    test = datasets["equilibrium_course"]
    readings = json.loads(test.attrs["readings"])
    readings["clamped"] = readings["rough"] | {"max_strain_course": 0.2}
    found = looks(test.assign_attrs(readings=json.dumps(readings)))
    assert found["rough"]["color"] == found["clamped"]["color"] != found["sliding"]["color"]
    assert found["rough"]["linewidth"] > found["clamped"]["linewidth"]
    assert len({look["color"] for look in looks(test).values()}) == 3


def test_without_a_state_the_equilibrium_model_is_left_out(datasets):
    empty = {
        name: data.assign_coords(strain=data.strain * np.nan)
        for name, data in datasets.items() if name.startswith("equilibrium")
    }  # fmt: skip
    assert with_states(datasets["equilibrium_course"]).sizes["variant"] == len(CONDITIONS)
    assert with_states(empty["equilibrium_course"]) is None
    assert len(draw("fig13_fabric_under_tension", datasets | empty).axes) == 10


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_equilibrium_starts_from_the_relaxed_spacings(direction, datasets):
    relaxed = datasets["relaxed"]
    known = float(relaxed.wale_spacing), float(relaxed.course_spacing)
    assert starting_spacings(datasets[f"equilibrium_{direction}"], direction) == pytest.approx(
        known, rel=1e-6
    )
    kinematic = datasets[f"tension_{direction}"]
    for k, name in enumerate(("wale_spacing", "course_spacing")):
        assert abs(float(kinematic[name][0, 0]) / known[k] - 1.0) > 0.05  # a different start


@pytest.mark.parametrize(
    ("key", "direction"), [("(a)", "course"), ("(b)", "wale"), ("(c)", "course"), ("(d)", "wale")]
)
def test_both_models_stand_in_the_force_figure(key, direction, datasets, figures):
    ax = panel(figures["fig14_fabric_tension"], key)
    assert ax.get_yscale() == "linear"
    test = datasets[f"equilibrium_{direction}"]
    strain, force, _ = loaded(datasets[f"tension_{direction}"], "shrinks", "force_per_width")
    ((x, _),) = lines(ax, label="kinematic: linear, to half")
    assert np.array_equal(x, strain)
    colours = {name: look["color"] for name, look in looks(test).items()}
    for name, words in (("sliding", "no friction, width free"), ("rough", "with friction, width free"),
                        ("clamped", "no friction, width held")):  # fmt: skip
        label = f"equilibrium, {name}: {words}"
        ((x, y),) = lines(ax, color=colours[name], linestyle="-", label=label)
        strain, force, _ = loaded(test, name, "force_per_width")
        reached = np.isfinite(strain)
        assert reached.sum() >= 3
        assert np.array_equal(x, strain[reached])
        assert y == pytest.approx(1e-3 * force[reached], rel=1e-12)
    rough = test.sel(variant="rough")
    ((x, y),) = lines(ax, color=colours["rough"], linestyle="--")
    back = np.flatnonzero(rough.phase.values == "recovery")
    assert x == pytest.approx(100.0 * rough.strain.values[[back[0] - 1, *back]], rel=1e-12)
    if key in ("(c)", "(d)"):
        ((left, _),) = lines(ax, color=colours["rough"], marker="D")
        assert left == pytest.approx(100.0 * rough.strain.values[back[-1]])
        assert left[0] > 1.0  # friction keeps some of the strain
        (width,) = ax.child_axes
        assert width._functions[0](1.0) == pytest.approx(1000.0 / 9.80665 * 10.0)  # gf/cm in a N/mm
        return
    # The spacing pulled stands above the strain, from the start of the equilibrium model.
    (side,) = ax.child_axes
    curve = test.sel(variant="sliding")
    x = 100.0 * curve.strain.values[1]
    spacing = f"{'wale' if direction == 'course' else 'course'}_spacing"
    assert side._functions[0](x) == pytest.approx(1e3 * float(curve[spacing][1]), rel=1e-6)
    assert side._functions[1](side._functions[0](x)) == pytest.approx(x)
    assert "equilibrium" in side.get_xlabel()


def test_the_gap_between_the_models_is_told_where_both_have_states(datasets, figures):
    strain, high, status = loaded(datasets["tension_course"], "isometric", "force_per_width")
    step = np.flatnonzero(status == 0)[-1]
    test = datasets["equilibrium_course"]
    curve = test.sel(variant="sliding")
    reached = int(np.isfinite(curve.strain.values).sum())
    assert 100.0 * curve.strain.values[reached - 1] < strain[step]

    def said(fig):
        return [t.get_text() for t in fig.axes[0].texts if "times" in t.get_text()]

    assert said(figures["fig14_fabric_tension"]) == []
    # As if it had been pulled so far that the last state but one lies there.
    factor = strain[step] / (100.0 * curve.strain.values[reached - 2])
    longer = test.assign_coords(strain=test.strain * factor)
    low = float(curve.force_per_width[reached - 2])
    fig = draw("fig14_fabric_tension", datasets | {"equilibrium_course": longer})
    assert said(fig) == [f"{high[step] / low:.0f} times"]


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_contraction_of_the_equilibrium_model_is_that_of_the_file(direction, datasets, figures):
    number = {"course": "07", "wale": "09"}[direction]
    ax = figures[f"fig{number}_{direction}_contraction"].axes[1]
    test = datasets[f"equilibrium_{direction}"]
    for name in CONDITIONS:
        strain, across, _ = loaded(test, name, "transverse_strain")
        reached = np.isfinite(strain)
        label = condition(name, json.loads(test.attrs["readings"])[name])
        ((x, scale),) = lines(ax, label=label)
        assert np.array_equal(x, strain[reached])
        assert np.array_equal(scale, 1.0 + across[reached])
        assert (x[0], scale[0]) == pytest.approx((0.0, 1.0), abs=1e-6)


def test_fabric_of_both_models_at_the_same_strains(datasets, figures):
    titles = np.array(
        [ax.get_title() for ax in figures["fig13_fabric_under_tension"].axes]
    ).reshape(4, 5)
    for row, direction in ((1, "course"), (3, "wale")):
        curve = datasets[f"equilibrium_{direction}"].sel(variant="sliding")
        strain = 100.0 * curve.strain.values
        for title in titles[row]:
            assert title == "" or title[4:].startswith(f"equilibrium\n{direction} ")
        assert f"{direction} +0 %\n0 N/mm" in titles[row, 0]
        last = np.nanargmax(strain)
        assert f"{direction} {strain[last]:+.0f} %" in titles[row, 4]
        assert f"{1e-3 * float(curve.force_per_width[last]):.2g} N/mm" in titles[row, 4]
        # The kinematic test goes on to strains that the other one has not reached.
        asked = [float(t.split(f"{direction} ")[1].split(" %")[0]) for t in titles[row - 1, 1:4]]
        for title, value in zip(titles[row, 1:4], asked, strict=True):
            near = np.nanmin(np.abs(strain - value)) < np.diff(strain[:2])[0]
            assert bool(title) == near
        assert any(titles[row, 1:4])
        assert not all(titles[row, 1:4])


def test_only_the_kinematic_model_is_drawn_without_the_other(datasets):
    alone = {name: data for name, data in datasets.items() if name.startswith("tension")}
    assert len(draw("fig13_fabric_under_tension", alone).axes) == 10
    fig = draw("fig14_fabric_tension", alone)
    assert [len(ax.child_axes) for ax in fig.axes[:2]] == [1, 1]
    assert "kinematic" in fig.axes[0].child_axes[0].get_xlabel()
    words = [text.get_text() for text in fig.legends[0].get_texts()]
    assert not any("equilibrium" in text for text in words)


def test_a_curve_is_called_what_it_is(datasets):
    dataset = datasets["tension_course"].copy()
    assert "stated in the configuration" in law_source(dataset)
    for rebuilt, words in ((True, "rebuilt from the paper's constants, not measured"),
                           (False, "calibrated from lab_7.csv")):  # fmt: skip
        configuration = json.loads(dataset.attrs["configuration"])
        curve = {"file": "curves/lab_7.csv", "rebuilt": rebuilt}
        configuration["yarn"]["values"]["tension_curve"] = curve
        dataset.attrs["configuration"] = json.dumps(configuration)
        assert words in law_source(dataset)
        assert "experiment" not in law_source(dataset)


def test_results_without_positions_are_refused(datasets):
    with pytest.raises(InputError, match="centreline"):
        draw(
            "fig06_course_deformation",
            {"tension_course": datasets["tension_course"].drop_vars("centreline")},
        )


def test_without_the_printed_reading_only_the_corrected_one_is_drawn(datasets):
    kept = {name: data.sel(variant=["isometric"]) for name, data in datasets.items()
            if name.startswith("tension")}  # fmt: skip
    fig = draw("fig06_course_deformation", kept)
    assert [ax.axison for ax in fig.axes[:3]] == [True, True, False]
    assert not [line for ax in fig.axes for line in ax.lines
                if line.get_color() == style.COLOURS["printed"]]  # fmt: skip
    assert len(draw("fig14_fabric_tension", kept).axes) == 4

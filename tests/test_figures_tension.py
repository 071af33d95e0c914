"""Figures of the tensile test: what they show is what the result files hold."""

import json

import numpy as np
import pytest
import yaml

from knitsim.configuration.study import load_study
from knitsim.errors import InputError
from knitsim.figures import style, tension
from knitsim.figures.states import law_source
from knitsim.stages import kinematic_tension
from knitsim.stages.laws import calibration_of, laws_of

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
    """A small fabric's tests in every kind of reading, by the keywords of the figures."""
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
                }
            }
        },
    }  # fmt: skip
    for name, part in parts.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(part, sort_keys=False))
    fabric = load_study(folder).fabrics["sample"]
    laws = laws_of(fabric.yarn, calibration_of(fabric.yarn))
    return {
        f"tension_{direction}": kinematic_tension.run(fabric, laws, direction)[0]
        for direction in ("course", "wale")
    }


def draw(stem, datasets, **more):
    function, needed = tension.FIGURES[stem]
    with style.context():
        return function(**{name: datasets[name] for name in needed}, **more)


@pytest.fixture(scope="module")
def figures(datasets):
    return {stem: draw(stem, datasets) for stem in tension.FIGURES}


def lines_of(ax, **wanted):
    """Data (2, n) of the axes' lines with these properties."""
    found = [
        line.get_xydata().T
        for line in ax.lines
        if all(getattr(line, f"get_{name}")() == value for name, value in wanted.items())
    ]
    assert found
    return found


def loaded(dataset, variant, name):
    """(strain in percent, values) on loading of one variable."""
    curve = dataset.sel(variant=variant)
    up = curve.phase.values == "loading"
    return 100.0 * curve.strain.values[up], curve[name].values[up], curve.status.values[up]


QUICK = ("fig07_course_contraction", "fig13_fabric_under_tension")


@pytest.mark.parametrize(
    "stem",
    [stem if stem in QUICK else pytest.param(stem, marks=pytest.mark.slow)
     for stem in tension.FIGURES],
)  # fmt: skip
def test_saved_files_are_the_same_twice(stem, datasets, figures, tmp_path):
    first = style.save(figures[stem], tmp_path / "first")
    second = style.save(draw(stem, datasets), tmp_path / "second")
    for one, other in zip(first, second, strict=True):
        content = one.read_bytes()
        assert content == other.read_bytes()
        assert 5_000 < len(content) < 1_500_000


@pytest.mark.parametrize("stem", tension.FIGURES)
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
        if stem.startswith("fig14") and not place.is_first_col():
            continue  # a row shares its label
        assert ax.get_ylabel().endswith(("(mm)", "(N)", "(1)", "(diameters)"))
    if stem.startswith("fig14"):
        sides = [child for ax in grid for child in ax.child_axes]
        assert "force per width (N/mm)" in [side.get_ylabel() for side in sides]


@pytest.mark.parametrize(
    ("stem", "name", "axis"),
    [("fig06_course_deformation", "tension_course", 0), ("fig08_wale_deformation", "tension_wale", 1)],
)  # fmt: skip
def test_sections_move_as_eqs_4_and_5_say(stem, name, axis, datasets, figures):
    dataset = datasets[name]
    rest = dataset.centreline.sel(variant="isometric").values[0, :, axis]
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
    ((x, moved),) = lines_of(ax, color=style.COLOURS["printed"])
    printed = offset * np.abs(offset) / (edge * 1e3)
    assert np.allclose(moved, printed - offset, atol=2e-3 * edge * 1e3)
    assert np.ptp(moved) > 0.1 * edge * 1e3


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_contraction_is_that_of_the_file_down_to_its_limit(direction, datasets, figures):
    dataset = datasets[f"tension_{direction}"]
    number = {"course": "07", "wale": "09"}[direction]
    ax = figures[f"fig{number}_{direction}_contraction"].axes[1]
    labels = {"isometric": "isometric, then at the limit", "shrinks": "linear, to half"}
    for variant, label in labels.items():
        strain, across, status = loaded(dataset, variant, "transverse_strain")
        ((x, y),) = lines_of(ax, label=label)
        valid = status == 0
        assert np.array_equal(x, strain)
        assert np.allclose(y[valid], 1.0 + across[valid], atol=0)
        assert np.isnan(y[~valid]).all()
        assert 1.0 + across.min() == pytest.approx(0.5, abs=1e-12)
    dotted = sorted({line[1][0] for line in lines_of(ax, color=style.GREY)})
    if direction == "course":
        points = dataset.centreline.sel(variant="isometric").values[0, :, 1]
        # One course spacing of the loop's height: the coarse points miss the height by little.
        assert dotted == [pytest.approx(1.0 - 0.7e-3 / np.ptp(points), abs=5e-3), 0.5]
    else:
        assert dotted == [0.5]


def test_every_reading_stands_in_the_force_figure(datasets, figures):
    axes = np.array(figures["fig14_fabric_tension"].axes).reshape(4, 4)
    panels = {
        "isometric": 0,
        "shrinks": 0,
        "other_limit": 0,
        "fabric": 1,
        "law": 2,
        "printed": 2,
    }
    for row, direction in ((0, "course"), (2, "wale")):
        dataset = datasets[f"tension_{direction}"]
        for variant, column in panels.items():
            if variant not in dataset.variant.values:
                assert (direction, variant) == ("wale", "other_limit")
                continue
            for ax, name in zip(
                axes[row : row + 2, column], ("yarn_tension", "force_per_loop"), strict=True
            ):
                strain, force, status = loaded(dataset, variant, name)
                expected = np.where(status == 0, force, np.nan)
                assert any(
                    np.array_equal(line.get_xdata(), strain)
                    and np.array_equal(line.get_ydata(), expected, equal_nan=True)
                    for line in ax.lines
                )
    friction = lines_of(axes[0, 3], linestyle="-", color=style.BLACK)[0]
    held = datasets["tension_course"].sel(variant="drag").friction_force.values[0]
    assert held > 0
    assert np.allclose(friction[1], held, rtol=1e-9)


def test_force_per_width_axis_agrees_with_the_file(datasets, figures):
    axes = np.array(figures["fig14_fabric_tension"].axes).reshape(4, 4)
    for row, direction in ((1, "course"), (3, "wale")):
        curve = datasets[f"tension_{direction}"].sel(variant="isometric")
        (side,) = axes[row, 0].child_axes
        force = curve.force_per_loop.values
        step = int(np.argmax(force))
        assert force[step] > 0
        per_width = float(curve.force_per_width[step]) * 1e-3  # N/m to N/mm
        assert side._functions[0](force[step]) == pytest.approx(per_width, rel=1e-9)


def test_states_beyond_break_are_marked(datasets, figures):
    curve = datasets["tension_course"].sel(variant="isometric")
    strain, force, status = loaded(datasets["tension_course"], "isometric", "yarn_tension")
    assert 0 < status.sum() < status.size
    first = int(np.argmax(status))
    axes = np.array(figures["fig14_fabric_tension"].axes).reshape(4, 4)
    crosses = [c[:, 0] for c in lines_of(axes[0, 0], marker="X")]
    assert any(np.array_equal(cross, [strain[first], force[first]]) for cross in crosses)

    titles = [ax.get_title() for ax in figures["fig13_fabric_under_tension"].axes[:5]]
    shares = [int(np.argmin(np.abs(strain - k / 3 * strain[-1]))) for k in range(4)]
    for title, step in zip(titles, shares, strict=False):
        assert ("beyond break" in title) == bool(status[step])
        assert f"course {strain[step]:+.0f} %" in title
    assert "as printed" in titles[4]
    assert f"closest {float(curve.min_distance[0]):.2f} d" in titles[0]


def test_equilibrium_is_drawn_beside_the_kinematic_model(datasets):
    other = datasets["tension_course"].sel(variant=["isometric"]).assign_coords(variant=["sliding"])
    other = other.assign(
        force_per_loop=other.force_per_loop + 0.5, transverse_strain=other.transverse_strain * 0.5
    )
    colour = style.COLOURS["equilibrium"]
    fig = draw("fig14_fabric_tension", datasets, equilibrium_course=other)
    ax = np.array(fig.axes).reshape(4, 4)[1, 0]
    up = other.phase.values == "loading"
    drawn = lines_of(ax, color=colour, linestyle="-")
    assert any(
        np.array_equal(line[1], other.force_per_loop.values[0, up])
        for line in drawn
        if line.shape[1] == up.sum()
    )
    fig = draw("fig07_course_contraction", datasets, equilibrium_course=other)
    ((_, scale),) = lines_of(fig.axes[1], color=colour, linestyle="-", label="equilibrium, sliding")
    assert np.array_equal(scale, 1.0 + other.transverse_strain.values[0, up])


def test_a_curve_is_called_what_it_is(datasets):
    dataset = datasets["tension_course"].copy()
    assert "stated in the configuration" in law_source(dataset)
    for name, words in (("cotton_rebuilt", "rebuilt from the paper's constants, not measured"),
                        ("lab_7", "calibrated from lab_7.csv")):  # fmt: skip
        configuration = json.loads(dataset.attrs["configuration"])
        configuration["yarn"]["values"]["tension_curve"] = {"file": f"curves/{name}.csv"}
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
    kept = {name: data.sel(variant=["isometric"]) for name, data in datasets.items()}
    fig = draw("fig06_course_deformation", kept)
    assert [ax.axison for ax in fig.axes[:3]] == [True, True, False]
    assert not [line for ax in fig.axes for line in ax.lines
                if line.get_color() == style.COLOURS["printed"]]  # fmt: skip
    assert len(draw("fig14_fabric_tension", kept).axes) == 4

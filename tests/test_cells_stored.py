"""Cells of several loops come whole into store, ParaView files and figures."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import COTTON
from figure_tools import draw
from test_vtk import read

from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.dataset import bend_dataset, pull_dataset
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.figures import bending, equilibrium_tension, tension
from knitsim.figures.vtk import SIDES
from knitsim.stages import kinematic_tension, vtk_states
from knitsim.stages.laws import laws_of
from knitsim.store.results import labels_of
from knitsim.store.tensile import stack_variants
from knitsim.store.writer import describe, to_json, write
from knitsim.study.study import load_study

STAGE = "equilibrium_tension"
CHOICES = {"friction": False, "lateral": "free", "recovery": False, "to_force": None}
PLACES = [(0, 0), (1, 0), (0, 1), (1, 1)]  # (wale, course) of the loops in the cell


def relaxed_cell(law, wales, courses):
    fabric = Fabric(**COTTON, bending_rigidity=5e-9, law=law)
    return relax(fabric, Resolution(points=32, cell="full", wales=wales, courses=courses))


@pytest.fixture(scope="module")
def pulled(cotton_law):
    relaxed = relaxed_cell(cotton_law, 2, 2)
    return relaxed, tensile(relaxed, "course", [0.05, 0.1])


@pytest.fixture(scope="module")
def file(pulled, tmp_path_factory):
    """A result of 2 by 2 loops, each lifted by a tenth of a diameter more than the one before."""
    _, curve = pulled
    dataset = stack_variants({"free": pull_dataset(curve)})
    lift = 0.1 * COTTON["diameter"] * np.arange(4)
    dataset["centreline"] = dataset.centreline + lift[:, None, None] * (np.arange(3) == 2)
    dataset["diameter"] = COTTON["diameter"]
    dataset.attrs |= {"readings": to_json({"free": CHOICES}), "stop_reason": ""}
    describe(
        dataset, STAGE, labels_of(STAGE, "cotton", "cotton", direction="course"), title="2 by 2 loops",
        summary="Of a test.", references=("munden",), configuration={"name": "cotton"}, assumptions=[],
    )  # fmt: skip
    path = tmp_path_factory.mktemp("cell") / "cell.nc"
    write(dataset, path)
    return path


@pytest.fixture(scope="module")
def datasets_of_small():
    fabric = load_study(Path(__file__).parents[1] / "config" / "small").fabrics["small"]
    laws = laws_of(fabric.yarn, None)
    return {
        f"tension_{way}": kinematic_tension.run(fabric, laws, way)[0] for way in ("course", "wale")
    }


def test_every_loop_of_the_cell_is_stored_where_it_lies(pulled, file):
    relaxed, curve = pulled
    with xr.open_dataset(file) as dataset:
        lines = dataset.centreline
        assert lines.dims == ("variant", "step", "loop", "point", "axis")
        assert lines.sizes["loop"] == 4
        places = zip(dataset.loop_wale.values, dataset.loop_course.values, strict=True)
        assert list(places) == PLACES
        for step in range(2):
            w, c = (float(dataset[f"{of}_spacing"][0, step]) for of in ("wale", "course"))
            one = lines[0, step, 0].values
            for k, (wale, course) in enumerate(PLACES):
                # Loops of a uniform fabric are alike, but for how far this test lifted them.
                there = one + [wale * w, course * c, 0.1 * k * COTTON["diameter"]]
                off = np.abs(lines[0, step, k].values - there).max()
                assert off < 0.01 * COTTON["diameter"]
            # A yarn goes on from loop to loop, here over the step by which they were lifted.
            for k in (0, 2):
                gap = lines[0, step, k + 1, 0].values - lines[0, step, k, -1].values
                assert gap == pytest.approx([0, 0, 0.1 * COTTON["diameter"]], abs=1e-9)
    assert relaxed.centrelines.shape == curve.centrelines.shape[1:]


def test_paraview_files_hold_every_loop(file, tmp_path):
    vtk_states.run([file], tmp_path)
    with xr.open_dataset(file) as dataset:
        lines = dataset.centreline[0].values
    for step in range(2):
        data, fields, _ = read(tmp_path / f"equilibrium_tensile_course_{step:04d}.vtp")
        assert fields["fabric"] == "cotton"
        yarns = np.split(data["Points"], np.flatnonzero(np.diff(data["course"])) + 1)
        assert len(yarns) == 2
        for k, (_, course) in enumerate(PLACES):
            rings = yarns[course][: -2 * SIDES].reshape(-1, SIDES, 3).mean(1)
            # Every stored point but the last, from which the next loop or image goes on.
            known = lines[step, k, :-1]
            away = np.linalg.norm(rings[:, None] - known[None], axis=2).min(0)
            assert np.median(away) < 1e-3 * COTTON["diameter"]


@pytest.mark.parametrize(
    ("module", "name"),
    [(equilibrium_tension, "fig16_equilibrium_tension"), (tension, "fig13_fabric_under_tension")],
)
def test_figures_draw_every_loop(module, name, file, monkeypatch, datasets_of_small):
    drawn = []
    real = module.draw_tubes

    def spy(ax, lines, *args, **options):
        drawn.append(np.concatenate(lines))
        return real(ax, lines, *args, **options)

    monkeypatch.setattr(module, "draw_tubes", spy)
    with xr.open_dataset(file) as opened:
        dataset = opened.load()
    solved = {f"equilibrium_{way}": dataset for way in ("course", "wale")}
    draw(name, solved | datasets_of_small)
    lowest = dataset.centreline[0].min(("point", "axis")).values
    assert lowest.shape == (2, 4)
    least = np.sort(dataset.centreline[0, -1, :, :, 2].min("point").values)
    assert np.diff(least) == pytest.approx(0.1 * COTTON["diameter"], rel=0.02)
    # In a picture of a solved state the feet of the loops lie at four heights.
    for points in drawn:
        heights = points[:, 2]
        found = [np.abs(heights - level).min() < 0.02 * COTTON["diameter"] for level in least]
        if all(found):
            break
    else:
        raise AssertionError("no picture shows all loops")


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_a_bent_cell_lies_on_the_cylinder_as_one_loop_and_its_images(cotton_law, direction):
    wales, courses = (2, 1) if direction == "course" else (1, 2)
    one, two = (
        bend(relaxed_cell(cotton_law, *size), direction, [0.0, 60.0])
        for size in ((1, 1), (wales, courses))
    )
    assert two.yarn_strain == pytest.approx(one.yarn_strain, abs=1e-7)
    assert two.yarn_tension == pytest.approx(one.yarn_tension, abs=1e-6)
    loops = two.centrelines_bent(1)
    assert loops.shape[0] == 2
    [image] = one.centrelines_bent(1, wales=wales - 1, courses=courses - 1)
    assert np.abs(loops[0] - one.centrelines_bent(1)[0]).max() < 0.01 * COTTON["diameter"]
    assert np.abs(loops[1] - image).max() < 0.01 * COTTON["diameter"]
    dataset = bend_dataset(two)
    dataset["diameter"] = COTTON["diameter"]
    assert dataset.centreline.dims == ("step", "loop", "point", "axis")
    # The drawn piece holds the cell: its first course runs through the first loop.
    state = dataset.isel(step=1)
    piece = bending.bent_piece(state, direction)[0]
    assert len(piece) == bending.LOOPS[direction][1]

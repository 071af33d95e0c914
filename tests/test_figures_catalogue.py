"""The catalogue of figures, how they are drawn from files, and how a figure is written."""

import inspect
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from knitsim.figures import catalogue, style
from knitsim.figures.draw import draw
from knitsim.stages import loop
from knitsim.store.writer import write
from knitsim.study.study import load_study

SMALL = Path(__file__).parents[1] / "config" / "small"


@pytest.mark.parametrize("figure", catalogue.FIGURES, ids=lambda figure: figure.name)
def test_each_figure_takes_the_files_that_the_catalogue_names(figure):
    function = getattr(import_module(f"knitsim.figures.{figure.module}"), figure.name)
    parameters = inspect.signature(function).parameters
    assert set(parameters) == {*figure.needs, *figure.takes}
    for name, parameter in parameters.items():
        assert name in catalogue.FILES
        assert (parameter.default is None) == (name in figure.takes)


def test_figures_are_named_once_and_drawn_where_their_files_are():
    names = [figure.name for figure in catalogue.FIGURES]
    assert len(set(names)) == len(names)
    assert names[0] == "fig00_load_extension"
    assert catalogue.drawable("solved", "fabric", {"loop"}) == []
    found = catalogue.drawable("solved", "fabric", {"loop", "relaxed"})
    assert [figure.name for figure in found] == ["fig15_relaxed_fabric"]
    assert catalogue.drawable("solved", "yarn", catalogue.FILES) == []


def test_every_figure_has_a_caption_that_its_files_carry(tmp_path):
    captions = [figure.caption for figure in catalogue.FIGURES]
    assert all(caption.endswith(".") and len(caption) > 60 for caption in captions)
    assert len(set(captions)) == len(captions)
    with style.context():
        fig, _ = style.figure()
    png, svg = style.save(fig, tmp_path / "one", captions[0])
    assert Image.open(png).text["Description"] == captions[0]
    assert captions[0] in svg.read_text()


def test_figures_of_a_group_are_drawn_from_files(tmp_path):
    dataset = loop.run(load_study(SMALL).fabrics["small"])[0]
    file = tmp_path / "loop.nc"
    write(dataset, file)
    figures = catalogue.drawable("paper", "fabric", {"loop"})[:1]
    stems = {figure.name: tmp_path / "drawn" / figure.name for figure in figures}
    draw(figures, {"loop": file}, stems)
    written = sorted(path.name for path in (tmp_path / "drawn").iterdir())
    assert written == ["fig03_loop_anchors.png", "fig03_loop_anchors.svg"]


def test_a_figure_is_laid_out_once_and_can_be_written_again(tmp_path):
    with style.context():
        fig, axes = style.figure(rows=1, columns=2)
        for ax in axes.flat:
            ax.plot([0.0, 1.0], [0.0, 1000.0])
            ax.set_ylabel("a label that needs room (N)")
    before = axes[0, 1].get_position().x0
    first = [path.read_bytes() for path in style.save(fig, tmp_path / "first")]
    places = [ax.get_position(original=True).bounds for ax in fig.axes]
    assert places[1][0] - before > 0.01  # the label has got its room
    assert np.allclose(places, np.round(places, 6), atol=0.0)
    second = [path.read_bytes() for path in style.save(fig, tmp_path / "second")]
    assert first == second

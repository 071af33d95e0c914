"""What the tests of the figures share."""

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.text import Text

from knitsim.figures import catalogue, style
from knitsim.figures.draw import drawn
from knitsim.figures.panels import LETTERS

FIGURES = {figure.name: figure for figure in catalogue.FIGURES}


def named(*modules):
    """Names of the catalogue's figures that these modules of knitsim.figures draw."""
    return [name for name, figure in FIGURES.items() if figure.module in modules]


def repeated(names, quick):
    """Parameters of a test that draws again: all but ``quick`` are for the slow suite."""
    return [name if name == quick else pytest.param(name, marks=pytest.mark.slow) for name in names]


def draw(name, datasets):
    """The figure from what it needs, and from what it takes as far as it is there."""
    return drawn(FIGURES[name], datasets)


def panel(fig, start):
    """The axes whose heading starts like this."""
    return next(ax for ax in fig.axes if ax.get_title("left").startswith(start))


def lines(ax, **wanted):
    """Data (2, n) of the axes' lines with these properties."""
    return [
        line.get_xydata().T
        for line in ax.lines
        if all(getattr(line, f"get_{name}")() == value for name, value in wanted.items())
    ]


def check_same_twice(figures, folder):
    """Two drawings of one figure give the same two files, neither empty nor too large to open."""
    first, second = (style.save(fig, folder / str(k) / "figure") for k, fig in enumerate(figures))
    assert [path.name for path in first] == ["figure.png", "figure.svg"]
    for one, other in zip(first, second, strict=True):
        content = one.read_bytes()
        assert content == other.read_bytes()
        assert 5_000 < len(content) < 1_500_000


def texts(fig):
    """(text, box in pixels) of all that is written on a figure as it would be saved."""
    with style.context():
        style._lay_out(fig)
        fig.canvas.draw()
        return list(_written(fig))


def _written(fig):
    boxes = [*fig.legends, *(ax.get_legend() for ax in fig.axes if ax.get_legend())]
    artists = [*fig.texts, *(text for box in boxes for text in (*box.get_texts(), box.get_title()))]
    second = [child for one in fig.axes for child in one.child_axes]
    for ax in [*fig.axes, *second]:
        artists += [ax.title, ax._left_title, *ax.texts]
        for axis in (ax.xaxis, ax.yaxis) if ax.axison else ():
            if axis.get_visible():
                ticks = axis._update_ticks()
                artists += [axis.label, *(label for t in ticks for label in (t.label1, t.label2))]
    renderer = fig.canvas.get_renderer()
    for artist in artists:
        if artist.get_visible() and artist.get_text().strip():
            yield artist.get_text(), Text.get_window_extent(artist, renderer)


def overlapping(fig, slack=1.0):
    """Pairs of texts that lie on each other by more than ``slack`` pixels."""
    found = texts(fig)
    return [
        (one, other)
        for k, (one, a) in enumerate(found)
        for other, b in found[:k]
        if min(a.x1, b.x1) - max(a.x0, b.x0) > slack and min(a.y1, b.y1) - max(a.y0, b.y0) > slack
    ]


def cut(fig, slack=1.0):
    """Texts that reach over the edge of the figure."""
    width, height = fig.bbox.size
    return [
        text
        for text, box in texts(fig)
        if box.x0 < -slack or box.y0 < -slack or box.x1 > width + slack or box.y1 > height + slack
    ]


def _signs(artist):
    """How a mark looks: its colour, and its line or marker or the fill of an area."""
    if isinstance(artist, Line2D):
        marker = str(artist.get_marker())
        dashes = artist.get_linestyle() if marker in ("None", "none", "") else marker
        return to_hex(artist.get_color()), str(dashes)
    return to_hex(np.atleast_2d(artist.get_facecolor())[0]), "area"


def without_mark(fig):
    """Entries of the legends that stand for nothing in the figure."""
    marks = set()
    for ax in fig.axes:
        for artist in (*ax.lines, *ax.patches, *ax.collections):
            for face in (
                np.atleast_2d(artist.get_facecolor()) if hasattr(artist, "get_facecolor") else ()
            ):
                marks.add((to_hex(face), "area"))
            if isinstance(artist, Line2D):
                marks.add((to_hex(artist.get_color()), str(artist.get_linestyle())))
                marks.add((to_hex(artist.get_color()), str(artist.get_marker())))
    kinds = {kind for _, kind in marks}
    missing = []
    for box in [*fig.legends, *(ax.get_legend() for ax in fig.axes if ax.get_legend())]:
        for handle, text in zip(box.legend_handles, box.get_texts(), strict=True):
            colour, kind = _signs(handle)
            neutral = colour in (
                "#000000",
                to_hex(style.GREY),
            )  # stands for a line or mark of any colour
            if not ((colour, kind) in marks or (neutral and kind in kinds)):
                missing.append(text.get_text())
    return missing


def check_layout(fig):
    """Nothing lies on other text or is cut, each entry of a legend has its mark, panels have letters."""
    assert overlapping(fig) == []
    assert cut(fig) == []
    assert without_mark(fig) == []
    panels = [ax for ax in fig.axes if ax.get_subplotspec() is not None and ax.get_ylabel()]
    for ax in panels:
        assert sum(child._orientation == "x" for child in ax.child_axes) <= 1
    titles = [title for ax in fig.axes for title in (ax.get_title("left"), ax.get_title()) if title]
    letters = sorted(title[:3] for title in titles if title.startswith("("))
    assert letters == [f"({key})" for key in LETTERS[: len(letters)]]
    assert len(panels) == 1 or len(letters) >= 2

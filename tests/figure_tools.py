"""What the tests of the figures share."""

import pytest

from knitsim.figures import catalogue, style
from knitsim.figures.draw import drawn

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

"""What all figures share in their layout: heading, lettered panels, second axes, the legend."""

from textwrap import fill

from matplotlib.lines import Line2D

from knitsim.figures import style
from knitsim.figures.stored import fabric_name
from knitsim.units import from_si, to_si

LETTERS = "abcdefghijklmnopqrstuvwxyz"
PAGE_WIDTH = 132  # characters of small print on the width of a page
PLAIN = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}  # box behind text
RECOVERY = {"recovery": Line2D([], [], color=style.BLACK, linestyle=style.LINES["recovery"])}


def heading(fig, text, number=None, about=None):
    """The line above a figure that says what it shows, broken where it would run over the page.

    number: of the figure; about: a dataset, whose yarn or fabric is named.
    """
    if about is not None:
        text = f"{'Fabric' if about.attrs['fabric'] else 'Yarn'} {fabric_name(about)}: {text}"
    text = text if number is None else f"Fig. {number}  {text}"
    title = fig.suptitle(text, fontsize=9)
    share = 0.98 * fig.bbox.width / title.get_window_extent().width
    if share < 1.0:
        title.set_text(fill(text, int(share * len(text)), break_on_hyphens=False))


def letter(ax, key, text="", y=1.02):
    """A panel's letter and heading, above its left corner."""
    ax.set_title(f"({key}) {text}".rstrip(), loc="left", y=y, pad=0)


def say(ax, text, at, offset=(0, 0), **look):
    """Small text beside a place of the axes; offset in points."""
    look = {"fontsize": 7, "va": "center"} | look
    ax.annotate(text, at, offset, textcoords="offset points", **look)


def arrow(ax, start, end):
    """An arrow with two heads, as of a dimension."""
    look = {"arrowstyle": "<->", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", start, end, arrowprops=look)


def scale_bar(ax, at, length, text):
    """A bar of ``length`` to the right of a place, in units of the axes, and its text behind it."""
    (x, y), end = at, at[0] + length
    ax.plot([x, end], [y, y], color="black", linewidth=2.0, solid_capstyle="butt")
    say(ax, text, (end, y), (5, 0), fontsize=8)


def second_axis(ax, own, other, label, side="right", factor=1.0):
    """An axis at ``side`` that gives the values of the axes, in the unit ``own``, in ``other``.

    factor: SI value shown there over that of the axes.  The label may be empty.
    """
    functions = (
        lambda value: from_si(to_si(value, own) * factor, other),
        lambda value: from_si(to_si(value, other) / factor, own),
    )
    second = ax.secondary_yaxis(side, functions=functions)
    second.set_ylabel(label)
    return second


def labelled(axes):
    """{text: handle} of all that has a label in the axes, each text once."""
    handles = {}
    for ax in axes:
        for handle, text in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(text, handle)
    return handles


def legend(fig, handles, ncols=3, note=""):
    """The legend below all panels; note: lines of text above it."""
    fig.legend(
        handles.values(), handles, loc="outside lower center", ncols=ncols, title=_broken(note) or None,
        title_fontsize=7,
    )  # fmt: skip


def note(fig, text):
    """Text below all panels, broken where it would run over the page."""
    fig.supxlabel(_broken(text), fontsize=7)


def _broken(text):
    """Lines of text broken where they would run over the page."""
    return "\n".join(fill(line, PAGE_WIDTH, break_on_hyphens=False) for line in text.split("\n"))

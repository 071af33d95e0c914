"""What was recognised in a file of a measured test, as text and as a plot.

``python -m knitsim.measured.report FILE`` shows it; options answer what a file leaves open.
"""

import argparse
import sys
from textwrap import wrap

import numpy as np

from knitsim.errors import InputError
from knitsim.measured.drawn import draw
from knitsim.measured.read import SLACKS, ZEROS, read_measured
from knitsim.measured.test import KINDS, SHOWN
from knitsim.units import from_si, label


def report(test):
    """A :class:`~knitsim.measured.test.MeasuredTest` in words: columns, units, rows used and left out."""
    lines = [repr(test).strip("<>").partition(" ")[2], f"file: {test.source}"]
    lines += _part("recognised", test.recognised)
    lines += _part("done to the numbers", test.corrections)
    rows = [f"{_lines(first, last)}: {why}" for first, last, why in test.left_out]
    lines += _part("rows left out", rows or ["none"])
    lines += _part("the file says", test.comments)
    lines += [f"specimen {k}: {one!r}" for k, one in enumerate(test.specimens, start=1)]
    used = [name for name in SHOWN if name in test]
    lines.append(f"{'rows used':12}" + "".join(f"{_heading(name):>24}" for name in used))
    for point in dict.fromkeys((0, len(test) // 2, int(np.argmax(test.x)), len(test) - 1)):
        values = "".join(f"{from_si(test[name][point], SHOWN[name]):24.6g}" for name in used)
        lines.append(f"{point + 1:12d}{values}")
    return "\n".join(lines)


def _lines(first, last):
    return f"line {first}" if first == last else f"lines {first} to {last}"


def _heading(name):
    unit = "%" if SHOWN[name] == "percent" else label(SHOWN[name])
    return f"{name.replace('_', ' ')} ({unit})"


def _part(title, items):
    """A title and its items, indented; nothing without items."""
    found = []
    for item in items:
        found += wrap(item, 96, initial_indent="  - ", subsequent_indent="    ")
    return [f"{title}:", *found] if found else []


def plot(test, path=None):
    """The curve of a measured test, with each specimen and the band, as a matplotlib figure.

    path: where it is written as well, by the end of its name as PNG, SVG or PDF.
    """
    from matplotlib.figure import Figure

    fig = Figure(figsize=(6.3, 4.2), layout="constrained")
    ax = draw(test, fig.add_subplot())
    ax.set_title(repr(test).strip("<>").partition(" ")[2], fontsize=9)
    ax.grid(True, alpha=0.3)
    if path is not None:
        fig.savefig(path, dpi=150)
    return fig


def _pairs(texts):
    """{name: value} of texts ``name=value``."""
    return {name: value for name, _, value in (text.partition("=") for text in texts)} or None


def main(arguments=None):
    """``knitsim read FILE ...``: print the report, write the plot; 0, or 1 for a file that is refused."""
    parser = argparse.ArgumentParser(
        prog="knitsim read", description=main.__doc__.partition(":")[0]
    )
    parser.add_argument("files", nargs="+", help="a file, or one of each specimen")
    parser.add_argument("--kind", choices=tuple(KINDS))
    parser.add_argument("--direction", choices=("course", "wale"), default="")
    parser.add_argument("--column", action="append", default=[], metavar="extension_mm=HEADING")
    parser.add_argument("--unit", action="append", default=[], metavar="force=gf")
    parser.add_argument("--skip", type=int, nargs="*", help="how many first lines, or which lines")
    parser.add_argument("--decimal-sign", choices=("comma", "point"))
    parser.add_argument("--sheet")
    parser.add_argument("--cycle", type=int)
    parser.add_argument("--zero", choices=ZEROS)
    parser.add_argument("--slack", choices=SLACKS)
    parser.add_argument("--state", action="append", default=[], metavar="gauge_length_mm=100")
    parser.add_argument("--plot", metavar="FILE.png")
    parser.add_argument("--csv", metavar="FILE.csv", help="write the curve in knitsim's own form")
    parser.add_argument("--comma", action="store_true", help="that with decimal commas, for Excel")
    given = parser.parse_args(arguments)
    skip = given.skip[0] if given.skip and len(given.skip) == 1 else given.skip or None
    try:
        stated = {name: float(value) for name, value in (_pairs(given.state) or {}).items()}
        test = read_measured(
            given.files, given.kind, given.direction, columns=_pairs(given.column), skip=skip,
            unit=_pairs(given.unit), decimal_sign=given.decimal_sign, sheet=given.sheet,
            cycle=given.cycle, zero=given.zero, slack=given.slack, **stated,
        )  # fmt: skip
    except InputError as error:
        # What is stated in a study is an option here.
        here = " (here: --column, --unit, --skip, --zero, --slack, --state KEY=VALUE)"
        print(f"knitsim: {error}{here if 'state ' in str(error) else ''}", file=sys.stderr)
        return 1
    print(report(test))
    if given.plot:
        plot(test, given.plot)
    if given.csv:
        test.to_csv(given.csv, comma=given.comma)
    return 0


if __name__ == "__main__":
    sys.exit(main())

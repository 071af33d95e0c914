"""Chart of a fabric's KES parameters, one scale a parameter, in the manner of a KES control chart.

Kawabata's chart plots deviations from the mean of a population of fabrics; no such population is
at hand here, so that each parameter has its own plain scale.
"""

import json
from itertools import pairwise

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import ConnectionPatch

from knitsim.figures import style
from knitsim.figures.panels import LETTERS, heading, legend, say
from knitsim.figures.style import COLOURS
from knitsim.units import from_si

# Test, parameter as in the file, and how it is shown; linear scales have ends of their own.
ROWS = (
    ("tensile", "LT 50 gf/cm", "LT", (0.0, 1.0)),
    ("tensile", "WT 50 gf/cm", "WT", None),
    ("tensile", "RT 50 gf/cm", "RT", (0.0, 100.0)),
    ("tensile", "EMT 50 gf/cm", "EMT", None),
    ("bending", "B", "B", None),
    ("bending", "2HB", "2HB", None),
    ("shear", "G", "G", None),
    ("shear", "2HG", "2HG", None),
    ("shear", "2HG5", "2HG5", None),
)
GROUPS = {"tensile": "tension, to 50 gf/cm", "bending": "bending", "shear": "shear"}
MARKS = {"course": ("course", "o"), "wale": ("wale", "s"), "": ("other", "D")}


def _choices(kes, test, direction, variant):
    """What a variant stands for, as its test's configuration says; empty where it has none."""
    tests = json.loads(kes.attrs["configuration"])["tests"]
    found = tests.get("_".join(filter(None, (test, "equilibrium", direction))), {}).get("tests", {})
    for section in found.values():
        if variant in section.get("variants", {}):
            return section["variants"][variant]
    return {}


def chosen(kes):
    """{(test, direction): {variant: {parameter: (value, unit)}}} of the equilibrium model.

    The first variant is the one shown in full: that with the most of the chart's parameters, and
    of several one with friction.  Bending without friction and variants of another set follow.
    """
    names = [name for _, name, _, _ in ROWS]
    columns = ("test", "direction", "variant", "kes_parameter", "kes_value", "kes_units")
    is_solved = kes.model.values == "equilibrium"
    found = {}
    for test, direction, variant, name, value, unit in zip(
        *(kes[column].values[is_solved] for column in columns), strict=True
    ):
        if name in names and np.isfinite(value):
            variants = found.setdefault((str(test), str(direction)), {})
            variants.setdefault(str(variant), {})[str(name)] = (float(value), str(unit))
    shown = {}
    for (test, direction), variants in found.items():
        choices = {name: _choices(kes, test, direction, name) for name in variants}
        own = [name for name in variants if choices[name].get("set") is None] or list(variants)
        best = max(
            own, key=lambda name: (len(variants[name]), choices[name].get("friction", False))
        )
        # B without friction, as Figs 21 and 22 have it; it has no hysteresis.
        smooth = {
            name: {"B": variants[name]["B"]}
            for name in own
            if test == "bending" and "B" in variants[name] and name != best
            and (choices[name].get("friction"), choices[name].get("spacings")) == (False, "free")
        }  # fmt: skip
        sets = {n: values for n, values in variants.items() if choices[n].get("set") is not None}
        shown[test, direction] = {best: variants[best]} | smooth | sets
    return shown


def limits(values):
    """Ends of a logarithmic scale about positive values: steps 1, 2, 5 with room on either side."""
    steps = np.array([m * 10.0**k for k in range(-9, 10) for m in (1, 2, 5)])
    low, high = steps[steps < 0.8 * min(values)][-1], steps[steps > 1.25 * max(values)][0]
    if high / low < 10.0:
        low = steps[steps <= 1.001 * high / 10.0][-1]
    return float(low), float(high)


def fig20_kes_chart(kes, relaxed):
    """Tension, bending and shear parameters of a fabric, course and wale, in KES units."""
    found = chosen(kes)
    fig, axes = style.figure(height_mm=152.0, rows=len(ROWS), columns=1)
    axes = axes[:, 0]
    w, c = (from_si(float(relaxed[f"{name}_spacing"]), "mm") for name in ("wale", "course"))
    heading(fig, f"KES parameters in equilibrium (at rest: w {w:.3f} mm, c {c:.3f} mm)", 20, kes)
    places, handles, tested = {}, {}, {str(test) for test in kes.test.values}
    for ax, (test, parameter, name, ends) in zip(axes, ROWS, strict=True):
        shown = _shown(found, test, parameter)
        unit = next((unit for _, _, _, unit in shown), "")
        _scale(ax, [value for _, _, value, _ in shown], ends)
        ax.set_ylabel(f"{name} ({unit})" if unit else name, rotation=0, ha="right", va="center")
        said = []
        for direction, variant, value, _ in shown:
            colour, mark = MARKS[direction]
            number = list(found[test, direction]).index(variant)
            first, mark = number == 0, [mark, *"^v<>"][min(number, 4)]
            fill = COLOURS[colour] if first else "white"
            if ax.get_xscale() == "log" and value <= 0.0:
                continue
            ax.plot(value, 0.0, mark, color=COLOURS[colour], markerfacecolor=fill, markersize=6,
                    clip_on=False, zorder=5)  # fmt: skip
            text = ", ".join(filter(None, (direction, variant)))
            said_of = GROUPS[test].partition(",")[0] + (f": {text}" if text else "")
            handles.setdefault(said_of, Line2D(
                [], [], color=COLOURS[colour], marker=mark, markerfacecolor=fill, linestyle="none"
            ))  # fmt: skip
            if first:
                said.append(f"{direction} {value:.3g}".strip())
                places.setdefault((test, direction), []).append((ax, value))
        missing = "left out: see tables/kes.csv" if test in tested else "not tested"
        say(ax, "\n".join(said) if shown else missing, (1.02, 0.5), xycoords="axes fraction")
    for (_, direction), points in places.items():
        for (ax, x), (below, y) in pairwise(points):
            fig.add_artist(ConnectionPatch(
                (x, 0.0), (y, 0.0), "data", "data", axesA=ax, axesB=below,
                color=COLOURS[MARKS[direction][0]], linewidth=0.9, alpha=0.7,
            ))  # fmt: skip
    for key, (test, text) in zip(LETTERS, GROUPS.items(), strict=False):
        first = axes[[row[0] for row in ROWS].index(test)]
        first.set_title(f"({key}) {text}", loc="left", pad=5)
    legend(
        fig, handles, ncols=4,
        note="Each parameter has its own scale: Kawabata's chart is scaled by the mean and deviation of a"
        " population\nof fabrics, which is not at hand.  Hollow: without friction, as B in Figs 21 and"
        " 22, or with another set of the yarn.",
    )  # fmt: skip
    return fig


def _shown(found, test, parameter):
    """[(direction, variant, value, unit)] of one parameter."""
    return [
        (direction, variant, *values[parameter])
        for (kind, direction), variants in found.items() if kind == test
        for variant, values in variants.items() if parameter in values
    ]  # fmt: skip


def _scale(ax, values, ends):
    ax.set_ylim(-1.0, 1.0)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.spines["bottom"].set_position(("data", 0.0))
    if ends is not None:
        # LT of a curve that bends over is above 1.
        ax.set_xlim(ends[0], max([ends[1], *(1.05 * value for value in values)]))
        return
    positive = [value for value in values if value > 0.0]
    if not positive:
        ax.set_xticks([])
        return
    low, high = limits(positive)
    ax.set_xscale("log")
    ax.set_xlim(low, high)
    ticks = [m * 10.0**k for k in range(-9, 10) for m in (1, 2, 5)]
    ticks = [tick for tick in ticks if low * 0.999 <= tick <= high * 1.001]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()

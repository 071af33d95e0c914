"""Plots of results in textile units, on linear axes."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from knitsim.equilibrium.result import LOADING
from knitsim.figures.style import COLOURS, LINES
from knitsim.library.curves import Bent, BiaxiallyPulled, Pulled, Sheared, Tested
from knitsim.library.rest import Rest
from knitsim.units import from_si

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from knitsim.library.result import Result

FORCE = "Force per width (gf/cm)"


def draw(result: Result, ax: Axes, **options: Any) -> None:
    """Draw a result on ``ax``."""
    if isinstance(result, Rest):
        _loops(result, ax, **options)
    elif isinstance(result, Pulled):
        strain, force = 100 * result.strain, _gf(result.force_per_width)
        _line(ax, result, strain, force, COLOURS[result.direction], **options)
        _label(ax, f"Strain along the {result.direction} (%)", FORCE)
    elif isinstance(result, Bent):
        moment = np.asarray(from_si(result.moment_per_width, "gf"))
        per_cm = np.asarray(from_si(result.curvature, "per_cm"))
        _line(ax, result, per_cm, moment, COLOURS[result.direction], **options)
        _label(ax, "Curvature (1/cm), face convex positive", "Moment per width (gf cm/cm)")
    elif isinstance(result, Sheared):
        angle = np.degrees(result.angle)
        _line(ax, result, angle, _gf(result.force_per_width), COLOURS["other"], **options)
        _label(ax, "Shear angle (degrees)", FORCE)
    elif isinstance(result, BiaxiallyPulled):
        for name, strain, force in (
            ("course", result.strain, result.force_per_width),
            ("wale", result.wale_strain, result.wale_force_per_width),
        ):
            ax.plot(100 * strain, _gf(force), color=COLOURS[name], **{"label": name, **options})
        _label(ax, "Strain (%)", FORCE)
        ax.legend(frameon=False)


def _gf(force: Any) -> Any:
    return np.asarray(from_si(force, "gf_per_cm"))


def _label(ax: Axes, x: str, y: str) -> None:
    # Two directions on one pair of axes.
    both = ax.get_xlabel().startswith("Strain") and ax.get_xlabel() != x
    ax.set_xlabel("Strain (%)" if both else x)
    ax.set_ylabel(y)
    ax.spines[["top", "right"]].set_visible(False)


def _line(ax: Axes, result: Tested, x: Any, y: Any, colour: str, **options: Any) -> None:
    """Loading in full, recovery dashed, each pass joined to the one before."""
    phase = np.asarray(result.curve.phase)
    ends = [0, *(np.flatnonzero(np.diff(phase)) + 1), len(phase)]
    kinds = {LOADING: "loading"}
    label = options.pop("label", None)
    style = {"color": colour, **options}
    seen: set[str] = set()
    for first, last in itertools.pairwise(ends):
        kind = kinds.get(int(phase[first]), "recovery")
        own = slice(max(first - 1, 0), last)
        whole = f"{result.direction}, {kind}" if result.direction else kind
        name = label if label and not seen else whole if kind not in seen and not label else None
        ax.plot(x[own], y[own], **{"linestyle": LINES[kind], **style, "label": name})
        seen.add(kind)
    if len(seen) > 1 and not label:
        ax.legend(frameon=False)


def _loops(rest: Rest, ax: Axes, loops_wide: int = 5, loops_high: int = 5, **options: Any) -> None:
    """A piece of the fabric as tubes, seen on its technical face."""
    from knitsim.figures.tubes import draw_tubes, fabric_polylines

    piece = fabric_polylines(
        rest.state.centrelines, rest.wale_spacing, rest.course_spacing, loops_wide, loops_high,
        courses=rest.state.model.cell.courses,
    )  # fmt: skip
    draw_tubes(ax, piece.polylines, 0.5 * rest.fabric.yarn["diameter"], piece.colours, **options)

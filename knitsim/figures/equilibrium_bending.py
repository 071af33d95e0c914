"""Figures of the bending test in the equilibrium model: moments, and the bent fabric.

Curvature is positive when the technical face is convex; the moment is that per width of fabric.
"""

import json

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from knitsim.figures import panels, solved, stored, style
from knitsim.figures.bending import bent_piece, draw_pieces, states_of
from knitsim.figures.style import COLOURS, LINES
from knitsim.figures.yarn_to_fabric import straight_rigidity
from knitsim.store.results import DIRECTIONS
from knitsim.units import from_si

MN = "mN"
SLOPE_RANGE, HYSTERESIS_AT = (0.5, 1.5), 1.0  # 1/cm; where KES reads B and 2HB
KES_MOMENT = "gf cm/cm"


def fig18_equilibrium_bending(bent_course, bent_wale, bending_course=None, bending_wale=None):
    """Moment against curvature with its loop, beside the kinematic model, and the spacings."""
    tests = {"course": bent_course, "wale": bent_wale}
    kinematic = {"course": bending_course, "wale": bending_wale}
    both = any(test is not None for test in kinematic.values())
    rows = ["moment", "change from flat", *["beside the kinematic model"] * both, "spacings"]
    fig, axes = style.figure(height_mm=52.0 + 44.0 * len(rows), rows=len(rows), columns=2)
    panels.heading(
        fig, "pure bending in equilibrium, along course (left) and wale", 18, bent_course
    )
    for column, (direction, test) in zip(axes.T, tests.items(), strict=True):
        _moments(column[0], test)
        _changes(column[1], test, direction)
        if both:
            _beside_kinematic(column[2], test, kinematic[direction])
        _spacings(column[-1], test)
    for k, ax in enumerate(axes.flat):
        ax.set_xlabel("curvature (1/cm)")
        ax.axvline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
        panels.letter(ax, panels.LETTERS[k], f"{DIRECTIONS[k % 2]}: {rows[k // 2]}")
    bands, said = solved.error_legend(tests, "moment_per_width")
    handles = panels.labelled(axes.flat) | {
        "back to flat": panels.RECOVERY["recovery"],
        **bands,
        "KES B: slope from 0.5 to 1.5 per cm": Patch(color="#EEEEEE", linewidth=0),
        "KES 2HB: at 1 per cm": Line2D([], [], color=style.GREY, linestyle=":", linewidth=0.8),
    }
    panels.legend(
        fig, handles, ncols=2,
        note="\n".join([
            "Positive curvature: technical face convex.  The moment at zero curvature holds the fabric"
            " flat; without it, it curls.", *said, *solved.ended(tests),
        ]),
    )  # fmt: skip
    return fig


def _shaped(curve):
    """The states of one variant that have a shape."""
    shaped = np.isfinite(curve.centreline.values).all(axis=(1, 2, 3))
    return curve.isel(step=np.flatnonzero(shaped & np.isfinite(curve.curvature.values)))


def _moments(ax, test):
    solved.draw_errors(ax, test, "moment_per_width", MN, "per_cm")
    solved.draw(ax, test, from_si(test.moment_per_width, MN), "per_cm")
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -0.05 * (high - low)), max(high, 0.05 * (high - low)))
    ax.axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
    ax.set_ylabel("moment per width (mN)")
    panels.second_axis(ax, MN, "gf", KES_MOMENT)


def _changes(ax, test, direction):
    """Moments from that of the fabric held flat before bending: the elastic change and the loop."""
    change = from_si(test.moment_per_width - test.moment_per_width.isel(step=0), MN)
    solved.draw_errors(ax, test, "moment_per_width", MN, "per_cm", change=True)
    solved.draw(ax, test, change, "per_cm")
    curvature = test.curvature.values
    span = np.array([np.nanmin(curvature), np.nanmax(curvature)])
    yarn = json.loads(test.attrs["configuration"])["yarn"]["values"]["bending_rigidity"]
    straight = yarn * float(straight_rigidity(test.isel(variant=0, step=0), direction))
    ax.plot(
        from_si(span, "per_cm"),
        from_si(straight * span, MN),
        "k:",
        label="straight yarns: B/c, 2 B/w",
    )
    ax.set_ylim(1.15 * min(0.0, float(change.min())), 1.15 * max(0.0, float(change.max())))
    for side in (-1, 1):
        ax.axvspan(*(side * edge for edge in SLOPE_RANGE), color="#EEEEEE", linewidth=0, zorder=-1)
        ax.axvline(side * HYSTERESIS_AT, color=style.GREY, linewidth=0.8, linestyle=":")
    ax.set_ylabel("change of moment (mN)")
    panels.second_axis(ax, MN, "gf", KES_MOMENT)


def _beside_kinematic(ax, test, kinematic):
    """Both models on one scale; the kinematic moments are those of yarn that only stretches."""
    if kinematic is not None:
        reference = kinematic.isel(variant=0)
        order = np.argsort(reference.curvature.values, kind="stable")
        ax.plot(
            from_si(reference.curvature.values, "per_cm")[order],
            from_si(reference.moment_per_width.values, MN)[order], color=COLOURS["kinematic"],
            label="kinematic model",
        )  # fmt: skip
    first = str(test.variant.values[0])
    solved.draw(ax, test, from_si(test.moment_per_width, MN), "per_cm", variants=[first])
    ax.set_ylabel("moment per width (mN)")
    panels.second_axis(ax, MN, "gf", KES_MOMENT)


def _spacings(ax, test):
    """Spacings of the reference condition, from those of the fabric held flat."""
    curve = test.isel(variant=0)
    x = from_si(curve.curvature.values, "per_cm")
    for name in DIRECTIONS:
        spacing = curve[f"{name}_spacing"].values
        change, label = from_si(spacing / spacing[0] - 1.0, "percent"), f"{name} spacing"
        for phase, states in solved.runs(curve):
            ax.plot(
                x[states], change[states], LINES[phase], color=COLOURS[name],
                label=f"{label}, {curve.variant.item()}",
            )  # fmt: skip
    ax.set_ylabel("change of spacing (%)")
    ax.axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)


def fig19_bent_shapes(bent_course, bent_wale, bending_course=None, bending_wale=None):
    """Fig. 11 from equilibrium, and below it the kinematic bent shape beside that in equilibrium."""
    tests = {"course": bent_course, "wale": bent_wale}
    kinematic = {"course": bending_course, "wale": bending_wale}
    shown = {k: test for k, test in kinematic.items() if test is not None and "centreline" in test}
    fig = style.page(height_mm=95.0 + 42.0 * len(shown))
    side = ", and both models from the side" if shown else ""
    panels.heading(fig, f"bent to both sides in equilibrium{side}", 19, bent_course)
    heights = [1.0, 1.25, *[1.1] * len(shown)]
    rows = list(fig.add_gridspec(len(heights), 1, height_ratios=heights))
    keys = iter(panels.LETTERS)
    for place, (direction, test) in zip(rows[:2], tests.items(), strict=True):
        curve = _shaped(stored.with_centreline(test).isel(variant=0))
        back, face = states_of(curve)[:2], states_of(curve)[2:]
        flat = stored.state_at(curve, "curvature", 0.0)
        states = [curve.isel(step=step) for step in (*back, flat, *face)]
        _row(place, direction, states, [f"along {direction}"] * len(states), keys)
    for place, (direction, test) in zip(rows[2:], shown.items(), strict=False):
        models = {
            "kinematic": _shaped(test.isel(variant=0)),
            "equilibrium": _shaped(tests[direction].isel(variant=0)),
        }
        states = [
            (name, curve.isel(step=int(extreme(curve.curvature.values))))
            for extreme in (np.argmin, np.argmax)
            for name, curve in models.items()
        ]
        names, states = zip(*states, strict=True)
        _row(place, direction, states, names, keys, side=True)
    return fig


def _row(place, direction, states, names, keys, *, side=False):
    """States side by side to one scale; side: a strip as seen along the cylinder's axis."""
    axes = place.subgridspec(1, len(states)).subplots()
    pieces = []
    for state, name in zip(states, names, strict=True):
        size = {"along": 6, "across": 2} if side else {}
        courses, colours, _, ink = bent_piece(state, direction, **size)
        curvature = from_si(float(state.curvature), "per_cm")
        convex = "" if curvature == 0 else f", {'face' if curvature > 0 else 'back'} convex"
        title = f"({next(keys)}) {name}\n{curvature + 0.0:+.3g} per cm{convex}"
        pieces.append((courses, colours, title if curvature else title.replace("+0 ", "0 "), ink))
    view = f"side_{direction}" if side else None
    draw_pieces(axes, pieces, 0.5 * float(states[0].diameter), direction, view)
    for ax in axes:
        ax.title.set_fontsize(6.5)
        if side:
            ax.locator_params(nbins=3)
        if side and ax is not axes[0]:
            ax.set_ylabel("")

"""Figures of the bending test in the equilibrium model: moments, and the bent fabric.

Curvature is positive when the technical face is convex; the moment is that per width of fabric.
"""

import json
from textwrap import fill

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from knitsim.figures import style
from knitsim.figures.bending import bent_piece, draw_pieces, states_of
from knitsim.figures.readings import EQUILIBRIUM_COLOURS, THICK, THIN
from knitsim.figures.states import (
    PER_CM,
    PERCENT,
    fabric_name,
    heading,
    letter,
    readings,
    state_at,
    with_centreline,
)
from knitsim.figures.style import COLOURS, LINES
from knitsim.figures.yarn_to_fabric import straight_rigidity
from knitsim.units import from_si, to_si

DIRECTIONS = ("course", "wale")
MN = "mN"
SLOPE_RANGE, HYSTERESIS_AT = (0.5, 1.5), 1.0  # 1/cm; where KES reads B and 2HB
SET_COLOURS = (style.GREEN, style.PURPLE, style.BLACK)


def fig18_equilibrium_bending(bent_course, bent_wale, bending_course=None, bending_wale=None):
    """Moment against curvature with its loop, beside the kinematic model, and the spacings."""
    tests = {"course": bent_course, "wale": bent_wale}
    kinematic = {"course": bending_course, "wale": bending_wale}
    ended = [f"{direction} curved, ended early: {test.attrs['stop_reason']}"
             for direction, test in tests.items() if test.attrs["stop_reason"]]  # fmt: skip
    both = any(test is not None for test in kinematic.values())
    fig, axes = style.figure(height_mm=150.0, rows=2, columns=4 if both else 3)
    heading(
        fig,
        f"Fig. 18  Fabric {fabric_name(bent_course)} in pure bending, equilibrium model: bent along the"
        " course (above) and the wale",
    )
    if ended:
        fig.supxlabel("\n".join(fill(text, 120) for text in ended), fontsize=7)
    for row, (direction, test), letters in zip(
        axes, tests.items(), ("abcd", "efgh") if both else ("abc", "def"), strict=True
    ):
        _moments(row[0], test)
        _changes(row[1], test, direction)
        titles = ["moment", "change from flat", "spacings"]
        if both:
            titles.insert(2, "beside kinematic")
            _beside_kinematic(row[2], test, kinematic[direction])
        _spacings(row[-1], test)
        for ax, key, title in zip(row, letters, titles, strict=False):
            ax.set_xlabel("curvature (1/cm)")
            ax.locator_params(axis="x", nbins=5)
            ax.axvline(0.0, color=style.GREY, linewidth=0.5, zorder=0)
            letter(ax, f"({key}) {title}")
        row[0].set_ylabel(f"{direction}: moment per width (mN)")
    handles = {
        condition(name, readings(test)[name]): Line2D([], [], **look)
        for test in tests.values() for name, look in looks_of(test).items()
    } | {
        "away from flat": Line2D([], [], color=style.GREY, linestyle=LINES["loading"]),
        "back to flat": Line2D([], [], color=style.GREY, linestyle=LINES["recovery"]),
        "estimated numerical error": Patch(color=style.GREY, alpha=0.35, linewidth=0),
        "straight yarns: B/c, 2 B/w": Line2D([], [], color="black", linestyle=":"),
    } | ({"kinematic model": Line2D([], [], color=COLOURS["kinematic"])} if both else {}) | {
        "KES 2HB: at 1 per cm": Line2D([], [], color=style.GREY, linestyle=":", linewidth=0.5),
        "wale spacing": Line2D([], [], color=COLOURS["wale"]),
        "course spacing": Line2D([], [], color=COLOURS["course"]),
        "KES B: 0.5 to 1.5 per cm": Patch(color="#EEEEEE", linewidth=0),
    }  # fmt: skip
    fig.legend(
        handles.values(), handles, loc="outside lower center", ncols=3,
        title="Positive curvature: technical face convex.  The moment at zero curvature holds the fabric"
        " flat; without it, it curls.", title_fontsize=7,
    )  # fmt: skip
    return fig


def condition(name, choices):
    """A condition of the bending test by its name, and in words."""
    own = "" if choices["set"] is None else f", set {choices['set']:g}"
    return (
        f"{name}: {'with' if choices['friction'] else 'no'} friction, spacings"
        f" {choices['spacings']}{own}"
    )


def looks_of(test):
    """{variant: look}: dark with friction, pale if the spacings are held, others for another set."""
    looks, sets = {}, []
    for name, choices in readings(test).items():
        colour = EQUILIBRIUM_COLOURS[choices["friction"], choices["spacings"] == "free"]
        if choices["set"] is not None:
            if choices["set"] not in sets:
                sets.append(choices["set"])
            colour = SET_COLOURS[sets.index(choices["set"]) % len(SET_COLOURS)]
        again = any(look["color"] == colour for look in looks.values())
        looks[name] = {"color": colour, "linewidth": THIN if again else THICK}
    return looks


def passes_of(curve):
    """[(phase, numbers of states)] of one variant of a bending test, in turn.

    Each begins with the last state of the one before; states that were not reached are left out.
    """
    reached = np.flatnonzero(np.isfinite(curve.moment_per_width.values))
    phase = curve.phase.values[reached]
    side = np.sign(curve.curvature.values[reached])
    # Flat, a state belongs to the pass that leads to it.
    cuts = np.flatnonzero((phase[1:] != phase[:-1]) | (side[1:] * side[:-1] < 0)) + 1
    found = []
    for part in np.split(reached, cuts):
        if part.size:
            before = found[-1][1][-1:] if found else part[:0]
            found.append((str(curve.phase.values[part[-1]]), np.concatenate([before, part])))
    return found


def reached(curve):
    """The states of one variant that have a shape."""
    shaped = np.isfinite(curve.centreline.values).all(axis=(1, 2, 3))
    return curve.isel(step=np.flatnonzero(shaped & np.isfinite(curve.curvature.values)))


def error_of(curve):
    """Estimated error (N) of the moment of one variant, (steps,)."""
    moment = np.abs(curve.moment_per_width.values)
    return curve.numerical_error.values * np.fmax(moment, 0.01 * np.nanmax(moment))


def _variants(test):
    """(curve, look) of the variants that reached any state; the first one lies on top of the others."""
    for k, (name, look) in enumerate(looks_of(test).items()):
        curve = test.sel(variant=name)
        if np.isfinite(curve.moment_per_width.values).any():
            yield curve, look | {"zorder": 2.5 - 0.1 * k}


def _draw(ax, curve, values, **look):
    curvature = from_si(curve.curvature.values, PER_CM)
    for phase, states in passes_of(curve):
        ax.plot(curvature[states], values[states], linestyle=LINES[phase], **look)


def _band(ax, curve, values, error, colour):
    curvature = from_si(curve.curvature.values, PER_CM)
    for _, states in passes_of(curve):
        ax.fill_between(
            curvature[states], (values - error)[states], (values + error)[states], color=colour,
            alpha=0.35, linewidth=0,
        )  # fmt: skip


def _moments(ax, test):
    for curve, look in _variants(test):
        moment, error = from_si(curve.moment_per_width.values, MN), from_si(error_of(curve), MN)
        _band(ax, curve, moment, error, look["color"])
        _draw(ax, curve, moment, **look)
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -0.05 * (high - low)), max(high, 0.05 * (high - low)))
    ax.axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)


def _changes(ax, test, direction):
    """Moments from that of the fabric held flat before bending: the elastic change and the loop."""
    ends = [0.0]
    for curve, look in _variants(test):
        change = from_si(curve.moment_per_width.values - float(curve.moment_per_width[0]), MN)
        error = curve.change_error.values * np.nanmax(np.abs(change))
        _band(ax, curve, change, error, look["color"])
        _draw(ax, curve, change, **look)
        ends += [np.nanmin(change), np.nanmax(change)]
    curvature = test.curvature.values
    span = np.array([np.nanmin(curvature), np.nanmax(curvature)])
    yarn = json.loads(test.attrs["configuration"])["yarn"]["values"]["bending_rigidity"]
    straight = yarn * float(straight_rigidity(test.isel(variant=0, step=0), direction))
    ax.plot(from_si(span, PER_CM), from_si(straight * span, MN), "k:")
    ax.set_ylim(1.15 * min(ends), 1.15 * max(ends))
    for side in (-1, 1):
        ax.axvspan(*(side * edge for edge in SLOPE_RANGE), color="#EEEEEE", linewidth=0, zorder=-1)
        ax.axvline(side * HYSTERESIS_AT, color=style.GREY, linewidth=0.5, linestyle=":")
    axis = ax.secondary_yaxis(
        "right",
        functions=(
            lambda moment: from_si(to_si(moment, MN), "gf"),
            lambda moment: from_si(to_si(moment, "gf"), MN),
        ),
    )
    axis.set_ylabel("(gf cm/cm)", labelpad=1, fontsize=7)
    ax.set_ylabel("change of moment (mN)")


def _beside_kinematic(ax, test, kinematic):
    """Both models on one scale; the kinematic moments are those of yarn that only stretches."""
    if kinematic is not None:
        reference = kinematic.isel(variant=0)
        order = np.argsort(reference.curvature.values, kind="stable")
        ax.plot(
            from_si(reference.curvature.values, PER_CM)[order],
            from_si(reference.moment_per_width.values, MN)[order], color=COLOURS["kinematic"],
        )  # fmt: skip
    for curve, look in list(_variants(test))[:1]:
        _draw(ax, curve, from_si(curve.moment_per_width.values, MN), **look)
    ax.set_ylabel("moment (mN)")


def _spacings(ax, test):
    """Spacings of the reference condition, from those of the fabric held flat."""
    for curve, _ in list(_variants(test))[:1]:
        for name in DIRECTIONS:
            spacing = curve[f"{name}_spacing"].values
            _draw(ax, curve, from_si(spacing / spacing[0] - 1.0, PERCENT), color=COLOURS[name])
    ax.set_ylabel("change of spacing (%)")
    ax.axhline(0.0, color=style.GREY, linewidth=0.5, zorder=0)


def fig19_bent_shapes(bent_course, bent_wale, bending_course=None, bending_wale=None):
    """Fig. 11 from equilibrium, and below it the kinematic bent shape beside that in equilibrium."""
    tests = {"course": bent_course, "wale": bent_wale}
    kinematic = {"course": bending_course, "wale": bending_wale}
    shown = {k: test for k, test in kinematic.items() if test is not None and "centreline" in test}
    fig = style.page(height_mm=95.0 + 42.0 * len(shown))
    heading(
        fig,
        f"Fig. 19  Fabric {fabric_name(bent_course)} in pure bending in equilibrium, as Fig. 11, and"
        " both models from the side",
    )
    heights = [1.0, 1.25, *[1.1] * len(shown)]
    rows = list(fig.add_gridspec(len(heights), 1, height_ratios=heights))
    keys = iter("abcdefghijklmnopqr")
    for place, (direction, test) in zip(rows[:2], tests.items(), strict=True):
        curve = reached(with_centreline(test).isel(variant=0))
        back, face = states_of(curve)[:2], states_of(curve)[2:]
        flat = state_at(curve, "curvature", 0.0)
        states = [curve.isel(step=step) for step in (*back, flat, *face)]
        _row(place, direction, states, [f"along {direction}"] * len(states), keys)
    for place, (direction, test) in zip(rows[2:], shown.items(), strict=False):
        models = {
            "kinematic": reached(test.isel(variant=0)),
            "equilibrium": reached(tests[direction].isel(variant=0)),
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
        curvature = from_si(float(state.curvature), PER_CM)
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

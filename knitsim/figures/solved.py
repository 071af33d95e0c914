"""What the figures of the tests in the equilibrium model share: conditions, passes, errors."""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from knitsim.figures import style
from knitsim.figures.stored import BEYOND_BREAK, readings, with_neighbours
from knitsim.figures.style import COLOURS, LINES
from knitsim.store.tensile import absolute_error
from knitsim.units import from_si

THICK, THIN = 1.4, 0.7
SEEN = 0.01  # of the largest value: a band that is thinner does not show beside its line
# By friction, and whether the width (or, bent, the spacings) is free to follow.
_COLOURS = {
    (False, True): COLOURS["equilibrium"],
    (True, True): style.BLACK,
    (False, False): style.GREY,
    (True, False): style.PURPLE,
}
SET_COLOURS = (style.GREEN, style.PURPLE, style.GREY)  # for another set than the fabric's


def condition(name, choices):
    """A condition of a test by its name, and in words."""
    words = [f"{'with' if choices['friction'] else 'no'} friction"]
    if "lateral" in choices:
        load = choices.get("lateral_load")
        across = (
            f"under {from_si(load, 'N_per_mm'):.3g} N/mm" if choices["lateral"] == "loaded" else ""
        )
        words.append(f"width {across or choices['lateral']}")
        if choices.get("to_force"):
            words.append(f"to {from_si(choices['to_force'], 'gf_per_cm'):.3g} gf/cm")
    else:
        words.append(f"spacings {choices['spacings']}")
    if choices.get("set") is not None:
        words.append(f"set {choices['set']:g}")
    return f"equilibrium, {name}: {', '.join(words)}"


def looks(test):
    """{variant: look}; of those that would look alike all but the first are thin."""
    found, sets = {}, []
    for name, choices in readings(test).items():
        free = choices["lateral" if "lateral" in choices else "spacings"] == "free"
        colour = _COLOURS[choices["friction"], free]
        if choices.get("set") is not None:
            if choices["set"] not in sets:
                sets.append(choices["set"])
            colour = SET_COLOURS[sets.index(choices["set"]) % len(SET_COLOURS)]
        again = any(look["color"] == colour for look in found.values())
        found[name] = {"color": colour, "linewidth": THIN if again else THICK}
    return found


def along_of(test):
    """What a test goes through: ``strain`` or ``curvature``."""
    return "curvature" if "curvature" in test.coords else "strain"


def runs(curve):
    """[(phase, numbers of states)] of one variant: loading and recovery in turn, and to either side.

    Each begins with the last state of the one before; states that were not reached are left out.
    """
    along = along_of(curve)
    load = curve["moment_per_width" if along == "curvature" else "force_per_width"].values
    reached = np.flatnonzero(np.isfinite(curve[along].values) & np.isfinite(load))
    phase, cycle = curve.phase.values[reached], curve.cycle.values[reached]
    changes = (phase[1:] != phase[:-1]) | (cycle[1:] != cycle[:-1])
    if along == "curvature":
        # Flat, a state belongs to the pass that leads to it.
        side = np.sign(curve.curvature.values[reached])
        changes = (phase[1:] != phase[:-1]) | (side[1:] * side[:-1] < 0)
    found = []
    for part in np.split(reached, np.flatnonzero(changes) + 1):
        if part.size:
            before = found[-1][1][-1:] if found else part[:0]
            found.append((str(curve.phase.values[part[-1]]), np.concatenate([before, part])))
    return found


def with_states(test):
    """The test with the variants that reached any state; None without one, or without a test."""
    if test is None:
        return None
    reached = [name for name in readings(test) if runs(test.sel(variant=name))]
    return test.sel(variant=reached) if reached else None


def is_recovered(curve):
    return any(phase == "recovery" for phase, _ in runs(curve))


def draw(ax, test, values, unit, *, variants=None, residual=False):
    """Values (variant, step) of a test against its strain or curvature in ``unit``, out and back.

    Each variant has its own states; those that were not reached hold no numbers, those beyond the
    breaking strain are dotted.  variants: only these; the first one lies on top.  residual: mark the
    strain that is left when the force is gone.
    """
    said, along = readings(test), along_of(test)
    for k, (name, look) in enumerate(looks(test).items()):
        if variants is not None and name not in variants:
            continue
        look = look | {"zorder": 2.5 - 0.1 * k}
        curve, y = test.sel(variant=name), values.sel(variant=name).values
        x, label = from_si(curve[along].values, unit), condition(name, said[name])
        for phase, states in runs(curve):
            shown = y[states]
            beyond = curve.status.values[states] == BEYOND_BREAK
            ax.plot(x[states], np.where(beyond, np.nan, shown), LINES[phase], label=label, **look)
            label = None
            if beyond.any():
                dotted = np.where(with_neighbours(beyond), shown, np.nan)
                ax.plot(x[states], dotted, ":", **look)
            if residual and phase == "recovery":
                ax.plot(
                    x[states[-1]], 0.0, "D", transform=ax.get_xaxis_transform(), markersize=4.5,
                    markerfacecolor="white", clip_on=False, **look | {"zorder": 5},
                )  # fmt: skip


def draw_errors(ax, test, quantity, unit, along_unit, *, change=False):
    """Bands of the estimated numerical error of a force or moment in ``unit``.

    change: of its change from the first state.
    """
    for name, look in looks(test).items():
        curve = test.sel(variant=name)
        values = curve[quantity].values
        if change:
            values = values - values[0]
            error = curve.change_error.values * np.nanmax(np.abs(values))
        else:
            error = absolute_error(values, curve.numerical_error.values)
        low, high = from_si(np.array([values - error, values + error]), unit)
        x = from_si(curve[along_of(test)].values, along_unit)
        for _, states in runs(curve):
            ax.fill_between(
                x[states], low[states], high[states], color=look["color"], alpha=0.35, linewidth=0
            )


def error_legend(tests, quantity):
    """({text: patch}, lines of a note) for the legend of the bands of :func:`draw_errors`.

    tests: {direction: dataset}.  Bands that are too thin to be seen are told in the note instead.
    """
    shares = [
        np.nanmax(absolute_error(values, error), initial=0.0) / np.nanmax(np.abs(values))
        for test in tests.values()
        for values, error in zip(
            *(
                test[name].transpose("variant", "step").values
                for name in (quantity, "numerical_error")
            ),
            strict=True,
        )
    ]
    if max(shares) > SEEN:
        return {"estimated numerical error": Patch(color=style.GREY, alpha=0.35, linewidth=0)}, []
    percent = from_si(max(shares), "percent")
    return {}, [
        f"Estimated numerical error: at most {percent:.1g} % of the largest, thinner than the lines."
    ]


def residual_handle():
    """{text: line} for the legend: what is left after recovery."""
    line = Line2D([], [], color=style.BLACK, marker="D", markerfacecolor="white", linestyle="none")
    return {"strain left when the force is gone": line}


def ended(tests):
    """Lines that say why tests {direction: dataset} ended early; none where none did."""
    return [
        f"{direction}, ended early: {test.attrs['stop_reason']}"
        for direction, test in tests.items()
        if test is not None and test.attrs["stop_reason"]
    ]

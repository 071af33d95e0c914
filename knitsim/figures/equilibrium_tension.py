"""Figure of the tensile test in the equilibrium model: forces, shape, energies and the fabric."""

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import EngFormatter, MaxNLocator

from knitsim.figures import panels, solved, stored, style
from knitsim.figures.readings import OTHER, starting_spacings
from knitsim.figures.tubes import draw_tubes, fabric_polylines
from knitsim.units import from_si

# Stacked from below; the energy that friction took last.
ENERGY_COLOURS = {
    "bend": style.SKY,
    "contact": style.ORANGE,
    "stretch": style.GREEN,
    "held by friction": style.PURPLE,
    "lost to friction": "#C8C8C8",
}
APART = 1.6  # diameters of arc below which two places of one yarn do not touch


def fig16_equilibrium_tension(equilibrium_course, equilibrium_wale):
    """Load and extension with its error, contraction, energies and fabric, in both directions."""
    given = {"course": equilibrium_course, "wale": equilibrium_wale}
    tests = {
        direction: solved.with_states(test)
        for direction, test in given.items() if solved.with_states(test) is not None
    }  # fmt: skip
    fig = style.page(height_mm=242.0)
    panels.heading(fig, "tension in equilibrium, course (above) and wale", 16, equilibrium_course)
    if not tests:
        panels.note(fig, "\n".join(solved.ended(given)))
        return fig
    curves, energies, fabrics = fig.add_gridspec(3, 1, height_ratios=[2.4, 1.0, 0.75])
    grid = curves.subgridspec(len(tests), 4).subplots(squeeze=False)
    for row, (direction, test), letters in zip(grid, tests.items(), ("abcd", "efgh"), strict=False):
        _curves(row, test, direction, letters)
    shown = [(d, test, name) for d, test in tests.items() for name in _told_apart(test)]
    row = energies.subgridspec(1, len(shown)).subplots(squeeze=False)[0]
    seen = set()
    for ax, (direction, test, name), key in zip(row, shown, "ijkl", strict=False):
        curve = test.sel(variant=name)
        seen |= _energies(ax, curve)
        if solved.is_recovered(curve):
            _say_left_over(ax, curve)
        ax.set_xlabel(f"{direction} strain (%)")
        ax.set_ylabel("energy per loop (J)" if ax is row[0] else "")
        panels.letter(ax, key, f"energy, {name}")
    _fabrics(fig, fabrics, tests, panels.LETTERS[8 + len(shown) :])
    handles = panels.labelled(grid[:, 0]) | panels.RECOVERY | solved.residual_handle()
    bands, said = solved.error_legend(tests, "force_per_width")
    handles |= bands | {
        f"energy: {name}": Patch(color=colour)
        for name, colour in ENERGY_COLOURS.items()
        if name in seen
    }
    handles["work done, from the energy at rest"] = Line2D([], [], color="black", linestyle=":")
    panels.legend(fig, handles, ncols=2, note="\n".join([*said, *solved.ended(given)]))
    return fig


def _curves(row, test, direction, letters):
    """Load and extension, whole and small forces; contraction; how close the yarns come."""
    force = from_si(test.force_per_width, "N_per_mm")
    for ax in row[:2]:
        solved.draw_errors(ax, test, "force_per_width", "N_per_mm", "percent")
        solved.draw(ax, test, force, "percent", residual=ax is row[1])
        ax.set_ylim(bottom=0.0)
    row[0].set_ylabel("force per width (N/mm)")
    panels.second_axis(row[1], "N_per_mm", "gf_per_cm", "force per width (gf/cm)")
    _show_small(row[1], test, force)
    solved.draw(row[2], test, from_si(test.transverse_strain, "percent"), "percent")
    row[2].set_ylabel(f"strain along the {OTHER[direction]} (%)")
    solved.draw(row[3], test, test.min_distance, "percent")
    row[3].axhline(1.0, color=style.GREY, linewidth=0.8, linestyle=":")
    row[3].set_ylabel("closest centre lines (diameters)")
    touch = strain_of_touch(stored.with_centreline(test).isel(variant=0))
    titles = ("load", "small loads", "contraction", "closest yarns")
    for ax, key, title in zip(row, letters, titles, strict=True):
        ax.set_xlim(left=0.0)
        ax.set_xlabel(f"{direction} strain (%)")
        ax.locator_params(axis="x", nbins=4)
        panels.letter(ax, key, title)
        if touch is not None and ax in row[:2]:
            x = from_si(touch, "percent")
            ax.axvline(x, color=style.GREY, linewidth=0.8, linestyle=(0, (1, 2)), zorder=0)
            if ax is row[1]:
                # On the side where there is room.
                side, shift = ("left", 3) if x < 0.25 * ax.get_xlim()[1] else ("right", -3)
                at = {"xycoords": ax.get_xaxis_transform(), "ha": side, "va": "top"}
                said = f"legs\ntouch\n{x:.0f} %"
                if x <= ax.get_xlim()[1]:
                    panels.say(ax, said, (x, 0.97), (shift, 0), fontsize=6, **at)


def strain_of_touch(curve):
    """Strain at which, first on loading, the yarn of a course comes to touch itself; None if never.

    From then on a loop can give way only by squeezing its legs.  Read from the stored centre lines,
    between states in proportion.
    """
    diameter, before = float(curve.diameter), None
    for step in solved.runs(curve)[0][1]:
        state = curve.isel(step=step)
        courses = np.split(state.centreline.values, stored.courses_of(state))
        gap = min(_gap(yarn, float(state.wale_spacing), diameter) for yarn in courses) - diameter
        strain = float(state.strain)
        if gap <= 0.0:
            if before is None:
                return None  # it does so at rest
            return before[0] + (strain - before[0]) * before[1] / (before[1] - gap)
        before = strain, gap
    return None


def _gap(loops, wale_spacing, diameter):
    """Smallest distance (m) of two places of one yarn that are apart along it.

    loops: (wales, n, 3) (m), a course of the cell.
    """
    line = loops[:, :-1].reshape(-1, 3)
    n, period = len(line), len(loops) * wale_spacing
    step = np.linalg.norm(np.diff(np.concatenate(loops), axis=0), axis=1).max()
    least = int(np.ceil(APART * diameter / step))
    images = np.concatenate([line + [turn * period, 0.0, 0.0] for turn in (-1, 0, 1)])
    away = np.linalg.norm(line[:, None] - images[None], axis=2)
    between = np.abs(np.arange(n)[:, None] - (np.arange(3 * n) - n)[None])
    return float(away[between >= least].min())


SMALL = 0.2  # of the largest load, where every condition comes to it


def _show_small(ax, test, force):
    """Limit the panel to the strains and loads of the condition that recovers."""
    recovered = [
        name for name in stored.readings(test) if solved.is_recovered(test.sel(variant=name))
    ]
    shown = test.sel(variant=recovered[:1]) if recovered else test
    share, strain = 1.15 if recovered else 0.1, shown.strain
    if len(recovered) == test.sizes["variant"]:  # nothing else to be smaller than
        share, load = SMALL, shown.force_per_width
        strain = strain.where(load <= SMALL * load.max())
    ax.set_ylim(top=share * float(force.sel(variant=shown.variant).max()))
    ax.set_xlim(0.0, 1.1 * from_si(float(strain.max()), "percent"))


def _say_left_over(ax, curve):
    """What the first recovery leaves of the strain, and its cycle takes of the work."""
    (_, up), (_, down) = solved.runs(curve)[:2]
    # 100 - RT: what friction takes, and what it keeps in the loops.
    work = curve.work.values - float(curve.work[0])
    lost = from_si(float(work[down[-1]] / work[up[-1]]), "percent")
    left = from_si(float(curve.strain[down[-1]]), "percent")
    text = f"strain left {left:.1f} %\nwork lost {lost:.0f} %"
    panels.say(ax, text, (0.05, 0.06), xycoords="axes fraction", va="bottom")


def _told_apart(test):
    """The reference condition, and the first one with friction."""
    found = stored.readings(test)
    rough = [name for name, choices in found.items() if choices["friction"]]
    return list(dict.fromkeys([next(iter(found)), *rough[:1]]))


def _energies(ax, curve):
    """Energies of a loop stacked over the first loading and recovery; the work as a line.

    The names of those that are large enough to be seen.
    """
    found = solved.runs(curve)[:2]
    states = np.concatenate([found[0][1], *(part[1:] for _, part in found[1:])])
    strain = from_si(curve.strain.values[states], "percent")
    path = strain[0] + np.append(0.0, np.cumsum(np.abs(np.diff(strain))))
    terms = ("bend", "contact", "stretch", "friction")
    *own, held = curve.energy.sel(term=list(terms)).values[states].T
    parts = dict(zip(terms[:3], own, strict=True))
    lost = curve.dissipated.values[states]
    if lost.any():
        parts |= {"held by friction": held, "lost to friction": lost}
    total, work = np.sum(list(parts.values()), axis=0), curve.work.values[states]
    work = total[0] - work[0] + work
    ax.stackplot(
        path, *parts.values(), linewidth=0, colors=[ENERGY_COLOURS[name] for name in parts]
    )
    ax.plot(path, work, ":", color="black")
    ax.set_xlim(0.0, path[-1])
    ax.set_ylim(0.0, 1.08 * max(work.max(), total.max()))
    ax.yaxis.set_major_formatter(EngFormatter(sep=""))  # 50µ
    if len(found) > 1:  # out and back: the axis goes on, its numbers turn round
        turn = path[found[0][1].size - 1]
        ax.axvline(turn, color=style.GREY, linewidth=0.6)
        ticks = MaxNLocator(3).tick_values(0.0, turn)
        ticks = ticks[(ticks >= 0) & (ticks <= turn)]
        back = 2.0 * turn - ticks[::-1]
        back = back[(back > turn) & (back <= path[-1])]
        ax.set_xticks([*ticks, *back], [f"{x:g}" for x in (*ticks, *(2.0 * turn - back))])
    return {name for name, part in parts.items() if part.max() > solved.SEEN * total.max()}


def curvature(points):
    """Curvature (1/m) of one loop's centre line (n + 1, 3) (m) at its points, (n + 1,).

    That of the circle through each point and its neighbours; the last point is the first one of
    the next loop.
    """
    steps = np.diff(points, axis=0)
    before, after = np.roll(steps, 1, axis=0), steps
    doubled = np.linalg.norm(np.cross(before, after), axis=1)
    sides = [np.linalg.norm(side, axis=1) for side in (before, after, before + after)]
    found = 2.0 * doubled / np.prod(sides, axis=0)
    return np.append(found, found[0])


def _fabrics(fig, place, tests, letters):
    """The reference fabric at thirds of its largest strain, its yarn coloured by curvature."""
    drawn = []
    for direction, test in tests.items():
        curve = stored.with_centreline(test).isel(variant=0)
        states = solved.runs(curve)[0][1]
        for share in (1, 2, 3):
            asked = curve.strain.values[states[-1]] * share / 3
            step = states[np.argmin(np.abs(curve.strain.values[states] - asked))]
            drawn.append((direction, stored.thinned(curve.isel(step=step))))
    bent = [np.array([curvature(loop) for loop in state.centreline.values]) for _, state in drawn]
    scale = Normalize(0.0, from_si(max(values.max() for values in bent), "per_cm"))
    count = len(drawn)
    *axes, bar = place.subgridspec(1, count + 1, width_ratios=[1.0] * count + [0.08]).subplots()
    direction, test = next(iter(tests.items()))
    reach = np.array(starting_spacings(test, direction)) * [1.5, 2.0]
    window = (-reach[0], reach[0], -reach[1], reach[1])
    tick = float(f"{0.8 * from_si(reach[0], 'mm'):.1g}")
    colours = colormaps[style.TENSION_MAP]
    for ax, (direction, state), values, key in zip(axes, drawn, bent, letters, strict=False):
        spacings = np.array([float(state.wale_spacing), float(state.course_spacing)])
        yarns = fabric_polylines(
            state.centreline.values, *spacings, *(2 * np.ceil(reach / spacings).astype(int) + 3),
            courses=stored.courses_of(state), centred=True,
            colours=colours(scale(from_si(values, "per_cm")))[..., :3],
        )  # fmt: skip
        draw_tubes(ax, yarns.polylines, 0.5 * float(state.diameter), yarns.colours, window=window)
        force = from_si(float(state.force_per_width), "N_per_mm")
        broken = "\nbeyond break" if stored.is_beyond_break(state) else ""
        ax.set_title(
            f"({key}) {direction} {from_si(float(state.strain), 'percent'):+.0f} %\n{force:.2g} N/mm"
            f"{broken}", fontsize=7,
        )  # fmt: skip
        ax.set_xlabel("course (mm)")
        ax.set_ylabel("wale (mm)")
        ax.locator_params(nbins=3)
        ax.set_xticks([-tick, tick])
        if ax is not axes[0]:
            ax.yaxis.set_visible(False)
    fig.colorbar(ScalarMappable(scale, colours), cax=bar, label="curvature (1/cm)")

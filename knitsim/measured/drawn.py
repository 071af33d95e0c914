"""The curve of a measured test drawn, in the units of the textile trade."""

import numpy as np

from knitsim.measured.test import KINDS, RECOVERY, SHOWN
from knitsim.units import from_si, label

# As the results of the model are drawn, so that both fit into one picture.
PLOTTED = SHOWN | {"force_per_width": "gf_per_cm", "moment_per_width": "gf"}


def axes_for(ax):
    """``ax``, or axes of a new figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.figure(layout="constrained").add_subplot()


def draw(test, ax=None, **options):
    """Draw the curve with each specimen, other cycles and the band; the axes.  options: of its line."""
    ax = axes_for(ax)
    x, y = KINDS[test.kind]

    def line(one, **look):
        return ax.plot(from_si(one.x, PLOTTED[x]), from_si(one.y, PLOTTED[y]), **look)[0]

    grey = {"color": "0.6", "linewidth": 0.8}
    for k, one in enumerate(test.specimens):
        line(one, **grey, label="specimens" if k == 0 else None)
    for k, one in enumerate(one for one in test.cycles if one.cycle != test.cycle):
        line(one, **grey, label="other cycles" if k == 0 else None)
    if test.band is not None:
        low, high = (from_si(end, PLOTTED[x]) for end in test.band)
        own = test.loading
        ax.fill_betweenx(
            from_si(test.y, PLOTTED[y])[own], low[own], high[own], alpha=0.2, label="band"
        )
    look = {"color": "black", "linewidth": 1.2, "marker": "." if len(test) <= 200 else ""}
    way = np.flatnonzero(test.loading | (test.kind == "bending"))
    line(test.kept(way), **look | {"label": "mean" if test.specimens else "measured"} | options)
    back = test.phase == RECOVERY
    if back.any() and test.kind != "bending":
        # From the last point of loading on.
        back[way[-1]] = True
        told = "recovery" if "label" not in options else None
        line(test.kept(back), **look | {"linestyle": "--"} | options | {"label": told})
    ax.set_xlabel(_heading(x, test.direction))
    ax.set_ylabel(_heading(y))
    ax.legend(frameon=False)
    return ax


def _heading(quantity, direction=""):
    if quantity == "curvature":
        return "Curvature (1/cm), face convex positive"
    unit = {"percent": "%", "gf": "gf cm/cm"}.get(PLOTTED[quantity]) or label(PLOTTED[quantity])
    along = f" along the {direction}" if quantity == "strain" and direction else ""
    return f"{quantity.replace('_', ' ').capitalize()}{along} ({unit})"

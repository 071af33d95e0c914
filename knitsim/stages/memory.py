"""What friction remembers, in the stages: histories, programmes of loads, what comes out per cycle."""

import numpy as np

from knitsim.equilibrium.programme import (
    RELEASED,
    Force,
    Handled,
    Strain,
    conditioned,
    growth,
    handled,
    per_cycle,
    returned,
    shaken,
)
from knitsim.store.writer import to_json


def turns_of(stated):
    """Turning points of :mod:`knitsim.equilibrium.programme` from those of a study."""
    return [Strain(one["strain"]) if "strain" in one else Force(one["force"]) for one in stated]


def history_of(fabric):
    """The history (tuple of Handled) that a FabricInput states."""
    stated = fabric["history"]
    if stated == "as_knitted":
        return ()
    if stated == "relaxed_by_shaking":
        return shaken()
    steps = []
    for step in stated:
        turns = turns_of([step["turn"]] * step["times"])
        between = [one for turn in turns for one in (turn, RELEASED)]
        steps.append(Handled(step["direction"], tuple(between[:-1])))
    return tuple(steps)


def with_history(fabric, relaxed):
    """A relaxed state after the history that its FabricInput states; as it is without friction."""
    history = history_of(fabric) if relaxed.model.fabric.friction else ()
    return handled(relaxed, history)


def history_json(fabric):
    """What was done before the tests with friction, for the attribute ``fabric_history`` of a result."""
    return to_json(fabric["history"])


def cycles_dataset(curve, cycles):
    """What each cycle of a Curve gives; cycles: rows, more than it has where other curves have more."""
    import xarray as xr  # late: it takes long to load, and a curve on the screen needs none

    found = per_cycle(curve)
    rows = np.full((cycles, 3), np.nan)
    rows[: len(found)] = found
    closes = conditioned(curve)
    names = ("cycle_peak_force_per_width", "cycle_residual_strain", "cycle_dissipated")
    data = {name: ("round", column) for name, column in zip(names, rows.T, strict=True)}
    data["cycles_to_close"] = np.nan if closes is None else float(closes)
    data["growth"] = growth(curve)
    data["return_point_change"] = returned(curve)
    return xr.Dataset(data, {"round": np.arange(1, cycles + 1)})

"""The effect of each assumption on the results, by running again with its other values."""

import numpy as np

from knitsim.errors import ComputationError, InputError


def alternatives(resolved, stages):
    """(row, value) for each other value of each assumption that changes what ``stages`` take.

    resolved: YarnInput or FabricInput.  A range gives its two ends, choices all but the one taken.
    """
    for row in resolved.assumptions():
        if not row.path or not stages.intersection(row.stages):
            continue
        values = [row.low, row.high] if row.low is not None else row.choices
        yield from ((row, value) for value in values if _matters(resolved, row, value, stages))


def _matters(resolved, row, value, stages):
    """Whether a result of ``stages`` may change: of a modulus from which nothing follows none does."""
    if value == row.value:
        return False
    try:
        other = resolved.with_value(row.path, value)
    except InputError:
        return True  # and is told as refused
    return other.values_of(stages) != resolved.values_of(stages)


def effect_dataset(resolved, stages, headlines):
    """Dataset of the headline results and their relative change for every alternative.

    headlines: a function of the resolved input that returns {name: (value, units)}.  Where an
    alternative is refused or cannot be computed the effect is not a number and ``refused`` says why.
    """
    import xarray as xr  # late: it takes long to load, and a curve on the screen needs none

    stated = headlines(resolved)
    base = np.array([value for value, _ in stated.values()], dtype=float)
    labels, ranges, effects, refused = [], [], [], []
    for row, value in alternatives(resolved, stages):
        labels.append(
            f"{row.path}={value:g}" if isinstance(value, float) else f"{row.path}={value}"
        )
        ranges.append((row.key, f"{row.value}", f"{value}"))
        try:
            found = headlines(resolved.with_value(row.path, value))
        except (InputError, ComputationError) as error:
            effects.append(np.full(base.size, np.nan))
            refused.append(str(error))
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            effects.append(
                (np.array([v for v, _ in found.values()], dtype=float) - base)
                / np.where(base == 0.0, np.nan, abs(base))
            )
        refused.append("")
    shape = (len(labels), base.size)
    return xr.Dataset(
        {
            "headline": ("quantity", base),
            "assumption_effect": (("alternative", "quantity"), np.reshape(effects, shape)),
        },
        {
            "quantity": list(stated),
            "quantity_units": ("quantity", [units for _, units in stated.values()]),
            "alternative": np.array(labels, dtype=object),
            "refused": ("alternative", np.array(refused, dtype=object)),
        },
    )

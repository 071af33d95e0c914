"""A tensile test as it is stored: from the state at rest on, and back to it where it comes back."""

import numpy as np

from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.result import LOADING, RECOVERY

_ROWS = (
    "strain", "wale_strain", "phase", "cycle", "segment", "force_per_loop", "force_per_width", "forces",
    "energy", "work", "dissipated", "min_distance", "residual", "iterations", "increments", "status", "y",
    "numerical_error",
)  # fmt: skip


def pulled(relaxed, direction, strains, *, recovery=False, cycles=1, lateral="free", **conditions):
    """The Curve of :func:`knitsim.equilibrium.pull.tensile` from rest on.

    Without friction the way back is the way there and is read backwards, unless the fabric snapped on
    the way.  Under a load across the pull (lateral a number) the fabric at its relaxed spacing carries
    a force: the test does not start at rest, and its way back is solved.
    """
    conditions |= {"lateral": lateral}
    at_rest = lateral in ("free", "held")
    if recovery and at_rest and not relaxed.model.fabric.friction:
        curve = tensile(relaxed, direction, strains, **conditions)
        if not curve.dissipated.any():
            return from_rest(there_and_back(curve, cycles))
    curve = tensile(relaxed, direction, strains, recovery=recovery, cycles=cycles, **conditions)
    return from_rest(curve) if at_rest else curve


def from_rest(curve):
    """The Curve with the relaxed state as its first: strain, force, work and their error are zero."""
    rows = {}
    for name, values, rest in _with_rest(curve):
        rows[name] = np.concatenate([rest, values]).astype(values.dtype)
    return curve.replaced(**rows)


def there_and_back(curve, cycles=1):
    """A frictionless Curve on loading, and back to rest by the same states, ``cycles`` times.

    What the solver gives for recovery=True, to its tolerance; the way back took no iterations.  A curve
    that stopped early does not go back.
    """
    if curve.stop_reason:
        return curve
    n = curve.steps
    # The state before the first is the relaxed one, number n.
    order = np.concatenate([np.arange(n), np.arange(n - 2, -1, -1), [n]])
    rows = {}
    for name, values, rest in _with_rest(curve):
        whole = np.concatenate([values, rest]).astype(values.dtype)[order]
        if name in ("iterations", "increments"):
            whole[n:] = 0
        rows[name] = np.concatenate([whole] * cycles)
    phase = np.where(np.arange(len(order)) < n, LOADING, RECOVERY)
    rows["phase"] = np.tile(phase, cycles).astype(curve.phase.dtype)
    ways = 2 * np.arange(cycles)[:, None] + (phase == RECOVERY)
    rows["segment"] = ways.ravel().astype(curve.segment.dtype)
    rows["cycle"] = np.repeat(np.arange(1, cycles + 1), len(order)).astype(curve.cycle.dtype)
    return curve.replaced(**rows)


def _with_rest(curve):
    """(name, values (steps, ...), the relaxed state's row (1, ...)) of all that a Curve holds of states.

    Only what is not zero at rest is named.
    """
    known = {"cycle": 1} | {
        name: getattr(curve.start, name)
        for name in ("energy", "min_distance", "residual", "iterations", "y")
    }
    for name in _ROWS:
        values = np.asarray(getattr(curve, name))
        yield name, values, np.broadcast_to(np.asarray(known.get(name, 0)), values.shape[1:])[None]

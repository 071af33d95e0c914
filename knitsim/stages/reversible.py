"""The way back of a test without friction: the way there, read backwards."""

import numpy as np

from knitsim.equilibrium.result import LOADING, RECOVERY

_ROWS = (
    "strain", "wale_strain", "force_per_loop", "force_per_width", "forces", "energy", "work",
    "dissipated", "min_distance", "residual", "iterations", "status", "y", "numerical_error",
)  # fmt: skip


def there_and_back(curve, relaxed, cycles=1):
    """A frictionless Curve on loading, and back to rest by the same states, ``cycles`` times.

    relaxed: where it starts and ends.  What the solver gives for recovery=True, to its tolerance; the
    way back took no iterations.  A curve that stopped early does not go back.
    """
    if curve.stop_reason:
        return curve
    n = curve.steps
    # The state before the first is the relaxed one, number n; only what is not zero there is named.
    rest = {
        "energy": relaxed.energy, "min_distance": relaxed.min_distance,
        "residual": relaxed.residual, "y": relaxed.y,
    }  # fmt: skip
    order = np.concatenate([np.arange(n), np.arange(n - 2, -1, -1), [n]])
    phase = np.where(np.arange(len(order)) < n, LOADING, RECOVERY)
    rows = {}
    for name in _ROWS:
        values = np.asarray(getattr(curve, name))
        end = np.broadcast_to(np.asarray(rest.get(name, 0)), values.shape[1:])[None]
        whole = np.concatenate([values, end]).astype(values.dtype)[order]
        if name == "iterations":
            whole[n:] = 0
        rows[name] = np.concatenate([whole] * cycles)
    rows["phase"] = np.tile(phase, cycles).astype(curve.phase.dtype)
    rows["cycle"] = np.repeat(np.arange(1, cycles + 1), len(order)).astype(curve.cycle.dtype)
    return curve.replaced(**rows)

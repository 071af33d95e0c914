"""What would have room where a yarn has none in its loop: changes that were computed to work."""

import math

from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError
from knitsim.units import from_si

STEP, STEPS = 1.06, 20  # of a value from trial to trial, and trials
ROOM = ("diameter", "loop_length")  # quantities about which the solver refuses for want of room


def remedies(fabric, solver_of):
    """Sentence about a FabricInput that has no room at rest: which loop length, which diameter have it.

    solver_of: function of a FabricInput that gives the solver's fabric.  Each value named was relaxed.
    """
    found = []
    for path, key, quantity, sign in (
        ("loop_length_mm", "loop_length_mm", "loop_length", 1),
        ("yarn.diameter_mm", "diameter_mm", "diameter", -1),
    ):
        start = from_si(fabric[quantity] if sign > 0 else fabric.yarn[quantity], "mm")
        for k in range(1, STEPS + 1):
            value = _rounded(start * STEP ** (sign * k), sign)
            try:
                relax(solver_of(fabric.with_value(path, value)), Resolution())
            except (InputError, ComputationError):
                continue
            found.append(f"{key} {value:g}")
            break
    if not found:
        return f"no loop length up to {STEP**STEPS:.2g} times this, and no thinner yarn, was found to work"
    return f"computed to work: {', or '.join(found)}"


def _rounded(value, sign):
    """Three significant digits, upwards or downwards."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{(math.ceil if sign > 0 else math.floor)(value / unit) * unit:.3g}")

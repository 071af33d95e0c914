"""The two ways in which knitsim says no."""

import math


class InputError(ValueError):
    """Input that cannot be used; raised before any computing.

    The message is one line that names where (file, line or key), the value found and what would be
    right, e.g. ``config/fabrics.yaml: cotton.wales_per_cm = -3: must be above 0``.
    """

    def __init__(self, where, value, right):
        self.where, self.value, self.right = where, value, right
        shown = "" if value is None else f" = {value}"
        # One line, whatever is in a name: a raw newline or escape code is shown, not sent.
        said = f"{where}{shown}: {right}"
        super().__init__("".join(c if c.isprintable() else repr(c)[1:-1] for c in said))

    def __reduce__(self):
        return type(self), (self.where, self.value, self.right)


class ComputationError(RuntimeError):
    """A computation on valid input that could not be completed; the message says where and why."""


def number(where, value, low=-math.inf, high=math.inf, low_allowed=False):
    """``value`` as a float; raises InputError unless it is finite, above ``low`` (or equal to it
    if ``low_allowed``) and below ``high``."""
    try:
        found = float(value)
    except (TypeError, ValueError):
        found = math.nan
    if math.isfinite(found) and found < high and (found > low or (low_allowed and found == low)):
        return found
    limits = []
    if low > -math.inf:
        limits.append(f"{'at least' if low_allowed else 'above'} {low:.10g}")
    if high < math.inf:
        limits.append(f"below {high:.10g}")
    shown = repr(value) if isinstance(value, str) else value
    raise InputError(where, shown, f"must be {' and '.join(limits) or 'a finite number'}")

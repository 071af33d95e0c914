"""The two ways in which knitsim says no."""


class InputError(ValueError):
    """Input that cannot be used; raised before any computing.

    The message is one line that names where (file, line or key), the value found and what would be
    right, e.g. ``config/fabrics.yaml: cotton.wales_per_cm = -3: must be above 0``.
    """

    def __init__(self, where, value, right):
        self.where, self.value, self.right = where, value, right
        shown = "" if value is None else f" = {value}"
        super().__init__(f"{where}{shown}: {right}")

    def __reduce__(self):
        return type(self), (self.where, self.value, self.right)


class ComputationError(RuntimeError):
    """A computation on valid input that could not be completed; the message says where and why."""

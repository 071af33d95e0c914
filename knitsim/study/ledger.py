"""The assumption ledger: every input that nobody gave, with its reason and plausible range."""

from dataclasses import asdict, dataclass

from knitsim.study.schema import MODEL_ASSUMPTIONS


@dataclass(frozen=True)
class Assumption:
    """One row of the ledger.

    subject: name of the yarn, fabric or scene (``model`` for what no key can change); kind: which
    of these it is.  key: as in the file, with the unit in its name, after its sections and dots.
    path: the key as ``with_value`` of the object that listed the row takes it; empty for the model.
    value, low, high: in ``unit``.  low and high are None where choices hold the alternatives
    instead.  stages: the stages of the work whose results the value changes.
    """

    subject: str
    kind: str
    key: str
    value: object
    unit: str
    because: str
    low: float | None
    high: float | None
    choices: tuple
    stages: tuple
    path: str = ""

    def as_dict(self):
        """The row as plain JSON types, without path and stages."""
        row = asdict(self)
        del row["path"], row["stages"]
        return row | {"choices": list(self.choices)}


def model_assumptions():
    """The rows of what the model takes for granted."""
    return [
        Assumption("model", "model", name, value, "1", because, None, None, (), stages)
        for name, value, stages, because in MODEL_ASSUMPTIONS
    ]

"""The assumption ledger: every input that nobody gave, with its reason and plausible range."""

from dataclasses import asdict, dataclass
from textwrap import wrap

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


class Ledger(list):
    """A list of :class:`Assumption`, printed a row a line, or all of a subject together, without reasons."""

    LINES = 9

    def __repr__(self):
        if len(self) <= self.LINES:
            return "\n".join(f"{row.subject}.{self._value(row)}: {row.because}" for row in self)
        of = {}
        for row in self:
            of.setdefault(row.subject, []).append(self._value(row))
        lines = [
            line
            for subject, told in of.items()
            for line in wrap(f"{subject}: {'; '.join(told)}", 110, subsequent_indent="  ")
        ]
        more = [*lines[: self.LINES - 1], "..."] if len(lines) > self.LINES else lines
        return "\n".join([*more, "to_dataframe() has the reasons"])

    def _value(self, row):
        value, low, high = (
            f"{one:.4g}" if isinstance(one, float) else str(one)
            for one in (row.value, row.low, row.high)
        )
        unit = "" if row.unit == "1" else f" {row.unit}"
        between = "" if row.low is None else f" ({low} to {high})"
        return f"{row.key} = {value}{unit}{between}"

    def to_dataframe(self):
        """One row an assumption (pandas)."""
        import pandas as pd

        return pd.DataFrame([row.as_dict() for row in self])


def model_assumptions():
    """The rows of what the model takes for granted."""
    return [
        Assumption("model", "model", name, value, "1", because, None, None, (), stages)
        for name, value, stages, because in MODEL_ASSUMPTIONS
    ]

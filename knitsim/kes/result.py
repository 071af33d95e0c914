"""KES parameters as they are handed out: SI and gf units, the definition used, what was left out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from knitsim.units import from_si

# Kind of quantity: SI unit, KES unit, and one SI unit in KES units.  Work, rigidity and moment are
# per width or per area of fabric: gf cm/cm2, gf cm2/cm, gf cm/cm.
KINDS = {
    "ratio": ("1", "1", 1.0),
    "share": ("1", "%", from_si(1.0, "percent")),
    "strain": ("1", "%", from_si(1.0, "percent")),
    "force": ("N m-1", "gf/cm", from_si(1.0, "gf_per_cm")),
    "work": ("J m-2", "gf cm/cm2", from_si(1.0, "gf_per_cm")),
    "curvature": ("m-1", "1/cm", from_si(1.0, "per_cm")),
    "moment": ("N", "gf cm/cm", from_si(1.0, "gf")),
    "rigidity": ("N m", "gf cm2/cm", from_si(1.0, "gf") / from_si(1.0, "per_cm")),
    "angle": ("rad", "deg", from_si(1.0, "deg")),
    "shear_rigidity": (
        "N m-1 rad-1",
        "gf/(cm deg)",
        from_si(1.0, "gf_per_cm") / from_si(1.0, "deg"),
    ),
}

MAIN = ("EMT", "WT", "LT", "RT", "B", "2HB", "G", "2HG")  # whose lack is said aloud
NO_RECOVERY = "the test has no recovery"
UNSURE = 0.2  # errors of reading above it, over the value, are said aloud


class LeftOut(Exception):
    """A parameter that this curve does not give; the message is the reason."""


@dataclass(frozen=True)
class Parameter:
    """One KES parameter.

    value (SI, in ``units``), kes_value (in ``kes_units``, those of the instrument), error: estimated
    error of ``value`` by the reading between points (SI; NaN: no estimate), not of the points
    themselves.  definition: what was computed, with its numbers.
    """

    name: str
    value: float
    units: str
    kes_value: float
    kes_units: str
    error: float
    definition: str

    def __str__(self):
        si = "" if self.units == "1" else f" {self.units}"
        kes = "" if self.kes_units == "1" else f" ({self.kes_value:.6g} {self.kes_units})"
        return f"{self.name} = {self.value:.6g}{si}{kes}: {self.definition}"


@dataclass(frozen=True)
class Evaluation:
    """Parameters by name, the reasons for those left out by name, and how each pass was read.

    ``evaluation["B"]`` is a :class:`Parameter`; KeyError with the reason if it was left out.  at: the
    force F_m of a tension test, in words.  Printed, it is one line, with what was read to worse than
    20 %; :meth:`described` lists all of them with their definitions.
    """

    parameters: Mapping[str, Parameter]
    left_out: Mapping[str, str]
    read: tuple[str, ...]
    at: str = ""

    def __getitem__(self, name):
        if name in self.left_out:
            raise KeyError(f"{name} was left out: {self.left_out[name]}")
        return self.parameters[name]

    def __contains__(self, name):
        return name in self.parameters

    def rows(self):
        """A list of dicts, one row of a table per parameter, those left out with NaN and reason."""
        rows = [
            {
                "parameter": p.name, "value": p.value, "units": p.units, "kes_value": p.kes_value,
                "kes_units": p.kes_units, "error": p.error, "definition": p.definition,
                "left_out": "",
            }
            for p in self.parameters.values()
        ]  # fmt: skip
        return rows + [
            {
                "parameter": name, "value": math.nan, "units": "", "kes_value": math.nan,
                "kes_units": "", "error": math.nan, "definition": "", "left_out": reason,
            }
            for name, reason in self.left_out.items()
        ]  # fmt: skip

    def __repr__(self):
        told = []
        for one in list(self.parameters.values())[:6]:
            unit = "" if one.kes_units == "1" else f" {one.kes_units}"
            told.append(f"{one.name} {one.kes_value:.3g}{unit}")
        unsure = [p.name for p in self.parameters.values() if not p.error <= UNSURE * abs(p.value)]
        told = ", ".join(told) or "nothing could be read"
        told += f"; poorly known between so few states: {', '.join(unsure)}" if unsure else ""
        lacking = {
            n: self.left_out[n]
            for n in MAIN
            if NO_RECOVERY not in self.left_out.get(n, NO_RECOVERY)
        }
        told += "".join(f"; no {name}: {why}" for name, why in lacking.items())
        return f"<KES{self.at and f' at {self.at}'}: {told}>"

    def __str__(self):
        return repr(self)

    def described(self):
        """All parameters with their definitions, the reasons for those left out, and how it was read."""
        lines = [str(parameter) for parameter in self.parameters.values()]
        lines += [f"{name} left out: {reason}" for name, reason in self.left_out.items()]
        return "\n".join([*lines, *self.read])


class Collector:
    """Gathers what an evaluation gives; a computation that raises LeftOut is noted as left out."""

    def __init__(self):
        self.parameters, self.left_out = {}, {}

    def add(self, name, kind, compute, definition):
        """compute() gives (value, error) in SI, or raises LeftOut."""
        try:
            value, error = compute()
        except LeftOut as reason:
            self.left_out[name] = str(reason)
            return
        units, kes_units, factor = KINDS[kind]
        value = float(value) + 0.0  # which makes a negative zero a zero
        self.parameters[name] = Parameter(
            name, value, units, value * factor, kes_units, float(error), definition
        )

    def needed(self, *names):
        """(value, error) of parameters found before; raises LeftOut if one of them is not there."""
        for name in names:
            if name in self.left_out:
                reason = self.left_out[name]
                raise LeftOut(reason if reason.startswith("needs ") else f"needs {name}: {reason}")
        return [(self.parameters[n].value, self.parameters[n].error) for n in names]

    def mean(self, *names):
        """(mean, mean error) of parameters found before; raises LeftOut if one is not there."""
        found = self.needed(*names)
        return tuple(sum(column) / len(found) for column in zip(*found, strict=True))

    def result(self, read, at=""):
        return Evaluation(
            MappingProxyType(self.parameters), MappingProxyType(self.left_out), tuple(read), at
        )


def shown(values, kind):
    """``0.5 to 1.5 1/cm (50 to 150 m-1)`` of a pair of values, or one value likewise."""
    values = values if isinstance(values, tuple) else (values,)
    units, kes_units, factor = KINDS[kind]
    # Adding 0 takes the sign from a negative zero.
    si = " to ".join(f"{value + 0.0:.6g}" for value in values)
    kes = " to ".join(f"{value * factor + 0.0:.6g}" for value in values)
    return f"{kes} {kes_units} ({si}{'' if units == '1' else ' ' + units})"

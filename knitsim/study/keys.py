"""What the table of configuration keys is made of: keys, sections of keys, allowed intervals."""

import math
from dataclasses import dataclass, field

REQUIRED = object()  # default of a key that must be given


class Missing(Exception):
    """Raised by a rule that lacks what it follows from; the message says what to give."""


@dataclass(frozen=True)
class Follows:
    """What a rule returns where its value (SI) follows from what is stated and is no assumption.

    how: from what and by which formula, in words.
    """

    value: object
    how: str


@dataclass(frozen=True)
class Interval:
    """The allowed numbers of a key, in the key's own unit."""

    low: float
    high: float
    low_open: bool
    high_open: bool

    @classmethod
    def parse(cls, text):
        """From mathematical notation: ``(0, 1]`` is above 0 and at most 1."""
        low, high = text[1:-1].split(",")
        return cls(float(low), float(high), text[0] == "(", text[-1] == ")")

    def __contains__(self, number):
        above = number > self.low if self.low_open else number >= self.low
        below = number < self.high if self.high_open else number <= self.high
        return above and below

    def __str__(self):
        words = []
        if self.low > -math.inf:
            words.append(f"{'above' if self.low_open else 'at least'} {self.low:.12g}")
        if self.high < math.inf:
            words.append(f"{'below' if self.high_open else 'at most'} {self.high:.12g}")
        return " and ".join(words)


@dataclass(frozen=True)
class Key:
    """One key of a configuration file.

    name: as in the file, with its unit.  quantity: its name inside, in SI; keys of one quantity are
    alternatives, and default, because and plausible are read from the first of them.
    kind: number, integer, count (of a yarn, a number or as the trade writes it), flag, choice, text,
    numbers, choices or words (lists), mapping (names to text or numbers), lines (how many first lines, or
    a list of line numbers), pattern (of knit and purl), turns, history
    (:mod:`knitsim.study.turns`).
    unit: a unit of knitsim.units, None if dimensionless.  allowed: an interval, in the key's unit.
    default: REQUIRED, None (may be left out), a value in the key's unit, or a rule: a function of
    the SI values that are stated, or stand before it in the table, that returns the SI value, None for
    none, or :class:`Follows`, or raises :class:`Missing`.
    because: why the default is what it is; a default with a reason is an assumption and goes into
    the ledger.  Without a default: why a value goes there where it is given.
    plausible: low and high in the key's unit, or as factors if the default is a rule.
    when: the values of the section's ``kind`` for which the key is known; empty for all.
    gives: the quantity that follows from this one, where it is not stated itself.
    may_be_empty: whether a list may have no element.
    stages: the stages of knitsim.study.schema whose results the key changes.
    """

    name: str
    quantity: str
    kind: str
    about: str
    unit: str | None = None
    allowed: str | None = None
    choices: tuple = ()
    default: object = None
    because: str = ""
    plausible: tuple = ()
    when: tuple = ()
    stages: tuple = ()
    may_be_empty: bool = False
    gives: str = ""
    interval: Interval | None = field(init=False, default=None, repr=False)

    def __post_init__(self):
        if self.allowed is not None:
            object.__setattr__(self, "interval", Interval.parse(self.allowed))

    @property
    def is_list(self):
        """Whether one value of the key is itself a list."""
        return self.kind in ("numbers", "choices", "words", "lines", "turns")

    @property
    def stem(self):
        """The key without the unit at its end: ``loop_length`` of ``loop_length_mm``."""
        for end in (self.unit, str(self.unit).removeprefix("loops_")):
            if self.name.endswith(f"_{end}"):
                return self.name[: -len(end) - 1]
        return self.name


@dataclass(frozen=True)
class Section:
    """A group of keys, with sections within it.

    of: for a section of a scene, what it tests (``yarn`` or ``fabric``).  stage: what it belongs to
    as a whole.  named: the section holds any number of user-named entries, each with these keys;
    a key that an entry leaves out is taken from the enclosing section.  default_entries: what
    stands for a named section that is left out.
    """

    name: str
    about: str
    keys: tuple = ()
    sections: tuple = ()
    of: str = ""
    stage: str = ""
    named: bool = False
    default_entries: dict = field(default_factory=dict)

    def key(self, name):
        """The key of that name, or None."""
        return next((key for key in self.keys if key.name == name), None)

    def section(self, name):
        """The section of that name, or None."""
        return next((section for section in self.sections if section.name == name), None)

    def quantities(self):
        """The alternatives of each quantity: {quantity: [keys]}, in table order."""
        found = {}
        for key in self.keys:
            found.setdefault(key.quantity, []).append(key)
        return found

"""The keys of a yarn's contact law and what of it can be calibrated, from the fields of the laws."""

from collections.abc import Mapping

from knitsim import units
from knitsim.equilibrium.contact import LAWS, BarrierContact
from knitsim.study.keys import REQUIRED, Key, Section

STAGE = "equilibrium"


def keys_of(law, **more):
    """A key for every field of a contact law (class)."""
    default = {one.name: one.default for one in law.__dataclass_fields__.values()}
    return tuple(
        Key(
            q.key, name, "number", q.about, unit=q.unit, allowed=q.allowed,
            default=_from_si(default[name], q.unit), plausible=q.plausible, because=q.because,
            **more,
        )
        for name, q in law.quantities().items()
    )  # fmt: skip


def _from_si(default, unit):
    if not isinstance(default, (int, float)):
        return REQUIRED
    return units.from_si(default, unit) if unit else default


def barrier_key():
    """The key that stands at the yarn itself, for the law that a yarn has without a section."""
    (key,) = keys_of(BarrierContact, stages=(STAGE,))
    object.__setattr__(key, "quantity", "compression_stiffness")
    return key


def stated_contact(yarn):
    """The contact law that the sections of a YarnInput state, None where it has none of them."""
    for section, law in LAWS.items():
        if (own := yarn[section]) is not None:
            return law(**{name: own[name] for name in law.quantities()})
    return None


class Live:
    """What a function gives, asked anew each time: laws may be added after this package is loaded."""

    def __init__(self, make):
        self.make = make

    def __iter__(self):
        return iter(self.make())


def law_sections():
    """A section of a yarn for every contact law."""
    return [
        Section(
            name,
            getattr(law, "about", (law.__doc__ or "").split("\n")[0]),
            keys_of(law),
            stage=STAGE,
        )
        for name, law in LAWS.items()
    ]


class LawParameters(Mapping):
    """Calibratable parameters by name: those given, and those of every contact law.

    parameter: function of key, Quantity, field and section that makes one.
    """

    def __init__(self, own, parameter):
        self.own, self.parameter = own, parameter

    def _all(self):
        found = {}
        for section, law in [*LAWS.items(), ("", BarrierContact)]:
            for name, q in law.quantities().items():
                key = f"yarn.{section}.{q.key}" if section else f"yarn.{q.key}"
                label = q.parameter or f"{section.removesuffix('_law')}_{name}"
                found[label] = self.parameter(key, q, f"contact.{name}", section)
        return found | self.own

    def __getitem__(self, name):
        return self._all()[name]

    def __iter__(self):
        return iter(self._all())

    def __len__(self):
        return len(self._all())

"""What the columns and the preamble of a machine's file are called, in English, German and French.

A heading is taken apart into a name and a unit, in brackets, behind a comma, a slash or ``in``, or at
the end of a name such as ``force_per_width_gf_per_cm``.  The name must be one of :data:`FAMILIES` as a
whole: ``Strain rate (1/s)`` is no strain.  Which quantity a column is follows from its unit.
"""

import re
import unicodedata
from dataclasses import dataclass, replace

from knitsim.units import COUNT, COUNT_UNITS, FORCE, INDIRECT, LENGTH, NONE, Unit, parsed

PER_WIDTH = (1, -1, 0, 0)
PER_LENGTH = (0, -1, 0, 0)
TENACITY = (1, 0, -1, 0)
MOMENT = (1, 1, 0, 0)
COMPLIANCE = (-1, 1, 0, 0)

# Quantities: powers of their unit (knitsim.units), and a unit to name in messages.
QUANTITIES = {
    "strain": (NONE, "%"),
    "extension": (LENGTH, "mm"),
    "force": (FORCE, "N"),
    "tenacity": (TENACITY, "cN/tex"),
    "force_per_width": (PER_WIDTH, "N/mm"),
    "lateral_strain": (NONE, "%"),
    "strain_low": (NONE, "%"),
    "strain_high": (NONE, "%"),
    "thickness": (LENGTH, "mm"),
    "curvature": (PER_LENGTH, "1/cm"),
    "moment": (MOMENT, "gf cm"),
    "moment_per_width": (FORCE, "gf cm/cm"),
}
# Quantities that a column of each family may hold; its unit decides.
FAMILIES = {
    "lengthening": ("extension", "strain"),
    "force": ("force", "force_per_width", "tenacity"),
    "lateral_strain": ("lateral_strain",),
    "strain_low": ("strain_low",),
    "strain_high": ("strain_high",),
    "thickness": ("thickness",),
    "curvature": ("curvature",),
    "moment": ("moment", "moment_per_width"),
    # Known, and not quantities of a curve.
    "time": (),
    "cycle": (),
    "specimen": (),
}
_NAMES = {
    "lengthening": """strain; extension; elongation; displacement; elong; ext; disp; displ; crosshead;
        crosshead displacement;
        crosshead extension; crosshead travel; crosshead position; position; stroke; travel; grip
        displacement; jaw displacement; extensibility; deformation; epsilon; eps; e; dl; delta l;
        extension from preload; displacement from preload; weg;
        dehnung; standardweg; traversenweg; kolbenweg; maschinenweg; prufweg; verlangerung;
        langenanderung; verformung; verschiebung; allongement; deplacement; deplacement traverse;
        deplacement de la traverse; extension traverse; course; allungamento; spostamento;
        deformazione; alargamiento; desplazamiento; deformacion""",
    "force": """force; load; f; load from preload; force from preload; kraft; standardkraft; prufkraft;
        zugkraft; kraft f; force f; fadenzugkraft;
        fadenkraft; last; load cell; kraftaufnehmer; pull force; tension; charge; effort; forza; carico;
        fuerza; carga; tenacity; specific stress; specific strength; specific force; tex force;
        feinheitsfestigkeit; feinheitsbezogene kraft; feinheitsbezogene zugkraft; tenacite; force per
        width; force per unit width; load per width; load per unit width; line force; membrane force;
        tension per width; tensile force per unit width; linienkraft; breitenbezogene kraft; kraft pro
        breite; kraft je breite; force lineique; force par largeur; force par unite de largeur""",
    "lateral_strain": """lateral strain; transverse strain; width strain; strain across; querdehnung;
        deformation transversale""",
    "strain_low": "strain low; low strain",
    "strain_high": "strain high; high strain",
    "thickness": "thickness; dicke; epaisseur; spessore; espesor",
    "curvature": "curvature; bending curvature; k; kappa; krummung; courbure; curvatura",
    "moment": """moment; m; bending moment; moment per width; moment per unit width; bending moment per
        width; bending moment per unit width; biegemoment; moment de flexion; couple; momento""",
    "time": "time; t; elapsed time; test time; zeit; prufzeit; temps; tempo; tiempo; duree",
    "cycle": """cycle; cycles; cycle number; cycle no; cycle count; total cycle count; elapsed cycles;
        zyklus;
        zyklen; zyklus nr; zyklusnummer; numero de cycle""",
    "specimen": """specimen; specimen no; specimen number; specimen label; sample; sample no; probe; probe
        nr;
        probennummer; prufling; eprouvette; test no; test number; run""",
}  # fmt: skip
# Words that say nothing about which quantity it is.
_DECORATION = {
    "tensile", "axial", "standard", "engineering", "nominal", "applied", "measured", "actual", "technical",
    "technische", "primary", "instron", "channel", "signal", "yarn", "fabric",
}  # fmt: skip
# What a whole file states once: powers of its unit, how a key names it, other names.
CONDITIONS = {
    "gauge_length": ((LENGTH,), "gauge_length_mm", """gauge length; gage length; initial gauge length;
        nominal gauge length; clamp distance; clamp separation; jaw separation; grip separation; grip to
        grip
        separation; grip to grip separation at the start position; free length; test length; initial
        length; original length; l0; einspannlange; freie einspannlange; einspannlange bei startposition;
        einspannlange
        l0; klemmenabstand; spannlange; messlange; anfangsmesslange;
        klemmlange; pruflange; longueur initiale; longueur utile; longueur de reference; longueur d
        essai; distance entre mors; distance entre machoires; longueur entre mors"""),
    "width": ((LENGTH,), "width_mm", """width; specimen width; sample width; initial width; strip width;
        breite; probenbreite; streifenbreite; breite b0; probenbreite b0; b0; largeur; largeur eprouvette;
        largeur de l
        eprouvette; largeur d eprouvette"""),
    "pretension": ((PER_WIDTH, FORCE, TENACITY), "pretension_N_per_mm", """pretension; pre tension;
        pretension force; preload; pre load; preload force; vorkraft; vorspannkraft; precharge;
        pretension load"""),
    "machine_compliance": ((COMPLIANCE,), "machine_compliance_mm_per_N", """machine compliance; compliance;
        system compliance; nachgiebigkeit; maschinennachgiebigkeit"""),
    "linear_density": ((COUNT,), "linear_density_dtex", """linear density; count; yarn count; yarn number;
        titre; titer; feinheit; garnfeinheit; fineness; finesse; masse lineique"""),
    "decimal_sign": ((), "decimal_sign", "decimal sign"),
}  # fmt: skip
_BRACKETS = re.compile(r"\(([^()]*)\)|\[([^\[\]]*)\]|<([^<>]*)>|\{([^{}]*)\}")
_BEHIND = re.compile(r"\s+(?:in|en)\s+|\s*[/,]\s*|\s+|_")


def plain(name):
    """A name in small letters without accents, signs and line breaks: ``Prüf-Kraft`` is ``pruf kraft``."""
    text = unicodedata.normalize("NFKD", name.replace("ß", "ss").replace("\u0394", "delta "))
    text = "".join(c if c.isalnum() else " " for c in text if not unicodedata.combining(c)).lower()
    for spelt, one in (("ae", "a"), ("oe", "o"), ("ue", "u")):
        text = text.replace(spelt, one)
    return " ".join(text.split())


def _table(names):
    return {plain(name): key for key, text in names.items() for name in text.split(";")}


_FAMILY_OF = _table(_NAMES)
_CONDITION_OF = _table({name: entry[2] for name, entry in CONDITIONS.items()})
_NAMED = {*_FAMILY_OF, *_CONDITION_OF}
_OWN = sorted((*QUANTITIES, *CONDITIONS, "count"), key=len, reverse=True)


@dataclass(frozen=True)
class Heading:
    """A heading: text as in the file; name: in plain spelling, without unit and number; number: that
    stands behind the name (of a specimen), 0 without; unit, or None; remark: brackets that hold no unit."""

    text: str
    name: str
    number: int
    unit: Unit | None
    remark: str = ""

    @property
    def family(self):
        """The key of FAMILIES that it belongs to, or None."""
        found = _FAMILY_OF.get(self.name)
        # One letter is a name only with the unit that goes with it.
        if found is not None and len(self.name) == 1 and self.quantity_in(found) is None:
            return None
        return found

    @property
    def condition(self):
        """The key of CONDITIONS that it names, or None."""
        return _CONDITION_OF.get(self.name)

    @property
    def quantity(self):
        """The quantity that name and unit make it, or None; a plain ``strain`` is a fraction."""
        return self.quantity_in(self.family)

    def quantity_in(self, family):
        if family is None:
            return None
        if self.unit is None:
            own = self.name.replace(" ", "_")
            return own if own in QUANTITIES and QUANTITIES[own][0] == NONE else None
        for quantity in FAMILIES[family]:
            if QUANTITIES[quantity][0] == self.unit.powers:
                return quantity
        return None

    def with_unit(self, unit):
        return replace(self, unit=unit)


def heading(text):
    """The :class:`Heading` of a cell."""
    text = " ".join(str(text).split())
    return _snake(text) or _spoken(text)


def _snake(text):
    """A heading in knitsim's own spelling, ``force_per_width_gf_per_cm`` or ``count_Ne``; None if not."""
    name = re.sub(r"[\s()\[\]]+", "_", text.replace("%", " percent ").replace("/", "_per_")).strip(
        "_"
    )
    name = re.sub(r"_+", "_", name).replace("_1_per_", "_per_")
    for own in _OWN:
        if not name.lower().startswith(own):
            continue
        rest, number = name[len(own) :], 0
        # pandas and people number what stands twice: force_N.1, force_N_2.
        if numbered := re.fullmatch(r"(.*)([._])(\d+)", rest):
            rest, number = numbered[1], int(numbered[3]) + (numbered[2] == ".")
        if rest[:1] not in ("", "_"):
            continue
        if rest.startswith("_in_") or rest[1:2].isdigit():
            return None  # Force in cN, Force 1 (cN)
        spelt = re.sub(r"^per_", "1/", rest[1:]).replace("_per_", "/").replace("_", ".")
        unit = _count(rest[1:]) or (parsed(spelt) if spelt else None)
        if rest and unit is None:
            return None
        if unit is not None:
            unit = Unit(unit.factor, unit.powers, rest[1:].replace("_per_", "/").replace("_", " "))
        return Heading(text, own.replace("_", " "), number, unit)
    return None


def _count(text):
    """The unit of a yarn count that is no plain factor (Ne, Nm), as a Unit of factor NaN; or None."""
    if text in INDIRECT and text in COUNT_UNITS:
        return Unit(float("nan"), COUNT, text)
    return None


def _spoken(text):
    """A heading as people and machines write it."""
    unit, remarks = None, []
    rest = text
    for match in list(_BRACKETS.finditer(text))[::-1]:
        inner = next(group for group in match.groups() if group is not None)
        found = _count(inner.strip()) or parsed(inner) if inner.strip() else None
        if found is not None and unit is None:
            unit = found
        else:
            remarks.append(inner)
        rest = rest[: match.start()] + " " + rest[match.end() :]
    rest = rest.strip().rstrip(":=").strip()
    if unit is None and rest.startswith("%"):
        unit, rest = parsed("%"), rest[1:]
    if unit is None and rest.endswith("%"):
        unit, rest = parsed("%"), rest[:-1].rstrip(" ,/_")
        rest = re.sub(r"\s+in$", "", rest)
    for match in () if unit else _BEHIND.finditer(rest):
        # The shortest name that leaves a unit behind it.
        tail = rest[match.end() :]
        # A number behind a name is that of a specimen.
        found = None if tail.isdigit() or tail == "-" else _count(tail) or parsed(tail)
        if found is not None and _base(rest[: match.start()])[0] in _NAMED:
            unit, rest = found, rest[: match.start()]
            break
    name, number = _base(rest)
    return Heading(text, name, number, unit, " ".join(remarks))


def _base(name):
    """(plain name without decoration, number behind it)."""
    words, number = plain(name).split(), 0
    if " ".join(words) not in _NAMED and words:
        match = re.fullmatch(r"(\D*)(\d+)", words[-1])
        if match and (match[1] or len(words) > 1):
            words[-1:], number = [match[1]] if match[1] else [], int(match[2])
    if " ".join(words) not in _NAMED:
        words = [word for word in words if word not in _DECORATION] or words
    return " ".join(words), number

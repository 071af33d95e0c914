"""Contact laws: what it takes to press two yarns together.

A law is an energy v(D) per length of the one yarn and length of the other (J/m2), D being the distance
of the two centre lines; it is zero from one diameter on.  A law of your own is one class: its fields are
:func:`quantity` fields, and :meth:`ContactLaw.energy` says what v is.

>>> import numpy as np
>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Quadratic(ContactLaw):
...     section = "quadratic_law"
...     stiffness: float = quantity("stiffness_N_per_mm3", "Stiffness.", unit="N_per_mm3", si="N m-3")
...     def energy(self, distance, diameter):
...         return 0.5 * self.stiffness * np.maximum(diameter - distance, 0.0) ** 2
>>> v, *_ = Quadratic(1e9).at(np.array([0.9e-3]), 1e-3)
>>> round(float(v[0]), 9)
5.0

The keys of a study (``quadratic_law: {stiffness_N_per_mm3: 1}`` of a yarn), their checks and the
parameters that a calibration may free follow from the fields.  The two laws that knitsim brings are
compiled in closed form; any other is tabulated once, as a quintic spline between knots that lie denser
towards the core, and the table is the law: its derivatives are exact.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar

from knitsim.errors import InputError, number

CORE, TABLE = 1, 2  # kinds of soft laws, see kernels.contact.soft_at
TERMS = 14  # of power series of a core law, see kernels.mean.core_integrals
# Spacing of the contact points, in diameters.  Two crossing yarns of bending rigidity B touch along
# about d (B/(K d^3))^(1/4): a force B/d^2 presses them by delta diameters, K d delta^2 = B/d^2, and
# their gap stays below that over sqrt(delta) d.  The factor makes it d/16 for a cotton jersey.
BARRIER_SPACING, WIDEST, NARROWEST = 1.0 / 8.0, 1.0 / 4.4, 1.0 / 96.0
BARRIER_SHELL = 8.914  # shell of the barrier law over K/d^2
RATIO, DEEPEST = 1.03, 1e-3  # of the table: gap of one knot over that of the next; smallest gap
TABLE_TOLERANCE, TOUCH_TOLERANCE = (
    1e-6,
    1e-4,
)  # of the energy itself, of that half way: between knots

# A study reads this module: numpy and scipy are loaded where they are needed, not at the start.
LAWS = {}  # every law with a section of its own in a study, by that section's name


@dataclass(frozen=True)
class Quantity:
    """What is said of a field of a law.

    key: as in a study, with its unit; about; unit: of the key (a unit of :mod:`knitsim.units`) or None;
    si: unit inside; allowed: interval in the key's unit; length: whether it grows with the yarn;
    parameter: name as a calibratable parameter, least_free: the least value (SI) that
    a calibration tries without bounds; plausible, because: see
    :class:`knitsim.study.keys.Key`.
    """

    key: str
    about: str
    unit: str | None
    si: str
    allowed: str
    length: bool
    parameter: str
    least_free: float
    plausible: tuple
    because: str


def quantity(
    key, about, *, unit=None, si="1", allowed="(0, 1e9]", length=False, parameter="",
    least_free=0.0, default=None, plausible=(), because="",
):  # fmt: skip
    """A field of a contact law (:class:`Quantity`); default: in SI, None if it must be given."""
    about = Quantity(
        key, about, unit, si, allowed, length, parameter, least_free, plausible, because
    )  # fmt: skip
    given = {} if default is None else {"default": default}
    return field(metadata={"quantity": about}, **given)


class ContactLaw(ABC):
    """Base of all contact laws; a subclass is a frozen dataclass with :func:`quantity` fields.

    section: name of its section of a yarn in a study.
    """

    section: ClassVar[str] = ""
    limits: ClassVar[dict] = {}

    def __init_subclass__(cls, **more):
        super().__init_subclass__(**more)
        if cls.section:
            LAWS[cls.section] = cls

    def __post_init__(self):
        for one in fields(self):
            low, high = self.limits.get(one.name, (0.0, math.inf))
            number(f"contact {one.name}", getattr(self, one.name), low, high)

    @classmethod
    def quantities(cls):
        """The fields and what is said of them: {name: Quantity}, in order."""
        return {one.name: one.metadata["quantity"] for one in fields(cls)}

    @abstractmethod
    def energy(self, distance, diameter):
        """v (J/m2) at distances of the centre lines (m, any shape) below the diameter (m)."""

    def core(self, diameter):
        """Distance (m) below which the law does not let the centre lines come; 0 where it has none."""
        return 0.0

    def check(self, diameter):
        """Raises InputError if the law does not fit a yarn of this diameter (m)."""
        if not self.core(diameter) < diameter:
            raise InputError(
                "contact core", self.core(diameter), f"must be below the diameter {diameter:g} m"
            )

    def shell(self, diameter):
        """Stiffness of the contact where it is first touched (N/m3): mean over a tenth of the gap."""
        gap = 0.1 * (diameter - self.core(diameter))
        return 2.0 * float(self.energy(diameter - gap, diameter)) / gap**2

    def grown(self, factor):
        """The law of a yarn ``factor`` times as thick: its lengths grow along."""
        longer = {n: factor * getattr(self, n) for n, q in self.quantities().items() if q.length}
        return replace(self, **longer)

    def spacing(self, diameter, bending_rigidity):
        """Spacing (m) of contact points along the yarn that the law needs where it is pressed little.

        Smooth over the shell, and of a yarn without core as for the barrier of its stiffness.  Where
        yarns are pressed close to a core, more points are taken (:func:`.relax.relax`).
        """
        barrier = self.shell(diameter) * diameter**2 / BARRIER_SHELL
        slender = bending_rigidity / (barrier * diameter**3)
        smooth = min(WIDEST * diameter, 2.0 * WIDEST * (diameter - self.core(diameter)))
        return min(smooth, diameter * max(NARROWEST, BARRIER_SPACING * slender**0.25))

    def soft(self, diameter):
        """What the kernels need of it besides its stiffness: kind, then parameters and series, or table."""
        return _table(self, diameter)

    def for_kernels(self, diameter):
        """The law as the kernels read it (:class:`.kernels.records.Law`)."""
        from knitsim.equilibrium.kernels.records import Law

        stiffness = float(getattr(self, "stiffness", 0.0))
        return Law(float(diameter), float(self.core(diameter)), stiffness, self.soft(diameter))

    def at(self, distance, diameter):
        """v and its first two derivatives by the distance (J/m2, N/m2, N/m3), as the kernels have it."""
        import numpy as np

        from knitsim.equilibrium.kernels.contact import law_at

        law, distance = self.for_kernels(diameter), np.asarray(distance, dtype=float)
        square = [law_at(float(d) ** 2, law) for d in distance.ravel()]
        v, first, second = (np.reshape(part, distance.shape) for part in np.transpose(square))
        return v, 2.0 * distance * first, 2.0 * first + 4.0 * distance**2 * second


def _table(law, diameter):
    """Quintic polynomials between knots: TABLE, logarithm of the knots' ratio, a row a piece.

    The gap z = (D - core)/(diameter - core) runs from 1 down by RATIO a knot to DEEPEST; segment j
    holds the six coefficients by u, 0 at its lower knot and 1 at its upper one, and the first and second
    integral by z from first touch down to its upper knot.
    """
    import numpy as np
    from scipy.interpolate import BPoly, PPoly, make_interp_spline

    core = law.core(diameter)
    count = math.ceil(math.log(1.0 / DEEPEST) / math.log(RATIO))
    log = math.log(1.0 / DEEPEST) / count

    def energy(z):
        return np.asarray(law.energy(core + z * (diameter - core), diameter), dtype=float)

    # By t = log z the law is smooth on an even grid, down to the core.
    t = -log * np.arange(4 * count + 1)[::-1] / 4.0
    spline = make_interp_spline(t, energy(np.exp(t)), k=7)
    knots = t[::4]
    z = np.exp(knots)
    v, by_t, by_tt = (spline.derivative(k)(knots) if k else spline(knots) for k in range(3))
    values = np.stack([v, by_t / z, (by_tt - by_t) / z**2], axis=1)
    values[-1, :2] = 0.0  # no energy and no force at first touch
    pieces = BPoly.from_derivatives(z, values)
    between = 0.5 * (z[:-1] + z[1:])
    off = np.abs(pieces(between) - energy(between))
    if not (
        off <= TABLE_TOLERANCE * energy(between) + TOUCH_TOLERANCE * energy(np.array([0.5]))
    ).all():
        raise InputError(
            "contact law", type(law).__name__,
            "its energy must be a smooth function of the distance that falls to zero, and with it "
            "its slope, at one diameter",
        )  # fmt: skip
    h = np.diff(z)
    coefficients = PPoly.from_bernstein_basis(pieces).c[::-1] * h ** np.arange(6)[:, None]
    # Integrals from first touch down to the upper knot of each piece.
    k = np.arange(6)[:, None]
    whole = h * (coefficients / (k + 1.0)).sum(0)
    again = h**2 * (coefficients / (k + 2.0)).sum(0)
    first = np.append(np.cumsum(whole[::-1])[::-1][1:], 0.0)
    second = np.append(np.cumsum((again + first * h)[::-1])[::-1][1:], 0.0)
    table = np.vstack([coefficients, first, second])
    return np.concatenate([[TABLE, log], table.T[::-1].ravel()])


@dataclass(frozen=True)
class BarrierContact(ContactLaw):
    """Contact energy K (1 - x^2)^2/x^2 per length squared, x = distance/diameter; K in N/m."""

    limits: ClassVar[dict] = {"stiffness": (1e-3, 1e8)}

    stiffness: float = quantity(
        "compression_stiffness_N_per_m", "Stiffness K of the contact of two yarns.",
        unit="N_per_m", si="N m-1", parameter="compression_stiffness", default=1000.0,
        plausible=(300.0, 10000.0), because="not in the paper; a soft spun yarn",
    )  # fmt: skip

    def energy(self, distance, diameter):
        x2 = (distance / diameter) ** 2
        return self.stiffness * (1.0 - x2) ** 2 / x2

    def soft(self, diameter):
        return ()


@dataclass(frozen=True)
class CoreContact(ContactLaw):
    """A stiff core in a soft shell (Singal et al. 2024).

    v(D) = k delta^2/(p (p-1)) [z^(1-p) - 1 - (p-1)(1-z)] per length squared, z = (D - core)/delta,
    delta = diameter - core; core in m, stiffness k in N/m3, exponent p above 1.
    """

    section: ClassVar[str] = "core_law"
    limits: ClassVar[dict] = {
        "core_diameter": (1e-9, 1.0), "stiffness": (1e-3, 1e15), "exponent": (1.01, 20.0)
    }  # fmt: skip
    about: ClassVar[str] = (
        "Compression of a soft shell around a stiff core, for bulky spun yarns, instead of the "
        "compression stiffness."
    )

    core_diameter: float = quantity(
        "core_diameter_mm", "Diameter of the core.", unit="mm", si="m", allowed="(0, 20]",
        length=True, parameter="core_diameter",
    )  # fmt: skip
    stiffness: float = quantity(
        "stiffness_N_per_mm3", "Stiffness k of the shell.", unit="N_per_mm3", si="N m-3",
        allowed="(0, 1e6]", parameter="core_stiffness",
    )  # fmt: skip
    exponent: float = quantity(
        "exponent", "Exponent p of the shell.", allowed="(1, 20]", parameter="core_exponent", least_free=1.05,
        default=2.4, plausible=(1.5, 4.0),
        because="that of an acrylic spun yarn, Singal et al. (2024)",
    )  # fmt: skip

    def energy(self, distance, diameter):
        delta, p = diameter - self.core_diameter, self.exponent
        z = (distance - self.core_diameter) / delta
        bracket = z ** (1.0 - p) - 1.0 - (p - 1.0) * (1.0 - z)
        return self.stiffness * delta**2 / (p * (p - 1.0)) * bracket

    def core(self, diameter):
        return self.core_diameter

    def soft(self, diameter):
        import numpy as np

        q = self.exponent - 1.0
        if abs(q - 1.0) < 1e-5:  # what is divided by q - 1 stays away from it
            q = 1.0 + 1e-5
        n = np.arange(2.0, TERMS + 2.0)
        series = 0.5 * q * (q + 1.0) * np.cumprod(np.append(1.0, (q + n[:-1]) / (n[:-1] + 1.0)))
        once = series / (n + 1.0)
        return np.concatenate([[CORE, self.exponent, q], series, once, once / (n + 2.0)])

"""Tests of a fabric: what is asked for, and what comes out.

A test is described by an object (:class:`Pull`, :class:`Bend`, ...) that can be run on any fabric; the
functions (:func:`pull`, :func:`bend`, ...) describe it and run it at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from knitsim.errors import InputError
from knitsim.library.curves import Bent, BiaxiallyPulled, Pulled, Sheared, Tested
from knitsim.library.rest import Rest, relax
from knitsim.study.check import check_value
from knitsim.study.schema import SCENE
from knitsim.study.study import Fabric

DIRECTIONS = ("course", "wale")
TO_STRAIN = 0.3  # pulled so far where no force ends the test


def _key(section: str, name: str) -> Any:
    return SCENE.section(section).key(name)


@dataclass(frozen=True)
class Test(ABC):
    """A test that can be run on any fabric; its values are checked as a study's are."""

    # pytest is not to collect it.
    __test__: ClassVar[bool] = False
    SECTION: ClassVar[str] = ""
    # Keywords that are called otherwise than the key that checks them.
    KEYS: ClassVar[dict[str, str]] = {}

    def __post_init__(self) -> None:
        direction = getattr(self, "direction", "course")
        if direction not in DIRECTIONS:
            raise InputError(f"{self.label}.direction", repr(direction), "must be course or wale")
        for field in fields(self):
            value, key = getattr(self, field.name), self._key_of(field.name)
            if value is not None and key is not None:
                object.__setattr__(
                    self, field.name, check_value(key, value, f"{self.label}.{field.name}")
                )

    @property
    def label(self) -> str:
        """The test in messages."""
        return type(self).__name__.lower()

    def _key_of(self, name: str) -> Any:
        key = self.KEYS.get(name, name).format(direction=getattr(self, "direction", ""))
        return _key(self.SECTION, key)

    def stated(self) -> dict[str, Any]:
        """The section of a scene that asks for this test."""
        keys = {}
        for field in fields(self):
            value, key = getattr(self, field.name), self._key_of(field.name)
            if value is not None and key is not None:
                keys[key.name] = value
        return keys

    def scene(self) -> dict[str, Any]:
        """Sections of scenes.yaml: the test as the only condition, under its own name."""
        return {self.SECTION: {**self.stated(), "variants": {self.label: {}}}}

    @abstractmethod
    def run(self, fabric: Fabric | Rest) -> Tested:
        """The test of a fabric, or of one at rest."""

    def at_rest(self, fabric: Fabric | Rest) -> Rest:
        """The fabric at rest, relaxed if it is not yet."""
        if isinstance(fabric, Rest):
            return fabric
        if isinstance(fabric, Fabric):
            return relax(fabric)
        raise InputError(self.label, repr(fabric), "needs a Fabric, or what relax makes of one")


@dataclass(frozen=True)
class Pull(Test):
    """A tension test to be run on any fabric: the arguments of :func:`knitsim.pull`.

    >>> import knitsim as ks
    >>> ks.Pull("course", to_strain=0.3, recovery=True)
    Pull('course', to_strain=0.3, recovery=True)
    """

    direction: str
    to_strain: float | None = None
    to_force_gf_per_cm: float | None = None
    friction: bool = True
    lateral: str = "free"
    lateral_load_gf_per_cm: float | None = None
    recovery: bool = False
    cycles: int = 1
    states: int = 30

    SECTION: ClassVar[str] = "equilibrium_tension"
    KEYS: ClassVar[dict[str, str]] = {"to_strain": "max_strain_{direction}"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.cycles > 1 and not self.recovery:
            raise InputError("pull.cycles", self.cycles, "needs recovery=True above 1")
        if self.to_strain is None and self.to_force_gf_per_cm is None:
            object.__setattr__(self, "to_strain", TO_STRAIN)

    def run(self, fabric: Fabric | Rest) -> Pulled:
        """The test of a fabric, or of one at rest."""
        rest = self.at_rest(fabric)
        return Pulled(rest, rest.fabric.with_tests(**self.scene()), self.direction)

    def __repr__(self) -> str:
        return _shown(self)


@dataclass(frozen=True)
class Bend(Test):
    """A bending test to be run on any fabric: the arguments of :func:`knitsim.bend`.

    >>> import knitsim as ks
    >>> ks.Bend("wale", to_per_cm=2.5)
    Bend('wale')
    """

    direction: str
    to_per_cm: float = 2.5
    friction: bool = True
    spacings: str = "free"
    set: float | None = None
    cycles: int = 1
    states: int = 10

    SECTION: ClassVar[str] = "equilibrium_bending"
    KEYS: ClassVar[dict[str, str]] = {"to_per_cm": "max_curvature_per_cm"}

    def run(self, fabric: Fabric | Rest) -> Bent:
        """The test of a fabric, or of one at rest."""
        rest = self.at_rest(fabric)
        try:
            return Bent(rest, rest.fabric.with_tests(**self.scene()), self.direction)
        except InputError as error:
            if error.where != "curvature" and not error.where.endswith("max_curvature_per_cm"):
                raise
            raise InputError("bend.to_per_cm", f"{self.to_per_cm:g}", error.right) from error

    def __repr__(self) -> str:
        return _shown(self)


@dataclass(frozen=True)
class Shear(Test):
    """A shear test to be run on any fabric: the arguments of :func:`knitsim.shear`.

    >>> import knitsim as ks
    >>> ks.Shear(to_deg=5)
    Shear(to_deg=5.0)
    """

    to_deg: float = 8.0
    tension_gf_per_cm: float = 10.0
    friction: bool = True
    states: int = 16

    SECTION: ClassVar[str] = "equilibrium_shear"
    KEYS: ClassVar[dict[str, str]] = {"to_deg": "max_angle_deg"}

    def scene(self) -> dict[str, Any]:
        return {self.SECTION: self.stated()}

    def run(self, fabric: Fabric | Rest) -> Sheared:
        """The test of a fabric, or of one at rest."""
        rest = self.at_rest(fabric)
        return Sheared(rest, rest.fabric.with_tests(**self.scene()))

    def __repr__(self) -> str:
        return _shown(self)


@dataclass(frozen=True)
class Biaxial(Test):
    """A biaxial test to be run on any fabric: the arguments of :func:`knitsim.biaxial`.

    >>> import knitsim as ks
    >>> ks.Biaxial(0.2, 0.1)
    Biaxial(0.2, 0.1)
    """

    course: float
    wale: float
    friction: bool = True
    states: int = 20

    SECTION: ClassVar[str] = "equilibrium_tension"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in DIRECTIONS:
            value = getattr(self, name)
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not number or not -0.9 < value <= 5.0:
                raise InputError(
                    f"biaxial.{name}", repr(value), "must be a strain, above -0.9 and at most 5"
                )
        if self.course == 0.0 and self.wale == 0.0:
            raise InputError("biaxial", "0, 0", "must be strained in one direction at least")

    def scene(self) -> dict[str, Any]:
        keys = {"friction": self.friction, "states": self.states}
        return {self.SECTION: {**keys, "variants": {"biaxial": {}}}}

    def run(self, fabric: Fabric | Rest) -> BiaxiallyPulled:
        """The test of a fabric, or of one at rest."""
        rest = self.at_rest(fabric)
        tested = rest.fabric.with_tests(**self.scene())
        return BiaxiallyPulled(rest, tested, self.course, self.wale)

    def __repr__(self) -> str:
        return _shown(self)


def _shown(test: Test) -> str:
    """The test as it is written, without what is as by default."""
    told = []
    for field in fields(test):
        value = getattr(test, field.name)
        if field.name in ("direction", "course", "wale"):
            told.append(repr(value))
        elif value != field.default:
            told.append(f"{field.name}={value!r}")
    return f"{type(test).__name__}({', '.join(told)})"


def pull(
    fabric: Fabric | Rest, direction: str, *, to_strain: float | None = None,
    to_force_gf_per_cm: float | None = None, friction: bool = True, lateral: str = "free",
    lateral_load_gf_per_cm: float | None = None, recovery: bool = False, cycles: int = 1, states: int = 30,
) -> Pulled:  # fmt: skip
    """Pull the fabric along ``direction``, "course" or "wale": a tension test.

    fabric: a :class:`knitsim.Fabric` or what :func:`knitsim.relax` made of it.  to_strain: largest strain,
    from rest (0.3 where no force is given); to_force_gf_per_cm: end loading at this force per width.
    friction: with that of the yarn.  lateral: the spacing across is "free", "held" or "loaded" by
    ``lateral_load_gf_per_cm``.  recovery: come back to no force; cycles: so many times.  states: stored
    up to the largest strain.  Keys of ``equilibrium_tension``.

    A test that cannot be followed to its end gives the states reached and says why (``stop_reason``).

    >>> import knitsim as ks
    >>> fabric = ks.Fabric(ks.Yarn(count_tex=19.7, bending_rigidity_N_mm2=2e-3), loop_length_mm=2.9)
    >>> ks.pull(fabric, "course", to_strain=0.3, recovery=True)
    <Pull course: 52 states to 30 %, 53.6 gf/cm there, error 0.7 %>
    """
    return Pull(
        direction, to_strain, to_force_gf_per_cm, friction, lateral, lateral_load_gf_per_cm, recovery,
        cycles, states,
    ).run(fabric)  # fmt: skip


def bend(
    fabric: Fabric | Rest, direction: str, *, to_per_cm: float = 2.5, friction: bool = True,
    spacings: str = "free", set: float | None = None, cycles: int = 1, states: int = 10,
) -> Bent:  # fmt: skip
    """Bend the fabric so that ``direction``, "course" or "wale", becomes curved, as the KES tester does.

    From flat to ``to_per_cm`` (1/cm, technical face convex), to the same with the back convex, and back to
    flat.  friction: between the yarns and within them.  spacings: "free", or "held" at those of rest.  set:
    of the yarn, instead of the fabric's own.  Keys of ``equilibrium_bending``.

    >>> import knitsim as ks
    >>> fabric = ks.Fabric(ks.Yarn(count_tex=19.7, bending_rigidity_N_mm2=2e-3), loop_length_mm=2.9)
    >>> bent = ks.bend(fabric, "wale", friction=False)
    >>> bent
    <Bend wale: 41 states to 2.5 per cm, 0.858 gf cm/cm holds it flat, rolls to the face, error 0.04 %>
    >>> round(bent.curl.kes_moment, 3)  # gf cm/cm
    0.858
    """
    return Bend(direction, to_per_cm, friction, spacings, set, cycles, states).run(fabric)


def shear(
    fabric: Fabric | Rest, *, to_deg: float = 8.0, tension_gf_per_cm: float = 10.0, friction: bool = True,
    states: int = 16,
) -> Sheared:  # fmt: skip
    """Shear the fabric in its plane: from 0 to ``to_deg`` (degrees), to the negative angle, and back.

    tension_gf_per_cm: force per width along the wale, kept throughout.  Keys of ``equilibrium_shear``.

    >>> import knitsim as ks
    >>> fabric = ks.Fabric(ks.Yarn(count_tex=19.7, bending_rigidity_N_mm2=2e-3), loop_length_mm=2.9)
    >>> ks.shear(fabric, to_deg=4, states=4, friction=False)
    <Shear: 16 states to 4 degrees, 1.2 gf/cm there, error 0.05 %>
    """
    return Shear(to_deg, tension_gf_per_cm, friction, states).run(fabric)


def biaxial(
    fabric: Fabric | Rest, course: float, wale: float, *, friction: bool = True, states: int = 20
) -> BiaxiallyPulled:
    """Strain the fabric along the course and the wale at once, both in proportion, from rest.

    course, wale: strains at the end (1).  Forces along both are in the result.

    >>> import knitsim as ks
    >>> fabric = ks.Fabric(ks.Yarn(count_tex=19.7, bending_rigidity_N_mm2=2e-3), loop_length_mm=2.9)
    >>> ks.biaxial(fabric, 0.1, 0.05, states=2, friction=False)
    <Biaxial: 3 states to 10 and 5 %, 35.7 and 35.4 gf/cm there>
    """
    return Biaxial(course, wale, friction, states).run(fabric)

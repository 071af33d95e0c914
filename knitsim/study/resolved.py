"""What a yarn, a fabric and a scene have in common: keys as stated, values in SI, the ledger."""

import copy
import json
from collections.abc import Mapping
from types import MappingProxyType

from knitsim import units
from knitsim.errors import InputError
from knitsim.study.check import check_points, check_section
from knitsim.study.cross_checks import check_scene
from knitsim.study.ledger import Ledger
from knitsim.study.resolve import Resolver, replaced
from knitsim.study.schema import SCENE

KINEMATIC_IS_JERSEY = "the kinematic model has jersey only, and this is {}"


class Resolved:
    """A yarn, fabric or scene with every value in SI; read ``resolved["quantity"]``.

    name: the entry's name and, in a sweep, ``_key=value`` for each swept key.  base: the entry's
    name.  point: {key: value} of the swept keys, in the keys' units.  values: quantity to SI value;
    a section that is not given, and an optional value that is not given, is None.
    """

    section = None
    parts = ()  # attributes that hold the objects it refers to

    def __init__(self, file, base, point, label, tree):
        self.file, self.base, self.point = file, base, point
        self.name = f"{base}_{label}" if label else base
        self._resolve(tree)

    def _resolve(self, tree):
        self._tree = tree
        found = Resolver(self.section, tree, self._entry, self.name, self._beside())
        self.values, self._rows, self.derived = found.values, found.rows, found.derived

    def _beside(self):
        """What the rules of its keys need of the objects that it refers to."""
        return {}

    @property
    def _entry(self):
        return f"{self.file}: {self.base}" if self.file else self.base

    def _named(self):
        """The name as a part of the one line that is printed; empty where it is that of its kind."""
        return "" if self.name == self.section.name else f" {self.name}"

    def __repr__(self):
        return f"<{self.section.name.title()}{self._named()}>"

    def __getitem__(self, path):
        """The SI value of a quantity; dots lead into sections.  Raises KeyError."""
        value = self.values
        for part in path.split("."):
            if not isinstance(value, Mapping) or part not in value:
                known = ", ".join(value) if isinstance(value, Mapping) else "nothing below it"
                raise KeyError(f"{path}: values are in SI, by their name without unit: {known}")
            value = value[part]
        return value

    def where(self, key):
        """File and key as error messages name them, e.g. ``config/yarns.yaml: cotton.fibres``."""
        return f"{self._entry}.{key}"

    def is_stated(self, quantity):
        """Whether a key of the entry states the quantity, or what it follows from."""
        keys = self.section.quantities()[quantity]
        return any(key.name in self._tree for key in keys) or quantity in self.derived

    def stated(self, quantity):
        """(where, value) of a quantity in the key's unit, for the message of an InputError."""
        *sections, last = quantity.split(".")
        section, tree = self.section, self._tree
        for name in sections:
            section, tree = section.section(name), tree[name]
        keys = section.quantities()[last]
        key = next((key for key in keys if key.name in tree), keys[0])
        value = units.from_si(self[quantity], key.unit) if key.unit else self[quantity]
        return self.where(".".join([*sections, key.name])), f"{value:.6g}"

    def states(self, key):
        """Whether the entry gives a value for the key at its top."""
        return key in self._tree

    def assumptions(self):
        """The ledger (rows Assumption) of this object and of what it refers to; printed, a row a line."""
        return Ledger(self._rows)

    def with_value(self, path, value):
        """:meth:`with_values` of one value."""
        return self.with_values({path: value})

    def with_values(self, values):
        """A copy with the keys at some paths (dots lead into sections) set, {path: value}, checked.

        A value is in the key's unit.  Alternatives of the key, such as another unit, give way.  What
        follows from the key by default follows again.  The name stays.  Raises InputError.
        """
        other, own = copy.copy(self), dict(values)
        for part in self.parts:
            of_part = {path: own.pop(path) for path in values if path.startswith(f"{part}.")}
            if of_part:
                inner = {path.removeprefix(f"{part}."): value for path, value in of_part.items()}
                setattr(other, part, getattr(self, part).with_values(inner))
        tree = self._tree
        for path, value in own.items():
            tree = self._changed(tree, path, value)
        other._resolve(tree)
        other._check()
        return other

    def _changed(self, tree, path, value):
        """The tree with one key set."""
        *sections, name = path.split(".")
        section, inner = self.section, tree
        for part in sections:
            # An entry of a named section has the keys of that section.
            section = section if section.named else section.section(part)
            if section is None or part not in inner:
                raise InputError(self.where(path), None, f"{part} is not given, so is not changed")
            inner = inner[part]
        key = section.key(name)
        if key is None or name in ("scene", "yarn"):
            raise InputError(self.where(path), None, "is no key whose value can be changed")
        points = check_points(key, value, self.where(path), sweeps=False)
        changed = {k: v for k, v in inner.items() if k not in self._alternatives(section, key)}
        changed[name] = points
        return replaced(tree, sections, changed) if sections else changed

    @staticmethod
    def _alternatives(section, key):
        known = section.quantities()
        gives = {key.quantity, key.gives} | {
            k.quantity for k in section.keys if k.gives == key.quantity
        }
        return {other.name for quantity in gives for other in known.get(quantity, ())}

    def _check(self):
        pass

    def _part(self, stages):
        """The values that matter to ``stages``, without tests."""
        part = {}
        for quantity, keys in self.section.quantities().items():
            if stages.intersection(keys[0].stages):
                part[quantity] = self.values[quantity]
        for inner in self.section.sections:
            if inner.stage in stages:
                part[inner.name] = self.values[inner.name]
        return part

    def values_of(self, stages):
        """The values that matter to ``stages``, of this object and of what it refers to."""
        return [one._part(stages) for one in (self, *(getattr(self, part) for part in self.parts))]

    def as_json(self):
        """:meth:`as_dict` as JSON on one line, the same bytes for the same input."""
        return json.dumps(self.as_dict(), allow_nan=False, ensure_ascii=False)


class SceneInput(Resolved):
    """A test programme; ``scene["tensile_test"]`` is None if that test is not run."""

    section = SCENE
    left_out = MappingProxyType({})  # tests that are stated but not run: why

    def __init__(self, file, base, point, label, tree):
        super().__init__(file, base, point, label, tree)
        self._check()

    @classmethod
    def by_default(cls, of, **tests):
        """The scene of an object that is no study's; tests: of a fabric, what its sections state."""
        stated = {"equilibrium_rest": {}, **tests} if of == "fabric" else {}
        return cls("", of, {}, "", check_section(SCENE, stated, of, sweeps=False))

    def _check(self):
        check_scene(self, self._tree)

    def with_tests(self, **tests):
        """A scene with the same state at rest and these tests, {section: what it states}."""
        rest = {"equilibrium_rest": self._tree.get("equilibrium_rest", {})}
        tree = check_section(SCENE, tests, self.base, sweeps=False)
        return SceneInput(self.file, self.base, {}, "", {**rest, **tree})

    @property
    def of(self):
        """``yarn`` or ``fabric``: what the scene tests."""
        tested = (part.of for part in SCENE.sections if self.values[part.name] is not None)
        return next(tested, "")

    def for_pattern(self, pattern):
        """The tests that a fabric of a pattern can have: those of the kinematic model are jersey's."""
        left = {
            name: KINEMATIC_IS_JERSEY.format(pattern)
            for name, values in self.values.items()
            if values is not None and name.startswith("kinematic_")
        }
        if pattern == "jersey" or not left:
            return self
        other = copy.copy(self)
        other.left_out = left
        other._resolve({name: one for name, one in self._tree.items() if name not in left})
        return other

    @property
    def needs_loop(self):
        """Whether a test needs the loop as built: those of the kinematic model do."""
        return any(
            values is not None and name.startswith("kinematic_")
            for name, values in self.values.items()
        )

    def as_dict(self):
        """Name and SI values of the tests that are run, as plain JSON types."""
        tests = {name: value for name, value in self.values.items() if value is not None}
        return {"name": self.name, "tests": tests}

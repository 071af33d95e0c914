"""A study: the yarns, fabrics and scenes of one directory, checked and in SI.

>>> study = load_study("config")
>>> cotton = study.fabrics["cotton"]
>>> round(cotton["wale_spacing"] * 1e3, 4), round(cotton.yarn["diameter"] * 1e3, 4)
(1.4993, 0.2793)
>>> cotton.with_value("yarn.diameter_mm", 0.3).yarn["diameter"]
0.0003
"""

import copy
import json
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from knitsim import units
from knitsim.errors import InputError
from knitsim.study.check import check_name, check_points, check_section, shown
from knitsim.study.cross_checks import check_fabric, check_scene, check_yarn
from knitsim.study.ledger import model_assumptions
from knitsim.study.measured_checks import calibrate_on, check_measured
from knitsim.study.resolve import Resolver, expand, replaced
from knitsim.study.schema import FABRIC, SCENE, YARN, closure
from knitsim.study.yaml_file import read_yaml

KINEMATIC_IS_JERSEY = "the kinematic model has jersey only, and this is {}"


class Resolved:
    """A yarn, fabric or scene with every value in SI; read ``resolved["quantity"]``.

    name: the entry's name and, in a sweep, ``_key=value`` for each swept key.  base: the entry's
    name.  point: {key: value} of the swept keys, in the keys' units.  values: quantity to SI value;
    a section that is not given, and an optional value that is not given, is None.
    """

    section = None

    def __init__(self, file, base, point, label, tree):
        self.file, self.base, self.point = file, base, point
        self.name = f"{base}_{label}" if label else base
        self._resolve(tree)

    def _resolve(self, tree):
        self._tree = tree
        found = Resolver(self.section, tree, f"{self.file}: {self.base}", self.name)
        self.values, self._rows = found.values, found.rows

    def __repr__(self):
        return f"{type(self).__name__}({self.name})"

    def __getitem__(self, path):
        """The SI value of a quantity; dots lead into sections.  Raises KeyError."""
        value = self.values
        for part in path.split("."):
            value = value[part]
        return value

    def where(self, key):
        """File and key as error messages name them, e.g. ``config/yarns.yaml: cotton.fibres``."""
        return f"{self.file}: {self.base}.{key}"

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

    def assumptions(self):
        """The ledger rows (Assumption) of this object and of what it refers to."""
        return list(self._rows)

    def with_value(self, path, value):
        """A copy with the key at ``path`` (dots lead into sections) set to ``value``, checked.

        value is in the key's unit.  Alternatives of the key, such as another unit, give way.  What
        follows from the key by default follows again.  The name stays.  Raises InputError.
        """
        *sections, name = path.split(".")
        section, tree = self.section, self._tree
        for part in sections:
            # An entry of a named section has the keys of that section.
            section = section if section.named else section.section(part)
            if section is None or part not in tree:
                raise InputError(self.where(path), None, f"{part} is not given, so is not changed")
            tree = tree[part]
        key = section.key(name)
        if key is None or name in ("scene", "yarn"):
            raise InputError(self.where(path), None, "is no key whose value can be changed")
        points = check_points(key, value, self.where(path), sweeps=False)
        changed = {k: v for k, v in tree.items() if k not in self._alternatives(section, key)}
        changed[name] = points
        other = copy.copy(self)
        other._resolve(replaced(self._tree, sections, changed) if sections else changed)
        other._check()
        return other

    @staticmethod
    def _alternatives(section, key):
        return {other.name for other in section.quantities()[key.quantity]}

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

    def _check(self):
        check_scene(self, self._tree)

    @property
    def of(self):
        """``yarn`` or ``fabric``: what the scene tests."""
        return next(part.of for part in SCENE.sections if self.values[part.name] is not None)

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


class YarnInput(Resolved):
    """A yarn and its scene."""

    section = YARN

    def __init__(self, file, base, point, label, tree, scenes, folders):
        super().__init__(file, base, point, label, tree)
        self.scene = _scene_of(self, scenes, "yarn")
        self._folders = folders
        self._check()

    def _check(self):
        check_yarn(self)
        _ = self.curve_paths, self.compression_paths

    @property
    def curve_paths(self):
        """Paths of the measured tension curve, none without one.  Raises InputError for a missing file."""
        return _files(self, "tension_curve")

    @property
    def compression_paths(self):
        """Paths of the measured compression curve, likewise."""
        return _files(self, "compression_curve")

    def assumptions(self):
        return super().assumptions() + _below("scene", self.scene)

    def with_value(self, path, value):
        return _with_value(self, super().with_value, ("scene",), path, value)

    def as_dict(self):
        """Name, SI values and scene as plain JSON types."""
        return {
            "name": self.name,
            "base": self.base,
            "point": self.point,
            "values": self.values,
            "scene": self.scene.as_dict(),
        }

    def config(self, stage):
        """What one stage of the work depends on, no more, as plain JSON types: see _config."""
        stages = closure(stage)
        return {"name": self.name, "values": self._part(stages), **_config(self, stages)}


class FabricInput(Resolved):
    """A fabric, its yarn (``fabric.yarn``), its scene, and the fabric whose calibrations it takes or None."""

    section = FABRIC
    calibrated_on = None

    def __init__(self, file, base, point, label, tree, yarn, scenes, folders):
        super().__init__(file, base, point, label, tree)
        self.yarn = yarn
        self.scene = _scene_of(self, scenes, "fabric").for_pattern(self["pattern"])
        self._folders = folders
        self._check()
        check_measured(self)

    def _check(self):
        check_fabric(self)

    def measured_paths(self, name):
        """Paths of the measured curve ``name``.  Raises InputError for a missing file."""
        return _files(self, f"measured.{name}")

    def assumptions(self):
        return (
            super().assumptions()
            + [_moved("yarn", row) for row in self.yarn._rows]
            + _below("scene", self.scene)
        )

    def with_value(self, path, value):
        return _with_value(self, super().with_value, ("yarn", "scene"), path, value)

    def as_dict(self):
        """Name, SI values, yarn and scene as plain JSON types."""
        return {
            "name": self.name,
            "base": self.base,
            "point": self.point,
            "values": self.values,
            "yarn": self.yarn.as_dict(),
            "scene": self.scene.as_dict(),
        }

    def config(self, stage):
        """What one stage of the work depends on, no more, as plain JSON types: see _config."""
        stages = closure(stage)
        yarn = {"name": self.yarn.name, "values": self.yarn._part(stages)}
        return {
            "name": self.name,
            "values": self._part(stages),
            "yarn": yarn,
            **_config(self, stages),
        }


def _config(resolved, stages):
    """The tests and ledger rows that matter to ``stages``.

    With name, values (and those of the yarn) they are the params of a Snakemake rule and the record
    in its result file: a change that does not matter to the stage changes nothing here.
    """
    rows = model_assumptions() + resolved.assumptions()
    return {
        "tests": resolved.scene._part(stages),
        "assumed": [row.as_dict() for row in rows if stages.intersection(row.stages)],
    }


def _with_value(resolved, own, parts, path, value):
    """with_value of an object that refers to others by the attributes ``parts``."""
    first, _, rest = path.partition(".")
    if first not in parts or not rest:
        return own(path, value)
    other = copy.copy(resolved)
    setattr(other, first, getattr(resolved, first).with_value(rest, value))
    other._check()
    return other


def _files(resolved, section):
    """Paths of the files that a section of a measured curve names; [] without the section."""
    if resolved[section] is None:
        return []
    one, several = resolved[f"{section}.file"], resolved[f"{section}.files"]
    if (one is None) == (several is None):
        right = (
            "is missing; give file or files"
            if one is None
            else "stands beside file; keep one of them"
        )
        raise InputError(resolved.where(f"{section}.file{'s' * (one is not None)}"), None, right)
    found = []
    for file in several or [one]:
        at = next(
            (folder / file for folder in resolved._folders if (folder / file).is_file()), None
        )
        if at is None:
            looked = ", ".join(dict.fromkeys(folder.as_posix() for folder in resolved._folders))
            key = resolved.where(f"{section}.file{'s' * (one is None)}")
            raise InputError(key, shown(file), f"no such file in {looked}")
        found.append(at)
    return found


def _moved(part, row):
    return replace(row, path=f"{part}.{row.path}")


def _below(part, resolved):
    return [_moved(part, row) for row in resolved.assumptions()]


def _scene_of(resolved, scenes, of):
    name = resolved["scene"]
    known = [scene.name for scene in scenes.values() if scene.of == of]
    if name not in known:
        right = f"is a scene of a {scenes[name].of}" if name in scenes else "no such scene"
        raise InputError(
            resolved.where("scene"),
            shown(name),
            f"{right}; scenes of a {of} are: {', '.join(known) or 'none'}",
        )
    return scenes[name]


class Study:
    """What load_study returns: ``yarns``, ``fabrics`` and ``scenes`` are dicts by name, in order.

    files: the paths that the study was read from.
    """

    def __init__(self, path, yarns, fabrics, scenes):
        self.path, self.yarns, self.fabrics, self.scenes = path, yarns, fabrics, scenes
        curves = [path for y in yarns.values() for path in (*y.curve_paths, *y.compression_paths)]
        curves += [
            path
            for f in fabrics.values()
            for name in f["measured"]
            for path in f.measured_paths(name)
        ]
        self.files = [path / f"{name}.yaml" for name in ("yarns", "fabrics", "scenes")]
        self.files += list(dict.fromkeys(curves))

    def assumptions(self):
        """The ledger of the study: one Assumption for each subject and key."""
        rows = model_assumptions()
        for group in (self.yarns, self.fabrics, self.scenes):
            for resolved in group.values():
                rows += resolved._rows
        return rows


def load_study(path, fallback="config"):
    """The Study in the directory ``path``: yarns.yaml, fabrics.yaml and scenes.yaml.

    A curve file is looked for in ``path``, in the directory above it and in ``fallback``.  Raises
    InputError, one line that names file, key, value and what is right.
    """
    path = Path(path)
    folders = (path, path.parent, Path(fallback))
    scenes = _load_scenes(path / "scenes.yaml")
    yarns, points_of = {}, {}
    for file, base, tree in _entries(path / "yarns.yaml", YARN):
        points_of[base] = []
        for point, label, one in expand(tree, f"{file}: {base}"):
            yarn = YarnInput(file, base, point, label, one, scenes, folders)
            yarns[yarn.name] = yarn
            points_of[base].append((label, yarn))
    fabrics = {}
    for file, base, tree in _entries(path / "fabrics.yaml", FABRIC):
        for point, label, one in expand(tree, f"{file}: {base}"):
            for yarn_label, yarn in _yarns_of(one, f"{file}: {base}", yarns, points_of):
                point_and_yarn = point | (yarn.point if yarn_label else {})
                both = ",".join(part for part in (label, yarn_label) if part)
                fabric = FabricInput(file, base, point_and_yarn, both, one, yarn, scenes, folders)
                fabrics[fabric.name] = fabric
    for fabric in fabrics.values():
        calibrate_on(fabric, fabrics)
    return Study(path, yarns, fabrics, scenes)


def _entries(file, section):
    """(file, name, checked tree) of each entry of a file."""
    seen = {}
    for name, raw in read_yaml(file).items():
        check_name(name, file)
        if name.lower() in seen:
            raise InputError(
                f"{file}: {name}",
                None,
                f"differs from {seen[name.lower()]} by upper and lower case only; must differ "
                "by more, as some file systems take them for one",
            )
        seen[name.lower()] = name
        yield file, name, check_section(section, raw, f"{file}: {name}", section is not SCENE)


def _load_scenes(file):
    scenes = {}
    for _, base, tree in _entries(file, SCENE):
        kinds = {SCENE.section(name).of for name in tree}
        if len(kinds) != 1:
            names = ", ".join(f"{part.name} ({part.of})" for part in SCENE.sections)
            raise InputError(
                f"{file}: {base}",
                None,
                f"must hold tests of either a yarn or a fabric; tests are: {names}",
            )
        scenes[base] = SceneInput(file, base, {}, "", tree)
    return scenes


def _yarns_of(tree, where, yarns, points_of):
    """(label, yarn) of the yarn, or of each point of its sweep, that a fabric's tree names."""
    if "yarn" not in tree:
        return [("", None)]
    name = tree["yarn"].stated[0].value
    if name in points_of:
        return points_of[name]
    if name in yarns:
        return [("", yarns[name])]
    raise InputError(
        f"{where}.yarn", shown(name), f"no such yarn; yarns.yaml has: {', '.join(yarns) or 'none'}"
    )

"""A study: the yarns, fabrics and scenes of one directory, checked and in SI.

>>> study = load_study("config")
>>> cotton = study.fabrics["cotton"]
>>> round(cotton["wale_spacing"] * 1e3, 4), round(cotton.yarn["diameter"] * 1e3, 4)
(1.4993, 0.2793)
>>> cotton.with_value("yarn.diameter_mm", 0.3).yarn["diameter"]
0.0003
"""

import copy
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from knitsim.errors import InputError
from knitsim.study.by_hand import stated_tree, with_signature
from knitsim.study.check import check_name, check_section, shown
from knitsim.study.cross_checks import check_fabric, check_yarn
from knitsim.study.ledger import Ledger, model_assumptions
from knitsim.study.measured_checks import calibrate_on, check_measured
from knitsim.study.resolve import expand
from knitsim.study.resolved import Resolved, SceneInput
from knitsim.study.schema import FABRIC, SCENE, YARN, closure
from knitsim.study.yaml_file import read_yaml
from knitsim.units import from_si


@with_signature(YARN)
class Yarn(Resolved):
    """A yarn: its count, and what else is known of it.

    Keywords are the keys of ``yarns.yaml`` in config/README.md, in the units at the end of their names; a
    count is enough, all else is then assumed and stands in :meth:`assumptions`.  ``yarn["diameter"]`` is the
    SI value of a quantity.  Raises InputError for a key that is not known or a value that makes no sense.

    >>> import knitsim as ks
    >>> yarn = ks.Yarn(count_tex=19.7, friction=0.25, bending_rigidity_N_mm2=2e-3)
    >>> yarn
    <Yarn: 19.7 tex, diameter 0.1657 mm, 11 inputs assumed>
    >>> ks.Yarn(count_tex=19.7, friction=25)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    knitsim.errors.InputError: yarn.friction = 25: must be at least 0 and at most 1 ...
    """

    section = YARN
    parts = ("scene",)

    def __init__(self, *, name: str = "yarn", **keys: Any) -> None:
        tree = stated_tree(YARN, keys, name)
        self._make("", name, {}, "", tree, None, (Path(),))

    @classmethod
    def read(cls, *entry):
        """The yarn of an entry of a study; entry: what :meth:`_make` takes."""
        self = cls.__new__(cls)
        self._make(*entry)
        return self

    def _make(self, file, base, point, label, tree, scenes, folders):
        Resolved.__init__(self, file, base, point, label, tree)
        self.scene = _scene_of(self, scenes, "yarn")
        self._folders = folders
        self._check()

    def _assumed(self):
        rows = len(self._rows)
        return f", {rows} input{'s' * (rows > 1)} assumed" if rows else ""

    def __repr__(self) -> str:
        tex, diameter = 1e6 * self["linear_density"], 1e3 * self["diameter"]
        return f"<Yarn{self._named()}: {tex:.4g} tex, diameter {diameter:.4g} mm{self._assumed()}>"

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
        return Ledger(super().assumptions() + _below("scene", self.scene))

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


@with_signature(FABRIC)
class Fabric(Resolved):
    """A fabric: a yarn, a density and a loop length.

    Keywords are the keys of ``fabrics.yaml`` in config/README.md, in the units at the end of their names.
    The object is what :func:`knitsim.load_study` gives for a fabric of a study.  ``fabric["loop_length"]``
    is the SI value of a quantity, ``fabric.assumptions()`` what nobody stated.  Raises InputError.

    >>> import knitsim as ks
    >>> yarn = ks.Yarn(count_tex=19.7)
    >>> fabric = ks.Fabric(yarn, wales_per_cm=14, courses_per_cm=20, loop_length_mm=2.9)
    >>> fabric
    <Fabric: 14 wales and 20 courses per cm, loop length 2.9 mm, tightness factor 15.3, yarn of 19.7 tex>
    >>> round(1e3 * fabric["wale_spacing"], 4)
    0.7143
    """

    section = FABRIC
    parts = ("yarn", "scene")
    calibrated_on = None  # the fabric whose calibrations it takes

    def __init__(self, yarn: Yarn, *, name: str = "fabric", **keys: Any) -> None:
        if not isinstance(yarn, Yarn):
            raise InputError(f"{name}.yarn", shown(yarn), "must be a knitsim.Yarn")
        tree = stated_tree(FABRIC, {**keys, "yarn": yarn.base}, name)
        self._make("", name, {}, "", tree, yarn, None, (Path(),))

    @classmethod
    def read(cls, *entry):
        """The fabric of an entry of a study; entry: what :meth:`_make` takes."""
        self = cls.__new__(cls)
        self._make(*entry)
        return self

    def _make(self, file, base, point, label, tree, yarn, scenes, folders):
        self.yarn = yarn
        Resolved.__init__(self, file, base, point, label, tree)
        self.scene = _scene_of(self, scenes, "fabric").for_pattern(self["pattern"])
        self._folders = folders
        self._check()
        check_measured(self)

    def _beside(self):
        return {} if self.yarn is None else {"linear_density": self.yarn["linear_density"]}

    def __repr__(self) -> str:
        pattern = "" if self["pattern"] == "jersey" else f"{self['pattern']}, "
        density = [
            f"{0.01 / self[f'{one}_spacing']:.4g} {one}s"
            for one in ("wale", "course")
            if self[f"{one}_spacing"] is not None
        ]
        density = f"{' and '.join(density)} per cm, " if density else ""
        return (
            f"<Fabric{self._named()}: {pattern}{density}loop length {1e3 * self['loop_length']:.4g} mm, "
            f"tightness factor {self.tightness_factor:.3g}, "
            f"yarn of {1e6 * self.yarn['linear_density']:.4g} tex>"
        )

    def _check(self):
        check_fabric(self)

    @property
    def tightness_factor(self):
        """sqrt(tex) over the loop length in cm: of plain fabrics 9 (open) to 19 (tight)."""
        return math.sqrt(from_si(self.yarn["linear_density"], "tex")) / (1e2 * self["loop_length"])

    @property
    def stated_spacings(self):
        """(wale, course) spacing (m); None where nobody stated it: what follows from an assumption is no
        density that a fabric at rest could be compared with."""
        return tuple(
            self[name] if self.is_stated(name) else None
            for name in ("wale_spacing", "course_spacing")
        )

    def with_rest(self, **keys):
        """A copy whose scene has these keys of equilibrium_rest, and what it stated of it before."""
        other = copy.copy(self)
        if self.scene["equilibrium_rest"] is None:
            other.scene = self.scene.with_tests()
        if "points" in keys and "accuracy" in keys:
            raise InputError(
                "relax.accuracy", keys["accuracy"], "chooses what points states; keep one of them"
            )
        for key, value in keys.items():
            other.scene = other.scene.with_value(f"equilibrium_rest.{key}", value)
        other._check()
        return other

    def with_tests(self, **tests):
        """A copy whose scene has these tests, {section of scenes.yaml: what it states}, and no others."""
        other = copy.copy(self)
        other.scene = self.scene.with_tests(**tests)
        other._check()
        return other

    def measured_paths(self, name):
        """Paths of the measured curve ``name``.  Raises InputError for a missing file."""
        return _files(self, f"measured.{name}")

    def assumptions(self):
        return Ledger(
            super().assumptions()
            + [_moved("yarn", row) for row in self.yarn._rows]
            + _below("scene", self.scene)
        )

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
        key = resolved.where(f"{section}.file{'s' * (one is None)}")
        # What a study names lies in it, so that it can be sent, and shows no other file.
        if resolved.file and (Path(file).is_absolute() or ".." in Path(file).parts):
            raise InputError(
                key,
                shown(file),
                "must lie in the study, named from there: without .. and not absolute",
            )
        at = next(
            (folder / file for folder in resolved._folders if (folder / file).is_file()), None
        )
        if at is None:
            looked = dict.fromkeys(folder.as_posix() for folder in resolved._folders)
            looked = ", ".join("the study" if folder == "." else folder for folder in looked)
            raise InputError(key, shown(file), f"no such file in {looked}")
        found.append(at)
    return found


def _moved(part, row):
    return replace(row, path=f"{part}.{row.path}")


def _below(part, resolved):
    return [_moved(part, row) for row in resolved.assumptions()]


def _scene_of(resolved, scenes, of):
    if scenes is None:
        return SceneInput.by_default(of)
    name = resolved["scene"]
    known = [scene.name for scene in scenes.values() if scene.of == of]
    if name not in known:
        right = f"is a scene of a {scenes[name].of}" if name in scenes else "no such scene"
        if not resolved.states("scene"):
            right = f"is what is taken where nothing is stated, and {right}"
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

    def __repr__(self) -> str:
        return f"<Study {self.path}: {len(self.yarns)} yarns, {len(self.fabrics)} fabrics>"

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
            yarn = Yarn.read(file, base, point, label, one, scenes, folders)
            yarns[yarn.name] = yarn
            points_of[base].append((label, yarn))
    fabrics = {}
    for file, base, tree in _entries(path / "fabrics.yaml", FABRIC):
        for point, label, one in expand(tree, f"{file}: {base}"):
            for yarn_label, yarn in _yarns_of(one, f"{file}: {base}", yarns, points_of):
                point_and_yarn = point | (yarn.point if yarn_label else {})
                both = ",".join(part for part in (label, yarn_label) if part)
                fabric = Fabric.read(file, base, point_and_yarn, both, one, yarn, scenes, folders)
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

"""What the workflow makes for a study: which jobs there are, and which files each of them makes.

Built once when the Snakefile is read, so that no list of files is made again for a rule or a job.
Nothing heavy is imported here.
"""

import functools
import hashlib
import json

from knitsim.figures import catalogue
from knitsim.stages.needs import skips_of
from knitsim.store.results import RESULTS, path_of
from knitsim.study.measured_checks import config_of, names_of

# Stages that one job does, one after the other, each for one fabric.
JOBS = {
    "kinematic": ("loop", "kinematic_tension", "kinematic_bending"),
    "equilibrium": (
        "equilibrium_rest", "equilibrium_tension", "equilibrium_bending", "equilibrium_shear",
    ),
    "yarn_to_fabric": ("yarn_to_fabric",),
    "sensitivity": ("sensitivity",),
}  # fmt: skip
KES_KINDS = ("tensile", "bending", "shear")
KES = "kes"
MEASURED_GROUP = "measured"


def digest_of(data):
    """Hash (16 hex digits) of plain data."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]


def _tests_of(fabric, stages):
    """(stage, direction) of what a FabricInput needs of ``stages``; direction "" where there is none."""
    found = []
    for stage in stages:
        if stage == "loop":
            found += [(stage, "")] if fabric.scene.needs_loop else []
            continue
        scene = fabric.scene.values.get(stage)
        if scene is not None:
            directions = scene["directions"] if RESULTS[stage].has_direction else [""]
            found += [(stage, direction) for direction in directions]
    return tuple(found)


def path(test, **labels):
    """Path of the result file of a (stage, direction); labels that are not given stay wildcards."""
    stage, direction = test
    return path_of(stage, **labels, **({"direction": direction} if direction else {}))


def _grouped(keys):
    """{key: [names]} of a mapping of names to keys."""
    found = {}
    for name, key in keys.items():
        found.setdefault(key, []).append(name)
    return found


class Plan:
    """The files of a Study.  Paths are below the root of the store."""

    def __init__(self, study):
        self.study = study
        self.tests = {
            job: {name: _tests_of(fabric, stages) for name, fabric in study.fabrics.items()}
            for job, stages in JOBS.items()
        }
        # {fabric: the files of its tests}
        self.files = {
            name: [
                path(test, fabric=name) for job in JOBS for test in self.tests[job][name]
            ]
            for name in study.fabrics
        }  # fmt: skip
        self.with_kes = [name for name in study.fabrics if self.of_kinds(name, KES_KINDS)]
        self.measured = [name for name, fabric in study.fabrics.items() if names_of(fabric)]

    def shapes(self, job):
        """[(tests, fabrics)]: the fabrics that need the same tests of one of JOBS."""
        return [(key, names) for key, names in _grouped(self.tests[job]).items() if key]

    def of_kinds(self, fabric, kinds):
        """The files of a fabric's tests of these kinds."""
        return [
            path(test, fabric=fabric)
            for job in JOBS
            for test in self.tests[job][fabric]
            if RESULTS[test[0]].kind in kinds
        ]

    @functools.cache  # noqa: B019, one plan lives as long as the process
    def inputs(self, job, fabric):
        """Hash of what the results of a job depend on: a change of anything else reruns nothing."""
        stages = dict.fromkeys(stage for stage, _ in self.tests[job][fabric])
        return digest_of([self.study.fabrics[fabric].config(stage) for stage in stages])

    def yarn_inputs(self, yarn):
        """The same of a yarn."""
        return digest_of(self.study.yarns[yarn].config("yarn"))

    def calibration_inputs(self, fabric, name):
        """The same of one calibration of a fabric."""
        return digest_of(config_of(self.study.fabrics[fabric], name))

    def curves(self, fabric):
        """Paths of the measured curves of a fabric."""
        one = self.study.fabrics[fabric]
        return [path for name in one["measured"] for path in one.measured_paths(name)]

    def calibrated(self, fabric, on_request=False):
        """Result files of a fabric's calibrations; on_request None: of all of them."""
        return [
            path_of("calibration", fabric=fabric, calibration=name)
            for name in names_of(self.study.fabrics[fabric], on_request)
        ]

    def skipping(self):
        """(fabrics, inputs, skips): the first fabric of each scene that has an equilibrium test, and all
        whose loop may be one that cannot be drawn."""
        first = {}
        for name, fabric in self.study.fabrics.items():
            if fabric.scene["equilibrium_tension"] is not None:
                first.setdefault(fabric.scene.name, name)
        measured = list(first.values())
        looped = [name for name, fabric in self.study.fabrics.items() if fabric.scene.needs_loop]
        fabrics = list(dict.fromkeys([*measured, *looped]))
        inputs = [
            digest_of(self.study.fabrics[name].config(stage))
            for name in fabrics
            for stage in ("equilibrium_tension", "yarn", "loop")
        ]
        skips = [str(s) for name in measured for s in skips_of(self.study.fabrics[name].scene)]
        return fabrics, inputs, skips

    def _cycles(self, fabric):
        """Whether a fabric is pulled more than once in some condition."""
        test = self.study.fabrics[fabric].scene["equilibrium_tension"]
        return test is not None and any(one["cycles"] > 1 for one in test["variants"].values())

    def drawings(self):
        """[Drawing] of all figures of yarns and fabrics, by group; those of measured curves excepted."""
        subjects = {"yarn": list(self.study.yarns), "fabric": list(self.study.fabrics)}
        made = {path_of("yarn", yarn=yarn) for yarn in self.study.yarns}
        made.update(file for files in self.files.values() for file in files)
        made.update(path_of(KES, fabric=fabric) for fabric in self.with_kes)
        found = []
        for of, names in subjects.items():
            have = {
                name: tuple(
                    argument
                    for argument, file in catalogue.files_of(of, name).items()
                    if file in made
                )
                + ((catalogue.CYCLES,) if of == "fabric" and self._cycles(name) else ())
                for name in names
            }
            for group in catalogue.GROUPS:
                if group == MEASURED_GROUP:
                    continue
                keys = {name: (name == names[0], have[name]) for name in names}
                for (plain, available), drawn in _grouped(keys).items():
                    figures = catalogue.drawable(group, of, available)
                    if figures:
                        number = sum(one.group == group for one in found)
                        found.append(Drawing(group, of, figures, available, drawn, plain, number))
        return found


class Drawing:
    """The figures of one group of those yarns or fabrics that have the same files.

    group: of the catalogue; of: "yarn" or "fabric"; names: the yarns or fabrics; plain: of the first of
    the study, whose figures carry the plain names; number: of those of the group, from 0.
    """

    def __init__(self, group, of, figures, available, names, plain, number):
        self.group, self.of, self.figures, self.names, self.plain = group, of, figures, names, plain
        self.number = number
        used = {name for figure in figures for name in (*figure.needs, *figure.takes)}
        self.arguments = [name for name in available if name in used]

    @property
    def suffix(self):
        return "" if self.plain else f"_{{{self.of}}}"

    def inputs(self, name=None):
        """{argument: path} of a yarn or fabric; of the first for the plain names."""
        files = catalogue.files_of(self.of, self.names[0] if name is None else name)
        return {argument: files[argument] for argument in self.arguments}

    def outputs(self, name=None):
        """Paths of the figures, with a wildcard unless they are plain or the name is given."""
        suffix = self.suffix if name is None or self.plain else f"_{name}"
        return [
            f"figures/{figure.name}{suffix}.{kind}"
            for figure in self.figures
            for kind in ("png", "svg")
        ]

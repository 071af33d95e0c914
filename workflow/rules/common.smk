# The study, checked before any rule; what the results of each rule depend on.

import hashlib
import json
import os
import re
import sys
from pathlib import Path

from knitsim.study.measured_checks import config_of, inferred_of, names_of
from knitsim.study.study import load_study
from knitsim.errors import InputError
from knitsim.figures import catalogue
from knitsim.files import cache_root
from knitsim.provenance import kernel_hash, source_hash
from knitsim.stages.compile import marker
from knitsim.stages.needs import skips_of
from knitsim.store.results import RESULTS, path_of

# One thread a job: -c says how many jobs run side by side.
for library in ("OMP", "MKL", "OPENBLAS", "NUMBA"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

# Of the campaigns: which random cases, and how many.
SAMPLE = {key: config[key] for key in ("seed", "cases") if key in config}
for key, value in config.items():
    if key not in ("study", "results", "seed", "cases"):
        sys.exit(
            f"knitsim: --config {key} = {value}: must be study=DIR, results=DIR, seed=NUMBER or "
            "cases=NUMBER"
        )
for key, value in SAMPLE.items():
    if type(value) is not int or value < 1:
        sys.exit(f"knitsim: --config {key} = {value}: must be a whole number above 0")
config.setdefault("study", "config")
config.setdefault("results", "results")
STORE = Path(config["results"])


def checked_study(path):
    """The study, with every loop and yarn known to exist.

    That check imports the models, so a study that has passed is remembered by its hash.
    """
    study = load_study(path)
    digest = hashlib.sha256(source_hash("knitsim.stages.check").encode())
    for file in study.files:
        digest.update(file.read_bytes())
    passed = cache_root() / "checked" / digest.hexdigest()[:32]
    if not passed.exists():
        from knitsim.stages.check import check_study

        check_study(study)
        passed.parent.mkdir(parents=True, exist_ok=True)
        passed.touch()
    return study


try:
    STUDY = checked_study(config["study"])
except InputError as error:
    sys.exit(f"knitsim: {error}")

MEASURED_FABRICS = [name for name, fabric in STUDY.fabrics.items() if names_of(fabric)]
# Longest compilation first.
PARTS = ("equilibrium", "figures", "yarn", "fabric")
# The chain through the equilibrium tests is the longest: first, but after its own compilation.
EQUILIBRIUM_PRIORITY = 1 if marker("equilibrium").exists() else -1
# The stages that are tests of a scene of a fabric, by the name of its section.
TESTS = [stage for stage in RESULTS if any(stage in f.scene.values for f in STUDY.fabrics.values())]
# Those that have KES parameters.
KES_KINDS = ("tensile", "bending", "shear")


def results(pattern):
    return (STORE / pattern).as_posix()


def log_of(name):
    return results(f"benchmark/logs/{name}.log")


def timings_of(name):
    return results(f"benchmark/stages/{name}.csv")


def digest_of(data):
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]


def inputs_of(group, name, stage):
    """Hash of what a stage's result depends on: a change of anything else reruns nothing."""
    return digest_of(getattr(STUDY, group)[name].config(stage))


def result_of(stage, **labels):
    """Path of the files of a stage; labels that are not given stay wildcards."""
    return results(path_of(stage, **labels))


def fabrics_with(test):
    return [name for name, fabric in STUDY.fabrics.items() if fabric.scene[test] is not None]


FABRICS_WITH_LOOP = [name for name, fabric in STUDY.fabrics.items() if fabric.scene.needs_loop]


def wildcards_of(stage, fabric):
    """The wildcards, a dict each, of the jobs of a test of a fabric."""
    scene = STUDY.fabrics[fabric].scene[stage]
    if scene is None:
        return []
    if not RESULTS[stage].has_direction:
        return [{"fabric": fabric}]
    return [{"fabric": fabric, "direction": direction} for direction in scene["directions"]]


def yarn_of(wildcards):
    return result_of("yarn", yarn=STUDY.fabrics[wildcards.fabric].yarn.name)


def compression_of(wildcards):
    return STUDY.fabrics[wildcards.fabric].yarn.compression_paths


def yarn_files():
    return [result_of("yarn", yarn=yarn) for yarn in STUDY.yarns]


def loop_files():
    return [result_of("loop", fabric=fabric) for fabric in FABRICS_WITH_LOOP]


def tests_of(fabric, kinds=None):
    """The result files of the tests of a fabric; kinds: of these only."""
    return [
        result_of(stage, **wildcards)
        for stage in TESTS
        if kinds is None or RESULTS[stage].kind in kinds
        for wildcards in wildcards_of(stage, fabric)
    ]


def fabric_files():
    return loop_files() + [file for fabric in STUDY.fabrics for file in tests_of(fabric)]


FABRICS_WITH_KES = [fabric for fabric in STUDY.fabrics if tests_of(fabric, KES_KINDS)]


def kes_files():
    return [result_of("kes", fabric=fabric) for fabric in FABRICS_WITH_KES]


def one_of_each_scene():
    """Names of the fabrics that are the first with their scene and have an equilibrium test."""
    found = {}
    for name in fabrics_with("equilibrium_tension"):
        found.setdefault(STUDY.fabrics[name].scene.name, name)
    return list(found.values())


def skips_of_fabric(fabric):
    return skips_of(STUDY.fabrics[fabric].scene)


def calibrated(fabric, on_request=False):
    """Result files of a fabric's calibrations; on_request None: of all of them."""
    return [
        result_of("calibration", fabric=fabric, calibration=name)
        for name in names_of(STUDY.fabrics[fabric], on_request)
    ]


def measured_curves(wildcards):
    fabric = STUDY.fabrics[wildcards.fabric]
    return [path for name in fabric["measured"] for path in fabric.measured_paths(name)]


def drawn(figures, suffix):
    """The files of figures of the catalogue."""
    return [
        results(f"figures/{figure.name}{suffix}.{kind}")
        for figure in figures
        for kind in ("png", "svg")
    ]


def output_files():
    verified = [*rules.verification.output, *rules.figures_verification.output]
    vtk = expand(rules.vtk.output.directory, fabric=STUDY.fabrics)
    benchmark = [*rules.skipping.output, *rules.benchmark_quick.output]
    return [*rules.tables.output, *kes_files(), *vtk, *FIGURES, *verified, *benchmark]


wildcard_constraints:
    yarn="|".join(map(re.escape, STUDY.yarns)),
    fabric="|".join(map(re.escape, STUDY.fabrics)),
    direction="course|wale",


localrules:
    all,

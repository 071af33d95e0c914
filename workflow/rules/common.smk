# The study, checked before any rule; what the results of each rule depend on.

import hashlib
import json
import os
import re
import sys
from pathlib import Path

from knitsim.study.measured_checks import config_of, names_of
from knitsim.study.study import load_study
from knitsim.errors import InputError
from knitsim.figures import catalogue
from knitsim.files import cache_root
from knitsim.provenance import kernel_hash, source_hash
from knitsim.stages.compile import marker
from knitsim.stages.needs import skips_of

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
RESULTS = Path(config["results"])


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
MEASURED_FIGURES = ("fig30_calibration", "fig31_prediction", "fig32_misfit_profile")
# Longest compilation first.
PARTS = ("equilibrium", "figures", "yarn", "fabric")
# The chain through the equilibrium tests is the longest: first, but after its own compilation.
EQUILIBRIUM_PRIORITY = 1 if marker("equilibrium").exists() else -1
UNDIRECTED_TESTS = ("equilibrium_rest", "equilibrium_shear", "yarn_to_fabric", "sensitivity")
FABRIC_TESTS = (
    "kinematic_tension", "kinematic_bending", "equilibrium_tension", "equilibrium_bending"
)


def results(pattern):
    return (RESULTS / pattern).as_posix()


def log_of(name):
    return results(f"benchmark/logs/{name}.log")


def timings_of(name):
    return results(f"benchmark/stages/{name}.csv")


def digest_of(data):
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]


def inputs_of(group, name, stage):
    """Hash of what a stage's result depends on: a change of anything else reruns nothing."""
    return digest_of(getattr(STUDY, group)[name].config(stage))


def fabrics_with(test):
    return [name for name, fabric in STUDY.fabrics.items() if fabric.scene[test] is not None]


FABRICS_WITH_LOOP = [name for name, fabric in STUDY.fabrics.items() if fabric.scene.needs_loop]


def directions(fabric, test):
    return STUDY.fabrics[fabric].scene[test]["directions"]


def yarn_of(wildcards):
    return results(f"yarn/{STUDY.fabrics[wildcards.fabric].yarn.name}.nc")


def compression_of(wildcards):
    return STUDY.fabrics[wildcards.fabric].yarn.compression_paths


def yarn_files():
    return expand(rules.yarn.output.result, yarn=STUDY.yarns)


def fabric_files():
    files = expand(rules.loop.output.result, fabric=FABRICS_WITH_LOOP)
    for test in UNDIRECTED_TESTS:
        files += expand(getattr(rules, test).output.result, fabric=fabrics_with(test))
    for test in FABRIC_TESTS:
        for fabric in fabrics_with(test):
            files += expand(
                getattr(rules, test).output.result,
                fabric=fabric,
                direction=directions(fabric, test),
            )
    return files


def tests_of(wildcards):
    """The result files of the tests of a fabric that have a direction."""
    fabric = wildcards.fabric
    return [
        path
        for test in FABRIC_TESTS
        if fabric in fabrics_with(test)
        for path in expand(
            getattr(rules, test).output.result, fabric=fabric, direction=directions(fabric, test)
        )
    ]


# Tests that have KES parameters.
KES_TESTS = {*FABRIC_TESTS, "equilibrium_shear"}
FABRICS_WITH_KES = [
    name
    for name, fabric in STUDY.fabrics.items()
    if any(fabric.scene[test] is not None for test in KES_TESTS)
]


def kes_tests_of(wildcards):
    shear = "equilibrium_shear" if wildcards.fabric in fabrics_with("equilibrium_shear") else None
    return tests_of(wildcards) + (
        expand(getattr(rules, shear).output.result, fabric=wildcards.fabric) if shear else []
    )


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
        results(f"measured/{fabric}/{name}.nc")
        for name in names_of(STUDY.fabrics[fabric], on_request)
    ]


def measured_curves(wildcards):
    fabric = STUDY.fabrics[wildcards.fabric]
    return [path for name in fabric["measured"] for path in fabric.measured_paths(name)]


def figures_of(fabric, target, on_request):
    """{figure: stem of its files}; the first measured fabric carries the plain names."""
    suffix = f"_{fabric}" if MEASURED_FABRICS.index(fabric) else ""
    fits = len(names_of(STUDY.fabrics[fabric], on_request)) > 1
    names = MEASURED_FIGURES if fits else MEASURED_FIGURES[:-1]
    return {name: results(f"figures/{name}{suffix}{target}") for name in names}


def drawn(stems):
    return [f"{stem}.{kind}" for stem in stems.values() for kind in ("png", "svg")]


def output_files():
    vtk = expand(rules.vtk.output.directory, fabric=STUDY.fabrics)
    kes = expand(rules.kes.output.result, fabric=FABRICS_WITH_KES)
    verified = [*rules.verification.output, *rules.figures_verification.output]
    verified += rules.skipping.output
    verified += rules.benchmark_quick.output
    return [*rules.tables.output, *kes, *vtk, *FIGURES, *verified]


wildcard_constraints:
    yarn="|".join(map(re.escape, STUDY.yarns)),
    fabric="|".join(map(re.escape, STUDY.fabrics)),
    direction="course|wale",


localrules:
    all,

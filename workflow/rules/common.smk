# The study, checked before any rule; what the results of each rule depend on.

import hashlib
import os
import re
import sys
from pathlib import Path
from types import SimpleNamespace

from knitsim.command import show
from knitsim.errors import InputError
from knitsim.figures import catalogue
from knitsim.files import cache_root, is_whole
from knitsim.provenance import kernel_hash, source_hash
from knitsim.stages.compile import marker
from knitsim.stages.job import kept_study
from knitsim.stages.plan import JOBS, KES_KINDS, Plan, digest_of
from knitsim.stages.plan import path as plan_path
from knitsim.store.results import RESULTS, path_of
from knitsim.study import kept
from knitsim.study.measured_checks import config_of, inferred_of, names_of
from knitsim.study.study import load_study

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
for key, default in (("study", "config"), ("results", "results")):
    config.setdefault(key, default)
    if isinstance(config[key], (list, dict)) or config[key] in (None, ""):
        sys.exit(f"knitsim: --config {key} = {config[key]}: must be {key}=DIR")
    # A directory named 2024 comes as a number.
    config[key] = str(config[key])
STORE = Path(config["results"])
if Path(config["study"]).is_absolute():
    config["study"] = os.path.relpath(config["study"])


def read_study():
    """(study, content of its files by path, their hash), all as they were at one moment."""
    while True:
        before = kept.stamps(config["study"])
        study = load_study(config["study"])
        contents = {file: file.read_bytes() for file in study.files}
        if before == kept.stamps(config["study"]):
            hashes = [[str(f), hashlib.sha256(c).hexdigest()] for f, c in contents.items()]
            return study, contents, digest_of(hashes)


def checked(study, digest):
    """The study, with every loop and yarn known to exist.

    That check imports the models, so a study that has passed is remembered by its hash.
    """
    passed = cache_root() / "checked" / f"{digest}-{source_hash('knitsim.stages.check')}"
    if not passed.exists():
        from knitsim.stages.check import check_study

        check_study(study)
        passed.parent.mkdir(parents=True, exist_ok=True)
        passed.touch()
    return study


KEPT = STORE / "study"
# A job on another machine reads this file again: it goes by what the run has kept.
running = None if workflow.is_main_process else kept.running(KEPT)
try:
    if running is None:
        STUDY, CONTENTS, DIGEST = read_study()
        config["kept"] = str(kept.folder_of(STUDY, KEPT, DIGEST))
        checked(STUDY, DIGEST)
    else:
        config["kept"] = str(running)
        with kept_study(SimpleNamespace(config=config)) as STUDY:
            pass
except InputError as error:
    sys.exit(f"knitsim: {error}")

PLAN = Plan(STUDY)
# Longest compilation first.
PARTS = ("equilibrium", "figures", "yarn", "fabric")
# The chain through the equilibrium tests is the longest: first, but after its own compilation.
EQUILIBRIUM_PRIORITY = 1 if marker("equilibrium").exists() else -1


def results(pattern):
    return (STORE / pattern).as_posix()


def log_of(name):
    return results(f"benchmark/logs/{name}.log")


def timings_of(name):
    return results(f"benchmark/stages/{name}.csv")


def result_of(stage, **labels):
    """Path of the files of a stage; labels that are not given stay wildcards."""
    return results(path_of(stage, **labels))


def one_of(names):
    """A wildcard's constraint: one of these names."""
    return "|".join(map(re.escape, names)) or "(?!)"


def yarn_of(wildcards):
    return result_of("yarn", yarn=STUDY.fabrics[wildcards.fabric].yarn.name)


def compression_of(wildcards):
    return STUDY.fabrics[wildcards.fabric].yarn.compression_paths


def curves_of(wildcards):
    return PLAN.curves(wildcards.fabric)


# Every file that is made by default, once.
YARN_FILES = [result_of("yarn", yarn=yarn) for yarn in STUDY.yarns]
TEST_FILES = [results(file) for files in PLAN.files.values() for file in files]
KES_FILES = [result_of("kes", fabric=fabric) for fabric in PLAN.with_kes]
# Filled by the rules that make them.
TIMINGS, FIGURES, TABLES, OTHERS = [], [], [], []

# What was cut short from outside, by a full disk or a copy, is made again.
CALIBRATED = [results(f) for name in PLAN.measured for f in PLAN.calibrated(name, None)]
for file in [*YARN_FILES, *TEST_FILES, *KES_FILES, *CALIBRATED, result_of("verification")]:
    if os.path.exists(file) and not is_whole(file):
        print(f"knitsim: {file} is cut short: it is made again", file=sys.stderr)
        os.unlink(file)


wildcard_constraints:
    yarn="|".join(map(re.escape, STUDY.yarns)),
    fabric="|".join(map(re.escape, STUDY.fabrics)),
    direction="course|wale",


onstart:
    kept.keep(CONTENTS, Path(config["kept"]), KEPT, DIGEST)


localrules:
    all,

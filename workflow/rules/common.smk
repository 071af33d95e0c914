# The study, checked before any rule; what the results of each rule depend on.

import hashlib
import json
import os
import re
import sys
from pathlib import Path

from knitsim.configuration.study import load_study
from knitsim.errors import InputError
from knitsim.files import cache_root
from knitsim.provenance import kernel_hash, source_hash

# One thread a job: -c says how many jobs run side by side.
for library in ("OMP", "MKL", "OPENBLAS", "NUMBA"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

for key, value in config.items():
    if key not in ("study", "results"):
        sys.exit(f"knitsim: --config {key} = {value}: must be study=DIR or results=DIR")
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


def results(pattern):
    return (RESULTS / pattern).as_posix()


def log_of(name):
    return results(f"benchmark/logs/{name}.log")


def timings_of(name):
    return results(f"benchmark/stages/{name}.csv")


def compiled(part):
    # Ancient: results do not depend on when the kernels were compiled.
    return ancient(timings_of(f"compile_{part}"))


def inputs_of(group, name, stage):
    """What a stage's result depends on, as one line: a change of anything else reruns nothing."""
    return json.dumps(getattr(STUDY, group)[name].config(stage), sort_keys=True)


def fabrics_with(test):
    return [name for name, fabric in STUDY.fabrics.items() if fabric.scene[test] is not None]


def directions(fabric, test):
    return STUDY.fabrics[fabric].scene[test]["directions"]


wildcard_constraints:
    yarn="|".join(map(re.escape, STUDY.yarns)),
    fabric="|".join(map(re.escape, STUDY.fabrics)),
    direction="course|wale",


localrules:
    all,


# Kernels are compiled once, before jobs side by side would all compile them.
rule compile:
    output:
        timings=timings_of("compile_{part}"),
    log:
        log_of("compile_{part}"),
    params:
        kernels=kernel_hash(),
        small=(Path(workflow.basedir) / "config/small").as_posix(),
    wildcard_constraints:
        part="yarn|fabric|figures",
    script:
        "../scripts/compile.py"

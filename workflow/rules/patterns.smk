# One yarn in four patterns, calibrated on the curves of its jersey alone: snakemake -c2 patterns.

from knitsim.stages.patterns import ordered as patterns_of
from knitsim.stages.patterns import paths as pattern_paths

PATTERN_STUDY = Path(workflow.basedir) / "config/patterns"
PATTERNS = patterns_of(load_study(PATTERN_STUDY, Path(workflow.basedir) / "config"))
PATTERN_FILES = {
    kind: [results(pattern_paths(fabric)[place]) for fabric in PATTERNS]
    for place, kind in enumerate(("rest", "course", "wale", "predicted"))
}


# One job, so that the fit, which takes longest, is made once.
rule patterns_solved:
    input:
        [path for one in PATTERNS for name in one["measured"] for path in one.measured_paths(name)],
    output:
        [results(path) for fabric in PATTERNS for path in pattern_paths(fabric)],
    log:
        log_of("patterns_solved"),
    params:
        study=PATTERN_STUDY.as_posix(),
        inputs=[digest_of(config_of(fabric, "both")) for fabric in PATTERNS],
        source=source_hash("knitsim.stages.patterns"),
    resources:
        mem_mb=1500,
        runtime=120,
    script:
        "../scripts/patterns.py"


rule patterns:
    input:
        **PATTERN_FILES,
    output:
        [
            results(f"figures/{name}.{kind}")
            for name in ("fig40_patterns_at_rest", "fig41_patterns_pulled", "fig42_patterns_curves")
            for kind in ("png", "svg")
        ],
    log:
        log_of("patterns"),
    params:
        source=source_hash("knitsim.figures.patterns"),
    resources:
        mem_mb=1500,
        runtime=10,
    script:
        "../scripts/pattern_figures.py"

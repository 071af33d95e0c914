# One yarn in four patterns, calibrated on the curves of its jersey alone: snakemake -c2 patterns.

from knitsim.stages.patterns import paths as pattern_paths

PATTERN_STUDY = Path(workflow.basedir) / "config/patterns"
PATTERNS = load_study(PATTERN_STUDY, Path(workflow.basedir) / "config").fabrics
PATTERN_FILES = {
    kind: [results(pattern_paths(fabric)[place]) for fabric in PATTERNS.values()]
    for place, kind in enumerate(("rest", "course", "wale", "predicted"))
}


for fabric in PATTERNS.values():

    rule:
        name:
            f"pattern_{fabric.name}"
        input:
            [path for name in fabric["measured"] for path in fabric.measured_paths(name)],
        output:
            [results(path) for path in pattern_paths(fabric)],
        log:
            log_of(f"pattern_{fabric.name}"),
        params:
            study=PATTERN_STUDY.as_posix(),
            pattern=fabric.name,
            inputs=digest_of(config_of(fabric, "both")),
            source=source_hash("knitsim.stages.patterns"),
        resources:
            mem_mb=1500,
            runtime=60,
        script:
            "../scripts/pattern.py"


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

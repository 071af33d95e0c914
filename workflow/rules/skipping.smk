# What the scenes do not need, computed with and without: part of the default target.

SKIP_FABRICS, SKIP_INPUTS, SKIPS = PLAN.skipping()


rule skipping:
    output:
        table=results("tables/skipped.csv"),
        times=results("benchmark/skipping.csv"),
    log:
        log_of("skipping"),
    params:
        fabrics=SKIP_FABRICS,
        inputs=SKIP_INPUTS,
        skips=SKIPS,
        source=source_hash("knitsim.stages.skipping"),
    resources:
        mem_mb=1500,
        runtime=30,
    # When the kernels are compiled.
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/skipping.py"

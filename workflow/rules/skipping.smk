# What the scenes do not need, computed with and without: part of the default target.


rule skipping:
    output:
        table=results("tables/skipped.csv"),
    log:
        log_of("skipping"),
    params:
        fabrics=one_of_each_scene(),
        inputs=[
            inputs_of("fabrics", name, stage)
            for name in one_of_each_scene()
            for stage in ("equilibrium_tension", "yarn", "loop")
        ],
        skips=[str(skip) for name in one_of_each_scene() for skip in skips_of_fabric(name)],
        source=source_hash("knitsim.stages.skipping"),
    # When the kernels are compiled.
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/skipping.py"

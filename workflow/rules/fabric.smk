# Fabric: the loop, its tests in both models, and their KES parameters.


rule loop:
    output:
        result=result_of("loop"),
        timings=timings_of("loop_{fabric}"),
    log:
        log_of("loop_{fabric}"),
    params:
        stage="loop",
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "loop"),
        source=source_hash("knitsim.stages.loop"),
    script:
        "../scripts/stage.py"


for stage in TESTS:
    job = f"{stage}_{{fabric}}" + ("_{direction}" if RESULTS[stage].has_direction else "")

    rule:
        name:
            stage
        input:
            yarn=yarn_of,
            # Of the yarn in the equilibrium model.
            compression=compression_of if RESULTS[stage].model == "equilibrium" else [],
        output:
            result=result_of(stage),
            timings=timings_of(job),
        log:
            log_of(job),
        params:
            stage=stage,
            inputs=lambda wildcards, stage=stage: inputs_of("fabrics", wildcards.fabric, stage),
            source=source_hash(f"knitsim.stages.{stage}"),
        # The figures of tension, the longest to draw, wait for the kinematic one.
        priority: {"kinematic_tension": 1, "kinematic_bending": 0}.get(stage, EQUILIBRIUM_PRIORITY)
        script:
            "../scripts/stage.py"


rule kes:
    input:
        lambda wildcards: tests_of(wildcards.fabric, KES_KINDS),
    output:
        result=result_of("kes"),
    log:
        log_of("kes_{fabric}"),
    params:
        source=source_hash("knitsim.stages.kes"),
    script:
        "../scripts/kes.py"

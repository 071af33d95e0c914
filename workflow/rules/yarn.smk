# Yarn: calibration of the tension law, fibres, simulated tensile test.

TIMINGS += [timings_of(f"yarn_{yarn}") for yarn in STUDY.yarns]


rule yarn:
    input:
        curve=lambda wildcards: STUDY.yarns[wildcards.yarn].curve_paths,
    output:
        result=result_of("yarn"),
        timings=timings_of("yarn_{yarn}"),
    log:
        log_of("yarn_{yarn}"),
    params:
        tests=[("yarn", "")],
        inputs=lambda wildcards: PLAN.yarn_inputs(wildcards.yarn),
        source=source_hash("knitsim.stages.several", "knitsim.stages.yarn"),
    resources:
        mem_mb=1500,
        runtime=10,
    # Every test of a fabric waits for its yarn.
    priority: 2
    script:
        "../scripts/stage.py"

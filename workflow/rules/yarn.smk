# Yarn: calibration of the tension law, fibres, simulated tensile test.


rule yarn:
    input:
        curve=lambda wildcards: STUDY.yarns[wildcards.yarn].curve_paths,
    output:
        result=result_of("yarn"),
        timings=timings_of("yarn_{yarn}"),
    log:
        log_of("yarn_{yarn}"),
    params:
        stage="yarn",
        inputs=lambda wildcards: inputs_of("yarns", wildcards.yarn, "yarn"),
        source=source_hash("knitsim.stages.yarn"),
    # Every test of a fabric waits for its yarn.
    priority: 2
    script:
        "../scripts/stage.py"

# Fabric: the loop, and the paper's tests on it.


FABRIC_TESTS = ("kinematic_tension", "kinematic_bending")


def yarn_of(wildcards):
    return results(f"yarn/{STUDY.fabrics[wildcards.fabric].yarn.name}.nc")


rule loop:
    input:
        ready=compiled("fabric"),
    output:
        result=results("loop/{fabric}.nc"),
        timings=timings_of("loop_{fabric}"),
    log:
        log_of("loop_{fabric}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "loop"),
        source=source_hash("knitsim.stages.loop"),
    script:
        "../scripts/loop.py"


rule kinematic_tension:
    input:
        ready=compiled("fabric"),
        yarn=yarn_of,
    output:
        result=results("tensile/{fabric}/kinematic_{direction}.nc"),
        timings=timings_of("kinematic_tension_{fabric}_{direction}"),
    log:
        log_of("kinematic_tension_{fabric}_{direction}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "kinematic_tension"),
        source=source_hash("knitsim.stages.kinematic_tension"),
    script:
        "../scripts/kinematic_test.py"


rule kinematic_bending:
    input:
        ready=compiled("fabric"),
        yarn=yarn_of,
    output:
        result=results("bending/{fabric}/kinematic_{direction}.nc"),
        timings=timings_of("kinematic_bending_{fabric}_{direction}"),
    log:
        log_of("kinematic_bending_{fabric}_{direction}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "kinematic_bending"),
        source=source_hash("knitsim.stages.kinematic_bending"),
    script:
        "../scripts/kinematic_test.py"


def fabric_files():
    files = expand(rules.loop.output.result, fabric=STUDY.fabrics)
    for test in FABRIC_TESTS:
        for fabric in fabrics_with(test):
            files += expand(
                getattr(rules, test).output.result,
                fabric=fabric,
                direction=directions(fabric, test),
            )
    return files

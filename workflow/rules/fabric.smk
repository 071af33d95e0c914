# Fabric: the loop, and the paper's tests on it.


rule loop:
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
        yarn=yarn_of,
    output:
        result=results("tensile/{fabric}/kinematic_{direction}.nc"),
        timings=timings_of("kinematic_tension_{fabric}_{direction}"),
    log:
        log_of("kinematic_tension_{fabric}_{direction}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "kinematic_tension"),
        source=source_hash("knitsim.stages.kinematic_tension"),
    # The figures of tension, the longest to draw, wait for it.
    priority: 1
    script:
        "../scripts/fabric_test.py"


rule kinematic_bending:
    input:
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
        "../scripts/fabric_test.py"


rule equilibrium_rest:
    input:
        yarn=yarn_of,
        compression=compression_of,
    output:
        result=results("relaxed/{fabric}.nc"),
        timings=timings_of("equilibrium_rest_{fabric}"),
    log:
        log_of("equilibrium_rest_{fabric}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "equilibrium_rest"),
        source=source_hash("knitsim.stages.equilibrium_rest"),
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/fabric_test.py"


rule equilibrium_tension:
    input:
        yarn=yarn_of,
        compression=compression_of,
    output:
        result=results("tensile/{fabric}/equilibrium_{direction}.nc"),
        timings=timings_of("equilibrium_tension_{fabric}_{direction}"),
    log:
        log_of("equilibrium_tension_{fabric}_{direction}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "equilibrium_tension"),
        source=source_hash("knitsim.stages.equilibrium_tension"),
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/fabric_test.py"


rule equilibrium_shear:
    input:
        yarn=yarn_of,
        compression=compression_of,
    output:
        result=results("shear/{fabric}/equilibrium.nc"),
        timings=timings_of("equilibrium_shear_{fabric}"),
    log:
        log_of("equilibrium_shear_{fabric}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "equilibrium_shear"),
        source=source_hash("knitsim.stages.equilibrium_shear"),
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/fabric_test.py"


rule equilibrium_bending:
    input:
        yarn=yarn_of,
        compression=compression_of,
    output:
        result=results("bending/{fabric}/equilibrium_{direction}.nc"),
        timings=timings_of("equilibrium_bending_{fabric}_{direction}"),
    log:
        log_of("equilibrium_bending_{fabric}_{direction}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "equilibrium_bending"),
        source=source_hash("knitsim.stages.equilibrium_bending"),
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/fabric_test.py"


rule yarn_to_fabric:
    input:
        yarn=yarn_of,
        compression=compression_of,
    output:
        result=results("yarn_to_fabric/{fabric}.nc"),
        timings=timings_of("yarn_to_fabric_{fabric}"),
    log:
        log_of("yarn_to_fabric_{fabric}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "yarn_to_fabric"),
        source=source_hash("knitsim.stages.yarn_to_fabric"),
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/fabric_test.py"


rule kes:
    input:
        kes_tests_of,
    output:
        result=results("kes/{fabric}.nc"),
    log:
        log_of("kes_{fabric}"),
    params:
        source=source_hash("knitsim.stages.kes"),
    script:
        "../scripts/kes.py"

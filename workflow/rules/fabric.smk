# Fabric: the tests of one model are one job; then what is read from them.
# One rule for the fabrics that need the same tests.

for job in JOBS:
    for number, (tests, fabrics) in enumerate(PLAN.shapes(job)):
        TIMINGS += [timings_of(f"{job}_{fabric}") for fabric in fabrics]

        rule:
            name:
                f"{job}_{number + 1}" if number else job
            input:
                # The loop alone needs no yarn.
                yarn=[] if tests == (("loop", ""),) else yarn_of,
                # Of the yarn in the equilibrium model.
                compression=[] if job == "kinematic" else compression_of,
            output:
                result=[results(plan_path(test)) for test in tests],
                timings=timings_of(f"{job}_{{fabric}}"),
            log:
                log_of(f"{job}_{{fabric}}"),
            params:
                tests=tests,
                inputs=lambda wildcards, job=job: PLAN.inputs(job, wildcards.fabric),
                source=source_hash(
                    "knitsim.stages.several",
                    *(f"knitsim.stages.{stage}" for stage in dict(tests)),
                ),
            wildcard_constraints:
                fabric=one_of(fabrics),
            resources:
                mem_mb=1500,
                runtime=30,
            priority: 0 if job == "kinematic" else EQUILIBRIUM_PRIORITY
            script:
                "../scripts/stage.py"


rule readings:
    input:
        tests=lambda wildcards: [results(f) for f in PLAN.of_kinds(wildcards.fabric, KES_KINDS)],
    output:
        kes=result_of("kes"),
        vtk=directory(results("vtk/{fabric}")),
    log:
        log_of("readings_{fabric}"),
    params:
        source=source_hash("knitsim.stages.kes", "knitsim.stages.vtk_states"),
    wildcard_constraints:
        fabric=one_of(PLAN.with_kes),
    resources:
        mem_mb=1500,
        runtime=10,
    script:
        "../scripts/readings.py"


OTHERS += [results(f"vtk/{fabric}") for fabric in PLAN.with_kes]

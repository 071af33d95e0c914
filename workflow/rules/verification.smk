# The solver against exact answers; depends on the code alone, not on the study.


rule verification:
    output:
        result=result_of("verification"),
        table=results("tables/accuracy.csv"),
        timings=timings_of("verification"),
    log:
        log_of("verification"),
    params:
        source=source_hash("knitsim.stages.verification"),
    # Last, when the long compilation of the equilibrium is done.
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/verification.py"


rule figures_verification:
    input:
        verification=rules.verification.output.result,
    output:
        drawn(catalogue.drawable("verification", "study", ["verification"]), ""),
    log:
        log_of("figures_verification"),
    params:
        group="verification",
        of="study",
        suffix="",
        source=source_hash("knitsim.figures.draw", *catalogue.modules("verification")),
    script:
        "../scripts/figures.py"

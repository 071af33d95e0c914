# The solver against exact answers; depends on the code alone, not on the study.

DRAWN_OF_CASES = [
    results(f"figures/{figure.name}.{kind}")
    for figure in catalogue.drawable("verification", "study", ["verification"])
    for kind in ("png", "svg")
]


rule verification:
    output:
        result=result_of("verification"),
        table=results("tables/accuracy.csv"),
        timings=timings_of("verification"),
    log:
        log_of("verification"),
    params:
        source=source_hash("knitsim.stages.verification"),
    resources:
        mem_mb=1500,
        runtime=30,
    # Last, when the long compilation of the equilibrium is done.
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/verification.py"


rule figures_verification:
    input:
        verification=rules.verification.output.result,
    output:
        DRAWN_OF_CASES,
    log:
        log_of("figures_verification"),
    params:
        suffix="",
        source=source_hash("knitsim.figures.draw", *catalogue.modules("verification")),
    resources:
        mem_mb=1500,
        runtime=10,
    script:
        "../scripts/figures.py"


FIGURES += DRAWN_OF_CASES

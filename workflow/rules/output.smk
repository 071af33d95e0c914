# Figures, tables and the page: all read result files only.

# One rule for the yarns, or fabrics, that have the same files, since what can be drawn depends on them.
# The first yarn and the first fabric carry the plain names.
for drawing in PLAN.drawings():
    for name in drawing.names:
        FIGURES += map(results, drawing.outputs(name))

    rule:
        name:
            f"figures_{drawing.group}{drawing.number or ''}"
        input:
            unpack(
                lambda wildcards, drawing=drawing: {
                    name: results(file)
                    for name, file in drawing.inputs(wildcards.get(drawing.of)).items()
                }
            ),
        output:
            [results(file) for file in drawing.outputs()],
        log:
            log_of(f"figures_{drawing.group}{drawing.suffix or '_first_' + drawing.of}"),
        params:
            suffix=lambda wildcards, drawing=drawing: drawing.suffix.format(**wildcards),
            source=source_hash("knitsim.figures.draw", *catalogue.modules(drawing.group)),
        wildcard_constraints:
            **{drawing.of: one_of(drawing.names)},
        resources:
            mem_mb=1500,
            runtime=10,
        # The longest to draw.
        priority: 2 if drawing.group == "paper" else 0
        script:
            "../scripts/figures.py"


TABLES += [
    results(f"tables/{name}.csv")
    for name in (
        "timing", "assumptions", "corrections", "kes", "curl", "load_extension", "summary",
        *(MEASURED_TABLES if PLAN.measured else ()),
        *(["sensitivity"] if any("sensitivity" in "".join(f) for f in PLAN.files.values()) else ()),
    )
]  # fmt: skip


rule tables:
    input:
        results=[*YARN_FILES, *TEST_FILES],
        kes=KES_FILES,
        measured=MEASURED_FILES[""],
        timings=[timings_of(f"compile_{part}") for part in PARTS]
        + [timings_of("verification"), *TIMINGS],
    output:
        TABLES,
    log:
        log_of("tables"),
    params:
        assumptions=digest_of([row.as_dict() for row in STUDY.assumptions()]),
        source=source_hash("knitsim.stages.all_tables"),
    resources:
        mem_mb=1500,
        runtime=30,
    script:
        "../scripts/tables.py"


rule page:
    input:
        tables=TABLES,
        figures=FIGURES,
        results=[*YARN_FILES, *TEST_FILES, *KES_FILES, *MEASURED_FILES[""]],
        more=[*rules.verification.output, *rules.skipping.output],
    output:
        page=results("index.html"),
    log:
        log_of("page"),
    params:
        assumptions=digest_of([row.as_dict() for row in STUDY.assumptions()]),
        source=source_hash("knitsim.stages.page", "knitsim.figures.catalogue"),
    resources:
        mem_mb=1500,
        runtime=30,
    script:
        "../scripts/page.py"

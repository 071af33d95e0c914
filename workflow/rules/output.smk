# Tables, figures and ParaView files: all read result files only.


rule tables:
    input:
        results=[*yarn_files(), *fabric_files()],
        kes_of_fabrics=kes_files(),
        timings=[
            timings_of(name)
            for name in [
                *(f"compile_{part}" for part in PARTS),
                "verification",
                *MEASURED_STAGES,
                *(f"yarn_{yarn}" for yarn in STUDY.yarns),
                *(f"loop_{fabric}" for fabric in FABRICS_WITH_LOOP),
                *(
                    "_".join([stage, *wildcards.values()])
                    for stage in TESTS
                    for fabric in STUDY.fabrics
                    for wildcards in wildcards_of(stage, fabric)
                ),
            ]
        ],
    output:
        timing=results("tables/timing.csv"),
        assumptions=results("tables/assumptions.csv"),
        corrections=results("tables/corrections.csv"),
        kes=results("tables/kes.csv"),
        curl=results("tables/curl.csv"),
    log:
        log_of("tables"),
    params:
        assumptions=digest_of([row.as_dict() for row in STUDY.assumptions()]),
        source=source_hash("knitsim.stages.tables", "knitsim.stages.kes_table"),
    script:
        "../scripts/tables.py"


rule vtk:
    input:
        results=lambda wildcards: tests_of(wildcards.fabric, ("tensile", "bending")),
    output:
        directory=directory(results("vtk/{fabric}")),
    log:
        log_of("vtk_{fabric}"),
    params:
        source=source_hash("knitsim.stages.vtk_states"),
    script:
        "../scripts/vtk.py"


# One rule for each group of figures and each yarn or fabric, since what can be drawn depends on the
# tests of its scene.  The first yarn and the first fabric carry the plain names.
FIGURES = []
MADE = {*yarn_files(), *fabric_files(), *kes_files()}
for group in catalogue.GROUPS:
    for of, subjects in (("yarn", STUDY.yarns), ("fabric", STUDY.fabrics)):
        for number, subject in enumerate(subjects):
            paths = {name: results(path) for name, path in catalogue.files_of(of, subject).items()}
            files = {name: path for name, path in paths.items() if path in MADE}
            figures = catalogue.drawable(group, of, files)
            if not figures:
                continue
            used = {name for figure in figures for name in (*figure.needs, *figure.takes)}
            suffix = f"_{subject}" if number else ""
            FIGURES += drawn(figures, suffix)

            rule:
                name:
                    f"figures_{group}_{of}_{number}"
                input:
                    **{name: file for name, file in files.items() if name in used},
                output:
                    drawn(figures, suffix),
                log:
                    log_of(f"figures_{group}_{subject}"),
                params:
                    group=group,
                    of=of,
                    suffix=suffix,
                    source=source_hash("knitsim.figures.draw", *catalogue.modules(group)),
                # The longest to draw.
                priority: 2 if group == "tension" else 0
                script:
                    "../scripts/figures.py"

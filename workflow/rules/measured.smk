# Calibrations on measured curves, and what they predict: a job each.  Those that the study marks
# on_request are made by snakemake calibration only.

MEASURED_TABLES = ("calibration", "prediction")
TIMINGS += [
    timings_of(f"measured_{fabric}_{name}")
    for fabric in PLAN.measured
    for name in names_of(STUDY.fabrics[fabric], False)
]


rule measured:
    input:
        yarn=yarn_of,
        compression=compression_of,
        curves=curves_of,
    output:
        result=result_of("calibration"),
        timings=timings_of("measured_{fabric}_{calibration}"),
    log:
        log_of("measured_{fabric}_{calibration}"),
    params:
        tests=lambda wildcards: [("calibration", wildcards.calibration)],
        inputs=lambda wildcards: PLAN.calibration_inputs(wildcards.fabric, wildcards.calibration),
        source=source_hash("knitsim.stages.several", "knitsim.stages.calibration"),
    wildcard_constraints:
        calibration=r"[^/]+",
    resources:
        mem_mb=1500,
        runtime=60,
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/stage.py"


# Figures of the calibrations made by default, and of all of them.
ALL_MEASURED, MEASURED_FILES = [], {"": [], "_all": []}
for target, on_request in (("", False), ("_all", None)) if PLAN.measured else ():
    drawings = []
    for number, fabric in enumerate(PLAN.measured):
        # The first measured fabric carries the plain names.
        fits = PLAN.calibrated(fabric, on_request)
        names = ["measured", "fitted"] if len(fits) > 1 else ["measured"]
        names += ["inferred"] if inferred_of(STUDY.fabrics[fabric], on_request) else []
        figures = catalogue.drawable("measured", "fabric", names)
        suffix = (f"_{fabric}" if number else "") + target
        drawings.append(([results(fit) for fit in fits], names, suffix))
        FIGURES_OF_MEASURED = [
            results(f"figures/{figure.name}{suffix}.{kind}")
            for figure in figures
            for kind in ("png", "svg")
        ]
        (ALL_MEASURED if target else FIGURES).extend(FIGURES_OF_MEASURED)

        rule:
            name:
                f"figures_measured{target}_{number}"
            input:
                **{name: drawings[-1][0] for name in names},
            output:
                FIGURES_OF_MEASURED,
            log:
                log_of(f"figures_measured{target}_{fabric}"),
            params:
                suffix=suffix,
                source=source_hash("knitsim.figures.draw", *catalogue.modules("measured")),
            resources:
                mem_mb=1500,
                runtime=10,
            script:
                "../scripts/figures.py"

    MEASURED_FILES[target] = [fit for fits, _, _ in drawings for fit in fits]


rule measured_tables_all:
    input:
        MEASURED_FILES["_all"],
    output:
        [results(f"tables/{name}_all.csv") for name in MEASURED_TABLES],
    log:
        log_of("measured_tables_all"),
    params:
        source=source_hash("knitsim.stages.calibration_tables"),
    resources:
        mem_mb=1500,
        runtime=10,
    script:
        "../scripts/measured_tables.py"


rule calibration:
    input:
        rules.measured_tables_all.output if PLAN.measured else [],
        ALL_MEASURED,


localrules:
    calibration,

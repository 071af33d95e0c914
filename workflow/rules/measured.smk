# Calibrations on measured curves, and what they predict: a job each.  Those that the study marks
# on_request are made by snakemake calibration only.

MEASURED_TABLES = ("calibration", "prediction")
# Names of the timings of the calibrations that are made by default.
MEASURED_STAGES = [
    f"measured_{fabric}_{name}"
    for fabric in MEASURED_FABRICS
    for name in names_of(STUDY.fabrics[fabric], False)
]


rule measured:
    input:
        yarn=yarn_of,
        compression=compression_of,
        curves=measured_curves,
    output:
        result=result_of("calibration"),
        timings=timings_of("measured_{fabric}_{calibration}"),
    log:
        log_of("measured_{fabric}_{calibration}"),
    params:
        stage="calibration",
        inputs=lambda wildcards: digest_of(
            config_of(STUDY.fabrics[wildcards.fabric], wildcards.calibration)
        ),
        source=source_hash("knitsim.stages.calibration"),
    wildcard_constraints:
        calibration=r"[^/]+",
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/stage.py"


# Tables and figures of the calibrations made by default, and of all of them.
MEASURED_OUTPUT, ALL_MEASURED_FIGURES = [], []
for target, on_request in (("", False), ("_all", None)):
    if not MEASURED_FABRICS:
        break
    tables = [results(f"tables/{name}{target}.csv") for name in MEASURED_TABLES]

    rule:
        name:
            f"measured_tables{target}"
        input:
            [file for fabric in MEASURED_FABRICS for file in calibrated(fabric, on_request)],
        output:
            tables,
        log:
            log_of(f"measured_tables{target}"),
        params:
            source=source_hash("knitsim.stages.calibration_tables"),
        script:
            "../scripts/measured_tables.py"

    MEASURED_OUTPUT += [] if target else tables
    for number, fabric in enumerate(MEASURED_FABRICS):
        # The first measured fabric carries the plain names.
        suffix, fits = (f"_{fabric}" if number else "") + target, calibrated(fabric, on_request)
        names = ["measured", "fitted"] if len(fits) > 1 else ["measured"]
        names += ["inferred"] if inferred_of(STUDY.fabrics[fabric], on_request) else []
        outputs = drawn(catalogue.drawable("measured", "fabric", names), suffix)
        ALL_MEASURED_FIGURES += outputs if target else []
        MEASURED_OUTPUT += [] if target else outputs

        rule:
            name:
                f"figures_measured{target}_{number}"
            input:
                **{name: fits for name in names},
            output:
                outputs,
            log:
                log_of(f"figures_measured{target}_{fabric}"),
            params:
                group="measured",
                of="fabric",
                suffix=suffix,
                source=source_hash("knitsim.figures.draw", *catalogue.modules("measured")),
            script:
                "../scripts/figures.py"


if fabrics_with("sensitivity"):
    MEASURED_OUTPUT.append(results("tables/sensitivity.csv"))

    rule sensitivity_table:
        input:
            [result_of("sensitivity", fabric=fabric) for fabric in fabrics_with("sensitivity")],
        output:
            results("tables/sensitivity.csv"),
        log:
            log_of("sensitivity_table"),
        params:
            source=source_hash("knitsim.stages.sensitivity"),
        script:
            "../scripts/sensitivity_table.py"


rule calibration:
    input:
        [results(f"tables/{name}_all.csv") for name in MEASURED_TABLES] if MEASURED_FABRICS else [],
        ALL_MEASURED_FIGURES,


localrules:
    calibration,

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
        result=results("measured/{fabric}/{calibration}.nc"),
        timings=timings_of("measured_{fabric}_{calibration}"),
    log:
        log_of("measured_{fabric}_{calibration}"),
    params:
        inputs=lambda wildcards: digest_of(
            config_of(STUDY.fabrics[wildcards.fabric], wildcards.calibration)
        ),
        source=source_hash("knitsim.stages.calibration"),
    wildcard_constraints:
        calibration=r"[^/]+",
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/measured.py"


# Tables and figures of the calibrations made by default, and of all of them.
MEASURED_OUTPUT = []
for target, on_request in (("", False), ("_all", None)):
    if not MEASURED_FABRICS:
        break
    tables = [results(f"tables/{name}{target}.csv") for name in MEASURED_TABLES]
    stems = {fabric: figures_of(fabric, target, on_request) for fabric in MEASURED_FABRICS}
    if not target:
        MEASURED_OUTPUT += [*tables, *(file for own in stems.values() for file in drawn(own))]

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

    for fabric in MEASURED_FABRICS:

        rule:
            name:
                f"measured_figures{target}_{MEASURED_FABRICS.index(fabric)}"
            input:
                calibrated(fabric, on_request),
            output:
                drawn(stems[fabric]),
            log:
                log_of(f"measured_figures{target}_{fabric}"),
            params:
                stems=stems[fabric],
                source=source_hash("knitsim.figures.measured"),
            script:
                "../scripts/measured_figures.py"


rule sensitivity:
    input:
        yarn=yarn_of,
        compression=compression_of,
    output:
        result=results("sensitivity/{fabric}.nc"),
        timings=timings_of("sensitivity_{fabric}"),
    log:
        log_of("sensitivity_{fabric}"),
    params:
        inputs=lambda wildcards: inputs_of("fabrics", wildcards.fabric, "sensitivity"),
        source=source_hash("knitsim.stages.sensitivity"),
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/fabric_test.py"


if fabrics_with("sensitivity"):
    MEASURED_OUTPUT.append(results("tables/sensitivity.csv"))

    rule sensitivity_table:
        input:
            expand(rules.sensitivity.output.result, fabric=fabrics_with("sensitivity")),
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
        [file for fabric in MEASURED_FABRICS for file in drawn(figures_of(fabric, "_all", None))],


localrules:
    calibration,

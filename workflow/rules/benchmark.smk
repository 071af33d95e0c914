# Run time against error, comparison with others, scaling.  Depends on the code alone, not on the study.
# A quick version belongs to the default target; the full one is snakemake -c2 benchmark.  All that
# holds run times lies in benchmark/, as it differs from run to run.


rule benchmark_quick:
    input:
        # A run that compiles would be timed as well.
        [timings_of(f"compile_{part}") for part in PARTS],
    output:
        errors=results("benchmark/run_time_against_error.csv"),
        bought=results("benchmark/error_bought.csv"),
        figure=[results(f"benchmark/run_time_against_error.{kind}") for kind in ("png", "svg")],
    log:
        log_of("benchmark_quick"),
    params:
        full=False,
        source=source_hash("knitsim.stages.benchmark", "knitsim.figures.benchmark"),
    resources:
        mem_mb=1500,
        runtime=60,
    script:
        "../scripts/benchmark.py"


rule benchmark_errors:
    input:
        [timings_of(f"compile_{part}") for part in PARTS],
    output:
        errors=results("benchmark/full/run_time_against_error.csv"),
        bought=results("benchmark/full/error_bought.csv"),
        figure=[results(f"benchmark/full/run_time_against_error.{kind}") for kind in ("png", "svg")],
    log:
        log_of("benchmark_errors"),
    params:
        full=True,
        source=source_hash("knitsim.stages.benchmark", "knitsim.figures.benchmark"),
    resources:
        mem_mb=1500,
        runtime=60,
    script:
        "../scripts/benchmark.py"


rule benchmark_rest:
    input:
        compiled=[timings_of(f"compile_{part}") for part in PARTS],
    output:
        comparison=results("benchmark/full/comparison.csv"),
        scaling=results("benchmark/full/scaling.csv"),
        phases=results("benchmark/full/phases.csv"),
    log:
        log_of("benchmark_rest"),
    params:
        snakefile=(Path(workflow.basedir) / "Snakefile").as_posix(),
        source=source_hash("knitsim.stages.benchmark", "knitsim.stages.benchmark_runs"),
    # It runs the workflow on two cores by itself.
    threads: 2
    resources:
        mem_mb=3000,
        runtime=60,
    script:
        "../scripts/benchmark_rest.py"


rule benchmark:
    input:
        rules.benchmark_errors.output,
        rules.benchmark_rest.output,


localrules:
    benchmark,

"""Rules benchmark_quick and benchmark_errors: run time against error, its tables and figure."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.figures import style
    from knitsim.figures.benchmark import read, run_time_against_error
    from knitsim.stages.benchmark import run_errors

    output = snakemake.output
    run_errors(snakemake.params.full, output.errors, output.bought)
    with style.context():
        style.save(run_time_against_error(read(output.errors)), Path(output.errors).with_suffix(""))

"""Rules benchmark_quick and benchmark_errors: run time against error, its tables and figure."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.figures import style
    from knitsim.figures.benchmark import read, run_time_against_error
    from knitsim.figures.catalogue import TABLE_CAPTIONS
    from knitsim.stages.benchmark import run_errors

    output = snakemake.output
    run_errors(snakemake.params.full, output.errors, output.bought)
    with style.context():
        picture = run_time_against_error(read(output.errors))
        style.save(
            picture, Path(output.errors).with_suffix(""), TABLE_CAPTIONS["run_time_against_error"]
        )

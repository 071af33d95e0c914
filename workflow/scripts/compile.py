"""Rule compile: compile the kernels of one part of the workflow."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.configuration.study import load_study
    from knitsim.stages.compile import run

    study = load_study(snakemake.params.small, fallback=snakemake.params.small)
    run(snakemake.params.part, study).write(snakemake.output.timings)

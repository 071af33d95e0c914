"""Rule compile: compile the kernels of one part of the workflow."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.compile import run
    from knitsim.study.study import load_study

    study = load_study(snakemake.params.small, fallback=snakemake.params.small)
    run(snakemake.params.part, study).write(snakemake.output.timings)

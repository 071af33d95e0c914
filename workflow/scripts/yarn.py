"""Rule yarn: calibrate and simulate one yarn."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.yarn import run
    from knitsim.store.writer import write
    from knitsim.study.study import load_study

    dataset, timings = run(load_study(snakemake.config["study"]).yarns[snakemake.wildcards.yarn])
    write(dataset, snakemake.output.result)
    timings.write(snakemake.output.timings)

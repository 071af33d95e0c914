"""Rule loop: build the loop of one fabric."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.loop import run
    from knitsim.store.writer import write
    from knitsim.study.study import load_study

    study = load_study(snakemake.config["study"])
    dataset, timings = run(study.fabrics[snakemake.wildcards.fabric])
    write(dataset, snakemake.output.result)
    timings.write(snakemake.output.timings)

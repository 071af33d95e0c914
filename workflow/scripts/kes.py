"""Rule kes: the KES parameters of one fabric, from its tests."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.kes import run
    from knitsim.store.writer import write

    write(run(snakemake.input), snakemake.output.result)

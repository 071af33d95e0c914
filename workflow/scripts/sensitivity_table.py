"""Rule sensitivity_table: what one per cent of each input does, and how well it must be measured."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.sensitivity import write_table

    write_table(snakemake.input, snakemake.output[0])

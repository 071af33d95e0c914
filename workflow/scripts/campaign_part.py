"""One part of a campaign: some of its cases, solved and judged."""

from knitsim.stages.job import job

with job(snakemake):
    from importlib import import_module

    from knitsim.store.timing import write_csv

    stage = import_module(snakemake.params.stage)
    part, parts = int(snakemake.wildcards.part), snakemake.params.parts
    rows, times = stage.run(range(stage.CASES)[part::parts])
    write_csv(snakemake.output.rows, stage.COLUMNS, rows)
    write_csv(snakemake.output.times, stage.TIMES, times)

"""Rule bending_campaign: the results of all bent fabrics in one table, and what they come to."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.bending_campaign import COLUMNS, SUMMARY, TIMES, summary
    from knitsim.stages.stress import gathered
    from knitsim.store.timing import write_csv

    rows = gathered(snakemake.input.rows)
    write_csv(snakemake.output.rows, COLUMNS, rows)
    write_csv(snakemake.output.times, TIMES, gathered(snakemake.input.times))
    write_csv(snakemake.output.summary, SUMMARY, summary(rows))

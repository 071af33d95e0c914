"""Rule stress: the results of all cases in one table, what they come to, and the map."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.figures import style
    from knitsim.figures.stress import stress_map
    from knitsim.stages.stress import COLUMNS, LIMITS, SUMMARY, TIMES, gathered, summary
    from knitsim.store.timing import write_csv

    rows = gathered(snakemake.input.rows)
    write_csv(snakemake.output.rows, COLUMNS, rows)
    write_csv(snakemake.output.times, TIMES, gathered(snakemake.input.times))
    write_csv(snakemake.output.summary, SUMMARY, summary(rows))
    with style.context():
        style.save(stress_map(rows, LIMITS), Path(snakemake.output.figure[0]).with_suffix(""))

"""Rule skipping: what the scenes do not need, and what leaving it out saves and changes."""

from knitsim.stages.job import absolute, job, kept_study

with job(snakemake):
    from knitsim.stages.skipping import COLUMNS, TIMES, run
    from knitsim.store.timing import write_csv

    table, times = absolute([snakemake.output.table, snakemake.output.times])
    with kept_study(snakemake) as study:
        rows = run([study.fabrics[name] for name in snakemake.params.fabrics])
    write_csv(table, COLUMNS, rows)
    write_csv(times, TIMES, rows)

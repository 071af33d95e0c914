"""Rule verification: the solver against exact answers."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.verification import accuracy_table, run
    from knitsim.store.writer import write

    dataset, rows, timings = run()
    write(dataset, snakemake.output.result)
    accuracy_table(rows, snakemake.output.table)
    timings.write(snakemake.output.timings)

"""Rule campaign: the results of all random fabrics in one table, and what they come to."""

from knitsim.stages.job import job

with job(snakemake):
    import csv

    from knitsim.stages.campaign import COLUMNS, SUMMARY, TIMES, summary
    from knitsim.store.timing import write_csv

    def read(paths):
        rows = []
        for path in paths:
            with open(path, newline="", encoding="utf-8") as file:
                rows += csv.DictReader(file)
        return sorted(rows, key=lambda row: int(row["number"]))

    rows = read(snakemake.input.rows)
    write_csv(snakemake.output.rows, COLUMNS, rows)
    write_csv(snakemake.output.times, TIMES, read(snakemake.input.times))
    write_csv(snakemake.output.summary, SUMMARY, summary(rows))

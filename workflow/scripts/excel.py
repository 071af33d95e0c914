"""Rule excel: every table once more, as Excel opens it where the comma is the decimal sign."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.store.table import write_for_excel

    for table in map(Path, snakemake.input):
        write_for_excel(table, Path(snakemake.output.directory) / table.name)

"""Rule tables: every table that is gathered from all result files."""

from knitsim.stages.job import absolute, job, kept_study

with job(snakemake):
    from knitsim.stages.all_tables import write_tables

    tables = {path.stem: path for path in absolute(snakemake.output)}
    files = {
        name: absolute(snakemake.input.get(name, []))
        for name in ("results", "kes", "measured", "timings")
    }
    with kept_study(snakemake) as study:
        write_tables(study, files, tables)

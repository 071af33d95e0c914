"""Rule skipping: what the scenes do not need, and what leaving it out saves and changes."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.skipping import COLUMNS, run
    from knitsim.store.timing import write_csv
    from knitsim.study.study import load_study

    study = load_study(snakemake.config["study"])
    fabrics = [study.fabrics[name] for name in snakemake.params.fabrics]
    write_csv(snakemake.output.table, COLUMNS, run(fabrics))

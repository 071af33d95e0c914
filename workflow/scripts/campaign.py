"""Rules campaign, bending_campaign, stress: all cases in one table, what they come to, the map."""

from knitsim.stages.job import job

with job(snakemake):
    from importlib import import_module
    from pathlib import Path

    from knitsim.stages.judged import gathered
    from knitsim.store.timing import write_csv

    stage = import_module(snakemake.params.stage)
    rows = gathered(snakemake.input.rows)
    write_csv(snakemake.output.rows, stage.COLUMNS, rows)
    write_csv(snakemake.output.times, stage.TIMES, gathered(snakemake.input.times))
    write_csv(snakemake.output.summary, stage.SUMMARY, stage.summary(rows))
    if "figure" in snakemake.output.keys():
        from knitsim.figures import style
        from knitsim.figures.stress import stress_map

        with style.context():
            map_of_cases = stress_map(rows, stage.LIMITS)
            style.save(map_of_cases, Path(snakemake.output.figure[0]).with_suffix(""))

"""Rules of the campaigns: some of a campaign's cases, solved and judged; or all in one table."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.stages import trials
    from knitsim.store.timing import write_csv

    given, put = snakemake.params, snakemake.output
    if "part" in snakemake.wildcards.keys():
        part = int(snakemake.wildcards.part)
        sample = {key: given[key] for key in ("seed", "cases") if key in given.keys()}
        rows, times = trials.part_of(given.campaign, part, given.parts, **sample)
    else:
        rows, times = (
            trials.gathered(files) for files in (snakemake.input.rows, snakemake.input.times)
        )
        write_csv(put.summary, trials.SUMMARY, trials.summary(given.campaign, rows))
    write_csv(put.rows, trials.COLUMNS, rows)
    write_csv(put.times, trials.TIMES, times)
    if "figure" in put.keys():
        from knitsim.figures import style
        from knitsim.figures.stress import stress_map

        with style.context():
            style.save(stress_map(rows, trials.LIMITS), Path(put.figure[0]).with_suffix(""))

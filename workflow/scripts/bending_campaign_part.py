"""Rule bending_campaign_part: some of the random fabrics, bent and judged."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.evaluation.stress_bending import CASES
    from knitsim.stages.bending_campaign import COLUMNS, TIMES, run
    from knitsim.store.timing import write_csv

    rows, times = run(range(CASES)[int(snakemake.wildcards.part) :: snakemake.params.parts])
    write_csv(snakemake.output.rows, COLUMNS, rows)
    write_csv(snakemake.output.times, TIMES, times)

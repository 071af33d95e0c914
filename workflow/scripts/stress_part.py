"""Rule stress_part: some of the random and worst cases, solved and judged."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.evaluation.stress import CASES
    from knitsim.stages.stress import COLUMNS, TIMES, run
    from knitsim.store.timing import write_csv

    rows, times = run(range(CASES)[int(snakemake.wildcards.part) :: snakemake.params.parts])
    write_csv(snakemake.output.rows, COLUMNS, rows)
    write_csv(snakemake.output.times, TIMES, times)

"""Rule benchmark_rest: comparison with PyElastica, scaling, and cost by phase."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.benchmark import (
        COMPARED_COLUMNS,
        PHASE_COLUMNS,
        SCALING_COLUMNS,
        comparison_rows,
        phase_rows,
        scaling_rows,
    )
    from knitsim.stages.benchmark_runs import many_fabrics, outside_phases
    from knitsim.store.timing import write_csv

    output = snakemake.output
    write_csv(output.comparison, COMPARED_COLUMNS, comparison_rows())
    write_csv(output.phases, PHASE_COLUMNS, phase_rows(outside_phases(snakemake.input.compiled)))
    rows = scaling_rows()
    write_csv(output.scaling, SCALING_COLUMNS, rows + many_fabrics(snakemake.params.snakefile))

"""Rule tables: run times, assumptions with their effects, corrections with their sizes."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.kes_table import curl_table, kes_table
    from knitsim.stages.tables import assumption_table, correction_table, timing_table
    from knitsim.study.study import load_study

    study = load_study(snakemake.config["study"])
    timing_table(snakemake.input.timings, snakemake.output.timing)
    assumption_table(study, snakemake.input.results, snakemake.output.assumptions)
    correction_table(snakemake.input.results, snakemake.output.corrections)
    kes_table(snakemake.input.kes_of_fabrics, snakemake.output.kes)
    curl_table(snakemake.input.results, snakemake.output.curl)

"""Rule page: what came out, to look at in a browser."""

from knitsim.stages.job import absolute, job, kept_study

with job(snakemake):
    from knitsim.stages.page import write_page

    (page,) = absolute([snakemake.output.page])
    with kept_study(snakemake) as study:
        write_page(study, page)

"""The paper, end to end: yarn, loop, fabric tests, figures and tables.  See README.md.

    snakemake -c2                          everything, into results/
    snakemake -c2 campaign                 1,000 random fabrics pulled, each result judged
    snakemake -c2 bending_campaign         300 random fabrics bent
    snakemake -c2 shear_campaign           500 random fabrics sheared
    snakemake -c2 friction_campaign        500 random fabrics pulled and released three times
    snakemake -c2 pattern_campaign         300 random fabrics of knit and purl pulled
    snakemake -c2 stress                   5,000 random and worst cases, with a map of the limits
    snakemake -c2 stress --config seed=7 cases=100   other cases of a campaign, or fewer
    snakemake -c2 calibration              also the calibrations that the study marks on_request
    snakemake -c2 patterns                 jersey, garter, rib and seed of one yarn, predicted from its jersey
    snakemake -c2 benchmark                run time against error in full, PyElastica beside it, scaling
    snakemake -c2 excel                    the tables again, for Excel with decimal commas
    snakemake -c2 --config study=DIR       with the yarns, fabrics and scenes of another directory

A run ends with the table of results/tables/summary.csv; results/index.html is the page to look at.
"""

include: "workflow/rules/common.smk"
include: "workflow/rules/compile.smk"
include: "workflow/rules/yarn.smk"
include: "workflow/rules/fabric.smk"
include: "workflow/rules/measured.smk"
include: "workflow/rules/verification.smk"
include: "workflow/rules/skipping.smk"
include: "workflow/rules/output.smk"
include: "workflow/rules/campaign.smk"
include: "workflow/rules/benchmark.smk"
include: "workflow/rules/excel.smk"
include: "workflow/rules/patterns.smk"


rule all:
    default_target: True
    input:
        # Results first: one that is missing is made again, even if what shows it is there.
        YARN_FILES,
        TEST_FILES,
        KES_FILES,
        MEASURED_FILES[""],
        TABLES,
        FIGURES,
        OTHERS,
        rules.page.output,
        rules.verification.output,
        rules.skipping.output,
        rules.benchmark_quick.output,


onsuccess:
    # knitsim run shows it by itself; a run of a few targets may have none.
    if "KNITSIM_RUN" not in os.environ and (STORE / show.TABLE).exists():
        show.show_results(STORE)

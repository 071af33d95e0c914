"""The paper, end to end: yarn, loop, fabric tests, figures and tables.  See README.md.

    snakemake -c2                          everything, into results/
    snakemake -c2 campaign                 1,000 random fabrics through the equilibrium model
    snakemake -c2 --config study=DIR       with the yarns, fabrics and scenes of another directory
"""

include: "workflow/rules/common.smk"
include: "workflow/rules/compile.smk"
include: "workflow/rules/yarn.smk"
include: "workflow/rules/fabric.smk"
include: "workflow/rules/output.smk"
include: "workflow/rules/verification.smk"
include: "workflow/rules/campaign.smk"


rule all:
    default_target: True
    input:
        yarn_files(),
        fabric_files(),
        output_files(),

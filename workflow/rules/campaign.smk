# Random fabrics through the equilibrium model: snakemake campaign.  Not part of the default target.
# Cut into parts, so that a stopped campaign resumes with the part that it was in.

CAMPAIGN_PARTS = [f"{part:02d}" for part in range(20)]


rule campaign:
    input:
        rows=expand(results("verification/campaign/{part}.csv"), part=CAMPAIGN_PARTS),
        times=expand(results("benchmark/campaign/{part}.csv"), part=CAMPAIGN_PARTS),
    output:
        rows=results("tables/campaign.csv"),
        summary=results("tables/campaign_summary.csv"),
        times=results("tables/campaign_timing.csv"),
    log:
        log_of("campaign"),
    params:
        source=source_hash("knitsim.stages.campaign"),
    script:
        "../scripts/campaign.py"


rule campaign_part:
    output:
        rows=results("verification/campaign/{part}.csv"),
        times=results("benchmark/campaign/{part}.csv"),
    log:
        log_of("campaign_{part}"),
    params:
        parts=len(CAMPAIGN_PARTS),
        source=source_hash("knitsim.stages.campaign"),
    wildcard_constraints:
        part=r"\d+",
    script:
        "../scripts/campaign_part.py"

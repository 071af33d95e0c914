# What the scenes do not need, computed with and without: part of the default target.


rule skipping:
    output:
        table=results("tables/skipped.csv"),
    log:
        log_of("skipping"),
    params:
        fabrics=one_of_each_scene(),
        inputs=[
            inputs_of("fabrics", name, stage)
            for name in one_of_each_scene()
            for stage in ("equilibrium_tension", "yarn", "loop")
        ],
        skips=[str(skip) for name in one_of_each_scene() for skip in skips_of_fabric(name)],
        source=source_hash("knitsim.stages.skipping"),
    # When the kernels are compiled.
    priority: EQUILIBRIUM_PRIORITY
    script:
        "../scripts/skipping.py"


# Stability of the equilibrium model: snakemake stress, random and worst-case fabrics and tests;
# snakemake bending_campaign, random fabrics bent.  Not part of the default target.  Cut into parts, so
# that a stopped campaign resumes with the part that it was in.

STRESS_PARTS = [f"{part:02d}" for part in range(50)]
BENDING_PARTS = [f"{part:02d}" for part in range(20)]


rule stress:
    input:
        rows=expand(results("verification/stress/{part}.csv"), part=STRESS_PARTS),
        times=expand(results("benchmark/stress/{part}.csv"), part=STRESS_PARTS),
    output:
        rows=results("tables/stress.csv"),
        summary=results("tables/stress_summary.csv"),
        times=results("tables/stress_timing.csv"),
        figure=[results(f"figures/stress_map.{kind}") for kind in ("png", "svg")],
    log:
        log_of("stress"),
    params:
        source=source_hash("knitsim.stages.stress", "knitsim.figures.stress"),
    script:
        "../scripts/stress.py"


rule stress_part:
    output:
        rows=results("verification/stress/{part}.csv"),
        times=results("benchmark/stress/{part}.csv"),
    log:
        log_of("stress_{part}"),
    params:
        parts=len(STRESS_PARTS),
        source=source_hash("knitsim.stages.stress"),
    wildcard_constraints:
        part=r"\d+",
    script:
        "../scripts/stress_part.py"


rule bending_campaign:
    input:
        rows=expand(results("verification/bending/{part}.csv"), part=BENDING_PARTS),
        times=expand(results("benchmark/bending_campaign/{part}.csv"), part=BENDING_PARTS),
    output:
        rows=results("tables/bending_campaign.csv"),
        summary=results("tables/bending_campaign_summary.csv"),
        times=results("tables/bending_campaign_timing.csv"),
    log:
        log_of("bending_campaign"),
    params:
        source=source_hash("knitsim.stages.bending_campaign"),
    script:
        "../scripts/bending_campaign.py"


rule bending_campaign_part:
    output:
        rows=results("verification/bending/{part}.csv"),
        times=results("benchmark/bending_campaign/{part}.csv"),
    log:
        log_of("bending_campaign_{part}"),
    params:
        parts=len(BENDING_PARTS),
        source=source_hash("knitsim.stages.bending_campaign"),
    wildcard_constraints:
        part=r"\d+",
    script:
        "../scripts/bending_campaign_part.py"

# Random fabrics through the equilibrium model, each result judged: snakemake campaign (tension),
# bending_campaign, stress (random and worst cases, pulled and bent).  Not part of the default target.
# Cut into parts, so that a stopped campaign resumes with the parts that it was in.

for campaign, count in {"campaign": 20, "bending_campaign": 20, "stress": 50}.items():
    stage = f"knitsim.stages.{campaign}"
    parts = [f"{part:02d}" for part in range(count)]
    tables = {
        "rows": results(f"tables/{campaign}.csv"),
        "summary": results(f"tables/{campaign}_summary.csv"),
        "times": results(f"tables/{campaign}_timing.csv"),
    }
    if campaign == "stress":
        tables["figure"] = [results(f"figures/stress_map.{kind}") for kind in ("png", "svg")]

    rule:
        name:
            campaign
        input:
            rows=expand(results(f"verification/{campaign}/{{part}}.csv"), part=parts),
            times=expand(results(f"benchmark/{campaign}/{{part}}.csv"), part=parts),
        output:
            **tables,
        log:
            log_of(campaign),
        params:
            stage=stage,
            source=source_hash(stage, *["knitsim.figures.stress"] * ("figure" in tables)),
        script:
            "../scripts/campaign.py"

    rule:
        name:
            f"{campaign}_part"
        output:
            rows=results(f"verification/{campaign}/{{part}}.csv"),
            times=results(f"benchmark/{campaign}/{{part}}.csv"),
        log:
            log_of(f"{campaign}_{{part}}"),
        params:
            stage=stage,
            parts=count,
            source=source_hash(stage),
        wildcard_constraints:
            part=r"\d+",
        script:
            "../scripts/campaign_part.py"

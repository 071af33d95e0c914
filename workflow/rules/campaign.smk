# Random fabrics through the equilibrium model, each result judged: snakemake campaign (tension),
# bending_campaign, shear_campaign, friction_campaign (three cycles each), pattern_campaign (knit and
# purl), stress (random and worst cases of all tests).  Not part of the default target.  Cut into parts, so that a stopped campaign resumes with
# the parts that it was in.
# Other cases than those of knitsim.verification.trials.table: --config seed=NUMBER cases=NUMBER.

PARTS_OF = {
    "campaign": 20, "bending_campaign": 20, "shear_campaign": 20, "friction_campaign": 20,
    "pattern_campaign": 20, "stress": 50,
}  # fmt: skip
for campaign, count in PARTS_OF.items():
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
            campaign=campaign,
            source=source_hash("knitsim.stages.trials", *["knitsim.figures.stress"] * ("figure" in tables)),
        resources:
            mem_mb=1500,
            runtime=60,
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
            campaign=campaign,
            parts=count,
            **SAMPLE,
            source=source_hash("knitsim.stages.trials"),
        wildcard_constraints:
            part=r"\d+",
        resources:
            mem_mb=1500,
            runtime=60,
        script:
            "../scripts/campaign.py"

"""Rule patterns: the four patterns of one yarn side by side."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.figures.patterns import draw_patterns

    draw_patterns({name: snakemake.input[name] for name in ("rest", "course", "wale", "predicted")},
                  Path(snakemake.output[0]).parent)  # fmt: skip

"""Rule pattern: one of the acrylic's patterns, its rest, its tension, and what its calibration predicts."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.stages.patterns import run
    from knitsim.store.writer import write
    from knitsim.study.study import load_study

    fabric = load_study(snakemake.params.study).fabrics[snakemake.params.pattern]
    for dataset, path in zip(run(fabric), snakemake.output, strict=True):
        write(dataset, Path(path))

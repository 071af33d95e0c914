"""Rule patterns_solved: the patterns of one yarn, at rest, in tension, and as their calibration predicts."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.stages.patterns import ordered, run
    from knitsim.store.writer import write
    from knitsim.study.study import load_study

    study = load_study(snakemake.params.study)
    for dataset, path in zip(run(ordered(study)), snakemake.output, strict=True):
        write(dataset, Path(path))

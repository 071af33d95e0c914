"""Rule measured: one calibration of one fabric and its predictions."""

from knitsim.stages.job import job

with job(snakemake):
    import xarray

    from knitsim.stages.calibration import run
    from knitsim.stages.laws import FORMS, law_from
    from knitsim.store.writer import write
    from knitsim.study.study import load_study

    fabric = load_study(snakemake.config["study"]).fabrics[snakemake.wildcards.fabric]
    with xarray.open_dataset(snakemake.input.yarn) as yarn:
        laws = {form: law_from(yarn, form) for form in FORMS}
    dataset, timings = run(fabric, laws, snakemake.wildcards.calibration)
    write(dataset, snakemake.output.result)
    timings.write(snakemake.output.timings)

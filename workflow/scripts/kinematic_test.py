"""Rules kinematic_tension and kinematic_bending: one test of one fabric in one direction."""

from importlib import import_module

from knitsim.stages.job import job

with job(snakemake):
    import xarray

    from knitsim.configuration.study import load_study
    from knitsim.stages.laws import FORMS, law_from
    from knitsim.store.writer import write

    stage = import_module(f"knitsim.stages.{snakemake.rule}")
    study = load_study(snakemake.config["study"])
    with xarray.open_dataset(snakemake.input.yarn) as yarn:
        laws = {form: law_from(yarn, form) for form in FORMS}
    dataset, timings = stage.run(
        study.fabrics[snakemake.wildcards.fabric], laws, snakemake.wildcards.direction
    )
    write(dataset, snakemake.output.result)
    timings.write(snakemake.output.timings)

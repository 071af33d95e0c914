"""Rules kinematic_* and equilibrium_*: one test of one fabric, in one direction if it has one."""

from importlib import import_module

from knitsim.stages.job import job

with job(snakemake):
    import xarray

    from knitsim.stages.laws import FORMS, law_from
    from knitsim.store.writer import write
    from knitsim.study.study import load_study

    stage = import_module(f"knitsim.stages.{snakemake.rule}")
    fabric = load_study(snakemake.config["study"]).fabrics[snakemake.wildcards.fabric]
    with xarray.open_dataset(snakemake.input.yarn) as yarn:
        laws = {form: law_from(yarn, form) for form in FORMS}
    direction = snakemake.wildcards.get("direction")
    dataset, timings = stage.run(fabric, laws, *([direction] if direction else []))
    write(dataset, snakemake.output.result)
    timings.write(snakemake.output.timings)

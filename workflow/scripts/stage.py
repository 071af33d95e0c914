"""Rules of one stage: yarn, loop, every test of a fabric, and calibrations."""

from importlib import import_module

from knitsim.stages.job import job

with job(snakemake):
    import xarray

    from knitsim.stages.laws import FORMS, law_from
    from knitsim.store.writer import write
    from knitsim.study.study import load_study

    study, wildcards = load_study(snakemake.config["study"]), dict(snakemake.wildcards.items())
    of_yarn = "yarn" in wildcards
    given = [
        study.yarns[wildcards.pop("yarn")] if of_yarn else study.fabrics[wildcards.pop("fabric")]
    ]
    if "yarn" in snakemake.input.keys():
        with xarray.open_dataset(snakemake.input.yarn) as yarn:
            given.append({form: law_from(yarn, form) for form in FORMS})
    stage = import_module(f"knitsim.stages.{snakemake.params.stage}")
    # What is left of the wildcards is a direction, or the name of a calibration.
    dataset, timings = stage.run(*given, *wildcards.values())
    write(dataset, snakemake.output.result)
    timings.write(snakemake.output.timings)

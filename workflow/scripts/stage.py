"""Rules of the stages: a yarn, the tests of a fabric, or a calibration."""

from knitsim.stages.job import absolute, job, kept_study

with job(snakemake):
    from knitsim.stages.several import run

    names, given, put = snakemake.wildcards, snakemake.input, snakemake.output
    outputs = absolute(put.result if isinstance(put.result, list) else [put.result])
    (timings, log), yarn = absolute([put.timings, snakemake.log[0]]), given.get("yarn")
    with kept_study(snakemake) as study:
        one = (
            study.fabrics[names.fabric] if "fabric" in names.keys() else study.yarns[names.yarn]
        )
        run(
            one, snakemake.params.tests, outputs, timings,
            yarn=absolute([yarn])[0] if yarn else None, log=log,
        )  # fmt: skip

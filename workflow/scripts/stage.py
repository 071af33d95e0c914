"""Rules of the stages: a yarn, the tests of a fabric, or a calibration."""

from knitsim.stages.job import absolute, job, kept_study

with job(snakemake):
    from knitsim.stages.several import run

    names, put = snakemake.wildcards, snakemake.output
    outputs = absolute(put.result if not isinstance(put.result, str) else [put.result])
    timings, log = absolute([put.timings, snakemake.log[0]])
    yarn = snakemake.input.get("yarn")
    yarn = absolute([yarn])[0] if yarn else None
    with kept_study(snakemake) as study:
        of_yarn = "yarn" in names.keys()
        given = study.yarns[names.yarn] if of_yarn else study.fabrics[names.fabric]
        run(given, snakemake.params.tests, outputs, timings, yarn=yarn, log=log)

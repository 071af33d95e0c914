"""Rules measured_tables*: the calibrations and predictions of all fabrics, in numbers and words."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.calibration_tables import write_tables

    write_tables(snakemake.input, *snakemake.output)

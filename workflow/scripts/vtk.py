"""Rule vtk: ParaView files of one fabric's states."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages.vtk_states import run

    run(snakemake.input.results, snakemake.output.directory)

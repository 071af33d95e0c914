"""Rule readings: KES parameters of one fabric, and its states for ParaView."""

from knitsim.stages.job import job

with job(snakemake):
    from knitsim.stages import kes, vtk_states
    from knitsim.store.writer import write

    write(kes.run(snakemake.input.tests), snakemake.output.kes)
    vtk_states.run(snakemake.input.tests, snakemake.output.vtk)

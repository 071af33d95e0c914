"""Rules measured_figures*: the figures of the calibrations of one fabric."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    import xarray

    from knitsim.figures import measured, style

    files = map(Path, snakemake.input)
    datasets = {file.stem: xarray.load_dataset(file, engine="netcdf4") for file in files}
    for name, stem in snakemake.params.stems.items():
        with style.context():
            style.save(getattr(measured, name)(datasets), stem)

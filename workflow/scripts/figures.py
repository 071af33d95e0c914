"""Rules figures_*: the figures of one group and one yarn or fabric."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.figures.catalogue import drawable
    from knitsim.figures.draw import draw

    files = dict(snakemake.input.items())
    figures = drawable(snakemake.params.group, snakemake.params.of, files)
    directory, suffix = Path(snakemake.output[0]).parent, snakemake.params.suffix
    draw(figures, files, {figure.name: directory / (figure.name + suffix) for figure in figures})

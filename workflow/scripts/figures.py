"""Rules figures_*: the figures of one group and one yarn or fabric."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.figures.catalogue import FIGURES
    from knitsim.figures.draw import draw

    files, suffix = dict(snakemake.input.items()), snakemake.params.suffix
    figures = [figure for figure in FIGURES if figure.name in snakemake.params.figures]
    directory = Path(snakemake.output[0]).parent
    stems = {figure.name: directory / (figure.name + suffix) for figure in figures}
    draw(figures, files, stems, snakemake.log[0])

"""Rules figures_*: the figures of one group and one yarn or fabric."""

from knitsim.stages.job import job

with job(snakemake):
    from pathlib import Path

    from knitsim.figures.catalogue import FIGURES
    from knitsim.figures.draw import draw

    stems = [Path(file).with_suffix("") for file in snakemake.output if file.endswith(".png")]
    stems = {stem.name.removesuffix(snakemake.params.suffix): stem for stem in stems}
    figures = [figure for figure in FIGURES if figure.name in stems]
    draw(figures, dict(snakemake.input.items()), stems, snakemake.log[0])

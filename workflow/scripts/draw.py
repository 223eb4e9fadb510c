from nearharmonic_paper.tasks.job import draw

draw(snakemake)

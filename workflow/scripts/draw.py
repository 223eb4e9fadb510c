from nearharmonic.reproduction.tasks.job import draw

draw(snakemake)

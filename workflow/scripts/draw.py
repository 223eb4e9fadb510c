from nearharmonic.output.job import draw

draw(snakemake)

from nearharmonic_paper.tasks.job import run

run(snakemake)

from nearharmonic.reproduction.tasks.job import run

run(snakemake)

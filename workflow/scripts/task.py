from nearharmonic.output.job import run

run(snakemake)

from nearharmonic_paper.tasks.job import refresh

refresh(snakemake)

from nearharmonic.integrate import warm_up
from nearharmonic.job import logged

with logged(snakemake.log[0]):
    warm_up(snakemake.wildcards.system, snakemake.params.precisions)

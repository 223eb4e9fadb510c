from importlib import import_module

from nearharmonic.job import logged

with logged(snakemake.log[0]):
    import_module(f"nearharmonic.stability.{snakemake.params.module}").warm_up()

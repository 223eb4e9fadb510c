from nearharmonic.job import logged
from nearharmonic.settings import Config, Sweep
from nearharmonic.store import read
from nearharmonic.tables import skipped, write_csv

with logged(snakemake.log[0]):
    settings = snakemake.params.config
    config = Config(**{**settings, "sweeps": tuple(Sweep(**sweep) for sweep in settings["sweeps"])})
    cubes = {system: read(path) for system, path in snakemake.input.items()}
    write_csv(snakemake.output[0], skipped(config, cubes))

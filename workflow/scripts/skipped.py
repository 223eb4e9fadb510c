from nearharmonic.job import logged
from nearharmonic.settings import Config, Sweep
from nearharmonic.store import read
from nearharmonic.tables import skipped, totals, write_csv

with logged(snakemake.log[0]):
    settings = snakemake.params.config
    config = Config(**{**settings, "sweeps": tuple(Sweep(**sweep) for sweep in settings["sweeps"])})
    cubes = {system: read(path) for system, path in snakemake.input.items()}
    rows = skipped(config, cubes)
    write_csv(snakemake.output[0], [*rows, *totals(rows, cubes)])

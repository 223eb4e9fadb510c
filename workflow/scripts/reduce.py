from nearharmonic.job import logged
from nearharmonic.provenance import provenance
from nearharmonic.reduce import NEEDED, cube
from nearharmonic.store import read_precisions, write_dataset

with logged(snakemake.log[0]):
    settings = {**snakemake.params.sweep, "integrators": snakemake.params.integrators}
    runs = {name: read_precisions(snakemake.input[name], NEEDED) for name in snakemake.params.integrators}
    origin = provenance(settings, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    write_dataset(snakemake.output[0], cube(snakemake.wildcards.system, runs), origin)

from pathlib import Path

from nearharmonic.job import logged
from nearharmonic.provenance import provenance
from nearharmonic.render.table import save
from nearharmonic.stability.cubes import REDUCTIONS
from nearharmonic.store import read, write_dataset

with logged(snakemake.log[0]):
    reduction = REDUCTIONS[snakemake.wildcards.ensemble]
    settings = {**snakemake.params.settings, "integrators": list(snakemake.input.keys())}
    cube = reduction.cube({name: read(path) for name, path in snakemake.input.items()})
    origin = provenance(settings, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    write_dataset(snakemake.output.cube, cube, origin)
    save(*reduction.rows(cube), Path(snakemake.output.table[0]).with_suffix(""), reduction.note)

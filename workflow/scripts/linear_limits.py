from pathlib import Path

from nearharmonic.integrators import integrators
from nearharmonic.job import logged
from nearharmonic.linear_limits import linear_stability_cube, linear_stability_table
from nearharmonic.provenance import provenance
from nearharmonic.render.table import save
from nearharmonic.store import write_dataset

NOTE = "Where the harmonic oscillator stays bounded: intervals of step sizes, and the gap that ends each."
with logged(snakemake.log[0]):
    names = snakemake.params.integrators
    methods = [integrators[name] for name in names]
    origin = provenance({"integrators": names}, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    write_dataset(snakemake.output.cube, linear_stability_cube(methods), origin)
    save(*linear_stability_table(methods), Path(snakemake.output.table[0]).with_suffix(""), NOTE)

from pathlib import Path

from nearharmonic.integrators import integrators
from nearharmonic.job import logged
from nearharmonic.kinetic_energy import kinetic_energy_cube, kinetic_energy_table
from nearharmonic.provenance import provenance
from nearharmonic.render.table import save
from nearharmonic.store import write_dataset

NOTE = "Relativistic oscillator: largest energy error at tau/s = 0.05 over that of Ruth's method, by amplitude A."
with logged(snakemake.log[0]):
    names = snakemake.params.integrators
    cube = kinetic_energy_cube([integrators[name] for name in names])
    origin = provenance({"integrators": names}, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    write_dataset(snakemake.output.cube, cube, origin)
    save(*kinetic_energy_table(cube), Path(snakemake.output.table[0]).with_suffix(""), NOTE)

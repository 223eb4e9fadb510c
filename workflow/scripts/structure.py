from pathlib import Path

from nearharmonic.integrators import integrators
from nearharmonic.job import logged
from nearharmonic.provenance import provenance
from nearharmonic.render.table import save
from nearharmonic.store import write_dataset
from nearharmonic.structure_cube import structure_cube, structure_table

NOTE = "Reversibility, symplecticity and mean energy, relative, each beside what rounding alone would give."
with logged(snakemake.log[0]):
    names, t_end = snakemake.params.integrators, snakemake.params.t_end
    cube = structure_cube([integrators[name] for name in names], list(t_end.items()))
    settings = {"integrators": names, "t_end": t_end}
    origin = provenance(settings, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    write_dataset(snakemake.output.cube, cube, origin)
    save(*structure_table(cube), Path(snakemake.output.table[0]).with_suffix(""), NOTE)

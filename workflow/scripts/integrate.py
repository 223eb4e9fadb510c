from nearharmonic.integrate import integrate_run
from nearharmonic.job import logged
from nearharmonic.plan import Sweep, runs_of
from nearharmonic.provenance import provenance
from nearharmonic.store import write

with logged(snakemake.log[0]):
    sweep, integrator, shard = snakemake.params.sweep, snakemake.wildcards.integrator, int(snakemake.wildcards.shard)
    parts = {run.precision: integrate_run(run) for run in runs_of(Sweep(**sweep), integrator, shard)}
    settings = {**sweep, "integrator": integrator, "shard": shard}
    origin = provenance(settings, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    write(snakemake.output[0], parts.pop("double", {}), origin, groups=parts)

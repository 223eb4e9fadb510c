from nearharmonic.job import logged
from nearharmonic.plan import Sweep
from nearharmonic.provenance import provenance
from nearharmonic.store import write
from nearharmonic.work_precision import measure_all
from nearharmonic.work_precision_settings import WorkPrecision

with logged(snakemake.log[0]):
    given = snakemake.params
    sweeps = [Sweep(**sweep) for sweep in given.sweeps]
    groups, facts = measure_all(sweeps, given.methods, WorkPrecision(**given.settings))
    settings = {**given.settings, "sweeps": given.sweeps, "methods": given.methods}
    origin = provenance(settings, code=given.code, coefficients=given.coefficients)
    write(snakemake.output[0], {}, {**origin, **facts}, groups=groups)

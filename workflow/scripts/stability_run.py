from importlib import import_module

from nearharmonic.integrators import integrators
from nearharmonic.job import logged
from nearharmonic.provenance import provenance
from nearharmonic.stability.settings import SETTINGS
from nearharmonic.store import write_dataset

with logged(snakemake.log[0]):
    integrator, asked = snakemake.wildcards.integrator, snakemake.params.settings
    module = import_module(f"nearharmonic.stability.{snakemake.params.module}")
    settings = {**asked, "integrator": integrator}
    origin = provenance(settings, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    result = module.run(integrators[integrator], SETTINGS[snakemake.wildcards.ensemble](**asked))
    write_dataset(snakemake.output[0], result, origin)

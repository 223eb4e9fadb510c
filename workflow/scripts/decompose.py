from nearharmonic.job import logged
from nearharmonic.provenance import provenance
from nearharmonic.reduce import harmonic_terms
from nearharmonic.store import write_dataset

with logged(snakemake.log[0]):
    methods = snakemake.params.integrators
    origin = provenance(
        {"integrators": methods}, code=snakemake.params.code, coefficients=snakemake.params.coefficients
    )
    write_dataset(snakemake.output[0], harmonic_terms(methods), origin)

from nearharmonic.job import logged
from nearharmonic.provenance import write_manifest

with logged(snakemake.log[0]):
    write_manifest(snakemake.output[0], snakemake.input)

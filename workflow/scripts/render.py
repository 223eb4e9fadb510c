from importlib import import_module
from pathlib import Path

from nearharmonic.job import logged
from nearharmonic.render.style import save
from nearharmonic.store import read

with logged(snakemake.log[0]):
    module = import_module(f"nearharmonic.render.{snakemake.params.module}")
    substeps = import_module("nearharmonic.substeps")
    shown = read(snakemake.input[0]) if snakemake.input else substeps.paper_panels()
    save(module.figure(shown), Path(snakemake.output.png).with_suffix(""))

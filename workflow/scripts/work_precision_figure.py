from pathlib import Path

from nearharmonic.job import logged
from nearharmonic.render.style import save
from nearharmonic.render.work_precision import work_precision_figure
from nearharmonic.systems import systems
from nearharmonic.work_precision import read_parts

with logged(snakemake.log[0]):
    system = systems[snakemake.wildcards.system]
    parts, facts = read_parts(snakemake.input[0], system.name)
    save(work_precision_figure(system.label, parts, facts), Path(snakemake.output.png).with_suffix(""))

from nearharmonic.job import logged
from nearharmonic.systems import systems
from nearharmonic.time_to_error import markdown, rows, write_csv, write_text
from nearharmonic.work_precision import read_parts

with logged(snakemake.log[0]):
    system = systems[snakemake.wildcards.system]
    parts, facts = read_parts(snakemake.input[0], system.name)
    write_csv(snakemake.output.csv, [row for part in parts for row in rows(system.name, *part)])
    write_text(snakemake.output.md, markdown(system.label, parts, facts))

import sys
from pathlib import Path

from nearharmonic.coefficient_table import table_4
from nearharmonic.derivation import tables
from nearharmonic.derivation.comparison import compare
from nearharmonic.derivation.derive import derive
from nearharmonic.job import logged
from nearharmonic.provenance import provenance
from nearharmonic.render.table import save, save_document

TAU_PER_STAGE = (0.02, 0.05, 0.1)
with logged(snakemake.log[0]):
    settings = snakemake.params.settings
    found = derive(**settings, report=lambda text: print(text, file=sys.__stderr__, flush=True))
    origin = provenance(settings, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    save_document({"provenance": origin, **tables.document(found)}, snakemake.output.document)
    folder = Path(snakemake.output.tables[0]).parent
    for stem, (header, rows), note in (
        ("table4_derived", table_4(tables.derived_tableaus(found)), "Table 4, printed and derived."),
        ("derived_solutions", tables.roots(found.isolated), "Every real solution of the isolated cases."),
        ("derived_counts", tables.counts(found), "How many solutions there are, and why none is missing."),
        ("derived_families", tables.families(found), "Printed members of families, and their rank in them."),
        ("derived_orders", tables.reach_of_stages(found), "The harmonic order that a number of stages reaches."),
        ("derived_routes", tables.routes(found), "Two routes to the coefficients; seconds are of this run."),
        (
            "derived_errors",
            tables.solution_errors(compare(found.isolated[0], TAU_PER_STAGE)),
            "The five-stage solutions at work: energy errors of all of them, in both roles.",
        ),
    ):
        save(header, rows, folder / stem, note)

import sys
from pathlib import Path

from nearharmonic.integrators import integrators
from nearharmonic.job import logged
from nearharmonic.provenance import provenance
from nearharmonic.render.table import save, save_document
from nearharmonic.search import tables
from nearharmonic.search.nystrom_search import nystrom_search, winners
from nearharmonic.search.registration import registered

with logged(snakemake.log[0]):
    settings = snakemake.params.settings
    findings = nystrom_search(
        **settings, threads=snakemake.threads, report=lambda text: print(text, file=sys.__stderr__, flush=True)
    )
    best = [
        (candidate, registered(candidate, source="found by nearharmonic.search")) for candidate in winners(findings)
    ]
    origin = provenance(settings, code=snakemake.params.code, coefficients=snakemake.params.coefficients)
    save_document({"provenance": origin, **tables.document(best)}, snakemake.output.document)
    folder = Path(snakemake.output.tables[0]).parent
    compared = [*(integrators[name] for name in snakemake.params.integrators), *(tableau for _, tableau in best)]
    for stem, (header, rows), note in (
        ("sixth_order_counts", tables.counts(findings), "Solutions by stages, composition and harmonic order."),
        ("sixth_order_ranking", tables.ranking(findings.candidates), "The best by a criterion that runs no problem."),
        ("sixth_order_measured", tables.measured(compared), "The winners beside the others, at the same cost."),
    ):
        save(header, rows, folder / stem, note)

from pathlib import Path

from nearharmonic.coefficient_table import table_4
from nearharmonic.job import logged
from nearharmonic.paper_tables import even_orders, overview, recursion_symbols, recursion_values, structure
from nearharmonic.render.table import save

METHOD = "ruth"  # The paper illustrates its Tables 2 and 3 with three stages, composed as BAB.
with logged(snakemake.log[0]):
    folder = Path(snakemake.output[0]).parent
    for stem, (header, rows), note in (
        ("table1_structure", structure(METHOD), "Table 1: mirror images among the coefficients of Ruth's method."),
        (
            "table2_recursion",
            recursion_symbols(METHOD, first="kick"),
            "Table 2: the recursion for three stages as BAB, in symbols.",
        ),
        ("table2_values", recursion_values(METHOD, first="kick"), "Table 2 for Ruth's method as BAB, in numbers."),
        (
            "table3_even_orders",
            even_orders(METHOD, first="kick"),
            "Table 3: closed sums for Ruth's method as BAB, beside Table 2's numbers.",
        ),
        ("table4_coefficients", table_4(), "Table 4: independent coefficients; d is the outer row, c the inner one."),
        ("integrators", overview(), "Every integrator: structure, orders, leading errors, linear stability."),
    ):
        save(header, rows, folder / stem, note)

"""A small folder of results for the tests of the page, made by hand but for one static figure."""

import csv
import json
from zlib import crc32

import numpy as np

from nearharmonic.output import store
from nearharmonic.plotting.style import save
from nearharmonic_paper.tasks.experiment import figures_of
from nearharmonic_paper.tasks.provenance import function_of
from support.cubes import figure_cubes as made

SYSTEMS = {"sho": "oscillator of the tests", "henon_heiles": "<b>galaxy</b> & tests", "kepler": "planet of the tests"}
#: Status of a run by the index of its step size, where it is not "ok".
STATUS = {0: "skipped", 11: "skipped", made.TAU.size - 1: "diverged"}

#: Panels of each figure.
PLOTS = {"1": 2, "2": 2, "3": 2, "4": 1, "5": 2, "6": 4, "gain": 2}

CLAIMS = [
    ("one", "Section 4, Figure 1", "The slope is <6> & steep", "holds", "6.02 ± 0.01", "6 ± 0.3"),
    ("two", "Figures 3 and 5", "BAB's8o7H is best", "holds in part", "from 3 h to 20 h", "every step size"),
    ("three", "Table 3", "The method is stable", "fails", "differs by 0.41", "10⁻¹²"),
    ("four", "Table 4", "Every decimal is right", "not decided here", "not measured", "76 decimals"),
    ("five", "Section 2 and Figure 9", "Nothing is shown of this", "holds", "0", "0"),
    ("six", "Eq. 13", "The sum runs to h - 1", "erratum", "0 of 20", "exactly"),
    ("seven", "Section 5", "All are better", "holds but for edges", "103 of 104", "each step size"),
    ("eight", "Table 4, heading", "There are four", "holds", "4", "Sturm's theorem"),
]
#: Kinds of those that are no results.
KINDS_OF_CLAIMS = {"six": "misprint", "eight": "finding", "five": "background"}
#: The one static figure that is drawn, which takes a second; this stands for the others.
DRAWN = "fig4_perihelion"
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="40pt" height="30pt"><path d="M 1 2 \nL 30 25 "/></svg>'
KEYS = ("id", "paper", "statement", "verdict", "value", "threshold")


def cube(system, methods=made.METHODS):
    """A cube of energy errors, with all that the page shows of a run."""
    precise = system == "sho"
    found = made.errors(methods, precise, "h" if system == "kepler" else "1")
    if system != "sho":  # no two systems alike
        found = found * (2.0 if system == "kepler" else 3.0 + crc32(system.encode()) % 89)
        found.tau_per_stage.attrs["units"] = "h" if system == "kepler" else "1"
    dims = found.max_energy_error.dims
    shape = found.max_energy_error.shape
    steps = np.broadcast_to(1000 + np.arange(made.TAU.size), shape)
    found["steps"] = dims, steps
    found["evaluations"] = dims, steps * 7 + np.arange(len(methods))[:, None]
    found["diverged_at"] = dims, np.where(np.isinf(found.max_energy_error.values), 321, 0)
    status = np.full(made.TAU.size, "ok", dtype="<U8")
    for index, name in STATUS.items():
        status[index] = name
    found["status"] = dims, np.broadcast_to(status, shape)
    if system == "kepler":
        advances = made.advances(methods).drop_vars("label")
        found = found.merge(advances, compat="override", combine_attrs="override").assign_attrs(orbital_period=2000.0)
    found.max_energy_error.attrs |= {"long_name": "maximum of |H - H0|/|H0| over every step", "units": "1"}
    return found.assign_attrs(system=system, system_label=SYSTEMS.get(system, f"{system} of the tests"))


def write_cube(path, dataset):
    """Write a cube; units and long names that are missing are made up."""
    variables = {
        str(name): (v.dims, v.values, {"units": "1", "long_name": str(name)} | v.attrs)
        for name, v in dataset.variables.items()
    }
    store.write(path, variables, dict(dataset.attrs))


def write_results(folder, systems=tuple(SYSTEMS), methods=made.METHODS):
    """Write cubes, static figures, claims and tables to ``folder``."""
    for name in ("cubes", "figures", "tables"):
        (folder / name).mkdir(parents=True)
    cubes = {system: cube(system, methods) for system in systems} | {"sho_terms": made.terms(methods)}
    for name, dataset in cubes.items():
        write_cube(folder / "cubes" / f"{name}.h5", dataset)
    for one in figures_of(systems, ["sho_terms"]):
        place = folder / "figures" / f"{one.stem}.svg"
        if one.stem == DRAWN:
            save(function_of({"function": one.draw})(cubes[one.cube]), [place])
        else:
            place.write_text(SVG, encoding="utf-8")
    write_claims(folder)
    write_tables(folder)
    return folder


def write_claims(folder, claims=CLAIMS):
    """Write the table of claims as JSON."""
    told = [dict(zip(KEYS, claim, strict=True)) | {"needs": ["cubes/sho.h5", "derived/none.toml"]} for claim in claims]
    for one in told:
        one["paper"] = {"section": one["paper"], "sentence": f"as the paper has it: {one['id']} 0.{'7' * 76}"}
        one["kind"] = KINDS_OF_CLAIMS.get(one["id"], "result")
        one["margin"] = "" if one["verdict"] == "not decided here" else f"margin of {one['id']}"
    (folder / "tables" / "claims.json").write_text(json.dumps(told, ensure_ascii=False), encoding="utf-8")


def write_table(folder, stem, rows, markdown=""):
    """Write a table as CSV, and its Markdown if there is one."""
    with (folder / "tables" / f"{stem}.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    if markdown:
        (folder / "tables" / f"{stem}.md").write_text(markdown, encoding="utf-8")


def write_tables(folder):
    """Write two of the paper's tables, one of all methods, and what was skipped."""
    write_table(
        folder, "table3_even_orders", [["h", "tau^2"], ["1", "-0.9128804378017515"]], "Table 3: sums.\n\n| h |\n"
    )
    write_table(folder, "table3_values", [["h"], ["2"]], "Table 3 again.\n")
    write_table(folder, "table4_coefficients", [["set", "printed"], ["A", "0." + "7" * 76]], "Table 4: coefficients.\n")
    write_table(folder, "integrators", [["integrator", "label"], *([m, made.label(m)] for m in made.METHODS)])
    header = ["system", "integrator", "precision", "what", "reason", "runs", "evaluations"]
    full = "every step size in double and extended, each observable in a pass of its own, no early stop"
    rows = [
        ["sho", "ruth", "double", "the rest of a run", "it left its energy surface", 1, 250],
        ["all", "all", "all", "done", "", 60, 750],
        ["all", "all", "all", "full grid", full, 61, 1000],
        ["all", "all", "all", "saved", "the rest of a run: it left its energy surface", 1, 250],
    ]
    write_table(folder, "skipped", [header, *rows])

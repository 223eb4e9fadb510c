"""The files of each target on the tiny config, below results/tiny/, logs left out: written down here, not asked for."""

from __future__ import annotations

METHODS = ("ruth", "babs7o7h")
#: Of figure 2.
DECOMPOSED = ("aba864", "babs7o7h")
SYSTEMS = ("sho", "henon_heiles", "kepler")


def figures(*stems):
    return {f"figures/{stem}.{suffix}" for stem in stems for suffix in ("pdf", "svg", "png")}


def tables(*stems):
    return {f"tables/{stem}.{suffix}" for stem in stems for suffix in ("csv", "md", "tex")}


def cubes(*stems):
    return {f"cubes/{stem}.h5" for stem in stems}


_PAPER_TABLES = (
    "table1_structure", "table2_recursion", "table2_values", "table3_even_orders", "table4_coefficients", "integrators",
)  # fmt: skip
_DERIVED_TABLES = (
    "table4_derived", "derived_solutions", "derived_counts", "derived_families", "derived_orders", "derived_routes",
    "derived_errors",
)  # fmt: skip
STABILITY_FIGURES = (
    "henon_heiles_stability", "kepler_stability", "rounding_growth", "linear_stability", "kinetic_energy",
)  # fmt: skip
_ENSEMBLES = ("henon_heiles", "kepler", "rounding")

FIGURES = {
    "fig1": figures("fig1_sho"),
    "fig2": figures("fig2_decomposition"),
    "fig3": figures("fig3_henon_heiles"),
    "fig4": figures("fig4_perihelion"),
    "fig5": figures("fig5_kepler"),
    "fig6": figures("fig6_substeps"),
    "fig6_displaced": figures("fig6_displaced"),
    **{f"{system}_energy_error": figures(f"{system}_energy_error") for system in SYSTEMS},
}
#: Target -> the files that it stands for.
TARGETS = FIGURES | {
    "figures": set().union(*FIGURES.values()),
    "tables": {"tables/skipped.csv"} | tables(*_PAPER_TABLES),
    "derive": {"derived/coefficients.toml"} | tables(*_DERIVED_TABLES),
    "beyond": {"derived/sixth_order.toml"}
    | tables("sixth_order_counts", "sixth_order_ranking", "sixth_order_measured"),
    "stability": cubes("linear_stability", "structure", "kinetic_energy", *(f"stability_{name}" for name in _ENSEMBLES))
    | figures(*STABILITY_FIGURES)
    | tables(*(f"stability_{name}" for name in _ENSEMBLES), "linear_stability", "structure", "kinetic_energy"),
    **{name: figures(name) for name in STABILITY_FIGURES},
    "work_precision": cubes("work_precision")
    | figures(*(f"work_precision_{system}" for system in SYSTEMS), "library_times_trajectory", "library_times_ensemble")
    | tables("library_times")
    | {f"tables/work_precision_{system}.{suffix}" for system in SYSTEMS for suffix in ("csv", "md")},
}  # fmt: skip
EXACT_FIGURES = ("exact_oscillator_error", "exact_oscillator_charge")
TARGETS |= {name: figures(name) for name in EXACT_FIGURES} | {
    "exact_oscillator": cubes("exact_oscillator")
    | tables("exact_oscillator", "exact_oscillator_times")
    | figures(*EXACT_FIGURES)
}
TRAINED_FIGURES = ("trained_error", "trained_gain", "trained_ideas")
TARGETS |= {name: figures(name) for name in TRAINED_FIGURES}
TARGETS["trained_proof"] = (
    cubes("trained", "trained_ideas")
    | tables(*(f"trained_{name}" for name in ("gains", "methods", "ideas", "long", "times")))
    | figures(*TRAINED_FIGURES)
)
TARGETS["trained"] = (
    TARGETS["trained_proof"]
    | {
        "derived/trained_light.toml",
        "derived/trained_modified.toml",
        "derived/trained.py",
        "derived/trained_modified.py",
    }
    | tables("trained_landscape_light", "trained_landscape_modified")
)
TARGETS["claims"] = {f"tables/claims.{suffix}" for suffix in ("csv", "md", "json")}
TARGETS["sixth_order"] = TARGETS["beyond"]
TARGETS["report"] = {"report.html"}
TARGETS["all"] = TARGETS["figures"] | TARGETS["tables"] | TARGETS["claims"] | TARGETS["report"]
TARGETS["everything"] = set().union(*TARGETS.values())

#: What is made on the way to the targets.
RUNS = {f"runs/{system}/{method}/{shard}.h5" for system in SYSTEMS for method in METHODS for shard in (0, 1)}
CUBES = cubes(*SYSTEMS, "sho_terms", "henon_heiles_chaos", "substeps_displaced")
ENSEMBLES = cubes(*(f"stability_{name}" for name in _ENSEMBLES)) | {
    f"runs/stability/{name}/{method}.h5" for name in _ENSEMBLES for method in METHODS
}
#: Runs of experiments that have one file for all methods.
SINGLE_RUNS = {
    "runs/stability/kinetic_energy.h5", "runs/exact_oscillator/trajectories.h5", "runs/trained/proof.h5",
    "runs/trained/ideas.h5", "runs/trained/long.h5",
}  # fmt: skip
#: Intervals of the systems that structure is measured on, on the tiny config.
STRUCTURE_T_END = {"sho": "20", "henon_heiles": "25", "kepler": "4383", "relativistic_oscillator": "500"}
STRUCTURE_RUNS = {f"runs/stability/structure/{system}.h5" for system in STRUCTURE_T_END}
MADE = TARGETS["everything"] | RUNS | CUBES | ENSEMBLES | SINGLE_RUNS | STRUCTURE_RUNS
#: Target -> all files that are there after it.
MADE_BY = {"all": TARGETS["all"] | RUNS | CUBES, "everything": MADE}
#: What every run of the workflow writes to, beside what it was asked for.
RECORD = {"history.jsonl", "manifest.json"}

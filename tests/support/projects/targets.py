"""The files of each target on the tiny config, below results/tiny/, logs left out, as the experiments declare them."""

import re

from nearharmonic.systems import systems
from nearharmonic_paper.tasks.experiment import experiments, figures_of

METHODS = ("ruth", "babs7o7h")
#: Of figure 2.
DECOMPOSED = ("aba864", "babs7o7h")
#: Of the experiments on crystals and on samplers.
ON_CRYSTALS = ("leapfrog", "bcss_s4", "babs7o7h", "trained_light")
SAMPLING = ("leapfrog", "bcss_s4", "babs7o7h")
SYSTEMS = ("sho", "henon_heiles", "kepler")
#: Intervals of the systems that structure is measured on: from the tiny config, or the systems' own.
STRUCTURE_T_END = {
    name: system.t_end
    for name, system in systems.items()
    if not system.time_dependent and system.regularisation is None
} | {"sho": "20", "henon_heiles": "25", "kepler": "4383"}


def figures(*stems):
    return {f"figures/{stem}.{suffix}" for stem in stems for suffix in ("pdf", "svg", "png")}


def tables(*stems):
    return {f"tables/{stem}.{suffix}" for stem in stems for suffix in ("csv", "md", "tex")}


def cubes(*stems):
    return {f"cubes/{stem}.h5" for stem in stems}


_EXPERIMENTS = experiments()
#: Values of the placeholders in names of files; the figure of regularised systems is not drawn of these.
_NAMES = {
    "system": SYSTEMS, "integrator": METHODS, "shard": ("0", "1"), "purpose": ("light", "modified"),
    "ensemble": ("henon_heiles", "kepler", "rounding"), "crystal": ("argon", "chain"),
    "family": ("4_kick",), "target": ("lattice", "mesquite"),
    "autonomous": tuple(STRUCTURE_T_END),
}  # fmt: skip
_OF_EXPERIMENTS = {
    one.target: {name for name in one.files(**_NAMES) if "regularised_times" not in name}
    for one in _EXPERIMENTS.values()
}

_PAPER = _EXPERIMENTS["paper"]
_DRAWN = figures_of(SYSTEMS, [stem for one in _EXPERIMENTS.values() for stem in one.cubes])
#: The paper's figures by target.
FIGURES = {one.target: figures(one.stem) for one in _DRAWN if one.experiment == "paper" and one.by_default}
#: The pages of figures without a number.
_OWN = ("sho", "henon_heiles", "kepler")
_ALONE = {f"figure-{system}_energy_error.html" for system in SYSTEMS if system not in _OWN}
#: Target -> the files that it stands for.
TARGETS = _OF_EXPERIMENTS | {one.target: figures(one.stem) for one in _DRAWN} | {
    f"{one.cube}_energy_error": figures(one.stem) for one in _DRAWN if one.profile
} | {
    "figures": set().union(*FIGURES.values()),
    "columns": set().union(
        *(figures(f"{one.stem}_column") for one in _DRAWN if one.experiment == "paper" and one.by_default)
    ),
    "tables": {"tables/skipped.csv"} | tables(*_PAPER.tables),
    "claims": {f"tables/claims.{suffix}" for suffix in ("csv", "md", "json")},
    "report": {"report.html", *(f"figure-{name}.html" for name in ("gain", *range(1, 7))), *_ALONE},
    "beyond": _OF_EXPERIMENTS["sixth_order"],
    "trained_proof": {
        name for name in _OF_EXPERIMENTS["trained"] if not re.search("^derived|landscape", name)
    },
}  # fmt: skip
#: What is made on the way to the targets.
RUNS_OF = {one.name: set(one.run_files(**_NAMES)) for one in _EXPERIMENTS.values()}
CUBES = cubes(*SYSTEMS, *_PAPER.cubes)

#: The default target asks for these too, so that a lost one is made again.
TARGETS["all"] = TARGETS["figures"] | TARGETS["tables"] | TARGETS["claims"] | TARGETS["report"]
TARGETS["all"] |= RUNS_OF["paper"] | CUBES
#: All but the searches, which take longer than the rest together.
TARGETS["everything"] = set().union(*TARGETS.values()) - (TARGETS["trained"] - TARGETS["trained_proof"])

MADE = TARGETS["everything"].union(TARGETS["trained"], CUBES, *RUNS_OF.values())
#: Target -> all files that are there after it. The figure, alone, takes runs of one system.
MADE_BY = {
    "fig3": FIGURES["fig3"] | cubes("henon_heiles")
    | {name for name in RUNS_OF["paper"] if name.startswith("runs/henon_heiles/")},
    "all": TARGETS["all"], "everything": MADE,
}  # fmt: skip
#: What every run of the workflow writes to, beside what it was asked for.
RECORD = {"history.jsonl", "manifest.json"}

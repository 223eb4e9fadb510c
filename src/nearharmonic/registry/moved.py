"""Old names of modules: an import by an old name gives the moved module and a warning."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, cast

#: Modules that have moved under their names: old room, new room, names. Their submodules have moved too.
_ROOMS = (
    ("", "output", "answers"),
    ("", "reproduction", "claims experiments record"),
    ("claims", "reproduction.claims.judging", "curves definitions margins slopes"),
    ("claims", "reproduction.claims.pages", "documents in_short summary"),
    ("claims.page", "reproduction.report.shown", "figures links pictures results tables wording"),
    (
        "claims.statements", "reproduction.claims.statements.tableaus",
        "coefficients methods roles sizes splitting trained",
    ),
    ("claims.statements", "reproduction.claims.statements.performance", "comparisons"),
    ("claims.statements", "reproduction.claims.statements.equations", "decomposition identities misprints search"),
    ("claims.statements", "reproduction.claims.statements.figures", "henon_heiles kepler oscillator substeps"),
    ("commands", "reproduction.commands", "adopt archive compare history runs show verify"),
    ("", "reproduction.config", "config schema"),
    ("core", "core.loops", "advance kernel landing scheduler shape"),
    ("core", "core.formulas", "chain condition constant expression number physics rules tracing"),
    ("core", "core.machine", "disk jit link native numba_functions operations reals values"),
    ("", "registry", "display user_module"),
    ("engine", "engine.numbers", "arrays coefficients initial_values rotations"),
    ("engine", "numerics", "clock geometric portable quasi_random statistics"),
    ("engine", "engine.runs", "continuation description ensemble invariants output_times problem solution trajectory"),
    ("engine", "engine.batch", "execution kernels lanes numba_runs processed regularised results"),
    ("exchange", "exchange.proof", "nearest oscillator residuals suspects verdict"),
    ("experiments.derivation", "reproduction.experiments.derivation.search", "kernels simplex starts"),
    ("experiments.paper", "reproduction.experiments.paper.orbits", "chaos displaced substeps tangent"),
    ("experiments.paper", "reproduction.experiments.paper.tableaus", "decompose overview tables"),
    ("experiments.paper", "reproduction.config", "definitions"),
    ("experiments.paper.figures", "plotting", "energy_error floor levels plot"),
    ("experiments.paper.figures", "plotting.datasets", "members"),
    ("plotting", "plotting.datasets", "members"),
    ("experiments.paper", "reproduction.experiments.paper.grid", "omissions plan"),
    ("experiments.trained", "reproduction.experiments.trained.comparison", "contestants resampling"),
    ("experiments.trained", "reproduction.experiments.trained.problems", "purposes"),
    ("experiments.work_precision", "recommendation", "curve own"),
    ("experiments.work_precision.peers", "reproduction.experiments.work_precision", "measure"),
    ("output", "reproduction.tasks", "declarations definitions job provenance receipts reduction"),
    ("output", "reproduction.tasks.code", "sources user_sources"),
    ("reproduction.tasks", "reproduction.tasks.code", "sources user_sources"),
    ("output", "plotting", "palette style"),
    ("record", "reproduction.record.files", "fingerprint folders manifest texts"),
    ("systems", "systems.definition", "arguments declaration quantities system"),
    (
        "systems", "systems.formulas",
        "energy gradients kinetic_energy modified_potential multiprecision_functions oscillator "
        "regularisation source",
    ),
    ("", "integrators", "tableau"),
    ("training.tailor", "training.tailor.inputs", "start_file starts"),
)  # fmt: skip
#: Old name in the package -> new name; submodules of an old name have moved too. A colon precedes an attribute.
MOVED = {
    "reproduction.report.shown.legend": "reproduction.report.shown.figures",
    "claims.page": "reproduction.report",
    "claims.page.legend": "reproduction.report.shown.figures",
    "claims.statements.background": "reproduction.claims.statements.tableaus.splitting",
    "claims.statements.conclusions": "reproduction.claims.statements.performance.discussion",
    "claims.statements.large_steps": "reproduction.claims.statements.performance.discussion",
    "claims.statements.perihelion": "reproduction.claims.statements.figures.kepler",
    "claims.statements.rounding": "reproduction.claims.statements.tableaus.methods",
    "core.levenberg_marquardt": "numerics.search.damped",
    "engine.config_entries": "reproduction.entries",
    "engine.earlier_result": "engine.runs.continuation",
    "engine.modified_moves": "engine.numbers.coefficients",
    "engine.batch.parameters": "engine.numbers.initial_values",
    "engine.numbers.earlier_result": "engine.runs.continuation",
    "engine.runs.sampled": "engine.runs.description",
    "engine.numbers.modified_moves": "engine.numbers.coefficients",
    "engine.sampled": "engine.runs.description",
    "experiments.exact_oscillator.surfaces": "reproduction.experiments.exact_oscillator.run",
    "experiments.sixth_order.tables": "reproduction.experiments.sixth_order.run",
    "experiments.stability.linear.tables": "reproduction.experiments.stability.linear.run",
    "experiments.trained.proof.ensembles": "reproduction.experiments.trained.proof.run",
    "experiments.work_precision.peers.heyoka_regularised": "reproduction.experiments.work_precision.peers.heyoka",
    "experiments.stability.initial_conditions": "reproduction.experiments.stability.kepler.run",
    "experiments.work_precision.comparison_figure": "reproduction.experiments.work_precision.figures.comparison",
    "experiments.work_precision.figure": "reproduction.experiments.work_precision.figures.times",
    "experiments.work_precision.regularised_figure": "reproduction.experiments.work_precision.figures.regularised",
    "experiments.work_precision.recommend": "recommendation",
    "integrators.modified": "integrators",
    "integrators.modified.nearharmonic_2026": "integrators.nearharmonic_2026_modified",
    "integrators.modified.trained": "integrators.trained",
    "integrators.modified_tableau": "integrators.tableau",
    "integrators.processed_tableau": "integrators.tableau",
    "modified_integrators": "integrators:modified_integrators",
    "numerics.levenberg_marquardt": "numerics.search.damped",
    "output.cubes": "reproduction.tasks.experiment",
    "recommendation.libraries": "recommendation.timings",
    "systems.numba_gradients": "systems.numba.gradients",
    "systems.numba_potential": "systems.numba.potential",
    "theory": "integrators.theory",
    "theory.modified_search": "training.family",
    "theory.word_sums": "exact.words",
} | {f"{old}.{name}".removeprefix("."): f"{new}.{name}" for old, new, names in _ROOMS for name in names.split()}

MOVED |= {
    f"experiments.{place}.{old}": f"reproduction.experiments.{place}.reductions"
    for place in (
        "exact_oscillator", "stability.conservation", "stability.henon_heiles", "stability.kepler",
        "stability.kinetic_energy", "stability.rounding", "trained.ideas", "trained.long_runs", "trained.proof",
    )
    for old in ("reduce", "tables")
}  # fmt: skip

MOVED |= {
    f"reproduction.experiments.paper.figures.{old}": "reproduction.experiments.paper.figures.energy_error"
    for old in ("fig1_sho", "fig3_henon_heiles", "fig5_kepler")
}

PACKAGE = "nearharmonic"


def new_name(name: str) -> str | None:
    """Return the full new name of a module from its full old name; None if it has not moved."""
    rest = name.removeprefix(f"{PACKAGE}.")
    parts = rest.split(".")
    for count in range(len(parts), 0, -1):
        moved = MOVED.get(".".join(parts[:count]))
        if moved is not None:
            return ".".join([PACKAGE, moved, *parts[count:]])
    return None


class Moved:
    """Finder and loader of modules by their old names."""

    def __init__(self) -> None:
        self._specs: dict[str, Any] = {}

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """Return the spec of a moved module; None passes the name to the next finder."""
        if not name.startswith(f"{PACKAGE}.") or new_name(name) is None:
            return None
        return ModuleSpec(name, self)  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module under its new name."""
        new = str(new_name(spec.name))
        warnings.warn(f"{spec.name} is now {new.replace(':', '.')}", DeprecationWarning, stacklevel=2)
        module = import_module(new.partition(":")[0])
        self._specs[module.__name__] = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore the spec of the module, which the import system has replaced; the module has run already."""
        old = str(cast("ModuleSpec", module.__spec__).name)
        module.__spec__ = self._specs[module.__name__]
        attribute = str(new_name(old)).partition(":")[2]
        if attribute:
            sys.modules[old] = getattr(module, attribute)


def install() -> None:
    """Insert the finder of old names before all others, once."""
    if not any(isinstance(finder, Moved) for finder in sys.meta_path):
        sys.meta_path.insert(0, Moved())

"""Old names of modules: an import by an old name gives the moved module and a warning."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, cast

#: Old name in the package -> new name; submodules of an old name have moved too. A colon precedes an attribute.
MOVED = {
    "answers": "output.answers",
    "claims": "reproduction.claims",
    "claims.curves": "reproduction.claims.judging.curves",
    "claims.definitions": "reproduction.claims.judging.definitions",
    "claims.documents": "reproduction.claims.pages.documents",
    "claims.in_short": "reproduction.claims.pages.in_short",
    "claims.margins": "reproduction.claims.judging.margins",
    "claims.page": "reproduction.report",
    "claims.page.figures": "reproduction.report.shown.figures",
    "claims.page.legend": "reproduction.report.shown.legend",
    "claims.page.links": "reproduction.report.shown.links",
    "claims.page.pictures": "reproduction.report.shown.pictures",
    "claims.page.results": "reproduction.report.shown.results",
    "claims.page.tables": "reproduction.report.shown.tables",
    "claims.page.wording": "reproduction.report.shown.wording",
    "claims.slopes": "reproduction.claims.judging.slopes",
    "claims.statements.background": "reproduction.claims.statements.tableaus.splitting",
    "claims.statements.coefficients": "reproduction.claims.statements.tableaus.coefficients",
    "claims.statements.comparisons": "reproduction.claims.statements.performance.comparisons",
    "claims.statements.conclusions": "reproduction.claims.statements.performance.discussion",
    "claims.statements.decomposition": "reproduction.claims.statements.equations.decomposition",
    "claims.statements.henon_heiles": "reproduction.claims.statements.figures.henon_heiles",
    "claims.statements.identities": "reproduction.claims.statements.equations.identities",
    "claims.statements.kepler": "reproduction.claims.statements.figures.kepler",
    "claims.statements.large_steps": "reproduction.claims.statements.performance.discussion",
    "claims.statements.methods": "reproduction.claims.statements.tableaus.methods",
    "claims.statements.misprints": "reproduction.claims.statements.equations.misprints",
    "claims.statements.oscillator": "reproduction.claims.statements.figures.oscillator",
    "claims.statements.perihelion": "reproduction.claims.statements.figures.kepler",
    "claims.statements.roles": "reproduction.claims.statements.tableaus.roles",
    "claims.statements.rounding": "reproduction.claims.statements.tableaus.methods",
    "claims.statements.search": "reproduction.claims.statements.equations.search",
    "claims.statements.sizes": "reproduction.claims.statements.tableaus.sizes",
    "claims.statements.splitting": "reproduction.claims.statements.tableaus.splitting",
    "claims.statements.substeps": "reproduction.claims.statements.figures.substeps",
    "claims.statements.trained": "reproduction.claims.statements.tableaus.trained",
    "claims.summary": "reproduction.claims.pages.summary",
    "commands.adopt": "reproduction.commands.adopt",
    "commands.archive": "reproduction.commands.archive",
    "commands.compare": "reproduction.commands.compare",
    "commands.history": "reproduction.commands.history",
    "commands.runs": "reproduction.commands.runs",
    "commands.show": "reproduction.commands.show",
    "commands.verify": "reproduction.commands.verify",
    "config": "reproduction.config.config",
    "core.advance": "core.loops.advance",
    "core.chain": "core.formulas.chain",
    "core.condition": "core.formulas.condition",
    "core.constant": "core.formulas.constant",
    "core.disk": "core.machine.disk",
    "core.expression": "core.formulas.expression",
    "core.jit": "core.machine.jit",
    "core.kernel": "core.loops.kernel",
    "core.landing": "core.loops.landing",
    "core.levenberg_marquardt": "numerics.search.damped",
    "core.link": "core.machine.link",
    "core.native": "core.machine.native",
    "core.numba_functions": "core.machine.numba_functions",
    "core.number": "core.formulas.number",
    "core.operations": "core.machine.operations",
    "core.physics": "core.formulas.physics",
    "core.reals": "core.machine.reals",
    "core.rules": "core.formulas.rules",
    "core.scheduler": "core.loops.scheduler",
    "core.shape": "core.loops.shape",
    "core.tracing": "core.formulas.tracing",
    "core.values": "core.machine.values",
    "display": "registry.display",
    "engine.arrays": "engine.numbers.arrays",
    "engine.clock": "numerics.clock",
    "engine.coefficients": "engine.numbers.coefficients",
    "engine.config_entries": "reproduction.entries",
    "engine.continuation": "engine.runs.continuation",
    "engine.description": "engine.runs.description",
    "engine.earlier_result": "engine.runs.continuation",
    "engine.ensemble": "engine.runs.ensemble",
    "engine.execution": "engine.batch.execution",
    "engine.geometric": "numerics.geometric",
    "engine.handed_on": "engine.settings",
    "engine.initial_values": "engine.numbers.initial_values",
    "engine.invariants": "engine.runs.invariants",
    "engine.kernels": "engine.batch.kernels",
    "engine.lanes": "engine.batch.lanes",
    "engine.modified_moves": "engine.numbers.coefficients",
    "engine.batch.parameters": "engine.numbers.initial_values",
    "engine.numbers.earlier_result": "engine.runs.continuation",
    "engine.runs.sampled": "engine.runs.description",
    "engine.numbers.modified_moves": "engine.numbers.coefficients",
    "engine.numba_runs": "engine.batch.numba_runs",
    "engine.output_times": "engine.runs.output_times",
    "engine.portable": "numerics.portable",
    "engine.problem": "engine.runs.problem",
    "engine.processed": "engine.batch.processed",
    "engine.quasi_random": "numerics.quasi_random",
    "engine.regularised": "engine.batch.regularised",
    "engine.results": "engine.batch.results",
    "engine.rotations": "engine.numbers.rotations",
    "engine.sampled": "engine.runs.description",
    "engine.solution": "engine.runs.solution",
    "engine.statistics": "numerics.statistics",
    "engine.trajectory": "engine.runs.trajectory",
    "exchange.nearest": "exchange.proof.nearest",
    "exchange.oscillator": "exchange.proof.oscillator",
    "exchange.residuals": "exchange.proof.residuals",
    "exchange.suspects": "exchange.proof.suspects",
    "exchange.verdict": "exchange.proof.verdict",
    "experiments": "reproduction.experiments",
    "experiments.derivation.kernels": "reproduction.experiments.derivation.search.kernels",
    "experiments.derivation.simplex": "reproduction.experiments.derivation.search.simplex",
    "experiments.derivation.starts": "reproduction.experiments.derivation.search.starts",
    "experiments.exact_oscillator.surfaces": "reproduction.experiments.exact_oscillator.run",
    "experiments.sixth_order.tables": "reproduction.experiments.sixth_order.run",
    "experiments.stability.linear.tables": "reproduction.experiments.stability.linear.run",
    "experiments.trained.proof.ensembles": "reproduction.experiments.trained.proof.run",
    "experiments.work_precision.peers.heyoka_regularised": "reproduction.experiments.work_precision.peers.heyoka",
    "experiments.paper.chaos": "reproduction.experiments.paper.orbits.chaos",
    "experiments.paper.decompose": "reproduction.experiments.paper.tableaus.decompose",
    "experiments.paper.definitions": "reproduction.config.definitions",
    "experiments.paper.displaced": "reproduction.experiments.paper.orbits.displaced",
    "experiments.paper.figures.energy_error": "plotting.energy_error",
    "experiments.paper.figures.floor": "plotting.floor",
    "experiments.paper.figures.levels": "plotting.levels",
    "experiments.paper.figures.members": "plotting.members",
    "experiments.paper.figures.plot": "plotting.plot",
    "experiments.paper.omissions": "reproduction.experiments.paper.grid.omissions",
    "experiments.paper.overview": "reproduction.experiments.paper.tableaus.overview",
    "experiments.paper.plan": "reproduction.experiments.paper.grid.plan",
    "experiments.paper.substeps": "reproduction.experiments.paper.orbits.substeps",
    "experiments.paper.tables": "reproduction.experiments.paper.tableaus.tables",
    "experiments.paper.tangent": "reproduction.experiments.paper.orbits.tangent",
    "experiments.trained.contestants": "reproduction.experiments.trained.comparison.contestants",
    "experiments.stability.initial_conditions": "reproduction.experiments.stability.kepler.run",
    "experiments.trained.purposes": "reproduction.experiments.trained.problems.purposes",
    "experiments.trained.resampling": "reproduction.experiments.trained.comparison.resampling",
    "experiments.work_precision.comparison_figure": "reproduction.experiments.work_precision.figures.comparison",
    "experiments.work_precision.curve": "recommendation.curve",
    "experiments.work_precision.figure": "reproduction.experiments.work_precision.figures.times",
    "experiments.work_precision.own": "recommendation.own",
    "experiments.work_precision.peers.measure": "reproduction.experiments.work_precision.measure",
    "experiments.work_precision.regularised_figure": "reproduction.experiments.work_precision.figures.regularised",
    "experiments.work_precision.recommend": "recommendation",
    "integrators.modified": "integrators",
    "integrators.modified.nearharmonic_2026": "integrators.nearharmonic_2026_modified",
    "integrators.modified.trained": "integrators.trained_modified",
    "integrators.modified_tableau": "integrators.tableau",
    "integrators.processed_tableau": "integrators.tableau",
    "modified_integrators": "integrators:modified_integrators",
    "numerics.levenberg_marquardt": "numerics.search.damped",
    "output.cubes": "reproduction.tasks.experiment",
    "output.declarations": "reproduction.tasks.declarations",
    "output.definitions": "reproduction.tasks.definitions",
    "output.job": "reproduction.tasks.job",
    "output.palette": "plotting.palette",
    "output.provenance": "reproduction.tasks.provenance",
    "output.receipts": "reproduction.tasks.receipts",
    "output.reduction": "reproduction.tasks.reduction",
    "output.sources": "reproduction.tasks.sources",
    "output.style": "plotting.style",
    "output.user_sources": "reproduction.tasks.user_sources",
    "record": "reproduction.record",
    "record.fingerprint": "reproduction.record.files.fingerprint",
    "record.folders": "reproduction.record.files.folders",
    "record.manifest": "reproduction.record.files.manifest",
    "record.texts": "reproduction.record.files.texts",
    "schema": "reproduction.config.schema",
    "systems.arguments": "systems.definition.arguments",
    "systems.declaration": "systems.definition.declaration",
    "systems.energy": "systems.formulas.energy",
    "systems.gradients": "systems.formulas.gradients",
    "systems.kinetic_energy": "systems.formulas.kinetic_energy",
    "systems.modified_potential": "systems.formulas.modified_potential",
    "systems.multiprecision_functions": "systems.formulas.multiprecision_functions",
    "systems.numba_gradients": "systems.numba.gradients",
    "systems.numba_potential": "systems.numba.potential",
    "systems.oscillator": "systems.formulas.oscillator",
    "systems.quantities": "systems.definition.quantities",
    "systems.regularisation": "systems.formulas.regularisation",
    "systems.source": "systems.formulas.source",
    "systems.system": "systems.definition.system",
    "tableau": "integrators.tableau",
    "theory.modified_search": "training.family",
    "theory.word_sums": "exact.words",
    "training.tailor.start_file": "training.tailor.inputs.start_file",
    "training.tailor.starts": "training.tailor.inputs.starts",
    "user_module": "registry.user_module",
}
MOVED |= {
    f"experiments.{place}.{old}": f"reproduction.experiments.{place}.reductions"
    for place in (
        "exact_oscillator", "stability.conservation", "stability.henon_heiles", "stability.kepler",
        "stability.kinetic_energy", "stability.rounding", "trained.ideas", "trained.long_runs", "trained.proof",
    )
    for old in ("reduce", "tables")
}  # fmt: skip

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

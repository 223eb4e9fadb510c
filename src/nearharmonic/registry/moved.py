"""Old names of modules: an import by one gives the module that has moved, and warns."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

#: Old name below the package -> new one; what is below an old name has moved with it.
MOVED = {
    "answers": "output.answers",
    "claims": "reproduction.claims",
    "claims.page": "reproduction.report",
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
    "core.levenberg_marquardt": "numerics.levenberg_marquardt",
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
    "engine.config_entries": "reproduction.experiments.entries",
    "engine.continuation": "engine.runs.continuation",
    "engine.description": "engine.runs.description",
    "engine.earlier_result": "engine.numbers.earlier_result",
    "engine.ensemble": "engine.runs.ensemble",
    "engine.execution": "engine.batch.execution",
    "engine.geometric": "numerics.geometric",
    "engine.initial_values": "engine.numbers.initial_values",
    "engine.invariants": "engine.runs.invariants",
    "engine.kernels": "engine.batch.kernels",
    "engine.lanes": "engine.batch.lanes",
    "engine.modified_moves": "engine.numbers.modified_moves",
    "engine.numba_runs": "engine.batch.numba_runs",
    "engine.output_times": "engine.runs.output_times",
    "engine.portable": "numerics.portable",
    "engine.problem": "engine.runs.problem",
    "engine.processed": "engine.batch.processed",
    "engine.quasi_random": "numerics.quasi_random",
    "engine.regularised": "engine.batch.regularised",
    "engine.results": "engine.batch.results",
    "engine.rotations": "engine.numbers.rotations",
    "engine.sampled": "engine.runs.sampled",
    "engine.solution": "engine.runs.solution",
    "engine.statistics": "numerics.statistics",
    "engine.trajectory": "engine.runs.trajectory",
    "experiments": "reproduction.experiments",
    "experiments.paper.figures.energy_error": "plotting.energy_error",
    "experiments.paper.figures.floor": "plotting.floor",
    "experiments.paper.figures.levels": "plotting.levels",
    "experiments.paper.figures.members": "plotting.members",
    "experiments.paper.figures.plot": "plotting.plot",
    "experiments.work_precision.curve": "recommendation.curve",
    "experiments.work_precision.own": "recommendation.own",
    "experiments.work_precision.recommend": "recommendation",
    "modified_integrators": "integrators.modified",
    "output.cubes": "reproduction.tasks.cubes",
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
    "user_module": "registry.user_module",
}

PACKAGE = "nearharmonic"


def new_name(name: str) -> str | None:
    """Return the new name of a module with its full old one; None if it has not moved."""
    rest = name.removeprefix(f"{PACKAGE}.")
    parts = rest.split(".")
    for count in range(len(parts), 0, -1):
        moved = MOVED.get(".".join(parts[:count]))
        if moved is not None:
            return ".".join([PACKAGE, moved, *parts[count:]])
    return None


class Moved:
    """A finder of modules by their old names, and the loader of what it finds."""

    def __init__(self) -> None:
        self._specs: dict[str, Any] = {}

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """Return the spec of a module that has moved; None leaves the name to the finders behind this one."""
        if not name.startswith(f"{PACKAGE}.") or new_name(name) is None:
            return None
        return ModuleSpec(name, self)  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module under its new name."""
        new = str(new_name(spec.name))
        warnings.warn(f"{spec.name} is now {new}", DeprecationWarning, stacklevel=2)
        module = import_module(new)
        self._specs[module.__name__] = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Give the module its own spec back, which the import system has replaced: it has run already."""
        module.__spec__ = self._specs[module.__name__]


def install() -> None:
    """Find old names before any other finder does; once."""
    if not any(isinstance(finder, Moved) for finder in sys.meta_path):
        sys.meta_path.insert(0, Moved())

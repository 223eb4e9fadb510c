"""Registered systems: Hamiltonian, parameters, units, initial values and source, as their modules declare them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from importlib import import_module

from bibtex_entries import linked

from nearharmonic.output.page import pipes
from nearharmonic.systems import systems
from nearharmonic.systems.system import System


def systems_part() -> str:
    """Return a section for each registered system."""
    return "\n".join(section_of(systems[name]) for name in systems.registered)


def section_of(system: System) -> str:
    """Return the section of a system."""
    lines = [
        f"## {system.label[0].upper()}{system.label[1:]}",
        "",
        f"$$H = {latex(hamiltonian_of(system))}$$",
        "",
        f"Source: {linked(system.source)}.",
        "",
        *pipes(("property", "value"), _facts(system)),
        "",
    ]
    if system.parameters:
        rows = [(f"`{name}`", one.value, one.unit, one.meaning) for name, one in system.parameters.items()]
        lines += [*pipes(("parameter", "value", "unit", "meaning"), rows), ""]
    recorded = {**system.invariants, **system.observables}
    if recorded:
        rows = [
            (f"`{name}`", "conserved" if name in system.invariants else "recorded", one.unit, one.meaning)
            for name, one in recorded.items()
        ]
        lines += [*pipes(("quantity", "kind", "unit", "meaning"), rows), ""]
    return "\n".join(lines)


def hamiltonian_of(system: System) -> str:
    """Return H as the first line of the docstring of the system's module has it."""
    text = str(import_module(str(systems.module_of(system.name))).__doc__)
    return re.findall(r"H = (.+?)(?= \([A-Z]|: |, |\.\n|\.$)", text)[0]


def latex(formula: str) -> str:
    """Return a formula in LaTeX: roots, and indices of momenta."""
    text = re.sub(r"sqrt\((.*?)\)", r"\\sqrt{\1}", formula)
    text = re.sub(r"\bp([xy])\b", r"p_\1", text)
    return text.replace("|q|", r"\lvert q\rvert")


def _facts(system: System) -> Iterable[Sequence[str]]:
    units = system.units
    (q, p), constants = system.start(float), system.constants(float)
    yield "name", f"`{system.name}`"
    yield "coordinates", str(system.dimension)
    yield "units of q, p, t and energy", ", ".join(units[key] for key in ("q", "p", "t", "energy"))
    yield "q at t = 0", f"({', '.join(system.q0)})"
    yield "p at t = 0", f"({', '.join(system.p0)})"
    yield "energy at t = 0", f"{system.energy(q, p, constants):.6g}"
    yield "end of the interval", f"t = {system.t_end}"
    yield "T quadratic", "yes" if system.quadratic_kinetic_energy else "no: methods that need a quadratic T are refused"
    if system.regularisation is not None:
        yield "regularised", "integrated as an oscillator, with steps in a fictitious time"
    if system.frequencies is not None:
        yield "frequencies for `split`", ", ".join(map(str, system.frequencies))
    yield "diverged", f"if the relative energy error exceeds {system.surface_limit:g}: {system.surface_reason}"
    yield "declared in", f"`{systems.module_of(system.name)}`"

"""Sphinx extension: writes the generated pages of the section Reference before pages are read.

They are pages of the registered methods with facts that the library proves, digits to copy, BibTeX and an example; a
section for each registered system, as its module declares it; and the help texts of the commands.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from decimal import Context, Decimal
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import nearharmonic
from nearharmonic.cli import PROGRAM, command_names, help_text
from nearharmonic.engine.trajectory import Problem
from nearharmonic.integrators import integrators
from nearharmonic.integrators.collocation import Collocation, gauss
from nearharmonic.integrators.tableau import Composition, Tableau
from nearharmonic.output.table import pipes
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic.theory.order import harmonic_order, nystrom_order_of, order_of
from nearharmonic.theory.oscillator import stability_limit
from nearharmonic_paper.pages.library import rounded_down

ROOT = Path(__file__).parents[2]
#: Folder of the generated pages, relative to the folder of the configuration; git ignores it.
FOLDER = "reference/generated"
#: Width of the terminal of help texts: lines of this length fit a page of the site.
COLUMNS = 90

# --- pages of methods -------------------------------------------------------------------------------------------------

COMPOSITION = {"drift": "ABA", "kick": "BAB"}
#: System, and step size per stage, of the example on each page.
SYSTEM, TAU_PER_STAGE = "henon_heiles", 0.1
#: Most samples of a trajectory by default; the energy of a processed method is measured there.
SAMPLES = 1000
#: Pages are reached from the index, not from the navigation: 80 entries beside every page double the time of a build.
PAGE = """---
orphan: true
---

# {label}

One of the [registered methods](../../methods.md). Source: {source}.

{facts}

The orders are proved from the digits below in exact arithmetic. The [glossary](../../glossary.md) explains the terms.

## Coefficients

{coefficients}

## Example

```python
{example}
```

It prints `{printed}`.

## BibTeX

```bibtex
{bibtex}
```
"""

#: What the page of an implicit method has in place of coefficients of kicks and drifts.
NODES = """In units of the step size τ: the first half of the nodes c and of the weights b. Nodes of the second half are
1 - c, weights are equal. [The page on Gauss](../../../how_to/gauss.md) has the equations.

```python
{rows}
```"""
COEFFICIENTS = """In units of the step size τ{square}, in the order of application{processor}.

```python
{rows}
```

As JSON: `nearharmonic export {name} --to json`. [Coefficients from and to other programs](../../../how_to/exchange.md)
has the other targets."""
#: Digits of a node on the page.
DIGITS = 40


def pages() -> dict[str, str]:
    """Return the page of each registered method by its path."""
    return {f"integrators/{name}.md": page_of(integrators[name]) for name in integrators.registered}


def page_of(one: Tableau | Collocation) -> str:
    """Return the page of a method."""
    example, printed = _example(one)
    return PAGE.format(
        label=one.label,
        source=linked(one.source),
        facts="\n".join(pipes(("property", "value"), _facts_of_method(one))),
        coefficients=_coefficients(one),
        name=one.name,
        example=example,
        printed=printed,
        bibtex=bibtex_of(one.name, one.source),
    )


def _coefficients(one: Tableau | Collocation) -> str:
    if isinstance(one, Collocation):
        lines = []
        for letter, numbers in zip("cb", gauss(one.stages), strict=True):
            half = numbers[: (one.stages + 1) // 2]
            digits = (Context(prec=DIGITS).divide(Decimal(x.numerator), Decimal(x.denominator)) for x in half)
            lines += [f"{letter} = (", *(f'    "{x:f}",' for x in digits), ")"]
        return NODES.format(rows="\n".join(lines))
    return COEFFICIENTS.format(
        square=", and `square` in units of τ³" if one.modified else "",
        processor="; the processor is applied at the samples alone" if one.processed else "",
        rows="\n".join(_rows(one)),
        name=one.name,
    )


def _facts_of_method(one: Tableau | Collocation) -> Iterable[tuple[str, str]]:
    limit = stability_limit(one)
    yield "name", f"`{one.name}`"
    if one.other_names[1:]:
        yield "other names", ", ".join(f"`{name}`" for name in one.other_names[1:])
    if one.implicit:
        yield "scheme", "implicit: a step solves equations for all stages"
    else:
        yield "scheme", f"{COMPOSITION[one.first]}: a step begins and ends with a {one.first}"
    yield "stages s", str(one.stages)
    if one.modified:
        yield "forces with a gradient", f"{one.gradients} a step"
    if not one.modified:
        yield "order", str(order_of(one))
    if one.requires:
        yield "order for quadratic T", str(nystrom_order_of(one))
    yield "harmonic order", str(harmonic_order(one))
    if one.generalised_order:
        yield "generalised order, as the source claims it", str(one.generalised_order)
    yield (
        "linear stability limit",
        f"τ = {rounded_down(limit)} for H = (p² + q²)/2, τ/s = {rounded_down(limit / one.stages)}",
    )
    yield "symmetric", "yes" if one.symmetric else "no: a step of -τ does not reverse a step of τ"
    yield "needs", _needs(one)
    yield "digits", f"{one.digits} decimals that {'are computed' if one.implicit else 'the source guarantees'}"
    if one.note:
        yield "note", one.note
    yield "declared in", f"`{integrators.module_of(one.name)}`"


def _needs(one: Tableau) -> str:
    if one.modified:
        return "quadratic T, gradient of |∇V|²" + (", processor" if one.processed else "")
    return "quadratic T" if one.requires else "separable H"


def _rows(one: Tableau) -> list[str]:
    lines = _rows_of(one)
    if one.processor is not None:
        lines += ["", *_rows_of(one.processor, "processor_")]
    return lines


def _rows_of(one: Composition, prefix: str = "") -> list[str]:
    """Return the rows of a composition as assignments of tuples."""
    lines = [f'{prefix}first = "{one.first}"']
    for key in ("kick", "drift", *(["square"] if one.modified else [])):
        lines += [f"{prefix}{key} = (", *(f'    "{text}",' for text in getattr(one, key)), ")"]
    return lines


def _example(one: Tableau) -> tuple[str, str]:
    """Return the lines of an example, and its output."""
    tau = round(TAU_PER_STAGE * one.stages, 12)
    error = Problem(SYSTEM, one.name, samples=SAMPLES)(tau).max_energy_error
    lines = (
        "import nearharmonic as nh",
        "",
        f'run = nh.integrate("{SYSTEM}", "{one.name}", {tau})',
        'print(f"{run.max_energy_error.item():.1e}")',
    )
    return "\n".join(lines), f"{error:.1e}"


# --- BibTeX -----------------------------------------------------------------------------------------------------------

#: Sources of this project begin so; references in them are to the work that they build on.
OWN = ("found by", "trained by")


@cache
def entries() -> dict[str, str]:
    """Return the entries of paper.bib by their keys."""
    text = (ROOT / "paper.bib").read_text(encoding="utf-8")
    return {entry[1]: entry[0] for entry in re.finditer(r"^@\w+\{([^,]+),.*?^\}", text, re.MULTILINE | re.DOTALL)}


@cache
def software() -> str:
    """Return the entry of this software, from CITATION.cff."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    found = dict(re.findall(r'^(?:  - )?([\w-]+): "?(.*?)"?$', text.partition("references:")[0], re.MULTILINE))
    members = {
        "author": f"{{{found['name']}}}",
        "title": found["title"],
        "version": found["version"],
        "url": found["repository-code"],
    }
    return _entry("software", "nearharmonic", members)


def bibtex_of(name: str, source: str) -> str:
    """Return the BibTeX entries of a source.

    Parameters
    ----------
    name : str
        Key of the entry that is made if paper.bib has none.
    source : str
        Source of a method or a system: a text with identifiers such as doi:10.1103/PhysRev.159.98.
    """
    cited = [entry for entry in entries().values() if _is_of(entry, source)]
    if source.startswith(OWN):
        return "\n\n".join([software(), *cited])
    return "\n\n".join(cited) or _entry("misc", name, {"note": source, **_address(source)})


def linked(source: str) -> str:
    """Return a source as Markdown, in which its identifiers are links."""
    text = re.sub(r"doi:(10\.\S+?)(?=[;,.:]?(?:\s|$))", r"[doi:\1](<https://doi.org/\1>)", source)
    text = re.sub(r"arXiv:(\d+\.\d+)", r"[arXiv:\1](https://arxiv.org/abs/\1)", text)
    return re.sub(r"(?<![<(])(https://[^\s,;)]+)", r"<\1>", text)


def _is_of(entry: str, source: str) -> bool:
    """Return True if an entry has an identifier of the source or, if it has none, its first author and year."""
    known = re.findall(r"^  (?:doi|eprint) = \{(.*?)\}", entry, re.MULTILINE)
    if known:
        return any(re.search(rf"(?:doi|arXiv):{re.escape(one)}(?![\w.-]*\w)", source) for one in known)
    author, year = (re.findall(rf"^  {key} = \{{(\w+)", entry, re.MULTILINE)[0] for key in ("author", "year"))
    return re.match(rf"{author}\b[^(]*\({year}\)", source) is not None


def _address(source: str) -> dict[str, str]:
    found = re.search(r"https://[^\s,;)]+", source)
    return {"url": found[0]} if found else {}


def _entry(kind: str, key: str, members: dict[str, str]) -> str:
    written = [f"  {name} = {{{value if name == 'url' else _escaped(value)}}}" for name, value in members.items()]
    lines = ",\n".join(written)
    return f"@{kind}{{{key},\n{lines}\n}}"


def _escaped(text: str) -> str:
    return re.sub(r"([&_#%])", r"\\\1", text)


# --- systems and commands ---------------------------------------------------------------------------------------------


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
        *pipes(("property", "value"), _facts_of_system(system)),
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


def _facts_of_system(system: System) -> Iterable[Sequence[str]]:
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


def commands_part() -> str:
    """Return a section for the program and for each of its commands, as they print their help."""
    texts = {PROGRAM: help_text(columns=COLUMNS)}
    texts |= {f"{PROGRAM} {name}": help_text(name, columns=COLUMNS) for name in command_names()}
    return "\n".join(f"## {name}\n\n```text\n{text.rstrip()}\n```\n" for name, text in texts.items())


# --- the extension ----------------------------------------------------------------------------------------------------


def write_all(folder: Path, texts: Mapping[str, str]) -> None:
    """Write texts by their paths in a folder, only those that have changed, and remove other pages beside them."""
    for place in {(folder / name).parent for name in texts}:
        place.mkdir(parents=True, exist_ok=True)
        for path in place.glob("*.md"):
            if path.relative_to(folder).as_posix() not in texts:
                path.unlink()
    for name, text in texts.items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def write(app: Any) -> None:
    """Write the pages of methods, and the parts that pages include."""
    nearharmonic.problem.__name__ = "problem"  # or it is documented as an alias of a class that users do not see
    parts = {"parts/systems.md": systems_part(), "parts/commands.md": commands_part()}
    write_all(Path(app.confdir) / FOLDER, {**pages(), **parts})


def link_methods(app: Any, docname: str, source: list[str]) -> None:
    """Link each name in the first column of a table of methods to the page of the method."""
    if docname == "reference/methods":
        names = "|".join(integrators.registered)
        source[0] = re.sub(rf"^\| `({names})` \|", r"| [`\1`](generated/integrators/\1.md) |", source[0], flags=re.M)


def hide_source_links(app: Any, pagename: str, templatename: str, context: dict[str, Any], doctree: Any) -> None:
    """Remove the link to the source of a generated page, which the repository does not have."""
    if pagename.startswith(FOLDER):
        context["page_source_suffix"] = None


def setup(app: Any) -> dict[str, bool]:
    """Connect the extension to Sphinx."""
    app.connect("builder-inited", write)
    app.connect("source-read", link_methods)
    app.connect("html-page-context", hide_source_links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Pages of the registered methods: facts that the library proves, digits to copy, BibTeX, and an example."""

from __future__ import annotations

from collections.abc import Iterable
from decimal import ROUND_DOWN, Context, Decimal
from fractions import Fraction

from bibtex_entries import bibtex_of, linked
from mpmath import isinf

from nearharmonic.engine.solution import Problem
from nearharmonic.exact.decimals import BigFloat
from nearharmonic.integrators import integrators
from nearharmonic.integrators.collocation import Collocation, gauss
from nearharmonic.integrators.composition import Composition
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.theory.linear_stability import stability_limit
from nearharmonic.theory.order import harmonic_order, nystrom_order_of, order_of
from nearharmonic.output.page import pipes

COMPOSITION = {"drift": "ABA", "kick": "BAB"}
#: System, and step size per stage, of the example on each page.
SYSTEM, TAU_PER_STAGE = "henon_heiles", 0.1
#: Most samples of a trajectory by default; the energy of a processed method is measured there.
SAMPLES = 1000
#: Columns of the index, which the page explains.
HEADS = ("method", "label", "scheme", "s", "order", "λ_H", "τ", "τ/s")

#: Pages are reached from the index, not from the navigation: 80 entries beside every page double the time of a build.
PAGE = """---
orphan: true
---

# {label}

One of the [registered integrators](../../integrators.md). Source: {source}.

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
    """Return the page of each registered method, and the part of the index, by their paths."""
    found = {f"integrators/{name}.md": page_of(integrators[name]) for name in integrators.registered}
    return {**found, "parts/integrators.md": index()}


def page_of(one: Tableau | Collocation) -> str:
    """Return the page of a method."""
    example, printed = _example(one)
    return PAGE.format(
        label=one.label,
        source=linked(one.source),
        facts="\n".join(pipes(("property", "value"), _facts(one))),
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
            lines += [f"{letter} = (", *(f'    "{_decimal(x)}",' for x in half), ")"]
        return NODES.format(rows="\n".join(lines))
    return COEFFICIENTS.format(
        square=", and `square` in units of τ³" if one.modified else "",
        processor="; the processor is applied at the samples alone" if one.processed else "",
        rows="\n".join(_rows(one)),
        name=one.name,
    )


def _decimal(x: Fraction) -> str:
    return f"{Context(prec=DIGITS).divide(Decimal(x.numerator), Decimal(x.denominator)):f}"


def index() -> str:
    """Return the table of all methods."""
    rows = []
    for name in integrators.registered:
        one, limit = integrators[name], stability_limit(name)
        link = f"[`{name}`](generated/integrators/{name}.md)"
        limits = shown(limit), shown(limit / one.stages)
        scheme = "implicit" if one.implicit else COMPOSITION[one.first]
        rows.append([link, one.label, scheme, one.stages, _orders(one), harmonic_order(one), *limits])
    return "\n".join(pipes(HEADS, rows, align="lllr")) + "\n"


def _orders(one: Tableau) -> str:
    """Return the order; if a quadratic T is needed, that for quadratic T, with that for any other T in brackets."""
    if one.requires is None:
        return str(order_of(one))
    return f"{nystrom_order_of(one)} ({'none' if one.modified else order_of(one)})"


def shown(limit: BigFloat) -> str:
    """Return a limit of the step size with five significant digits, rounded down: the step is then stable."""
    if isinf(limit):
        return "∞"
    return str(Context(prec=5, rounding=ROUND_DOWN).create_decimal(f"{float(limit):.15f}"))


def _facts(one: Tableau | Collocation) -> Iterable[tuple[str, str]]:
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
    yield "linear stability limit", f"τ = {shown(limit)} for H = (p² + q²)/2, τ/s = {shown(limit / one.stages)}"
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

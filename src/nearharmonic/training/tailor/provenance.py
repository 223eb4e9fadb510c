"""Provenance of a method made for a system, in the words of its tableau and as a Python file."""

from __future__ import annotations

import json
from textwrap import fill, wrap

from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau
from nearharmonic.theory.linear_stability import stability_limit
from nearharmonic.training.source_text import palindrome_lines
from nearharmonic.training.tailor.result import Tailored

#: Width of the lines of a file, but for coefficients, which are not cut.
WIDTH = 100


def source_of(found: Tailored) -> str:
    """Return how the method was found: enough to find it again."""
    from nearharmonic import __version__

    asked, search = found.question, found.search
    drawn = "given" if asked.starts is not None else "drawn"
    return (
        f"nearharmonic {__version__}, tailor: {asked.system.name}, {window_text(found)} per stage, seed {asked.seed}, "
        f"{search.trials} trials from {drawn} starts, the best from {search.best.origin}"
    )


def note_of(found: Tailored) -> str:
    """Return for what the method was made, and what it gains there."""
    test = found.test
    others = ", ".join(dict.fromkeys(test.best))
    return (
        f"for {found.question.system.label} alone: step sizes per stage of {window_text(found)}, where max |dH| on "
        f"{found.held_out.size} starts that were not used is {test.gain} decades below that of the best published "
        f"methods, {others}, at equal cost"
    )


def window_text(found: Tailored) -> str:
    """Return the window with its unit."""
    unit = found.question.system.units["t"]
    return f"{found.window[0]:g} to {found.window[1]:g}{'' if unit == '1' else f' {unit}'}"


def file_text(tableau: Tableau, name: str) -> str:
    """Return a Python file that defines the method as TABLEAU.

    Parameters
    ----------
    tableau : Tableau
        The method.
    name : str
        Name that it has in the file.
    """
    kind = "quadratic T" if tableau.requires else "every separable H"
    paragraphs = [
        f"Order {tableau.order} for {kind}, proved; harmonic order {tableau.harmonic_order}, stability limit of the "
        f"oscillator {float(stability_limit(tableau)):.4g}; {tableau.stages} stages, {tableau.first} first.",
        f"Made {tableau.note}.",
    ]
    title = f'"""{_plain(tableau.label)}: a symplectic method made for one system.'
    head = "\n\n".join([title, *map(_filled, paragraphs)])
    fields = {
        "name": name,
        "label": tableau.label,
        "order": tableau.order,
        "harmonic_order": tableau.harmonic_order,
        "first": tableau.first,
    }
    if tableau.requires == QUADRATIC_KINETIC_ENERGY:
        fields["requires"] = tableau.requires
    lines = [f"    {key}={_literal(value)}," for key, value in fields.items()]
    for key in ("kick", "drift"):
        lines += palindrome_lines(key, getattr(tableau, key), "    ")
    lines += [f"    {key}={_literal(getattr(tableau, key))}," for key in ("digits", "source", "note")]
    body = "\n".join(["TABLEAU = Tableau(", *lines, ")"])
    return f'{head}\n"""\n\nfrom nearharmonic import Tableau, palindrome\n\n{body}\n'


def _filled(text: str) -> str:
    return fill(_plain(text), WIDTH, break_long_words=False, break_on_hyphens=False)


def _plain(text: str) -> str:
    """Text that can stand in a docstring."""
    return text.replace("\\", "/").replace('"""', "'''")


def _literal(value: object) -> str:
    """A number or a text as Python writes it, a long text as lines in brackets."""
    if not isinstance(value, str) or len(value) <= WIDTH:
        return repr(value) if not isinstance(value, str) else _quoted(value)
    lines = wrap(value, WIDTH, drop_whitespace=False, break_long_words=False, break_on_hyphens=False)
    return "\n".join(["(", *(f"        {_quoted(line)}" for line in lines), "    )"])


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # of which Python reads the same

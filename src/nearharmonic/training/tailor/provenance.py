"""Provenance of a tailored method, in the fields of its tableau and as a Python file."""

from __future__ import annotations

import json
from textwrap import fill, wrap

from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau
from nearharmonic.integrators.theory.linear_stability import stability_limit
from nearharmonic.training.source_text import palindrome_lines
from nearharmonic.training.tailor.result import Tailored

#: Width of the lines of a file, except for coefficients, which are not wrapped.
WIDTH = 100


def source_of(found: Tailored) -> str:
    """Return a description of the search that is sufficient to repeat it."""
    from nearharmonic import __version__

    asked, search = found.question, found.search
    drawn = "given" if asked.starts is not None else "drawn"
    return (
        f"nearharmonic {__version__}, tailor: {asked.system.name}, {window_text(found)} per stage, seed {asked.seed}, "
        f"{search.trials} trials from {drawn} starts, the best from {search.best.origin}"
    )


def note_of(found: Tailored) -> str:
    """Return the purpose of the method and its gain."""
    test = found.test
    others = ", ".join(dict.fromkeys(test.best))
    return (
        f"for {found.question.system.label} alone: step sizes per stage of {window_text(found)}, where max |dH| on "
        f"{found.held_out.size} starts that were not used is {test.gain} decades below that of the best registered "
        f"methods, {others}, at equal cost"
    )


def window_text(found: Tailored) -> str:
    """Return the window with its unit, as text."""
    unit = found.question.system.units["t"]
    return f"{found.window[0]:g} to {found.window[1]:g}{'' if unit == '1' else f' {unit}'}"


def file_text(tableau: Tableau, name: str) -> str:
    """Return a Python file that defines the method as TABLEAU, with this ``name``."""
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
    """Return a text that is valid in a docstring."""
    return text.replace("\\", "/").replace('"""', "'''")


def _literal(value: object) -> str:
    """Return the Python literal of a number or a text; a long text is wrapped in brackets."""
    if not isinstance(value, str) or len(value) <= WIDTH:
        return repr(value) if not isinstance(value, str) else _quoted(value)
    lines = wrap(value, WIDTH, drop_whitespace=False, break_long_words=False, break_on_hyphens=False)
    return "\n".join(["(", *(f"        {_quoted(line)}" for line in lines), "    )"])


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # Python reads the same text from them

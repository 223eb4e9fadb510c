"""Where a method that was made for a system comes from, in the words of its tableau and as a Python file."""

from __future__ import annotations

from textwrap import fill

from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Row, Tableau
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
        f"Order {tableau.order} for {kind}, harmonic order {tableau.harmonic_order}, {tableau.stages} stages, "
        f"{tableau.first} first.",
        f"Made {tableau.note}.",
    ]
    head = "\n\n".join([f'"""{tableau.label}: a symplectic method made for one system.', *map(_filled, paragraphs)])
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
    lines += [f"    {key}={_row(getattr(tableau, key))}," for key in ("kick", "drift")]
    lines += [f"    {key}={_literal(getattr(tableau, key))}," for key in ("digits", "source", "note")]
    body = "\n".join(["TABLEAU = Tableau(", *lines, ")"])
    return f'{head}\n"""\n\nfrom nearharmonic import Tableau, palindrome\n\n{body}\n'


def _filled(text: str) -> str:
    return fill(_plain(text), WIDTH, break_long_words=False, break_on_hyphens=False)


def _plain(text: str) -> str:
    """Text that can stand in a docstring."""
    return text.replace("\\", "/").replace('"""', "'''")


def _literal(value: object) -> str:
    if not isinstance(value, str):
        return repr(value)
    quoted = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")
    return f'"{quoted}"'


def _row(row: Row) -> str:
    half = len(row) // 2
    numbers = [f'        "{c}",' for c in row[:half]]
    if len(row) % 2:
        numbers.append(f'        centre="{row[half]}",')
    return "\n".join(["palindrome(", *numbers, "    )"])

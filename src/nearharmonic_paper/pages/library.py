"""Pages on the library: its methods, the variables of its files, its errors in other libraries, and its examples."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from decimal import ROUND_DOWN, Context
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import dedent
from typing import TYPE_CHECKING, Any

import numpy as np
from mpmath import isinf

from nearharmonic.engine.trajectory import sweep
from nearharmonic.errors import NearharmonicError
from nearharmonic.exact.polynomials import BigFloat
from nearharmonic.integrators import implicit_integrators, modified_integrators, plain_integrators
from nearharmonic.integrators import integrators as registered
from nearharmonic.output.store import groups_of, read
from nearharmonic.output.table import Cell, from_csv, pipes
from nearharmonic.plotting.style import house_style, log_scale, method_handles, new_figure, style_of
from nearharmonic.systems import systems as known
from nearharmonic.theory.order import harmonic_order, order_of
from nearharmonic.theory.oscillator import stability_limit
from nearharmonic_paper.pages.filling import fills, table
from nearharmonic_paper.report.shown import drawn, on_page

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

# --- docs/reference/methods.md ----------------------------------------------------------------------------------------

#: Step sizes per stage at which methods with modified potentials are compared, the heads of their columns, and the time
#: of a force with the gradient of its square over the time of a force.
COMPARED = {"henon_heiles": ((0.05, 0.1, 0.2), "Hénon-Heiles, τ/s = {:g}", 2.1),
            "kepler": ((10, 20, 40), "Sun-Mercury, {:g} h", 1.3)}  # fmt: skip
#: Methods without a modified potential in this table.
PLAIN = ("ruth", "srkn_b6", "srkn_b11", "srkn_a14", "nystrom_6a8", "babps8o7h")


@fills
def methods() -> dict[str, str]:
    """Proved orders and stability limits of all methods, and errors of those with a modified potential."""
    kinds = {"methods": plain_integrators, "modified": modified_integrators, "implicit": implicit_integrators}
    header = ("name", "label", "scheme", "s", "order", "λ_H", "τ", "τ/s")
    found = {
        kind: table((*header, *["gradients"] * (kind == "modified")), map(proved, names.registered), left=3)
        for kind, names in kinds.items()
    }
    compared = (*modified_integrators.registered, *PLAIN)
    columns = ("name", *(head.format(tau) for taus, head, _ in COMPARED.values() for tau in taus))
    return found | {"errors": table(columns, ((f"`{name}`", *decades(name)) for name in compared))}


def proved(name: str) -> tuple[Cell, ...]:
    """The row of a method; an order for quadratic T stands before the order for every other T."""
    one, limit = registered[name], stability_limit(name)
    scheme = "implicit" if one.implicit else {"drift": "ABA", "kick": "BAB"}[one.first]
    order = f"{one.order} ({'none' if one.modified else order_of(one)})" if one.requires else str(order_of(one))
    row = (f"`{name}`", one.label, scheme, one.stages, order, harmonic_order(one))
    return (*row, rounded_down(limit), rounded_down(limit / one.stages), *([one.gradients] if one.modified else []))


def rounded_down(limit: BigFloat) -> str:
    """A limit of the step size with five significant digits, rounded down: the step is then stable."""
    return "∞" if isinf(limit) else str(Context(prec=5, rounding=ROUND_DOWN).create_decimal(f"{float(limit):.15f}"))


def decades(name: str) -> Iterator[str]:
    """log10 of the errors of a method at equal numbers of evaluations, and in brackets at equal times."""
    one = registered[name]
    for system, (taus, _, factor) in COMPARED.items():
        at = [[tau * one.stages * charge for tau in taus] for charge in (1, factor)]
        equal, charged = (np.log10(sweep(system, one, steps).max_energy_error.values) for steps in at)
        yield from (f"{a:.1f} ({b:.1f})" if one.modified else f"{a:.1f}" for a, b in zip(equal, charged, strict=True))


# --- docs/how_to/files.md, docs/reference/variables.md ----------------------------------------------------------------


@fills
def files(runs: Sequence[str], cubes: Sequence[str]) -> dict[str, str]:
    """Variables of run files and of cubes, each of a dimensionless system and of Kepler's problem."""
    return {"runs": variables_table(map(read, runs)), "cube": variables_table(map(read, cubes))}


@fills
def variables(files: Sequence[str], kinds: Sequence[str], explained: str) -> dict[str, str]:
    """Variables of a file of each kind, named with placeholders; ``explained`` is the page with all attributes."""
    _, _, attributes = Path(explained).read_text(encoding="utf-8").partition("\n## Attributes\n")
    told = re.findall(r"^\| `(\w+)` \|", attributes, re.MULTILINE)
    lines: list[str] = []
    for kind, path in zip(kinds, files, strict=True):
        if unknown := sorted({*read(path).attrs} - {*told}):
            raise NearharmonicError(f"{path} has attributes that {explained} does not explain: {', '.join(unknown)}")
        groups = groups_of(path)
        lines += [f"## `{kind}`"] + [f"In each of the groups {', '.join(f'`{one}`' for one in groups)}:"] * bool(groups)
        lines.append(variables_table(read(path, group=name) for name in groups or (None,)))
    return {"variables": "\n\n".join(lines)}


def variables_table(datasets: Iterator[xr.Dataset]) -> str:
    """A row for each variable of at least one dataset, coordinates of dimensions first.

    The unit of a quantity of Kepler's problem, in which all units differ, is replaced by the quantity's name.
    """
    found: dict[str, list[xr.DataArray]] = {}
    for dataset in datasets:
        for name in dataset.variables:
            found.setdefault(str(name), []).append(dataset[name])
    quantity = {unit: name for name, unit in known["kepler"].units.items() if unit != "1"}
    rows = []
    for name in sorted(found, key=lambda name: (name not in found[name][0].dims, name)):
        units = {str(one.attrs["units"]) for one in found[name]}
        unit = next((f"unit of {quantity[one]}" for one in units if one in quantity), min(units))
        meaning = str(found[name][0].attrs["long_name"]).replace("|", "\\|").replace("_", "\\_")
        rows.append((f"`{name}`", ", ".join(map(str, found[name][0].dims)) or "none", unit, meaning))
    return table(("variable", "dimensions", "unit", "meaning"), rows, left=4)


# --- docs/how_to/adapters.md ------------------------------------------------------------------------------------------


@fills
def adapters(errors: str) -> dict[str, Any]:
    """Energy errors inside other libraries, from a file of them."""
    found = from_csv(Path(errors).read_text(encoding="utf-8"))
    names = found.header[4:]
    header = (*found.header[:4], *(f"`{name}`" for name in names))
    lines = pipes(header, found.rows, align="llllr")
    return {"errors": "\n".join(lines), "figure": drawn(errors_drawn(names, found.rows))}


@house_style
def errors_drawn(names: Sequence[str], rows: Sequence[Sequence[str]]) -> Figure:
    """Draw errors over the first method's error, as libraries have units of their own: a line for each row."""
    figure = new_figure(7, 0.36 * len(rows) + 1.2)
    height = figure.get_figheight()
    figure.subplots_adjust(left=0.5, right=0.98, top=1 - 0.4 / height, bottom=0.55 / height)
    axes = figure.subplots()
    places = range(len(rows), 0, -1)
    for place, row in zip(places, rows, strict=True):
        errors = [float(cell) / float(row[4]) for cell in row[4:]]
        axes.plot([min(errors), max(errors)], [place, place], color="#c8c8c8", linewidth=1, zorder=1)
        for name, error in zip(names, errors, strict=True):
            axes.plot(error, place, **style_of(name).line(markersize=6, linestyle="none"))
    axes.set_yticks(list(places), [f"{row[0]}: {row[1]} ({row[3]})" for row in rows])
    axes.set(xlabel="energy error over leapfrog's error", ylim=(0.3, len(rows) + 0.7))
    axes.tick_params(axis="y", which="both", length=0)
    log_scale(axes, "x")
    labels = [name if name.startswith("trained_") else registered[name].label for name in names]
    handles = method_handles(names, [text.replace("_", " ") for text in labels])
    figure.legend(handles=handles, loc="upper right", ncols=3)
    return figure


# --- docs/start/gallery.md --------------------------------------------------------------------------------------------


#: Cards in a row of the gallery.
CARDS = 3


@fills
def gallery(files: Sequence[str]) -> dict[str, Any]:
    """Cards, a section for each example with its code, and pictures by the names of the examples."""
    places = sorted(map(Path, files))
    titles = {place.stem: (ast.get_docstring(ast.parse(place.read_text("utf-8"))) or place.stem) for place in places}
    cards = [
        f"[![{name}](gallery/{name}.svg)](#{name}) **{name}**: {title.splitlines()[0].replace('|', chr(92) + '|')}"
        for name, title in titles.items()
    ]
    cards += [""] * (-len(cards) % CARDS)
    rows = [cards[i : i + CARDS] for i in range(0, len(cards), CARDS)]
    entries = (f"## {place.stem}\n\n{titles[place.stem].splitlines()[0]}\n\n{entry(place)}" for place in places)
    texts = {"cards": table([""] * CARDS, rows, left=CARDS), "code": "\n\n".join(entries)}
    return texts | {place.stem: picture_drawn(place) for place in places}


def entry(place: Path) -> str:
    """The lines of the function ``main`` of an example, of which the last one writes the picture."""
    text = place.read_text(encoding="utf-8")
    (main,) = (node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef) and node.name == "main")
    lines = dedent("\n".join(text.splitlines()[main.body[0].lineno - 1 : main.end_lineno]))
    written = r'print\("wrote", save\((.+), \["(\w+\.png)"\]\)\[0\]\.resolve\(\)\)'
    code = re.sub(written, r'\1.savefig("\2")', lines).strip()
    return (
        f"<details><summary>the lines that draw it</summary>\n\n```python\n{code}\n```\n\n</details>\n\n"
        f"[{place.name}](../../examples/{place.name})"
    )


def picture_drawn(place: Path) -> bytes:
    """Run an example as if it wrote an SVG file, and return the picture."""
    with TemporaryDirectory() as folder:
        copy = Path(folder, place.name)
        copy.write_text(place.read_text("utf-8").replace(f'"{place.stem}.png"', f'"{place.stem}.svg"'), "utf-8")
        subprocess.run([sys.executable, str(copy)], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        return on_page(str(copy.with_suffix(".svg")))["picture"]

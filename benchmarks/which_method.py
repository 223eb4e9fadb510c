"""The method with the fewest evaluations for a system and an error, as a table of coloured cells.

Run: ``python benchmarks/which_method.py``; ``--page`` writes the numbers to ``docs/start/which_method.csv`` and the
table to ``docs/start/choosing.md``. Counts of evaluations are identical on every machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from html import escape
from itertools import groupby
from typing import Any

import numpy as np
from ranking import RANKED, Place, contests, curves, reached
from timing import parser_of, show

import nearharmonic as nh
from nearharmonic.integrators import implicit_integrators, plain_integrators
from nearharmonic.output.table import Table, save
from nearharmonic.training.family import module_of, published_names
from nearharmonic_paper.pages.filling import power

PAGE, FILE = "docs/start/choosing.md", "which_method.csv"
#: Systems, in the order of the table: motion, interval, and what stands before a call.
MOTIONS = {
    "henon_heiles": ("near-harmonic, cubic V", "Hénon-Heiles, t = 200", "import nearharmonic as nh"),
    "quartic_pair": (
        "near-harmonic, quartic V",
        "two oscillators, t = 200",
        """\
import nearharmonic as nh


def V(q):
    x, y = q
    return (x * x + 2 * y * y) / 2 + (x**4 + y**4) / 8 + x * x * y * y / 2


system = nh.System(name="quartic_pair", V=V, q0=(1, 0.5), p0=(0, 0.3), t_end=200)""",
    ),
    "fput_8": (
        "chain, weakly coupled modes",
        "FPUT, 8 masses, t = 400",
        """\
from itertools import pairwise
from math import pi, sin

import nearharmonic as nh


def V(q):
    return sum((b - a) ** 2 / 2 + (b - a) ** 4 / 40 for a, b in pairwise((0, *q, 0)))


q0 = tuple(f"{sin(pi * (i + 1) / 9):.6f}" for i in range(8))
system = nh.System(name="fput_8", V=V, q0=q0, p0=(0,) * 8, t_end=400)""",
    ),
    "pendulum": (
        "large amplitude",
        "pendulum, 1 rad, t = 200",
        """\
import nearharmonic as nh
from nearharmonic.math import cos

system = nh.System(name="pendulum", V=lambda q: -cos(q[0]), q0=(1,), p0=(0,), t_end=200)""",
    ),
    "kepler": ("eccentric orbit", "Sun-Mercury, ten years", "import nearharmonic as nh"),
}
#: Families of methods, by the class of their cells.
FAMILIES = {
    "nielsen": "the paper",
    "trained": "found here",
    "nystrom": "Nyström type, for T = p²/2",
    "other": "other published",
    "implicit": "implicit",
}
#: Columns of the best of all methods, and of the best published one.
COLUMNS = ("method", "steps", "evaluations", "max_energy_error")
#: Steps between two runs of a curve that are tried for a smaller number.
TRIED = 12


def family(name: str) -> str:
    """Return the family of a method."""
    method = nh.integrators[name]
    if method.implicit:
        return "implicit"
    if name not in published_names():
        return "trained"
    if module_of(name).endswith("nielsen_2015"):
        return "nielsen"
    return "nystrom" if method.requires else "other"


def call(row: Mapping[str, Any]) -> str:
    """Return the Python of the best run of a row."""
    before, t_end = MOTIONS[row["system"]][2], row["t_end"]
    given = "system" if "system = " in before else f'"{row["system"]}"'
    run = f'run = nh.integrate({given}, "{row["method"]}", {t_end} / {row["steps"]}, t_end={t_end})'
    return f"{before}\n{run}\nprint(run.max_energy_error.item())\n"


def measured() -> Table:
    """Return a row for each system and error: the best of all methods, and the best published one."""
    names = (*plain_integrators.registered, *implicit_integrators.registered)
    rows = []
    for _, system, t_end in contests():
        found = curves(system, t_end, names)
        for error in RANKED:
            places = sorted(place for curve in found if (place := reached(curve, error)) is not None)
            public = next(place for place in places if place.method in published_names())
            of_both = [number for place in (places[0], public) for number in fewest(system, t_end, place, error)]
            rows.append((system.name, error, int(t_end), *of_both))
    rows.sort(key=lambda row: ([*MOTIONS].index(row[0]), -row[1]))
    return Table(header=("system", "error", "t_end", *COLUMNS, *(f"published {name}" for name in COLUMNS)), rows=rows)


def fewest(system: Any, t_end: str, place: Place, error: float) -> tuple[str, int, int, float]:
    """Return the fewest steps, below a run's, from which on all tried runs meet the error."""
    tried = np.unique(np.linspace(place.steps / 1.15, place.steps, TRIED).round()).astype(int)
    runs = nh.sweep(system, place.method, [float(Fraction(t_end) / int(steps)) for steps in tried], t_end=t_end)
    misses = np.flatnonzero(~(runs.max_energy_error.values <= error))
    run = runs.isel(tau=misses[-1] + 1 if misses.size else 0)
    return place.method, int(run.steps), int(run.evaluations), float(f"{float(run.max_energy_error):.3g}")


def cells(rows: Iterable[Mapping[str, Any]]) -> str:
    """Return the table of these rows in HTML; a click on a cell copies its call."""
    copy = "navigator.clipboard.writeText(this.dataset.call); this.className = 'copied'"
    heads = "".join(f"<th>error {power(error)}</th>" for error in RANKED)
    lines = ['<div class="which-method">', "<table>", f"<tr><th>motion, measured on</th>{heads}</tr>"]
    for system, of_system in groupby(rows, key=lambda row: row["system"]):
        motion, where, _ = MOTIONS[system]
        lines.append(f"<tr><th>{motion}<br><small>{where}</small></th>")
        for row in of_system:
            tau = f"{row['t_end'] / row['steps']:.3g}{' h' if system == 'kepler' else ''}"
            says = f"{named(row['method'])}<br>τ = {tau}<br>{grouped(row['evaluations'])} evaluations"
            if row["method"] != row["published method"]:
                best = row["published method"]
                chip = f'<span class="{family(best)}">{named(best)}</span>'
                says += f"<br><small>published: {chip} {grouped(row['published evaluations'])}</small>"
            text = escape(call(row)).replace("\n", "&#10;")
            button = f'<button title="Copy the call" data-call="{text}" onclick="{copy}">{says}</button>'
            lines.append(f'<td class="{family(row["method"])}">{button}</td>')
        lines.append("</tr>")
    keys = " ".join(f'<span class="{key}">{says}</span>' for key, says in FAMILIES.items())
    return "\n".join([*lines, "</table>", f"<p>{keys}</p>", "</div>"])


def named(method: str) -> str:
    """Return the name of a method, which may break after an underscore."""
    return f"<code>{method.replace('_', '_<wbr>')}</code>"


def grouped(number: int) -> str:
    """Return a count with a narrow space before each three digits."""
    return f"{number:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


if __name__ == "__main__":
    options = parser_of(__doc__, PAGE).parse_args()
    found = measured()
    parts = {"which-method": cells([dict(zip(found.header, row, strict=True)) for row in found.rows])}
    if options.page:
        save(found, [options.page / "start" / FILE])
    show(parts, PAGE, options.page)

"""The committed verdicts and the pages that show them: ``python -m nearharmonic.claims.documents FILE`` writes all.

``docs/claims.json`` is a copy of FILE, the ``tables/claims.json`` of a result in which every target has run. README
shows some of it, ``docs/claims.md`` all.
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from nearharmonic.output.atomic import write_text

COPY, PAGE, README = "docs/claims.json", "docs/claims.md", "README.md"

#: What README shows of each figure: what is drawn, and which statements.
SHOWN = {
    "fig1": (
        "harmonic oscillator: energy error against step size, double and (dashed) double-double",
        ("fig-1-sixth-order", "fig-1-fourth-order", "outperform-ruth-sho"),
    ),
    "fig2": (
        "error terms κ of the decomposition, ABA and BAB",
        ("fig-2-kappa-7", "fig-2-even-orders-meet", "fig-2-yoshida-diverges"),
    ),
    "fig3": (
        "Hénon-Heiles: energy error against step size",
        ("fig-3-sixth-order-descent", "fig-3-steepest", "outperform-ruth-henon-heiles"),
    ),
    "fig4": (
        "perihelion advance of Mercury against force evaluations per orbit",
        ("fig-4-coincide", "fig-4-intervals"),
    ),
    "fig5": (
        "Sun-Mercury, ten years: energy error against step size",
        ("fig-5-best-maximum", "fig-5-best-mean", "outperform-ruth-kepler"),
    ),
    "fig6": ("substeps in phase space", ("fig-6-c-unstable", "fig-6-others-stable")),
}
#: The table in README and the sentence below it.
_BLOCK = re.compile(r"^\| target and figure \|.*?^Of the \d+ statements .*?\n\n", re.DOTALL | re.MULTILINE)

INTRODUCTION = """# Statements of the paper

Each statement that numbers can decide, with a verdict computed from the results of `snakemake -j2 everything`.
`snakemake -j2` writes the same list to `results/<name>/tables/claims.md`, and says of statements that need another
target which it is. This page is generated from [claims.json](claims.json).
"""

Entry = Mapping[str, str]


def verdict_table(entries: Sequence[Entry]) -> str:
    """Return README's table of verdicts, a row a statement, and the sentence below it."""
    by_id = {entry["id"]: entry for entry in entries}
    lines = ["| target and figure | statement | verdict | measured |", "|---|---|---|---|"]
    for target, (drawn, names) in SHOWN.items():
        for name in names:
            entry = by_id[name]
            told = (entry["statement"], f"**{entry['verdict']}**", entry["value"])
            figure = f"`{target}` {drawn}" if name == names[0] else ""
            lines.append(f"| {figure} | {' | '.join(map(_cell, told))} |")
    return "\n".join([*lines, "", f"{tally(entries)}: [docs/claims.md]({PAGE}).", "", ""])


def tally(entries: Sequence[Entry]) -> str:
    """Say how many statements there are, and how many have each verdict."""
    found = Counter(entry["verdict"] for entry in entries)
    words = (
        ("holds", "hold"),
        ("holds in part", "hold in part"),
        ("fails", "fail"),
        ("not decided here", "are not decided"),
    )
    counts = ", ".join(f"{found[verdict]} {word}" for verdict, word in words if found[verdict])
    return f"Of the {len(entries)} statements of the paper that are checked {counts}"


def page(entries: Sequence[Entry]) -> str:
    """Return the page of all statements, in Markdown."""
    lines = [INTRODUCTION, f"{tally(entries)}.", ""]
    lines += ["| id | in the paper | statement | verdict | measured |", "|---|---|---|---|---|"]
    for entry in entries:
        told = (entry["paper"], entry["statement"], f"**{entry['verdict']}**", entry["value"])
        lines.append(f"| `{entry['id']}` | {' | '.join(map(_cell, told))} |")
    lines += ["", "## How each is decided", ""]
    alike: dict[str, list[Entry]] = {}
    for entry in entries:
        alike.setdefault(entry["threshold"], []).append(entry)
    for threshold, same in alike.items():
        files = ", ".join(f"`{name}`" for name in dict.fromkeys(name for entry in same for name in entry["needs"]))
        ids = ", ".join(f"`{entry['id']}`" for entry in same)
        lines.append(f"- {ids}: {threshold}.{f' From {files}.' if files else ''}")
    return "\n".join([*lines, ""])


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


def write_documents(source: Path, root: Path = Path()) -> None:
    """Copy the verdicts in ``source`` to the folder ``root``, and write README's table and the page from them."""
    text = source.read_text(encoding="utf-8")
    entries = json.loads(text)
    readme = (root / README).read_text(encoding="utf-8")
    write_text(root / COPY, text)
    write_text(root / PAGE, page(entries))
    write_text(root / README, _BLOCK.sub(lambda _: verdict_table(entries), readme, count=1))


if __name__ == "__main__":
    write_documents(Path(sys.argv[1]))

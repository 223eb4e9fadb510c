"""The committed verdicts and their pages; the target ``verdicts`` writes all of them together.

``docs/claims.json`` contains the verdicts on results of all targets. README shows some verdicts, and
``docs/results/claims.md`` shows all. The tests contain an archive of the results that decide.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import wrap
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.atomic import write_bytes
from nearharmonic.output.store import read, write_dataset
from nearharmonic.output.table import pipes
from nearharmonic_paper.claims.claim import FINDING, OPEN, Entry, in_words, of_the_paper, tally
from nearharmonic_paper.claims.judging import MEANINGS
from nearharmonic_paper.claims.performance import CLOSE, ROUND
from nearharmonic_paper.claims.table import FILES, decide, document, results_of
from nearharmonic_paper.claims.tableaus import ENSEMBLES

#: Systems by the ends of ids, in the order of the paper.
SYSTEMS = {"sho": "oscillator", "henon-heiles": "Hénon-Heiles", "kepler": "Sun-Mercury"}


#: README's table: words, id, and the words before the short values if each system has a statement.
SHOWN = (
    ("perform significantly better than previous integrators", "significantly-better", ""),
    ("outperform Ruth by several orders of magnitude", "outperform-ruth", "step sizes with a factor of 100 or more"),
    ("outperform the three methods of Blanes", "outperform-blanes", "step sizes at which a new method is better"),
)

#: The twelve main statements of the paper, at the top of the page.
CARRYING = (
    "significantly-better", "outperform-ruth", "best-performance", "greatly-and-consistently",
    "stable-with-large-steps", "fig-1-sixth-order", "fig-2-reads-order", "fig-3-sixth-order-descent",
    "fig-4-coincide", "fig-5-best-mean", "table-4-solves", "table-4-fourth-order",
)  # fmt: skip

#: Words for each statement that fails.
FAILURES = {
    "outperform-ruth-kepler": "on the Sun-Mercury system the new methods beat Ruth's method by a factor, not by orders "
    "of magnitude",
    "bab-prime-leaves-q": "in BAB' sets p is less exact than q, and the paper says the opposite",
    "eq-16-general": "Eq. 16 alone does not imply order four",
    "s5odr4-of-kahan": "the weights of s5odr4 are Suzuki's, not Kahan's",
}

#: The table in README and the sentence below it.
_BLOCK = re.compile(r"^\| the paper says \|.*?^\w+ statements? fails?[:.].*?\n\n", re.DOTALL | re.MULTILINE)
_WIDTH = 118

INTRODUCTION = """# Statements of the paper

This page lists each statement of the paper that numbers can decide, in the paper's words. Each verdict is computed from
the results of `snakemake -j2 everything`. `snakemake -j2` writes the same list to `results/<name>/tables/claims.md` and
names the extra target that an undecided statement needs. This page is generated from [claims.json](../claims.json).
"""


def verdict_table(entries: Sequence[Entry]) -> str:
    """Return README's table of verdicts, one row per statement, and the sentences below it."""
    by_id = {entry["id"]: entry for entry in entries}
    rows = []
    for words, name, of_systems in SHOWN:
        if of_systems:
            found = [(system, by_id[f"{name}-{ending}"]) for ending, system in SYSTEMS.items()]
            verdicts = [f"{system} **{entry['verdict']}**" for system, entry in found]
            values = [f"{system} {entry['brief']}" for system, entry in found]
            rows.append([words, ", ".join(verdicts), f"{of_systems}: {', '.join(values)}"])
        else:
            rows.append([words, f"**{by_id[name]['verdict']}**", by_id[name]["brief"]])
    lines = pipes(["the paper says", "verdict", "measured"], rows)
    return "\n".join([*lines, "", *wrap(failures_in_words(entries), _WIDTH, break_on_hyphens=False), "", ""])


def failures_in_words(entries: Sequence[Entry]) -> str:
    """Return the statements that fail, in a sentence."""
    failing = {entry["id"]: entry["statement"] for entry in entries if entry["verdict"] == "fails"}
    said = [words for name, words in FAILURES.items() if name in failing]
    said += [statement for name, statement in failing.items() if name not in FAILURES]
    number = {1: "One statement fails", 2: "Two statements fail", 3: "Three statements fail", 4: "Four statements fail"}
    return (
        f"{number.get(len(said), f'{len(said)} statements fail')}: {'; '.join(said)}."
        if said
        else "No statement fails."
    )


def page(entries: Sequence[Entry]) -> str:
    """Return the page of all statements in Markdown, with wrapped lines."""
    by_id = {entry["id"]: entry for entry in entries}
    lines = [INTRODUCTION, *_wrapped(f"{tally(entries)}. {failures_in_words(entries)}")]
    lines += ["## The main statements", ""]
    lines += [line for name in CARRYING for line in _in_short(by_id[name])]
    lines += ["## Errata", ""]
    lines += [line for entry in entries if entry["kind"] == "misprint" for line in _in_short(entry)]
    lines += ["## What general words and the verdicts mean", ""]
    lines += [line for meaning in MEANINGS for line in _item(f"{meaning.words}.")]
    lines += ["", "## All statements", ""]
    lines += [line for section, found in _by_section(entries).items() for line in _folded(section, found)]
    lines += ["## Findings of this project", "", "They are not statements of the paper and are not counted.", ""]
    lines += [line for entry in entries if entry["kind"] == FINDING for line in _told(entry)]
    return "\n".join(lines)


#: Title of each section, and a pattern for the places in it: sections, equations, tables or figures.
SECTIONS = {
    "Abstract": "Abstract",
    "Section 1, Introduction": "Section 1",
    "Section 2, Fundamental theorems": r"Section 2|Eq\. [1-4]\b|Table 1",
    "Section 3, Methods": r"Section 3|Eq\. ([5-9]|1[0-7])\b|Table [23]",
    "Section 4.A, Obtained splitting coefficients": r"Section 4\.A|Table 4",
    "Section 4.B, Numerical tests": r"Section 4\.B|Eq\. (18|19|20)\b|Figure [1-6]\b",
    "Section 5, Discussion": "Section 5",
    "Section 6, Conclusion": "Section 6",
}


def _by_section(entries: Sequence[Entry]) -> dict[str, list[Entry]]:
    """Return the statements of the paper by the titles of their sections, in order."""
    found: dict[str, list[Entry]] = {title: [] for title in SECTIONS}
    for entry in of_the_paper(entries):
        place = entry["paper"]["section"]
        found[next(title for title, places in SECTIONS.items() if re.match(places, place))].append(entry)
    return {title: those for title, those in found.items() if those}


def _folded(title: str, entries: Sequence[Entry]) -> Iterator[str]:
    verdicts = Counter(entry["verdict"] for entry in entries)
    yield from ("<details>", f"<summary>{title}: {in_words(verdicts)}</summary>", "")
    for entry in entries:
        yield from _told(entry)
    yield from ("</details>", "")


def _in_short(entry: Entry) -> Iterator[str]:
    """Return a statement, its verdict and its value."""
    yield from _item(f"“{entry['paper']['sentence']}” ({entry['paper']['section']}; `{entry['id']}`)")
    lines = "\n".join(["", *(f"  {line}" for line in _lines(f"{entry['verdict']} · {entry['value']}.")), ""])
    yield lines.replace(entry["verdict"], f"**{entry['verdict']}**", 1)


def _told(entry: Entry) -> Iterator[str]:
    """Return a statement, its verdict, its value and its threshold."""
    yield f"**{entry['verdict']}** · `{entry['id']}` · {entry['kind']} · {entry['paper']['section']}"
    yield ""
    yield from (f"> {line}" for line in _lines(f"“{entry['paper']['sentence']}”"))
    yield ""
    needs = f" From {', '.join(f'`{name}`' for name in entry['needs'])}." if entry["needs"] else ""
    yield from _item(f"Read as: {entry['statement']}.")
    yield from _item(f"Measured: {entry['value']}.")
    yield from _item(f"Threshold: {entry['threshold']}.{needs}")
    yield from _item(f"Margin: {entry['margin']}.")
    yield ""


def _item(text: str) -> list[str]:
    first, *rest = _lines(text)
    return [f"- {first}", *(f"  {line}" for line in rest)]


def _lines(text: str) -> list[str]:
    return wrap(_escaped(text), _WIDTH, break_on_hyphens=False, break_long_words=False)


def _wrapped(text: str) -> list[str]:
    return [*wrap(text, _WIDTH, break_on_hyphens=False), ""]


def _escaped(text: str) -> str:
    """Return text with escaped Markdown marks, except in code."""
    parts = text.split("`")
    return "`".join(part if i % 2 else re.sub(r"([|*_\[\]])", r"\\\1", part) for i, part in enumerate(parts))


def verdicts(folder: str, readme: str, integrators: Sequence[str], files: Sequence[str] = ()) -> dict[str, str | bytes]:
    """Decide all statements on ``folder`` anew, and return the committed documents; ``files`` are the deciding files.

    The documents are ``recorded``, the deciding results as a zip file; ``document``, the verdicts as JSON; ``page``;
    and ``readme``. A statement that is not decided raises a NearharmonicError.
    """
    entries = decide(results_of(folder, integrators))
    undecided = [f"{entry['id']} ({entry['value']})" for entry in entries if entry["verdict"] == OPEN]
    if undecided:
        message = f"{folder} leaves {len(undecided)} statements undecided, like {undecided[0]}: no verdict is written"
        raise NearharmonicError(message)
    filled = _BLOCK.sub(lambda _: verdict_table(entries), Path(readme).read_text("utf-8"), count=1)
    return {
        "recorded": recorded(Path(folder)), "document": document(entries), "page": page(entries), "readme": filled,
    }  # fmt: skip


#: The kept parts of cubes that the statements use only in part.
_ERRORS = ["max_energy_error", "mean_energy_error", "tau"]
_KEPT: Mapping[str, Callable[[Any], Any]] = {
    "sho": lambda cube: cube[_ERRORS],
    "henon_heiles": lambda cube: cube[_ERRORS],
    "kepler": lambda cube: cube[[*_ERRORS, *(name for name in cube if "perihelion" in name or "per_orbit" in name)]],
    "stability_rounding": lambda cube: cube[["energy_error_rms", "time", "orbit"]].isel(sample=slice(-20, None)),
    "stability_kepler": lambda cube: cube[["energy_error", "evaluations_per_orbit"]].sel(
        eccentricity=[ROUND, CLOSE], method="nearest"
    ),
    "trained": lambda cube: cube[["mean_log_error", "tau_per_stage", "kind"]].sel(ensemble=list(ENSEMBLES)),
    "kinetic_energy": lambda cube: cube[["max_energy_error"]],
}


def recorded(results: Path) -> bytes:
    """Return the deciding files as a zip file, from which tests decide again; equal results give equal bytes."""
    content = BytesIO()
    with TemporaryDirectory() as place, ZipFile(content, "w") as archive:
        for name in FILES:
            path = Path(place, name)
            if path.suffix == ".h5":
                write_dataset(path, _KEPT.get(path.stem, lambda cube: cube)(read(results / name)), {})
            else:
                write_bytes(path, (results / name).read_bytes())
            # Its time is the beginning of the format.
            archive.writestr(ZipInfo(name), path.read_bytes(), ZIP_DEFLATED, 9)
    return content.getvalue()

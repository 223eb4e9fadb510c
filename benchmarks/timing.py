"""Common parts of the benchmarks: interleaved times on one core, options, tables of pages, and compiled C files."""

from __future__ import annotations

import argparse
import ctypes
import subprocess
from math import inf
from pathlib import Path

from nearharmonic.numerics.clock import Patience, interleaved, pinned
from nearharmonic.output.atomic import write_bytes, write_text
from nearharmonic.output.table import filled_page
from nearharmonic_paper.report.shown import drawn

#: Where the pages are.
ROOT = Path(__file__).parents[1]


def parser_of(doc, page=None):
    """Parser of a benchmark: its help has the first line of the docstring; ``--page`` fills a page that it has."""
    parser = argparse.ArgumentParser(description=doc.split("\n", maxsplit=1)[0])
    if page:
        words = f"write the tables to {page}, on a quiet machine, or to its copy below another folder than docs"
        parser.add_argument("--page", nargs="?", const=ROOT / "docs", type=Path, metavar="FOLDER", help=words)
    return parser


def fill(doc, parts, page, picture=None):
    """Run a benchmark whose only option is ``--page``; ``parts()`` measures."""
    options = parser_of(doc, page).parse_args()
    show(parts(), page, options.page, picture)


def asked(doc, default, option="repeats", what="interleaved repeats of each call", page=None):
    """Options of a benchmark with one number, and ``--page`` if it has a page."""
    parser = parser_of(doc, page)
    parser.add_argument(f"--{option}", type=int, default=default, help=f"{what} (default {default})")
    return parser.parse_args()


def show(parts, page, folder, picture=None):
    """Print the generated parts of a page; write them, and the part ``figure``, below a folder if there is one."""
    texts = {name: part for name, part in parts.items() if name != "figure"}
    print("\n\n".join(texts.values()))
    if folder:
        place = folder / Path(page).relative_to("docs")
        write_text(place, filled_page(ROOT / page, texts))
        if picture:
            write_bytes(place.with_name(picture), drawn(parts["figure"]))


def short(number, decimals=1, below=10):
    """A number with ``decimals`` below a bound, and one less from there on."""
    return f"{number:.{decimals if round(number, decimals) < below else decimals - 1}f}"


def shortest(calls, repeats):
    """Shortest time of each call in seconds, by its key, after a first call that compiles and loads code."""
    for call in calls.values():
        call()
    patience = Patience(least=repeats, most=repeats, seconds=inf, longest=inf)
    with pinned():
        times = interleaved(list(calls.values()), patience)
    return dict(zip(calls, map(min, times), strict=True))


def compiled(source, folder, *flags):
    """Shared library of a C file of this folder, compiled into ``folder``."""
    library = Path(folder) / f"{Path(source).stem}{len(list(Path(folder).iterdir()))}.so"
    file = Path(__file__).with_name(source)
    subprocess.run(["cc", *flags, "-shared", "-fPIC", str(file), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))

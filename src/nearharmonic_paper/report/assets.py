"""Assets of the page: its template, style and script."""

from __future__ import annotations

import gzip
from base64 import b64encode
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from nearharmonic_paper.tasks.experiment import beside_the_paper

FOLDER = Path(__file__).parent / "template"
NAMES = ("page.html", "figure.html", "parts.html", "page.css", "page.js", "alive.js")


def digest() -> str:
    """Return the SHA-256 of the parts of the page that the code digest of the package does not cover.

    These are the assets, the version of bokeh, and the declarations of experiments.
    """
    told = [version("bokeh").encode(), repr(beside_the_paper()).encode()]
    return sha256(b"\0".join([*told, *((FOLDER / name).read_bytes() for name in NAMES)])).hexdigest()


def packed(text: str) -> str:
    """Return a text compressed with gzip, in base64: a third of the size of a document of plots."""
    return b64encode(gzip.compress(text.encode(), mtime=0)).decode()


@cache
def _packed_script() -> str:
    from nearharmonic_paper.report import panels

    return packed(panels.script())


def filled(name: str, values: Mapping[str, Any]) -> str:
    """Return a template filled with ``values``; text is escaped, style and scripts are inserted unchanged."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    from nearharmonic_paper.claims.claim import short
    from nearharmonic_paper.report import shown as wording
    from nearharmonic_paper.report.shown import VERDICTS

    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    inserted = (Markup((FOLDER / asset).read_text(encoding="utf-8")) for asset in ("page.css", "page.js", "alive.js"))
    style, script, alive = inserted
    environment.globals |= {
        "wording": wording, "short": short, "looks": VERDICTS, "style": style, "script": script,
        "alive_script": alive,
        "bokeh": _packed_script(),
    }  # fmt: skip
    return environment.get_template(name).render(values)

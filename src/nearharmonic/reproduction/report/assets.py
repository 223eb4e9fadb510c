"""Assets of the page: its template, style and script."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from nearharmonic.reproduction.tasks.experiment import beside_the_paper

FOLDER = Path(__file__).parent / "template"
NAMES = ("page.html", "page.css", "page.js")


def digest() -> str:
    """Return the SHA-256 of the parts of the page that the code digest of the package does not cover.

    These are the assets, the version of bokeh, and the declarations of experiments.
    """
    told = [version("bokeh").encode(), repr(beside_the_paper()).encode()]
    return sha256(b"\0".join([*told, *((FOLDER / name).read_bytes() for name in NAMES)])).hexdigest()


def filled(values: Mapping[str, Any]) -> str:
    """Return the template filled with ``values``; text is escaped, style and scripts are inserted unchanged."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    from nearharmonic.reproduction.claims.results import short
    from nearharmonic.reproduction.report.plots import models
    from nearharmonic.reproduction.report.shown import wording

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.globals |= {"wording": wording, "short": short}
    template, style, script = ((FOLDER / name).read_text(encoding="utf-8") for name in NAMES)
    return environment.from_string(template).render(
        values, style=Markup(style), script=Markup(script), bokeh=Markup(models.script())
    )

"""Sphinx extension: writes the generated pages of the section Reference before pages are read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from command_page import commands_part
from method_pages import pages
from system_page import systems_part

import nearharmonic

#: Folder of the generated pages, relative to that of the configuration; git ignores it.
FOLDER = "reference/generated"


def write_all(folder: Path, texts: Mapping[str, str]) -> None:
    """Write texts by their paths in a folder, only those that have changed, and remove other pages beside them."""
    for place in {(folder / name).parent for name in texts}:
        place.mkdir(parents=True, exist_ok=True)
        for path in place.glob("*.md"):
            if path.relative_to(folder).as_posix() not in texts:
                path.unlink()
    for name, text in texts.items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def write(app: Any) -> None:
    """Write the pages of methods, and the parts that pages include."""
    nearharmonic.problem.__name__ = "problem"  # or it is documented as an alias of a class that users do not see
    parts = {"parts/systems.md": systems_part(), "parts/commands.md": commands_part()}
    write_all(Path(app.confdir) / FOLDER, {**pages(), **parts})


def hide_source_links(app: Any, pagename: str, templatename: str, context: dict[str, Any], doctree: Any) -> None:
    """Remove the link to the source of a generated page, which the repository does not have."""
    if pagename.startswith(FOLDER):
        context["page_source_suffix"] = None


def setup(app: Any) -> dict[str, bool]:
    """Connect the extension to Sphinx."""
    app.connect("builder-inited", write)
    app.connect("html-page-context", hide_source_links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

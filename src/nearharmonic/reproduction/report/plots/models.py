"""Documents of bokeh as texts, and the script that shows them."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path

import bokeh
from bokeh.core.serialization import Serializer
from bokeh.document import Document
from bokeh.models import Plot


def script() -> str:
    """Return bokeh's script, the core without its extensions, as it is installed."""
    return Path(bokeh.__file__).parent.joinpath("server/static/js/bokeh.min.js").read_text(encoding="utf-8")


def document(roots: Sequence[Plot]) -> tuple[str, list[str]]:
    """Return a document with the plots ``roots`` as JSON, and the ids of the roots in it.

    Models are numbered in the order in which they are written, so that the same plots give the same text.
    """
    # Document.add_root would look through all plots again at each of them, which takes as long as all else.
    told = Document(title="nearharmonic").to_json(deferred=False)
    told["roots"] = Serializer(deferred=False).serialize(list(roots)).content
    text = json.dumps(told, separators=(",", ":"), allow_nan=False)
    ids: dict[str, str] = {}
    text = re.sub(r'"id":"(\w+)"', lambda found: f'"id":"{ids.setdefault(found[1], f"m{len(ids)}")}"', text)
    return text, [ids[root.id] for root in roots]

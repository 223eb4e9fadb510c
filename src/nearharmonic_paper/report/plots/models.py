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
    """Return the installed script of bokeh: the core without extensions."""
    return Path(bokeh.__file__).parent.joinpath("server/static/js/bokeh.min.js").read_text(encoding="utf-8")


def document(roots: Sequence[Plot]) -> str:
    """Return a document with the plots ``roots`` as JSON.

    Models are numbered in the order of writing, so that equal plots give equal texts.
    """
    # Document.add_root searches all plots again at each call, which would double the total time.
    told = Document(title="nearharmonic").to_json(deferred=False)
    told["roots"] = Serializer(deferred=False).serialize(list(roots)).content
    text = json.dumps(told, separators=(",", ":"), allow_nan=False)
    ids: dict[str, str] = {}
    return re.sub(r'"id":"(\w+)"', lambda found: f'"id":"{ids.setdefault(found[1], f"m{len(ids)}")}"', text)

"""Bokeh models as data: the objects that its script builds plots from, as its documents hold them.

Bokeh's own classes need two seconds to import, build and write the plots of the page, as much as all else that records
a default run. Script and format are bokeh's, and the tests load the document with bokeh's classes, which check every
name and value.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping
from functools import cache
from gzip import compress
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np


class Model:
    """An object of bokeh's.

    Parameters
    ----------
    kind : str
        Name of its class.
    **attributes
        Its properties: numbers, strings, lists, mappings, arrays, other models, and a :class:`Field` where a property
        is read from a column.
    """

    def __init__(self, kind: str, **attributes: Any) -> None:
        self.kind = kind
        self.attributes = attributes

    def __getitem__(self, name: str) -> Any:
        return self.attributes[name]

    def __setitem__(self, name: str, value: Any) -> None:
        self.attributes[name] = value


class Field(str):
    """Name of the column that a property is read from, one value for each point."""

    __slots__ = ()


def script() -> str:
    """Return bokeh's script, the core without its extensions, as it is installed."""
    found = find_spec("bokeh")
    assert found is not None  # a dependency of the package
    assert found.origin is not None
    return Path(found.origin).parent.joinpath("server/static/js/bokeh.min.js").read_text(encoding="utf-8")


@cache
def script_version() -> str:
    """Return the version of bokeh, from its metadata: importing it takes longer."""
    return version("bokeh")


def document(roots: list[Model]) -> tuple[str, list[str]]:
    """Return a document with the models ``roots`` as JSON, and the ids of the roots in it.

    Models are numbered in the order in which they are written, so that the same models give the same text.
    """
    writer = _Writer()
    config = Model("DocumentConfig", notifications=Model("Notifications"))
    written = [writer.encoded(root) for root in roots]
    told = {"version": script_version(), "title": "nearharmonic", "config": writer.encoded(config), "roots": written}
    return json.dumps(told, separators=(",", ":"), allow_nan=False), [str(root["id"]) for root in written]


class _Writer:
    """Writes a model in full where it first stands, and its id from then on."""

    def __init__(self) -> None:
        self._ids: dict[Model, str] = {}

    def encoded(self, value: Any) -> Any:
        if isinstance(value, Model):
            return self._model(value)
        if isinstance(value, Field):
            return {"type": "field", "field": str(value)}
        if isinstance(value, Mapping):
            return {"type": "map", "entries": [[key, self.encoded(member)] for key, member in value.items()]}
        if isinstance(value, (list, tuple)):
            return [self.encoded(member) for member in value]
        if isinstance(value, np.ndarray):
            return _array(value)
        return value

    def _model(self, model: Model) -> dict[str, Any]:
        if model in self._ids:
            return {"id": self._ids[model]}
        identity = self._ids[model] = f"m{len(self._ids)}"
        attributes = {name: self.encoded(value) for name, value in model.attributes.items()}
        return {"type": "object", "name": model.kind, "id": identity, "attributes": attributes}


def _array(values: np.ndarray[Any, np.dtype[Any]]) -> Any:
    """An array of numbers with every bit, one of strings as a list."""
    if values.dtype.kind in "UO":
        return values.tolist()
    little = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    return {
        "type": "ndarray",
        "array": {"type": "bytes", "data": b64encode(compress(little.tobytes(), mtime=0)).decode()},
        "shape": list(values.shape),
        "dtype": values.dtype.name,
        "order": "little",
    }

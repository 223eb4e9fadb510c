"""Seals of JSON documents: the last member, ``sha256``, is the digest of the others.

A seal reveals accidental changes, such as a flipped bit. It is no signature: anybody can seal a changed document again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from hashlib import sha256
from typing import Any


def digest_of(document: Any) -> str:
    """Return the SHA-256 of ``document`` as JSON: keys sorted, settings as mappings, exact numbers as text."""
    return sha256(json.dumps(document, sort_keys=True, ensure_ascii=False, default=plain).encode()).hexdigest()


def plain(value: Any) -> Any:
    """Return a value that JSON does not know as a mapping or as text."""
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return dict(value) if isinstance(value, Mapping) else str(value)


def sealed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``document`` followed by its seal."""
    return {**document, "sha256": digest_of(document)}


def opened(text: str | bytes) -> dict[str, Any] | None:
    """Return the document in a JSON text without its seal; None if there is no document, no seal or a wrong one."""
    try:
        found = json.loads(text)
        return found if isinstance(found, dict) and found.pop("sha256", None) == digest_of(found) else None
    except (ValueError, RecursionError):
        return None

"""Statements of experiments, found in the modules ``claims`` of their folders."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib import import_module
from types import ModuleType

from nearharmonic_paper.claims.claim import Claim
from nearharmonic_paper.tasks.code.sources import ROOT, path_of
from nearharmonic_paper.tasks.experiment import folders
from nearharmonic_paper.tasks.provenance import code_digest


def modules() -> list[str]:
    """Return the dotted names of the modules with statements."""
    return [name for name in (f"{folder}.claims" for folder in folders()) if path_of(name, ROOT).is_file()]


def digest() -> str:
    """Return the SHA-256 of their code, which the digest of the deciding job does not cover."""
    return code_digest(*modules())


@cache
def own_claims() -> tuple[Claim, ...]:
    """Return the statements in the order of their modules."""
    return tuple(one for name in modules() for one in claims_in(import_module(name)))


def claims_in(module: ModuleType) -> Iterator[Claim]:
    """Yield the statements of a module in their order, including those in tuples."""
    for value in vars(module).values():
        rows = value if isinstance(value, tuple) else (value,)
        yield from (one for one in rows if isinstance(one, Claim))

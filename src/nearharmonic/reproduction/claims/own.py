"""Statements of the experiments themselves, in the module ``claims`` of their folders; nothing lists them."""

from __future__ import annotations

from functools import cache
from importlib import import_module

from nearharmonic.reproduction.claims.claim import Claim
from nearharmonic.reproduction.tasks.experiment import experiments
from nearharmonic.reproduction.tasks.provenance import code_digest
from nearharmonic.reproduction.tasks.sources import PACKAGE, ROOT, path_of


def modules() -> list[str]:
    """Return the dotted names of the modules that hold statements, in the order of the experiments."""
    names = [f"{PACKAGE}.{one.room}.claims" for one in experiments().values()]
    return [name for name in names if path_of(name, ROOT).is_file()]


def digest() -> str:
    """Return the SHA-256 of their code, which the digest of the job that decides does not cover."""
    return code_digest(*modules())


@cache
def own_claims() -> tuple[Claim, ...]:
    """Return the statements in the order of their modules."""
    members = [value for name in modules() for value in vars(import_module(name)).values()]
    rows = [one for value in members for one in (value if isinstance(value, tuple) else (value,))]
    return tuple(one for one in rows if isinstance(one, Claim))

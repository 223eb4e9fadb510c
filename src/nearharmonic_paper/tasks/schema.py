"""Schema of the record as it is read back: receipts, entries of the manifest, lines of the history.

Anybody can write a record with a correct seal, so that types, names and sizes are checked before anything uses them.
Unknown keys are allowed: a newer version may write them. The module is imported when a record is read, because
pydantic takes time to load.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal, NotRequired

from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError, with_config
from typing_extensions import TypedDict  # pydantic asks for this one below Python 3.12

from nearharmonic.errors import shown

#: Levels of mappings and lists in a record: the deepest of this package have eight.
DEEPEST = 40


def _inside(name: str) -> str:
    """Check that this name is inside the folder of results; a foreign record may have any names."""
    path = PurePosixPath(name)
    if path.is_absolute() or not name.isprintable() or {"", ".."} & {*name.split("/")}:
        raise ValueError("must be the name of a file inside the folder of results")
    return name


Name = Annotated[str, AfterValidator(_inside)]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Count = Annotated[int, Field(ge=0, lt=2**63)]
Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False)]
_open = with_config(ConfigDict(strict=True, extra="allow"))
_closed = with_config(ConfigDict(strict=True, extra="forbid"))


@_closed
class OwnSystem(TypedDict, total=False):
    """Definition of a user's system."""

    file: str | None
    base: str | None
    label: str | None
    q0: list[str] | None
    p0: list[str] | None
    parameters: list[Annotated[list[str], Field(min_length=2, max_length=2)]]
    energy: str | None


@_closed
class OwnIntegrator(TypedDict):
    """Definition of a user's integrator."""

    file: str
    written: str
    base: NotRequired[None]


@_closed
class Definitions(TypedDict, total=False):
    """Definitions of users' systems and integrators."""

    systems: dict[str, OwnSystem]
    integrators: dict[str, OwnIntegrator]


class _Made(TypedDict):
    size: Count
    sha256: Digest
    function: Annotated[str, Field(pattern=r"^[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*$")]
    code: str
    coefficients: str
    systems: list[str]
    integrators: list[str]
    volatile: list[str]
    definitions: NotRequired[Definitions]


@_open
class Entry(_Made, total=False):
    """Entry of a file in the manifest."""

    settings: str | None
    evaluations: Count | None
    inputs: dict[Name, str]


@_open
class ReceiptEntry(_Made):
    """Entry of a file in a receipt."""

    modified: Annotated[int, Field(ge=-(2**63), lt=2**63)]
    settings: str
    evaluations: Count
    inputs: dict[Name, str]
    run: str | None


@_open
class Manifest(TypedDict):
    """A manifest without its seal."""

    format: Literal["nearharmonic manifest 1"]
    files: dict[Name, Entry]
    configfiles: NotRequired[list[str]]
    changed: NotRequired[list[Name]]
    former: NotRequired[list[Name]]
    unrecorded: NotRequired[list[Name]]


@_open
class Processor(TypedDict, total=False):
    """The processor of a run."""

    model: str | None
    features: list[str]


@_open
class Process(TypedDict):
    """The process of an unfinished run."""

    host: str
    number: Count
    created: Seconds


class _Started(TypedDict):
    id: Annotated[str, Field(pattern=r"^[\w.-]+$", max_length=100)]
    start: str
    config: dict[str, Any]


@_open
class HistoryLine(_Started, total=False):
    """A run in the history."""

    status: str | None
    exit_status: int | None
    end: str | None
    duration: Seconds | None
    cpu_seconds: Seconds | None
    cores: Count | None
    command: list[str] | None
    targets: list[str] | None
    commit: str | None
    dirty: bool | None
    work: str | None
    config_digest: str | None
    code_digest: str | None
    coefficients_digest: str | None
    versions: dict[str, str] | None
    user_files: dict[str, str]
    platform: str | None
    cpu: Processor | None
    jobs_run: Count | None
    jobs_reused: Count | None
    evaluations: Count | None
    evaluations_skipped: int | None
    made: list[Name] | None
    process: Process | None


@_open
class Settings(TypedDict, total=False):
    """The settings of a job in an attribute of its file."""

    sweep: dict[str, Any]
    definitions: Definitions


_KINDS: Mapping[str, Any] = {
    "manifest": Manifest,
    "receipt": dict[Name, ReceiptEntry],
    "run": HistoryLine,
    "settings": Settings,
}


@cache
def _adapter(kind: str) -> TypeAdapter[Any]:
    return TypeAdapter(_KINDS[kind])


def complaint(kind: Literal["manifest", "receipt", "run", "settings"], document: object) -> str:
    """Return the first reason why a document from JSON is not of this kind, as key, value and rule; empty if it is."""
    if _is_deep(document):
        return f"has more than {DEEPEST} levels of brackets"
    try:
        _adapter(kind).validate_python(document)
    except ValidationError as faults:
        first = faults.errors(include_url=False, include_context=False)[0]
        place = ".".join(str(step) for step in first["loc"] if step != "[key]")
        if first["type"] == "missing":
            return f"lacks {place}"
        rule = re.sub(r"^(Value error, must|\w+ should) ", "", first["msg"])
        rule = "not be there" if first["type"] == "extra_forbidden" else rule
        return f"has {place} = {_short(first['input'])}, which must {rule}"
    return ""


def _short(value: object) -> str:
    text = shown(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _is_deep(document: object) -> bool:
    """Return True if a document has too many levels for functions that call themselves."""
    level = [document]
    for _ in range(DEEPEST):
        within = (one.values() if isinstance(one, dict) else one for one in level if isinstance(one, dict | list))
        level = [member for members in within for member in members]
        if not level:
            return False
    return True

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
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

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
Plain = ConfigDict(strict=True, extra="allow")


class OwnSystem(BaseModel):
    """Definition of a user's system."""

    model_config = ConfigDict(strict=True, extra="forbid")
    file: str | None = None
    base: str | None = None
    label: str | None = None
    q0: list[str] | None = None
    p0: list[str] | None = None
    parameters: list[Annotated[list[str], Field(min_length=2, max_length=2)]] = []
    energy: str | None = None


class OwnIntegrator(BaseModel):
    """Definition of a user's integrator."""

    model_config = ConfigDict(strict=True, extra="forbid")
    file: str
    written: str
    base: None = None


class Definitions(BaseModel):
    """Definitions of users' systems and integrators."""

    model_config = ConfigDict(strict=True, extra="forbid")
    systems: dict[str, OwnSystem] = {}
    integrators: dict[str, OwnIntegrator] = {}


class Entry(BaseModel):
    """Entry of a file in the manifest."""

    model_config = Plain
    size: Count
    sha256: Digest
    function: Annotated[str, Field(pattern=r"^[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*$")]
    code: str
    coefficients: str
    systems: list[str]
    integrators: list[str]
    volatile: list[str]
    settings: str | None = None
    evaluations: Count | None = None
    inputs: dict[Name, str] = {}
    definitions: Definitions = Definitions()


class ReceiptEntry(Entry):
    """Entry of a file in a receipt."""

    modified: Annotated[int, Field(ge=-(2**63), lt=2**63)]
    settings: str
    evaluations: Count
    inputs: dict[Name, str]
    run: str | None


class Manifest(BaseModel):
    """A manifest without its seal."""

    model_config = Plain
    format: Literal["nearharmonic manifest 1"]
    files: dict[Name, Entry]
    configfiles: list[str] = []
    changed: list[Name] = []
    former: list[Name] = []
    unrecorded: list[Name] = []


class Processor(BaseModel):
    """The processor of a run."""

    model_config = Plain
    model: str | None = None
    features: list[str] = []


class Process(BaseModel):
    """The process of an unfinished run."""

    model_config = Plain
    host: str
    number: Count
    created: Seconds


class HistoryLine(BaseModel):
    """A run in the history."""

    model_config = Plain
    id: Annotated[str, Field(pattern=r"^[\w.-]+$", max_length=100)]  # a repetition to 100 takes 30 ms to compile
    start: str
    config: dict[str, Any]
    status: str | None = None
    exit_status: int | None = None
    end: str | None = None
    duration: Seconds | None = None
    cpu_seconds: Seconds | None = None
    cores: Count | None = None
    command: list[str] | None = None
    targets: list[str] | None = None
    commit: str | None = None
    dirty: bool | None = None
    work: str | None = None
    config_digest: str | None = None
    code_digest: str | None = None
    coefficients_digest: str | None = None
    versions: dict[str, str] | None = None
    user_files: dict[str, str] = {}
    platform: str | None = None
    cpu: Processor | None = None
    jobs_run: Count | None = None
    jobs_reused: Count | None = None
    evaluations: Count | None = None
    evaluations_skipped: int | None = None
    made: list[Name] | None = None
    process: Process | None = None


class Settings(BaseModel):
    """The settings of a job in an attribute of its file."""

    model_config = Plain
    sweep: dict[str, Any] = {}
    definitions: Definitions = Definitions()


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

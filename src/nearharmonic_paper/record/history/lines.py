"""Lines of a history: each one is sealed and holds the digest of the line before.

A changed, lost or added line is therefore found, and named by its number. A damaged line never hides a run: it is read
as a run with the status "damaged", of which only id and start are shown. Lines of older versions have no seals.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from nearharmonic.output.atomic import digest_of, read_bytes, sealed

#: A line of the history.
Run = dict[str, Any]

HISTORY = "history.jsonl"
#: Start of the text of every run, which separates lines whose line end is damaged.
FIRST = b'{"id": "'
DAMAGED = "is damaged: its seal does not match"
_BETWEEN = re.compile(rb"\n|(?<=\}).?(?=" + re.escape(FIRST) + rb")", re.DOTALL)
_ID = re.compile(rb"(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)Z-[0-9a-f]{8}")


@dataclass(frozen=True, kw_only=True)
class Line:
    """A line of a history: its number from 1, the SHA-256 of its bytes, and its run without ``before`` and seal.

    ``is_sealed`` is True if it has a seal that matches. ``fault`` says what is wrong with it, if anything. ``known``
    are the digests of earlier lines whose faults it records.
    """

    number: int
    digest: str
    run: Run
    is_sealed: bool
    fault: str
    known: tuple[str, ...]


def lines_of(place: Path) -> list[Line]:
    """Return the lines of a history or a marker, oldest first; none if there is no file."""
    try:
        texts = filter(None, _BETWEEN.split(read_bytes(place)))
    except OSError:
        return []
    found: list[Line] = []
    for number, text in enumerate(texts, start=1):
        found.append(_line(number, text, found[-1] if found else None))
    return found


def faulty_lines(lines: Sequence[Line]) -> list[Line]:
    """Return the lines with a fault that no later line records."""
    known = {digest for line in lines for digest in line.known}
    return [line for line in lines if line.fault and line.digest not in known]


def append(folder: Path, run: Mapping[str, Any], lost: str | None = None) -> None:
    """Append ``run`` to the history of ``folder``, sealed, in one atomic write.

    The line records the faults of earlier lines. An unfinished line of a previous writer, for example after a power
    failure, is ended first. ``lost`` is the digest of a last line that is no longer in the history, which this line
    records too. A history that cannot be written is an OSError; a number that is not finite is a ValueError.
    """
    place = folder / HISTORY
    json.dumps(run, allow_nan=False)  # before a file is created
    file = os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK, 0o666)  # a pipe must not block
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        unfinished = place.read_bytes()[-1:] not in {b"", b"\n"}
        os.write(file, (("\n" if unfinished else "") + text_of(run, lines_of(place), lost)).encode())
        os.fsync(file)
    finally:
        os.close(file)


def text_of(run: Mapping[str, Any], before: Sequence[Line] = (), lost: str | None = None) -> str:
    """Return the text of the line of ``run`` after the lines ``before``, of which the last one may be lost."""
    chain = {"before": before[-1].digest if before else None}
    faults = [line.digest for line in faulty_lines(before)] + ([lost] if lost else [])
    document = {"id": run["id"], **run, **({"faults": faults} if faults else {}), **chain}
    return json.dumps(sealed(document), ensure_ascii=False, allow_nan=False) + "\n"


def _line(number: int, text: bytes, previous: Line | None) -> Line:
    digest = sha256(text).hexdigest()
    document, fault = _document(text)
    if document is None:
        return _damaged(number, digest, text, fault)
    given = {key: document.pop(key, None) for key in ("sha256", "before", "faults")}
    is_sealed = given["sha256"] is not None
    if is_sealed and not _follows(given["before"], previous):
        fault = "does not follow the line before: a line was lost, added or changed there"
    elif not is_sealed and previous is not None and previous.is_sealed:
        fault = "has no seal, while the line before has one"
    known = tuple(given["faults"] or ())
    return Line(number=number, digest=digest, run=document, is_sealed=is_sealed, fault=fault, known=known)


def _follows(before: object, previous: Line | None) -> bool:
    """Return True if ``before`` is the digest of the previous line, or if that line is damaged itself."""
    if previous is None:
        return before is None
    return previous.fault != "" or before == previous.digest


def _document(text: bytes) -> tuple[Run | None, str]:
    """Return a run with its seal; None and the fault if the text is no run or has a seal that does not match."""
    from nearharmonic_paper.tasks.receipts.schema import complaint

    try:
        found: Any = json.loads(text)
        if not isinstance(found, dict):
            return None, DAMAGED
        rest = {key: value for key, value in found.items() if key != "sha256"}
        if digest_of(rest) != found.get("sha256") and ("sha256" in found or "before" in found):
            return None, DAMAGED
    except (ValueError, RecursionError):
        return None, DAMAGED
    fault = complaint("run", found)
    return (None, f"is no run: it {fault}") if fault else (found, "")


def _damaged(number: int, digest: str, text: bytes, fault: str) -> Line:
    name = _ID.search(text[:60])
    run: Run = {"id": f"line-{number}", "start": "", "config": {}, "status": "damaged"}
    if name:
        year, month, day, *clock = (part.decode() for part in name.groups())
        run |= {"id": name[0].decode(), "start": f"{year}-{month}-{day}T{':'.join(clock)}.000Z"}
    return Line(number=number, digest=digest, run=run, is_sealed=False, fault=fault, known=())

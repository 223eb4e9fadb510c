"""Check of the members of a zip file, so that an archive without a fault can be unpacked by any program.

A foreign archive may have the right seal: the seal protects from damage and says nothing about who made it.
"""

from __future__ import annotations

import stat
from collections import Counter
from collections.abc import Iterator
from zipfile import ZIP_STORED, ZipFile, ZipInfo

#: Flag of an encrypted member.
_ENCRYPTED = 0x1
#: Bits of the external attributes to the right of the mode of Unix.
_MODE = 16


def faults_of_members(archive: ZipFile, size: int) -> Iterator[str]:
    """Yield a sentence for each member that ``nearharmonic archive`` does not write, from the directory alone.

    Parameters
    ----------
    archive : ZipFile
        The open archive.
    size : int
        Size of its file, in bytes.
    """
    members = archive.infolist()
    counts = Counter(one.filename.casefold() for one in members)
    written = {one.filename.casefold(): one.filename for one in members}
    yield from (f"{written[name]} is in the archive {count} times" for name, count in counts.items() if count > 1)
    for one in members:
        yield from (f"{one.filename} {fault}" for fault in _faults(one))
    if sum(one.compress_size for one in members) > size:
        yield "members of the archive overlap: together they are larger than its file"


def _faults(member: ZipInfo) -> Iterator[str]:
    if not is_plain(member.orig_filename):
        yield "is no plain path inside of the archive"
    mode = member.external_attr >> _MODE
    if stat.S_IFMT(mode) not in {0, stat.S_IFREG}:
        yield f"is {'a symbolic link' if stat.S_ISLNK(mode) else 'no regular file'}"
    if member.flag_bits & _ENCRYPTED:
        yield "is encrypted"
    if member.compress_type != ZIP_STORED:
        yield "is compressed: the members of an archive are stored as they are"


def is_plain(name: str) -> bool:
    """Return True for a relative path with slashes whose parts are ordinary names on every system."""
    return name.isprintable() and not {"", ".", ".."} & {*name.split("/")} and not {"\\", ":"} & {*name}

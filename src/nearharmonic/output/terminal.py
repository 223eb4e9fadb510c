"""Text for a terminal: escape sequences in names from files never reach it."""

from __future__ import annotations

import re
import struct

#: Control characters except tab and line feed; marks of direction and of no width; separators; halves of surrogates.
_UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)


def printable(text: str) -> str:
    r"""Return ``text`` with an escape such as ``\u001b`` in place of each character that controls a terminal.

    Inside a string of JSON the escape means the same character. Tabs and line feeds stay.
    """
    return _UNSAFE.sub(_escaped, text)


def in_one_line(text: str) -> str:
    """Return ``text`` as :func:`printable` does, with its tabs and line feeds escaped too."""
    return printable(text).replace("\n", "\\n").replace("\t", "\\t")


def _escaped(found: re.Match[str]) -> str:
    units = struct.iter_unpack(">H", found[0].encode("utf-16-be", "surrogatepass"))
    return "".join(f"\\u{unit:04x}" for (unit,) in units)

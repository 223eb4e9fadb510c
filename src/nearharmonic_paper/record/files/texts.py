"""Tables, documents and pictures of a result, each checked against its record before use."""

from __future__ import annotations

from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.output.atomic import read_bytes
from nearharmonic.output.store import unusable
from nearharmonic.output.table import Table, from_csv
from nearharmonic_paper.record.files import manifest


class Texts:
    """The text files of a folder of results, ``results/<name>``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @cached_property
    def _entries(self) -> dict[str, dict[str, Any]]:
        return manifest.entries_of(self._folder)

    def read(self, name: str) -> str:
        """Return the text of the file ``name``, relative to the folder.

        A file that is missing, no text, or changed after its job wrote it is a ResultFileError; the message has the
        command that makes it again.
        """
        place = self._folder / name
        try:
            content = read_bytes(place)
            if name in self._entries and sha256(content).hexdigest() != self._entries[name]["sha256"]:
                raise self.unusable(name, "is damaged: its bytes are not those that its job wrote")
            return content.decode()
        except FileNotFoundError:
            raise self.unusable(name, "does not exist") from None
        except (OSError, UnicodeDecodeError) as error:
            raise self.unusable(name, "cannot be read") from error

    def table(self, name: str) -> Table:
        """Return the table in the CSV file ``name``; a file without one is an error as for :meth:`read`."""
        text = self.read(name)
        try:
            return from_csv(text)
        except NearharmonicError as error:
            raise self.unusable(name, "holds no table") from error

    def unusable(self, name: str, complaint: str) -> ResultFileError:
        """Return the error for the file ``name``."""
        return unusable(self._folder / name, complaint)

"""Members of an archive, and the formats of their files."""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from nearharmonic.errors import ResultFileError
from nearharmonic.output import atomic as reading

#: Media type and description of a file by its ending.
FORMATS = {
    ".cff": ("application/yaml", "Citation File Format"),
    ".csv": ("text/csv", "CSV with every digit"),
    ".h5": ("application/vnd.hdfgroup.hdf5", "HDF5, netCDF-4 conventions"),
    ".html": ("text/html", "HTML"),
    ".json": ("application/json", "JSON"),
    ".jsonl": ("application/jsonl", "JSON, one object a line"),
    ".md": ("text/markdown", "Markdown"),
    ".pdf": ("application/pdf", "PDF"),
    ".png": ("image/png", "PNG"),
    ".py": ("text/x-python", "Python"),
    ".rst": ("text/x-rst", "reStructuredText"),
    ".smk": ("text/x-snakemake", "Snakemake"),
    ".svg": ("image/svg+xml", "SVG"),
    ".tex": ("application/x-tex", "LaTeX"),
    ".toml": ("application/toml", "TOML"),
    ".yaml": ("application/yaml", "YAML"),
    "": ("text/plain", "plain text"),
}
_OTHER = ("application/octet-stream", "binary")


@dataclass(frozen=True, kw_only=True)
class Member:
    """A file of the archive.

    Attributes
    ----------
    path : str
        Its path in the archive, with slashes.
    source : Path or bytes
        Source of its bytes.
    size : int
        Number of bytes.
    sha256 : str
        Digest of the bytes, in hexadecimal digits.
    description : str
        One sentence.
    run : str, optional
        Id of the run that made it; None for files that the archive adds.
    """

    path: str
    source: Path | bytes
    size: int
    sha256: str
    description: str
    run: str | None = None

    @classmethod
    def of_bytes(cls, path: str, content: bytes, description: str) -> Member:
        """Return the member whose bytes are ``content``."""
        digest = hashlib.sha256(content).hexdigest()
        return cls(path=path, source=content, size=len(content), sha256=digest, description=description)

    @classmethod
    def of_file(cls, path: str, place: Path, description: str) -> Member:
        """Return the member with the present bytes of a file that has no digest on record."""
        with opened(place) as file:
            return cls.of_bytes(path, file.read(), description)


def opened(source: Path | bytes) -> BinaryIO:
    """Open the source of a member for reading.

    Raises
    ------
    ResultFileError
        The file cannot be read.
    """
    if isinstance(source, bytes):
        return io.BytesIO(source)
    try:
        return reading.opened(source)
    except OSError as error:
        message = f"{source} cannot be read: {error.strerror}"
        raise ResultFileError(message) from error


def format_of(path: str) -> tuple[str, str]:
    """Return the media type of a file and its format in words, by the ending of ``path``."""
    return FORMATS.get(PurePosixPath(path).suffix, _OTHER)

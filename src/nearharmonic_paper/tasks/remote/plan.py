"""Frozen jobs: all that a job of the workflow needs, in a file of its own that is named after its digest.

The module is separate because a job on a node imports it, and nothing of Snakemake.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.atomic import read_bytes, write_bytes

SUFFIX = ".job"


class Files(list[str]):
    """Files of a job in their order; the named ones, single or several, are attributes too."""

    def __init__(self, files: Iterable[str], named: Mapping[str, str | list[str]]) -> None:
        super().__init__(files)
        self.__dict__.update(named)

    def items(self) -> Iterator[tuple[str, str | list[str]]]:
        """Yield the names with their files."""
        yield from self.__dict__.items()


@dataclass(frozen=True, kw_only=True)
class FrozenJob:
    """A job with the members that :mod:`nearharmonic_paper.tasks.job` uses of Snakemake's object.

    Attributes
    ----------
    function : str
        Function of that module: ``run`` or ``draw``.
    input, output : Files
        Paths, relative to the working folder.
    params : SimpleNamespace
        Its member is ``task``, or ``tasks`` and ``captions`` by the names of the outputs; and ``transparent``, if set.
    log : list of str
        Its log file.
    threads : int
        Number of threads.
    patience : float
        Seconds to wait for inputs that another node wrote.
    """

    function: str
    input: Files
    output: Files
    params: SimpleNamespace
    log: list[str]
    threads: int
    patience: float

    @property
    def tasks(self) -> list[dict[str, Any]]:
        """Its tasks, as :func:`nearharmonic_paper.tasks.provenance.task` describes them."""
        return [self.params.task] if self.function == "run" else [*self.params.tasks.values()]

    def write(self, folder: str | Path) -> Path:
        """Write the job to a file in ``folder`` and return its path."""
        content = pickle.dumps(self)
        place = Path(folder, sha256(content).hexdigest()).with_suffix(SUFFIX)
        write_bytes(place, content)
        return place


def read(place: str | Path) -> FrozenJob:
    """Return the job in a file of :meth:`FrozenJob.write`.

    Raises
    ------
    NearharmonicError
        The file is absent, or its bytes are not those that its name tells.
    """
    path = Path(place)
    try:
        content = read_bytes(path)
    except OSError as error:
        message = f"the job {path} cannot be read: {error.strerror}"
        raise NearharmonicError(message) from None
    if sha256(content).hexdigest() != path.stem:
        message = f"the job {path} is damaged: its digest is not its name"
        raise NearharmonicError(message)
    job: FrozenJob = pickle.loads(content)
    return job

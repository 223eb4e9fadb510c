"""Jobs on other computers: each gets a frozen description and does not read the workflow again.

A frozen job has all that a job of the workflow needs, in a file that is named after its digest. A job on a node imports
this module, and nothing of Snakemake.
"""

from __future__ import annotations

import os
import pickle
import re
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.atomic import read_bytes, write_bytes

SUFFIX = ".job"
#: Command that runs Python on the nodes, for example in a container; by default the present interpreter.
PYTHON = "NEARHARMONIC_NODE_PYTHON"
#: The process that ends the jobs of this computer with itself (``job.LEADER``) has no meaning on another.
ENVIRONMENT = "env -u NEARHARMONIC_LEADER"
#: Parameters of rules that jobs read.
PARAMS = ("task", "tasks", "captions", "transparent", "earlier", "documents")
#: Seconds for which a job waits for inputs that another node wrote.
PATIENCE = 60.0


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
    input, output : Files
        Paths, relative to the working folder.
    params : SimpleNamespace
        The parameters of the rule among :data:`PARAMS`.
    log : list of str
        Its log file.
    threads : int
        Number of threads.
    patience : float
        Seconds to wait for inputs that another node wrote.
    """

    input: Files
    output: Files
    params: SimpleNamespace
    log: list[str]
    threads: int
    patience: float = PATIENCE

    @property
    def tasks(self) -> list[dict[str, Any]]:
        """Its tasks, as :func:`nearharmonic_paper.tasks.provenance.task` describes them."""
        several = getattr(self.params, "tasks", None)
        return [self.params.task] if several is None else [*several.values()]

    def write(self, folder: str | Path) -> Path:
        """Write the job to a file in ``folder`` and return its path."""
        content = pickle.dumps(self)
        place = Path(folder, sha256(content).hexdigest()).with_suffix(SUFFIX)
        write_bytes(place, content)
        return place


def frozen(job: Any) -> FrozenJob:
    """Return the frozen form of a job of Snakemake."""
    return FrozenJob(
        input=_files(job.input),
        output=_files(job.output),
        params=SimpleNamespace(**{name: value for name, value in job.params.items() if name in PARAMS}),
        log=[str(file) for file in job.log],
        threads=int(job.threads),
    )


def _files(files: Any) -> Files:
    named = {name: str(one) if isinstance(one, str) else [*map(str, one)] for name, one in files.items()}
    return Files(map(str, files), named)


def command_of(job: Any, folder: str | Path) -> str:
    """Return the shell command that runs a job of Snakemake on a node; its frozen form is a file in ``folder``."""
    python = os.environ.get(PYTHON) or shlex.quote(sys.executable)
    return f"{ENVIRONMENT} {python} -m {__package__} {shlex.quote(str(frozen(job).write(folder)))}"


def is_in_array(job: Any, arrays: str | None) -> bool:
    """Return True if a job is submitted in an array, by the setting ``array_jobs`` of the plugin for SLURM."""
    return not {"all", job.name}.isdisjoint(re.split(r"[,;\s]+", arrays or ""))


def read(place: str | Path) -> FrozenJob:
    """Return the job in a file of :meth:`FrozenJob.write`."""
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

"""Command of a job on a node: ``python -m nearharmonic_paper.tasks.remote FILE``."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from pathlib import Path

from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.tasks import job
from nearharmonic_paper.tasks.provenance import digests
from nearharmonic_paper.tasks.remote import FrozenJob, read


def main(place: str) -> None:
    """Run the frozen job in the file ``place``."""
    try:
        frozen = read(place)
        check_code(frozen)
        wait_for(frozen.input, frozen.patience)
        prepare(frozen)
    except NearharmonicError as error:
        raise SystemExit(str(error)) from None
    (job.draw if hasattr(frozen.params, "tasks") else job.run)(frozen)


def check_code(frozen: FrozenJob) -> None:
    """Compare the digests of a job with those of the package on this node; users' files are checked by the job."""
    for task in frozen.tasks:
        if task["definitions"]:
            continue
        here = digests(task["function"], task["systems"], task["integrators"])
        if any(here[what] != task[what] for what in here):
            message = f"{task['function']}: this node has another version of the package, of numpy, numba or llvmlite"
            raise NearharmonicError(message)


def wait_for(files: Iterable[str], patience: float) -> None:
    """Wait until files exist: a shared folder may show files of another node late."""
    end = time.monotonic() + patience
    for file in files:
        while not Path(file).exists():
            if time.monotonic() > end:
                message = f"the input {file} is not visible on this node after {patience:g} s"
                raise NearharmonicError(message)
            time.sleep(0.5)


def prepare(frozen: FrozenJob) -> None:
    """Remove the earlier outputs of a job but pages, which it updates; create the folders of outputs and log."""
    for file in map(Path, [*frozen.output, *frozen.log]):
        if "docs" not in file.parts:
            file.unlink(missing_ok=True)
        file.parent.mkdir(parents=True, exist_ok=True)


if __name__ == "__main__":
    main(sys.argv[1])

"""A job of the workflow, here or on another computer: calls the package function of a rule, and writes its results.

A job of the workflow: calls the package function of a rule, writes its results, and logs its messages.

Jobs on other computers: each gets a frozen description and does not read the workflow again.

A frozen job has all that a job of the workflow needs, in a file that is named after its digest. A job on a node imports
this module, and nothing of Snakemake.

Command of a job on a node: ``python -m nearharmonic_paper.tasks.job FILE``.
"""

from __future__ import annotations

import gc
import os
import pickle
import platform
import re
import shlex
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from hashlib import sha256
from inspect import signature
from io import BufferedWriter, FileIO, TextIOWrapper
from pathlib import Path
from select import select
from signal import SIGKILL
from threading import Thread
from types import SimpleNamespace
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators
from nearharmonic.output.atomic import read_bytes, write_bytes, write_text
from nearharmonic.output.dataset import Contents
from nearharmonic.output.table import Table, save_document
from nearharmonic.output.table import save as save_table
from nearharmonic.systems import systems
from nearharmonic_paper.tasks.provenance import (
    WHOLE,
    Receipt,
    defined,
    digests,
    files_in,
    folder_of,
    function_of,
    named_in,
    provenance,
)

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


Places = Sequence[str]

#: Environment variable with the host and the number of the process of Snakemake: a job ends with it.
LEADER = "NEARHARMONIC_LEADER"


def run(snakemake: Any) -> None:
    """Run the job of a rule whose ``params.task`` comes from :func:`nearharmonic_paper.tasks.provenance.task`.

    The function is called with its settings, and with the paths of the inputs of the rule under their names. Its
    optional parameter ``threads`` is the number of threads of the job; ``earlier`` is made by the class in
    ``params.earlier``. It returns a mapping with a result for each named output, of the types of :func:`write`.
    """
    with logged(snakemake.log[0]), rarely_collected():
        task = snakemake.params.task
        function, origin = function_of(task), provenance(task)
        offered: dict[str, Callable[[], Any]] = {
            "threads": lambda: snakemake.threads,
            "earlier": lambda: _earlier(snakemake, origin),
        }
        extra = {name: value() for name, value in offered.items() if name in signature(function).parameters}
        inputs = {name: _plain(value) for name, value in snakemake.input.items()}
        receipt = Receipt(snakemake.log[0], map(str, snakemake.input))
        with covered(task):
            results = function(**task["settings"], **inputs, **extra)
            for name, made in snakemake.output.items():
                places = [made] if isinstance(made, str) else list(made)
                write(results[name], places, origin, transparent=_is_transparent(snakemake))
                receipt.add(places, task, **_remarks(function, results[name]))
        receipt.write()


def draw(snakemake: Any) -> None:
    """Draw the figures of one cube, each with the package function in ``params.tasks`` under its stem.

    A function gets the cube, which is read once, if the rule has the input ``cube``; it returns a matplotlib
    ``Figure``. A figure with two names is drawn once. Errors are those of :func:`run`.
    """
    from nearharmonic.output.store import read

    with logged(snakemake.log[0]), rarely_collected():
        shown = [read(snakemake.input.cube)] if hasattr(snakemake.input, "cube") else []
        receipt = Receipt(snakemake.log[0], map(str, snakemake.input))
        drawn: dict[str, list[str]] = {}
        for stem, task in snakemake.params.tasks.items():
            places = list(getattr(snakemake.output, stem))
            what = f"{task['function']} {task['settings']}"
            if what in drawn:
                for made, place in zip(drawn[what], places, strict=True):
                    write_bytes(place, Path(made).read_bytes())
            else:
                with covered(task):
                    figure = function_of(task)(*shown, **task["settings"])
                    figure.set_label(snakemake.params.captions[stem])
                    write(figure, places, provenance(task), transparent=_is_transparent(snakemake))
            drawn[what] = places
            receipt.add(places, task)
        receipt.write()


def refresh(snakemake: Any) -> None:
    """Make documents again that show other results, if they are there and older than an input of this job.

    The parameter ``documents`` has the task, the input, the output and the log of the job of each document. One that
    cannot be made is a warning.
    """
    with logged(snakemake.log[0]):
        newest = max(Path(path).stat().st_mtime_ns for path in snakemake.input)
        for one in snakemake.params.documents:
            first = Path(next(iter(one["output"].values()))[0])
            if first.is_file() and first.stat().st_mtime_ns < newest:
                params, named = SimpleNamespace(task=one["task"]), Files(one["input"], {})
                job = SimpleNamespace(input=named, output=one["output"], params=params, log=[one["log"]], threads=1)
                try:
                    run(job)
                except SystemExit as error:
                    text = f"nearharmonic: warning: the page of results may be old: {error}"
                    print(text, file=sys.__stderr__, flush=True)
                newest = max(newest, first.stat().st_mtime_ns)


def _remarks(function: Any, result: Any) -> dict[str, Any]:
    """Return the remarks of a receipt on a result."""
    if hasattr(function, "measures_time"):
        return {"volatile": [WHOLE]}
    if isinstance(result, Contents):
        return {"evaluations": result.evaluations}
    return {"volatile": result.volatile} if isinstance(result, Table) else {}


@contextmanager
def rarely_collected() -> Iterator[None]:
    """Run the garbage collector rarely inside the block, and never after the block.

    In a process of one second the collections take a tenth of the time, and the last one, at exit, another tenth.
    """
    gc.set_threshold(200_000)
    yield
    gc.freeze()


@contextmanager
def covered(task: Mapping[str, Any]) -> Iterator[None]:
    """Restrict registries to entries that the digests of ``task`` cover: edits of others would not be detected."""
    named, reached = named_in(task["settings"]), task["modules"]
    with defined(task["definitions"]):
        if task["definitions"]:
            _check_files(task)
        with ExitStack() as stack:
            for registry in (systems, integrators):
                stack.enter_context(registry.restricted(named, reached))
            yield


def _check_files(task: Mapping[str, Any]) -> None:
    """Create users' systems and integrators; raise an error for a file that has changed since the planning."""
    for name in task["definitions"].get("systems", ()):
        systems[name]
    here = digests(task["function"], task["systems"], task["integrators"])
    if any(here[what] != task[what] for what in here):
        message = f"{' or '.join(files_in(task['definitions']))} has changed since the run began: start the run again"
        raise NearharmonicError(message)


def _is_transparent(snakemake: Any) -> bool:
    return bool(getattr(snakemake.params, "transparent", False))


def write(result: Any, places: Places, origin: Mapping[str, str], *, transparent: bool = False) -> None:
    """Write one result of a task to its files, with its ``origin``, the provenance, if they can hold it.

    A :class:`~nearharmonic.output.dataset.Contents` or an ``xarray.Dataset`` goes to an HDF5 file, a
    :class:`~nearharmonic.output.table.Table` to CSV, Markdown and LaTeX, a matplotlib ``Figure`` to PDF, SVG (without
    a background if ``transparent``) and PNG, a dict to TOML, and a string or bytes to a file as they are.
    """
    from nearharmonic.output import store

    if isinstance(result, Contents):
        attributes = {**result.attributes, **origin}
        store.write(places[0], result.variables, attributes, result.groups, coordinates=result.coordinates)
    elif isinstance(result, Table):
        save_table(result, places)
    elif isinstance(result, str):
        write_text(places[0], result)
    elif isinstance(result, bytes):
        write_bytes(places[0], result)
    elif hasattr(result, "data_vars"):  # a Dataset is a mapping too
        store.write_dataset(places[0], result, origin)
    elif hasattr(result, "savefig"):
        from nearharmonic.plotting.style import save

        save(result, places, transparent=transparent)
    else:
        save_document({"provenance": dict(origin), **result}, places[0])


class _Log(FileIO):
    """A log file: text for which the disk has no room is lost, and never hides an error of the job."""

    def write(self, text: Any, /) -> int:
        try:
            return super().write(text)
        except OSError:
            return len(text)


@contextmanager
def logged(path: str | os.PathLike[str]) -> Iterator[None]:
    """Write printed text and tracebacks to the file ``path``; the terminal shows an error in one sentence."""
    _end_with_leader()
    try:
        file = _Log(os.fspath(path), "w")
    except OSError as error:
        raise SystemExit(f"{path} cannot be written: {error.strerror}") from None
    with TextIOWrapper(BufferedWriter(file), encoding="utf-8", errors="backslashreplace") as log:
        try:
            with redirect_stdout(log), redirect_stderr(log):
                yield
        except NearharmonicError as error:
            log.write(f"{error}\n")
            raise SystemExit(str(error)) from None
        except Exception as error:
            traceback.print_exc(file=log)
            message = f"{type(error).__name__}: {error} (traceback in {path})"
            raise SystemExit(message) from None


def _end_with_leader() -> None:
    """End this process when that of Snakemake ends, however it does; a job on another computer has no such process."""
    host, _, number = os.environ.get(LEADER, "").rpartition(":")
    if host == platform.node() and int(number) != os.getpid():
        Thread(target=_watch, args=(int(number),), daemon=True).start()


def _watch(leader: int) -> None:
    """Wait for the end of the process ``leader``, then kill this process and those that it has started."""
    if hasattr(os, "pidfd_open"):
        with suppress(ProcessLookupError):
            select([os.pidfd_open(leader)], [], [])
    import psutil

    if not hasattr(os, "pidfd_open"):
        with suppress(psutil.NoSuchProcess):
            psutil.Process(leader).wait()
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            child.kill()
    os.kill(os.getpid(), SIGKILL)


def _earlier(snakemake: Any, origin: Mapping[str, str]) -> Any:
    """Return what may take results over from an earlier version of the first output."""
    search = function_of({"function": snakemake.params.earlier})
    return search(folder_of(snakemake.log[0]), snakemake.output[0], origin)


def _plain(value: Any) -> str | list[str]:
    """Convert an input of Snakemake to a path or a list of paths."""
    return str(value) if isinstance(value, str) else [str(path) for path in value]


def main(place: str) -> None:
    """Run the frozen job in the file ``place``."""
    try:
        frozen = read(place)
        check_code(frozen)
        wait_for(frozen.input, frozen.patience)
        prepare(frozen)
    except NearharmonicError as error:
        raise SystemExit(str(error)) from None
    (draw if hasattr(frozen.params, "tasks") else run)(frozen)


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

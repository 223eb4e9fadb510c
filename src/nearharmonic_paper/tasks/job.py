"""A job of the workflow, here or on another computer: calls the package function of a rule, and writes its results."""

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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from hashlib import sha256
from importlib import import_module
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
from nearharmonic.output.store import Contents
from nearharmonic.output.table import Table, save, save_document
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

# --- Jobs of rules: their functions are called, and what these return is written.


def run(snakemake: Any) -> None:
    """Run the job of a rule whose ``params.task`` comes from :func:`nearharmonic_paper.tasks.provenance.task`.

    The function is called with its settings, and with the paths of the inputs of the rule under their names. Its
    optional parameter ``threads`` is the number of threads of the job; ``earlier`` is made by the class in
    ``params.earlier``. It returns a mapping with a result for each named output, of the types of :func:`write`.
    """
    with _logged_job(snakemake.log[0]):
        task = snakemake.params.task
        function, origin = function_of(task), provenance(task)
        inputs = {name: _paths(value) for name, value in snakemake.input.items()}
        if "threads" in signature(function).parameters:
            inputs["threads"] = snakemake.threads
        if "earlier" in signature(function).parameters:
            search = function_of({"function": snakemake.params.earlier})
            inputs["earlier"] = search(folder_of(snakemake.log[0]), snakemake.output[0], origin)
        receipt = Receipt(snakemake.log[0], map(str, snakemake.input))
        with covered(task):
            results = function(**task["settings"], **inputs)
            for name, made in snakemake.output.items():
                places = [made] if isinstance(made, str) else list(made)
                write(results[name], places, origin, transparent=getattr(snakemake.params, "transparent", False))
                receipt.add(places, task, **_remarks(function, results[name]))
        receipt.write()


def draw(snakemake: Any) -> None:
    """Draw the figures of some cubes, each with the package function in ``params.tasks`` under its stem.

    A function gets the cubes of the input ``cubes``, which are read once, if there are any; it returns a matplotlib
    ``Figure``, which is made narrow if ``params.width`` is "column". Errors are as for :func:`run`.
    """
    from nearharmonic.output.store import read

    with _logged_job(snakemake.log[0]):
        shown = [read(path) for path in getattr(snakemake.input, "cubes", [])]
        receipt = Receipt(snakemake.log[0], map(str, snakemake.input))
        for stem, task in snakemake.params.tasks.items():
            places = list(getattr(snakemake.output, stem))
            with covered(task):
                figure = function_of(task)(*shown, **task["settings"])
                figure.set_label(snakemake.params.captions[stem])
                if getattr(snakemake.params, "width", "page") == "column":
                    import_module("nearharmonic.plotting.column").narrow(figure)
                write(figure, places, provenance(task), transparent=getattr(snakemake.params, "transparent", False))
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
                    text = f"nearharmonic: warning: the page of results may be out of date: {error}"
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
def covered(task: Mapping[str, Any]) -> Iterator[None]:
    """Restrict registries to entries that the digests of ``task`` cover: edits of others would not be detected.

    Users' systems and integrators are created; a file that has changed since the planning is an error.
    """
    with defined(task["definitions"]), ExitStack() as stack:
        for name in task["definitions"].get("systems", ()):
            systems[name]
        if task["definitions"] and _is_stale(task):
            files = " or ".join(files_in(task["definitions"]))
            raise NearharmonicError(f"{files} has changed since the run began: start the run again")
        for registry in (systems, integrators):
            stack.enter_context(registry.restricted(named_in(task["settings"]), task["modules"]))
        yield


def _is_stale(task: Mapping[str, Any]) -> bool:
    """Return True if code or coefficients here differ from a task's."""
    here = digests(task["function"], task["systems"], task["integrators"])
    return any(here[what] != task[what] for what in here)


def write(result: Any, places: Sequence[str], origin: Mapping[str, str], *, transparent: bool = False) -> None:
    """Write one result of a task to its files, with its ``origin``, the provenance, if they can hold it.

    A :class:`~nearharmonic.output.store.Contents` or an ``xarray.Dataset`` goes to an HDF5 file, a
    :class:`~nearharmonic.output.table.Table` to CSV, Markdown and LaTeX, a matplotlib ``Figure`` to PDF, SVG (without
    a background if ``transparent``) and PNG, a dict to TOML, and a string or bytes to a file as they are.
    """
    from nearharmonic.output import store

    if isinstance(result, Contents):
        attributes = {**result.attributes, **origin}
        store.write(places[0], result.variables, attributes, result.groups, coordinates=result.coordinates)
    elif isinstance(result, Table):
        save(result, places)
    elif isinstance(result, str):
        write_text(places[0], result)
    elif isinstance(result, bytes):
        write_bytes(places[0], result)
    elif hasattr(result, "data_vars"):  # a Dataset is a mapping too
        store.write_dataset(places[0], result, origin)
    elif hasattr(result, "savefig"):
        from nearharmonic.plotting.style import save as save_figure

        save_figure(result, places, transparent=transparent)
    else:
        save_document({"provenance": dict(origin), **result}, places[0])


def _paths(files: Any) -> str | list[str]:
    """Return files of Snakemake as a path or a list of paths."""
    return str(files) if isinstance(files, str) else [*map(str, files)]


# --- Logs of jobs, and their end with the process of Snakemake.

#: Environment variable with the host and the number of the process of Snakemake: a job ends with it.
LEADER = "NEARHARMONIC_LEADER"


class _Log(FileIO):
    """A log file: text for which the disk has no room is lost, and never hides an error of the job."""

    def write(self, text: Any, /) -> int:
        try:
            return super().write(text)
        except OSError:
            return len(text)


@contextmanager
def _logged_job(path: str) -> Iterator[None]:
    """Log a job as :func:`logged` does, and collect garbage rarely.

    In a process of one second the collections take a tenth of the time, and the last one, at exit, another tenth.
    """
    gc.set_threshold(200_000)
    with logged(path):
        yield
    gc.freeze()


@contextmanager
def logged(path: str | os.PathLike[str]) -> Iterator[None]:
    """Write printed text and tracebacks to the file ``path``; the terminal shows an error in one sentence."""
    host, _, number = os.environ.get(LEADER, "").rpartition(":")
    if host == platform.node() and int(number) != os.getpid():  # a job on another computer has no such process
        Thread(target=_end_with, args=(int(number),), daemon=True).start()
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
            raise SystemExit(f"{type(error).__name__}: {error} (traceback in {path})") from None


def _end_with(leader: int) -> None:
    """Wait for the end of the process ``leader``, then kill this process and all that it has started."""
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


# --- Frozen jobs for other computers: a node reads neither the workflow nor the config, and nothing of Snakemake.
#
# A frozen job has all that a job of the workflow needs, in a file that is named after its digest. Its command is
# ``python -m nearharmonic_paper.tasks.job FILE``.

SUFFIX = ".job"
#: Command that runs Python on the nodes, for example in a container; by default the present interpreter.
PYTHON = "NEARHARMONIC_NODE_PYTHON"
#: The process that ends the jobs of this computer with itself has no meaning on another.
ENVIRONMENT = f"env -u {LEADER}"
#: Parameters of rules that jobs read.
PARAMS = ("task", "tasks", "captions", "width", "transparent", "earlier", "documents")
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
    """A job with those members of Snakemake's object that :func:`run` and :func:`draw` use.

    Paths are relative to the working folder; ``params`` has the rule's parameters in :data:`PARAMS`. ``patience`` is
    the number of seconds to wait for inputs that another node wrote.
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
        if hasattr(self.params, "documents"):
            return [one["task"] for one in self.params.documents]
        return [*self.params.tasks.values()] if hasattr(self.params, "tasks") else [self.params.task]

    @property
    def modules(self) -> set[str]:
        """Dotted names of the modules of its functions."""
        functions = [*(task["function"] for task in self.tasks), getattr(self.params, "earlier", "")]
        return {function.partition(":")[0] for function in functions if function}

    def prepare(self) -> None:
        """Load what jobs of the same function share, in the process that they are forks of."""
        for task in (one for one in self.tasks if not one["definitions"]):
            getattr(function_of(task), "prepare", lambda **_: None)(**task["settings"])

    def execute(self) -> None:
        """Run the job, without results of an earlier run of it."""
        for file in map(Path, [*self.output, *self.log]):
            if "docs" not in file.parts:  # pages are updated
                file.unlink(missing_ok=True)
            file.parent.mkdir(parents=True, exist_ok=True)
        (refresh if hasattr(self.params, "documents") else draw if hasattr(self.params, "tasks") else run)(self)

    def write(self, folder: str | Path) -> Path:
        """Write the job to a file in ``folder`` and return its path."""
        content = pickle.dumps(self)
        place = Path(folder, sha256(content).hexdigest()).with_suffix(SUFFIX)
        write_bytes(place, content)
        return place


def frozen(job: Any) -> FrozenJob:
    """Return the frozen form of a job of Snakemake."""
    return FrozenJob(
        input=Files(map(str, job.input), {name: _paths(files) for name, files in job.input.items()}),
        output=Files(map(str, job.output), {name: _paths(files) for name, files in job.output.items()}),
        params=SimpleNamespace(**{name: value for name, value in job.params.items() if name in PARAMS}),
        log=[str(file) for file in job.log],
        threads=int(job.threads),
    )


def command_of(job: Any, folder: str | Path) -> str:
    """Return the shell command that runs a job of Snakemake on a node; its frozen form is a file in ``folder``."""
    python = os.environ.get(PYTHON) or shlex.quote(sys.executable)
    return f"{ENVIRONMENT} {python} -m {__name__} {shlex.quote(str(frozen(job).write(folder)))}"


def is_in_array(job: Any, arrays: str | None) -> bool:
    """Return True if a job is submitted in an array, by the setting ``array_jobs`` of the plugin for SLURM."""
    return not {"all", job.name}.isdisjoint(re.split(r"[,;\s]+", arrays or ""))


def read_job(place: str | Path) -> FrozenJob:
    """Return the job in a file of :meth:`FrozenJob.write`."""
    path = Path(place)
    try:
        content = read_bytes(path)
    except OSError as error:
        raise NearharmonicError(f"the job {path} cannot be read: {error.strerror}") from None
    if sha256(content).hexdigest() != path.stem:
        raise NearharmonicError(f"the job {path} is damaged: its digest is not its name")
    job: FrozenJob = pickle.loads(content)
    return job


def main(place: str) -> None:
    """Run the frozen job in the file ``place``; this node has the code of the job, and sees its inputs."""
    try:
        thawed = read_job(place)
        for task in thawed.tasks:
            if not task["definitions"] and _is_stale(task):  # the job checks users' files
                says = "this node has another version of the package, of numpy, numba or llvmlite"
                raise NearharmonicError(f"{task['function']}: {says}")  # noqa: TRY301 - told as all others
        wait_for(thawed.input, thawed.patience)
    except NearharmonicError as error:
        raise SystemExit(str(error)) from None
    thawed.execute()


def wait_for(files: Iterable[str], patience: float) -> None:
    """Wait until files exist: a shared folder may show files of another node late."""
    end = time.monotonic() + patience
    for file in files:
        while not Path(file).exists():
            if time.monotonic() > end:
                raise NearharmonicError(f"the input {file} is not visible on this node after {patience:g} s")
            time.sleep(0.5)


if __name__ == "__main__":
    import_module("nearharmonic_paper.tasks.job").main(sys.argv[1])  # the module that pickle knows

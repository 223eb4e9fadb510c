"""Server that forks a process for each job. It starts no thread, which its forks would lack."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
import time
import traceback
from collections.abc import Iterable
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection, wait
from typing import Any

#: Imported before the first job.
FIRST = ("nearharmonic_paper.tasks.job", "nearharmonic.core.kernel")
#: Imported while no job begins or ends, in this order and in small steps, as jobs wait meanwhile.
PRELOADED = (
    "nearharmonic.engine.description", "h5py", "mpmath", "nearharmonic.theory", "pandas", "xarray", "matplotlib",
    "matplotlib.text", "matplotlib.axes", "matplotlib.figure", "matplotlib.backends.backend_pdf",
    "matplotlib.backends.backend_svg", "PIL.PngImagePlugin", "nearharmonic.plotting.style",
    "nearharmonic_paper.tasks.schema",
)  # fmt: skip
#: Seconds until interrupted jobs are killed.
PATIENCE = 5.0

#: Number and process of each running job, by the end of a pipe that becomes readable when the process ends.
Jobs = dict[int, tuple[int, int]]


def serve(descriptor: int) -> None:
    """Fork a process for each request at the pipe ``descriptor``; answer with its number and exit status at its end.

    A request is a number, the modules of the job, its systems, its folder, its environment, and the pickled job; None
    asks to end after all jobs, and SIGINT to interrupt them. If the process at the other end is no longer there, they
    are killed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of Ctrl-C; the jobs get one too, and Snakemake says what follows
    requests, unloaded = Connection(descriptor), [*PRELOADED]
    jobs: Jobs = {}
    _load(FIRST)
    while True:
        ready: list[Any] = wait([requests, *jobs], timeout=0 if unloaded else None)
        if not ready:
            _load([unloaded.pop(0)])
            if not unloaded:
                _load_definitions()
        for source in ready:
            if source is not requests:
                _answer(requests, jobs, source)
                continue
            try:
                request = requests.recv()
            except (EOFError, ConnectionError):
                request = signal.SIGKILL
            if request is None:
                return
            if isinstance(request, signal.Signals):
                _end(jobs, request)
                return
            number, modules, names, *job = request
            _load(modules)
            _check(names)
            _fork(jobs, number, job)


def _load(modules: Iterable[str]) -> None:
    """Import modules for all jobs to come; a job tells why one cannot be imported."""
    for module in modules:
        if module not in sys.modules:
            with suppress(Exception):
                import_module(module)
            gc.freeze()  # collections in forks would copy all pages of memory


def _load_definitions() -> None:
    """Load methods and systems, which a registry imports when they are asked for, digests and versions of libraries."""
    from nearharmonic.core.native import core_digest
    from nearharmonic.integrators import integrators
    from nearharmonic.systems import systems
    from nearharmonic_paper.tasks.provenance import LIBRARIES, library_version

    for registry in (integrators, systems):
        for name in registry:
            registry[name]
    core_digest()
    for library in LIBRARIES:
        library_version(library)


def _check(names: Iterable[str]) -> None:
    """Trace and check the formulas of registered systems for all jobs to come; a job tells what is wrong with them."""
    from nearharmonic.engine.kernels import STANDARD, cost_of
    from nearharmonic.systems import systems

    for name in names:
        if name in systems.registered:
            with suppress(Exception):
                cost_of(systems[name], STANDARD)


def _fork(jobs: Jobs, number: int, job: list[Any]) -> None:
    ended, writable = os.pipe()
    process = os.fork()
    if process == 0:
        _work(*job)
    os.close(writable)
    jobs[ended] = number, process


def _answer(requests: Connection, jobs: Jobs, ended: int) -> None:
    number, process = jobs.pop(ended)
    os.close(ended)
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    with suppress(OSError):
        requests.send((number, status))


def _end(jobs: Jobs, how: signal.Signals) -> None:
    """End the jobs with a signal, and kill those that remain."""
    for each in (how, signal.SIGKILL):
        for _, process in jobs.values():
            os.kill(process, each)
        end = time.monotonic() + PATIENCE
        while jobs and (ready := wait([*jobs], timeout=max(0.0, end - time.monotonic()))):
            for ended in ready:
                os.waitpid(jobs.pop(int(ended))[1], 0)  # type: ignore[arg-type]


def _work(folder: str, environment: dict[str, str], job: bytes) -> None:
    """Run a frozen job in this process and exit; an error in one sentence goes to the terminal."""
    status = 1
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        pickle.loads(job).execute()
        status = 0
    except SystemExit as end:
        print(end.code, file=sys.stderr)
    except KeyboardInterrupt:
        status = 128 + signal.SIGINT
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)  # without the end of the interpreter, which takes as long as a short job


if __name__ == "__main__":
    serve(int(sys.argv[1]))

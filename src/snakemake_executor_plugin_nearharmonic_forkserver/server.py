"""Server that forks a process for each job. It starts no thread, which its forks would lack."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
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
    "nearharmonic.engine.trajectory", "h5py", "mpmath", "nearharmonic.theory.oscillator", "pandas", "xarray",
    "matplotlib", "matplotlib.text", "matplotlib.axes", "matplotlib.figure", "matplotlib.backends.backend_pdf",
    "matplotlib.backends.backend_svg", "PIL.PngImagePlugin", "nearharmonic.plotting.style",
    "nearharmonic_paper.tasks.schema",
)  # fmt: skip


def serve(descriptor: int) -> None:
    """Fork a process for each request at the pipe ``descriptor``; answer with its number and exit status at its end.

    A request is a number, the modules of the job, its folder, its environment, and the pickled job; or a signal for all
    jobs; or None, which is the last. Jobs are killed if the process at the other end is no longer there.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of Ctrl-C; Snakemake says what follows
    requests, unloaded, is_last = Connection(descriptor), [*PRELOADED], False
    # Number and process of each job, by the end of a pipe that becomes readable when the process ends.
    jobs: dict[int, tuple[int, int]] = {}
    _load(FIRST)
    for registry in map(import_module, ("nearharmonic.integrators", "nearharmonic.systems")):
        dict(registry)  # entries are loaded when they are asked for
    while jobs or not is_last:
        ready: list[Any] = wait([requests, *jobs], timeout=0 if unloaded else None)
        if not ready:
            _load([unloaded.pop(0)])
        for source in ready:
            if source is not requests:
                number, process = jobs.pop(source)
                os.close(source)
                with suppress(OSError):
                    requests.send((number, os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])))
                continue
            try:
                request = requests.recv()
            except (EOFError, ConnectionError):
                request, is_last = signal.SIGKILL, True
            if request is None:
                is_last = True
            elif isinstance(request, signal.Signals):
                for _, process in jobs.values():
                    os.kill(process, request)
            else:
                number, modules, *job = request
                _load(modules)
                with suppress(Exception):  # the job tells why it cannot be read
                    pickle.loads(job[-1]).prepare()
                ended, writable = os.pipe()
                process = os.fork()
                if process == 0:
                    _work(*job)
                os.close(writable)
                jobs[ended] = number, process


def _load(modules: Iterable[str]) -> None:
    """Import modules for all jobs to come; a job tells why one cannot be imported."""
    for module in modules:
        if module not in sys.modules:
            with suppress(Exception):
                import_module(module)
            gc.freeze()  # collections in forks would copy all pages of memory


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

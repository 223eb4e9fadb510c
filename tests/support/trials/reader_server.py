"""A process that has the readers of results loaded and forks for each request: loading them takes longest.

A request is a line of JSON on the standard input: a folder, questions, and the file for the answers. The answer is a
line with the exit status of the fork, negative if a signal ended it; one that takes too long is ended by SIGALRM.
"""

import importlib
import io
import json
import os
import resource
import signal
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import nearharmonic as nh
from nearharmonic import cli
from nearharmonic.core import disk
from nearharmonic.output import store
from nearharmonic.output import store as files
from nearharmonic_paper.tasks import job as plan

#: Seconds for all questions of a request; the slowest takes one.
LIMIT = 60


def numbers(place):
    """All values of a result file, and its attributes, as text."""
    groups = store.read_precisions(place) or {"double": store.read(place)}
    values = {f"{g}/{name}": v.values.tobytes().hex() for g, data in groups.items() for name, v in data.items()}
    return repr(sorted(values.items())) + repr(sorted(store.attributes_of(place).items()))


def of_kernel(place):
    """Code in a file of the kernel cache; it must be whole, or absent and the file gone."""
    found = disk.read(Path(place))
    assert found is not None or not Path(place).exists()
    return "compiled again" if found is None else repr(found)


def integrated(folder):
    """A run with the compiled code in ``folder``."""
    os.environ["NEARHARMONIC_CACHE_DIR"] = folder
    run = nh.integrate("sho", "babs7o7h", 0.1, t_end=10)
    return repr([run.q.values.tobytes().hex(), run.max_energy_error.item()])


def vanishing(place):
    """Numbers of a file that another process deletes between the check of its digest and its opening."""
    check = files.complaint
    files.complaint = lambda path: check(path) or Path(path).unlink() or ""
    return numbers(place)


ASKED = {
    "numbers": numbers, "kernel": of_kernel, "integrate": integrated, "vanish": vanishing,
    "job": lambda place: repr(plan.read_job(place)),
}  # fmt: skip


def asked(kind, *words):
    """Status, output and message of one question; an error that is none of the family has the status -1."""
    out, message = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(message):
        try:
            status = cli.main(words) if kind == "nearharmonic" else print(ASKED[kind](*words)) or 0
        except nh.errors.NearharmonicError as error:
            status = 2
            message.write(f"{error}\n")
        except Exception as error:
            status = -1
            message.write(f"{type(error).__name__}: {error}\n")
    return {"status": status, "out": out.getvalue(), "message": message.getvalue()}


def run(folder, questions, place, memory=None):
    """Answer ``questions`` in a fork; an address space of ``memory`` bytes is all that it may take."""
    signal.alarm(LIMIT)
    os.chdir(folder)
    if memory:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    Path(place).write_text(json.dumps([asked(*question) for question in questions]), encoding="utf-8")


if __name__ == "__main__":
    nh.errors = importlib.import_module("nearharmonic.errors")
    for line in sys.stdin:
        request = json.loads(line)
        if request.get("warm"):  # what every fork would compute again
            os.chdir(request["folder"])
            for question in request["questions"]:
                asked(*question)
        if not (child := os.fork()):
            run(request["folder"], request["questions"], request["place"], request.get("memory"))
            os._exit(0)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)

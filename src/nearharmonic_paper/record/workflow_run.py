"""Record of a run of the workflow. Failures here are reported as warnings and never abort the run.

A *receipt* lists the files that one job wrote, with their digests; the *manifest* lists all files of a folder of
results, assembled from the receipts; the *history* has a line for each run.
"""

from __future__ import annotations

import atexit
import fcntl
import json
import os
import platform
import re
import secrets
import shutil
import subprocess
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from nearharmonic.errors import RefusedError
from nearharmonic.integrators import integrators
from nearharmonic.output.atomic import digest_of, plain, read_bytes, remove_parts, sealed, unsealed, write_text
from nearharmonic.systems import systems
from nearharmonic_paper.config import Config
from nearharmonic_paper.experiments.paper.run import totals_in
from nearharmonic_paper.record import history, manifest
from nearharmonic_paper.tasks import provenance
from nearharmonic_paper.tasks.job import LEADER

# --- Fingerprint of a run: its config, code, coefficients and versions, and its machine.

#: Libraries that affect a number or a picture.
LIBRARIES = (
    "numpy", "numba", "llvmlite", "mpmath", "gmpy2", "xarray", "h5py", "h5netcdf", "matplotlib", "bokeh", "snakemake",
)  # fmt: skip


def fingerprint(config: Config) -> dict[str, Any]:
    """Return the data that identify the work of a run.

    They are ``config`` as resolved, ``config_digest``, ``code_digest``, ``coefficients_digest``, ``versions``; if users
    define systems or integrators, ``user_files`` with the digest of each file; and ``work``, the SHA-256 over these,
    which is equal for equal work.
    """
    # Keys stay in their order, which determines the order of tables and legends.
    resolved = json.loads(json.dumps(config, default=plain))
    methods = dict.fromkeys((*config.methods, *config.decomposed, *config.compared))
    told = {
        "config": resolved,
        "config_digest": digest_of(resolved),
        "code_digest": package_digest(),
        "coefficients_digest": provenance.coefficients_digest(integrators[name] for name in methods),
        "versions": versions(),
    }
    files = provenance.files_in({"systems": systems.definitions, "integrators": integrators.definitions})
    if files:
        told["user_files"] = {file: provenance.digest_of_file(file) for file in files}
    return {"work": digest_of(told), **told}


def package_digest(root: Path = provenance.ROOT) -> str:
    """Return the SHA-256 of the code of all modules of the packages, without docstrings and comments."""
    files = [path for package in provenance.PACKAGES for path in root.joinpath(package).rglob("*.py")]
    places = [path.relative_to(root).with_suffix("") for path in files]
    modules = sorted(".".join(p.parts[:-1] if p.name == "__init__" else p.parts) for p in places)
    return digest_of(
        {name: provenance.module_digest(name, None if root == provenance.ROOT else root) for name in modules}
    )


def versions() -> dict[str, str]:
    """Return the versions of Python, of this package and of the installed :data:`LIBRARIES`."""
    installed = {"python": platform.python_version()}
    for name in (provenance.PACKAGE, *LIBRARIES):
        with suppress(PackageNotFoundError):
            installed[name] = version(name)
    return installed


def machine() -> dict[str, Any]:
    """Return ``platform`` and ``cpu``: model and instruction-set features for compiled code."""
    from llvmlite import binding

    features = sorted(name for name, there in binding.get_host_cpu_features().items() if there)
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as lines:
            model = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        model = platform.processor() or platform.machine()
    return {"platform": platform.platform(), "cpu": {"model": model, "features": features}}


def revision(folder: Path) -> dict[str, Any]:
    """Return ``commit`` and ``dirty`` of the working tree at ``folder``; both are None without a repository.

    Without git this is an OSError.
    """
    command = ["git", "-C", str(folder), "status", "--porcelain=v2", "--branch"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=20)
    commit = re.search(r"^# branch\.oid ([0-9a-f]+)$", done.stdout, re.MULTILINE)  # no match before the first commit
    changed = any(not line.startswith("#") for line in done.stdout.splitlines())
    return {"commit": commit[1], "dirty": changed} if commit else {"commit": None, "dirty": None}


# --- State of a folder of results at the end of a run: sizes and times of all its files, and the end of its history.
#
# A start compares it with the present state, which takes milliseconds, and computes digests only of what differs.

STATE = Path("logs", "state")


def save(folder: Path, makeable: Iterable[str], receipts: provenance.Receipts) -> None:
    """Write the state of ``folder`` after a run; files that are not as their job wrote them count as unknown."""
    told = manifest.read(folder)
    unknown = {*told["changed"], *told["unrecorded"]}
    places = (place.relative_to(folder).as_posix() for place, _ in receipts)
    names = sorted({*makeable, *told["files"], *manifest.LEFT_OUT, *places} - unknown)  # the record is compared too
    files = {name: _observed(folder, name) for name in names} | {name: [] for name in sorted(unknown)}
    lines = history.lines_of(folder / history.HISTORY)
    head = lost_line(folder, lines) or (lines[-1].digest if lines else None)
    write_text(folder / STATE, json.dumps(sealed({"files": files, "head": head})) + "\n")


def lost_line(folder: Path, lines: Iterable[history.Line]) -> str | None:
    """Return the digest of the last line of the history at the last :func:`save`, if the ``lines`` do not have it.

    The chain of digests in the history shows every other loss.
    """
    head = _saved(folder).get("head")
    known = {digest for line in lines for digest in (line.digest, *line.known)}
    return head if isinstance(head, str) and head not in known else None


def differing(folder: Path) -> set[str] | None:
    """Return the names of the files that differ from the state of ``folder``; None if that is not known."""
    files = _saved(folder).get("files")
    if not isinstance(files, dict):
        return None
    return {name for name, before in files.items() if _observed(folder, name) != before or _is_broken(folder, name)}


def damaged_files(folder: Path, makeable: Collection[str], different: Collection[str] | None) -> list[str]:
    """Return the present files that are not as their job wrote them, and those made from them, directly or not, sorted.

    They are files of ``makeable``, which jobs make; among the ``different`` ones alone, if these are known.
    """
    names = set(makeable) if different is None else set(makeable).intersection(different)
    there = [name for name in sorted(names) if os.path.lexists(folder / name)]
    entries = manifest.entries_of(folder) if there else {}
    damaged = {name for name in there if name not in entries or manifest.is_changed(folder / name, entries[name])}
    inputs = {name: set(entry.get("inputs", ())) for name, entry in entries.items()}
    while more := {name for name in makeable if damaged & inputs.get(name, set())} - damaged:
        damaged |= more
    return sorted(name for name in damaged if os.path.lexists(folder / name))


def _saved(folder: Path) -> dict[str, Any]:
    """Return the saved state; empty if there is none or it is damaged."""
    try:
        return unsealed(read_bytes(folder / STATE)) or {}
    except OSError:
        return {}


def _observed(folder: Path, name: str) -> list[int] | None:
    """Return size and time of a file; None if there is none."""
    try:
        state = os.stat(f"{folder}/{name}")  # noqa: PTH116 - pathlib takes longer than the system
    except OSError:
        return None
    return [state.st_size, state.st_mtime_ns]


def _is_broken(folder: Path, name: str) -> bool:
    """Return True for a receipt whose seal does not match; a flipped bit leaves size and time as they were."""
    try:
        return name.startswith("logs/") and unsealed(read_bytes(folder / name)) is None
    except OSError:
        return True


# --- Damaged results, set aside while Snakemake plans a run, so that it makes them again.
#
# Files that no job has made again by the end of the process return to their places, where ``verify`` names them.

#: Folder of these files, in the folder of results.
ASIDE = Path("logs", "aside")


def restore(folder: Path) -> None:
    """Move results back to those places that no job has filled, also after an earlier process was killed."""
    for kept in sorted((folder / ASIDE).rglob("*")):
        place = folder / kept.relative_to(folder / ASIDE)
        if not os.path.lexists(place) and not (kept.is_dir() and not kept.is_symlink()):
            place.parent.mkdir(parents=True, exist_ok=True)
            kept.rename(place)
    shutil.rmtree(folder / ASIDE, ignore_errors=True)


# --- Lock of a folder of results: one run of the workflow at a time. It ends with its process, also with a killed one.

#: File with the host and the number of the process that holds the lock, or held it last.
LOCK = Path("logs", "lock")
UNLOCKED = "nearharmonic: warning: no lock, so two runs at once are possible"


def lock(folder: Path) -> None:
    """Hold the lock of ``folder`` until this process ends.

    In a folder without locks, for example a read-only one, there is a warning and no lock.
    """
    place = folder / LOCK
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(place, os.O_RDWR | os.O_CREAT, 0o666)
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # unlike flock, no child process holds it too
    except (BlockingIOError, PermissionError):
        if not os.access(place, os.R_OK | os.W_OK):
            print(f"{UNLOCKED}: {place}: Permission denied", file=sys.stderr)
            return
        host, _, number = place.read_text(errors="replace").strip().rpartition(" ")
        holder = f"process {number} on {host}" if host else "another process"
        message = f"{folder} is in use by a run of the workflow ({holder}); wait for its end, or stop it"
        raise RefusedError(message) from None
    except OSError as error:
        print(f"{UNLOCKED}: {place}: {error.strerror}", file=sys.stderr)
    else:
        os.ftruncate(file, 0)
        os.pwrite(file, f"{platform.node()} {os.getpid()}\n".encode(), 0)


# --- One run of the workflow.

#: What the history tells of a run as soon as it starts, in this order; None if it is not known.
FIELDS = (
    "id", "work", "config", "config_digest", "code_digest", "coefficients_digest", "versions", "platform", "cpu",
    "status", "exit_status", "start", "end", "duration", "cpu_seconds", "cores", "command", "targets", "commit",
    "dirty", "jobs_run", "jobs_reused", "evaluations", "evaluations_skipped",
)  # fmt: skip


class WorkflowRun:
    """One run of the workflow, in the process of Snakemake."""

    def __init__(
        self, folder: str | os.PathLike[str], config: Config, makeable: Collection[str] = (),
        configfiles: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self._folder, self._config, self._makeable, self._configfiles = Path(folder), config, makeable, configfiles
        self._began = datetime.now(UTC)
        #: What the history tells of this run.
        self.told: dict[str, Any] = {}
        self._warned: set[str] = set()

    @property
    def id(self) -> str:
        """The id of the run: start time and a random number."""
        return str(self.told.get("id", ""))

    def prepare(self, *, is_dry: bool = False) -> None:
        """Close the record of killed runs, and set damaged files and all that was made from them aside.

        It is called before Snakemake looks at the files, and does nothing while another run is at work. A dry run
        leaves the record as it is.
        """
        if not os.access(self._folder, os.W_OK):
            return
        different = differing(self._folder)
        if different == set() and not history.dead_in(self._folder) and not (self._folder / ASIDE).exists():
            return
        try:
            lock(self._folder)
        except RefusedError:
            return
        restore(self._folder)
        if not is_dry:
            with self._warning("killed runs are not closed"):
                history.close_killed(self._folder)
            with self._warning("temporary files are not removed"):
                remove_parts(self._folder)
            with self._warning("damaged receipts are not removed"):
                self._remove_damaged_receipts()
            self._complete(provenance.receipts_in(self._folder))
        with self._warning("damaged files are not made again"):
            atexit.register(restore, self._folder)
            for name in damaged_files(self._folder, self._makeable, different):
                kept = self._folder / ASIDE / name
                kept.parent.mkdir(parents=True, exist_ok=True)
                (self._folder / name).rename(kept)

    def begin(self, command: Sequence[str], targets: Sequence[str], cores: int | None) -> None:
        """Record the start: write a marker, and pass the ids of run and process to the jobs."""
        lock(self._folder)
        self.told = dict.fromkeys(FIELDS) | {
            "id": f"{self._began:%Y%m%dT%H%M%SZ}-{secrets.token_hex(4)}",
            "config": {},
            "versions": {},
            "cpu": {},
            "status": "running",
            "start": _stamp(self._began),
            "cores": cores,
            "command": [Path(command[0]).name, *command[1:]],
            "targets": list(targets),
            "made": [],
        }
        os.environ |= {provenance.RUN: self.id, LEADER: f"{platform.node()}:{os.getpid()}"}  # jobs inherit them
        with self._warning("the run is not recorded in full"):
            self.told |= fingerprint(self._config)
            self.told |= machine()
        with self._warning("the commit is not recorded"):
            self.told |= revision(Path())
        with self._warning("the history is not written"):
            history.mark(self._folder, self.told)

    def end(self, exit_status: int) -> None:
        """Write manifest and history at the end of a run, with the ``exit_status`` of Snakemake."""
        restore(self._folder)
        receipts, ended = provenance.receipts_in(self._folder), datetime.now(UTC)
        self.told |= {
            "status": "failed" if exit_status else "ok",
            "exit_status": exit_status,
            "end": _stamp(ended),
            "duration": round((ended - self._began).total_seconds(), 3),
            "cpu_seconds": round(sum(os.times()[:4]), 2),
            "made": provenance.names_made_by(receipts, self.id),
        }
        with self._warning("the evaluations are not recorded"):
            self.told |= self._counts(receipts)
        self._complete(receipts, ends=True)

    def _complete(self, receipts: provenance.Receipts, *, ends: bool = False) -> None:
        """Write the manifest, the line of the history if the run ``ends``, and the state for the next start."""
        with self._warning("the manifest is not written"):
            if changed := manifest.write(self._folder, self._makeable, self._configfiles, receipts):
                self._warn("", f"changed since their jobs wrote them: {', '.join(changed)} in {self._folder}")
        if ends:
            with self._warning("the history is not written"):
                try:
                    lines = history.lines_of(self._folder / history.HISTORY)
                    history.append(self._folder, self.told, lost_line(self._folder, lines))
                finally:
                    history.unmark(self._folder, self.id)
        with self._warning("the next start checks all files"):
            save(self._folder, self._makeable, receipts)

    def _remove_damaged_receipts(self) -> None:
        """Remove damaged receipts: the manifest has the entries of their files, or their jobs run again."""
        if damaged := provenance.damaged_receipts(self._folder):
            for place in damaged:
                place.unlink()
            listed = ", ".join([*map(str, damaged[:3]), *(["..."] if len(damaged) > 3 else [])])
            says = "damaged receipts are removed"
            self._warn("receipts", f"{len(damaged)} {says}: {listed}")

    def _counts(self, receipts: provenance.Receipts) -> dict[str, int | None]:
        """Numbers of jobs that ran and of those whose results were there, and of evaluations."""
        began = self._began.timestamp()
        new = [files for place, files in receipts if place.stat().st_mtime >= began]
        old = [files for place, files in receipts if place.stat().st_mtime < began]
        counts: dict[str, int | None] = {
            "jobs_run": len(new),
            "jobs_reused": sum(not files.keys().isdisjoint(self._makeable) for files in old),
            "evaluations": sum(entry["evaluations"] for files in new for entry in files.values()),
        }
        table = self._folder / "tables" / "skipped.csv"
        if table.is_file():
            totals = totals_in(table.read_text(encoding="utf-8"))
            counts["evaluations_skipped"] = totals.full - totals.done
        return counts

    @contextmanager
    def _warning(self, consequence: str) -> Iterator[None]:
        """Convert errors inside the block to a warning, one for each consequence."""
        try:
            yield
        except (Exception, SystemExit) as error:
            absent = isinstance(error, FileNotFoundError) and error.filename == "git"
            said = "git is not installed" if absent else f"{type(error).__name__}: {error}"
            self._warn(consequence, f"{consequence}: {said}")

    def _warn(self, kind: str, text: str) -> None:
        if kind not in self._warned:
            self._warned.add(kind)
            sys.stderr.write(f"nearharmonic: warning: {text}\n")


def _stamp(moment: datetime) -> str:
    """Return a UTC timestamp to the millisecond."""
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")

"""Record of a run of the workflow. Failures here are reported as warnings and never abort the run."""

from __future__ import annotations

import os
import platform
import secrets
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from nearharmonic.output.atomic import remove_parts
from nearharmonic_paper.config.config import Config
from nearharmonic_paper.experiments.paper.grid.omissions import totals_in
from nearharmonic_paper.record import history
from nearharmonic_paper.record.files import manifest
from nearharmonic_paper.record.files.fingerprint import fingerprint, machine, revision
from nearharmonic_paper.record.running import state
from nearharmonic_paper.tasks.job import LEADER
from nearharmonic_paper.tasks.receipts import RUN, damaged_receipts, names_made_by, receipts_in

#: What the history tells of a run as soon as it starts, in this order; None if it is not known.
FIELDS = (
    "id", "work", "config", "config_digest", "code_digest", "coefficients_digest", "versions", "platform", "cpu",
    "status", "exit_status", "start", "end", "duration", "cpu_seconds", "cores", "command", "targets", "commit",
    "dirty",
)  # fmt: skip


class WorkflowRun:
    """One run of the workflow, in the process of Snakemake; the commit of the folder ``sources`` is recorded."""

    def __init__(self, folder: str | os.PathLike[str], config: Config, sources: str | os.PathLike[str]) -> None:
        self._folder, self._config, self._sources = Path(folder), config, Path(sources)
        self._began = datetime.now(UTC)
        self._told: dict[str, Any] = {}
        self._warned: set[str] = set()
        self._killed: list[str] = []

    @property
    def id(self) -> str:
        """The id of the run: start time and a random number."""
        return str(self._told.get("id", ""))

    def recover(self) -> None:
        """Close killed runs; if there are any, or if files have changed, remove what they have left."""
        with self._warning("killed runs are not closed"):
            self._killed = history.close_killed(self._folder)
        if self.is_incomplete:
            self._clean()

    def _clean(self) -> None:
        """Remove temporary files and damaged receipts."""
        with self._warning("temporary files are not removed"):
            remove_parts(self._folder)
        with self._warning("damaged receipts are not removed"):
            self._remove_damaged_receipts()

    def complete(self, refresh: Callable[[], None], makeable: Collection[str], configfiles: Sequence[str]) -> None:
        """Bring page, claims and manifest up to date; parameters as for :meth:`end`."""
        with self._warning("the page of results may be old"):
            refresh()
        with self._warning("the manifest is not written"):
            changed = manifest.write(self._folder, makeable, configfiles)
            if changed:
                self._warn("", f"changed since their jobs wrote them: {', '.join(changed)} in {self._folder}")

    @cached_property
    def differing(self) -> set[str] | None:
        """Names of the files that have changed since the end of the last run, at the start; None if not known."""
        return state.differing(self._folder)

    @property
    def is_incomplete(self) -> bool:
        """True if an earlier run was killed, or if a file of the results or of the record has changed since its end."""
        return bool(self._killed) or self.differing != set()

    def begin(self, command: Sequence[str], targets: Sequence[str], cores: int | None) -> None:
        """Record the start: write a marker, and pass the ids of run and process to the jobs."""
        self._told = dict.fromkeys(FIELDS) | {
            "id": f"{self._began:%Y%m%dT%H%M%SZ}-{secrets.token_hex(4)}",
            "config": {},
            "versions": {},
            "cpu": {},
            "status": "running",
            "start": _stamp(self._began),
            "cores": cores,
            "command": [Path(command[0]).name, *command[1:]],
            "targets": list(targets),
        }
        os.environ |= {RUN: self.id, LEADER: f"{platform.node()}:{os.getpid()}"}  # jobs inherit them
        with self._warning("the run is not recorded in full"):
            self._told |= fingerprint(self._config)
            self._told |= machine()
        with self._warning("the commit is not recorded"):
            self._told |= revision(self._sources)
        self._told |= dict.fromkeys(("jobs_run", "jobs_reused", "evaluations", "evaluations_skipped")) | {"made": []}
        self._clean()
        with self._warning("the history is not written"):
            history.mark(self._folder, self._told)

    def end(
        self,
        exit_status: int,
        jobs_run: int,
        jobs_reused: int,
        refresh: Callable[[], None],
        makeable: Collection[str],
        configfiles: Sequence[str] = (),
    ) -> None:
        """Record the end: update page and claims, write the manifest and then the line of the history.

        Parameters
        ----------
        exit_status : int
            Exit status of Snakemake.
        jobs_run, jobs_reused : int
            Numbers of executed jobs, and of jobs with existing results.
        refresh : callable
            Function that remakes the files that show other files, if one of these is newer.
        makeable, configfiles
            As for :func:`nearharmonic_paper.record.files.manifest.write`.
        """
        self.complete(refresh, makeable, configfiles)
        ended = datetime.now(UTC)
        self._told |= {
            "status": "failed" if exit_status else "ok",
            "exit_status": exit_status,
            "end": _stamp(ended),
            "duration": round((ended - self._began).total_seconds(), 3),
            "cpu_seconds": round(sum(os.times()[:4]), 2),
            "jobs_run": jobs_run,
            "jobs_reused": jobs_reused,
            "made": names_made_by(self._folder, self.id),
        }
        with self._warning("the evaluations are not recorded"):
            self._told |= self._evaluations()
        with self._warning("the history is not written"):
            try:
                history.append(self._folder, self._told, state.lost_line(self._folder))
            finally:
                history.unmark(self._folder, self.id)
        self.save_state(makeable)

    def save_state(self, makeable: Collection[str]) -> None:
        """Remember sizes and times of all files, so that the next start looks at what has changed."""
        with self._warning("the next start looks at all files"):
            state.save(self._folder, makeable)

    def _remove_damaged_receipts(self) -> None:
        """Remove damaged receipts: the manifest has the entries of their files, or their jobs run again."""
        damaged = damaged_receipts(self._folder)
        for place in damaged:
            place.unlink()
        if damaged:
            listed = ", ".join([*map(str, damaged[:3]), *(["..."] if len(damaged) > 3 else [])])
            says = "receipts are not as their jobs wrote them, and are removed"
            self._warn("receipts", f"{len(damaged)} {says}: {listed}")

    def made(self, name: str) -> bool:
        """Return True if a job of this run made the file ``name``."""
        return any(made == name for made, _ in self._entries())

    def _entries(self, *others: str) -> Iterator[tuple[str, dict[str, Any]]]:
        """Each file that a job of this run, or of one of the ``others``, made, with its entry in the receipt."""
        for _, receipt in receipts_in(self._folder):
            yield from ((name, entry) for name, entry in receipt.items() if entry["run"] in {self.id, *others})

    def outdates(self, name: str, shown: Collection[str] | None = None) -> bool:
        """Return True if the file ``name`` exists and a job of this run, or of a killed one, made a newer file.

        Parameters
        ----------
        name : str
            A file that shows the content of other files.
        shown : collection of str, optional
            The other files; by default all except ``name``.
        """
        place = self._folder / name
        if not place.is_file():
            return False
        made = place.stat().st_mtime_ns
        newer = (other for other, entry in self._entries(*self._killed) if entry["modified"] > made)
        return any(other != name and (shown is None or other in shown) for other in newer)

    def _evaluations(self) -> dict[str, int | None]:
        made = sum(entry["evaluations"] for _, entry in self._entries())
        table = self._folder / "tables" / "skipped.csv"
        skipped = None
        if table.is_file():
            totals = totals_in(table.read_text(encoding="utf-8"))
            skipped = totals.full - totals.done
        return {"evaluations": made, "evaluations_skipped": skipped}

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

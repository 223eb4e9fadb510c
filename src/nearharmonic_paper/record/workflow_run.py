"""Record of a run of the workflow. Failures here are reported as warnings and never abort the run.

A *receipt* lists the files that one job wrote, with their digests; the *manifest* lists all files of a folder of
results, assembled from the receipts; the *history* has a line for each run.
"""

from __future__ import annotations

import os
import platform
import secrets
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from nearharmonic.errors import RefusedError
from nearharmonic.output.atomic import remove_parts
from nearharmonic_paper.config.config import Config
from nearharmonic_paper.experiments.paper.run import totals_in
from nearharmonic_paper.record import history, manifest, state
from nearharmonic_paper.record.fingerprint import fingerprint, machine, revision
from nearharmonic_paper.record.history import dead_in
from nearharmonic_paper.record.state import ASIDE, lock, restore, set_aside
from nearharmonic_paper.tasks.job import LEADER
from nearharmonic_paper.tasks.receipts import RUN, damaged_receipts, names_made_by, receipts_in

#: What the history tells of a run as soon as it starts, in this order; None if it is not known.
FIELDS = (
    "id", "work", "config", "config_digest", "code_digest", "coefficients_digest", "versions", "platform", "cpu",
    "status", "exit_status", "start", "end", "duration", "cpu_seconds", "cores", "command", "targets", "commit",
    "dirty", "jobs_run", "jobs_reused", "evaluations", "evaluations_skipped",
)  # fmt: skip


class WorkflowRun:
    """One run of the workflow, in the process of Snakemake."""

    def __init__(
        self,
        folder: str | os.PathLike[str],
        config: Config,
        makeable: Collection[str] = (),
        configfiles: Sequence[str] = (),
    ) -> None:
        self._folder, self._config, self._makeable, self._configfiles = Path(folder), config, makeable, configfiles
        self._began = datetime.now(UTC)
        self._told: dict[str, Any] = {}
        self._warned: set[str] = set()

    @property
    def id(self) -> str:
        """The id of the run: start time and a random number."""
        return str(self._told.get("id", ""))

    def prepare(self, *, is_dry: bool = False) -> None:
        """Close the record of killed runs, and set damaged files and all that was made from them aside.

        It is called before Snakemake looks at the files, and does nothing while another run is at work. A dry run
        leaves the record as it is.
        """
        if not os.access(self._folder, os.W_OK):
            return
        different = state.differing(self._folder)
        if different == set() and not dead_in(self._folder) and not (self._folder / ASIDE).exists():
            return
        try:
            lock(self._folder)
        except RefusedError:
            return
        restore(self._folder)
        if not is_dry:
            self._recover()
        with self._warning("damaged files are not made again"):
            damaged = state.files_to_remake(self._folder, self._makeable, different)
            if damaged:
                set_aside(self._folder, state.with_results_of(self._folder, self._makeable, damaged))

    def _recover(self) -> None:
        """Bring the record up to date with what killed runs and changes of files have left."""
        with self._warning("killed runs are not closed"):
            history.close_killed(self._folder)
        with self._warning("temporary files are not removed"):
            remove_parts(self._folder)
        with self._warning("damaged receipts are not removed"):
            self._remove_damaged_receipts()
        self._complete()

    def begin(self, command: Sequence[str], targets: Sequence[str], cores: int | None) -> None:
        """Record the start: write a marker, and pass the ids of run and process to the jobs."""
        lock(self._folder)
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
            "made": [],
        }
        os.environ |= {RUN: self.id, LEADER: f"{platform.node()}:{os.getpid()}"}  # jobs inherit them
        with self._warning("the run is not recorded in full"):
            self._told |= fingerprint(self._config)
            self._told |= machine()
        with self._warning("the commit is not recorded"):
            self._told |= revision(Path())
        with self._warning("the history is not written"):
            history.mark(self._folder, self._told)

    def end(self, exit_status: int) -> None:
        """Write manifest and history at the end of a run, whose ``exit_status`` is that of Snakemake."""
        restore(self._folder)
        ended = datetime.now(UTC)
        made = names_made_by(self._folder, self.id)
        self._told |= {
            "status": "failed" if exit_status else "ok",
            "exit_status": exit_status,
            "end": _stamp(ended),
            "duration": round((ended - self._began).total_seconds(), 3),
            "cpu_seconds": round(sum(os.times()[:4]), 2),
            "made": made,
        }
        with self._warning("the evaluations are not recorded"):
            self._told |= self._counts()
        self._complete(ends=True)

    def _complete(self, *, ends: bool = False) -> None:
        """Write the manifest, the line of the history if the run ``ends``, and the state for the next start."""
        with self._warning("the manifest is not written"):
            changed = manifest.write(self._folder, self._makeable, self._configfiles)
            if changed:
                self._warn("", f"changed since their jobs wrote them: {', '.join(changed)} in {self._folder}")
        if ends:
            with self._warning("the history is not written"):
                try:
                    history.append(self._folder, self._told, state.lost_line(self._folder))
                finally:
                    history.unmark(self._folder, self.id)
        with self._warning("the next start looks at all files"):
            state.save(self._folder, self._makeable)

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
        return name in self._told.get("made", ())

    def _counts(self) -> dict[str, int | None]:
        """Numbers of jobs that ran and of those whose results were there, and of evaluations."""
        new: list[dict[str, dict[str, Any]]] = []
        old: list[dict[str, dict[str, Any]]] = []
        for place, files in receipts_in(self._folder):
            (new if place.stat().st_mtime >= self._began.timestamp() else old).append(files)
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

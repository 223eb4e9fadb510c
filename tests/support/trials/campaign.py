"""Counts of the cases that a test tried, for the table of trials (``benchmarks/trials.py``)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

#: More failed cases than these are not listed.
LISTED = 10


class Campaign:
    """Cases of one kind: each is tried, and those that fail are named together at the end of the test."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.tried = 0
        self.failed: list[str] = []

    @contextmanager
    def case(self, label: object) -> Iterator[None]:
        """Try one case: an AssertionError or another exception inside counts as failed, and the next one follows."""
        self.tried += 1
        try:
            yield
        except Exception as fault:
            self.failed.append(f"{label}: {type(fault).__name__}: {fault}")

    def check(self) -> None:
        """Fail the test if there was no case or one of them failed."""
        assert self.tried > 0, f"{self.kind}: no case was tried"
        listed = "\n  ".join(self.failed[:LISTED])
        assert not self.failed, f"{self.kind}: {len(self.failed)} of {self.tried} cases failed\n  {listed}"


class TrialsPlugin:
    """Sums the campaigns of all tests and processes, and writes them where ``--trials`` says."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.counts: dict[str, list[int]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add the campaigns of a test that ended, in whichever process it ran."""
        if report.when != "teardown":
            return
        for name, told in report.user_properties:
            if name == "trials":
                kind, tried, failed = told
                total = self.counts.setdefault(kind, [0, 0])
                total[0] += tried
                total[1] += failed

    def pytest_sessionfinish(self) -> None:
        """Write the counts as JSON: tried and failed of each kind."""
        if self.counts:
            told = {kind: {"tried": tried, "failed": failed} for kind, (tried, failed) in sorted(self.counts.items())}
            self.file.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")

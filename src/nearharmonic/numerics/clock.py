"""Reproducible wall-clock measurements: one pinned thread, interleaved repetitions, quartiles, facts of the machine."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

#: Names of the values of :func:`summary`, in this order.
QUARTILES = ("min", "q1", "median", "q3")


@dataclass(frozen=True, kw_only=True)
class Patience:
    """Repetitions of a call: ``most``, fewer if they take over ``seconds``, but ``least``; two if over ``longest``."""

    least: int = 3
    most: int = 9
    seconds: float = 0.01
    longest: float = 0.03

    def goes_on(self, times: Sequence[float]) -> bool:
        """Return True if a call whose previous repetitions took ``times`` must be repeated."""
        spent = sum(times)
        if len(times) < self.least:
            return len(times) < 2 or spent < self.longest
        return len(times) < self.most and spent < self.seconds


STANDARD = Patience()


@contextmanager
def pinned() -> Iterator[int | None]:
    """Keep this process on the last core it may use; yields that core, or None if the system cannot pin processes.

    A process that moves between cores loses its caches and its clock rate. The allowed cores are restored at the end.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield None
        return
    before = os.sched_getaffinity(0)
    core = max(before)
    os.sched_setaffinity(0, {core})
    try:
        yield core
    finally:
        os.sched_setaffinity(0, before)


def interleaved(calls: Sequence[Callable[[], object]], patience: Patience = STANDARD) -> list[list[float]]:
    """Times of ``calls`` in seconds, one of each call per round, so that other load on the machine affects all equally.

    The caller must make each call once before: the first call compiles and loads code.
    """
    times: list[list[float]] = [[] for _ in calls]
    waiting = list(range(len(calls)))
    clock = time.perf_counter
    while waiting:
        for i in waiting:
            begin = clock()
            calls[i]()
            times[i].append(clock() - begin)
        waiting = [i for i in waiting if patience.goes_on(times[i])]
    return times


def summary(times: Sequence[float]) -> tuple[float, float, float, float]:
    """Minimum, first quartile, median and third quartile of ``times``; NaN if there are none."""
    if not times:
        return (np.nan,) * 4
    return tuple(float(x) for x in np.percentile(times, (0, 25, 50, 75)))  # type: ignore[return-value]


def machine(core: int | None) -> dict[str, str | float]:
    """Facts that times depend on: processor, clock, core, load, date."""
    clock = time.get_clock_info("perf_counter")
    return {
        "cpu": processor(),
        "cpu_count": os.cpu_count() or 1,
        "pinned_core": "not pinned: the system cannot" if core is None else str(core),
        "clock": f"time.perf_counter, {clock.implementation}, resolution {clock.resolution:g} s",
        "load_average": f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown",
        "measured": datetime.now(UTC).isoformat(timespec="seconds"),
        "python_version": platform.python_version(),
    }


def processor(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """Model of the processor, its clock rate if the system reports it, and its widest vector unit."""
    try:
        lines = [line.split(":", 1) for line in cpuinfo.read_text(encoding="utf-8").splitlines() if ":" in line]
    except OSError:
        return platform.processor() or platform.machine()
    facts = {key.strip(): value.strip() for key, value in reversed(lines)}
    words = [facts.get("model name", platform.machine())]
    if "cpu family" in facts and "model" in facts:
        words.append(f"family {facts['cpu family']} model {facts['model']}")
    if "cpu MHz" in facts:
        words.append(f"{float(facts['cpu MHz']) / 1000:.2f} GHz")
    flags = facts.get("flags", "").split()
    words += [name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags][:1]
    return ", ".join(words)

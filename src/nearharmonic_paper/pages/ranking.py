"""The tables of docs/results/ranking.md: all methods on five systems, by evaluations of the force and by time.

The evaluations that a method takes to an error are read off its curve of error against evaluations, by a straight line
through the logarithms between the last run that misses the error and the first from which on all meet it; they are the
same on every machine. Times are those of whole calls of prepared problems at that step, without a look at the energy,
interleaved on one core.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import exp, inf, isfinite, log
from typing import Any

import numpy as np

from nearharmonic.engine.settings import check_fit, steps_of
from nearharmonic.engine.trajectory import sweep
from nearharmonic.errors import SettingError
from nearharmonic.integrators import implicit_integrators, plain_integrators
from nearharmonic.integrators import integrators as registered
from nearharmonic.math import cos
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.recommendation.measure import LOSSLESS, prepared_calls
from nearharmonic.recommendation.step_search import fewest_for_good
from nearharmonic.systems import System
from nearharmonic.systems import systems as known
from nearharmonic.training.published import published_names
from nearharmonic_paper.tasks.receipts import measures_time

ERRORS = (1e-3, 1e-6, 1e-9, 1e-12)
#: Evaluations of the runs of a curve: 15 % more from one to the next.
RATIO, FEWEST, MOST = 1.15, 150, 1_500_000
#: Methods in a row, those that are timed for it besides implicit ones, and repeats.
PLACES, CANDIDATES = 3, 12
REPEATS = Patience(least=7, most=15, seconds=0.05)


@dataclass(frozen=True)
class Contest:
    """A system, its name in headings, and the interval of its runs."""

    name: str
    system: System
    t_end: str


@dataclass
class Curve:
    """Errors of a method by number of steps; ``plain`` has those of plain sums."""

    method: str
    evaluations: dict[int, int] = field(default_factory=dict)
    errors: dict[int, float] = field(default_factory=dict)
    plain: dict[int, float] = field(default_factory=dict)

    def reached(self, error: float) -> tuple[float, int] | None:
        """Evaluations to an error, and the fewest steps from which on all runs meet it; None if they do not."""
        first = fewest_for_good(self.errors, error)
        if first is None:
            return None
        before = sorted(n for n in self.errors if n < first)
        if not before or not isfinite(self.errors[before[-1]]):
            return float(self.evaluations[first]), first
        (x, y), (u, v) = ((log(self.evaluations[n]), log(self.errors[n])) for n in (before[-1], first))
        return exp(x + (u - x) * (log(error) - y) / (v - y)), first

    def summation(self, steps: int) -> str:
        """The cheaper sums that lose nothing."""
        return "plain" if self.plain[steps] <= LOSSLESS * self.errors[steps] else "compensated"


def contests() -> list[Contest]:
    """The systems, from near-harmonic to not."""

    def chain(q: Sequence[Any]) -> Any:
        return sum((b - a) ** 2 / 2 + (b - a) ** 4 / 40 for a, b in pairwise((0, *q, 0)))

    def pair(q: Sequence[Any]) -> Any:
        x, y = q
        return (x * x + 2 * y * y) / 2 + (x**4 + y**4) / 8 + x * x * y * y / 2

    first_mode = tuple(f"{np.sin(np.pi * (i + 1) / 9):.6f}" for i in range(8))
    pendulum = System(name="pendulum", V=lambda q: -cos(q[0]), q0=("1",), p0=("0",), t_end="200")
    quartic = System(name="quartic_pair", V=pair, q0=("1", "0.5"), p0=("0", "0.3"), t_end="200")
    fput = System(name="fput_8", V=chain, q0=first_mode, p0=("0",) * 8, t_end="400")
    return [
        Contest("Hénon-Heiles, H = 1/8", known["henon_heiles"], "200"),
        Contest("Kepler, e = 0.206", known["kepler"], "87660"),
        Contest("pendulum, 1 rad", pendulum, "200"),
        Contest("quartic pair", quartic, "200"),
        Contest("FPUT-8, first mode", fput, "400"),
    ]


def curve(contest: Contest, name: str) -> Curve | None:
    """The errors of a method, or None if it does not fit."""
    tableau, found = registered[name], Curve(name)
    try:
        check_fit(contest.system, tableau)
    except SettingError:
        return None
    ladder = [FEWEST * RATIO**k for k in range(int(log(MOST / FEWEST, RATIO)) + 1)]
    counts = list(dict.fromkeys(max(1, round(n / tableau.stages)) for n in ladder))
    for part in (counts[i : i + 8] for i in range(0, len(counts), 8)):
        taus = [float(contest.t_end) / n for n in part]
        for errors, summation in ((found.errors, "compensated"), (found.plain, "plain")):
            run = sweep(contest.system, tableau, taus, t_end=contest.t_end, summation=summation)
            errors.update(zip(run.steps.values.tolist(), run.max_energy_error.values.tolist(), strict=True))
        found.evaluations.update(zip(run.steps.values.tolist(), run.evaluations.values.tolist(), strict=True))
        if max(found.errors[n] for n in part) < ERRORS[-1]:
            break
    return found


def curves(contest: Contest) -> list[Curve]:
    """The curves of all methods that fit."""
    names = (*plain_integrators.registered, *implicit_integrators.registered)
    return [found for name in names if (found := curve(contest, name)) is not None]


def by_evaluations(found: list[Curve], error: float) -> list[tuple[float, int, Curve]]:
    """Evaluations, steps and curve of the methods that reach an error, the fewest evaluations first."""
    reached = [(*place, one) for one in found if (place := one.reached(error))]
    return sorted(reached, key=lambda row: row[0])


def by_time(contest: Contest, rows: list[tuple[float, int, Curve]]) -> list[tuple[float, Curve]]:
    """Seconds of the methods that lead by evaluations, and of implicit ones, the fastest first."""
    calls = []
    rows = [*rows[:CANDIDATES], *(row for row in rows[CANDIDATES:] if registered[row[-1].method].implicit)]
    for _, steps, one in rows:
        tableau = registered[one.method]
        made = prepared_calls(
            contest.system, tableau, contest.t_end, steps_of(contest.t_end, float(contest.t_end) / steps),
            one.summation(steps), modes=("trajectory",),
        )  # fmt: skip
        calls.append(made["trajectory"])
    times = [min(each, default=inf) for each in interleaved(calls, REPEATS)]
    return sorted(((time, one) for time, (_, _, one) in zip(times, rows, strict=True)), key=lambda row: row[0])


def counted(rows: Iterable[tuple[float, int, Curve]]) -> str:
    """Methods with their evaluations."""
    return ", ".join(f"{registered[one.method].label} {evaluations:.0f}" for evaluations, _, one in rows)


def table(contest: Contest) -> list[str]:
    """Lines of the table of a system."""
    found, lines = curves(contest), []
    for error in ERRORS:
        rows = by_evaluations(found, error)
        cheap = counted(rows[:PLACES])
        public = counted([row for row in rows if row[-1].method in published_names()][:PLACES])
        fast = (f"{registered[one.method].label} {1e6 * time:.0f} µs" for time, one in by_time(contest, rows)[:PLACES])
        lines.append((f"{error:.0e}", cheap, public, ", ".join(fast)))
    return pipes(("error", "fewest evaluations", "of published methods", "shortest time"), lines)


def tables() -> str:
    """Return the tables of all systems."""
    with pinned():
        each = [[f"## {one.name}, t = {one.t_end}", "", *table(one)] for one in contests()]
    return "\n\n".join("\n".join(lines) for lines in each)


@measures_time
def page(page: str, systems: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page, and name the machine."""
    text = filled_page(page, {"ranking": tables()})
    return {"page": re.sub(r"Machine: .*? Times", lambda _: f"Machine: {processor()}. Times", text, flags=re.DOTALL)}

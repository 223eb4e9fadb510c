"""All methods on five systems, by evaluations of the force and by time.

Run: ``python benchmarks/ranking.py``, on a quiet machine; ``--page`` writes the tables to ``docs/results/ranking.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import inf, log
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from timing import fill

from nearharmonic.integrators import implicit_integrators, plain_integrators
from nearharmonic.integrators import integrators as registered
from nearharmonic.math import cos
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor
from nearharmonic.recommendation.measure import Interval, cross, curves_of, fewest_for_good, measure, prepared_call
from nearharmonic.systems import System
from nearharmonic.systems import systems as known
from nearharmonic.training.family import published_names
from nearharmonic_paper.pages.filling import table

if TYPE_CHECKING:
    import xarray as xr

PAGE = "docs/results/ranking.md"
RANKED = (1e-3, 1e-6, 1e-9, 1e-12)
#: Evaluations of the runs of a curve: 15 % more from one to the next.
RATIO, FEWEST, MOST = 1.15, 150, 1_500_000
#: Methods in a row, those that are timed for it besides implicit ones, and repeats.
PLACES, CANDIDATES = 3, 12
REPEATS = Patience(least=7, most=15, seconds=0.05)


class Place(NamedTuple):
    """Cost of a method at an error: evaluations, interpolated, and the steps and sums of a run that meets it."""

    evaluations: float
    method: str
    steps: int
    summation: str


def parts():
    """All methods on five systems, by evaluations of the force and by time."""
    with pinned():
        tables = [f"## {title}, t = {t_end}\n\n{ranked(system, t_end)}" for title, system, t_end in contests()]
    return {"ranking": "\n\n".join(tables), "machine": f"Machine: {processor()}."}


def contests() -> list[tuple[str, System, str]]:
    """Titles, systems and intervals, from near-harmonic to not."""

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
        ("Hénon-Heiles, H = 1/8", known["henon_heiles"], "200"),
        ("Sun-Mercury, e = 0.206", known["kepler"], "87660"),
        ("pendulum, 1 rad", pendulum, "200"),
        ("quartic pair", quartic, "200"),
        ("FPUT-8, first mode", fput, "400"),
    ]


def ranked(system: System, t_end: str) -> str:
    """The table of a system."""
    names = (*plain_integrators.registered, *implicit_integrators.registered)
    measured, rows = curves(system, t_end, names), []
    for error in RANKED:
        places = sorted(place for curve in measured if (place := reached(curve, error)) is not None)
        public = [place for place in places if place.method in published_names()]
        counts = (", ".join(f"{registered[place.method].label} {place.evaluations:.0f}" for place in some[:PLACES])
                  for some in (places, public))  # fmt: skip
        times = (
            f"{registered[name].label} {1e6 * time:.0f} µs" for time, name in timed(system, t_end, places)[:PLACES]
        )
        rows.append((f"{error:.0e}", *counts, ", ".join(times)))
    return table(("error", "fewest evaluations", "of published methods", "shortest time"), rows, left=4)


def curves(system: System, t_end: str, names: Sequence[str]) -> list[xr.Dataset]:
    """Steps, evaluations and errors of methods, without points if a method does not fit."""
    taus = [float(t_end) / (FEWEST * RATIO**k) for k in range(int(log(MOST / FEWEST, RATIO)) + 1)]
    return curves_of(
        measure(Interval(system, t_end), [registered[name] for name in names], taus, modes=(), careful=True)
    )


def reached(curve: xr.Dataset, error: float) -> Place | None:
    """Cost of a method at an error which all finer runs meet; None if it does not reach it."""
    steps, errors = curve["steps"].values.tolist(), curve["max_energy_error"].values.tolist()
    fewest = fewest_for_good(dict(zip(steps, errors, strict=True)), error)
    if fewest is None:
        return None
    _, (evaluations,) = cross(errors, [curve["evaluations"].values.tolist()], error)
    summation = "compensated" if curve["compensated"][steps.index(fewest)] else "plain"
    return Place(evaluations, curve["solver"].item(), int(fewest), summation)


def timed(system: System, t_end: str, places: Sequence[Place]) -> list[tuple[float, str]]:
    """Seconds of the methods that lead by evaluations, and of implicit ones, the fastest first."""
    some = [place for i, place in enumerate(places) if i < CANDIDATES or registered[place.method].implicit]
    calls = [prepared_call(system, registered[p.method], t_end, p.steps, p.summation) for p in some]
    times = (min(each, default=inf) for each in interleaved(calls, REPEATS))
    return sorted(zip(times, (place.method for place in some), strict=True))


if __name__ == "__main__":
    fill(__doc__, parts, PAGE)

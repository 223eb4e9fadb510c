"""Pages on all methods: proved orders and errors in docs/reference/methods.md, and docs/results/ranking.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import exp, inf, isfinite, log
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.engine.settings import misfit, steps_of
from nearharmonic.engine.trajectory import sweep
from nearharmonic.integrators import implicit_integrators, modified_integrators, plain_integrators
from nearharmonic.integrators import integrators as registered
from nearharmonic.math import cos
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor
from nearharmonic.numerics.portable import Floats
from nearharmonic.recommendation.measure import LOSSLESS, prepared_calls
from nearharmonic.systems import System
from nearharmonic.systems import systems as known
from nearharmonic.theory.order import harmonic_order, order_of
from nearharmonic.training.published import published_names
from nearharmonic_paper.pages.filling import fills, table
from nearharmonic_paper.tasks.provenance import measures_time

# --- docs/reference/methods.md ----------------------------------------------------------------------------------------

#: Step sizes per stage at which methods with modified potentials are compared, the heads of their columns, and the time
#: of a force with the gradient of its square over that of a force.
COMPARED = {"henon_heiles": ((0.05, 0.1, 0.2), "Hénon-Heiles, τ/s = {:g}", 2.1),
            "kepler": ((10, 20, 40), "Kepler, {:g} h", 1.3)}  # fmt: skip
#: Methods without a modified potential in this table.
PLAIN = ("ruth", "srkn_b6", "srkn_b11", "srkn_a14", "nystrom_6a8", "babps8o7h")


@fills
def methods() -> dict[str, str]:
    """Proved orders of all methods, and errors of those with a modified potential."""
    first = ("name", "label", "composition", "stages")
    found = {}
    for kind, names, heads in (
        ("methods", plain_integrators, ("order", "order for quadratic T", "harmonic order")),
        ("modified", modified_integrators, ("gradients", "order", "harmonic order")),
        ("implicit", implicit_integrators, ("order", "harmonic order")),
    ):
        rows = []
        for one in map(registered.__getitem__, names.registered):
            order = order_of(one)
            proved = {
                "order": order, "order for quadratic T": one.order if one.requires else order,
                "gradients": getattr(one, "gradients", ""), "harmonic order": harmonic_order(one),
            }  # fmt: skip
            composition = "implicit" if one.implicit else {"drift": "ABA", "kick": "BAB"}[one.first]
            rows.append((f"`{one.name}`", one.label, composition, one.stages, *(proved[head] for head in heads)))
        found[kind] = table((*first, *heads), rows, left=3)
    compared = (*modified_integrators.registered, *PLAIN)
    header = ("name", *(head.format(tau) for taus, head, _ in COMPARED.values() for tau in taus))
    return found | {"errors": table(header, ((f"`{name}`", *decades(name)) for name in compared))}


def decades(name: str) -> Iterator[str]:
    """log10 of the errors of a method at equal numbers of evaluations, and in brackets at equal times."""
    one = registered[name]
    for system, (taus, _, factor) in COMPARED.items():
        at = [[tau * one.stages * charge for tau in taus] for charge in (1, factor)]
        equal, charged = (np.log10(sweep(system, one, steps).max_energy_error.values) for steps in at)
        yield from (f"{a:.1f} ({b:.1f})" if one.modified else f"{a:.1f}" for a, b in zip(equal, charged, strict=True))


# --- docs/results/ranking.md ------------------------------------------------------------------------------------------

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


@measures_time
@fills
def ranking() -> dict[str, str]:
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
        ("Kepler, e = 0.206", known["kepler"], "87660"),
        ("pendulum, 1 rad", pendulum, "200"),
        ("quartic pair", quartic, "200"),
        ("FPUT-8, first mode", fput, "400"),
    ]


def ranked(system: System, t_end: str) -> str:
    """The table of a system."""
    names = (*plain_integrators.registered, *implicit_integrators.registered)
    curves = {name: found for name in names if (found := curve(system, t_end, name)) is not None}
    rows = []
    for error in RANKED:
        places = sorted(place for name, found in curves.items() if (place := reached(name, found, error)))
        public = [place for place in places if place.method in published_names()]
        counts = (", ".join(f"{registered[one.method].label} {one.evaluations:.0f}" for one in some[:PLACES])
                  for some in (places, public))  # fmt: skip
        times = (
            f"{registered[name].label} {1e6 * time:.0f} µs" for time, name in timed(system, t_end, places)[:PLACES]
        )
        rows.append((f"{error:.0e}", *counts, ", ".join(times)))
    return table(("error", "fewest evaluations", "of published methods", "shortest time"), rows, left=4)


def curve(system: System, t_end: str, name: str) -> Floats | None:
    """Steps, evaluations, errors with compensated and with plain sums (4, n) of a method, None if it does not fit."""
    tableau, found = registered[name], []
    if misfit(system, tableau)[0]:
        return None
    ladder = (FEWEST * RATIO**k for k in range(int(log(MOST / FEWEST, RATIO)) + 1))
    counts = list(dict.fromkeys(max(1, round(n / tableau.stages)) for n in ladder))
    for i in range(0, len(counts), 8):
        taus = [float(t_end) / n for n in counts[i : i + 8]]
        careful, plain = (sweep(system, tableau, taus, t_end=t_end, summation=way) for way in ("compensated", "plain"))
        errors = careful.max_energy_error.values
        found.append(np.stack([plain.steps, plain.evaluations, errors, plain.max_energy_error]))
        if errors.max() < RANKED[-1]:
            break
    return np.concatenate(found, axis=1)


def reached(name: str, found: Floats, error: float) -> Place | None:
    """Cost of a method at an error which all finer runs meet; None if it does not reach it."""
    steps, evaluations, errors, plain = found
    missed = np.flatnonzero(~(errors <= error))
    first = int(missed[-1]) + 1 if missed.size else 0
    if first == errors.size:
        return None
    count = float(evaluations[first])
    if first and isfinite(errors[first - 1]):
        (x, u), (y, v) = (np.log(row[first - 1 : first + 1]) for row in (evaluations, errors))
        count = exp(x + (u - x) * (log(error) - y) / (v - y))
    lossless = plain[first] <= LOSSLESS * errors[first]  # the cheaper sums that lose nothing
    return Place(count, name, int(steps[first]), "plain" if lossless else "compensated")


def timed(system: System, t_end: str, places: Sequence[Place]) -> list[tuple[float, str]]:
    """Seconds of the methods that lead by evaluations, and of implicit ones, the fastest first."""
    some = [one for i, one in enumerate(places) if i < CANDIDATES or registered[one.method].implicit]
    calls = [
        prepared_calls(
            system, registered[one.method], t_end, steps_of(t_end, float(t_end) / one.steps), one.summation,
            modes=("trajectory",),
        )["trajectory"]
        for one in some
    ]  # fmt: skip
    times = (min(each, default=inf) for each in interleaved(calls, REPEATS))
    return sorted(zip(times, (one.method for one in some), strict=True))

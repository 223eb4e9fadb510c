"""The tables of docs/how_to/tailor.md: gains of ``nearharmonic tailor``, and over-fitting.

Over-fitting shows in gains on the starts of a search beside gains on others. Budgets are numbers of trials, so that a
seed gives the same rows on one kind of processor; the seconds of the example are those of this run.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from nearharmonic.commands.tailor import answer, arguments
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.answers import printed
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.systems import System
from nearharmonic.systems import systems as registered
from nearharmonic.systems.system import load_system
from nearharmonic.training.population import Ensemble
from nearharmonic.training.question import Orbit, Question, orbit_of, question
from nearharmonic.training.tailor import Tailored, comparison, ensembles, tailored
from nearharmonic.training.tailor_search import registered as contenders_of
from nearharmonic.training.tailor_search import step_sizes

EXAMPLE = ("henon_heiles", "--window", "0.08:0.12", "--trials", "6000")
#: Systems, those of the examples by the names of their files, and trials of their searches among six to twelve stages.
SYSTEMS = (
    "henon_heiles", "kepler", "relativistic_oscillator", "morse", "pendulum", "quartic_well", "double_well",
    "toda_chain", "outer_solar_system", "driven_oscillator",
)  # fmt: skip
TRIALS = 12_000
#: Over-fitting: systems with stages, starts of the search, trials, and draws of as many starts whose mean is shown.
OVER = (("henon_heiles", 8), ("morse", 9), ("kepler", 12))
STARTS, OVER_TRIALS, DRAWS = (1, 2, 4, 8, 16, 32), 4000, 3
#: Elsewhere: a method for H0 = 1/8 at 0.08 to 0.12 on other step sizes, and on other energies.
STEPS, ENERGIES = (0.03, 0.05, 0.065, 0.08, 0.1, 0.12, 0.15, 0.18), (0.001, 0.01, 0.04, 0.08, 0.125, 0.15)


def example() -> str:
    """Return the text that the command prints."""
    parser = ArgumentParser()
    arguments(parser)
    return f"```\n{printed(answer(parser.parse_args(EXAMPLE)), 'table')}```"


def gains(subjects: Mapping[str, System]) -> str:
    """Return a row for each system."""
    rows = []
    for name in SYSTEMS:
        found = gain_of(subjects[name])
        unit = found.question.system.units["t"]
        window = f"{found.window[0]:g} to {found.window[1]:g}{'' if unit == '1' else f' {unit}'}"
        overall = ", ".join(f"`{name}`" for name in dict.fromkeys(found.test.best))
        test = f"**{found.test.gain}**" if found.has_gain else str(found.test.gain)
        label = found.question.system.label
        rows.append((label, window, overall, found.tableau.stages, str(found.training.gain), test))
    columns = ("system", "window", "best registered", "stages", "on the starts of the search", "on others")
    return "\n".join(pipes(columns, rows))


def gain_of(system: System, trials: int = TRIALS) -> Tailored:
    """Return the method for a system, from six to twelve stages."""
    return tailored(question(system, stages="6:12", trials=trials))


def pool(system: System) -> Floats:
    """Return many starts near that of a system (R, 2 d)."""
    rows, d = [], system.dimension
    for seed in range(100, 100 + DRAWS):
        both = ensembles(question(system, seed=seed), orbit_of(system))
        rows += [np.hstack([one.start[:, :d], one.start[:, 2 * d : 3 * d]]) for one in both]
    return np.vstack(rows)


def over_fitting(subjects: Mapping[str, System]) -> str:
    """Return gains by the number of starts, on these and on 64 others."""
    rows = []
    for name, stages in OVER:
        starts = pool(subjects[name])
        for count in STARTS:
            pairs = [fitted(subjects[name], stages, starts, count, draw) for draw in range(DRAWS)]
            own, others = np.mean(pairs, axis=0)
            rows.append((subjects[name].label, count, *(f"{gain:.2f}" for gain in (own, others, own - others))))
    return "\n".join(pipes(("system", "starts", "on these", "on others", "difference"), rows, align="lr"))


def fitted(system: System, stages: int, starts: Floats, count: int, draw: int) -> tuple[float, float]:
    """Return the gains of a method that is made on so many starts, on these and on others."""

    def few(asked: Question, orbit: Orbit) -> tuple[Ensemble, Ensemble]:
        first, second = ensembles(replace(asked, starts=starts, seed=0), orbit)
        picked = np.random.default_rng([draw, count]).permutation(first.size)[:count]
        return first.part(picked), second.part(slice(64))

    found = tailored(question(system, stages=stages, trials=OVER_TRIALS, seed=draw), starts=few)
    return found.training.gain.mean, found.test.gain.mean


def elsewhere() -> str:
    """Return gains of one method on other step sizes and energies."""
    asked = question(registered["henon_heiles"], window="0.08:0.12", energy="same", trials=6000)
    found = tailored(asked)
    others = contenders_of(asked.system)
    wide = comparison(found.tableau, others, found.held_out, np.array(STEPS), 0)
    gains_by_step = ["gain at H = 1/8", *(f"{gain.mean:.2f}" for gain in wide.gains)]
    lines = [*pipes(["tau/s", *(f"{tau:g}" for tau in STEPS)], [gains_by_step], align="lr"), ""]
    cells = []
    for energy in ENERGIES:
        there = replace(asked, energy=energy, scale=energy)
        ensemble = replace(ensembles(there, orbit_of(asked.system))[1], t_end=found.held_out.t_end)
        cells.append(f"{comparison(found.tableau, others, ensemble, step_sizes(found.window), 0).gain.mean:.2f}")
    header = ["H", *(f"{energy:g}" for energy in ENERGIES)]
    return "\n".join([*lines, *pipes(header, [["gain at tau/s = 0.08 to 0.12", *cells]], align="lr")])


def page(page: str, files: Sequence[str], systems: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page. ``files`` are paths of the examples."""
    examples = {Path(path).stem: path for path in files}
    subjects = {name: load_system(examples[name]) if name in examples else registered[name] for name in SYSTEMS}
    parts = {
        "example": example(),
        "elsewhere": elsewhere(),
        "over-fitting": over_fitting(subjects),
        "gains": gains(subjects),
    }
    return {"page": filled_page(page, parts)}

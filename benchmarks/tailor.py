"""Methods tailored to ten systems: gains, over-fitting to few starts, and gains on other step sizes and energies.

Run: ``python benchmarks/tailor.py``; ``--page`` writes the tables to ``docs/how_to/tailor.md``. Nothing is timed.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from timing import ROOT, fill

from nearharmonic.commands.choice import tailor_answer, tailor_arguments
from nearharmonic.output.table import printed
from nearharmonic.systems import System
from nearharmonic.systems import systems as known
from nearharmonic.systems.system import load_system
from nearharmonic.training.objective import Ensemble
from nearharmonic.training.question import Orbit, TailorRequest, orbit_of, question, step_sizes
from nearharmonic.training.question import registered as contenders_of
from nearharmonic.training.tailor import Tailored, comparison, ensembles, tailored
from nearharmonic_paper.pages.filling import table

PAGE = "docs/how_to/tailor.md"
#: Systems, or the names of the files of examples, and trials of their searches among six to twelve stages.
TAILORED = (
    "henon_heiles", "kepler", "relativistic_oscillator", "morse", "pendulum", "quartic_well", "double_well",
    "toda_chain", "outer_solar_system", "driven_oscillator",
)  # fmt: skip
TRIALS = 12_000
#: Over-fitting: systems with stages, starts of the search, trials, and draws of as many starts whose mean is shown.
OVER = (("henon_heiles", 8), ("morse", 9), ("kepler", 12))
STARTS, OVER_TRIALS, DRAWS = (1, 2, 4, 8, 16, 32), 4000, 3
#: Elsewhere: a method for H0 = 1/8 at 0.08 to 0.12 on other step sizes, and on other energies.
OTHER_STEPS, OTHER_ENERGIES = (0.03, 0.05, 0.065, 0.08, 0.1, 0.12, 0.15, 0.18), (0.001, 0.01, 0.04, 0.08, 0.125, 0.15)


def parts():
    """Output of the command, gains on ten systems, over-fitting, and gains elsewhere.

    Budgets are numbers of trials, so that a seed gives the same rows on one kind of processor.
    """
    examples = {path.stem: str(path) for path in (ROOT / "examples").glob("*.py")}
    subjects = {name: load_system(examples[name]) if name in examples else known[name] for name in TAILORED}
    parser = ArgumentParser()
    tailor_arguments(parser)
    shown = tailor_answer(parser.parse_args(["henon_heiles", "--window", "0.08:0.12", "--trials", "6000"]))
    heads = ("system", "window", "best registered", "stages", "on the starts of the search", "on others")
    made = (tailored(question(one, stages="6:12", trials=TRIALS)) for one in subjects.values())
    return {
        "example": f"```\n{printed(shown, 'table')}```",
        "gains": table(heads, map(gain_row, made), left=6),
        "over-fitting": table(
            ("system", "starts", "on these", "on others", "difference"),
            (row for name, stages in OVER for row in over_fitting(subjects[name], stages)),
        ),
        "elsewhere": elsewhere(),
    }


def gain_row(found: Tailored) -> tuple[str, ...]:
    """Window, best registered methods and gains on a system, bold where the new method is ahead."""
    unit = found.question.system.units["t"]
    window = f"{found.window[0]:g} to {found.window[1]:g}{'' if unit == '1' else f' {unit}'}"
    best = ", ".join(f"`{name}`" for name in dict.fromkeys(found.test.best))
    test = f"**{found.test.gain}**" if found.has_gain else str(found.test.gain)
    return found.question.system.label, window, best, str(found.tableau.stages), str(found.training.gain), test


def over_fitting(system: System, stages: int) -> Iterator[tuple[object, ...]]:
    """Gains by the number of starts, on these and on 64 others, means of several draws."""
    rows, d = [], system.dimension
    for seed in range(100, 100 + DRAWS):
        both = ensembles(question(system, seed=seed), orbit_of(system))
        rows += [np.hstack([one.start[:, :d], one.start[:, 2 * d : 3 * d]]) for one in both]
    starts = np.vstack(rows)

    def gains(count: int, draw: int) -> tuple[float, float]:
        def few(asked: TailorRequest, orbit: Orbit) -> tuple[Ensemble, Ensemble]:
            first, second = ensembles(replace(asked, starts=starts, seed=0), orbit)
            picked = np.random.default_rng([draw, count]).permutation(first.size)[:count]
            return first.part(picked), second.part(slice(64))

        found = tailored(question(system, stages=stages, trials=OVER_TRIALS, seed=draw), starts=few)
        return found.training.gain.mean, found.test.gain.mean

    for count in STARTS:
        own, others = np.mean([gains(count, draw) for draw in range(DRAWS)], axis=0)
        yield system.label, count, *(f"{gain:.2f}" for gain in (own, others, own - others))


def elsewhere() -> str:
    """Gains of one method on other step sizes and energies."""
    asked = question(known["henon_heiles"], window="0.08:0.12", energy="same", trials=6000)
    found = tailored(asked)
    others = contenders_of(asked.system)
    wide = comparison(found.tableau, others, found.held_out, np.array(OTHER_STEPS), 0)
    gains = []
    for energy in OTHER_ENERGIES:
        there = ensembles(replace(asked, energy=energy, scale=energy), orbit_of(asked.system))[1]
        ensemble = replace(there, t_end=found.held_out.t_end)
        gains.append(comparison(found.tableau, others, ensemble, step_sizes(found.window), 0).gain)
    return "\n\n".join(
        table((head, *(f"{x:g}" for x in values)), [(row, *(f"{gain.mean:.2f}" for gain in some))])
        for head, values, row, some in (
            ("tau/s", OTHER_STEPS, "gain at H = 1/8", wide.gains),
            ("H", OTHER_ENERGIES, "gain at tau/s = 0.08 to 0.12", gains),
        )
    )


if __name__ == "__main__":
    fill(__doc__, parts, PAGE)

"""Gains of ``nearharmonic tailor``, and over-fitting: gains on the starts of a search beside gains on others.

Run: ``python benchmarks/tailor.py`` (about ten minutes). Writes the tables into docs/tailor.md. Budgets are numbers of
trials, so that a seed gives the same rows on one kind of processor; the seconds of the example are those of this run.
"""

from __future__ import annotations

import contextlib
import io
from dataclasses import replace
from pathlib import Path

import numpy as np

from nearharmonic.cli import main as command
from nearharmonic.output.page import filled, pipes
from nearharmonic.training.tailor.orbit import orbit_of
from nearharmonic.training.tailor.published import published, step_sizes
from nearharmonic.training.tailor.question import question
from nearharmonic.training.tailor.result import comparison
from nearharmonic.training.tailor.tailoring import ensembles, tailored

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/tailor.md"
EXAMPLE = ("henon_heiles", "--window", "0.08:0.12", "--trials", "6000")
#: Systems, and trials of their searches among six to twelve stages.
SYSTEMS = ("henon_heiles", "kepler", "relativistic_oscillator", *(
    f"examples/{name}.py" for name in (
        "morse", "pendulum", "quartic_well", "double_well", "toda_chain", "outer_solar_system", "driven_oscillator",
    )
))  # fmt: skip
TRIALS = 12_000
#: Over-fitting: systems with stages, starts of the search, trials, and draws of as many starts whose mean is shown.
OVER = (("henon_heiles", 8), ("examples/morse.py", 9), ("kepler", 12))
STARTS, OVER_TRIALS, DRAWS = (1, 2, 4, 8, 16, 32), 4000, 3
#: Elsewhere: a method for H0 = 1/8 at 0.08 to 0.12 on other step sizes, and on other energies.
STEPS, ENERGIES = (0.03, 0.05, 0.065, 0.08, 0.1, 0.12, 0.15, 0.18), (0.001, 0.01, 0.04, 0.08, 0.125, 0.15)


def example() -> str:
    """Return the text that the command prints."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        command(["tailor", *EXAMPLE])
    return f"```\n{out.getvalue()}```"


def gains() -> str:
    """A row for each system."""
    rows = []
    for system in SYSTEMS:
        found = gain_of(system)
        unit = found.question.system.units["t"]
        window = f"{found.window[0]:g} to {found.window[1]:g}{'' if unit == '1' else f' {unit}'}"
        overall = ", ".join(f"`{name}`" for name in dict.fromkeys(found.test.best))
        test = f"**{found.test.gain}**" if found.has_gain else str(found.test.gain)
        label = found.question.system.label
        rows.append((label, window, overall, found.tableau.stages, found.training.gain, test))
    columns = ("system", "window", "best published", "stages", "on the starts of the search", "on others")
    return "\n".join(pipes(columns, rows))


def gain_of(system: str, trials: int = TRIALS):
    """The method for a system, from six to twelve stages."""
    return tailored(question(str(ROOT / system) if "/" in system else system, stages="6:12", trials=trials))


def pool(system: str):
    """Many starts near that of a system (R, 2 d)."""
    rows = []
    for seed in range(100, 100 + DRAWS):
        asked = question(system, seed=seed)
        d, subject = asked.system.dimension, asked.system
        both = ensembles(asked, orbit_of(subject))
        rows += [np.hstack([one.start[:, :d], one.start[:, 2 * d : 3 * d]]) for one in both]
    return np.vstack(rows)


def over_fitting() -> str:
    """Gains by the number of starts, on these and on 64 others."""
    rows = []
    for name, stages in OVER:
        system = str(ROOT / name) if "/" in name else name
        starts = pool(system)
        for count in STARTS:
            label, pairs = fitted(system, stages, starts, count)
            own, others = np.mean(pairs, axis=0)
            rows.append((label, count, *(f"{gain:.2f}" for gain in (own, others, own - others))))
    return "\n".join(pipes(("system", "starts", "on these", "on others", "difference"), rows, align="lr"))


def fitted(system: str, stages: int, starts, count: int):
    """Label of the system, and the gains of methods made on so many starts, on these and on others, over some draws."""
    import nearharmonic.training.tailor.tailoring as module

    pairs, plain = [], module.ensembles
    for draw in range(DRAWS):
        asked = question(system, stages=stages, trials=OVER_TRIALS, seed=draw)

        def few(asked, orbit, draw=draw):
            first, second = plain(replace(asked, starts=starts, seed=0), orbit)
            picked = np.random.default_rng([draw, count]).permutation(first.size)[:count]
            return first.part(picked), second.part(slice(64))

        module.ensembles = few
        try:
            found = tailored(asked)
        finally:
            module.ensembles = plain
        pairs.append((found.training.gain.mean, found.test.gain.mean))
    return asked.system.label, pairs


def elsewhere() -> str:
    """Gains of one method on other step sizes and energies."""
    asked = question("henon_heiles", window="0.08:0.12", energy="same", trials=6000)
    found = tailored(asked)
    others = published(asked.system)
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


def main() -> None:
    """Write what was found into the page, between its marks."""
    for name, table in (
        ("example", example),
        ("elsewhere", elsewhere),
        ("over-fitting", over_fitting),
        ("gains", gains),
    ):
        found = table()
        print(name, found, sep="\n", flush=True)
        PAGE.write_text(filled(PAGE.read_text("utf-8"), {name: found}), encoding="utf-8")


if __name__ == "__main__":
    main()

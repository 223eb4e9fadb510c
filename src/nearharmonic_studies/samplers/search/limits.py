"""Gain of a method that is trained for one strength of the anharmonicity alone, and its cost at other strengths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.dataset import Contents, coordinate, variable
from nearharmonic.output.store import read
from nearharmonic.training.search import Effort
from nearharmonic.training.searcher import Searcher
from nearharmonic_studies.samplers.search.training import Objective, Proposals, SecondOrder, methods_of, starts_of
from nearharmonic_studies.samplers.settings import SamplersSettings

#: Strengths of the quartic term, the family, and the sets of starts, and how much larger they are than in training.
STRENGTHS_ALONE, FAMILY, SETS, LARGER = (0.0, 0.1, 0.5, 2.0), SecondOrder(stages=4, first="kick"), 6, 4


def specialist(strength: float, settings: SamplersSettings) -> Tableau:
    """Return the best method of the family for one strength."""
    objective = cast("Any", Objective(FAMILY, Proposals(settings.seed, settings.starts, (strength,))))
    effort = Effort(trials=settings.trials, population=12, random_points=100, small_step=1e-6)
    searcher = Searcher(effort, [settings.seed, 400])
    for start in starts_of(FAMILY, settings.methods, 0):
        searcher.search(objective, start)
    name = f"for_{strength:g}"
    return FAMILY.method(searcher.best.unknowns, name, f"searched for b = {strength:g} alone")


def gains(methods: list[Tableau], known: list[Tableau], seed: int, starts: int) -> Floats:
    """Return the gains (methods, b) over the best known method at each strength, on starts not seen in training."""
    proposals = Proposals(seed, starts, STRENGTHS_ALONE)
    best = np.min([proposals.gradients(one) for one in known], axis=0)
    found: Floats = best / np.array([proposals.gradients(one) for one in methods])
    return found


def measure(settings: SamplersSettings, trained: Sequence[str]) -> dict[str, Contents]:
    """Return ``run``: ``gain`` over (strength, specialist, set), and of the methods trained for all strengths."""
    known = [integrators[name] for name in settings.methods]
    searched = methods_of(map(read, trained))
    special = {f"{b:g}": specialist(b, settings) for b in STRENGTHS_ALONE}
    every = [*special.values(), *searched.values()]
    found = np.array([gains(every, known, settings.seed + 1000 + k, LARGER * settings.starts) for k in range(SETS)])
    values = found.transpose(2, 1, 0)
    plain = Objective(FAMILY, Proposals(settings.seed, settings.starts))
    variables = {
        **coordinate("strength", list(STRENGTHS_ALONE), "strength b of the quartic term"),
        **coordinate("trained_for", [*special, *searched], "strength that a method was trained for, or its name"),
        "trained_label": variable("trained_for", [one.label for one in every], "name in figures"),
        "special_gain": variable(
            ("strength", "trained_for", "set"),
            values,
            "gain over the best known method, on starts not seen in training",
        ),
        **coordinate("known", [*settings.methods, *searched], "integrator"),
        "known_objective": variable(
            "known", [plain.of(one) for one in (*known, *searched.values())], "log of gradients over those of leapfrog"
        ),
    }
    return {"run": Contents(variables=variables, coordinates=("trained_label",))}

"""One step of each method with each step size."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
from nearharmonic_paper.experiments.added.settings import AddedSettings

from nearharmonic.integrators import integrators
from nearharmonic.output.store import Contents, coordinate, method_coordinates, variable


def measure(methods: Sequence[str], settings: AddedSettings) -> dict[str, Contents]:
    """Return ``run``: the states after one step, over (integrator, tau)."""
    tau = 0.5 ** np.arange(1, settings.steps + 1)
    states = np.array([[_state(name, float(one)) for one in tau] for name in methods])
    variables = {
        **method_coordinates(integrators[name] for name in methods),
        **coordinate("tau", tau, "step size"),
        "q": variable(("integrator", "tau"), states[..., 0], "position after the step"),
        "p": variable(("integrator", "tau"), states[..., 1], "momentum after the step"),
    }
    return {"run": Contents(variables=variables, coordinates=("label",))}


def _state(name: str, tau: float) -> tuple[float, float]:
    """Position and momentum after one step from q = 0, p = 1."""
    method, q, p = integrators[name], 0.0, 1.0
    letters = ("kick", "drift") if method.first == "kick" else ("drift", "kick")
    for pair in zip_longest(method.outer, method.inner, fillvalue="0"):
        for letter, number in zip(letters, pair, strict=True):
            if letter == "kick":
                p -= tau * float(number) * q
            else:
                q += tau * float(number) * p
    return q, p

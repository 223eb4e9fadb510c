"""Comparison of the splitting with an exactly solved oscillator and the splitting into T and V, on Henon-Heiles."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from nearharmonic.engine.settings import EXACT_OSCILLATOR, check_fit
from nearharmonic.integrators import expanded, integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import geometric
from nearharmonic.systems.henon_heiles import SYSTEM
from nearharmonic_paper import entries

#: Cost ratios of a step with the exact oscillator for the comparison.
CHARGES = (1.0, 1.1, 1.25, 1.5, 2.0)


@dataclass(frozen=True, kw_only=True)
class ExactOscillatorSettings:
    """Energy error against amplitude with the oscillator solved exactly, at equal cost."""

    __pydantic_config__ = entries.STRICT

    integrators: tuple[str, ...] = entries.setting(
        "Methods that solve the oscillator exactly, beside the methods with T and V",
        "a list of at least one integrator, each named once",
        each="the name of an integrator, or the path of a Python file that defines TABLEAU or TABLEAUS",
        default=("aba104", "aba864", "aba1064", "rnia12", "na7", "trained_exact_light", "trained_exact_fine"),
        min_length=1,
    )
    energies: int = entries.setting(
        "Energies of the Henon-Heiles system from 1/80000 to 1/6, even in the logarithm",
        default=17,
        **entries.whole_from(2, 1000),
    )
    trajectories: int = entries.setting(
        "Quasi-random starts on each energy surface", default=192, **entries.whole_from(1, 10**5)
    )
    t_end: entries.PositiveDecimal = entries.setting(
        "Every run covers [0, t_end]", entries.POSITIVE, unit="1", default="500"
    )
    tau_per_stage: tuple[entries.PositiveDecimal, ...] = entries.positive_numbers(
        "Step sizes divided by the number of stages, equal for all methods", "0.1", "0.05"
    )
    seed: int = entries.setting("Chooses the quasi-random points", default=1, **entries.whole_from(0))

    def check(self, methods: Sequence[Tableau], problems: Collection[str]) -> None:
        """Raise an error for unknown integrators and for too many force evaluations."""
        exact = [integrators[name] for name in expanded(self.integrators)]
        for tableau in exact:
            check_fit(SYSTEM, tableau, EXACT_OSCILLATOR)
        runs = len(methods) + len(CHARGES) * len(exact)
        each = runs * self.energies * sum(float(self.t_end) / float(tau) for tau in self.tau_per_stage)
        entries.check_affordable("exact_oscillator.trajectories", self.trajectories, each)

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods for the exactly solved oscillator, including those from files."""
        return expanded(self.integrators)

    def surfaces(self) -> list[float]:
        """Return the energies from the smallest amplitude to escape."""
        return geometric(1 / 80_000, 1 / 6, self.energies)

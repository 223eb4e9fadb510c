"""Settings of the training of methods: the effort of the search."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from nearharmonic.engine.settings import one_of
from nearharmonic.integrators.tableau import Tableau
from nearharmonic_paper.entries import STRICT, setting, whole_from
from nearharmonic_studies.trained.proof_settings import ProofSettings
from nearharmonic_studies.trained.purposes import PURPOSES, REGISTERED


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """Effort of the search for trained methods; all budgets are numbers of tried methods."""

    __pydantic_config__ = STRICT

    seed: int = setting(
        "Of the systems and of the search; the same seed gives the same methods", default=1, **whole_from(0, 10**6)
    )
    systems: int = setting("Problems that a method is trained on", default=64, **whole_from(2, 10**5))
    held_out: int = setting(
        "Problems that the choice is made on, and as many others that it is tested on", default=256,
        **whole_from(2, 10**5),
    )  # fmt: skip
    trials: int = setting("Methods tried from each start", default=6000, **whole_from(20, 10**7))
    random: int = setting("Random starts for each family", default=1, **whole_from(0, 10**6))
    refinements: int = setting("Searches around the best of each family", default=8, **whole_from(0, 10**6))


@dataclass(frozen=True, kw_only=True)
class TrainedSettings:
    """The experiment on trained methods."""

    __pydantic_config__ = STRICT

    purposes: tuple[str, ...] = setting(
        "Purposes that methods are trained for", "a list of purposes, each named once", each="the name of a purpose",
        default=REGISTERED, min_length=1,
    )  # fmt: skip
    search: SearchSettings = setting("Effort of the search for trained methods", default=SearchSettings)
    proof: ProofSettings = setting("Problems on which trained and other methods are compared", default=ProofSettings)

    def check(self, methods: Sequence[Tableau], problems: Collection[str]) -> None:
        """Raise an error for unknown purposes and too many evaluations; keys are named as in a config."""
        for i, purpose in enumerate(self.purposes):
            one_of(f"trained.purposes[{i}]", purpose, tuple(PURPOSES))
        self.proof.check()

"""Run time against error, for the methods of this package and for other libraries."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from nearharmonic.engine.settings import check_fit, one_of
from nearharmonic.integrators import expanded, integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import systems
from nearharmonic_paper.entries import STRICT, PositiveNumber, setting, whole_from

#: Module of Nielsen's Table 4; his figures have some of its methods.
PAPER = "nearharmonic.integrators.nielsen_2015"


@dataclass(frozen=True, kw_only=True)
class WorkPrecisionSettings:
    """Run time against error: further methods, other libraries, and time limits."""

    __pydantic_config__ = STRICT

    integrators: tuple[str, ...] | None = setting(
        "Methods besides the methods of the figures; if not given, all except the other ones of the paper's Table 4",
        "a list of integrators, each named once",
        each="the name of an integrator, or the path of a Python file that defines TABLEAU or TABLEAUS",
        default=None,
    )
    points_per_decade: int = setting(
        "Step sizes in each factor of ten, over the range of the system", default=8, **whole_from(1, 100)
    )
    evaluations: int = setting(
        "Largest number of force evaluations in a run of this package's methods",
        default=1_250_000,
        **whole_from(100, 10**9),
    )
    peers: tuple[str, ...] | None = setting(
        "Other libraries, timed if they are installed and named as missing if not; numpy is plain numpy code, gcc a "
        "plain loop in C. All known libraries if not given",
        "a list of libraries, each named once",
        each="the name of a library",
        default=None,
    )
    longest: PositiveNumber = setting(
        "Library settings are refined until a run takes longer", "a finite number above 0", unit="s", default=0.25
    )

    def check(self, methods: Sequence[Tableau], problems: Collection[str]) -> None:
        """Raise an error for unknown integrators and libraries, and methods that do not fit one of the ``problems``."""
        from nearharmonic_paper.experiments.work_precision.peers import LIBRARIES

        for name in expanded(self.integrators or ()):
            for problem in problems:
                check_fit(systems[problem], integrators[name])
        for i, library in enumerate(self.peers or ()):
            one_of(f"work_precision.peers[{i}]", library, LIBRARIES)

    def methods(self, figures: Collection[str]) -> list[str]:
        """Return the names of all timed methods: first the methods of the ``figures``, then the others."""
        if self.integrators is None:
            others = tuple(name for name in integrators if integrators.module_of(name) != PAPER)
        else:
            others = expanded(self.integrators)
        return [*figures, *(name for name in others if name not in figures)]

    def solvers(self) -> list[str]:
        """Return the names of the timed solvers of peers, in the order of the peers."""
        from nearharmonic_paper.experiments.work_precision.peers import PEERS

        return [name for name, peer in PEERS.items() if self.peers is None or peer.module in self.peers]

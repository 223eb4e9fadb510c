"""Settings of the experiment on crystals."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from nearharmonic.engine.settings import one_of
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import expanded, integrators
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic_paper.entries import STRICT, PositiveDecimal, positive_numbers, setting, some_of, whole_from

#: Crystals, and the cells of each at size 1: 4, 4 and 8 atoms or two masses in a cell.
CELLS = {"argon": 3, "copper": 2, "silicon": 2, "chain": 512}
#: Methods of the long runs, and of the runs with a thermostat.
DRIFTING = ("leapfrog", "predescu_s3", "babps9o7h", "trained_light")
AVERAGED = ("leapfrog", "bcss_s3", "bcss_s4", "predescu_s3", "babs7o7h", "trained_coarse")


@dataclass(frozen=True, kw_only=True)
class CrystalsSettings:
    """Energy error on crystals against temperature and step size."""

    __pydantic_config__ = STRICT

    integrators: tuple[str, ...] = setting(
        "Methods of plain kicks and drifts that are compared",
        "a list of at least two integrators, each named once",
        each="the name of an integrator, or the path of a Python file that defines TABLEAU or TABLEAUS",
        default=(
            "leapfrog", "bcss_s3", "bcss_s4", "predescu_s3", "omelyan_v5", "pefrl", "srkn_b6", "srkn_b11",
            "blanes_moan_s6o4",
            "abas5o6h", "babs6o5h", "babps6o5h", "babs7o7h", "babps8o7h", "babps9o7h",
            "trained_coarse", "trained_light", "trained_moderate", "trained_fine",
        ),
        min_length=2,
    )  # fmt: skip
    crystals: tuple[str, ...] = some_of("Crystals", tuple(CELLS))
    cells: int = setting(
        "Cells along an edge of the cubic crystals, and 2^(3 cells) of the chain; 0 takes 3, 2, 2 and 512",
        default=0,
        **whole_from(0, 6),
    )
    temperatures: tuple[PositiveDecimal, ...] = positive_numbers(
        "Temperatures relative to the melting point", "0.01", "0.03", "0.1", "0.3", "1"
    )
    forces: tuple[PositiveDecimal, ...] = positive_numbers(
        "Forces in a period of the fastest phonon; leapfrog is stable above pi",
        *("40", "32", "26", "20", "16", "13", "10", "8", "6.3", "5", "4"),
    )
    periods: int = setting("Periods of the fastest phonon in a run", default=20, **whole_from(1))
    starts: int = setting("Equilibrated starts at each temperature", default=10, **whole_from(1, 1000))
    drift_steps: int = setting("Steps of the runs that measure the drift of the energy", default=10**5, **whole_from(1))
    drift_starts: int = setting("Starts of these runs", default=2, **whole_from(2, 1000))
    average_forces: int = setting("Forces of a run that measures averages", default=10**6, **whole_from(1))
    seed: int = setting("Chooses the starts", default=1, **whole_from(0))

    def check(self, methods: Sequence[Tableau], problems: Collection[str]) -> None:
        """Raise an error for unknown integrators, and for integrators that need more than forces."""
        for name in self.crystals:
            one_of("crystals.crystals", name, tuple(CELLS))
        for name in self.methods:
            tableau = integrators[name]
            if tableau.modified or tableau.processed:
                allowed = "methods of plain kicks and drifts, without modified potentials and processors"
                raise bad_setting("crystals.integrators", name, allowed)

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods, including those from files."""
        return expanded(self.integrators)

    def size(self, crystal: str) -> int:
        """Return the number of cells of a crystal, along an edge or of the chain."""
        if self.cells == 0:
            return CELLS[crystal]
        return 2 ** (3 * self.cells) if crystal == "chain" else self.cells


# --- The method that was trained on model crystals, to be compared with the registered ones.
#
# The search is the target ``trained`` with the key ``trained: {purposes: [crystal_coarse]}``.

TRAINED_ON_CRYSTALS = Tableau(
    name="trained_on_crystals",
    label="trained on crystals",
    order=4,
    first="kick",
    kick=palindrome(
        "0.07589539295301059723938800264622307417580801794650946314490101",
        "-0.14450477211212790944531833877971568736203515542461259403873900",
        "0.43766354494346381649138752094499544627876270099785514183017586",
        centre="0.26189166843130699142908563037699433381492887296049597812732424",
    ),
    drift=palindrome(
        "0.28146671897081099689832933537962532449426044468625333246129240",
        "-0.04150119854885854351883150908688622869390368309447006634157618",
        "0.26003447957804754662050217370726090419964323840821673388028378",
    ),
    source="found by the target trained for the purpose crystal_coarse",
    digits=60,
)

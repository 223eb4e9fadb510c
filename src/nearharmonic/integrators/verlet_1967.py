"""Verlet (1967), Computer "experiments" on classical fluids, Phys. Rev. 159, 98, doi:10.1103/PhysRev.159.98.

The leapfrog, kick first, which is the velocity form of Verlet's recursion for the positions.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

TABLEAUS = (
    Tableau(
        name="leapfrog",
        label="Leapfrog",
        order=2,
        first="kick",
        kick=palindrome("0.5"),
        drift=("1",),
        source="Verlet (1967), Phys. Rev. 159, 98, doi:10.1103/PhysRev.159.98",
        digits=80,
        note="exact coefficients",
        aliases=("verlet", "velocity_verlet", "stormer_verlet", "strang"),
    ),
)

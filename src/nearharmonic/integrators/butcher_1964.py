"""Gauss methods: Kuntzmann (1961); Butcher (1964), doi:10.1090/S0025-5718-1964-0159424-9.

They are symplectic: Sanz-Serna (1988), doi:10.1007/BF01954907. Iterated on the forces, with all eight stages in SIMD
lanes: Antonana, Makazaga & Murua (2025), arXiv:2511.03655.
"""

from nearharmonic.integrators.collocation import Collocation

TABLEAUS = (
    Collocation(
        name="gauss16",
        label="Gauss 16",
        stages=8,
        source="Butcher (1964), doi:10.1090/S0025-5718-1964-0159424-9; stages in lanes: Antonana et al. (2025), "
        "arXiv:2511.03655",
        note="implicit: for one trajectory at 1e-12 and below; an iteration takes eight forces at once",
    ),
)

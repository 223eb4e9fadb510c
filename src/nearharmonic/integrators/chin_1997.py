"""Chin (1997), Symplectic integrators from composite operator factorizations, Phys. Lett. A 226, 344, method A.

doi:10.1016/S0375-9601(97)00003-0. The force of the middle kick is F + tau^2 grad |F|^2 / 48; all coefficients are
positive.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

TABLEAUS = (
    Tableau(
        name="chin_4a",
        label="Chin 4A",
        order=4,
        first="kick",
        kick=palindrome(
            "0.16666666666666666666666666666666666666666666666666666666666666666666666666666667",
            centre="0.66666666666666666666666666666666666666666666666666666666666666666666666666666667",
        ),
        square=palindrome(
            "0",
            centre="0.01388888888888888888888888888888888888888888888888888888888888888888888888888889",
        ),
        drift=palindrome("0.5"),
        source="Chin (1997), Phys. Lett. A 226, 344, doi:10.1016/S0375-9601(97)00003-0",
        digits=80,
        note="1/6 and 2/3, and 2/3 of 1/48",
    ),
)

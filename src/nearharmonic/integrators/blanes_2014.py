"""Blanes, Casas & Sanz-Serna (2014), Numerical integrators for the Hybrid Monte Carlo method.

SIAM J. Sci. Comput. 36, A1556, doi:10.1137/130932740. Methods of order two whose parameters minimise the expected
energy error for a Gaussian distribution, an oscillator, over a range of step sizes.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

SOURCE = "Blanes, Casas & Sanz-Serna (2014), SIAM J. Sci. Comput. 36, A1556, doi:10.1137/130932740"

TABLEAUS = (
    Tableau(
        name="bcss_s2",
        label="BCSS 2",
        order=2,
        first="kick",
        kick=palindrome(
            "0.21132486540518711774542560974902127217619912436494",
            centre="0.57735026918962576450914878050195745564760175127013",
        ),
        drift=palindrome("0.5"),
        source=SOURCE,
        digits=50,
        note="Eq. (6.4): the first kick is (3 - sqrt 3)/6",
    ),
    Tableau(
        name="bcss_s3",
        label="BCSS 3",
        order=2,
        first="drift",
        drift=palindrome("0.11888010966548", "0.38111989033452"),
        kick=palindrome("0.29619504261126", centre="0.40760991477748"),
        source=SOURCE,
        digits=14,
        note="14 decimals",
    ),
    Tableau(
        name="bcss_s4",
        label="BCSS 4",
        order=2,
        first="drift",
        drift=palindrome("0.071353913450279725904", "0.268548791161230105820", centre="0.320194590776980336552"),
        kick=palindrome("0.1916678", "0.3083322"),
        source=SOURCE,
        digits=21,
    ),
)

"""Predescu et al. (2012), Computationally efficient molecular dynamics integrators with improved sampling accuracy.

Mol. Phys. 110, 967, doi:10.1080/00268976.2012.681311. A method of order two whose energy error on the oscillator is of
order six, to the 18 printed decimals.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

SOURCE = "Predescu et al. (2012), Mol. Phys. 110, 967, doi:10.1080/00268976.2012.681311"

TABLEAUS = (
    Tableau(
        name="predescu_s3",
        label="Predescu s3",
        order=2,
        first="kick",
        kick=palindrome("0.099031132097580873", "0.400968867902419127"),
        drift=palindrome("0.277479066043685596", centre="0.445041867912628808"),
        source=SOURCE,
        digits=18,
    ),
)

"""NAME: two stages and order two, with the coefficient of smallest error. Describe your method here.

The file runs without changes: nearharmonic recommend sho --error 1e-6 --methods NAME.py,ruth
In Python its path is its name: nearharmonic.integrate("sho", "NAME.py", tau=0.2)
In a config it is an entry of integrators:
  integrators: [ruth, babps9o7h, NAME.py]
"""

from nearharmonic import Tableau, palindrome

# One step of size tau applies the coefficients of the two rows in turn. A kick changes p by -tau * kick[i] * dV/dq, a
# drift changes q by tau * drift[i] * dT/dp. This one is: kick[0] drift[0] kick[1] drift[1] kick[2].
TABLEAU = Tableau(
    name="NAME",
    label="NAME",  # the name in figures and tables
    # The order for every H = T(p) + V(q). It is proved from the coefficients: a file that declares more is an error.
    order=2,
    # The role: the operator that begins and ends a step, "kick" or "drift". It has one coefficient more than the other.
    first="kick",
    # Decimal strings, in as many digits as are known: they are exact, and used in extended precision too. The sum of
    # each row is 1. palindrome("a", "b") is ("a", "b", "b", "a"), palindrome("a", centre="c") is ("a", "c", "a"); a
    # plain tuple of strings does as well. Rows that are not symmetric have "0" at one end of the longer one, or you add
    # symmetric=False.
    kick=palindrome("0.1931833275037836", centre="0.6136333449924328"),
    drift=palindrome("0.5"),
    # Decimals that are guaranteed: the sums may differ from 1 by one unit of the last of them for each coefficient.
    digits=16,
    source="Omelyan, Mryglod and Folk (2002), Phys. Rev. E 65, 056706, doi:10.1103/PhysRevE.65.056706",
    # Further options; each line can be used alone:
    # The order holds only for a kinetic energy of degree two in the momenta (a method of Nystrom type):
    # requires="quadratic kinetic energy",
    # The order for the harmonic oscillator, if it is higher:
    # harmonic_order=2,
    # A remark:
    # note="made up",
)
# Several methods in one file: TABLEAUS = (Tableau(...), Tableau(...)), each used as NAME.py:its_name.

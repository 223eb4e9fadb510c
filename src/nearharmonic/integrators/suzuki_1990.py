"""Suzuki (1990), Fractal decomposition of exponential operators, Phys. Lett. A 146, 319.

doi:10.1016/0375-9601(90)90962-N. The closed form of the weights rounded to 80 digits. The name s5odr4 (five stages,
order 4) is from Kahan & Li (1997), Math. Comp. 66, 1089, doi:10.1090/S0025-5718-97-00873-9; their own s5odr4a and
s5odr4b are other methods.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

TABLEAUS = (
    Tableau(
        name="s5odr4",
        label="s5odr4",
        order=4,
        first="drift",
        drift=palindrome(
            "0.20724538589718786857117703143038074785588730200835356666164244393009554479603996",
            "0.41449077179437573714235406286076149571177460401670713332328488786019108959207993",
            "-0.12173615769156360571353109429114224356766190602506069998492733179028663438811989",
        ),
        kick=palindrome(
            "0.41449077179437573714235406286076149571177460401670713332328488786019108959207993",
            "0.41449077179437573714235406286076149571177460401670713332328488786019108959207993",
            centre="-0.65796308717750294856941625144304598284709841606682853329313955144076435836831971",
        ),
        source="Suzuki (1990), Phys. Lett. A 146, 319, doi:10.1016/0375-9601(90)90962-N",
        digits=79,
        note="five leapfrog steps of weights u, u, 1 - 4u, u, u with u = 1/(4 - 4^(1/3)), named by Kahan & Li",
        benchmarked=True,
    ),
)

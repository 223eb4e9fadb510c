"""Forest & Ruth (1990), Fourth-order symplectic integration, Physica D 43, 105, doi:10.1016/0167-2789(90)90019-L.

The closed form of the weights (their Eq. 4.8; Nielsen 2015, Eq. 15) rounded to 80 digits.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

TABLEAUS = (
    Tableau(
        name="ruth",
        label="Ruth",
        order=4,
        first="drift",
        drift=palindrome(
            "0.67560359597982881702384390448573041346099968810857241416435299884465132155434485",
            "-0.17560359597982881702384390448573041346099968810857241416435299884465132155434485",
        ),
        kick=palindrome(
            "1.3512071919596576340476878089714608269219993762171448283287059976893026431086897",
            centre="-1.7024143839193152680953756179429216538439987524342896566574119953786052862173794",
        ),
        source="Forest & Ruth (1990), Physica D 43, 105, doi:10.1016/0167-2789(90)90019-L",
        digits=79,
        note="three leapfrog steps of weights w, 1 - 2w, w with w = 1/(2 - 2^(1/3))",
        aliases=("forest_ruth", "yoshida4"),
        benchmarked=True,
    ),
)

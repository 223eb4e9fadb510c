"""Nystrom methods from the comparison of quadratures and splittings for the solar system by A. Escorihuela-Tomas.

https://github.com/alejandro-escorihuela/solar_quad, file ``py/metsNIA.py``. RNIA12 is designed for a near-integrable
splitting, in which the kick is the small part.
"""

from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome

SOURCE = "Escorihuela-Tomas (2024), https://github.com/alejandro-escorihuela/solar_quad, py/metsNIA.py"

TABLEAUS = (
    Tableau(
        name="na7",
        label="NA7",
        order=6,
        first="drift",
        drift=palindrome(
            "0.11461549414882665575993176945936193388989107199537",
            "0.53426293146624710621643703513056974782022648434073",
            "0.17711460120577877175402023974983910216964739495838",
            "-0.32599302682085253373038904433977078387976495129447",
        ),
        kick=palindrome(
            "0.37776943459113132631985756821059318701837158247",
            "0.29421383710934448598146253333523798763268289347419",
            "-0.19724296189768175230925663095622519644388484550804",
            centre="0.050519380394411880015873058820788043585660739127725",
        ),
        source=SOURCE,
        digits=47,
        requires=QUADRATIC_KINETIC_ENERGY,
    ),
    Tableau(
        name="rnia12",
        label="RNIA12 (10,8,6)",
        order=6,
        first="drift",
        drift=palindrome(
            "0.037424188242624325968368262247184297021237374012019",
            "0.26561064604365719378697580612416164525446242780896",
            "-0.11898009697238293107756923215408457878013090047804",
            "0.2593429559795568375007620483757755314665595494919",
            "-0.050487109506873995190790509011672541937495296128551",
            "-0.1757970916894682379393580359200237698476160386687",
            centre="0.56577301580577361390322332067731883364596576792482",
        ),
        kick=palindrome(
            "0.094620465621870873233062722996722200767844396348324",
            "-0.083113003302747655954235747407470735195774138352586",
            "0.1708689632241170212948043845736803288402338443833",
            "-0.098522326906392763838537508515299488479056180636178",
            "0.37047037569665758912919684348299686266946557692867",
            "0.045675525666494936135709304869370831397286501328473",
        ),
        source=SOURCE,
        digits=49,
        requires=QUADRATIC_KINETIC_ENERGY,
        generalised_order=(10, 8, 6),
    ),
)

"""Morales, Costa, Pantaleoni, Burgarth, Sanders & Berry (2022), Greatly improved higher-order product formulae.

arXiv:2210.15817: a palindromic composition of seventeen leapfrog steps, here with the drift first, to 32 decimals.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

SOURCE = "Morales, Costa, Pantaleoni, Burgarth, Sanders & Berry (2022), arXiv:2210.15817"

TABLEAUS = (
    Tableau(
        name="morales_s17o8",
        label="s17o8 (Morales)",
        order=8,
        first="drift",
        drift=palindrome(
            "0.063916804931420554189287774752215",
            "0.344661031263202788657241422616255",
            "0.088741359824325227100640703968545",
            "-0.112089055464407391280362113259215",
            "-0.12033174109785091051286750923909",
            "-0.106897311393197088850658824875815",
            "0.223450211922224189135742853548875",
            "0.275788895014454066869225843389565",
            "-0.157240195000171435308250150901335",
        ),
        kick=palindrome(
            "0.12783360986284110837857554950443",
            "0.56148845266356446893590729572808",
            "-0.38400573301491401473462588779099",
            "0.15982762208609923217390166127256",
            "-0.40049110428180105319963667975074",
            "0.18669648149540687549831902999911",
            "0.26020394234904150277316667709864",
            "0.29137384767986663096528500968049",
            centre="-0.60585423768020950158178531148316",
        ),
        source=SOURCE,
        digits=32,
        note="seventeen leapfrog steps",
    ),
)

"""The method of uncertain origin in Zymplectic's list of splitting methods.

https://zymplectic.com, file ``integrators.txt``, which gives 77 digits and names doi:10.1039/c1cp22790d as its
reference. With kick and drift exchanged, and for a kinetic energy that is not quadratic, the order is four.
"""

from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome

SOURCE = "Zymplectic, integrators.txt, https://zymplectic.com, after doi:10.1039/c1cp22790d"

TABLEAUS = (
    Tableau(
        name="nystrom_6a8",
        label="6A8",
        order=6,
        first="kick",
        kick=palindrome(
            "0.0694294434625298773584886582470340212873326477788307180710943878613279791495",
            "-0.1331551983159820940996130995137351167213056349613229685677729907047977454573",
            "0.0012903891798107897423048174644328438348870284123368369027521504831395449410",
            "0.4224353656736414269988196238022682515990859587701554135939264523603302213668",
            centre="0.28",
        ),
        drift=palindrome(
            "0.2848783771728008405274534645665782822332292504014550404164962685109953644174",
            "0.3278397575961294541205467836732554684643158890928798965123834834134451082886",
            "-0.3812210427193262947562278437421127382433515210869757758908996846386730282460",
            "0.2685029079503960001082275955022789875458063815926408389620199327142325555400",
        ),
        source=SOURCE,
        digits=76,
        requires=QUADRATIC_KINETIC_ENERGY,
        note="its origin is not settled",
    ),
)

"""Ruth (1983), A canonical integration technique, IEEE Trans. Nucl. Sci. 30, 2669, doi:10.1109/TNS.1983.4332919.

The first method of order three, whose coefficients are fractions, rounded here to 80 digits: kicks 7/24, 3/4, -1/24 and
drifts 2/3, -2/3, 1. It is asymmetric with as many kicks as drifts, so that the last kick of a step is 0.
"""

from nearharmonic.integrators.tableau import Tableau

TABLEAUS = (
    Tableau(
        name="ruth_s3o3",
        label="Ruth s3 o3",
        order=3,
        first="kick",
        kick=(
            "0.29166666666666666666666666666666666666666666666666666666666666666666666666666667",
            "0.75",
            "-0.04166666666666666666666666666666666666666666666666666666666666666666666666666667",
            "0",
        ),
        drift=(
            "0.66666666666666666666666666666666666666666666666666666666666666666666666666666667",
            "-0.66666666666666666666666666666666666666666666666666666666666666666666666666666667",
            "1",
        ),
        source="Ruth (1983), IEEE Trans. Nucl. Sci. 30, 2669, doi:10.1109/TNS.1983.4332919",
        digits=80,
    ),
)

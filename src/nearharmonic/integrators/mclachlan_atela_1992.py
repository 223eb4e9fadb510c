"""McLachlan & Atela (1992), The accuracy of symplectic integrators.

Nonlinearity 5, 541, doi:10.1088/0951-7715/5/2/011. Asymmetric methods with as many kicks as drifts, so that the last
kick of a step is 0. The methods of two and three stages follow from the order conditions, to 80 digits. The methods of
four and six stages have order four and five for a quadratic kinetic energy, and order three otherwise. Their digits are
from OrdinaryDiffEq.jl (McAte4, McAte5), where a are the drifts and b the kicks.
"""

from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau

SOURCE = "McLachlan & Atela (1992), Nonlinearity 5, 541, doi:10.1088/0951-7715/5/2/011"

TABLEAUS = (
    Tableau(
        name="mclachlan_atela_2",
        label="McLachlan-Atela 2",
        order=2,
        first="kick",
        kick=(
            "0.29289321881345247559915563789515096071516406231152596341166013100463376076894648",
            "0.70710678118654752440084436210484903928483593768847403658833986899536623923105352",
            "0",
        ),
        drift=(
            "0.70710678118654752440084436210484903928483593768847403658833986899536623923105352",
            "0.29289321881345247559915563789515096071516406231152596341166013100463376076894648",
        ),
        source=SOURCE,
        digits=79,
        note="kicks 1 - 2^(-1/2), 2^(-1/2), and the drifts in reverse",
    ),
    Tableau(
        name="mclachlan_atela_3",
        label="McLachlan-Atela 3",
        order=3,
        first="kick",
        kick=(
            "0.26833009578175992495695522992549913948119267347511900022123224320217642627500455",
            "-0.18799161879915978200785286807888192904447219188292044185610562866407749230153765",
            "0.91966152301739985705089763815338278956327951840780144163487338546190106602653309",
            "0",
        ),
        drift=(
            "0.91966152301739985705089763815338278956327951840780144163487338546190106602653309",
            "-0.18799161879915978200785286807888192904447219188292044185610562866407749230153765",
            "0.26833009578175992495695522992549913948119267347511900022123224320217642627500455",
        ),
        source=SOURCE,
        digits=79,
        note="the drifts are the kicks in reverse",
    ),
    Tableau(
        name="mclachlan_atela_4",
        label="McLachlan-Atela 4",
        order=4,
        first="kick",
        kick=(
            "0.134496199277431089",
            "-0.224819803079420806",
            "0.756320000515668291",
            "0.334003603286321425",
            "0",
        ),
        drift=(
            "0.515352837431122936",
            "-0.085782019412973646",
            "0.441583023616466524",
            "0.128846158365384185",
        ),
        source=SOURCE,
        digits=17,
        requires=QUADRATIC_KINETIC_ENERGY,
    ),
    Tableau(
        name="mclachlan_atela_5",
        label="McLachlan-Atela 5",
        order=5,
        first="kick",
        kick=(
            "0.1193900292875672758",
            "0.6989273703824752308",
            "-0.1713123582716007754",
            "0.4012695022513534480",
            "0.0107050818482359840",
            "-0.0589796254980311632",
            "0",
        ),
        drift=(
            "0.339839625839110000",
            "-0.088601336903027329",
            "0.5858564768259621188",
            "-0.603039356536491888",
            "0.3235807965546976394",
            "0.4423637942197494587",
        ),
        source=SOURCE,
        digits=17,
        requires=QUADRATIC_KINETIC_ENERGY,
    ),
)

"""Methods of order six for quadratic T with five stages and modified potentials, found by our own search.

:mod:`nearharmonic.training.family` has the equations, six for seven unknowns;
:mod:`nearharmonic.training.objective` finds the digits. The ABA method has the smallest
norm of the error terms of degree seven in its family, to five digits;
its second kick is the parameter of the family. The BAB method is the one with two innermost kicks of V alone that has
the smallest coefficients.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

TABLEAUS = (
    Tableau(
        name="abag5o6",
        label="ABAg5o6",
        order=6,
        first="drift",
        kick=palindrome(
            "0.26962168349324287841777297759605561969137441915304283877640430086806797049918397",
            "0.061",
            centre="0.33875663301351424316445404480788876061725116169391432244719139826386405900163207",
        ),
        square=palindrome(
            "0.00100751696003393703311640399824403141604648908112220414780199943930655352263986",
            "-0.00132791511203299995651572625348602036625601470650752561851322964481695743120623",
            centre="0.00964949605066487794116072501252892364933661923807593320237855743914817609070500",
        ),
        drift=palindrome(
            "0.10990961389702739317461699527330844781534579306460657633070122897533570672613102",
            "0.49237556788129931501812333087050158197799013895432939690892681935900009223240444",
            "-0.10228518177832670819274032614381002979333593201893597323962804833433579895853546",
        ),
        source="found by a search of this project, see docs/reference/methods.md",
        digits=80,
        note="kick[1] is a parameter of the family",
    ),
    Tableau(
        name="babg5o6",
        label="BABg5o6",
        order=6,
        first="kick",
        kick=palindrome(
            "0.04800136993352095529120823533134638358632836503252622685886708008803306834050474",
            "0.26339570699353499695020330441696480584131610437695680405719523892349988493320859",
            "0.18860292307294404775858846025168881057235553059051696908393768098846704672628668",
        ),
        square=palindrome(
            "-0.00170969317144984395361303294066838703149313312389194981308500669472264136461750",
            "0.00466808373051980545224405997955619930718189001945914867583726286674768915851180",
            "0",
        ),
        drift=palindrome(
            "0.16673812334764911621954699066521658458550911489844926723101883963446310825468340",
            "0.38003893443025958590835674810350776628938835991841140005731343676870506938505709",
            centre="-0.09355411555581740425580747753744870174979494963372133457666455280633635527948098",
        ),
        source="found by a search of this project, see docs/reference/methods.md",
        digits=80,
        note="three of five forces take a gradient",
    ),
)

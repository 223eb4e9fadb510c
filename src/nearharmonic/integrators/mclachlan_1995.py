"""McLachlan (1995), On the numerical integration of ordinary differential equations by symmetric composition methods.

SIAM J. Sci. Comput. 16, 151, doi:10.1137/0916010. The symmetric fourth-order methods: S for any H = A + B, SB3A for [B,
[B, [B, A]]] = 0, for example a quadratic kinetic energy, and SS, a composition of leapfrog steps. All coefficients
follow from the rational coefficients of the paper, in closed form or as roots of the order conditions, and agree with
its 20 digits.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

SOURCE = "McLachlan (1995), SIAM J. Sci. Comput. 16, 151, doi:10.1137/0916010"

TABLEAUS = (
    Tableau(
        name="mclachlan_s4",
        label="S4 (McLachlan)",
        order=4,
        first="kick",
        kick=palindrome(
            "0.1691392799220720451750024659651743352138691336680187092368843019084134521896314",
            "-0.299186203904050799508631715119427894211498507163597150996333864251361048278731",
            centre="1.2600938479639575086672584983085071179952587469911568835188991246858951921781992",
        ),
        drift=palindrome(
            "0.5454545454545454545454545454545454545454545454545454545454545454545454545454545",
            "-0.0454545454545454545454545454545454545454545454545454545454545454545454545454545",
        ),
        source=SOURCE,
        digits=78,
        note="drifts 6/11, -1/22; kick 0 is (642 + 471^(1/2))/3924, kick 1 is 121 (12 - 471^(1/2))/3924; either role",
    ),
    Tableau(
        name="mclachlan_s5",
        label="S5 (McLachlan)",
        order=4,
        first="kick",
        kick=palindrome(
            "0.08926945422647524488669461126055911426724996365525513947323755427630039510923",
            "-0.0973360426368955080153599433983084223514724766354362459095593422881194564576121",
            "0.5080665884104202631286653321377493080842225129801811064363217880118190613483821",
        ),
        drift=palindrome(
            "0.4",
            "-0.1",
            centre="0.4",
        ),
        source=SOURCE,
        digits=78,
        note="drifts 2/5, -1/10; kick 0 is (14 - 19^(1/2))/108, kick 1 is (20 - 7 19^(1/2))/108; either role",
    ),
    Tableau(
        name="mclachlan_sb3a4",
        label="SB3A4 (McLachlan)",
        order=4,
        first="drift",
        drift=palindrome(
            "0.1881952177688382178680209389736208915203316826851060878080212110566637369744217",
            "-0.0215285511021715512013542723069542248536650160184394211413545443899970703077551",
            centre="0.6666666666666666666666666666666666666666666666666666666666666666666666666666668",
        ),
        kick=palindrome(
            "1.0",
            "-0.5",
        ),
        source=SOURCE,
        digits=78,
        note="errors minimised for quadratic T; kicks 1, -1/2",
    ),
    Tableau(
        name="mclachlan_sb3a5",
        label="SB3A5 (McLachlan)",
        order=4,
        first="drift",
        drift=palindrome(
            "0.4051886183952522772205531983898517327134198264213796114561331576934184679008677",
            "-0.2871440408165240889966277933622274550685613710484559222666394562201473567783027",
            "0.381955422421271811776074594972375722355141544627076310810506298526728888877435",
        ),
        kick=palindrome(
            "-0.0410958904109589041095890410958904109589041095890410958904109589041095890410959",
            "0.2881355932203389830508474576271186440677966101694915254237288135593220338983051",
            centre="0.5059205943812398421174831669375435337822149988390991409333642906895751102855816",
        ),
        source=SOURCE,
        digits=78,
        note="errors minimised for quadratic T; kicks -3/73, 17/59",
    ),
    Tableau(
        name="mclachlan_ss5",
        label="SS5 (McLachlan)",
        order=4,
        first="drift",
        drift=palindrome(
            "0.14",
            "0.4527332142338350225061694527463245064591079155711731681390005855678914977911441",
            "-0.0927332142338350225061694527463245064591079155711731681390005855678914977911441",
        ),
        kick=palindrome(
            "0.28",
            "0.6254664284676700450123389054926490129182158311423463362780011711357829955822883",
            centre="-0.8109328569353400900246778109852980258364316622846926725560023422715659911645766",
        ),
        source=SOURCE,
        digits=78,
        note="five leapfrog steps of weights w1, w2, w3, w2, w1 with w1 = 0.28",
    ),
)

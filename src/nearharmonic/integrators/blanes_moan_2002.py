"""Blanes & Moan (2002), Practical symplectic partitioned Runge-Kutta and Runge-Kutta-Nystrom methods.

J. Comput. Appl. Math. 142, 313, doi:10.1016/S0377-0427(01)00492-7. The paper prints 15 to 17 decimals of methods with
3, 3, 4 and 7 free parameters, which it chose for small errors. Here as many printed values as there are free parameters
are kept, and the order conditions give the others to 79 decimals. S6 and SRKN 6b then round to the printed values. No
set that rounds to all printed decimals of SRKN 11b or 14a fulfils the conditions: four and seven values are kept, and
the others differ from the printed values by at most 3 (11b) and 6 (14a) units of the last decimal, 6e-15.

The Nystrom methods need [V, [V, [V, T]]] = 0, in one role only: with kick and drift exchanged, 11b and 14a have order
four. SRKN 6b has order four for any separable H in both roles, and small errors in its own role with quadratic T.
"""

from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome

SOURCE = "Blanes & Moan (2002), J. Comput. Appl. Math. 142, 313, doi:10.1016/S0377-0427(01)00492-7"

TABLEAUS = (
    Tableau(
        name="blanes_moan_s6o4",
        label="S6 (Blanes-Moan)",
        order=4,
        first="kick",
        kick=palindrome(
            "0.0792036964311957",
            "0.353172906049774",
            "-0.0420650803577195",
            centre="0.2193769557534996",
        ),
        drift=palindrome(
            "0.2095151066133620888834053396065920071208147496393540314614743103495133216522077",
            "-0.1438517731798181145653890563342006868338551589600270298573763314454649609104541",
            "0.4343366665664560256819837167276086797130404093206729983959020210959516392582464",
        ),
        source=SOURCE,
        digits=78,
        note="either role, but for quadratic T errors are smaller with the kick first; kick 0, 1, 2 as printed",
    ),
    Tableau(
        name="srkn_b6",
        label="SRKN 6b",
        order=4,
        first="kick",
        kick=palindrome(
            "0.0829844064174052",
            "0.3963098014983684289021177511130699602929822759688423081741070120638656948874154",
            "-0.0390563049223486",
            centre="0.1195241940131499421957644977738600794140354480623153836517859758722686102251692",
        ),
        drift=palindrome(
            "0.2452989571842713685804973786368333662011714399813501903026918659092682341322758",
            "0.60487266571108",
            "-0.3501716228953513685804973786368333662011714399813501903026918659092682341322758",
        ),
        source=SOURCE,
        digits=78,
        note="errors minimised for quadratic T; kick 0, 2 and drift 1 as printed",
    ),
    Tableau(
        name="srkn_b11",
        label="SRKN 11b",
        order=6,
        first="kick",
        kick=palindrome(
            "0.0414649985182624",
            "0.1981286719180648703466575753423991272935665525336129725064607007805583130546256",
            "-0.0400061921041533",
            "0.0752539843015807781262996615602369879361095033239012035907020489215551939828229",
            "-0.011511387420687639473268878417543927950651489558457976102457010986476150489983",
            "0.2366699247869328910003116415149078127209754337009438000052942612843626434525345",
        ),
        drift=palindrome(
            "0.1232297759462699160696097906517802204221073150402070587801590286168516968180767",
            "0.290553797799558",
            "-0.1270492126254162910072580903328671414263718945161771707013928826968435771066932",
            "-0.246331761062075",
            "0.3572088727959264725851184701416150052426233534223320000428897644578466904560735",
            centre="0.204777054291473804705059659078943831523282452107276223756688179244290379665086",
        ),
        source=SOURCE,
        digits=78,
        requires=QUADRATIC_KINETIC_ENERGY,
        note="kick 0, 2 and drift 1, 3 as printed; the others up to 3e-15 off the print",
    ),
    Tableau(
        name="srkn_a14",
        label="SRKN 14a",
        order=6,
        first="drift",
        drift=palindrome(
            "0.0378593198406116",
            "0.1026356331024346940197016641740158386481730460422753029865434455093880332991408",
            "-0.0258678882665587",
            "0.3142414030714457393228708458374997438834670823469055092964196490147352459948893",
            "-0.1301444595174093324800608057069871954697973999040600895029048103436198365941044",
            "0.1064177003695370503596678034227759697871415925859842713237747231177379201274488",
            "-0.0087942431285105439025974203459729877424672621795474157931022953122515004387792",
            centre="0.2073050690568989853608358252373372617869658822168848433785385760280202752228094",
        ),
        kick=palindrome(
            "0.09171915262446165",
            "0.183983170005006",
            "-0.05653436583288827",
            "0.004914688774712854",
            "0.143761127168361628968101479026767237766077045114854027407380728628379096952236",
            "0.328567693746804",
            "-0.196411466486457862968101479026767237766077045114854027407380728628379096952236",
        ),
        source=SOURCE,
        digits=78,
        requires=QUADRATIC_KINETIC_ENERGY,
        note="drift 0, 2 and kick 0, 1, 2, 3, 5 as printed; the others up to 6e-15 off the print",
    ),
)

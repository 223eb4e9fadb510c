"""Omelyan, Mryglod & Folk (2002, 2003): methods of order four without a force gradient, and one of order six with it.

Optimized Forest-Ruth- and Suzuki-like algorithms for integration of motion in many-body systems, Comput. Phys. Commun.
146, 188, doi:10.1016/S0010-4655(02)00451-4, and Symplectic analytically integrable decomposition algorithms, Comput.
Phys. Commun. 151, 272, doi:10.1016/S0010-4655(02)00754-3 (the methods of five stages). One or two free parameters
minimise the norm of the commutators of degree 5: of all six commutators (EFRL), or of the four that remain for
quadratic kinetic energy. The parameters are taken as printed, with 16 to 17 decimals; the order conditions give the
others, which round to the printed values.

Construction of high-order force-gradient algorithms, Phys. Rev. E 66, 026701, doi:10.1103/PhysRevE.66.026701,
arXiv:cond-mat/0111055, has the method with modified potentials: order six with five stages, drift first. The digits
after the 16 of the source follow from the order conditions; the parameter of the family is fixed because the second
kick is of V alone.
"""

from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome

SOURCE_2002 = "Omelyan, Mryglod & Folk (2002), Comput. Phys. Commun. 146, 188, doi:10.1016/S0010-4655(02)00451-4"
SOURCE_GRADIENT = "Omelyan, Mryglod & Folk (2002), Phys. Rev. E 66, 026701, doi:10.1103/PhysRevE.66.026701"
SOURCE_2003 = "Omelyan, Mryglod & Folk (2003), Comput. Phys. Commun. 151, 272, doi:10.1016/S0010-4655(02)00754-3"

TABLEAUS = (
    Tableau(
        name="pefrl",
        label="PEFRL",
        order=4,
        first="drift",
        drift=palindrome(
            "0.178617895844809067849254925276929053514227592950848065248662959406276220123847",
            "-0.06626458266981849",
            centre="0.775293373650018844301490149446141892971544814098303869502674081187447559752306",
        ),
        kick=palindrome(
            "0.7123418310626054209030421455888885670370254770498689459304093518125555874726535",
            "-0.2123418310626054209030421455888885670370254770498689459304093518125555874726535",
        ),
        source=SOURCE_2002,
        digits=78,
        note="position extended; errors minimised for quadratic T; drift 1 as printed",
    ),
    Tableau(
        name="vefrl",
        label="VEFRL",
        order=4,
        first="kick",
        kick=palindrome(
            "0.1644986515575759704336322526805035812395497252045251228889804321206762582967462",
            "1.2356926511389168507621777277253198323941352670350716480452856468159461932702553",
            centre="-1.800382605392985642391619960811646827267369984479193541868532157873244903134003",
        ),
        drift=palindrome(
            "0.52094333910398989",
            "-0.02094333910398989",
        ),
        source=SOURCE_2002,
        digits=78,
        note="velocity extended; errors minimised for quadratic T; drift 1 as printed",
    ),
    Tableau(
        name="efrl",
        label="EFRL",
        order=4,
        first="drift",
        drift=palindrome(
            "0.1720865590295143403237332881141679746105335202374613483833703530138213049683959",
            "-0.1616217622107222382851658840880144977445853736102305316982501378789883176817746",
            centre="0.9790704063624157959228651919476930462681037067455383666297595697303340254267574",
        ),
        kick=palindrome(
            "0.59156203075515678",
            "-0.09156203075515678",
        ),
        source=SOURCE_2002,
        digits=78,
        note="errors minimised for any separable H, in either role; kick 1 as printed",
    ),
    Tableau(
        name="omelyan_p5",
        label="OMF 5P",
        order=4,
        first="drift",
        drift=palindrome(
            "0.2750081212332419311638795260549829450152038267625233440480027613574052889780368",
            "-0.1347950099106792",
            "0.3597868886774372688361204739450170549847961732374766559519972386425947110219632",
        ),
        kick=palindrome(
            "-0.08442961950707149",
            "0.3549000571574260345053943765427826035912755821579162567112942401178571574146291",
            centre="0.4590591246992909109892112469144347928174488356841674865774115197642856851707418",
        ),
        source=SOURCE_2003,
        digits=78,
        note="position form; errors minimised for quadratic T; drift 1 and kick 0 as printed",
    ),
    Tableau(
        name="omelyan_v5",
        label="OMF 5V",
        order=4,
        first="kick",
        kick=palindrome(
            "0.08398315262876693",
            "0.6822365335719091348007262350196673256362203024574375802433962562139800468815984",
            "-0.2662196862006760648007262350196673256362203024574375802433962562139800468815984",
        ),
        drift=palindrome(
            "0.2539785108410594661988100265139040075068538571236859949167616528445459465559001",
            "-0.03230286765269967",
            centre="0.5566487136232804076023799469721919849862922857526280101664766943109081068881998",
        ),
        source=SOURCE_2003,
        digits=78,
        note="velocity form; errors minimised for quadratic T; kick 0 and drift 1 as printed",
    ),
    Tableau(
        name="omelyan_s7o6",
        label="s7o6 (Omelyan)",
        order=6,
        first="kick",
        kick=palindrome(
            "0.0833333333333333333333333333333333333333333333333333333333333333333333333333",
            "0.3977675859548440074217908138860875275681475964766784567046549559379573747118",
            "-0.0393336931446257363828544842331766147740374598197977075187673155627909889434",
            "0.0582327738564483956277303370137557538725565300097859174807790262915002808983",
        ),
        drift=palindrome(
            "0.2465881872786138277570711850754743059162938595239688394060624877215472458030",
            "0.6047073875057809013986983841499748659238985537193444373721906560735404685632",
            "-0.4009869039788007481085648931513153144575044954263700297044324813292338900679",
            centre="0.0993826583888120379055906478517322852346241643661135058523586750682923514033",
        ),
        source=SOURCE_2003,
        digits=76,
        requires=QUADRATIC_KINETIC_ENERGY,
    ),
    Tableau(
        name="omelyan_g5o6",
        label="OMF 5G",
        order=6,
        first="drift",
        kick=palindrome(
            "0.26933158489353005613350339779650874201304993095345156444993278941434790996086650",
            "1.13198034865155639250390730462479653448111283522997262110816227418361834209941897",
            centre="-1.80262386709017289727482140484261055298832553236684837111619012719593250412057095",
        ),
        square=palindrome(
            "0.00086421613397061662604433847937159387534744800467865448059432246177219364880297",
            "0",
            centre="-0.01324638643416052385902941845693811303039213674853831119997554797719721617463023",
        ),
        drift=palindrome(
            "0.10970597239486819130899039214759417287742195595535551784348236681474233622088832",
            "0.41406322673108311243402117878208332942973084358108320034027234287194471802691349",
            "-0.02376919912595130374301157092967750230715279953643871818375470968668705424780180",
        ),
        source=SOURCE_GRADIENT,
        digits=80,
        note="three of five forces take a gradient",
    ),
)

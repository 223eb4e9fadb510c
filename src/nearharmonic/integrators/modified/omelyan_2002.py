"""Omelyan, Mryglod & Folk (2002), Construction of high-order force-gradient algorithms, Phys. Rev. E 66, 026701.

doi:10.1103/PhysRevE.66.026701, arXiv:cond-mat/0111055. Order six with five stages, position first. The digits beyond
the 16 of the source follow from the order conditions; that the second kick is of V alone fixes the parameter of the
family.
"""

from nearharmonic.integrators.modified_tableau import ModifiedTableau
from nearharmonic.integrators.tableau import palindrome

TABLEAUS = (
    ModifiedTableau(
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
        source="Omelyan, Mryglod & Folk (2002), Phys. Rev. E 66, 026701, doi:10.1103/PhysRevE.66.026701",
        digits=80,
        note="three of five forces take a gradient",
    ),
)

"""Rowlands (1991), A numerical algorithm for Hamiltonian systems, J. Comput. Phys. 97, 235: processed, order four.

The kernel is a leapfrog with the force F + tau^2 grad |F|^2 / 24 of Takahashi & Imada (1984), J. Phys. Soc. Jpn. 53,
3765, doi:10.1143/JPSJ.53.3765. Its error of degree three is the commutator of [A, B] / 24 with A + B, so that it has
order four in other variables. The processor is our own. With drifts -a, 2 a, -a and kicks -b, b its logarithm is 2 a b
[A, B]; a square of a b^2 cancels [B, [A, B]]. Here a = 1/12 and b = 1/4.
"""

from nearharmonic.integrators.tableau import Processor, Tableau

TABLEAUS = (
    Tableau(
        name="rowlands",
        label="Rowlands",
        order=4,
        first="drift",
        kick=("1",),
        square=("0.04166666666666666666666666666666666666666666666666666666666666666666666666666667",),
        drift=("0.5", "0.5"),
        processor=Processor(
            first="drift",
            kick=("-0.25", "0.25"),
            square=(
                "0.00520833333333333333333333333333333333333333333333333333333333333333333333333333",
                "0",
            ),
            drift=(
                "-0.08333333333333333333333333333333333333333333333333333333333333333333333333333333",
                "0.16666666666666666666666666666666666666666666666666666666666666666666666666666667",
                "-0.08333333333333333333333333333333333333333333333333333333333333333333333333333333",
            ),
            digits=80,
        ),
        source="Rowlands (1991), J. Comput. Phys. 97, 235; processor: our own",
        digits=80,
        note="processed; one force with its gradient a step",
    ),
)

"""A method for cubic potentials: of order six for quadratic T and every V of degree three, and of order four for any H.

Three conditions of degree five are left of the four of Nystrom methods: brackets with a fourth derivative of V
vanish (:mod:`nearharmonic.exact.lie.conditions`). Such potentials: Escorihuela-Tomas (2026), arXiv:2605.06975. The
search is that of the target ``trained`` with the key ``trained: {purposes: [cubic]}``.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.integrators.trained import SOURCE

TABLEAUS = (
    Tableau(
        name="trained_cubic",
        label="trained cubic",
        order=4,
        first="kick",
        kick=palindrome(
            "0.03587869340812112869186964053538978030564945884513030801785994",
            "0.18295189890624169646505469432453830775871102624344946697610437",
            "-0.04924748505672186288318287469980922413403881432526516229912924",
            "0.07966369651598758825224487446829359867137841163889628610041937",
            "-0.00919751133381304597666847292348734449444072562149898872492894",
            "0.25995070756018449545068213829507488189274064321928808992967449",
        ),
        drift=palindrome(
            "0.10930760794783751329063544078290231217557020223721724617570426",
            "0.29035574312674561239809755023795815540566623388192121708184591",
            "-0.11800047236895952654014266855686120231137031372282882568615321",
            "-0.26058828114553919598100858126191947845172997219910589426089800",
            "0.36159018841241953581897790807356756538209914674116589924701399",
            centre="0.23467042805499212202688070144870529559952940612326071488497410",
        ),
        source=SOURCE,
        digits=60,
        note=(
            "cubic potentials, high accuracy: tau/s 0.035 to 0.05; "
            "cubic potentials, d = 2 and 3, 0.05 to 0.75 of the barrier; stability limit tau = 3.1417; "
            "seed 1; run 9dba257d92f5434a"
        ),
    ),
)

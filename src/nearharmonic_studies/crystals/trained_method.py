"""The method that was trained on model crystals, to be compared with the registered ones.

The search is that of the target ``trained`` with the key ``trained: {purposes: [crystal_coarse]}``.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

TRAINED_ON_CRYSTALS = Tableau(
    name="trained_on_crystals",
    label="trained on crystals",
    order=4,
    first="kick",
    kick=palindrome(
        "0.07589539295301059723938800264622307417580801794650946314490101",
        "-0.14450477211212790944531833877971568736203515542461259403873900",
        "0.43766354494346381649138752094499544627876270099785514183017586",
        centre="0.26189166843130699142908563037699433381492887296049597812732424",
    ),
    drift=palindrome(
        "0.28146671897081099689832933537962532449426044468625333246129240",
        "-0.04150119854885854351883150908688622869390368309447006634157618",
        "0.26003447957804754662050217370726090419964323840821673388028378",
    ),
    source="found by the target trained for the purpose crystal_coarse",
    digits=60,
)

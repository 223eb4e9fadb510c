"""Section 4.B: the list of the ten methods."""

from __future__ import annotations

from mpmath import mp, mpf

from nearharmonic.claims.claim import Decision, claim, counted, either
from nearharmonic.claims.results import Results, only, short
from nearharmonic.integrators import BENCHMARKED, blanes_2013, forest_ruth_1990, kahan_li_1997, yoshida_1990
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.theory.order import error_norm, order_of

#: The modules of the ten methods but Nielsen's own: what they declare is covered by the digest of the job.
SOURCES = (blanes_2013, forest_ruth_1990, kahan_li_1997, yoshida_1990)

#: Stages and composition as the list prints them.
LISTED = {
    "ruth": (3, "ABA"), "s5odr4": (5, "ABA"), "aba104": (7, "ABA"), "aba864": (7, "ABA"), "aba1064": (8, "ABA"),
    "yoshida_s7o6a": (7, "ABA"), "abas5o6h": (5, "ABA"), "babs7o7h": (7, "BAB"), "babps8o7h": (7, "BAB"),
    "babps9o7h": (9, "BAB"),
}  # fmt: skip
GENERALISED = {"aba104": "(10, 4)", "aba864": "(8, 6, 4)", "aba1064": "(10, 6, 4)"}

#: Yoshida's solutions B and C for seven stages, his Table 1, outer weights w_3, w_2, w_1.
YOSHIDA = {
    "B": ("1.43984816797678", "0.00426068187079180", "-2.13228522200144"),
    "C": ("1.44778256239930", "-2.14403531630539", "0.00152886228424922"),
}


@claim(
    id="listed-stages",
    paper="Section 4.B, list of the ten",
    statement="The numbers of stages of the ten methods",
    threshold="the length of the inner row of coefficients",
)
def listed_stages(results: Results) -> Decision:
    found = {name: results.method(name).stages for name in LISTED}
    bad = [f"{name} has {found[name]}, not {stages}" for name, (stages, _) in LISTED.items() if found[name] != stages]
    good = [found[name] == stages for name, (stages, _) in LISTED.items()]
    return counted(good, f"{sum(good)} of 10" + (f"; {', '.join(bad)}" if bad else ""))


@claim(
    id="listed-stages-babps8o7h",
    paper="Section 4.B, list of the ten",
    statement="BAB's8o7H has seven stages",
    threshold="the length of the inner row of coefficients, which its name states as well",
)
def listed_stages_of_one(results: Results) -> Decision:
    stages = results.method("babps8o7h").stages
    return either(stages == 7, f"{stages} stages")


@claim(
    id="listed-compositions",
    paper="Section 4.B, list of the ten",
    statement="Seven of the ten are composed as ABA, three as BAB",
    threshold="the operator that comes first in the runs",
)
def listed_compositions(results: Results) -> Decision:
    first = {"ABA": "drift", "BAB": "kick"}
    good = [results.method(name).first == first[composition] for name, (_, composition) in LISTED.items()]
    return counted(good, f"{sum(good)} of 10")


@claim(
    id="listed-orders",
    paper="Section 4.B, list of the ten",
    statement="Yosh s7o6 A is of sixth order, the others of fourth",
    threshold="the order for any separable Hamiltonian, proved in the free Lie algebra up to degree 7",
)
def listed_orders(results: Results) -> Decision:
    good = [order_of(results.method(name), highest=7) == (6 if name == "yoshida_s7o6a" else 4) for name in BENCHMARKED]
    return counted(good, f"{sum(good)} of 10")


@claim(
    id="listed-generalised-orders",
    paper="Section 4.B, list of the ten",
    statement="ABA104, ABA864 and ABA1064 are of generalized order 10-4, 8-6-4 and 10-6-4",
    threshold="the generalised order proved in the free Lie algebra",
    needs=("tables/integrators.csv",),
)
def listed_generalised_orders(results: Results) -> Decision:
    rows = results.rows("integrators")
    found = {name: only(rows, "integrator", name)["generalised order"] for name in GENERALISED}
    good = [found[name] == expected for name, expected in GENERALISED.items()]
    return counted(good, ", ".join(f"{name} {order}" for name, order in found.items()))


@claim(
    id="s5odr4-of-kahan-and-li",
    paper="Section 4.B, list of the ten",
    statement="s5odr4 is a method of Kahan and Li (1997)",
    threshold="its weights other than those that Suzuki composed in 1990, 1/(4 - 4^(1/3)) four times, in 15 decimals",
)
def s5odr4_source(results: Results) -> Decision:
    method = results.method("s5odr4")
    with mp.workdps(30):
        weight = 1 / (4 - mp.cbrt(4))
        suzuki = [weight, weight, 1 - 4 * weight, weight, weight]
        off = max(abs(mpf(c) - w) for c, w in zip(method.inner, suzuki, strict=True))
    return either(off > 1e-15, f"its weights are Suzuki's within {mp.nstr(off, 1)}")


@claim(
    id="yoshida-a-smallest",
    paper="Section 4.B, below the list",
    statement="Yosh s7o6 A yields the smallest errors of Yoshida's three with seven stages",
    threshold="the norm of the leading error, degree 7 in the Lyndon basis, below those of B and C",
)
def yoshida_a_smallest(results: Results) -> Decision:
    ours = error_norm(results.method("yoshida_s7o6a"), 7)
    others = {letter: error_norm(composed(letter), 7) for letter in YOSHIDA}
    listed = ", ".join(f"{letter} {short(norm)}" for letter, norm in {"A": ours, **others}.items())
    return either(ours < min(others.values()), listed)


def composed(letter: str) -> Tableau:
    """The composition of seven leapfrog steps with the weights of one of Yoshida's solutions."""
    with mp.workdps(30):
        outer = [mpf(w) for w in YOSHIDA[letter]]
        weights = [*outer, 1 - 2 * sum(outer), *reversed(outer)]
        halves = [(a + b) / 2 for a, b in zip([mpf(0), *weights], [*weights, mpf(0)], strict=True)]
        kicks, drifts = ([mp.nstr(c, 25) for c in row] for row in (weights, halves))
    return Tableau(
        name=f"yoshida_s7o6{letter.lower()}",
        label=f"Yosh s7o6 {letter}",
        order=6,
        first="drift",
        drift=palindrome(*drifts[:4]),
        kick=palindrome(*kicks[:3], centre=kicks[3]),
        source="Yoshida (1990), doi:10.1016/0375-9601(90)90092-3, Table 1",
        digits=14,
    )

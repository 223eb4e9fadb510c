"""Figure 6: substeps in phase space."""

from __future__ import annotations

import numpy as np

from nearharmonic.math import hypot
from nearharmonic.theory.oscillator import stability_limit
from nearharmonic_paper.claims.claim import Decision, counted, either, finding, mathematics, result, tallied
from nearharmonic_paper.claims.judging import GREATLY, STABLE
from nearharmonic_paper.claims.results import Results, short


@result(
    paper="Figure 6, caption",
    sentence="(C) shows an unstable integration where H is not conserved",
    statement="(C), Yosh s7o6 A on the Hénon-Heiles system, shows an unstable integration",
    threshold=f"the relative energy error passes 1 within 1000 iterations; {STABLE.brief}",
)
def fig_6_c_unstable(results: Results) -> Decision:
    panel = results.panels()["C"]
    left = int(panel["left_at"])
    value = f"leaves its energy surface at iteration {left}" if left else "stays for 1000 iterations"
    return either(left > 0, value)


DISPLACED = ("cubes/substeps_displaced.h5",)


@result(
    paper="Figure 6, caption",
    sentence="(A) (B) and (D) show stable integrations which preserve H indefinitely",
    statement="(A), (B) and (D) are stable, (D) in the plane q_x = p_x = 0 of the caption",
    threshold="(A) and (B) for ever, as τ = π/4 is below the proved linear limits of both methods, and in 1000 "
    f"iterations; (D) in 100000 iterations, with compensated and with plain sums; {STABLE.brief}",
    needs=DISPLACED,
)
def fig_6_others_stable(results: Results) -> Decision:
    panels, cube = results.panels(), results.cube("substeps_displaced")
    largest = {letter: float(panels[letter]["max_energy_error"]) for letter in "AB"}
    good = [int(panels[letter]["left_at"]) == 0 for letter in "AB"]
    good += [np.pi / 4 < float(stability_limit(results.method(name))) for name in ("yoshida_s7o6a", "babs7o7h")]
    start, left = cube["displacement"].values, cube["left_at"].values
    good += (left[start == 0] == 0).ravel().tolist()
    told = ", ".join(f"({letter}) {short(error)}" for letter, error in largest.items())
    plane = float(cube["max_energy_error"].values[start == 0].max(initial=0.0))
    iterations = int(cube.attrs["iterations"])
    return counted(good, f"largest energy errors {told}, (D) {short(plane)} in {iterations} iterations in its plane")


@finding(
    paper="Figure 6, caption",
    sentence="(A) (B) and (D) show stable integrations which preserve H indefinitely",
    statement="(D) is unstable from starts beside its plane, which the paper does not show",
    threshold="the relative energy error passes 1 within 100000 iterations from each start with q_x from 10⁻¹² to "
    f"10⁻², with compensated and with plain sums; {STABLE.brief}",
    needs=DISPLACED,
)
def fig_6_beside_the_plane(results: Results) -> Decision:
    cube = results.cube("substeps_displaced")
    start, left = cube["displacement"].values, cube["left_at"].values
    beside = left[start > 0].ravel()
    gone = beside[beside > 0]
    when = f", at iterations {gone.min()} to {gone.max()}: rounding decides when" if gone.size else ""
    return tallied((beside > 0).tolist(), "runs", when)


@result(
    paper="Section 5, Discussion",
    sentence="Yosh s7o6 A (A) (C) performs large forward and backward steps compared to BABs7o7H (B) (D)",
    statement="Yosh s7o6 A performs large forward and backward steps compared to BABs7o7H",
    threshold="its longest substep in phase space, a pair of a drift and a kick, longer than that of BABs7o7H on both "
    "systems, forward and, with a negative coefficient, backward",
    bound=1.0,
)
def fig_6_large_substeps(results: Results, ratio: float) -> Decision:
    panels = results.panels()
    good, told, longest = [], [], {}
    for letter in "ABCD":
        panel = panels[letter]
        length = hypot(*(np.diff(panel[name].values, axis=1) for name in "qp"))
        back = np.minimum(panel["next_drift_sign"].values, panel["next_kick_sign"].values)[:-1] < 0
        longest[letter] = [float(length[:, chosen].max()) for chosen in (~back, back)]
    for i, way in enumerate(("forward", "backward")):
        good += [longest[one][i] > ratio * longest[other][i] for one, other in ("AB", "CD")]
        told.append(f"{way} " + ", ".join(f"({letter}) {short(row[i])}" for letter, row in longest.items()))
    return counted(good, f"longest substep {'; '.join(told)}")


@mathematics(
    paper="Section 2, below Eq. 3",
    sentence="the intermediate steps (q_j, p_j), j = 1, 2, ..., k - 1, referred to as substeps, do not represent the "
    "time evolution of (q₀, p₀)",
    statement="Substeps are not points of the orbit: their energy is far off",
    threshold="in each panel of Figure 6 the largest energy error at substeps at least ten times that after the two "
    "iterations",
    bound=GREATLY.number,
)
def substeps_are_no_evolution(results: Results, factor: float) -> Decision:
    good, told = [], []
    for letter, panel in results.panels().items():
        errors = np.abs(panel["energy_error"].values)
        within, after = float(errors[:, 1:-1].max()), float(errors[:, -1].max())
        good.append(within >= factor * after)
        told.append(f"({letter}) {short(within, 2)} against {short(after, 2)}")
    return counted(good, f"largest energy error at substeps against steps: {', '.join(told)}")

"""Figure 6: substeps in phase space."""

from __future__ import annotations

import numpy as np

from nearharmonic.math import hypot
from nearharmonic.reproduction.claims.claim import Decision, claim, counted, either
from nearharmonic.reproduction.claims.definitions import GREATLY, STABLE
from nearharmonic.reproduction.claims.results import Results, short
from nearharmonic.theory.linear_stability import stability_limit


@claim(
    id="fig-6-c-unstable",
    paper="Figure 6, caption",
    sentence="(C) shows an unstable integration where H is not conserved",
    kind="result",
    statement="(C), Yosh s7o6 A on the Hénon-Heiles system, shows an unstable integration",
    threshold="an energy error above 1 within 1000 iterations, by which every run of the system counts as diverged",
)
def fig_6_c(results: Results) -> Decision:
    panel = results.panels()["C"]
    left = int(panel["left_at"])
    value = f"leaves its energy surface at iteration {left}" if left else "stays for 1000 iterations"
    return either(left > 0, value)


DISPLACED = ("cubes/substeps_displaced.h5",)


@claim(
    id="fig-6-others-stable",
    paper="Figure 6, caption",
    sentence="(A) (B) and (D) show stable integrations which preserve H indefinitely",
    kind="result",
    statement="(A), (B) and (D) stay on their energy surfaces for good, (D) from starts beside its plane q_x = 0 as "
    "well",
    threshold="(A) and (B) not within 1000 iterations and, as τ = π/4 is below the proved linear limits of both "
    "methods, never; (D) not within the iterations of the runs, from q_x = 0 and from each displaced start, by "
    f"compensated and by plain sums; {STABLE.words}",
    needs=DISPLACED,
)
def fig_6_others(results: Results) -> Decision:
    panels, cube = results.panels(), results.cube("substeps_displaced")
    largest = {letter: float(panels[letter]["max_energy_error"]) for letter in "AB"}
    good = [int(panels[letter]["left_at"]) == 0 for letter in "AB"]
    good += [np.pi / 4 < float(stability_limit(results.method(name))) for name in ("yoshida_s7o6a", "babs7o7h")]
    start, left = cube["displacement"].values, cube["left_at"].values
    good += (left == 0).ravel().tolist()
    told = ", ".join(f"({letter}) {short(error)}" for letter, error in largest.items())
    plane = float(cube["max_energy_error"].values[start == 0].max(initial=0.0))
    iterations = int(cube.attrs["iterations"])
    beside, gone = left[start > 0], left[left > 0]
    value = f"largest energy errors {told}, (D) {short(plane)} in {iterations} iterations in its plane"
    if gone.size:
        value += (
            f"; with q_x = {short(start[start > 0].min(), 1)} to {short(start.max(), 1)} at the start "
            f"{int((beside > 0).sum())} of {beside.size} runs of (D) leave at iterations {gone.min()} to {gone.max()}: "
            "rounding decides when"
        )
    return counted(good, value)


@claim(
    id="fig-6-large-substeps",
    paper="Section 5, Discussion",
    sentence="Yosh s7o6 A (A) (C) performs large forward and backward steps compared to BABs7o7H (B) (D)",
    kind="result",
    statement="Yosh s7o6 A performs large forward and backward steps compared to BABs7o7H",
    threshold="its longest substep in phase space, a pair of a drift and a kick, above that of BABs7o7H, on either "
    "system, among the forward ones and among those with a negative coefficient",
    bound=1.0,
)
def fig_6_substeps(results: Results, ratio: float) -> Decision:
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


@claim(
    id="substeps-are-no-evolution",
    paper="Section 2, below Eq. 3",
    sentence="the intermediate steps (q_j, p_j), j = 1, 2, ..., k - 1, referred to as substeps, do not represent the "
    "time evolution of (q₀, p₀)",
    kind="mathematics",
    statement="Substeps do not represent the time evolution",
    threshold="the largest energy error at the substeps of Figure 6 at least ten times that after its two iterations, "
    "in each of the four panels",
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

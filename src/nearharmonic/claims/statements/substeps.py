"""Figure 6: substeps in phase space."""

from __future__ import annotations

import numpy as np

from nearharmonic.claims.claim import Decision, claim, counted, either
from nearharmonic.claims.results import Results, short
from nearharmonic.theory.linear_stability import stability_limit


@claim(
    id="fig-6-c-unstable",
    paper="Figure 6, caption",
    statement="(C), Yosh s7o6 A on the Hénon-Heiles system, shows an unstable integration",
    threshold="an energy error above 1 within 1000 iterations, by which every run of the system counts as diverged",
)
def fig_6_c(results: Results) -> Decision:
    panel = results.panels()["C"]
    left = int(panel["left_at"])
    value = f"leaves its energy surface at iteration {left}" if left else "stays for 1000 iterations"
    return either(left > 0, value)


@claim(
    id="fig-6-others-stable",
    paper="Figure 6, caption",
    statement="(A), (B) and (D) show stable integrations which preserve H indefinitely",
    threshold="none of 1000 iterations leaves the energy surface; on the oscillator for good, as tau = pi/4 is below "
    "the proved linear limits of both methods",
)
def fig_6_others(results: Results) -> Decision:
    panels = results.panels()
    good = [int(panels[letter]["left_at"]) == 0 for letter in "ABD"]
    good += [np.pi / 4 < float(stability_limit(results.method(name))) for name in ("yoshida_s7o6a", "babs7o7h")]
    told = [f"{letter} {short(float(panels[letter]['max_energy_error']))}" for letter in "ABD"]
    return counted(good, f"largest energy errors: {', '.join(told)}")


@claim(
    id="fig-6-large-substeps",
    paper="Section 5, Discussion",
    statement="Yosh s7o6 A performs large forward and backward steps compared to BABs7o7H",
    threshold="its longest substep in phase space above that of BABs7o7H, on either system",
)
def fig_6_substeps(results: Results) -> Decision:
    panels = results.panels()
    longest = {}
    for letter in "ABCD":
        q, p = (np.diff(panels[letter][name].values, axis=1) for name in "qp")
        longest[letter] = float(np.hypot(q, p).max())
    good = [longest["A"] > longest["B"], longest["C"] > longest["D"]]
    return counted(good, "longest substep " + ", ".join(f"({k}) {short(v)}" for k, v in longest.items()))

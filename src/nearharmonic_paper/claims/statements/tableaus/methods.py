"""Section 4.B: the list of the ten methods, double precision and compensated summation."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from mpmath import mp, mpf

from nearharmonic.integrators import BENCHMARKED, blanes_2013, forest_ruth_1990, kahan_li_1997, yoshida_1990
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.theory.order import error_norm, order_of
from nearharmonic_paper.claims.claim import (
    Decision,
    attribution,
    background,
    counted,
    either,
    finding,
    misprint,
    tallied,
)
from nearharmonic_paper.claims.judging import GREATLY
from nearharmonic_paper.claims.results import Results, label, once, only, require, short
from nearharmonic_paper.claims.statements.tableaus.splitting import leapfrogs

if TYPE_CHECKING:
    import xarray as xr

#: The modules of the ten methods but Nielsen's own: what they declare is covered by the digest of the job.
SOURCES = (blanes_2013, forest_ruth_1990, kahan_li_1997, yoshida_1990)

#: Stages as the list prints them.
LISTED = {
    "ruth": 3, "s5odr4": 5, "aba104": 7, "aba864": 7, "aba1064": 8, "yoshida_s7o6a": 7, "abas5o6h": 5, "babs7o7h": 7,
    "babps8o7h": 7, "babps9o7h": 9,
}  # fmt: skip
GENERALISED = {"aba104": "(10, 4)", "aba864": "(8, 6, 4)", "aba1064": "(10, 6, 4)"}

#: Yoshida's solutions B and C for seven stages, his Table 1, outer weights w_3, w_2, w_1.
YOSHIDA_TABLE_1 = {
    "B": ("1.43984816797678", "0.00426068187079180", "-2.13228522200144"),
    "C": ("1.44778256239930", "-2.14403531630539", "0.00152886228424922"),
}


@background(
    paper="Section 4.B, list of the ten",
    sentence="The following 10 symmetric SIs are benchmarked",
    statement="Of the ten methods all but BAB's8o7H have the listed number of stages",
    threshold="equal to the number of coefficients in the shorter row",
)
def listed_stages(results: Results) -> Decision:
    found = {name: results.method(name).stages for name in LISTED if name != "babps8o7h"}
    bad = [f"{label(name)} has {found[name]}, not {LISTED[name]}" for name in found if found[name] != LISTED[name]]
    good = len(found) - len(bad)
    return counted([good > 0, not bad], f"{good} of {len(found)}" + (f"; {', '.join(bad)}" if bad else ""))


@misprint(
    paper="Section 4.B, list of the ten",
    sentence="BAB's8o7H [BAB] 7-stage, 4th order",
    statement="BAB's8o7H has seven stages",
    threshold="equal to the number of coefficients in the shorter row; the name of the method says eight as well",
)
def listed_stages_babps8o7h(results: Results) -> Decision:
    stages = results.method("babps8o7h").stages
    return either(stages == LISTED["babps8o7h"], f"{stages} stages")


@background(
    paper="Section 4.B, list of the ten",
    sentence="Yosh s7o6 A [ABA] 7-stage, 6th order",
    statement="Yosh s7o6 A is of sixth order, the others of fourth",
    threshold="orders for any separable Hamiltonian, proved in the free Lie algebra",
)
def listed_orders(results: Results) -> Decision:
    good = [order_of(results.method(name), highest=7) == (6 if name == "yoshida_s7o6a" else 4) for name in BENCHMARKED]
    return counted(good, f"{sum(good)} of 10")


@background(
    paper="Section 4.B, list of the ten",
    sentence="ABA864 [ABA] 7-stage, 8-6-4 generalized order",
    statement="ABA104, ABA864 and ABA1064 are of generalized order 10-4, 8-6-4 and 10-6-4",
    threshold="generalised orders, proved in the free Lie algebra",
    needs=("tables/integrators.csv",),
)
def listed_generalised_orders(results: Results) -> Decision:
    rows = results.rows("integrators")
    found = {name: only(rows, "integrator", name)["generalised order"] for name in GENERALISED}
    good = [found[name] == expected for name, expected in GENERALISED.items()]
    return counted(good, ", ".join(f"{label(name)} {order}" for name, order in found.items()))


#: Weights of s5odr4 as programs that use it print them, in 20 decimals: the outer four, and the middle one.
S5ODR4 = ("0.41449077179437573714", "-0.65796308717750294857")


@attribution(
    paper="Abstract and Section 4.B, list of the ten",
    sentence="acclaimed integrators composed by S. Blanes et al. (2013), W. Kahan et al. (1999) and H. Yoshida (1990)",
    statement="s5odr4 was first composed by Kahan",
    threshold="its weights, in 20 decimals and in the runs, differ by more than a unit of the last decimal from "
    "those of Suzuki (1990), four times 1/(4 - 4^(1/3)). The name is of Kahan and Li (1997), whom the list cites",
    bound=1e-20,
)
def s5odr4_of_kahan(results: Results, unit: float) -> Decision:
    with mp.workdps(30):
        weight = 1 / (4 - mp.cbrt(4))
        suzuki = [weight, weight, 1 - 4 * weight, weight, weight]
        printed, middle = map(mpf, S5ODR4)
        rows = [[printed, printed, middle, printed, printed], list(map(mpf, results.method("s5odr4").inner))]
        off = [float(max(abs(c - w) for c, w in zip(row, suzuki, strict=True))) for row in rows]
    value = f"Suzuki's weights within {short(off[0], 1)} as printed and {short(off[1], 1)} in the runs"
    return either(max(off) > unit, value)


@background(
    paper="Section 4.B, below the list",
    sentence="Yosh s7o6 A yields the smallest errors of the three stage-optimized sixth order integrators presented by "
    "[Yoshida]",
    statement="Yosh s7o6 A yields the smallest errors of Yoshida's three with seven stages",
    threshold="norm of its leading error term, of degree 7 in the Lyndon basis, below those of B and C",
    bound=1.0,
)
def yoshida_a_smallest(results: Results, ratio: float) -> Decision:
    norms = _norms(results)
    listed = ", ".join(f"{letter} {short(norm)}" for letter, norm in norms.items())
    return either(norms["A"] < ratio * min(norms[letter] for letter in YOSHIDA_TABLE_1), listed)


@once
def _norms(results: Results) -> dict[str, float]:
    methods = {"A": results.method("yoshida_s7o6a")} | {letter: composed(letter) for letter in YOSHIDA_TABLE_1}
    return {letter: error_norm(method, 7) for letter, method in methods.items()}


def composed(letter: str) -> Tableau:
    """The composition of seven leapfrog steps with the weights of one of Yoshida's solutions."""
    with mp.workdps(30):
        outer = [mpf(w) for w in YOSHIDA_TABLE_1[letter]]
        weights = [*outer, 1 - 2 * sum(outer), *reversed(outer)]
        return leapfrogs(weights, name=f"yoshida_s7o6{letter.lower()}", label=f"Yosh s7o6 {letter}", order=6, digits=14)


#: Half the distance of doubles at 1: what one rounding may change.
UNIT = float(np.finfo(float).eps / 2)


@background(
    paper="Section 4.B, below the list",
    sentence="Compensated summation drastically reduces truncation errors for long-term symplectic integration",
    statement="Compensated summation drastically reduces errors of rounding in long integrations",
    threshold="the root mean square of the energy error by rounding at least ten times larger with plain than with "
    f"compensated sums, for each method; median of the last 20 samples; {GREATLY.brief}. The paper calls rounding "
    "truncation",
    bound=GREATLY.number,
    needs=("cubes/stability_rounding.h5",),
)
def compensated_summation(results: Results, factor: float) -> Decision:
    cube = results.cube("stability_rounding")
    rms = cube["energy_error_rms"].isel(sample=slice(-20, None))
    gains = (rms.sel(source="plain") / rms.sel(source="compensated")).median("sample").values
    worst = label(str(cube["integrator"].values[gains.argmin()]))
    gained = f"; gains {short(gains.min(), 2)} ({worst}) to {short(gains.max(), 2)}"
    return tallied((gains >= factor).tolist(), "methods", f"{gained}{_runs(cube)}")


def _runs(cube: xr.Dataset) -> str:
    """Describe the runs, as far as the cube says."""
    told = f"; {cube.sizes['orbit']} Kepler orbits" if "orbit" in cube.sizes else ""
    if "time" in cube:
        ends = cube["time"].values[:, -1]
        told += f" of {ends.min():.0f} to {ends.max():.0f} periods"
    steps = json.loads(cube.attrs.get("settings", "{}")).get("settings", {}).get("steps")
    return told + (f" in {steps} steps" if steps else "")


@finding(
    paper="Figure 1, dashed lines; the statement is this project's",
    sentence="The dashed lines show benchmark profiles for integrators of corresponding color using extended precision",
    statement="Double precision with compensated summation follows extended precision down to its floor of rounding",
    threshold="maximum errors in double and extended precision differ by at most 10 roundings of a double, 1.1 × "
    "10⁻¹⁵, at every step size with both: energies are of order 1, and an energy takes five roundings",
    bound=10.0,
    needs=("cubes/sho.h5",),
)
def floor_of_double(results: Results, roundings: float) -> Decision:
    cube = results.cube("sho")
    require("extended" in cube["precision"].values, "the config asks for no extended precision on the oscillator")
    double, extended = (cube["max_energy_error"].sel(precision=one).values for one in ("double", "extended"))
    known = np.isfinite(double) & np.isfinite(extended)
    off = np.abs(double[known] - extended[known])
    require(off.size, "no run of the oscillator in extended precision is known")
    floor = double[known & (extended < UNIT)]
    beside = f", largest difference {short(off.max(), 2)}"
    if floor.size:
        beside += f"; floor of the double curves {short(floor.min(), 2)} to {short(floor.max(), 2)}"
    return tallied((off <= roundings * UNIT).tolist(), "runs", beside)

"""Figure 3: the Hénon-Heiles system."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from nearharmonic.claims.claim import Decision, claim, counted, either
from nearharmonic.claims.curves import FEWEST, LOST, SLOPE, Curves, Floats, Range, orders, over
from nearharmonic.claims.results import Results, Undecided, label, short
from nearharmonic.engine.portable import log10
from nearharmonic.engine.statistics import power_law
from nearharmonic.systems import henon_heiles

CUBE = ("cubes/henon_heiles.h5",)
DESCENDING = ("babps8o7h", "babps9o7h")
ORDERS = {
    "ruth": 4, "s5odr4": 4, "aba104": 4, "aba864": 4, "aba1064": 4, "yoshida_s7o6a": 6, "abas5o6h": 4, "babs7o7h": 4,
    "babps8o7h": 4, "babps9o7h": 4,
}  # fmt: skip


@claim(
    id="henon-heiles-energy",
    paper="Section 4.B, below Eq. 18",
    statement="H = 1/8 for q = (0.3, 0), p = (0, 0.4)",
    threshold="exact, in rational arithmetic, from the initial values that are integrated",
)
def henon_heiles_energy(_: Results) -> Decision:
    system = henon_heiles.SYSTEM
    q, p = system.start(Fraction)
    energy = system.energy(q, p, ())
    return either(energy == Fraction(1, 8), f"H = {energy}")


@claim(
    id="fig-3-orders",
    paper="Figure 3",
    statement="Small steps show the general order: six for Yosh s7o6 A, four for the others",
    threshold=SLOPE,
    needs=CUBE,
)
def fig_3_orders(results: Results) -> Decision:
    return orders(Curves(results.cube("henon_heiles")), ORDERS)


@claim(
    id="fig-3-sixth-order-descent",
    paper="Section 4.B, text to Figure 3",
    statement="BAB's8o7H and BAB's9o7H exhibit a sixth order descent of error for large τ",
    threshold="slopes of both, fitted to a quarter of a decade on either side of a step size, between 5 and 7, half "
    "way to the even orders beside 6; at every step size of the decade that ends where the first of the two errors "
    "passes 1 %, as far as the fit has finite errors on both sides; in part: over half a decade or more in one piece",
    needs=CUBE,
)
def fig_3_descent(results: Results) -> Decision:
    curves = Curves(results.cube("henon_heiles"))
    end = min(_end(curves, name) for name in DESCENDING)
    local = np.array([_local_slopes(curves, name) for name in DESCENDING])
    asked = Range(curves.x, np.isfinite(local).all(axis=0) & (curves.x > end / 10) & (curves.x < end), curves.unit)
    if asked.asked.sum() < FEWEST:
        message = "the results have fewer than three step sizes in the decade below an error of 1 %"
        raise Undecided(message)
    steep = np.all(local > 5, axis=0)
    value = f"slopes of {short(local[:, asked.asked].min(), 2)} to {short(local[:, asked.asked].max(), 2)}"
    if steep[asked.asked].any():
        value += f"; both above 5 at {asked.words(steep)}"
    return over(asked, steep & np.all(local < 7, axis=0), value)


@claim(
    id="fig-3-steepest",
    paper="Section 4.B, text to Figure 3",
    statement="Especially BAB's8o7H and BAB's9o7H: theirs is the steepest descent for large τ",
    threshold="the slope of log(maximum error) over the decade that ends where it passes 1 % above that of each of the "
    "other eight",
    needs=CUBE,
)
def fig_3_steepest(results: Results) -> Decision:
    curves = Curves(results.cube("henon_heiles"))
    slopes = {name: _last_decade(curves, name) for name in ORDERS}
    others = {name: one for name, one in slopes.items() if name not in DESCENDING}
    steepest = max(others, key=others.__getitem__)
    listed = ", ".join(f"{label(name)} {slopes[name]:.2f}" for name in DESCENDING)
    value = f"{listed}; the others {min(others.values()):.2f} to {others[steepest]:.2f}, {label(steepest)}"
    return counted([slopes[name] > others[steepest] for name in DESCENDING], value)


def _end(curves: Curves, name: str) -> float:
    """The first step size at which the error passes 1 %."""
    return float(curves.x[curves.errors([name])[0] > LOST].min(initial=np.inf))


def _last_decade(curves: Curves, name: str) -> float:
    """The slope over the decade below that."""
    end = _end(curves, name)
    asked = (curves.x > end / 10) & (curves.x < end)
    if asked.sum() < FEWEST or not np.isfinite(end):
        message = f"the results have no decade of {label(name)} below an error of 1 %"
        raise Undecided(message)
    return power_law(curves.x[asked], curves.errors([name])[0][asked])[0]


def _local_slopes(curves: Curves, name: str) -> Floats:
    """The slope around each step size, NaN where fewer than three errors around it are finite or one is not."""
    tau, error = curves.of(name, "tau"), curves.errors([name])[0]
    found = np.full(curves.x.size, np.nan)
    for i, x in enumerate(curves.x):
        near = np.abs(log10(curves.x / x)) <= 0.25
        if near.sum() >= FEWEST and np.isfinite(error[near]).all():
            found[i] = power_law(tau[near], error[near])[0]
    return found

"""Statements on curves of errors and on one unstable run, decided in floating point."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpmath import mpf, workdps

from support.second_opinion import Opinion
from support.second_opinion.methods import METHODS
from support.second_opinion.ranges import compared, descent, over
from support.second_opinion.runs import SYSTEMS, curves

NEW = ("ABAs5o6H", "BABs7o7H", "BAB's8o7H", "BAB's9o7H")
#: "Several orders of magnitude" are two at least.
SEVERAL = 100
#: A tenth of a decade is covered by a dot of the figure.
DOT = 10**0.1


def sixth_order_on_the_oscillator() -> Opinion:
    return descent((curves("oscillator", label) for label in NEW), 6), []


def sixth_order_descent_on_henon_heiles() -> Opinion:
    return descent((curves("Henon-Heiles", label) for label in ("BAB's8o7H", "BAB's9o7H")), 6), []


def gains_on_ruth(name: str, row: str) -> np.ndarray:
    """Return the ratio of Ruth's error to the error of each new method, at the step sizes of the range."""
    every = [curves(name, label) for label in ("Ruth", *NEW)]
    part = compared((one, row) for one in every)
    ruth, *others = (getattr(one, row)[part] for one in every)
    return ruth / np.array(others)


def outperform_ruth() -> Opinion:
    """Compare maximum and mean errors on three systems, at each step size of each range."""
    gains = [gains_on_ruth(name, row) for name in ("oscillator", *SYSTEMS) for row in ("largest", "mean")]
    verdicts = {over(gain.min(axis=0) > 1) for gain in gains}
    return (verdicts.pop() if len(verdicts) == 1 else "holds in part"), []


def outperform_ruth_by_orders_on_kepler() -> Opinion:
    gains = gains_on_ruth("Kepler", "largest")
    worst, best = gains.min(axis=0), gains.max(axis=0)
    by_worst = f"worst new method's error {worst.min():.2g} to {worst.max():.2g}"
    return over(worst >= SEVERAL), [by_worst, f"best new method's error up to {best.max():.2g}"]


def coincide_in_figure_4() -> Opinion:
    three = [curves("Kepler", label) for label in ("ABAs5o6H", "ABA104", "BAB's8o7H")]
    part = compared((one, row) for one in three for row in ("largest", "rotation"))
    rotations = np.array([one.rotation[part] for one in three])
    ratios = rotations.max(axis=0) / rotations.min(axis=0)
    good = ratios <= DOT
    spread = f"ratio of largest to smallest advance {ratios.min():.3g} to {ratios.max():.3g}"
    return over(good), [f"{good.sum()} of {good.size} step sizes", spread]


def unstable_in_figure_6() -> Opinion:
    """Run Yosh s7o6 A with tau = 2 from q = p = 0.4 on the axis x = 0 of the Henon-Heiles system."""
    with workdps(40):  # enough to follow an unstable run to its end
        moves = [(kind, 2 * mpf(one.numerator) / one.denominator) for kind, one in METHODS["Yosh s7o6 A"].moves()]
        q = p = mpf("0.4")

        def energy() -> mpf:
            return (p * p + q * q) / 2 - q**3 / 3

        start = energy()
        for iteration in range(1, 1001):
            for kind, length in moves:
                if kind == "drift":
                    q += length * p
                else:
                    p -= length * (q - q * q)
            if abs(energy() / start - 1) > 1:
                return "holds", [f"leaves its energy surface at iteration {iteration}"]
    return "fails", []


STATEMENTS: dict[str, Callable[[], Opinion]] = {
    "fig-1-sixth-order": sixth_order_on_the_oscillator,
    "fig-3-sixth-order-descent": sixth_order_descent_on_henon_heiles,
    "outperform-ruth": outperform_ruth,
    "outperform-ruth-kepler": outperform_ruth_by_orders_on_kepler,
    "fig-4-coincide": coincide_in_figure_4,
    "fig-6-c-unstable": unstable_in_figure_6,
}

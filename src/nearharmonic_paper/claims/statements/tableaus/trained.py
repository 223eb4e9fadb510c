"""Statements of the paper that methods trained by the energy error bear on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from nearharmonic.math import pow
from nearharmonic.numerics.portable import Floats
from nearharmonic_paper.claims.claim import Decision, background, counted
from nearharmonic_paper.claims.judging import rank_correlation
from nearharmonic_paper.claims.results import Results, Undecided, label, once, require, short

TRAINED = "cubes/trained.h5"
#: The ensembles of random potentials whose strengths span the widest band, as the cube names them.
ENSEMBLES = ("d = 2, 0.01 to 0.5", "d = 3, 0.01 to 0.5")
ENSEMBLE_WORDS = "random potentials of two and three coordinates and strengths of 0.01 to 0.5"
#: Half way from no relation to one without exception.
RELATED = 0.5
#: A random order of so many methods reaches RELATED in one of twenty cases; of fewer methods, in more.
FEWEST_METHODS = 12


class Errors(NamedTuple):
    """Mean errors of methods at equal cost.

    Attributes
    ----------
    names, kinds : list of str
        Methods, and whether each is published, own or trained.
    tau_per_stage : (T,) array
        Step sizes over the cost of a step.
    mean_log : (methods, T) array
        Mean over all problems of log10 of the maximum error.
    """

    names: list[str]
    kinds: list[str]
    tau_per_stage: Floats
    mean_log: Floats

    def least(self, names: Sequence[str]) -> Floats:
        """Return the least error among some methods, for each step size."""
        found: Floats = self.mean_log[[self.names.index(name) for name in names]].min(axis=0)
        return found

    def of_order_four_or_more(self, results: Results) -> Errors:
        """Return the errors of the methods of high order."""
        kept = [i for i, name in enumerate(self.names) if results.methods[name].order >= 4]
        names, kinds = ([row[i] for i in kept] for row in (self.names, self.kinds))
        return Errors(names, kinds, self.tau_per_stage, self.mean_log[kept])


def errors_on_random_potentials(results: Results) -> Errors:
    """Return the errors of the methods of ``results`` on both ensembles together."""
    cube = results.cube("trained")
    for name in ENSEMBLES:
        require(name in cube["ensemble"].values, f"the results do not have the random potentials {name}")
    # Methods with modified potentials, which spend gradients on small coefficients, are not among those looked at.
    both = cube.sel(ensemble=list(ENSEMBLES))
    tau = both["tau_per_stage"].values[0]
    known = np.isfinite(tau)  # other ensembles may have more step sizes
    return Errors(
        [str(name) for name in both["integrator"].values],
        [str(kind) for kind in both["kind"].values],
        tau[known],
        both["mean_log_error"].mean("ensemble").transpose("integrator", "point").values[:, known],
    )


def lead_of_trained(results: Results, names: Sequence[str], what: str) -> str:
    """Say where trained methods err less than the methods ``names``, called ``what``; nothing without their results."""
    if not results.has(TRAINED):
        return ""
    try:
        errors = errors_on_random_potentials(results)
    except Undecided:
        return ""
    trained = [name for name, kind in zip(errors.names, errors.kinds, strict=True) if kind == "trained"]
    if not trained or not set(names) <= set(errors.names) or errors.tau_per_stage.size == 0:
        return ""
    lead = errors.least(names) - errors.least(trained)
    low, high = short(lead.min(), 2), short(lead.max(), 2)
    return (
        f"; on {ENSEMBLE_WORDS}, which are not in the paper, methods trained on other such potentials are ahead of "
        f"{what} at {(lead > 0).sum()} of {lead.size} step sizes, the best by {low} to {high} decades"
    )


@background(
    paper="Section 1",
    sentence="To construct more efficient high order SIs it has been proposed that the absolute value of negative "
    "coefficients and the sum of positive coefficients should be minimized",
    statement="Methods with smaller negative coefficients and a smaller sum of positive ones have smaller errors",
    threshold="Spearman's rank correlation of the sum of absolute values of the coefficients with the mean error at "
    f"least {RELATED} at each τ/s, over all registered methods of order four or more without the force gradient, on "
    f"{ENSEMBLE_WORDS}. Such a correlation is half way from none to a strict one; {FEWEST_METHODS} methods in random "
    "order reach it in one of twenty cases. Each row sums to 1, so negative coefficients, positive ones and their "
    "absolute values rank the methods alike",
    bound=RELATED,
    needs=(TRAINED,),
)
def minimised_coefficients(results: Results, related: float) -> Decision:
    found, said = _correlations(results)
    good = found >= related
    first, *rest = said
    counts = f"{short(related, 2)} or more at {good.sum()} of {good.size} step sizes"
    return counted(good.tolist(), "; ".join([first, counts, *rest]))


@once
def _correlations(results: Results) -> tuple[Floats, list[str]]:
    """The correlation at each step size, and what is told of it."""
    errors = errors_on_random_potentials(results).of_order_four_or_more(results)
    x = errors.tau_per_stage
    known = len(errors.names) >= FEWEST_METHODS and x.size
    require(known, f"the results have fewer than {FEWEST_METHODS} methods of order four or more, or no step size")
    methods = [results.methods[name] for name in errors.names]
    sums = np.array([sum(abs(float(c)) for c in (*one.kick, *one.drift)) for one in methods])
    found, fourth = _correlation(sums, errors.mean_log), np.array([one.order == 4 for one in methods])
    told = [f"rank correlation {short(found[0], 2)} at τ/s = {short(x[0])} to {short(found[-1], 2)} at {short(x[-1])}"]
    if fourth.sum() >= FEWEST_METHODS:
        among = _correlation(sums[fourth], errors.mean_log[fourth])
        told.append(f"among those of order four alone {short(among.min(), 2)} to {short(among.max(), 2)}")
    return found, [*told, *_leaders(errors, sums)]


def _correlation(sums: Floats, mean_log: Floats) -> Floats:
    return rank_correlation(np.broadcast_to(sums[:, None], mean_log.shape), mean_log)


def _leaders(errors: Errors, sums: Floats) -> Iterator[str]:
    """The methods of least error with their sums, and what the method of the least sum loses to them."""
    leaders: list[int] = errors.mean_log.argmin(axis=0).tolist()
    led = []
    for best, places in groupby(range(len(leaders)), leaders.__getitem__):
        x = [short(float(errors.tau_per_stage[i])) for i in places]
        led.append(f"{label(errors.names[best])} ({short(sums[best])}) at {' to '.join(dict.fromkeys((x[0], x[-1])))}")
    yield f"least error, with the sum: {', '.join(led)}"
    small = int(sums.argmin())
    ratios = pow(10.0, errors.mean_log[small] - errors.mean_log.min(axis=0))
    of = f"{short(sums[small])}, of {label(errors.names[small])}"
    yield f"the least sum is {of}, with {short(ratios.min())} to {short(ratios.max())} times the least error"

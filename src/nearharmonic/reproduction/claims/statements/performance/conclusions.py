"""Section 5: close encounters, kinetic energies that are not quadratic, coefficients of methods of higher order."""

from __future__ import annotations

from math import inf

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.reproduction.claims.claim import Decision, background, counted, either, result, tallied
from nearharmonic.reproduction.claims.judging.curves import LOST
from nearharmonic.reproduction.claims.judging.definitions import GENERALLY, SEVERAL, SIGNIFICANTLY, SMALL
from nearharmonic.reproduction.claims.results import Results, label, require, short
from nearharmonic.reproduction.claims.statements.performance.comparisons import NEW


@result(
    id="t-not-quadratic",
    paper="Section 5, Discussion",
    sentence="The performance of the obtained integrators generally declines for systems where T(p) deviates "
    "significantly from a squared kinetic energy",
    statement="The performance generally declines where T deviates significantly from a squared kinetic energy",
    threshold="on a relativistic oscillator at τ/s = 0.05 the maximum error is more than 1.26 times that with the "
    "roles of T and V exchanged, where V is not quadratic, and the ratio is above Ruth's, for more than half of the "
    "new methods at the amplitudes 0.1 and 1, where T is off a square by 0.25 % and by a sixth; "
    f"{SIGNIFICANTLY.brief}; {GENERALLY.brief}",
    bound=SIGNIFICANTLY.number,
    needs=("cubes/kinetic_energy.h5",),
)
def t_not_quadratic(results: Results, least: float) -> Decision:
    good, told = [], []
    for amplitude, (ruth, *new) in results.kept("roles", lambda: _by_roles(results)).items():
        good += [one > max(least, ruth) for one in new]
        listed = ", ".join(f"{label(name)} {short(one, 2)}" for name, one in zip(NEW, new, strict=True))
        told.append(f"at amplitude {short(amplitude)} {listed}, Ruth {short(ruth, 2)}")
    value = f"error over that with the roles exchanged: {'; '.join(told)}"
    return either(sum(good) > GENERALLY.number * len(good), value)


def _by_roles(results: Results) -> dict[float, list[float]]:
    """Errors over those with the roles exchanged by amplitude, of Ruth's method and of the new ones."""
    cube = results.cube("kinetic_energy")
    for name in ("ruth", *NEW):
        require(name in cube["integrator"].values, f"the results do not have the method {label(name)}")
    errors = cube["max_energy_error"].sel(tau_per_stage=0.05, method="nearest").sel(integrator=["ruth", *NEW])
    ratios = errors.sel(roles="own") / errors.sel(roles="exchanged")
    return {one: ratios.sel(amplitude=one, method="nearest").values.tolist() for one in (0.1, 1.0)}


#: Evaluations of the force an orbit, as in the figures of Kepler maps, and a round orbit beside those that come close.
EVALUATIONS, ROUND, CLOSE = 400, 0.2, 0.95


@background(
    id="close-encounters",
    paper="Section 5, Discussion",
    sentence="Close encounters in the gravitational N-body system inevitably cause high errors ultimately waiving "
    "symplectic properties of SIs",
    statement="Close encounters cause high errors: at fixed steps energy is lost on an orbit of high eccentricity",
    threshold=f"with each method, at {EVALUATIONS} evaluations an orbit, the relative energy error passes 1 within ten "
    f"periods on a Kepler orbit of eccentricity {CLOSE}, and stays below 1 % on one of eccentricity {ROUND}",
    bound=LOST,
    needs=("cubes/stability_kepler.h5",),
)
def close_encounters(results: Results, kept_below: float) -> Decision:
    cube = results.cube("stability_kepler")
    of_orbits = cube["energy_error"].sel(eccentricity=[ROUND, CLOSE], method="nearest").values
    places = abs(cube["evaluations_per_orbit"].values - EVALUATIONS).argmin(axis=1)
    kept, lost = zip(*(map(float, errors[place]) for errors, place in zip(of_orbits, places, strict=True)), strict=True)
    good = [one < kept_below and other == inf for one, other in zip(kept, lost, strict=True)]
    beside = f"; energy error at eccentricity {ROUND} {short(min(kept), 2)} to {short(max(kept), 2)}"
    return tallied(good, "methods lose the orbit", beside)


@background(
    id="high-order-negative",
    paper="Section 5, Discussion",
    sentence="Higher order integrators are generally more constrained and usually involve several negative splitting "
    "coefficients with large absolute values",
    statement="Higher order integrators usually have several negative coefficients, and large ones among these",
    threshold="more than half of the registered methods of order 6 or more for any separable Hamiltonian have several "
    "negative coefficients, and more than half have a large one, below -1: not a small one; holds in part with one of "
    f"the two; {SEVERAL.brief}; {SMALL.brief}; {GENERALLY.brief}",
    bound=GENERALLY.number,
    needs=("tables/integrators.csv",),
)
def high_order_negative(results: Results, share: float) -> Decision:
    high = {row["integrator"]: row for row in results.rows("integrators") if int(row["order"]) >= 6}
    require(high, "the table of methods has none of order 6")
    several = [int(row["negative coefficients"]) >= SEVERAL.number for row in high.values()]
    most = {name: _most_negative(results.method(name)) for name in high}
    large = [one < -SMALL.number for one in most.values()]
    listed = [f"{label(name)} {high[name]['negative coefficients']} to {one:.2f}" for name, one in most.items()]
    new = min(_most_negative(results.method(name)) for name in NEW)
    value = f"several in {sum(several)} of {len(high)}, a large one in {sum(large)}; number and most negative: "
    value += f"{', '.join(listed)}; new methods to {new:.2f}"
    return counted([sum(good) > share * len(high) for good in (several, large)], value)


def _most_negative(method: Tableau) -> float:
    return min(float(c) for c in (*method.kick, *method.drift))

"""Changes of correct results that set a number to a given multiple of its threshold."""

from __future__ import annotations

import numpy as np

from nearharmonic.integrators import BENCHMARKED

NEW = BENCHMARKED[-4:]
SYSTEMS = ("sho", "henon_heiles", "kepler")
BOTH = ("max_energy_error", "mean_energy_error")


def curve(results, system, name, variable="max_energy_error"):
    """A view of the errors of a method, to be changed; of the oscillator's that in double precision."""
    cube = results.cubes[system]
    rows = cube[variable].values[0] if "precision" in cube.dims else cube[variable].values
    return rows[list(cube["integrator"].values).index(name)]


def times_the(pick, factor, ours, theirs, systems=SYSTEMS, variables=BOTH):
    """The errors of ``ours`` become ``factor`` times those that ``pick``, np.min or np.max, finds among ``theirs``."""

    def change(results, by):
        for system in systems:
            for variable in variables:
                found = pick([curve(results, system, name, variable) for name in theirs], axis=0)
                for name in ours:
                    curve(results, system, name, variable)[:] = factor * by * found

    return change


def power(system, name, order, band):
    """The maximum error of a method has a slope that is off its order by ``band``."""

    def change(results, by):
        x = results.cubes[system]["tau_per_stage"].values
        error = curve(results, system, name)
        error[:] = np.maximum(error[100] * (x / x[100]) ** (order + band * by), 1e-16)

    return change


def interval(share):
    """The interval of one method's advance."""

    def change(results, by):
        cube = results.cubes["kepler"]
        advance = abs(cube["perihelion_advance"].sel(integrator="ruth"))
        cube["perihelion_advance_interval"].loc[{"integrator": "ruth"}] = share * by / 2 * advance

    return change


def advance(share):
    """The advance of one of three that coincide."""

    def change(results, by):
        found = results.cubes["kepler"]["perihelion_advance"]
        for name, factor in (("abas5o6h", 1.0), ("babps8o7h", share * by)):
            found.loc[{"integrator": name}] = factor * found.sel(integrator="aba104")

    return change


def halves(results, by):
    results.cubes["kepler"]["perihelion_advance_halves"].loc[{"integrator": "ruth"}] = 1 + 0.02 * by


def above_floor(results, by):
    cube = results.cubes["sho"]
    double, extended = cube["max_energy_error"].values
    known = np.flatnonzero(np.isfinite(extended[0]))[0]
    double[0, known] = extended[0, known] + 10 * by * 2.0**-53


def even_term(results, by):
    kappa = results.cubes["sho_terms"]["kappa"]
    for first, number in (("drift", 0.0), ("kick", 1e-30 * by)):
        kappa.loc[{"integrator": "babps9o7h", "first": first, "order": 8}] = number


def one_term_more(results, by):
    """The ABA composition of BABs7o7H has as many terms as the BAB one, and one of which it depends."""
    kappa = results.cubes["sho_terms"]["kappa"]
    rows = [kappa.sel(integrator="babs7o7h", first=first).values.copy() for first in ("drift", "kick")]
    vanished = np.flatnonzero(rows[1] < 1e-30)
    rows[0][:] = rows[1]
    rows[0][vanished[0]] = 1e-30 * by
    kappa.loc[{"integrator": "babs7o7h", "first": "drift"}] = rows[0]


def largest_of_yoshida(results, by):
    """Yosh s7o6 A alone, with a largest term that is ten times the largest of the new methods."""
    for name in ("s9odr6a", "s15odr8"):
        del results.methods[name]
    kappa = results.cubes["sho_terms"]["kappa"]
    new = [kappa.sel(integrator=n, first=results.methods[n].first).max().item() for n in NEW]
    kappa.loc[{"integrator": "yoshida_s7o6a"}] = 0.0
    kappa.loc[{"integrator": "yoshida_s7o6a", "order": 9}] = 10 * by * max(new)


def shares_of_the_best(results, by):
    """The three praised methods are the best at about half of all step sizes, as many as all curves have errors at."""
    praised = ("babps9o7h", "babps8o7h", "abas5o6h")
    for system in SYSTEMS:
        x = results.cubes[system]["tau_per_stage"].values
        for variable in BOTH:
            for name in BENCHMARKED:
                place = np.arange(x.size)
                ahead = place % 100 < 50 * by  # of each hundred step sizes
                factor = np.where(ahead, 0.5, 2.0) if name in praised else 1.0
                curve(results, system, name, variable)[:] = np.where(place < 100, 1e-6, 1.0) * factor
            for name in BENCHMARKED:  # the floor that each curve has at its first step size
                curve(results, system, name, variable)[0] = 1e-16


def first_loss(results, by):
    """All methods pass 1 % at the place 100, the new ones a place before or behind it."""
    for system in SYSTEMS:
        for name in BENCHMARKED:
            place = 100 + (0 if name not in NEW else 1 if by > 1 else -1)
            curve(results, system, name)[:] = np.where(np.arange(curve(results, system, name).size) < place, 1e-6, 0.1)


def first_spike(results, by):
    """All methods have a spike, the new ones a place before or behind Ruth's."""
    for system in SYSTEMS:
        for name in BENCHMARKED:
            error = curve(results, system, name)
            error[100 + (0 if name not in NEW else 1 if by > 1 else -1)] *= 100


def chaotic(results, by):
    cube = results.cubes["henon_heiles_chaos"]
    regular = 4e-5
    cube["lyapunov_exponent"].values[:, -1] = 10 * by * regular + 0.01, regular


def residual(results, by):
    results.document["printed"][0]["continued"]["residual"] = repr(1e-128 * by)


def long_substep(results, by):
    """One of the solutions with seven stages has a substep of about 1, the others have shorter ones."""
    for case in results.document["isolated"]:
        for root in case["roots"]:
            root["inner"] = ["0.5"]
    results.document["isolated"][1]["roots"][1]["inner"] = [repr(by)]


def roles(table_factor, rows):
    """Errors of solutions kick first over those drift first: rows of the table, (kick, drift)."""

    def change(results, by):
        table = results.tables["derived_errors"]
        for kick, drift in rows:
            error = float(table[drift]["max error, Henon-Heiles"])
            table[kick]["max error, Henon-Heiles"] = repr(table_factor * by * error)

    return change

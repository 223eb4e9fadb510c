"""Changes of correct results that change verdicts; some have a factor of the inserted number."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

from mpmath import mp, mpf

from nearharmonic.exact.decimals import fixed_point
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic_paper.claims.statements.equations import identities


def scaled(system, factor, *names, variable="max_energy_error"):
    """Multiply a curve by a factor, or by a function of the step size per stage."""

    def change(results):
        cube = results.cubes[system]
        by = factor(cube["tau_per_stage"]) if callable(factor) else factor
        for name in names:
            cube[variable].loc[{"integrator": name}] = cube[variable].sel(integrator=name) * by

    return change


def both(system, factor, *names):
    """Multiply both errors."""
    return together(*(scaled(system, factor, *names, variable=f"{one}_energy_error") for one in ("max", "mean")))


def steeper(system, name, by=0.7):
    return scaled(system, lambda x: x**by, name)


def spiked(name, at):
    """A hundredfold error at one step size of each system, by its place."""

    def change(results):
        for system in ("sho", "henon_heiles", "kepler"):
            results.cubes[system]["max_energy_error"].loc[{"integrator": name}][..., at] *= 100

    return change


def swapped(system, one, other, variable="max_energy_error"):
    def change(results):
        rows = results.cubes[system][variable]
        first, second = (rows.sel(integrator=name).values.copy() for name in (one, other))
        rows.loc[{"integrator": one}], rows.loc[{"integrator": other}] = second, first

    return change


def cell(table, row, column, content):
    def change(results, by=1):
        results.tables[table][row][column] = content if isinstance(content, str) else repr(content * by)

    return change


def put(cube, variable, value, **where):
    def change(results, by=1):
        results.cubes[cube][variable].loc[where] = value * by

    return change


def method(name, other):
    """Put another method in the place of ``name``: a name, or a function of the methods."""

    def change(results):
        found = results.methods[other] if isinstance(other, str) else other(results.methods)
        results.methods[name] = found

    return change


def nudged(tableau, by):
    """``tableau`` with the outermost coefficients larger by ``by`` and their neighbours smaller."""
    row = [Fraction(c) for c in tableau.outer]
    for i, sign in ((0, 1), (1, -1)):
        row[i] += sign * Fraction(by)
        row[-1 - i] = row[i]
    key = "kick" if tableau.first == "kick" else "drift"
    return replace(tableau, **{key: tuple(fixed_point_of(c) for c in row)})


def fixed_point_of(number):
    with mp.workdps(120):
        return fixed_point(mpf(number.numerator) / number.denominator, 90)


def thirds(_):
    """Three stages, the kick first, with coefficients of no use."""
    return Tableau(
        name="thirds", label="thirds", order=2, first="kick", source="none", digits=20,
        kick=palindrome("0.1", "0.4"), drift=palindrome("0.3", centre="0.4"),
    )  # fmt: skip


def together(*changes):
    def change(results, *by):
        for one in changes:
            one(results, *by)

    return change


def document(function):
    return lambda results: function(results.document)


def panel(letter, variable, value):
    def change(results):
        results.figure_6[letter][variable] = value

    return change


def panels_swapped(results):
    results.figure_6["A"], results.figure_6["B"] = results.figure_6["B"], results.figure_6["A"]


def patched(module, name, value):
    """Put something else in the place of a name of a module."""
    return lambda results: results.patch(module, name, value)


def draws(kicks, drifts):
    """In the place of random coefficients."""
    one = identities.Drawn(*([Fraction(c) for c in row] for row in (kicks, drifts)))
    return patched(identities, "drawn", lambda stages, symmetric=False: [one])


def terms_of_another_step(results):
    """A step whose last kick but one is gone."""
    right = identities.position_terms

    def wrong(one):
        return right(identities.Drawn([*one.kicks[:-1], Fraction(0)], one.drifts))

    results.patch(identities, "position_terms", wrong)


def momentum_first(known):
    """Stages whose momentum is of higher order than the position."""
    return replace(known["aba864"].role("kick"), label="BAB's8o7H")


def quiet_substeps(results):
    results.figure_6["B"]["energy_error"] = results.figure_6["B"]["energy_error"] * 0 + 1e-8


def reversed_order(*steps):
    """At some step sizes the methods of larger sums of coefficients err less, on all ensembles."""

    def change(results):
        cube = results.cubes["trained"]
        errors, tau = cube["mean_log_error"].values, cube["tau_per_stage"].values[-1]
        for step in steps:
            errors[:, :, tau == step] *= -1

    return change


def advance_follows_maximum(results):
    cube = results.cubes["kepler"]
    cube["perihelion_advance"] = cube["max_energy_error"] * 3
    cube["perihelion_advance_interval"] = cube["max_energy_error"] * 0.001


def another_start(module, momentum):
    """The system of a module starts with another momentum."""
    return patched(module, "SYSTEM", replace(module.SYSTEM, p0=("0", momentum)))


def another_potential(module):
    """The system of a module has a term of fourth degree, and none of third."""
    system = SimpleNamespace(start=module.SYSTEM.start, V=lambda q: (q[0] ** 2 + q[1] ** 2) / 2 + q[0] ** 4)
    return patched(module, "SYSTEM", system)


def kicks_of(name):
    """The method of this name with its roles exchanged, so that the first row printed is that of the kicks."""
    return lambda known: known[name].role("kick")

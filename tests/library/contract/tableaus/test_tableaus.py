"""Contract of every registered tableau: orders measured and proved, and ten methods of every kind."""

from dataclasses import replace
from decimal import Decimal, localcontext
from fractions import Fraction

import pytest
from mpmath import cbrt, log, mp, mpf

import nearharmonic as nh
from nearharmonic.errors import TableauError
from nearharmonic.integrators import BENCHMARKED, load_tableaus
from nearharmonic.integrators import integrators as registered
from nearharmonic.integrators import plain_integrators as integrators
from nearharmonic.systems import systems
from nearharmonic.theory import order as theory
from nearharmonic.theory.oscillator import kappa, step_polynomials
from nearharmonic_paper.experiments.paper.tableaus import overview
from support.methods.ten_methods import EVERY_METHOD, TEN_METHODS, thinned
from support.oracles.multiprecision import energy_errors

# --- contract of every registered tableau: the tests walk the registry, so new entries need no new line ---------------


EVERY = pytest.mark.parametrize("name", list(integrators))
EVERY_NIELSEN = pytest.mark.parametrize("name", [n for n, t in integrators.items() if "1501.04345" in t.source])
#: A state without any symmetry of either system, so that no error term vanishes by chance.
STATE = {1: (["0.3"], ["0.2"]), 2: (["0.3", "0.1"], ["0.2", "0.4"])}
#: What the next error term, a factor tau^2 = 2^-16 smaller, leaves of a slope is below 0.01.
SLOPE_TOLERANCE = 0.05


def other(tableau):
    return "kick" if tableau.first == "drift" else "drift"


def slope(tableau, system, tau, steps):
    """Observed order: log2 of what halving ``tau`` gains in max |dH/H0| over the same instants."""
    state = tuple([mpf(x) for x in row] for row in STATE[systems[system].dimension])
    coarse = energy_errors(tableau, systems[system], tau, steps, state)
    fine = energy_errors(tableau, systems[system], tau / 2, 2 * steps, state)[1::2]
    return log(max(coarse) / max(fine), 2)


def harmonic_energy_order(tableau):
    """Order of the energy error that the harmonic oscillator sees: the conserved ellipse is off by (K12 + K21)/tau."""
    K = step_polynomials(tableau)
    noise = Fraction(1, 10 ** (tableau.digits - 10))
    defects = zip(K.K11, K.K12, K.K21, K.K22, strict=True)
    # The ellipse is tilted by K11 - K22, which is 0 for a symmetric step.
    return next(n for n, (a, b, c, d) in enumerate(defects) if abs(b + c) > noise or abs(a - d) > noise) - 1


def closed(row):
    """The row with its innermost values, or the first one if it is no palindrome, as they close the sum exactly."""
    with localcontext(prec=200):
        if row != row[::-1]:
            return (str(1 - sum(map(Decimal, row[1:]))), *row[1:])
        values, middle = [Decimal(c) for c in row], (len(row) - 1) // 2
        inner = values[middle : len(row) - middle]
        rest = (1 - 2 * sum(values[:middle])) / len(inner)
        return (*map(str, values[:middle]), *[str(rest)] * len(inner), *map(str, reversed(values[:middle])))


# --- what an entry says about itself ----------------------------------------------------------------------------------


def test_the_papers_ten_methods_are_registered_and_marked():
    assert {name for name, tableau in integrators.items() if tableau.benchmarked} == set(BENCHMARKED)
    assert len(BENCHMARKED) == len(set(BENCHMARKED)) == 10


def test_no_two_methods_share_a_name_label_or_alias():
    taken = [text for one in registered.values() for text in {one.name, one.label, *one.aliases}]
    assert len(taken) == len(set(taken))


def test_labels_and_names_of_the_field_are_taken_for_names():
    assert registered["6A8"] is registered["nystrom_6a8"]
    assert registered["BAB's8o7H"] is registered["babps8o7h"]
    for alias in ("verlet", "velocity_verlet", "stormer_verlet", "strang"):
        assert integrators[alias] is registered[alias] is registered["leapfrog"]
        assert alias in registered
        assert alias in integrators
        assert alias not in nh.implicit_integrators
        assert alias not in list(registered)  # names are listed once
    assert nh.integrate("sho", "yoshida4", 0.1, t_end=1).attrs["integrator"] == "ruth"
    assert registered.module_of("verlet") == registered.module_of("leapfrog")
    for other in ("verle", 3, "verlet.py"):  # a file is read at look-up alone
        assert other not in registered


@EVERY
def test_entry_is_registered_by_name_with_traceable_source(name):
    tableau = integrators[name]
    assert tableau.name == name
    assert tableau.label
    assert any(where in tableau.source for where in ("doi:10.", "arXiv:", "https://github.com/"))


@EVERY
def test_rows_are_palindromes_or_padded_and_sum_to_one(name):
    tableau = integrators[name]
    assert (len(tableau.outer), len(tableau.inner)) == (tableau.stages + 1, tableau.stages)
    assert tableau.symmetric == (("0" in tableau.outer) is False)
    for row in (tableau.outer, tableau.inner):
        assert (row == row[::-1]) is tableau.symmetric
        with localcontext(prec=150):
            assert abs(sum(map(Decimal, row)) - 1) <= len(row) * Decimal(10) ** -tableau.digits


# --- orders, measured in multiprecision -------------------------------------------------------------------------------


@EVERY_METHOD
def test_energy_order_on_nonlinear_problem_is_declared_order(name):
    with mp.workdps(60):
        assert slope(integrators[name], "henon_heiles", mpf(2) ** -8, 32) == pytest.approx(
            nh.order_of(name, potential_degree=3), abs=SLOPE_TOLERANCE
        )


@pytest.mark.slow
@pytest.mark.parametrize("name", thinned(n for n, t in integrators.items() if t.requires is None))
def test_order_survives_role_exchange_except_for_quadratic_kinetic_energy(name):
    tableau = integrators[name]
    with mp.workdps(60):
        order = slope(tableau.role(other(tableau)), "henon_heiles", mpf(2) ** -8, 32)
    assert order == pytest.approx(tableau.order, abs=SLOPE_TOLERANCE)


@EVERY_METHOD
def test_energy_order_on_harmonic_oscillator_is_that_of_step_matrix(name):
    tableau = integrators[name]
    with mp.workdps(60):
        expected = harmonic_energy_order(tableau)
        assert slope(tableau, "sho", mpf(2) ** -8, 32) == pytest.approx(expected, abs=SLOPE_TOLERANCE)


@EVERY
def test_the_harmonic_oscillator_shows_at_least_the_declared_orders(name):
    # A symmetric method has even energy orders: lambda_H = 7 for the position gives 6 for the energy.
    tableau = integrators[name]
    order = harmonic_energy_order(tableau)
    assert order % 2 == 0 or not tableau.symmetric
    assert order >= tableau.order
    if tableau.harmonic_order is not None:
        assert order == 2 * (tableau.harmonic_order // 2)


@EVERY_METHOD
@pytest.mark.parametrize("system", ["sho", "henon_heiles"])
def test_a_tiny_step_shows_the_order_to_the_guaranteed_digits(name, system):
    # A coefficient wrong by d adds d tau^2 to the energy error of size tau^order: at this tau it would show as order 2
    # for any d above 10^(10 - digits); it is d tau and order 1 if the method is not symmetric. The sums are closed
    # first: they have a test of their own. Where the coefficient of tau^order is below 10^-10, that would ask for more
    # than the guaranteed digits: tau is then such that an error of 10^-digits changes the slope by the tolerance.
    tableau = integrators[name]
    order = nh.order_of(name, potential_degree=3) if system == "henon_heiles" else harmonic_energy_order(tableau)
    exact = replace(tableau, kick=closed(tableau.kick), drift=closed(tableau.drift))
    with mp.workdps(400):
        excess = max(order - 1 - tableau.symmetric, 1)
        tau = mpf(10) ** -((tableau.digits - 10) // excess)
        state, coarse = tuple([mpf(x) for x in row] for row in STATE[systems[system].dimension]), mpf(10) ** -4
        leading = max(energy_errors(exact, systems[system], coarse, 1, state)) / coarse**order
        if leading < mpf(10) ** -10:
            tau = (2**excess / SLOPE_TOLERANCE * mpf(10) ** -tableau.digits / leading) ** (mpf(1) / excess)
        assert slope(exact, system, tau, 1) == pytest.approx(order, abs=SLOPE_TOLERANCE)


# --- what the paper says about its methods ----------------------------------------------------------------------------


@EVERY_NIELSEN
def test_position_errors_vanish_exactly_up_to_the_harmonic_order(name):
    # 1e-70 is 76 printed decimals, times 7! and the number of products in a term; the next term is no rounding error.
    tableau = integrators[name]
    errors = kappa(tableau, tableau.harmonic_order + 1)
    assert max(errors[:-1]) < 1e-70
    assert errors[-1] > 1e-4


@EVERY_NIELSEN
def test_with_exchanged_roles_the_even_harmonic_order_is_left(name):
    tableau = integrators[name]
    even = 2 * (tableau.harmonic_order // 2)
    errors = kappa(tableau, even + 1, first=other(tableau))
    assert max(errors[:-1]) < 1e-70
    assert errors[-1] > 1e-4


@pytest.mark.parametrize(
    ("system", "tau"),
    [("henon_heiles", "0.25"), ("kepler", "44")],  # Kepler: 48 steps an orbit, 240 evaluations
)
def test_abas5o6h_applied_as_table_prints_it_is_ten_times_worse(system, tau):
    tableau = integrators["abas5o6h"]
    with mp.workdps(30):
        declared, literal = (
            max(energy_errors(tableau.role(first), systems[system], mpf(tau), 48)) for first in ("drift", "kick")
        )
    assert literal > 10 * declared


@pytest.mark.parametrize("name", ["ruth", "s5odr4"])
def test_compositions_of_leapfrog_agree_with_their_closed_form(name):
    tableau = integrators[name]
    with mp.workdps(100):
        w, u = 1 / (2 - cbrt(2)), 1 / (4 - cbrt(4))
        weights = {"ruth": [w, 1 - 2 * w, w], "s5odr4": [u, u, 1 - 4 * u, u, u]}[name]
        halves = [(a + b) / 2 for a, b in zip([0, *weights], [*weights, 0], strict=True)]
        for printed, exact in zip(tableau.kick + tableau.drift, weights + halves, strict=True):
            assert abs(mpf(printed) - exact) <= mpf(10) ** -tableau.digits


# --- declared orders of registered tableaus, proved exactly from their printed coefficients to their digits -----------


def declaring(attribute):
    return pytest.mark.parametrize(
        "name", [name for name, tableau in integrators.items() if getattr(tableau, attribute) is not None]
    )


@pytest.mark.slow
@EVERY
def test_declared_order_holds_for_systems_tableau_is_for(name):
    tableau = integrators[name]
    if tableau.requires is None:
        assert theory.order_of(tableau) == tableau.order
        assert theory.nystrom_order_of(tableau) >= tableau.order
    else:
        assert theory.nystrom_order_of(tableau) == tableau.order
        # A tableau asks for quadratic kinetic energy only if it needs it.
        assert theory.order_of(tableau) < tableau.order


@declaring("harmonic_order")
def test_the_declared_harmonic_order_is_that_of_the_position(name):
    assert theory.harmonic_order(name) == integrators[name].harmonic_order


@declaring("generalised_order")
def test_declared_generalised_order_holds_with_kick_as_small_part(name):
    tableau = integrators[name]
    assert theory.generalised_order_of(name, quadratic=tableau.requires is not None) == tableau.generalised_order


@EVERY
def test_a_harmonic_order_is_no_smaller_than_the_order(name):
    assert min(theory.harmonic_orders_of(name)) >= integrators[name].order


@EVERY_METHOD
def test_the_leading_error_stands_out_from_what_the_digits_leave(name):
    # The smallest so far are 4e-9; a vanishing condition leaves less than 1e-24 of any set with 26 digits or more, and
    # sets with fewer are of order two, which is a matter of their sums.
    assert all(error.norm > 1e-12 for error in theory.leading_errors(name))
    assert theory.leading_errors(name).general.degree == theory.order_of(name) + 1


@EVERY
def test_a_wrong_digit_ten_places_before_the_last_is_found(name):
    # Ten: what the size of the coefficients and the number of products may hide.
    tableau = integrators[name]
    rows = {}
    for key in ("kick", "drift"):
        with localcontext(prec=200):
            row = [Decimal(c) for c in getattr(tableau, key)]
            step = Decimal(1).scaleb(10 - tableau.digits)
            for i, sign in ((0, 1), (1, -1)) if (len(row) > 3 if tableau.symmetric else key == "kick") else ():
                row[i] += sign * step
                if tableau.symmetric:
                    row[-1 - i] += sign * step
            rows[key] = tuple(map(str, row))
    forged = replace(tableau, **rows, label="forged")
    assert max(theory.order_of(forged), theory.nystrom_order_of(forged)) == 1 + tableau.symmetric


@pytest.mark.slow
def test_overview_has_row_and_declarations_of_each_method():
    header, rows = overview()
    assert [row[0] for row in rows] == list(integrators)
    for row in rows:
        cells, tableau = dict(zip(header, row, strict=True)), integrators[row[0]]
        assert cells["stages"] == tableau.stages
        assert cells["composition"] == {"drift": "ABA", "kick": "BAB"}[tableau.first]
        assert cells["order" if tableau.requires is None else "Nystrom order"] == tableau.order
        assert cells["guaranteed digits"] == tableau.digits
        negative = sum(text.startswith("-") for text in tableau.kick + tableau.drift)
        assert cells["negative coefficients"] == negative
        size = sum(abs(float(c)) for c in tableau.kick + tableau.drift)
        assert cells["sum of absolute values"] == pytest.approx(size)
        assert len(cells["stability limit"].partition(".")[2]) == 12


def test_overview_can_be_asked_for_some_methods_in_order():
    header, rows = overview("babps9o7h", "ruth")
    assert [row[0] for row in rows] == ["babps9o7h", "ruth"]
    assert dict(zip(header, rows[1], strict=True))["first gap closes"] == "inf"


TABLEAU = """
import nearharmonic as nh
TABLEAU = nh.Tableau(
    name="mine", order={order}, first="kick", kick={kick}, drift=("0.5", "0.5"), digits=15, source="here", {more}
)
"""


@pytest.mark.parametrize(("order", "more"), [(4, ""), (3, ""), (3, 'requires="quadratic kinetic energy"')])
def test_users_tableau_of_lower_order_than_it_declares_is_refused(tmp_path, order, more):
    """Two leapfrogs are of order 2."""
    (tmp_path / "own.py").write_text(TABLEAU.format(order=order, kick=("0.25", "0.5", "0.25"), more=more))
    kind = "a quadratic kinetic energy" if more else "every separable H"
    words = f"the integrator 'mine' declares order {order}, and its coefficients, of 15 digits, have order 2 for {kind}"
    with pytest.raises(TableauError, match=f"own.py: {words}$"):
        load_tableaus(tmp_path / "own.py")
    with pytest.raises(TableauError, match=words):
        nh.integrate("sho", str(tmp_path / "own.py"), 0.1)


def test_users_tableau_of_order_that_it_declares_is_loaded(tmp_path):
    (tmp_path / "own.py").write_text(TABLEAU.format(order=2, kick=("0.25", "0.5", "0.25"), more=""))
    assert load_tableaus(tmp_path / "own.py")["mine"].order == 2


# --- the ten methods for expensive proofs in README's command: one of each registered kind ----------------------------


#: Each tells methods apart; the ten have all of its values, orders of eight and more counted as one.
KINDS = (
    lambda tableau: tableau.symmetric,
    lambda tableau: tableau.first,
    lambda tableau: tableau.requires,
    lambda tableau: tableau.benchmarked,
    lambda tableau: tableau.harmonic_order is None,
    lambda tableau: tableau.generalised_order is None,
    lambda tableau: tableau.order % 2,
    lambda tableau: min(tableau.order // 2, 4),
    lambda tableau: tableau.digits < 18,
    lambda tableau: tableau.name.startswith("trained_"),
    lambda tableau: any(text.startswith("-") for text in tableau.kick + tableau.drift),
)


def test_the_ten_methods_are_ten_and_of_every_registered_kind():
    assert len(TEN_METHODS) == 10
    ten = [registered[name] for name in TEN_METHODS]
    for kind in KINDS:
        assert {kind(tableau) for tableau in ten} == {kind(tableau) for tableau in registered.values()}

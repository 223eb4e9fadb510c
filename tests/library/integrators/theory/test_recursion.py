"""Tables 1 to 3 of the paper, recursion and closed sums, against products of 2x2 matrices of polynomials in tau."""

import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from numpy.polynomial.polynomial import polyadd, polymul

from nearharmonic.errors import SettingError, TableauError
from nearharmonic.integrators import plain_integrators as integrators
from nearharmonic.theory.order import closed_sums, momentum_row, position_rows
from nearharmonic.theory.oscillator import kappa, lambda_max, zeta
from nearharmonic_paper.experiments.paper.tableaus import even_orders, recursion_symbols, recursion_values, structure
from support.methods.ten_methods import EVERY_METHOD, thinned
from support.oracles.random_tableaus import tableaus
from support.oracles.word_series import operators_of

ROLES = pytest.mark.parametrize("first", ["drift", "kick"])
PAIRS = [(name, first) for name in integrators for first in ("drift", "kick")]
#: The last line of Table 2 divides by the last drift, which is 0 if the last coefficient of the drifts is padding.
WITH_LAST_DRIFT = pytest.mark.parametrize(
    ("name", "first"), thinned(pair for pair in PAIRS if Fraction(integrators[pair[0]].role(pair[1]).drift[-1]))
)


def matrix_product(X, Y):
    return [[polyadd(polymul(X[i][0], Y[0][j]), polymul(X[i][1], Y[1][j])) for j in (0, 1)] for i in (0, 1)]


def matrices_after_each_drift(tableau):
    """The products of shears up to each drift, and the whole step, as 2x2 matrices of polynomials in tau."""
    one, zero = np.array([Fraction(1)]), np.array([Fraction(0)])
    product, after = [[one, zero], [zero, one]], []
    for letter, c in operators_of(tableau):
        drift = letter == "A"
        product = matrix_product([[one, [0, c] if drift else zero], [zero if drift else [0, -c], one]], product)
        after += [product] * drift
    return after, product


def merged(from_q, from_p, length):
    """Coefficients by power of the sum of two polynomials, of which no others are left."""
    total = polyadd(from_q, from_p)
    assert not any(total[length:])
    return [*total, *[0] * length][:length]


def other(first):
    return "kick" if first == "drift" else "drift"


# --- the recursion ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
@given(tableaus())
def test_each_recursion_row_is_product_of_matrices(tableau):
    assume(all(map(Fraction, tableau.drift)))
    after, _ = matrices_after_each_drift(tableau)
    rows = position_rows(tableau)
    assert len(rows) == len(after) + 1
    for row, product in zip(rows[1:], after, strict=True):
        assert row == merged(*product[0], lambda_max(tableau) + 1)


@pytest.mark.slow
@given(tableaus())
def test_momentum_of_recursion_is_that_of_whole_step(tableau):
    assume(all(map(Fraction, tableau.drift)))
    _, step = matrices_after_each_drift(tableau)
    assert momentum_row(tableau) == merged(*step[1], lambda_max(tableau, variable="momentum") + 1)


@pytest.mark.slow
@given(tableaus())
def test_zeta_is_step_from_one_and_minus_one_by_order(tableau):
    _, step = matrices_after_each_drift(tableau)
    for variable, (from_q, from_p) in zip(("position", "momentum"), step, strict=True):
        found = zeta(tableau, variable=variable)
        assert len(found) == lambda_max(tableau, variable=variable) + 1
        assert list(found) == merged(from_q, -from_p, len(found))


@EVERY_METHOD
def test_momentum_of_one_composition_errs_as_position_of_other(name):
    # Exchanging q and p (and the sign of time) turns kicks into drifts: kappa must not know the difference.
    tableau = integrators[name]
    highest = 2 * tableau.stages + 2
    swapped = tableau.role(other(tableau.first))
    assert kappa(tableau, highest, variable="momentum") == kappa(swapped, highest)


def test_a_variable_other_than_position_and_momentum_is_refused():
    with pytest.raises(SettingError, match=r"variable = 'energy' is not allowed: it is 'position' or 'momentum'"):
        zeta("ruth", variable="energy")


@pytest.mark.parametrize("function", [position_rows, momentum_row])
def test_a_drift_of_zero_is_named(function):
    tableau = replace(integrators["ruth"], drift=("0", "0.5", "0.5", "0"), order=1)
    with pytest.raises(TableauError, match=r"tableau 'ruth': drift\[0\] = 0, by which"):
        function(tableau)


# --- the closed sums -------------------------------------------------------------------------------------------------


@pytest.mark.slow
@given(tableaus())
def test_closed_sums_have_orders_zero_two_four_with_equation_16(tableau):
    after, _ = matrices_after_each_drift(tableau)
    for sums, product in zip(closed_sums(tableau)[1:], after, strict=True):
        from_q = [*product[0][0], *[0] * 5]
        assert [sums.tau0, sums.tau2, sums.tau4] == from_q[0:5:2]


@given(tableaus())
def test_upper_limit_printed_in_table_3_gives_row_above(tableau):
    sums = closed_sums(tableau)
    assert [row.tau4_as_printed for row in sums[1:]] == [row.tau4 for row in sums[:-1]]


@pytest.mark.parametrize("name", thinned(name for name, one in integrators.items() if one.order >= 4 and one.symmetric))
@ROLES
def test_only_upper_limit_of_equation_16_gives_fourth_order(name, first):
    last = closed_sums(name, first=first)[-1]
    # Printed digits, less five for the few hundred products in a sum and for their size.
    allowed = Fraction(1, 10 ** (integrators[name].digits - 5))
    assert abs(last.tau2 + Fraction(1, 2)) < allowed
    assert abs(last.tau4 - Fraction(1, 24)) < allowed
    assert abs(last.tau4_as_printed - Fraction(1, 24)) > Fraction(1, 1000)


# --- the tables ------------------------------------------------------------------------------------------------------


def evaluated(cell, names):
    """A cell of Table 2 in exact arithmetic: juxtaposition multiplies, names and Q[h,l] are looked up."""
    text = re.sub(r"(?<=[\w\])]) (?=[A-Za-z(])", " * ", cell.replace(" / m", ""))
    return eval(text, {"__builtins__": {}}, names)


@WITH_LAST_DRIFT
def test_table_2_in_symbols_evaluates_to_product_of_matrices(name, first):
    tableau = integrators[name].role(first)
    after, step = matrices_after_each_drift(tableau)
    c, d = list(map(Fraction, tableau.drift)), list(map(Fraction, tableau.kick))
    before = d if tableau.first == "kick" else [Fraction(0), *d]
    names = {"q_a": Fraction(1), "p_a": Fraction(1), "Q": {}}
    names["Qbar"] = names["Q"]
    for h, drift in enumerate(c, start=1):
        names |= {f"c_{h}": drift, f"d_{h}": before[h - 1], f"D_{h}": -drift * before[h - 1]}
        if h > 1:
            ratio = drift / c[h - 2]
            names |= {f"C_{h}": ratio, f"Cbar_{h}": 1 + ratio}
    names[f"d_{len(c) + 1}"] = d[-1]
    _, rows = recursion_symbols(name, first=first)
    for h, *cells in rows[:-1]:
        for power, cell in enumerate(cells):
            if cell:
                names["Q"][h, power] = evaluated(cell, names)
    for h, product in enumerate(after, start=1):
        width = 1 + max(power for row, power in names["Q"] if row == h)
        assert [names["Q"][h, power] for power in range(width)] == merged(*product[0], width)
    momentum = [evaluated(cell, names) for cell in rows[-1][1:] if cell]
    assert momentum == merged(*step[1], len(momentum))


@WITH_LAST_DRIFT
def test_table_2_numbers_are_rounded_once_at_their_symbols(name, first):
    tableau = integrators[name].role(first)
    after, step = matrices_after_each_drift(tableau)
    header, rows = recursion_values(name, first=first)
    assert header == ("h", *(f"tau^{n}" for n in range(2 * tableau.stages + 2)))
    for (h, *cells), exact in zip(rows[1:], [*(m[0] for m in after), step[1]], strict=True):
        numbers = [cell for cell in cells if cell != ""]
        assert numbers == [float(x) for x in merged(*exact, len(numbers))], h
    _, symbols = recursion_symbols(name, first=first)
    assert [[cell == "" for cell in row] for row in rows] == [[cell == "" for cell in row] for row in symbols]


def test_last_drift_of_zero_is_refused_by_recursion_for_momentum():
    with pytest.raises(TableauError, match=r"drift\[3\] = 0, by which Eq. 6 divides"):
        momentum_row("ruth_s3o3", first="drift")


@EVERY_METHOD
@ROLES
def test_table_3_agrees_with_table_2(name, first):
    header, rows = even_orders(name, first=first)
    for row in rows:
        cells = dict(zip(header, row, strict=True))
        assert cells["tau^2"] == cells["tau^2 of Table 2"]
        assert cells["tau^4"] == cells["tau^4 of Table 2"]
    assert cells["h"] == len(integrators[name].role(first).drift)


@EVERY_METHOD
def test_table_1_names_coefficients_that_are_equal(name):
    header, rows = structure(name)
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    assert len(rows) == integrators[name].stages + 1
    for symbols, values in ((columns[key], columns[f"{key} value"]) for key in header[1::2]):
        for i, (text, value) in enumerate(zip(symbols, values, strict=True), start=1):
            left, _, right = text.partition(" = ")
            assert left == f"{left[0]}_{i}"
            assert value == (values[int(right.split("_")[1]) - 1] if "_" in right else right or value)
    assert columns["ABA d value"][-1] == columns["BAB c value"][-1] == "0"
    own = "ABA" if integrators[name].first == "drift" else "BAB"
    assert columns[f"{own} d value"][: len(integrators[name].kick)] == integrators[name].kick

"""Error terms and energy errors on the oscillator against closed forms, and Table 4."""

from dataclasses import replace
from itertools import product
from math import inf, prod

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import cos, mp, mpf, sin, taylor

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.integrators import BENCHMARKED, integrators, plain_integrators
from nearharmonic.theory.oscillator import harmonic_energy_error, kappa, lambda_max, stability_trace, step_polynomials
from nearharmonic.theory.table_4 import TABLEAUS, independent, table_4
from nearharmonic_paper.experiments.stability.reductions import KNOWN_LIMITS
from support.oracles.random_tableaus import tableaus
from support.oracles.reference_solutions import oscillator_step
from support.oracles.word_series import operators_of

TEN = pytest.mark.parametrize("name", BENCHMARKED)
ROLES = pytest.mark.parametrize("first", ["drift", "kick"])


def step(tableau, tau, q, p, number):
    """One step of the harmonic oscillator from (q, p), in the arithmetic of ``number``."""
    for letter, c in operators_of(tableau, number):
        q, p = (q + c * tau * p, p) if letter == "A" else (q, p - c * tau * q)
    return q, p


def value(polynomial, tau):
    return sum(coefficient * tau**power for power, coefficient in enumerate(polynomial))


# --- the step matrix -------------------------------------------------------------------------------------------------


@pytest.mark.slow
@given(tableaus(), st.fractions(-3, 3, max_denominator=50))
def test_a_step_is_symplectic_and_runs_back(tableau, tau):
    K11, K12, K21, K22 = (value(polynomial, tau) for polynomial in step_polynomials(tableau))
    assert K11 * K22 - K12 * K21 == 1
    back = tuple(value(polynomial, -tau) for polynomial in step_polynomials(tableau))
    assert back == (K22, -K12, -K21, K11)


@pytest.mark.slow
@given(tableaus())
def test_exchanging_roles_keeps_even_orders_exactly_and_exchanges_odd_ones(tableau):
    # Why lines and circles of the paper's Fig. 2 meet at even orders.
    own, other = (
        step_polynomials(tableau),
        step_polynomials(tableau, first={"drift": "kick"}.get(tableau.first, "drift")),
    )
    assert other.K11 == own.K11 == own.K22
    assert [-c for c in other.K12] == list(own.K21)


@given(tableaus())
def test_highest_term_is_product_of_all_coefficients_at_lambda_max(tableau):
    K, highest = step_polynomials(tableau), lambda_max(tableau)
    zeta = [a - b for a, b in zip(K.K11, K.K12, strict=True)]
    assert all(c == 0 for c in zeta[highest + 1 :])
    coefficients = [c for _, c in operators_of(tableau)]
    reaching_q = coefficients if tableau.first == "drift" else coefficients[:-1]
    assert abs(zeta[highest]) == abs(prod(reaching_q))


# --- kappa -----------------------------------------------------------------------------------------------------------


@TEN
@ROLES
def test_kappa_is_taylor_coefficient_of_position_after_one_step(name, first):
    tableau = integrators[name].role(first)
    highest = lambda_max(tableau)
    steps = taylor(lambda tau: step(tableau, tau, mpf(1), mpf(-1), mpf)[0], 0, highest)
    exact = taylor(lambda t: cos(t) - sin(t), 0, highest)
    for power, error in enumerate(kappa(name, highest, first=first), start=1):
        scale = mp.factorial(power)
        # Numerical differentiation to 40 digits; what cancels is as large as the larger of the two terms.
        size = scale * (abs(steps[power]) + abs(exact[power]))
        assert abs(error - scale * abs(steps[power] - exact[power])) < size * mpf(10) ** -30


@TEN
@ROLES
def test_no_term_of_the_step_is_left_beyond_lambda_max(name, first):
    highest = lambda_max(name, first=first)
    assert highest == 2 * integrators[name].stages + (first == "drift")
    assert kappa(name, highest + 3, first=first)[highest:] == [1, 1, 1]
    assert kappa(name, highest, first=first)[-1] != 1


@TEN
def test_compositions_agree_at_even_orders_and_nowhere_else(name):
    highest = 2 * integrators[name].stages
    drift, kick = (kappa(name, highest, first=first) for first in ("drift", "kick"))
    assert drift[1::2] == kick[1::2]
    apart = [abs(a - b) / (a + b) for a, b in zip(drift[0::2], kick[0::2], strict=True) if a + b > 1e-30]
    assert apart
    assert min(apart) > 1e-4


def test_kappa_takes_name_or_tableau_and_its_own_role():
    tableau = integrators["babs7o7h"]
    assert kappa("babs7o7h", 9) == kappa(tableau, 9) == kappa(tableau, 9, first="kick")
    assert kappa("babs7o7h", 9) != kappa(tableau, 9, first="drift")


def test_kappa_keeps_ten_guard_digits_in_any_working_precision():
    # kappa_8 of this method is 1e-3, so that 86 digits are 1e-89 of it; the reference is the step matrix, exact.
    zeta = step_polynomials("babps9o7h").K11[8]
    with mp.workdps(15):
        rounded = kappa("babps9o7h", 8)[7]
    with mp.workdps(150):
        exact = abs(1 - mp.factorial(8) * mpf(zeta.numerator) / zeta.denominator)
        assert abs(rounded - exact) < exact * mpf(10) ** -86


@pytest.mark.parametrize("highest", [0, -1, 2.0, True, "7", None])
def test_a_highest_order_below_one_or_no_integer_is_refused(highest):
    with pytest.raises(SettingError, match=r"highest = .* is not allowed: an integer >= 1"):
        kappa("ruth", highest)


# --- closed forms ----------------------------------------------------------------------------------------------------


ASYMMETRIC = [name for name, tableau in plain_integrators.items() if not tableau.symmetric]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "first", "tau_per_stage"),
    [
        *product(BENCHMARKED, [None], [0.02, 0.1, 0.3]),
        *product([*ASYMMETRIC, "ruth", "babps8o7h"], ["drift", "kick"], [0.12]),
    ],
)
def test_the_closed_form_is_the_maximum_over_many_steps(name, first, tau_per_stage):
    # 4000 steps come within about pi/4000 of the angle of the maximum: short of it by 1e-6.
    tableau = integrators[name].role(first)
    tau = tau_per_stage * tableau.stages
    expected, K = harmonic_energy_error(tableau, tau), oscillator_step(tableau, mpf(tau))
    q, p, largest = mpf(1), mpf(0), mpf(0)
    for _ in range(4000):
        q, p = K[0, 0] * q + K[0, 1] * p, K[1, 0] * q + K[1, 1] * p
        largest = max(largest, abs(q * q + p * p - 1))
    if expected == inf:
        assert largest > 1e3
    else:
        assert largest == pytest.approx(float(expected), rel=1e-5)
        assert largest <= expected * (1 + mpf(10) ** -12)


#: Ends of the first gaps, known to 4 or 5 decimals; None where none is known. Their starts are known to 9.
ENDS = {
    "ruth": inf, "s5odr4": None, "aba104": 3.2005, "aba864": 3.1738, "aba1064": 3.1539, "yoshida_s7o6a": 2.3278,
    "abas5o6h": 3.2201, "babs7o7h": 3.14152, "babps8o7h": 3.14288, "babps9o7h": 3.14217,
}  # fmt: skip


@TEN
def test_first_stability_gap_has_known_edges(name):
    # Within one unit of the last decimal.
    start, end = float(KNOWN_LIMITS[name]), ENDS[name]
    for tau, stable in ((start - 1e-9, True), (start + 1e-9, False)):
        assert (abs(stability_trace(name, tau)) <= 2) == stable
        assert (harmonic_energy_error(name, tau) < inf) == stable
    if end == inf:
        assert all(abs(stability_trace(name, start * 1.01**n)) > 2 for n in range(1, 400))
    elif end is not None:
        assert abs(stability_trace(name, end - 1e-4)) > 2
        assert abs(stability_trace(name, end + 1e-4)) <= 2


@TEN
def test_trace_of_small_step_is_that_of_exact_rotation(name):
    # The phase error of an order-4 method is O(tau^5): of the trace, O(tau^6), with constants below 1e3 / 6!.
    assert abs(stability_trace(name, mpf("1e-4")) - 2 * cos(mpf("1e-4"))) < mpf("1e-23")


@pytest.mark.parametrize("tau", [0, -0.1, inf, float("nan"), "quick", None])
def test_step_size_must_be_finite_and_positive(tau):
    with pytest.raises(SettingError, match=r"tau = .* is not allowed: a finite number above 0"):
        harmonic_energy_error("ruth", tau)


# --- Table 4 ----------------------------------------------------------------------------------------------------------


def test_table_4_prints_the_paper_s_independent_coefficients():
    """Counted in the paper: 4 each for five stages, 5 for six, 6 for seven, 7 for eight, 8 for nine."""
    header, rows = table_4()
    assert header == ("set", "coefficient", "printed")
    assert len(rows) == 3 * 4 + 3 * 5 + 2 * 6 + 7 + 8
    assert rows[0] == (
        "ABAs5o6H",
        "d(1)",
        "0.1558593591762168313166117535752091422239663993391011462498104831549442591694",
    )
    assert rows[-1][1] == "c(4)"


def test_every_set_of_the_paper_is_in_the_table():
    assert {one.name for one in TABLEAUS} == {name for name, t in nh.integrators.items() if "1501.04345" in t.source}


def test_a_derived_value_stands_beside_the_printed_one():
    tableau = nh.integrators["babs7o7h"]
    header, rows = table_4({"babs7o7h": replace(tableau, label="found")})
    assert header[-1] == "agreeing decimals"
    mine = [row for row in rows if row[0] == "BABs7o7H"]
    assert [row[2] for row in mine] == [value for _, _, value in independent(tableau)]
    assert {row[4] for row in mine} == {76}
    assert {row[4] for row in rows if row[0] != "BABs7o7H"} == {"not derived"}

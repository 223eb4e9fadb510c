"""Methods from the literature: printed decimals, and published statements on the methods."""

from dataclasses import replace
from fractions import Fraction
from itertools import chain

import pytest
from mpmath import eye, factorial, inverse, log, matrix, mp, mpf, norm, sqrt

import nearharmonic as nh
from nearharmonic.engine.settings import check_fit
from nearharmonic.errors import SettingError
from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic.systems import systems
from support.methods.tableau_files import names, verdict
from support.oracles.multiprecision import energy_errors, trajectory

from .printed import PRINTED, PRINTED_LAMBDA, ROUNDING, WEIGHTS

#: States on which no error term vanishes by chance.
STATE = {
    "henon_heiles": ([mpf("0.3"), mpf("0.1")], [mpf("0.2"), mpf("0.4")]),
    "relativistic_oscillator": ([mpf("0.3")], [mpf("0.7")]),
}


def slope(tableau, system):
    """Observed order of the energy error, in mpmath's current precision."""
    tau, steps = mpf(2) ** -8, 16
    coarse = max(energy_errors(tableau, systems[system], tau, steps, STATE[system]))
    fine = max(energy_errors(tableau, systems[system], tau / 2, 2 * steps, STATE[system])[1::2])
    return log(coarse / fine, 2)


# --- commutators of degree 5 ------------------------------------------------------------------------------------------

#: Right-nested commutators [x, [y, [z, [A, B]]]] that span degree 5 (Omelyan et al. 2003), A a drift and B a kick.
COMMUTATORS = ("AAA", "AAB", "BAA", "BBA", "ABB", "BBB")
#: Those that vanish for quadratic kinetic energy: [B, [B, [A, B]]] = 0 there.
VANISHING = ("ABB", "BBB")
LYNDON_5 = ("AAAAB", "AAABB", "AABAB", "AABBB", "ABABB", "ABBBB")


def commutator(letters):
    """The words of [x, [y, ... [A, B]]] with their signs."""
    element = {"AB": 1, "BA": -1}
    for x in reversed(letters):
        expanded = {}
        for word, c in element.items():
            expanded[x + word] = expanded.get(x + word, 0) + c
            expanded[word + x] = expanded.get(word + x, 0) - c
        element = expanded
    return element


def to_commutators():
    """The matrix that turns coefficients of Lyndon words into coefficients of COMMUTATORS."""
    return inverse(matrix([[commutator(c).get(word, 0) for c in COMMUTATORS] for word in LYNDON_5]))


def coefficient(operators, word):
    """Coefficient of ``word`` in the product of the exponentials exp(c X) of ``operators`` (X, c)."""
    read = [mpf(1)] + [mpf(0)] * len(word)
    for letter, c in operators:
        for end in range(len(word), 0, -1):
            run = next((k for k in range(end) if word[end - 1 - k] != letter), end)
            read[end] += sum(read[end - k] * c**k / factorial(k) for k in range(1, run + 1))
    return read[-1]


def operators_of(tableau, halves=None):
    """Operators of a step; with ``halves`` (outer, inner) instead of the tableau's first half rows."""
    letters = "AB" if tableau.first == "drift" else "BA"
    outer, inner = halves or half_rows(tableau)
    rows = [
        [half[min(i, n - 1 - i)] for i in range(n)]
        for half, n in ((outer, tableau.stages + 1), (inner, tableau.stages))
    ]
    return [(letters[i % 2], rows[i % 2][i // 2]) for i in range(2 * tableau.stages + 1)]


def half_rows(tableau):
    return [list(map(mpf, row[: (len(row) + 1) // 2])) for row in (tableau.outer, tableau.inner)]


def error_norm(operators, left_out=()):
    """Euclidean norm of the commutators of degree 5 in the logarithm of a symmetric step of order 4."""
    errors = matrix([coefficient(operators, word) - mpf(1) / 120 for word in LYNDON_5])
    gamma = to_commutators() * errors
    return sqrt(sum(g**2 for name, g in zip(COMMUTATORS, gamma, strict=True) if name not in left_out))


def steepness(function, constraints, point):
    """Rate of change of ``function`` along the level set of ``constraints``: norm of its projected gradient."""
    step = mpf(10) ** -20
    shifted = [[x + step * (i == j) for i, x in enumerate(point)] for j in range(len(point))]
    here = [function(point), *constraints(point)]
    columns = [[(b - a) / step for a, b in zip(here, [function(x), *constraints(x)], strict=True)] for x in shifted]
    gradient = matrix([column[0] for column in columns])
    normals = matrix([column[1:] for column in columns])
    projection = eye(len(point)) - normals * inverse(normals.T * normals) * normals.T
    return norm(projection * gradient)


# --- what is printed --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PRINTED)
def test_the_coefficients_round_to_the_printed_ones(name):
    tableau = integrators[name]
    with mp.workdps(90):
        for row, printed in zip((tableau.outer, tableau.inner), PRINTED[name], strict=True):
            for value, text in zip(row, printed, strict=False):
                last = mpf(10) ** -len(text.partition(".")[2])
                assert abs(mpf(value) - mpf(text)) <= ROUNDING.get(name, 0.5) * last
        if name in PRINTED_LAMBDA:
            text = PRINTED_LAMBDA[name]
            assert abs(mpf(tableau.inner[1]) - mpf(text)) <= mpf(10) ** -len(text.partition(".")[2]) / 2


@pytest.mark.parametrize("name", WEIGHTS)
def test_a_composition_agrees_with_leapfrog_steps_of_the_printed_weights(name):
    # A weight off by half a unit of its last decimal moves a state of size 1 by no more; there are fifteen at most.
    weights = [*WEIGHTS[name], *WEIGHTS[name][-2::-1]]
    last = max(mpf(10) ** -len(w.partition(".")[2]) for w in weights if len(w) > 10)
    with mp.workdps(50):
        system, state = systems["henon_heiles"], STATE["henon_heiles"]
        (q, p) = trajectory(integrators[name], system, mpf("0.1"), 1, state)[-1]
        for weight in weights:
            state = trajectory(integrators["leapfrog"].role("drift"), system, mpf(weight) / 10, 1, state)[-1]
        assert max(abs(x - y) for x, y in zip(q + p, state[0] + state[1], strict=True)) < 8 * last
        assert slope(integrators[name], "henon_heiles") == pytest.approx(integrators[name].order, abs=0.05)


def test_mclachlans_methods_have_their_closed_forms():
    with mp.workdps(90):
        a, b = sqrt(mpf(471)), sqrt(mpf(19))
        closed = {
            "mclachlan_s4": ([(642 + a) / 3924, 121 * (12 - a) / 3924], [mpf(6) / 11, mpf(-1) / 22]),
            "mclachlan_s5": ([(14 - b) / 108, (20 - 7 * b) / 108, (5 + 2 * b) / 27], [mpf(2) / 5, mpf(-1) / 10]),
            "mclachlan_sb3a4": ([], [mpf(1), mpf(-1) / 2]),
            "mclachlan_sb3a5": ([], [mpf(-3) / 73, mpf(17) / 59, mpf(2179) / 4307]),
        }
        for name, rows in closed.items():
            for printed, exact in zip((integrators[name].outer, integrators[name].inner), rows, strict=True):
                assert all(abs(mpf(x) - y) <= mpf(10) ** -78 for x, y in zip(printed, exact, strict=False))


@pytest.mark.parametrize("name", [name for name in names("published") if name in integrators])
def test_digits_are_those_of_file_that_was_copied_apart(name):
    file, tableau = verdict("published", name).file, integrators[name]
    kick = tableau.kick if tableau.symmetric else tableau.kick[:-1]  # which is padded
    assert (file.kick, file.drift, file.first) == (kick, tableau.drift, tableau.first)
    assert file.order == tableau.order


@pytest.mark.parametrize(
    "name", ["teloy_8a17c", *(name for name, tableau in integrators.items() if "leapfrog steps" in tableau.note)]
)
def test_composition_of_leapfrogs_has_half_sums_of_its_weights_outside(name):
    """Teloy's 8A17 are none, so that this can fail."""
    tableau = integrators[name]
    inner = [Fraction(0), *map(Fraction, tableau.inner), Fraction(0)]
    off = [abs(2 * Fraction(c) - a - b) for c, a, b in zip(tableau.outer, inner[:-1], inner[1:], strict=True)]
    assert (max(off) <= Fraction(4, 10**tableau.digits)) is (name != "teloy_8a17c")


# --- what their authors chose the free parameters by ------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "left_out", "other"),
    [
        ("pefrl", VANISHING, ()), ("vefrl", VANISHING, ()), ("omelyan_p5", VANISHING, ()),
        ("omelyan_v5", VANISHING, ()), ("efrl", (), VANISHING),
    ],
)  # fmt: skip
def test_the_parameters_of_omelyan_make_the_error_norm_least(name, left_out, other):
    # A parameter rounded at 1e-16 leaves a slope of 1e-16 times the second derivative, which is below 100.
    tableau, split = integrators[name], len(half_rows(integrators[name])[0])

    def step(point):
        return operators_of(tableau, (point[:split], point[split:]))

    def conditions(point):
        return [coefficient(step(point), word) for word in ("A", "B", "AAB", "ABB")]

    with mp.workdps(60):
        point = [*chain.from_iterable(half_rows(tableau))]
        assert steepness(lambda x: error_norm(step(x), left_out), conditions, point) < 1e-14
        assert steepness(lambda x: error_norm(step(x), other), conditions, point) > 1e-4


def test_largest_weight_of_s9odr6a_is_minimal():
    def coefficient_of_orders(weights, word):
        """Coefficient of a word in the generators Y1, Y3, Y5 of a leapfrog step exp(w Y1 + w^3 Y3 + ...)."""
        read = [mpf(1)] + [mpf(0)] * len(word)
        for w in [*weights, *weights[-2::-1]]:
            for end in range(len(word), 0, -1):
                for k in range(1, end + 1):
                    read[end] += read[end - k] * w ** sum(word[end - k : end]) / factorial(k)
        return read[-1]

    def conditions(weights):
        return [coefficient_of_orders(weights, word) for word in ((1,), (3,), (5,), (1, 1, 3))]

    with mp.workdps(60):
        weights = list(map(mpf, WEIGHTS["s9odr6a"]))
        assert max(map(abs, weights)) == weights[-1]
        # The minimum is flat: the first weight, printed to 26 decimals, is 4e-21 off it.
        assert steepness(lambda w: w[-1], conditions, weights) < 1e-17
        assert steepness(lambda w: w[0], conditions, weights) > 0.1


# --- error constants that others publish ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "efficiency"), [("ruth", "0.315"), ("efrl", "4.24"), ("s5odr4", "1.10"), ("blanes_moan_s6o4", "10.2")]
)
@pytest.mark.parametrize("first", ["drift", "kick"])
def test_efficiencies_for_any_separable_system_are_those_of_ostmeyer(name, efficiency, first):
    # Ostmeyer (2023), J. Phys. A 56, 285303, arXiv:2211.02691: 1/(s^4 norm), to three digits; roles do not matter.
    tableau = integrators[name].role(first)
    assert f"{float(1 / (tableau.stages**4 * error_norm(operators_of(tableau)))):.3g}" == efficiency.rstrip("0")


def test_pefrl_is_ten_times_as_efficient_as_forest_ruth():
    # The abstract of Omelyan et al. (2002); best roles of the others.
    def efficiency(name, first):
        tableau = integrators[name].role(first)
        return 1 / (tableau.stages**4 * error_norm(operators_of(tableau), VANISHING))

    ruth, suzuki = (max(efficiency(name, first) for first in ("drift", "kick")) for name in ("ruth", "s5odr4"))
    assert efficiency("pefrl", None) > 10 * ruth
    assert efficiency("pefrl", None) == pytest.approx(5 * suzuki, rel=0.2)


# --- Nystrom methods --------------------------------------------------------------------------------------------------

NYSTROM = [name for name, tableau in plain_integrators.items() if tableau.requires is not None]


@pytest.mark.slow
@pytest.mark.parametrize("name", NYSTROM)
def test_nystrom_method_loses_order_in_wrong_role_or_other_T(name):
    tableau = integrators[name]
    less = 4 if tableau.symmetric else 3
    wrong = "kick" if tableau.first == "drift" else "drift"
    with mp.workdps(60):
        order = nh.order_of(name, potential_degree=3)
        assert slope(tableau, "henon_heiles") == pytest.approx(order, abs=0.05)
        assert slope(replace(tableau.role(wrong), requires=None), "henon_heiles") == pytest.approx(less, abs=0.05)
        assert slope(tableau, "relativistic_oscillator") == pytest.approx(less, abs=0.05)


@pytest.mark.parametrize("name", ["srkn_b11", "srkn_a14"])
def test_plan_refuses_nystrom_method_where_kinetic_energy_is_not_quadratic(name):
    check_fit(systems["kepler"], integrators[name])
    with pytest.raises(SettingError, match=f"{name}.*quadratic kinetic energy"):
        check_fit(systems["relativistic_oscillator"], integrators[name])


@pytest.mark.parametrize(
    "name", ["srkn_b6", "mclachlan_sb3a4", "mclachlan_sb3a5", "pefrl", "vefrl", "omelyan_p5", "omelyan_v5"]
)
def test_quadratic_kinetic_energy_method_has_smaller_errors_in_own_role(name):
    tableau = integrators[name]
    own, other = (
        error_norm(operators_of(tableau.role(first)), VANISHING) for first in (tableau.first, _other(tableau))
    )
    assert own < other


def _other(tableau):
    return next(first for first in ("drift", "kick") if first != tableau.first)

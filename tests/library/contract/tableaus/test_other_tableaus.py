"""Methods with modified potentials, and asymmetric ones: proofs, integration, export and loading."""

from dataclasses import replace
from decimal import Decimal, localcontext
from math import isnan

import numpy as np
import pytest
from mpmath import eye, inf, mp, mpf

import nearharmonic as nh
from nearharmonic.errors import TableauError
from nearharmonic.exact.words import oscillator
from nearharmonic.exchange.files import export, read
from nearharmonic.exchange.verdict import Verdict
from nearharmonic.integrators import load_tableaus
from nearharmonic.integrators import plain_integrators as integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.theory.order import harmonic_orders_of, leading_errors, nystrom_order_of
from nearharmonic.theory.order_conditions import step_of
from nearharmonic.theory.oscillator import harmonic_energy_error, lambda_max, zeta
from support.oracles.multiprecision import trajectory
from support.oracles.reference_solutions import oscillator_step
from support.oracles.structures import structure

# --- declared orders of methods with modified potentials, proved from their printed coefficients ----------------------


EVERY = pytest.mark.parametrize("name", list(nh.modified_integrators))


@EVERY
def test_declared_order_is_one_proved_for_quadratic_kinetic_energy(name):
    tableau = nh.modified_integrators[name]
    assert nystrom_order_of(tableau) == nh.order_of(name) == tableau.order
    assert leading_errors(tableau).nystrom.degree == tableau.order + 1
    assert min(harmonic_orders_of(name)) >= tableau.order


@pytest.mark.parametrize(
    ("name", "key"),
    [
        (name, key)
        for name, one in nh.modified_integrators.items()
        for key in ("kick", "drift", "square")
        if key == "square" or len(getattr(one, key)) > 2  # the sum alone determines two that are equal
    ],
)
def test_a_wrong_digit_ten_places_before_the_last_is_found(name, key):
    tableau = nh.modified_integrators[name]
    with localcontext(prec=200):
        row = [Decimal(c) for c in getattr(tableau, key)]
        step = Decimal(1).scaleb(10 - tableau.digits)
        if key == "square":
            row = [x + step if x else x for x in row]
        else:
            count = len(row)
            row[0], row[-1] = row[0] + step, row[-1] + step
            row[count // 2] -= step if count % 2 == 0 else 2 * step
            if count % 2 == 0:
                row[count // 2 - 1] -= step
    forged = replace(tableau, **{key: tuple(map(str, row))}, name="forged")
    assert nystrom_order_of(forged) == 2


@EVERY
def test_without_the_square_the_order_is_two(name):
    tableau = nh.modified_integrators[name]
    assert nystrom_order_of(replace(tableau, square=("0",) * len(tableau.kick))) == 2


def step_matrix(tableau, tau):
    """The product of the matrices of a step, between its processor and the inverse."""
    step = oscillator_step(tableau, tau)
    behind = oscillator_step(tableau.processor, tau) if tableau.processed else eye(2)
    return behind * step * behind**-1


@EVERY
def test_step_matrices_on_the_oscillator_are_products_of_matrices(name):
    tau, K = mpf("0.7"), oscillator(step_of(nh.modified_integrators[name]))
    step = step_matrix(nh.modified_integrators[name], tau)
    for place, row in zip(((0, 0), (0, 1), (1, 0), (1, 1)), (K.K11, K.K12, K.K21, K.K22), strict=True):
        value = sum(mpf(c.numerator) / c.denominator * tau**n for n, c in enumerate(row))
        assert abs(value - step[place]) < mpf(10) ** -50


@pytest.mark.slow
@EVERY
def test_the_largest_stable_step_is_that_of_the_trace(name):
    tableau = nh.modified_integrators[name]
    limit = nh.stability_limit(name)
    K = oscillator(step_of(tableau))

    def trace(tau):
        return sum(float(a + b) * tau**n for n, (a, b) in enumerate(zip(K.K11, K.K22, strict=True)))

    assert abs(abs(trace(limit)) - 2) < 1e-9
    assert all(abs(trace(limit * (i + 0.5) / 200)) <= 2 for i in range(200))


def test_gradient_is_counted_where_kicks_of_neighbouring_steps_meet_too():
    tableau = nh.modified_integrators["chin_4a"]
    assert tableau.gradients == 1
    assert replace(tableau, square=("0.01", "0", "0.01")).gradients == 1
    assert replace(tableau, square=("0.01", "0.01", "0.01")).gradients == 2
    assert tableau.facts["gradients"] == 1


@EVERY
def test_error_terms_reach_to_the_highest_power_of_the_step(name):
    """The coefficients of the new position from q = -p = 1, as the derivatives of products of matrices."""
    tableau = nh.modified_integrators[name]
    highest, found = lambda_max(tableau), zeta(tableau)
    assert len(found) == highest + 1
    for tau in (mpf("0.3"), mpf("1.7")):
        value, step = (
            sum(mpf(c.numerator) / c.denominator * tau**n for n, c in enumerate(found)),
            step_matrix(tableau, tau),
        )
        assert abs(value - (step[0, 0] - step[0, 1])) < mpf(10) ** -45
    assert nh.kappa(tableau, highest + 2)[-2:] == [1, 1]
    assert nh.kappa(tableau, highest)[-1] != 1


# --- asymmetric methods: proofs, integration, export and loading, compared with symmetric ones ------------------------


ASYMMETRIC = [name for name, tableau in integrators.items() if not tableau.symmetric]
BOTH = pytest.mark.parametrize("name", [*ASYMMETRIC, "ruth", "babps8o7h"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ASYMMETRIC)
@pytest.mark.parametrize("precision", ["double", "extended"])
def test_the_kernel_takes_the_steps_of_a_plain_loop(name, precision):
    run = nh.integrate("henon_heiles", name, 0.125, t_end=5, samples=2, precision=precision)
    with mp.workdps(40):
        q, p = trajectory(integrators[name], nh.systems["henon_heiles"], mpf("0.125"), 40)[-1]
        found = [*run.q.values[-1], *run.p.values[-1]]
        # Forty steps of six kicks and drifts with compensated roundings of 1e-16, which the flow carries on.
        assert max(abs(mpf(float(a)) - b) for a, b in zip(found, [*q, *p], strict=True)) < 2e-15
    assert run.evaluations.item() == 40 * integrators[name].stages + 1


def test_energy_error_has_no_bound_beyond_limit_of_stability():
    limit = nh.stability_limit("ruth_s3o3")
    assert harmonic_energy_error("ruth_s3o3", limit * mpf("0.999")) < inf
    assert harmonic_energy_error("ruth_s3o3", limit * mpf("1.001")) == inf


def test_energy_error_has_no_bound_at_edge_of_stability():
    """The symplectic Euler method has the trace 2 - tau^2 = -2 at tau = 2, and the conserved form (p - q)^2."""
    euler = Tableau(name="euler", order=1, first="kick", kick=("1", "0"), drift=("1",), source="Euler", digits=50)
    assert harmonic_energy_error(euler, mpf("1.999")) < inf
    assert harmonic_energy_error(euler, mpf(2)) == inf


@BOTH
def test_step_back_undoes_step_of_symmetric_method_alone(name):
    there = nh.integrate("henon_heiles", name, 0.25, t_end=5, samples=2)
    back = nh.integrate("henon_heiles", name, 0.25, t_end=-5, samples=2, q0=there.q.values[-1], p0=there.p.values[-1])
    start = np.array([float(x) for x in nh.systems["henon_heiles"].q0])
    assert (abs(back.q.values[-1] - start).max() < 1e-14) == integrators[name].symmetric


@pytest.mark.slow
def test_only_symmetric_methods_are_checked_by_running_back():
    found = {name: structure(nh.systems["sho"], integrators[name], t_end="20") for name in ("ruth", "ruth_s3o3")}
    assert isnan(found["ruth_s3o3"].return_error)
    assert isnan(found["ruth_s3o3"].plain_return_error)
    assert found["ruth"].return_error < found["ruth"].return_bound
    # Every method is symplectic.
    assert max(one.symplectic_defect for one in found.values()) < 1e-15


@pytest.mark.slow
@pytest.mark.parametrize("name", ASYMMETRIC)
@pytest.mark.parametrize("to", ["json", "toml"])
def test_exported_file_claims_asymmetry_and_every_claim_holds(tmp_path, name, to):
    place = tmp_path / f"{name}.{to}"
    place.write_text(export(integrators[name], to), encoding="utf-8")
    file = read(str(place))
    assert file.symmetric is False
    found = Verdict(file)
    assert found.holds
    assert (found.nearest.tableau.name, found.nearest.is_same, found.nearest.reversed) == (name, True, False)
    assert not Verdict(replace(file, symmetric=True)).holds


OWN = """
import nearharmonic as nh
TABLEAU = nh.Tableau(
    name="mine", order={order}, first="drift", drift=("1", "-{third}", "{third}", "0"), digits=20, source="here",
    kick=("-{small}", "0.75", "{large}"),
)
"""
DECIMALS = {"third": "0.66666666666666666667", "small": "0.04166666666666666667", "large": "0.29166666666666666667"}


def test_users_file_may_hold_one_and_its_order_is_proved(tmp_path):
    """Ruth's method backwards is of order three as well."""
    place = tmp_path / "own.py"
    place.write_text(OWN.format(order=3, **DECIMALS))
    assert load_tableaus(place)["mine"].symmetric is False
    assert nh.order_of(load_tableaus(place)["mine"]) == 3
    assert nh.sweep("sho", str(place), [0.1, 0.05]).max_energy_error.values[0] < 1e-4
    place.write_text(OWN.format(order=4, **DECIMALS))
    with pytest.raises(TableauError, match="declares order 4, and its coefficients, of 20 digits, have order 3"):
        load_tableaus(place)

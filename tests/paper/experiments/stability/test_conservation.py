"""Structure against multiprecision, systems that lack it, and closed forms; other kinetic energies by the conjugate."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.core.arithmetic import sqrt
from nearharmonic.engine import kernels
from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import BENCHMARKED, integrators
from nearharmonic.output.dataset import assembled
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.stability import run as conservation
from nearharmonic_paper.experiments.stability.reductions import defect, kinetic_energy_cube, tangent_map
from nearharmonic_paper.experiments.stability.run import kinetic_energy_measure as measure
from support.oracles.multiprecision import trajectory
from support.oracles.structures import runs_of, structure


def tangent_in_multiprecision(system, tableau, tau, steps):
    """Central differences of the last state, by each coordinate of the first: off by the square of the spacing."""
    spacing, start = mpf(10) ** -20, [*map(mpf, (*system.q0, *system.p0))]
    columns = []
    for i in range(len(start)):
        ends = []
        for sign in (1, -1):
            moved = [x + sign * spacing * (i == j) for j, x in enumerate(start)]
            q, p = trajectory(tableau, system, mpf(tau), steps, (moved[: len(moved) // 2], moved[len(moved) // 2 :]))[
                -1
            ]
            ends.append([*q, *p])
        columns.append([float((a - b) / (2 * spacing)) for a, b in zip(*ends, strict=True)])
    return np.transpose(columns)


@pytest.mark.slow
@pytest.mark.parametrize("system", ["sho", "henon_heiles", "kepler", "relativistic_oscillator"])
@pytest.mark.parametrize("name", ["ruth", "babs7o7h"])
def test_the_tangent_map_is_that_of_multiprecision(monkeypatch, system, name):
    problem, tableau, steps = systems[system], integrators[name], 20
    t_end = Fraction(problem.t_end) / 200
    monkeypatch.setattr(conservation, "EVALUATIONS", 25 * steps * tableau.stages)
    one = runs_of(problem, [tableau], 25 * t_end).isel(integrator=0, sample=steps)
    J, scales = tangent_map(one.neighbour.values, one.neighbour_low.values, 2.0**-24), one.scale.values
    expected = tangent_in_multiprecision(problem, tableau, float(t_end / steps), steps) * scales / scales[:, None]
    # Doubles of coefficients and of the step are off by 1e-16 in each of a few hundred substeps.
    assert np.abs(np.array(J, dtype=float) - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("J", "expected"), [([[1, 0], [0, 1]], 0), ([[2, 5], [0, Fraction(1, 2)]], 0), ([[2, 0], [0, 1]], 1)]
)
def test_matrix_defect_in_one_dimension_is_that_of_determinant(J, expected):
    assert defect(np.array(J, dtype=object)) == expected


def test_the_defect_sees_degrees_of_freedom_that_are_mixed_up():
    # A turn of the positions alone: areas go from (q1, p1) to (q2, p1).
    J = [[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert defect(np.array(J, dtype=object)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("system", ["sho", "henon_heiles", "kepler", "relativistic_oscillator"])
@pytest.mark.parametrize("name", BENCHMARKED)
def test_every_method_keeps_the_structure_to_rounding_and_no_better(system, name):
    tableau = integrators[name]
    found = structure(systems[system], tableau, t_end=systems[system].t_end)
    # A matrix of determinant 1 has a norm of 1 or more; the tangent map is that of the flow but for the method's error.
    assert found.growth > 0.999
    updates = found.steps * systems[system].dimension * (2 * tableau.stages + 1)
    for prefix in ("", "plain_"):
        error, walk, bound = (getattr(found, f"{prefix}return_{key}") for key in ("error", "walk", "bound"))
        # Three standard deviations of a random walk; each of its ends is below a thousandth of one in 0.08 % of cases,
        # and the error is the largest of two ends or more.
        assert walk / 1000 < error < 3 * walk
        # Cauchy and Schwarz, over the run and the run back.
        assert walk < bound <= np.sqrt(2 * updates) * walk * (1 + 1e-12)
    # The walk is carried on by the rms norm, which only one entry of the worst state has, so that defects are about a
    # twentieth of it; of one degree of freedom it is a single number, det J - 1, which 0.01 % of cases bring this near.
    assert found.symplectic_walk / 100_000 < found.symplectic_defect < 3 * found.symplectic_walk < 1e-18
    # Ruth's mean energy error at this step size is below 1e-4 everywhere, and so is what its trend comes to.
    assert 0 < abs(found.energy_drift) < 1e-4
    # Twenty times: the blocks of a chaotic orbit are not independent, and among a dozen neighbours of its start trends
    # reach ten half widths; and rounding limits what a trend can be.
    assert abs(found.energy_drift) < 20 * found.energy_drift_interval
    assert 0 < found.energy_walk < found.energy_drift_interval


def swirling():
    """A force with a curl, so of no potential: it feeds the energy and shears areas."""
    sound = systems["henon_heiles"]
    return replace(
        sound, name="swirling", V=lambda q: (q[0] * q[0] + q[1] * q[1]) / 2,
        grad_V=lambda q: (q[0] + q[1] / 1000, q[1] - q[0] / 1000), t_end="50", q0=("1", "0"), p0=("0", "1"),
    )  # fmt: skip


@pytest.mark.slow
def test_a_force_without_a_potential_is_found_out(monkeypatch):
    monkeypatch.setattr(kernels, "check_gradients", lambda system: None)  # it would refuse the system at once
    tableau = integrators["babs7o7h"]
    found = structure(swirling(), tableau, t_end="50")
    assert found.symplectic_defect > 1e-4
    # The circle x + iy = exp(it) gains dH/dt = -curl/1000 (x v - y u): 1e-3 for each unit of time, H0 = 1.
    found = structure(swirling(), tableau, t_end="0.1")  # the trend is over ten times that
    assert abs(abs(found.energy_drift) - 1e-3) < 1e-5 + found.energy_drift_interval


def test_method_that_needs_quadratic_kinetic_energy_is_left_out():
    with pytest.raises(NearharmonicError, match=r"srkn_a17.*relativistic_oscillator does not have"):
        nh.integrate("relativistic_oscillator", "srkn_a17", 0.1)
    assert measure(["srkn_a17", "ruth"])["run"].variables["integrator"][1].tolist() == ["ruth"]


@pytest.fixture(scope="module")
def cube():
    contents = measure(("ruth", "babs7o7h", "babps9o7h"))["run"]
    return kinetic_energy_cube(assembled(contents.variables, contents.coordinates, {}))


@pytest.mark.parametrize("amplitude", [0.01, 1.0])
def test_runs_of_amplitude_are_those_of_system_begun_there(cube, amplitude):
    system = replace(systems["relativistic_oscillator"], q0=(f"{amplitude}",))
    taus = cube.tau_per_stage.values[::10]
    expected = nh.sweep(system, "babs7o7h", taus * 7)
    found = cube.sel(roles="own", amplitude=amplitude, integrator="babs7o7h", tau_per_stage=taus)
    np.testing.assert_array_equal(found.max_energy_error, expected.max_energy_error)
    # The same steps, summed in other blocks.
    np.testing.assert_allclose(found.mean_energy_error, expected.mean_energy_error, rtol=1e-12)


def test_exchanged_roles_are_method_on_conjugate_system_with_quadratic_T(cube):
    conjugate = nh.systems["sho"].__class__(
        name="conjugate",
        label="conjugate",
        V=lambda q: q[0] * q[0] / (1 + sqrt(1 + q[0] * q[0])),
        grad_V=lambda q: (q[0] / sqrt(1 + q[0] * q[0]),),
        q0=("0",),
        p0=("0.3",),
        t_end="500",
        units=systems["sho"].units,
        source="q -> p, p -> -q",
    )
    assert conjugate.quadratic_kinetic_energy
    taus = cube.tau_per_stage.values[8:21]
    expected = nh.sweep(conjugate, "babps9o7h", taus * 9)
    found = cube.sel(roles="exchanged", amplitude=0.3, integrator="babps9o7h", tau_per_stage=taus)
    # Not the same operations: energies differ by rounding, errors by 1e-16 over their size, 1e-10 at least.
    np.testing.assert_allclose(found.max_energy_error, expected.max_energy_error, rtol=1e-5)

"""Runs of processed methods: their attributes, and samples and energies of processed states.

Their states, orders and bits are tested with those of the other methods with kicks of a modified potential.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.errors import TableauError
from nearharmonic.integrators.tableau import Processor
from nearharmonic.theory.order import nystrom_order_of
from support.oracles import modified_steps
from support.oracles.multiprecision import digits_of

ROWLANDS = nh.modified_integrators["rowlands"]


def test_energy_errors_are_those_of_processed_states_at_the_samples():
    run = nh.integrate("henon_heiles", "rowlands", 0.1, t_end=5, samples=51, precision="extended")
    system = nh.systems["henon_heiles"]
    states = modified_steps.states(ROWLANDS, modified_steps.henon_heiles, system.q0, system.p0, mpf(1) / 10, 50)
    H = [(u * u + v * v + x * x + y * y) / 2 + x * x * y - y**3 / 3 for (x, y), (u, v) in states]
    expected = [float((h - H[0]) / H[0]) for h in H]
    # Rounded to doubles, from energies in double-double.
    assert run.energy_error.values == pytest.approx(expected, rel=1e-12, abs=1e-25)
    assert float(run.max_energy_error) == pytest.approx(max(map(abs, expected)), rel=1e-12)
    assert float(run.mean_energy_error) == pytest.approx(np.mean(np.abs(expected[1:])), rel=1e-12)


def test_the_first_sample_is_the_start_itself():
    run = nh.integrate("henon_heiles", "rowlands", 0.1, t_end=5, samples=3)
    assert run.q[0].values.tolist() == [0.3, 0.0]
    assert run.p[0].values.tolist() == [0.0, 0.4]
    assert run.energy_error[0] == 0


def test_without_processor_order_is_two_in_theory_and_in_runs():
    assert (nystrom_order_of(ROWLANDS.kernel), nystrom_order_of(ROWLANDS)) == (2, 4)
    errors = nh.sweep("henon_heiles", ROWLANDS.kernel, [0.1, 0.05, 0.025], t_end=20).max_energy_error.values
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx([2, 2], abs=0.05)


def test_processor_that_is_wrong_at_degree_three_makes_order_three():
    """The step is not symmetric then: conditions of even degree count."""
    forged = replace(ROWLANDS, processor=replace(ROWLANDS.processor, square=("0", "0")))
    assert nystrom_order_of(forged) == 3


def test_kernel_is_leapfrog_with_force_of_takahashi_and_imada():
    assert (ROWLANDS.kick, ROWLANDS.drift) == (("1",), ("0.5", "0.5"))
    assert abs(Fraction(ROWLANDS.square[0]) - Fraction(1, 24)) < Fraction(1, 10**80)
    given = ROWLANDS.processor
    a, b = -Fraction(given.drift[0]), Fraction(given.kick[1])
    assert abs(a * b - Fraction(1, 48)) < Fraction(1, 10**79)
    assert abs(Fraction(given.square[0]) - a * b * b) < Fraction(1, 10**79)


def test_result_states_processing_and_place_of_energy():
    run = nh.integrate("henon_heiles", "rowlands", 0.1, t_end=5)
    assert run.attrs["processed"].startswith("states and energies are processed at the samples")
    assert run.attrs["energy"] == "samples"
    assert "over the samples" in run.max_energy_error.attrs["long_name"]
    assert run.evaluations == 50  # of the kernel


def test_states_between_steps_are_those_of_one_shorter_step():
    run = nh.integrate("henon_heiles", "rowlands", 0.1, t_end=1, t=["0.5", "0.53"], precision="extended")
    q, p = (digits_of(run, name, 0) for name in "qp")
    (_, (x, _)) = modified_steps.states(ROWLANDS, modified_steps.henon_heiles, q, p, mpf("0.03"), 1)
    assert all(abs(a - b) < 1e-28 for a, b in zip(digits_of(run, "q"), x, strict=True))


def test_a_run_that_leaves_its_energy_surface_has_diverged():
    run = nh.integrate("henon_heiles", "rowlands", 2.0, q0=["2", "2"], t_end=100)
    assert run.status == "diverged"
    assert run.max_energy_error == np.inf


def test_the_energy_may_be_left_out():
    run = nh.integrate("henon_heiles", "rowlands", 0.1, t_end=5, samples=2, energy="none")
    other = nh.integrate("henon_heiles", "rowlands", 0.1, t_end=5, samples=2)
    assert np.isnan(run.max_energy_error)
    assert np.array_equal(run.q, other.q)


def test_way_back_retraces_orbit_to_order_of_method():
    distances = []
    for tau in (0.1, 0.05):
        there = nh.integrate("henon_heiles", "rowlands", tau, t_end=5, samples=1).isel(sample=-1)
        back = nh.integrate("henon_heiles", "rowlands", tau, t_end=-5, q0=there.q.values, p0=there.p.values, samples=1)
        distances.append(np.abs(back.q.values[-1] - [0.3, 0.0]).max())
    assert distances[0] / distances[1] > 2**3.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kick": ("-0.25", "0.3")}, r"kick row sum = '0\+5.0e-02', expected 0 within"),
        ({"drift": ("0.1", "-0.1")}, "expected one drift more than the other operator"),
        ({"square": ("0",)}, "square = '1 numbers', expected one for each of 2 kicks"),
        ({"square": ("0", "y")}, r"square\[1\] = 'y', expected a finite decimal"),
    ],
)
def test_a_processor_that_cannot_be_is_refused(change, words):
    given = {key: getattr(ROWLANDS.processor, key) for key in ("first", "kick", "drift", "square", "digits")}
    with pytest.raises(TableauError, match=words):
        Processor(**given | change)


def test_a_processor_and_its_inverse_are_the_identity():
    assert ROWLANDS.processor.inverse.inverse == ROWLANDS.processor
    assert ROWLANDS.processor.inverse.kick == ("-0.25", "0.25")
    other = replace(ROWLANDS, processor=ROWLANDS.processor.inverse)
    assert other.digest() != ROWLANDS.digest()
    assert nystrom_order_of(other) == 2

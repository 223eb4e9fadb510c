"""Runs of processed methods: their attributes, and samples and energies of processed states.

Their states, orders and bits are tested together with the other methods with kicks of a modified potential.
"""

import pickle
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.errors import SettingError, TableauError, UnknownNameError
from nearharmonic.integrators import plain_integrators
from nearharmonic.integrators.tableau import Processor
from nearharmonic.math import cos
from nearharmonic.theory.order import nystrom_order_of
from support.methods.own_systems import sites
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


# --- Runs of methods with kicks of a modified potential: against mpmath, in lanes, in order, and what is refused


EVERY = pytest.mark.parametrize("name", list(nh.modified_integrators))
MASSES = "1.5", "0.5"
SPRING = nh.System(
    name="spring", V=lambda q, k: k * (q[0] - q[1]) ** 2 / 2 + q[0] ** 4, masses=MASSES, parameters={"k": "3"},
    q0=("0.7", "-0.2"), p0=("0.1", "0.3"), t_end="4",
)  # fmt: skip
DRIVEN = nh.System(
    name="driven",
    V=lambda q, t: -cos(q[0]) - q[0] * cos(t) / 10,
    time_dependent=True,
    q0=("1",),
    p0=("0.5",),
    t_end="4",
)
STEPS = 40


def rates_of(system):
    if system is SPRING:
        return modified_steps.spring([mpf(m) for m in MASSES], mpf(3)), [mpf(m) for m in MASSES]
    if system is DRIVEN:
        return modified_steps.driven_pendulum, None
    if system.name == "kepler":
        return modified_steps.kepler(mpf(system.parameters["GM"].value)), None
    return modified_steps.henon_heiles, None


@EVERY
@pytest.mark.parametrize(
    "system",
    [
        nh.systems["henon_heiles"],
        *(pytest.param(one, marks=pytest.mark.slow) for one in (nh.systems["kepler"], SPRING, DRIVEN)),
    ],
    ids=lambda system: system.name,
)
@pytest.mark.parametrize("precision", ["double", "extended"])
def test_states_are_those_of_the_same_steps_in_multiprecision(name, system, precision):
    tau = mpf(system.t_end) / 4000 if system.name == "kepler" else mpf("0.1")
    t_end = str(float(tau) * STEPS)
    rates, masses = rates_of(system)
    step, tableau = mpf(t_end) / STEPS, nh.modified_integrators[name]
    expected = modified_steps.states(tableau, rates, system.q0, system.p0, step, STEPS, masses)[-1]
    run = nh.integrate(system, name, float(step), t_end=t_end, precision=precision, samples=2)
    for row, key in zip(expected, ("q", "p"), strict=True):
        worst = max(abs(a - b) for a, b in zip(digits_of(run, key), row, strict=True)) / max(abs(x) for x in row)
        # A unit of the last place for each of 40 steps of at most five kicks, along orbits that part slowly.
        assert worst < 40 * 5 * (mpf(2) ** -53 if precision == "double" else mpf(2) ** -100)


@pytest.mark.parametrize("square", [("0.02", "0"), ("0", "0.02"), ("0", "0")])
def test_kick_that_two_steps_share_takes_gradient_for_either(square):
    """The kick that closes a step may need none where the one that opens the next step does."""
    tableau = nh.Tableau(
        name="shared", order=1, first="kick", kick=("0.4", "0.6"), square=square, drift=("1",), symmetric=False,
        source="here", digits=20,
    )  # fmt: skip
    system = nh.systems["henon_heiles"]
    run = nh.integrate(system, tableau, 0.1, t_end=1, samples=1, precision="extended")  # all steps in one call
    tau = mpf(1) / 10
    expected = modified_steps.states(tableau, modified_steps.henon_heiles, system.q0, system.p0, tau, 10)
    q, p = (np.array(row, float) for row in expected[-1])
    assert run.q.values[-1] == pytest.approx(q, rel=1e-15, abs=1e-16)
    assert run.p.values[-1] == pytest.approx(p, rel=1e-15, abs=1e-16)


@pytest.mark.slow
@EVERY
def test_energy_of_many_coordinates_is_measured_as_at_samples(name):
    every = nh.integrate(sites(10), name, 0.5, samples=1000)
    # Errors in double are exact to four digits: CERTAINTY of the kernel.
    assert float(every.max_energy_error) == pytest.approx(np.abs(every.energy_error.values).max(), rel=1e-3)
    assert float(every.max_energy_error) < 1e-3


def test_a_result_says_how_many_gradients_a_step_takes():
    run = nh.integrate("henon_heiles", "chin_4a", 0.5, t_end=5)
    assert run.evaluations == 21
    assert run.attrs["gradients_per_step"] == "1"


def test_chins_middle_force_is_that_of_his_paper():
    """F + tau^2 grad |F|^2 / 48, which the kick of 2/3 takes."""
    tableau = nh.modified_integrators["chin_4a"]
    assert abs(mpf(tableau.square[1]) / mpf(tableau.kick[1]) - mpf(1) / 48) < mpf(10) ** -50
    assert set(tableau.square[::2]) == {"0"}


@pytest.mark.parametrize(
    ("system", "words"),
    [
        ("kepler_regularised", "it is regularised"),
        (
            nh.System(name="long", V=lambda q: sum(x * x for x in q), q0=("1",) * 60, p0=("0",) * 60, t_end="1"),
            "compiled as loops",
        ),
        (
            nh.System(name="quartic", V=lambda q: q[0] ** 2, T=lambda p: p[0] ** 4, q0=("1",), p0=("0",), t_end="1"),
            "requires a quadratic kinetic energy",
        ),
    ],
    ids=["regularised", "loops", "kinetic_energy"],
)
def test_system_without_modified_kicks_is_refused_in_one_sentence(system, words):
    with pytest.raises(SettingError, match=f"integrator = 'chin_4a' is not allowed.*{words}") as caught:
        nh.sweep(system, "chin_4a", [0.1])
    assert "\n" not in str(caught.value)


def test_a_modified_method_beside_exact_oscillators_is_refused():
    with pytest.raises(SettingError, match=r"chin_4a.*oscillators solved exactly"):
        nh.integrate("sho", "chin_4a", 0.1, split="exact_oscillator")


def test_the_registry_has_all_methods_and_three_views_share_them():
    assert {*plain_integrators, *nh.modified_integrators, *nh.implicit_integrators} == set(nh.integrators)
    assert not {*plain_integrators, *nh.modified_integrators} & set(nh.implicit_integrators)
    assert not set(plain_integrators) & set(nh.modified_integrators)
    assert all(nh.integrators[name] is one for name, one in nh.modified_integrators.items())
    assert all(one.square for one in nh.modified_integrators.values())
    assert not any(one.square or one.processor for one in plain_integrators.values())


def test_view_names_missing_entries_and_is_pickled_as_itself():
    with pytest.raises(UnknownNameError, match=r"unknown integrator 'chin_4'\. Did you mean 'chin_4a'"):
        nh.modified_integrators["chin_4"]
    with pytest.raises(UnknownNameError, match="unknown integrator 'ruth'"):
        nh.modified_integrators["ruth"]
    assert pickle.loads(pickle.dumps(nh.modified_integrators)) is nh.modified_integrators
    assert repr(nh.modified_integrators).startswith("<nearharmonic.integrators.modified_integrators, a mapping of ")
    assert nh.modified_integrators._repr_html_().count("<tr>") == len(nh.modified_integrators) + 1
    assert nh.modified_integrators.module_of("chin_4a") == "nearharmonic.integrators.chin_1997"


def test_users_file_has_modified_tableau_whose_order_is_proved(tmp_path):
    """The leapfrog with the force of Takahashi and Imada has order two, and three for processed states alone."""
    text = (
        "import nearharmonic as nh\n"
        "TABLEAU = nh.Tableau(name='m', order={}, first='drift', kick=('1',), drift=('0.5', '0.5'),\n"
        "    square=('0.0416666666666666666667',), source='here', digits=20)\n"
    )
    (tmp_path / "own.py").write_text(text.format(2))
    found = nh.integrate("henon_heiles", str(tmp_path / "own.py"), 0.1, t_end=5)
    kernel = nh.integrate("henon_heiles", nh.integrators["rowlands"].kernel, 0.1, t_end=5)
    assert found.max_energy_error == kernel.max_energy_error
    (tmp_path / "wrong.py").write_text(text.format(4))
    with pytest.raises(TableauError, match=r"declares order 4, .* have order 2 for a quadratic kinetic energy"):
        nh.integrate("henon_heiles", str(tmp_path / "wrong.py"), 0.1)

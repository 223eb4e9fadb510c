"""Steps inside functions of numba against runs of one step."""

import re
from fractions import Fraction
from pathlib import Path

import numba
import numpy as np
import pytest
import xarray as xr
from numba.core.errors import NumbaWarning, TypingError

import nearharmonic as nh
from nearharmonic.core.layout import COLUMNS
from nearharmonic.core.native import NativeFunction
from nearharmonic.core.stepper import fill
from nearharmonic.engine.trajectory import step_of
from nearharmonic.errors import SettingError
from nearharmonic.integrators import plain_integrators
from support.methods.numba_potentials import springs
from support.methods.own_systems import sites

RNG = np.random.default_rng(1)
ALL = list(plain_integrators)
#: Few, of every kind: kicks first and drifts first, with and without negative coefficients, a "0" at one end.
FEW = ["leapfrog", "ruth", "ruth_s3o3", "babs7o7h", "mclachlan_atela_4", "rnia12", "s15odr8", "sofspa_s35o10"]
PLAIN = [name for name, tableau in plain_integrators.items() if tableau.requires is None]
MODIFIED = [name for name, tableau in nh.modified_integrators.items() if not tableau.processed]
CHAIN = sites(70)  # whose formulas are compiled as loops
DRIVEN = nh.System(
    name="driven", V=lambda q, t, a: q[0] ** 4 / 4 - a * t * q[0], time_dependent=True, parameters={"a": 2}, q0=[1],
    p0=[0], t_end=1,
)  # fmt: skip


def random_state(system, *, compensated):
    """Positions and momenta near 0, and what their sums have left out: at most half a unit of the last digit."""
    q, p = RNG.uniform(-0.3, 0.3, (2, system.dimension))
    carries = [RNG.uniform(-0.5, 0.5, system.dimension) * np.spacing(np.abs(x)) for x in (q, p)]
    return q, p, *(carries if compensated else np.zeros((2, system.dimension)))


def run_of_one_step(system, method, tau, state, **settings):
    """The end of a run from this state, of the same layout; the interval is exact if tau has few bits."""
    q0, p0 = ([sum(map(Fraction, pair)) for pair in zip(*rows, strict=True)] for rows in (state[::2], state[1::2]))
    run = nh.integrate(system, method, abs(tau), t_end=tau, q0=q0, p0=p0, energy="none", **settings)
    return [run[name].values[-1] if name in run else np.zeros(len(q0)) for name in ("q", "p", "q_low", "p_low")]


def native_step(system, method, tau, state, **settings):
    """The state after a call of the machine code, with the moves that a step of numba makes."""
    step = step_of(nh.problem(system, method, energy="none", **settings))
    assert not step.parameters.size
    moves = np.empty(COLUMNS * len(step.flags))
    fill(step.table, step.flags, step.power, tau, moves)
    q, p, carry_q, carry_p = after = [x.copy() for x in state]
    call = NativeFunction(step.address, step.signature)
    call(len(step.flags) - 2, step.kick_first, moves, np.zeros(2), q, carry_q, p, carry_p)
    return after


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "summation", "methods"),
    [
        ("henon_heiles", "plain", FEW),
        pytest.param("henon_heiles", "compensated", MODIFIED, marks=pytest.mark.slow),
        pytest.param("henon_heiles", "plain", ALL, marks=pytest.mark.slow),
        pytest.param("henon_heiles", "compensated", ALL, marks=pytest.mark.slow),
        pytest.param("henon_heiles", "plain", MODIFIED, marks=pytest.mark.slow),
        pytest.param("relativistic_oscillator", "plain", PLAIN, marks=pytest.mark.slow),
    ],
)
def test_step_of_every_method_has_bits_of_run(name, summation, methods):
    system = nh.systems[name]
    for method in methods:
        for tau in (0.28125, -0.40625):
            state = random_state(system, compensated=summation == "compensated")
            expected = run_of_one_step(system, method, tau, state, summation=summation)
            found = native_step(system, method, tau, state, summation=summation)
            np.testing.assert_array_equal(found, expected, err_msg=f"{method} {tau}")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:energy='none' checks nothing")  # of a single step at a plunge
@pytest.mark.parametrize(
    ("system", "method", "summation"),
    [
        ("kepler", "ruth", "plain"),
        pytest.param(CHAIN, "leapfrog", "compensated", marks=pytest.mark.long),
        pytest.param("kepler", "chin_4a", "compensated", marks=pytest.mark.slow),
        pytest.param(CHAIN, "leapfrog", "plain", marks=pytest.mark.slow),
    ],
)
def test_a_step_of_numba_has_the_bits_of_a_run(system, method, summation):
    settings = {"summation": summation, "parameters": {"GM": "0.7"} if system == "kepler" else None}
    system = nh.systems[system] if isinstance(system, str) else system
    step = nh.stepper(system, method, **settings)
    for tau in (0.25, -0.125, 0.25):  # the moves of the third are remembered
        state = random_state(system, compensated=summation == "compensated")
        expected = run_of_one_step(system, method, tau, state, **settings)
        step(*(state if summation == "compensated" else state[:2]), tau)
        np.testing.assert_array_equal(state, expected)


@pytest.mark.slow
def test_the_time_is_the_last_coordinate_of_a_driven_system():
    q, p = np.array([1.0, 0.0]), np.array([0.5, 0.0])
    nh.stepper(DRIVEN, "ruth")(q, p, 0.375)
    run = nh.integrate(DRIVEN, "ruth", 0.375, t_end=0.375, p0=[0.5], summation="plain")
    assert (q[0], p[0], q[1]) == (run.q.values[-1, 0], run.p.values[-1, 0], 0.375)


@pytest.fixture(scope="module")
def step():
    return nh.stepper("henon_heiles", "babs7o7h")


def many_steps(step, **options):
    @numba.njit(nogil=True, **options)
    def many(q, p, taus):
        for i in numba.prange(len(q)):
            for tau in taus[i]:
                step(q[i], p[i], tau)

    return many


def states_of(many, taus):
    q, p = np.random.default_rng(3).uniform(-0.2, 0.2, (2, len(taus), 2))
    many(q, p, taus)
    return q, p


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"fastmath": True}, pytest.param({"parallel": True}, marks=pytest.mark.long)])
def test_options_of_the_caller_do_not_change_bits(step, options):
    taus = RNG.choice(RNG.uniform(-0.1, 0.1, 200), (16, 500))
    called = many_steps(step, **options)
    q, p = np.random.default_rng(3).uniform(-0.2, 0.2, (2, 16, 2))
    for i in range(16):
        for tau in taus[i]:
            step(q[i], p[i], tau)
    np.testing.assert_array_equal(states_of(called, taus), (q, p))


def test_a_step_back_with_reversed_momenta_returns(step):
    q, p = RNG.uniform(-0.3, 0.3, (2, 2))
    state = q.copy(), p.copy()
    for _ in range(2):
        for _ in range(10):
            step(q, p, 0.25)
        p *= -1
    # 20 steps of 7 kicks and 8 drifts, each of two roundings of at most 2^-54 to numbers below 1/2, and what the flow
    # makes of them: within a few units of time no more than tenfold.
    assert np.abs(np.array([q, p]) - state).max() < 20 * 15 * 2 * 2.0**-54 * 10


def test_arrays_of_another_length_are_refused(step):
    for q, p in ((np.zeros(3), np.zeros(2)), (np.zeros(2), np.zeros(1))):
        with pytest.raises(ValueError, match=r"step of henon_heiles: expected arrays of 2 numbers"):
            step(q, p, 0.1)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"q": np.zeros(2, np.float32)}, "q = 'array of float32, of shape (2,)' is not allowed: a writable, C-contig"),
        ({"p": np.zeros((2, 2))[:, 0]}, "p = 'strided array of float64, of shape (2,)' is not allowed: a writable"),
        ({"q": np.frombuffer(bytes(16))}, "q = 'read-only array of float64, of shape (2,)' is not allowed: a writable"),
        ({"q": np.zeros((1, 2))}, "q = 'array of float64, of shape (1, 2)' is not allowed: a writable, C-contiguous"),
        ({"p": [0.1, 0.2]}, "p = [0.1, 0.2] is not allowed: a writable, C-contiguous array of float64"),
        ({"q": xr.DataArray(np.zeros(2))}, "is not allowed: a writable, C-contiguous array of float64"),
        ({"tau": 1j}, "tau = 1j is not allowed: a real number, behind the arrays"),
        ({"tau": "0.1"}, "tau = '0.1' is not allowed: a real number, behind the arrays"),
    ],
)
def test_arguments_of_other_types_are_refused_in_a_sentence(step, given, named):
    with pytest.raises(SettingError, match=re.escape(named)) as found:
        step(**{"q": np.zeros(2), "p": np.zeros(2), "tau": 0.1} | given)
    assert "\n" not in str(found.value)


def test_callers_with_other_types_do_not_compile(step):
    with pytest.raises(TypingError, match=r"a step takes a writable, .*; this is array\(float32, 1d, C\)"):
        numba.njit(lambda q, p: step(q, p, 0.1))(np.zeros(2), np.zeros(2, np.float32))


@pytest.mark.slow
def test_step_of_potential_of_numba_has_bits_of_run():
    system, state = springs(), tuple(np.array([x]) for x in (0.7, -0.2, 0.0, 0.0))
    after = run_of_one_step(system, "babs7o7h", 0.375, state, summation="plain")
    q, p = (x.copy() for x in state[:2])
    nh.stepper(system, "babs7o7h")(q, p, 0.375)
    assert (q[0], p[0]) == (after[0][0], after[1][0])


def test_numba_does_not_keep_addresses_on_disk(step, tmp_path):
    (tmp_path / "caller.py").write_text("def caller(q, p):\n    step(q, p, 0.1)\n", encoding="utf-8")
    space = {"__file__": str(tmp_path / "caller.py"), "step": step}
    exec(compile((tmp_path / "caller.py").read_text(encoding="utf-8"), tmp_path / "caller.py", "exec"), space)
    with pytest.warns(NumbaWarning, match="Cannot cache"):
        numba.njit(cache=True)(space["caller"])(np.zeros(2), np.zeros(2))
    assert not list(tmp_path.rglob("*.nbc"))


@pytest.mark.parametrize(
    ("given", "settings", "message"),
    [
        (("henon_heiles", "babs7o7h"), {"precision": "extended"}, "precision = 'extended' is not allowed"),
        (("henon_heiles", "babs7o7h"), {"summation": "kahan"}, "summation = 'kahan' is not allowed"),
        (("henon_heiles", "babs7o7h"), {"split": "exact_oscillator"}, "split = 'exact_oscillator' is not allowed"),
        (("kepler_regularised", "babs7o7h"), {}, "system = 'kepler_regularised' is not allowed: it is regularised"),
        (("henon_heiles", "rowlands"), {}, "integrator = 'rowlands' is not allowed: it is processed"),
        (("relativistic_oscillator", "chin_4a"), {}, "it requires a quadratic kinetic energy"),
        (("kepler", "ruth"), {"parameters": {"GM": float("nan")}}, "is not allowed: a finite number"),
    ],
)
def test_what_a_step_is_not_is_refused(given, settings, message):
    with pytest.raises(SettingError, match=message):
        nh.stepper(*given, **settings)


# --- docs/how_to/stepper.md: its programs run as printed, and their results are correct


ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how_to/stepper.md").read_text(encoding="utf-8")


def run(word):
    """The names that the one program with this word in it leaves behind."""
    (program,) = [block for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL) if word in block]
    names = {}
    exec(compile(program, "docs/how_to/stepper.md", "exec"), names)
    return names


@pytest.mark.slow
def test_the_loop_follows_the_orbit_of_a_run():
    found = run("def orbit")
    settings = {"q0": [69.82, 0.0], "p0": [0.0, 0.14], "parameters": {"GM": "1.72"}}
    path = nh.integrate("kepler", "babps9o7h", 36, t_end=36_000, summation="plain", energy="none", **settings)
    # Each of the 1000 steps makes 18 sums. Their roundings, of 2^-53, change the energy as a random walk does, and the
    # phase by the sum of that over the steps.
    bound = 18 * 2.0**-53 * 1000**1.5
    assert np.abs(found["q"] / path.q.values[-1] - 1).max() < bound


@pytest.mark.slow
def test_the_sampler_has_the_variances_of_its_gaussian():
    found = run("def sample")
    squares = (found["chain"] - found["chain"].mean(axis=0)) ** 2
    # Batches of 200 states are independent for a chain whose correlation decays within a few.
    means = squares.reshape(100, 200, 2).mean(axis=1)
    error = means.std(axis=0, ddof=1) / np.sqrt(len(means))
    assert (np.abs(means.mean(axis=0) - [1, 4]) < 5 * error).all()
    assert (error < [0.05, 0.2]).all()
    assert 0.9 < found["accepted"] < 0.99


@pytest.fixture(scope="module")
def crossings():
    return run("def section")


@pytest.mark.slow
def test_points_of_section_lie_on_it_with_energy_of_orbit(crossings):
    (x, y), (px, py) = crossings["positions"].T, crossings["momenta"].T
    assert len(x) == 200
    assert np.abs(x).max() < 2.0**-52  # Newton's method squares the error: less than 0.3 becomes less than rounding
    assert px.min() > 0
    H = (px**2 + py**2) / 2 + y * y / 2 - y**3 / 3
    run = nh.integrate("henon_heiles", "babps9o7h", 0.5, t_end=2000, q0=[0.0, 0.1], p0=[0.49, 0.0])
    # The orbits part by rounding, and have errors of one size: a factor 3 for that.
    assert np.abs(H / run.initial_energy.item() - 1).max() < 3 * run.max_energy_error.item()


@pytest.mark.slow
def test_the_section_is_that_of_straight_lines_between_samples(crossings):
    system, tau = nh.systems[str(ROOT / "examples/poincare_section.py")], 0.02
    speed = np.sqrt(-0.674 - np.log(0.14**2 + 0.3**2))
    run = nh.integrate(system, "ruth", tau, t_end=30, samples=1501, q0=[0.3, 0.0], p0=[0.0, speed])
    q, p = run.q.values, run.p.values
    (before,) = np.nonzero((q[:-1, 1] < 0) & (q[1:, 1] >= 0))
    share = q[before, 1] / (q[before, 1] - q[before + 1, 1])
    lines = np.array([(a[before] + share[:, None] * (a[before + 1] - a[before]))[:, 0] for a in (q, p)])
    step = nh.stepper(system, "ruth")
    positions, momenta = crossings["section"](step, np.array([0.3, 0.0]), np.array([0.0, speed]), tau, len(before), 1)
    # A straight line is off by at most tau^2/8 of the second derivative of each coordinate, and its crossing of y = 0
    # by that over the speed, which moves x and its momentum by their own rates.
    rates = [np.abs(np.gradient(a, tau, axis=0)).max() for a in (q, p)]
    curvatures = [np.abs(np.gradient(np.gradient(a, tau, axis=0), tau, axis=0)).max() for a in (q, p)]
    late = curvatures[0] * tau**2 / 8 / momenta[:, 1].min()
    assert len(before) > 5
    for line, exact, rate, curvature in zip(lines, (positions, momenta), rates, curvatures, strict=True):
        assert np.abs(line - exact[:, 0]).max() < curvature * tau**2 / 8 + rate * late

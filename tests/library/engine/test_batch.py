"""Settings of the arithmetic, and the exact coefficients and starts that runs share."""

import random
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from math import inf

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch, sample_marks
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.numbers import moves
from nearharmonic.engine.settings import MOST_STEPS, Numerics, steps_of, steps_over
from support.methods.own_systems import spring
from support.oracles.reference_solutions import oscillator_state, oscillator_step
from support.oracles.word_series import operators_of


def test_numerics_with_one_compiled_code_are_one_in_compiled_form():
    """Double-double is compensated always; how often to look and rounded coefficients are arguments of a call."""
    extended = Numerics(precision="extended")
    for other in ({"summation": "plain"}, {"look": 5}, {"double_coefficients": True}):
        assert Numerics(precision="extended", **other).compiled == extended.compiled
    kinds = [
        Numerics(**how)
        for how in ({}, {"summation": "plain"}, {"precision": "extended"}, {"width": 1}, {"energy": "samples"})
    ]
    assert len({kind.compiled for kind in kinds}) == 5


def test_a_batch_that_looks_more_often_loads_no_other_kernel():
    settings = {"t_end": Fraction(3), "steps": [6], "samples": 2}
    for look in (None, 2, 3):
        before = kernel_of.misses
        numerics = Numerics(width=1, energy="samples", look=look)
        integrate_batch(nh.systems["sho"], nh.integrators["ruth"], numerics=numerics, **settings)
        assert look is None or kernel_of.misses == before


def substeps(tableau, tau, steps):
    """Kicks and drifts of so many steps, one after the other, as (letter, coefficient) without those that are 0."""
    return [(x, c * (-tau if x == "B" else tau)) for x, c in operators_of(tableau) * steps if c]


def joined(pieces):
    """Neighbours of one operator as one; those that come to nothing are left out."""
    found = []
    for name, c in pieces:
        before = found.pop()[1] if found and found[-1][0] == name else Fraction(0)
        if before + c:
            found.append((name, before + c))
    return found


def test_moves_are_rounded_substeps_independent_of_earlier_requests():
    """Twice through methods, roles, steps and parts, so that each follows each other one; to u/2 or (u/2)^2."""
    own, other = nh.integrators["babps9o7h"], nh.integrators["aba864"]
    taus = [Fraction(9, 10), Fraction(-1, 3), Fraction(10, 9)]
    for tableau in (own, own.role("drift"), other, own):
        for parts in (1, 2, 1):
            rows = moves(tableau, taus, parts)
            assert rows.shape == (3, tableau.stages + 2, 4)
            for row, tau in zip(rows, taus, strict=True):
                opening, merged, *inner, closing = row
                run = [opening, *inner, merged, *inner, merged, *inner, closing]
                order = [(name, move[k * parts : (k + 1) * parts]) for move in run
                         for k, name in enumerate("BA") if move[k * parts]]  # fmt: skip
                exact = joined(substeps(tableau, tau, 3))
                assert [name for name, _ in order] == [name for name, _ in exact]
                for (_, found), (_, c) in zip(order, exact, strict=True):
                    assert found[0] == float(c)
                    assert abs(sum(map(Fraction, found)) - c) <= abs(c) / 2 ** (53 * parts)


def test_kick_drift_product_is_rounded_once_with_its_rest():
    tableau, tau = nh.integrators["srkn_b11"], Fraction(7, 30)
    exact = [c for _, c in joined(substeps(tableau, tau, 2))]
    opening, merged, *inner, _ = moves(tableau, [tau], 1)[0]
    for i, (kick, drift, product, rest) in enumerate([opening, *inner, merged]):
        assert product == float(exact[2 * i] * exact[2 * i + 1])
        left_out = Fraction(kick) * Fraction(drift) - Fraction(product)
        assert abs(Fraction(rest) - left_out) <= abs(left_out) / 2**52


def test_moves_of_a_rounded_method_are_exactly_its_rounded_coefficients():
    tableau, tau = nh.integrators["aba864"], Fraction(1, 3)
    pieces = [(name, Fraction(float(c))) for name, c in substeps(tableau, tau, 1)]
    opening, merged, *inner, closing = moves(tableau, [tau], 2, rounded=True)[0]
    order = [Fraction(part[0]) + Fraction(part[1]) for move in (opening, *inner, merged, *inner, closing)
             for part in (move[:2], move[2:]) if part[0]]  # fmt: skip
    assert order == [c for _, c in joined(pieces * 2)]


def test_callers_changes_of_arrays_do_not_affect_later_runs():
    tableau, sho = nh.integrators["ruth"], nh.systems["sho"]
    settings = {"t_end": Fraction(3), "steps": [6], "samples": 2}
    before = integrate_batch(sho, tableau, **settings)
    moves(tableau, [Fraction(1, 2)], 1)[:] = 9.0
    kept = before.q.copy()
    before.q[:] = before.p[:] = 5.0
    assert np.array_equal(integrate_batch(sho, tableau, **settings).q, kept)


def test_runs_start_with_digits_that_their_summation_keeps():
    """0.3 and 0.4 are no doubles; twice through every arithmetic, so that each follows each other one."""
    settings = {"t_end": Fraction(3), "steps": [6, 7], "samples": 2}
    for how in ({}, {"summation": "plain"}, {"precision": "extended", "summation": "plain"}, {}):
        numerics = Numerics(**how, width=1)
        found = integrate_batch(nh.systems["henon_heiles"], nh.integrators["ruth"], numerics=numerics, **settings)
        for high, low, i, decimal in ((found.q, found.q_low, 0, "0.3"), (found.p, found.p_low, 1, "0.4")):
            first = set(zip(high[:, 0, i].tolist(), low[:, 0, i].tolist(), strict=True))
            rest = float(Fraction(decimal) - Fraction(float(decimal)))
            assert first == {(float(decimal), 0.0 if how == {"summation": "plain"} else rest)}


def test_start_may_be_array_that_cannot_be_written_to():
    start = np.array([[0.25, 0.0, 0.5, 0.0]])
    start.flags.writeable = False
    settings = {"t_end": Fraction(3), "steps": [6], "samples": 2}
    found = integrate_batch(nh.systems["sho"], nh.integrators["ruth"], start=start, **settings)
    assert (found.q[0, 0, 0], found.p[0, 0, 0], found.energy[0]) == (0.25, 0.5, 0.15625)


@pytest.mark.parametrize("samples", [1, 2, 3, 10, 200])
def test_samples_lie_evenly_from_the_first_to_the_last_step(samples):
    steps = np.array([1, 2, 7, 100])
    marks = sample_marks(steps, samples)
    for n, row in zip(steps.tolist(), marks.tolist(), strict=True):
        kept = [m for m in row if m >= 0]
        count = min(max(samples, 2), n + 1)
        assert kept == [k * n // (count - 1) for k in range(count)]
        assert row[len(kept) :] == [-1] * (len(row) - len(kept))
    assert marks.shape[1] == min(max(samples, 2), 101)


@pytest.mark.parametrize("numerics", [Numerics(), Numerics(precision="extended", width=1)])
def test_a_single_sample_is_the_end_of_the_run(numerics):
    """With all that is measured over the steps; a run of one sample did not come back before."""
    steps = {"t_end": Fraction(40), "steps": [100, 1, 17], "numerics": numerics}
    one, two = (integrate_batch(nh.systems["henon_heiles"], nh.integrators["ruth"], samples=n, **steps) for n in (1, 2))
    assert one.marks.tolist() == [[100], [1], [17]]
    for name in ("q", "q_low", "p", "p_low", "energy_error", "block_max", "block_mean"):
        assert np.array_equal(getattr(one, name)[:, 0], getattr(two, name)[:, 1], equal_nan=True)
    for name in ("max_energy_error", "mean_energy_error", "done", "left_at", "evaluations"):
        assert np.array_equal(getattr(one, name), getattr(two, name))
    assert nh.integrate("sho", "ruth", 0.5, t_end=9, samples=1).t.values.tolist() == [9.0]


def test_concurrent_runs_equal_sequential_runs():
    steps = [list(range(20_000 + i, 20_016 + i)) for i in range(8)]

    def errors(count):
        return nh.sweep("sho", "aba864", [500 / n for n in count]).mean_energy_error.values

    one_by_one = [errors(count) for count in steps]
    with ThreadPoolExecutor(4) as pool:
        assert all(map(np.array_equal, pool.map(errors, steps), one_by_one))


# --- Limits of doubles and of counts: overflow beside healthy lanes, denormals, 2^31 steps, the surface limit


HEALTHY = [(0.3, 0.1), (0.05, -0.2), (-0.1, 0.25), (0.2, 0.0), (0.0, 0.3)]
#: Energies that overflow at once, later, or to infinity minus infinity.
OVERFLOWING = [(1e80, 0.0), (0.0, -1e200), (1e308, 1e308), (-3.0, 40.0)]


@pytest.mark.parametrize("settings", [{}, {"precision": "extended"}, {"summation": "plain"}, {"energy": "none"}])
def test_overflow_in_a_lane_leaves_other_lanes_alone(settings, trials):
    """Members that overflow in all places among healthy ones, which have the bits of runs alone."""
    given = {"t_end": 40, "samples": 5, **settings}
    alone = {q0: nh.integrate("henon_heiles", "aba864", 0.5, q0=q0, **given) for q0 in HEALTHY}
    kind, draw = trials("G. overflow beside healthy lanes"), random.Random(str(settings))
    for width in range(6, 12):
        members = [*(draw.choice(OVERFLOWING) for _ in range(width)), *HEALTHY]
        draw.shuffle(members)
        start = {"q0": np.array(members), "p0": [["0", "0.4"]] * len(members)}
        many = nh.ensemble("henon_heiles", "aba864", 0.5, **start, **given)
        for place, q0 in enumerate(members):
            with kind.case((settings, members, place)):
                one = many.isel(member=place)
                assert one.status.item() == ("ok" if q0 in alone else "diverged")
                for name in ("q", "p", "energy_error", "max_energy_error") if q0 in alone else ():
                    np.testing.assert_array_equal(one[name], alone[q0][name], name)


@pytest.mark.parametrize("summation", ["compensated", "plain"])
def test_denormal_states_are_those_of_exact_steps(summation, trials):
    """A product that is denormal is off by 2^-1075; 40 steps of 7 stages have some 20 such moves, sums add no error."""
    kind, tableau = trials("G. denormal numbers"), nh.integrators["aba864"]
    exact = oscillator_state(tableau, mpf(1) / 4, 40)
    for power in (1000, 1022, 1030, 1045, 1060, 1070):
        with kind.case((summation, power)):
            scale = mpf(2) ** -power
            run = nh.integrate("sho", "aba864", 0.25, q0=[2.0**-power], p0=[0.0], t_end=10, summation=summation)
            allowed = 40 * 20 * mpf(2) ** -1074 + mpf(10) ** -12 * scale
            for found, value in zip((run.q[-1, 0], run.p[-1, 0]), exact, strict=True):
                assert abs(mpf(found.item()) - scale * value) <= allowed
            assert run.status.item() == "ok"
            q0 = [[1.0], [2.0**-power]] * 9
            many = nh.ensemble("sho", "aba864", 0.25, q0=q0, p0=[0.0], t_end=10, summation=summation)
            assert (many.q[1::2, -1, 0] == run.q[-1, 0].item()).all()


def test_the_smallest_difference_of_two_states_is_kept():
    """Free motion by 2^-1074 a step, which a processor that flushes denormals to zero would lose."""
    free = spring("free", V=lambda q: 0 * q[0], grad_V=lambda q: (0 * q[0],), energy_scale=1)
    run = nh.integrate(free, "leapfrog", 1, q0=[0.0], p0=[5e-324], t_end=100, samples=101)
    assert run.q[:, 0].values.tolist() == [n * 5e-324 for n in range(101)]


def test_an_energy_error_at_the_limit_has_not_diverged():
    """The limit is the largest error of the run itself, and the next double below it."""
    whole = nh.integrate(spring(), "leapfrog", 0.5, t_end=50, samples=101)
    worst, step = whole.max_energy_error.item(), int(np.abs(whole.energy_error.values).argmax())
    for limit, left in ((worst, 0), (float(np.nextafter(worst, 0)), step), (float(np.nextafter(worst, inf)), 0)):
        system = spring(surface_limit=limit)
        for width in (1, 8):
            found = integrate_batch(
                system, nh.integrators["leapfrog"], t_end=Fraction(50), steps=[100, 50, 100], samples=2,
                numerics=Numerics(width=width),
            )  # fmt: skip
            assert found.left_at[[0, 2]].tolist() == [left, left]
        run = nh.integrate(system, "leapfrog", 0.5, t_end=50)
        assert (run.diverged_at.item(), run.max_energy_error.item()) == (left, inf if left else worst)


@pytest.mark.parametrize("steps", [2**31 - 1, 2**31, 2**31 + 1, 2**32 + 3, 2**53 - 1])
def test_samples_of_more_steps_than_four_bytes_count(steps):
    marks = sample_marks(np.array([steps, 10]), 500)
    assert marks[0].tolist() == [i * steps // 499 for i in range(500)]
    assert marks[1, :11].tolist() == list(range(11))
    assert (marks[1, 11:] == -1).all()
    assert nh.integrators["babs7o7h"].evaluations(np.array([steps])).tolist() == [7 * steps + 1]


def test_steps_of_an_interval_are_its_rounded_quotient(trials):
    """Intervals that are no multiples of the step, at and beside halves, and up to the most steps of a run."""
    kind, draw = trials("G. numbers of steps"), random.Random(3)
    tableau = nh.integrators["leapfrog"]
    for _ in range(300):
        tau = draw.choice((1, 2.0**-20, 0.1)) * draw.uniform(0.5, 2)
        count = draw.choice((0, 1, 10**3, 10**8)) * draw.random() + draw.choice((0, 0.5, 1e-9))
        t_end = draw.choice((f"{tau * count + 1e-9:.17g}", f"{tau * count + 1e-9:.3g}"))
        with kind.case((t_end, tau)):
            whole, rest = divmod(Fraction(t_end), Fraction(tau))
            half = Fraction(tau) / 2
            expected = max(1, whole + (rest > half or (rest == half and whole % 2 == 1)))
            assert steps_of(t_end, tau) == expected
            assert steps_over(np.array([tau]), t_end, tableau).tolist() == [expected]


def test_too_many_steps_are_refused_with_their_number():
    with pytest.raises(nh.NearharmonicError, match=f"would take {2**31} steps, and one run takes at most {MOST_STEPS}"):
        nh.integrate("sho", "ruth", 0.5, t_end=2**30)


@pytest.mark.long
def test_a_run_counts_more_than_2_to_31_steps():
    """A minute: the phase of so many steps is right to their rounding errors, and a carry is never lost."""
    steps = 2**31 + 5
    found = integrate_batch(
        nh.systems["sho"], nh.integrators["leapfrog"], t_end=Fraction(steps, 4), steps=[steps], samples=3,
        numerics=Numerics(width=1, energy="samples"),
    )  # fmt: skip
    assert found.marks.tolist() == [[0, steps // 2, steps]]
    assert (found.steps.item(), found.done.item(), found.left_at.item()) == (steps, steps, 0)
    q, p = oscillator_state(nh.integrators["leapfrog"], mpf(1) / 4, steps)
    # Each step of one kick and one drift by exact coefficients is off by two roundings, and the phase by their sum.
    assert abs(mpf(found.q[0, -1, 0]) - q) < steps * mpf(2) ** -52
    assert abs(mpf(found.p[0, -1, 0]) - p) < steps * mpf(2) ** -52


# --- Growth of rounding errors over 10^10 steps of 16 oscillators on one core


MEMBERS = 16
#: From 10^5 to 10^10 steps.
MARKS = [round(10 ** (k / 4)) for k in range(20, 41)]


def rounding_errors(summation, tau, marks):
    """Root mean squares over members of the relative error of the conserved energy and of the phase at these steps.

    A step of leapfrog, kick first, turns (q sqrt(1 - tau^2 / 4), p) by a fixed angle, so that p^2 + (1 - tau^2 / 4) q^2
    is conserved and exact states are powers of the step matrix.
    """
    amplitudes = np.linspace(0.75, 1.25, MEMBERS)
    start = np.zeros((MEMBERS, 4))
    start[:, 0] = amplitudes
    found = integrate_batch(
        nh.systems["sho"], nh.integrators["leapfrog"], t_end=tau * marks[-1], steps=[marks[-1]] * MEMBERS, samples=2,
        marks=np.tile(np.array([0, *marks]), (MEMBERS, 1)), start=start,
        numerics=Numerics(summation=summation, width=MEMBERS, energy="none"),
    )  # fmt: skip
    assert (found.done == marks[-1]).all()
    h = mpf(tau.numerator) / tau.denominator
    scale, step = mpmath.sqrt(1 - h**2 / 4), oscillator_step(nh.integrators["leapfrog"], h)
    errors = np.empty((len(marks), MEMBERS, 2))
    for i, mark in enumerate(marks):
        q, p = (step**mark * mpmath.matrix([1, 0]))[:]
        for k, amplitude in enumerate(amplitudes.tolist()):
            x, u = (mpf(getattr(found, name)[k, i + 1, 0]) + mpf(getattr(found, name + "_low")[k, i + 1, 0])
                    for name in ("q", "p"))  # fmt: skip
            exact, ours = mpmath.mpc(q * scale, p) * amplitude, mpmath.mpc(x * scale, u)
            errors[i, k] = float((abs(ours / exact)) ** 2 - 1), float(mpmath.arg(ours / exact))
    return np.sqrt((errors**2).mean(axis=1))


def exponents(marks, sizes):
    """Slopes of straight lines through logarithms."""
    return np.polyfit(np.log(marks), np.log(sizes), 1)[0]


@pytest.mark.long
@pytest.mark.parametrize(("summation", "largest"), [("compensated", 0.5), ("plain", 2.0)])
def test_rounding_errors_of_ten_billion_steps_grow_as_their_root(summation, largest, trials):
    """A minute: steps of 1/4 multiply exactly, so that only sums are rounded, with errors of either sign.

    The frequency of an oscillator does not depend on its energy, so that its phase error grows like its energy error.
    16 members have root mean squares to 18 %, and exponents over five decades to 0.05: three times that.
    """
    sizes = rounding_errors(summation, Fraction(1, 4), MARKS)
    with trials("G. 10^10 steps").case(summation):
        assert np.polyfit(np.log(MARKS), np.log(sizes), 1)[0] == pytest.approx([0.5, 0.5], abs=0.15)
        assert (sizes < largest * 2.0**-53 * np.sqrt(MARKS)[:, None]).all()


@pytest.mark.long
@pytest.mark.parametrize("summation", ["compensated", "plain"])
def test_rounding_errors_of_ten_billion_steps_grow_linearly_at_most(summation, trials):
    """A minute: products by a rounded step have a bias, which is below a tenth of a rounding for each step."""
    sizes = rounding_errors(summation, Fraction(0.3), MARKS)
    with trials("G. 10^10 steps").case(summation):
        assert (sizes < 0.1 * 2.0**-53 * np.array(MARKS)[:, None]).all()

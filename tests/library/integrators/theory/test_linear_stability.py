"""Stability gaps against closed forms, values known elsewhere, and a scan of the trace of the step matrix."""

from fractions import Fraction

import pytest
from mpmath import eig, inf, linspace, log, matrix, mpf, nstr, pi, sin, sqrt

import nearharmonic as nh
from nearharmonic.integrators import BENCHMARKED, integrators, plain_integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.theory import oscillator
from nearharmonic_paper.experiments.stability.reductions import KNOWN_LIMITS
from support.methods.ten_methods import EVERY_METHOD, TEN_METHODS
from support.oracles.reference_solutions import oscillator_step


def trace(tableau, tau):
    step = oscillator_step(tableau, mpf(tau))
    return step[0, 0] + step[1, 1]


def symmetric(outer, inner):
    return Tableau(name="symmetric", order=2, first="kick", kick=outer, drift=inner, source="here", digits=30)


@pytest.mark.parametrize("first", ["kick", "drift"])
def test_leapfrog_is_stable_up_to_two_and_never_after(first):
    assert oscillator.stability_gaps(symmetric(("0.5", "0.5"), ("1",)), first=first) == [(2, inf)]


def test_where_the_trace_only_touches_two_no_gap_opens():
    # Two leapfrog steps of half the size: the trace touches -2 at sqrt(8), and leaves [-2, 2] for good at 4.
    assert oscillator.stability_gaps(symmetric(("0.25", "0.5", "0.25"), ("0.5", "0.5"))) == [(4, inf)]


def test_gap_of_two_stages_is_where_its_quadratic_equations_say():
    # Kicks b, 1 - 2b, b and drifts 1/2: with x = tau^2, K12/tau = 1 - x(1 - 2b)/4 and K21/tau has a factor
    # 1 - b x/2; at b = 1/4 these roots, 4/(1 - 2b) and 2/b, meet.
    (start, end), (last, forever) = oscillator.stability_gaps(symmetric(("0.3", "0.4", "0.3"), ("0.5", "0.5")))
    assert abs(start - sqrt(mpf(20) / 3)) < mpf(10) ** -28
    assert abs(end - sqrt(mpf(10))) < mpf(10) ** -28
    assert (last > end, forever) == (True, inf)


def beside(name, edge):
    """A step from ``edge`` that leads past no other edge; None if another one is the same in 30 digits.

    Of methods of order eight and ten some edges are 1e-13 apart, and far out, where the trace is 1e20, some 1e-35.
    """
    edges = sorted(abs(other - edge) for gap in oscillator.stability_gaps(name) for other in gap)
    step = min(edge * mpf(10) ** -14, edges[1] / 4)
    return step if step > edge * mpf(10) ** -28 else None


@EVERY_METHOD
def test_each_edge_is_crossing_of_two_to_twelve_digits(name):
    tableau, gaps = integrators[name], oscillator.stability_gaps(name)
    resolved = [begin for begin, end in gaps if end - begin > begin * mpf(10) ** (2 - tableau.digits)]
    assert oscillator.stability_limit(name) == resolved[0]
    assert gaps[-1][1] == inf
    for start, end in gaps:
        if near := beside(name, start):
            assert abs(trace(tableau, start - near)) < 2 < abs(trace(tableau, start + near))
        if end != inf and (near := beside(name, end)):
            assert abs(trace(tableau, end - near)) > 2 > abs(trace(tableau, end + near))


@pytest.mark.slow
def test_stability_edges_are_distinguished_in_30_digits():
    gaps = {name: oscillator.stability_gaps(name)[:-1] for name in integrators if not integrators[name].implicit}
    assert [name for name in gaps if not all(beside(name, end) for _, end in gaps[name])] == ["sofspa_s35o10"]
    assert all(beside(name, oscillator.stability_limit(name)) for name in gaps)


@pytest.mark.parametrize(("name", "limit"), KNOWN_LIMITS.items())
def test_the_limits_agree_with_those_found_by_another_program(name, limit):
    assert abs(oscillator.stability_limit(name) - mpf(limit)) < mpf("6e-10")  # its tenth digit


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit"), [("bcss_s3", 4.67), ("bcss_s4", 5.35)])
def test_a_gap_that_digits_open_is_no_limit(name, limit):
    """4.67 is what BlackJAX states for BCSS 3; a scan of the trace finds both, and nothing above 2 before."""
    assert float(nh.stability_limit(name)) == pytest.approx(limit, abs=0.01)
    assert oscillator.stability_gaps(name)[0][1] < limit  # the gap is there, and listed
    for tau in linspace(0.01, nh.stability_limit(name), 400):
        step = oscillator_step(integrators[name], tau)
        assert abs(step[0, 0] + step[1, 1]) < 2 + mpf("1e-9")


@EVERY_METHOD
def test_exchanging_roles_changes_no_edge(name):
    # The trace is the same: K12 and K21 change places.
    assert oscillator.stability_gaps(name, first="kick") == oscillator.stability_gaps(name, first="drift")


# Growth, touching points, and runs on both sides of every edge.

#: Steps of the runs beside an edge: the slowest growth there, 2.4e-5 a step, becomes e^48 in the energy.
STEPS = 1_000_000
#: The relative energy error at which a run on the oscillator counts as diverged.
LEFT_AT = nh.systems["sho"].surface_limit


def leapfrogs(count):
    """``count`` leapfrog steps of equal size as one: its trace touches 2 at every resonance inside 2 count."""
    kicks = [Fraction(1, count)] * (count - 1)
    rows = [Fraction(1, 2 * count), *kicks, Fraction(1, 2 * count)], [Fraction(1, count)] * count
    return symmetric(*(tuple(str(float(x)) for x in row) for row in rows))


@pytest.mark.parametrize("count", [2, 4, 8])
def test_leapfrogs_in_row_touch_at_their_resonances_and_never_cross(count):
    # A leapfrog step h turns by theta with sin(theta / 2) = h / 2: count of them make half turns at k pi.
    expected = [2 * count * sin(k * mpf(pi) / (2 * count)) for k in range(1, count)]
    assert oscillator.stability_gaps(leapfrogs(count)) == [(2 * count, inf)]
    assert all(
        abs(a - b) < mpf(10) ** -27 for a, b in zip(oscillator.touching_points(leapfrogs(count)), expected, strict=True)
    )


@EVERY_METHOD
def test_no_registered_method_touches_without_crossing(name):
    assert oscillator.touching_points(name) == []


@EVERY_METHOD
def test_the_growth_is_the_logarithm_of_the_larger_eigenvalue(name):
    for start, end in oscillator.stability_gaps(name):
        tau = start * mpf("1.1") if end == inf else (start + end) / 2
        largest = max(abs(x) for x in eig(oscillator_step(integrators[name], tau), left=False, right=False))
        assert abs(oscillator.growth_rate(name, tau) - log(largest)) < mpf(10) ** -20 * (1 + log(largest))
        near = beside(name, start)
        assert near is None or oscillator.growth_rate(name, start - near) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] * (name not in TEN_METHODS)) for name in plain_integrators]
)
def test_no_growth_in_a_gap_exceeds_the_largest(name):
    for gap in oscillator.stability_gaps(name):
        found, (start, end) = oscillator.largest_growth(name, gap), gap
        last = 4 * found.at_time if end == inf else end
        rates = [(oscillator.growth_rate(name, tau), tau) for tau in linspace(start, last, 400)]
        in_time = max(rate / tau for rate, tau in rates)
        # A maximum lies at most half a spacing, 1/800 of the gap, off the grid, where the curve is flat or steep as a
        # root: the grid falls short by less than 1 %, and never exceeds.
        assert found.per_time * mpf("0.99") < in_time <= found.per_time * (1 + mpf(10) ** -10)
        if end == inf:
            assert (found.per_step, found.at) == (inf, inf)
        else:
            in_step = max(rate for rate, _ in rates)
            assert found.per_step * mpf("0.99") < in_step <= found.per_step * (1 + mpf(10) ** -10)


def left_at(tableau, tau):
    """The first step from (1, 0) at which |H/H0 - 1| exceeds a million, by doubling and bisection of matrix powers."""
    step = oscillator_step(tableau, tau)

    def outside(n):
        q, p = step**n * matrix([1, 0])
        return abs(q * q + p * p - 1) > LEFT_AT

    low, high = 0, 1
    while not outside(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if outside(middle) else (middle, high)
    return high


def beside_edges(name):
    """(just stable, just unstable) step sizes at each edge: a thousandth of the narrower neighbour away from it."""
    edges = [edge for gap in oscillator.stability_gaps(name) for edge in gap if edge != inf]
    for i, edge in enumerate(edges):
        below = edge - (edges[i - 1] if i else 0)
        above = edges[i + 1] - edge if i + 1 < len(edges) else edge
        away = min(below, above) / 1000
        opens = i % 2 == 0
        yield (edge - away, edge + away) if opens else (edge + away, edge - away)


@pytest.mark.slow
@pytest.mark.parametrize("name", BENCHMARKED)
def test_runs_on_both_sides_of_every_edge_confirm_it(name):
    """Rounding moves an edge by 1e-16 times the size of the step's operators, below 1e-12; runs keep 5e-9 away."""
    for stable, unstable in beside_edges(name):
        runs = {tau: nh.sweep("sho", name, [float(tau)], t_end=nstr(tau * STEPS, 30)) for tau in (stable, unstable)}
        assert runs[stable].steps.item() == runs[unstable].steps.item() == STEPS
        # A stable ellipse can be so eccentric that it passes the limit: the closed form knows.
        bound = oscillator.harmonic_energy_error(name, stable)
        if bound < LEFT_AT:
            assert runs[stable].status.item() == "ok"
            assert 0.99 * bound < runs[stable].max_energy_error.item() < 1.0001 * bound
        assert runs[unstable].status.item() == "diverged"
        # Rounded coefficients change the growth by a few parts in 1e6 at this distance from the edge.
        expected = left_at(integrators[name], unstable)
        assert abs(runs[unstable].diverged_at.item() - expected) <= 1 + 1e-4 * expected
